//! Differential wheeled movement: what both wheels do for a while.

use crate::codec::Message;
use crate::encoders::EncodersSpan;
use crate::motion::{self, Motion, Wheels};
use crate::navigator::{NavigatorData, NavigatorSpan, Pose, Twist};
use crate::sides::{Symmetric, same_time};
use crate::{
    Metres, MetresPerSecond, MetresPerSecondSquared, Radians, RadiansPerSecond, Refusal, Seconds, Sides,
};
use serde::{Deserialize, Serialize};

/// The fastest wheel Axle believes in, m/s; whatever asks for more is refused before anything is computed.
pub const MAX_WHEEL_SPEED: f64 = 20.0;
/// The longest movement that one [`Dwm`] may describe, s.
pub const MAX_DURATION: f64 = 3600.0;

/// The distance between the contact points of the wheels, in metres: finite and positive.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(try_from = "Metres", into = "Metres")]
pub struct Track(f64);

impl Track {
    /// A checked track.
    ///
    /// # Errors
    /// Refuses what is not between 1 mm and 100 m.
    pub fn new(track: Metres) -> Result<Self, Refusal> {
        crate::refusal::within("track in metres", track.0, 1e-3, 100.0)?;
        Ok(Self(track.0))
    }
    /// The distance in metres.
    #[must_use]
    pub const fn get(self) -> f64 {
        self.0
    }
}
impl TryFrom<Metres> for Track {
    type Error = Refusal;
    fn try_from(track: Metres) -> Result<Self, Refusal> {
        Self::new(track)
    }
}
impl From<Track> for Metres {
    fn from(track: Track) -> Self {
        Self(track.0)
    }
}

/// A differential wheeled movement: the speeds of the wheels at its start and end, and its duration.
///
/// Each wheel has a constant acceleration in between, which is a fair model of a real motor (paper, section I.A).
/// Constructed values are finite, and the duration is not negative; a duration of 0 moves nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "DwmWire", into = "DwmWire")]
pub struct Dwm {
    start: Sides<MetresPerSecond>,
    end: Sides<MetresPerSecond>,
    duration: Seconds,
}

/// One wheel of a [`Dwm`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DwmHalf {
    /// Speed at the start.
    pub v0: MetresPerSecond,
    /// Speed at the end.
    pub v1: MetresPerSecond,
    /// How long it takes.
    #[serde(rename = "T")]
    pub duration: Seconds,
}

/// The five numbers of the paper, by their names there.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct DwmWire {
    v0l: MetresPerSecond,
    v0r: MetresPerSecond,
    v1l: MetresPerSecond,
    v1r: MetresPerSecond,
    #[serde(rename = "T")]
    duration: Seconds,
}

impl TryFrom<DwmWire> for Dwm {
    type Error = Refusal;
    fn try_from(wire: DwmWire) -> Result<Self, Refusal> {
        Self::new(Sides::new(wire.v0l, wire.v0r), Sides::new(wire.v1l, wire.v1r), wire.duration)
    }
}
impl From<Dwm> for DwmWire {
    fn from(dwm: Dwm) -> Self {
        Self {
            v0l: dwm.start.left,
            v0r: dwm.start.right,
            v1l: dwm.end.left,
            v1r: dwm.end.right,
            duration: dwm.duration,
        }
    }
}

impl Dwm {
    /// A movement from wheel speeds `start` to wheel speeds `end` within `duration`.
    ///
    /// # Errors
    /// Refuses numbers that are not finite and a negative duration.
    pub fn new(
        start: Sides<MetresPerSecond>,
        end: Sides<MetresPerSecond>,
        duration: Seconds,
    ) -> Result<Self, Refusal> {
        for (name, speed) in
            [("v0l", start.left), ("v0r", start.right), ("v1l", end.left), ("v1r", end.right)]
        {
            if !speed.is_finite() {
                return Err(Refusal::out_of_range(format!("wheel speed {name}"), speed, "finite numbers"));
            }
        }
        if !(duration.is_finite() && duration.0 >= 0.0) {
            return Err(Refusal::out_of_range("duration T of a DWM", duration, "0 s or more"));
        }
        Ok(Self { start, end, duration })
    }
    /// A movement at constant speeds.
    ///
    /// # Errors
    /// As [`Dwm::new`].
    pub fn steady(speeds: Sides<MetresPerSecond>, duration: Seconds) -> Result<Self, Refusal> {
        Self::new(speeds, speeds, duration)
    }
    /// No movement, for `duration`; a negative or non-finite duration counts as 0.
    #[must_use]
    pub const fn rest(duration: Seconds) -> Self {
        let nothing = Sides::new(MetresPerSecond::ZERO, MetresPerSecond::ZERO);
        // `max` also turns NaN into 0; an infinite rest is cut to the longest movement.
        Self { start: nothing, end: nothing, duration: Seconds(duration.0.max(0.0).min(MAX_DURATION)) }
    }
    /// Wheel speeds at the start.
    #[must_use]
    pub const fn start(&self) -> Sides<MetresPerSecond> {
        self.start
    }
    /// Wheel speeds at the end.
    #[must_use]
    pub const fn end(&self) -> Sides<MetresPerSecond> {
        self.end
    }
    /// How long the movement lasts.
    #[must_use]
    pub const fn duration(&self) -> Seconds {
        self.duration
    }
    /// The wheels apart.
    #[must_use]
    pub fn halves(&self) -> Sides<DwmHalf> {
        self.start.zip(self.end, |v0, v1| DwmHalf { v0, v1, duration: self.duration })
    }
    /// Two wheels together.
    ///
    /// # Errors
    /// As [`Dwm::new`], and when the durations differ.
    pub fn from_halves(halves: Sides<DwmHalf>) -> Result<Self, Refusal> {
        let Sides { left, right } = halves;
        same_time("duration", left.duration, right.duration)?;
        Self::new(Sides::new(left.v0, right.v0), Sides::new(left.v1, right.v1), left.duration)
    }
    /// Wheel speeds `t` after the start; `t` is clamped to the movement.
    #[must_use]
    pub fn speeds_at(&self, t: Seconds) -> Sides<MetresPerSecond> {
        if t.0 >= self.duration.0 {
            return self.end;
        }
        let share = (t.0 / self.duration.0).max(0.0);
        self.start.zip(self.end, |v0, v1| v0 + (v1 - v0) * share)
    }
    /// Signed distance of each wheel `t` after the start; `t` is clamped to the movement.
    #[must_use]
    pub fn distances_at(&self, t: Seconds) -> Sides<Metres> {
        let t = Seconds(t.0.clamp(0.0, self.duration.0));
        self.start.zip(self.speeds_at(t), |v0, v| Metres((v0.0 + v.0) / 2.0 * t.0))
    }
    /// Acceleration of each wheel; 0 for a movement without duration.
    #[must_use]
    pub fn accelerations(&self) -> Sides<MetresPerSecondSquared> {
        if self.duration.0 > 0.0 {
            self.start.zip(self.end, |v0, v1| (v1 - v0) / self.duration)
        } else {
            Sides::default()
        }
    }
    /// The largest absolute wheel speed within the movement.
    #[must_use]
    pub fn peak_speed(&self) -> MetresPerSecond {
        let [a, b] = self.start.both();
        let [c, d] = self.end.both();
        a.abs().max(b.abs()).max(c.abs()).max(d.abs())
    }
    /// What encoders would count: exact (model.md, 4.3).
    #[must_use]
    pub fn encoders_span(&self) -> EncodersSpan {
        let Sides { left, right } = self.distances_at(self.duration);
        EncodersSpan { duration: self.duration, left, right }
    }
    /// Where the robot is `t` after the start, in the frame of its start: exact for every shape (model.md, 3.2).
    #[must_use]
    pub fn motion_at(&self, track: Track, t: Seconds) -> Motion {
        self.wheels(track).at(t.0)
    }
    /// The displacement of the whole movement.
    #[must_use]
    pub fn navigator_span(&self, track: Track) -> NavigatorSpan {
        let motion = self.wheels(track).end();
        NavigatorSpan {
            duration: self.duration,
            x: Metres(motion.x),
            y: Metres(motion.y),
            heading: Radians(motion.theta),
        }
    }
    /// The pose `t` after the start, when the movement starts at `from`.
    #[must_use]
    pub fn pose_at(&self, from: Pose, track: Track, t: Seconds) -> Pose {
        let motion = self.motion_at(track, t);
        from.moved(Metres(motion.x), Metres(motion.y), Radians(motion.theta))
    }
    /// The states of a robot that makes the movement from `from` on, for a chart: at its start, at its end, and in
    /// equal parts of at most `step` between; at most a million parts. A step that is not above 0 asks for no parts.
    ///
    /// Each pose is exact, since it is computed from the start and not from the pose before it.
    pub fn poses(
        &self,
        from: NavigatorData,
        track: Track,
        step: Seconds,
    ) -> impl Iterator<Item = NavigatorData> + use<> {
        let dwm = *self;
        let wanted = (dwm.duration.0 / step.0).ceil();
        let parts = if step.0 > 0.0 { wanted.clamp(1.0, 1e6) } else { 1.0 };
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 1 to a million"
        )]
        let last = if dwm.duration.0 > 0.0 { parts as u32 } else { 0 };
        (0..=last).map(move |part| {
            let t =
                if part == last { dwm.duration } else { dwm.duration * (f64::from(part) / f64::from(last)) };
            let motion = dwm.motion_at(track, t);
            let twist = Twist { v: MetresPerSecond(motion.v), omega: RadiansPerSecond(motion.omega) };
            let pose = from.pose.moved(Metres(motion.x), Metres(motion.y), Radians(motion.theta));
            NavigatorData { stamp: from.stamp + t, pose, twist: Some(twist), covariance: None }
        })
    }
    /// The name of the curve that is driven; a label, never a switch of the numerics.
    #[must_use]
    pub fn shape(&self, track: Track) -> motion::Shape {
        motion::shape(&self.wheels(track))
    }

    /// The raw numbers, for the routines of [`motion`].
    #[must_use]
    pub const fn wheels(&self, track: Track) -> Wheels {
        Wheels {
            v0l: self.start.left.0,
            v0r: self.start.right.0,
            v1l: self.end.left.0,
            v1r: self.end.right.0,
            duration: self.duration.0,
            track: track.get(),
        }
    }
}

/// Where each movement ends, in the frame of its start: fills `ends` in the order of `movements`, as far as both reach.
///
/// Nothing is allocated, so that a caller may give each of its threads a part of both.
pub fn fill_ends(movements: &[Dwm], track: Track, ends: &mut [Motion]) {
    for (movement, end) in movements.iter().zip(ends) {
        *end = movement.wheels(track).end();
    }
}

impl Symmetric for Dwm {
    type Half = DwmHalf;
    fn split(self) -> Sides<DwmHalf> {
        self.halves()
    }
    fn join(halves: Sides<DwmHalf>) -> Result<Self, Refusal> {
        Self::from_halves(halves)
    }
}

impl Message for Dwm {
    const NAME: &'static str = "Dwm";
    const LIMIT: usize = 256;
}

/// The same five numbers, but an unknown key is refused: what reaches the wheels must not carry a misspelt limit.
pub(crate) mod strict {
    use super::{Dwm, DwmWire, MetresPerSecond, Seconds};
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize as _, Serializer};

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Strict {
        v0l: MetresPerSecond,
        v0r: MetresPerSecond,
        v1l: MetresPerSecond,
        v1r: MetresPerSecond,
        #[serde(rename = "T")]
        duration: Seconds,
    }

    pub(crate) fn serialize<S: Serializer>(dwm: &Dwm, to: S) -> Result<S::Ok, S::Error> {
        dwm.serialize(to)
    }
    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Dwm, D::Error> {
        let Strict { v0l, v0r, v1l, v1r, duration } = Strict::deserialize(from)?;
        Dwm::try_from(DwmWire { v0l, v0r, v1l, v1r, duration }).map_err(D::Error::custom)
    }
}
