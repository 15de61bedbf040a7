//! A run: what the lines of one file tell, put one after the other.
//!
//! What is relative (movements, geometries, spans) goes on where the last line ended. What is absolute (poses, readings)
//! is taken as it is.

use crate::chart::WheelPoint;
use crate::lines::{curve, read, track, words};
use axle_schema::motion::{Motion, arc};
use axle_schema::{
    Dwm, EncodersData, EncodersSpan, Metres, NavigatorData, NavigatorSpan, Pose, Radians, Seconds, Sides,
    Symmetric as _, Track,
};
use serde::Deserialize;
use serde_json::Value;

/// The most points that are kept of one line of the chart; when there are more, every second one is forgotten.
const MOST: usize = 400_000;
/// A curve turns by no more than this from one point to the next, in radians.
const TURN: f64 = 0.05;
/// The fewest and the most points of one movement.
const PARTS: [f64; 2] = [16.0, 20_000.0];

/// What was told so far.
pub(super) struct Run {
    /// The distance between the wheels where a line does not tell it.
    track: Option<f64>,
    pose: Pose,
    time: f64,
    covered: Sides<f64>,
    /// The first of the poses that belong together, and the pose and the time at which they begin.
    poses: Option<(NavigatorData, Pose, f64)>,
    reading: Option<EncodersData>,
    path: Vec<(f64, f64)>,
    distances: Vec<WheelPoint>,
    speeds: Vec<WheelPoint>,
}

/// A state as `axle convert dwm pose` writes it.
#[derive(Deserialize)]
struct State {
    x: Metres,
    y: Metres,
    theta: Radians,
}

/// When a movement is looked at; the other fields of the line are those of the movement.
#[derive(Deserialize)]
struct When {
    t: Option<Seconds>,
}

impl Run {
    pub(super) const fn new(track: Option<f64>) -> Self {
        Self {
            track,
            pose: Pose::new(0.0, 0.0, 0.0),
            time: 0.0,
            covered: Sides::new(0.0, 0.0),
            poses: None,
            reading: None,
            path: Vec::new(),
            distances: Vec::new(),
            speeds: Vec::new(),
        }
    }
    /// Where the robot went.
    pub(super) fn path(&self) -> &[(f64, f64)] {
        &self.path
    }
    /// How far the wheels have come since the beginning.
    pub(super) fn distances(&self) -> &[WheelPoint] {
        &self.distances
    }
    /// How fast they were.
    pub(super) fn speeds(&self) -> &[WheelPoint] {
        &self.speeds
    }

    /// Takes a line; what it is, its fields tell.
    pub(super) fn line(&mut self, value: &Value) -> Result<(), String> {
        let has = |field: &str| value.get(field).is_some();
        let side_has = |field: &str| value["left"].get(field).is_some();
        let track = || track(value, self.track);
        if has("v0l") {
            self.movement(read(value)?, read::<When>(value)?.t, track()?)
        } else if side_has("v0") {
            self.movement(Dwm::join(read(value)?).map_err(words)?, None, track()?)
        } else if side_has("stamp") {
            self.reading(EncodersData::join(read(value)?).map_err(words)?, track()?)
        } else if side_has("duration") {
            self.span(EncodersSpan::join(read(value)?).map_err(words)?, track()?)
        } else if has("pose") {
            self.measured(read(value)?, track().ok())
        } else if has("theta") {
            self.state(&read(value)?)
        } else if has("heading") {
            self.displacement(&read(value)?)
        } else if has("stamp") {
            self.reading(read(value)?, track()?)
        } else if has("duration") {
            self.span(read(value)?, track()?)
        } else if ["line", "turn", "arc", "spiral", "clothoid"].into_iter().any(has) {
            self.geometry(value)
        } else {
            Err("nothing that can be drawn; `axle convert --map` shows the fields of everything that can"
                .into())
        }
    }

    /// The movement goes on from here, until `t` where that is given.
    fn movement(&mut self, dwm: Dwm, t: Option<Seconds>, track: Track) -> Result<(), String> {
        let whole = dwm.duration();
        let t = t.unwrap_or(whole);
        axle_schema::refusal::within("t in s", t.0, 0.0, whole.0).map_err(words)?;
        let dwm = Dwm::new(dwm.start(), dwm.speeds_at(t), t).map_err(words)?;
        let (began, covered) = (self.time, self.covered);
        self.trace(&dwm, track)?;
        self.wheels(began, covered);
        self.speeds_are(began, dwm.start().map(|speed| speed.0));
        for t in times(&dwm, track) {
            let Sides { left, right } = dwm.distances_at(t);
            self.wheels(began + t.0, Sides::new(covered.left + left.0, covered.right + right.0));
        }
        self.speeds_are(began + t.0, dwm.end().map(|speed| speed.0));
        Ok(())
    }

    /// A geometry has no speeds and no time; every track draws the same path.
    fn geometry(&mut self, value: &Value) -> Result<(), String> {
        let track = Track::new(Metres(1.0)).map_err(words)?;
        let dwm = curve(value)?.normalized_dwm(track).map_err(words)?;
        self.trace(&dwm, track)
    }

    /// Draws the way of a movement.
    fn trace(&mut self, dwm: &Dwm, track: Track) -> Result<(), String> {
        let from = self.pose;
        self.moved(from, dwm.motion_at(track, dwm.duration()))?;
        self.pose = from;
        self.here();
        for t in times(dwm, track) {
            self.moved(from, dwm.motion_at(track, t))?;
            self.here();
        }
        Ok(())
    }

    fn moved(&mut self, from: Pose, Motion { x, y, theta, .. }: Motion) -> Result<(), String> {
        self.pose = finite(from.moved(Metres(x), Metres(y), Radians(theta)))?;
        Ok(())
    }

    /// The wheels drove an arc.
    fn span(&mut self, span: EncodersSpan, track: Track) -> Result<(), String> {
        let EncodersSpan { duration, left: Metres(left), right: Metres(right) } = span;
        let (from, began, covered) = (self.pose, self.time, self.covered);
        finite(after_arc(from, left, right, track))?;
        self.here();
        self.wheels(began, covered);
        let parts = parts((right - left).abs() / track.get(), 1.0);
        for part in 1..=parts {
            let share = f64::from(part) / f64::from(parts);
            self.pose = after_arc(from, left * share, right * share, track);
            self.here();
        }
        self.wheels(began + duration.0, Sides::new(covered.left + left, covered.right + right));
        Ok(())
    }

    /// A reading of the encoders: from the one before to this one the wheels drove an arc.
    fn reading(&mut self, data: EncodersData, track: Track) -> Result<(), String> {
        let last = self.reading.unwrap_or(data);
        let (left, right) = (data.left - last.left, data.right - last.right);
        self.span(EncodersSpan { duration: data.stamp - last.stamp, left, right }, track)?;
        self.reading = Some(data);
        Ok(())
    }

    /// The robot is somewhere else, by a straight line as far as is known.
    fn displacement(&mut self, span: &NavigatorSpan) -> Result<(), String> {
        let pose = finite(self.pose.moved(span.x, span.y, span.heading))?;
        self.here();
        self.pose = pose;
        self.time += span.duration.0;
        self.here();
        Ok(())
    }

    fn state(&mut self, state: &State) -> Result<(), String> {
        self.pose = finite(Pose { x: state.x, y: state.y, heading: state.theta })?;
        self.here();
        Ok(())
    }

    /// A pose with a stamp. One that is the very first one again begins anew, and then it goes on from where the robot
    /// is: so the poses of several movements, each of which begins at 0, are one path as the movements are.
    fn measured(&mut self, data: NavigatorData, track: Option<Track>) -> Result<(), String> {
        let (first, from, began) = match self.poses {
            None => (data, data.pose, self.time),
            Some((first, ..)) if first.pose == data.pose && first.stamp == data.stamp => {
                (first, self.pose, self.time)
            }
            Some(known) => known,
        };
        let seen = data.pose.seen_from(first.pose);
        // Where nothing was begun anew the pose is taken as it is, to the last digit.
        let pose = if from == first.pose { data.pose } else { from.moved(seen.x, seen.y, seen.heading) };
        self.pose = finite(pose)?;
        self.poses = Some((first, from, began));
        self.time = began + (data.stamp - first.stamp).0;
        self.here();
        if let (Some(twist), Some(track)) = (data.twist, track) {
            self.speeds_are(self.time, twist.wheel_speeds(track).map(|speed| speed.0));
        }
        Ok(())
    }

    fn here(&mut self) {
        keep(&mut self.path, (self.pose.x.0, self.pose.y.0));
    }
    fn wheels(&mut self, time: f64, covered: Sides<f64>) {
        (self.time, self.covered) = (time, covered);
        keep(&mut self.distances, WheelPoint { time, left: covered.left, right: covered.right });
    }
    fn speeds_are(&mut self, time: f64, speeds: Sides<f64>) {
        keep(&mut self.speeds, WheelPoint { time, left: speeds.left, right: speeds.right });
    }
}

fn keep<T>(list: &mut Vec<T>, item: T) {
    if list.len() >= MOST {
        let mut odd = false;
        list.retain(|_| {
            odd = !odd;
            odd
        });
    }
    list.push(item);
}

/// The times at which a movement is drawn, after its start.
fn times(dwm: &Dwm, track: Track) -> impl Iterator<Item = Seconds> + use<> {
    let turning = |speeds: Sides<axle_schema::MetresPerSecond>| (speeds.right - speeds.left).0.abs();
    let turn = (turning(dwm.start()) + turning(dwm.end())) / 2.0 / track.get() * dwm.duration().0;
    let (parts, whole) = (parts(turn, PARTS[0]), dwm.duration());
    (1..=parts).map(
        move |part| {
            if part == parts { whole } else { whole * (f64::from(part) / f64::from(parts)) }
        },
    )
}

/// In how many parts a turn is drawn.
fn parts(turn: f64, fewest: f64) -> u32 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 20 000")]
    let parts = (turn / TURN).ceil().clamp(fewest, PARTS[1]) as u32;
    parts.max(1)
}

fn after_arc(from: Pose, left: f64, right: f64, track: Track) -> Pose {
    let (x, y, heading) = arc(left, right, track.get());
    from.moved(Metres(x), Metres(y), Radians(heading))
}

fn finite(pose: Pose) -> Result<Pose, String> {
    let is_finite = pose.x.is_finite() && pose.y.is_finite() && pose.heading.is_finite();
    if is_finite { Ok(pose) } else { Err("the result is beyond the range of f64".into()) }
}
