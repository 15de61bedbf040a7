//! A recording: the plan, where the robot was and where it believed to be, and what its wheels did, were asked for and
//! were given.

use crate::chart::{Panel, PathSeries, WheelPoint, Wheels};
use crate::path::of_plan;
use crate::unread::Unread;
use axle_recorder::{Entry, Recorded, Recording};
use axle_schema::codec::decode_as;
use axle_schema::command::Command;
use axle_schema::task::CorrectorProgress;
use axle_schema::{EncodersData, NavigatorData, Plan, Refusal, Sides, Signals, Task, WayTask, key};
use std::collections::VecDeque;
use std::path::Path;

/// The most samples of one stream that are kept: an hour at 100 Hz.
const MOST: usize = 400_000;

/// What was said about one robot.
#[derive(Default)]
pub(super) struct Heard {
    planned: Vec<(f64, f64)>,
    truth: Vec<(f64, f64)>,
    estimate: Vec<(f64, f64)>,
    /// The points that the robot was sent to.
    pub(super) way_points: Vec<(f64, f64)>,
    /// What was due, and what the encoders measured.
    pub(super) wheels: Wheels,
    /// The robot's clock at the first beat of a corrector.
    began: Option<f64>,
    /// The robot's clock at the newest reading, and the readings of the last moments.
    clock: f64,
    readings: VecDeque<EncodersData>,
    speeds: Vec<WheelPoint>,
    asked: Vec<WheelPoint>,
    errors: Vec<WheelPoint>,
    signals: Vec<WheelPoint>,
    /// Positions with their covariance: x, y, and the variances and covariance of both.
    beliefs: Vec<[f64; 5]>,
    robot: Option<String>,
}

/// Speeds are taken over so many readings: less would show the grain of the encoders, not the wheels.
const SMOOTH: usize = 6;
/// So many ellipses are drawn, each of so many points; 95 % of a plane's Gaussian lie within the root of this.
const ELLIPSES: (usize, u32) = (14, 48);
const NINETY_FIVE: f64 = 5.991;

impl Heard {
    /// Reads a recording to its end, which may be where a crash cut it off.
    pub(super) fn read(path: &Path, complain: &dyn Fn(&str)) -> anyhow::Result<Self> {
        let mut recording = Recording::open(path)?;
        let (mut heard, mut unread) = (Self::default(), Unread::default());
        for entry in recording.by_ref() {
            let Entry::Sample(sample) = entry else { continue };
            if let Err(refusal) = heard.sample(&sample) {
                unread.add(&sample.key, &refusal);
            }
        }
        let account = recording.account();
        if let Some(why) = &account.cut {
            complain(&format!("the recording is cut off: {why}"));
        }
        if account.damaged > 0 {
            complain(&format!("{} chunks or records are damaged and were left out", account.damaged));
        }
        if let Some(words) = unread.words() {
            complain(&words);
        }
        Ok(heard)
    }

    fn sample(&mut self, sample: &Recorded) -> Result<(), Refusal> {
        let Some(place) = key::place(&sample.key) else { return Ok(()) };
        // A chart is about one robot: the first that says where it is.
        if self.robot.as_deref().is_some_and(|robot| robot != place.robot) {
            return Ok(());
        }
        match (place.service, place.name) {
            ("emulator", "truth") => keep(&mut self.truth, position(sample)?),
            ("navigator", "pose") => {
                keep(&mut self.estimate, position(sample)?);
                self.believe(&read(sample)?);
            }
            ("robot", "encoders") => self.reading(read(sample)?),
            ("robot", "signals") => {
                let Signals { left, right } = read(sample)?;
                self.wheel(self.clock, Sides::new(left.get(), right.get()), |heard| &mut heard.signals);
            }
            ("gate", "command") => {
                let Command { echo, dwm, .. } = read(sample)?;
                let speeds = dwm.start().map(|speed| speed.0);
                self.wheel(f64::from(echo.0) / 1e3, speeds, |heard| &mut heard.asked);
            }
            ("pilot", "way") => {
                let Task { plan, .. } = read::<Task<WayTask>>(sample)?;
                self.way_points.extend(plan.points.iter().map(|point| (point.x.0, point.y.0)));
            }
            ("pilot", "plan") => {
                let Task { plan, .. } = read::<Task<Plan>>(sample)?;
                self.planned.extend(of_plan(&plan));
            }
            (corrector, "progress") if corrector.ends_with("-corrector") => self.beat(&read(sample)?),
            _ => return Ok(()),
        }
        self.robot.get_or_insert_with(|| place.robot.to_owned());
        Ok(())
    }

    fn beat(&mut self, beat: &CorrectorProgress) {
        let time = beat.stamp.0 - *self.began.get_or_insert(beat.stamp.0);
        if let (Some(due), Some(real)) = (beat.due, beat.real) {
            let error = Sides::new(due.left.0 - real.left.0, due.right.0 - real.right.0);
            self.wheel(beat.stamp.0, error, |heard| &mut heard.errors);
        }
        let lists = [(&mut self.wheels.due, beat.due), (&mut self.wheels.real, beat.real)];
        for (list, distances) in lists {
            if let Some(Sides { left, right }) = distances {
                keep(list, WheelPoint { time, left: left.0, right: right.0 });
            }
        }
    }

    /// A reading: the speeds since a moment ago.
    fn reading(&mut self, data: EncodersData) {
        self.clock = data.stamp.0;
        self.readings.push_back(data);
        while self.readings.len() > SMOOTH {
            self.readings.pop_front();
        }
        let Some(first) = self.readings.front().copied() else { return };
        let seconds = data.stamp.0 - first.stamp.0;
        if seconds > 0.0 {
            let speeds =
                [data.left.0 - first.left.0, data.right.0 - first.right.0].map(|covered| covered / seconds);
            let middle = first.stamp.0 + seconds / 2.0;
            self.wheel(middle, Sides::new(speeds[0], speeds[1]), |heard| &mut heard.speeds);
        }
    }

    /// Keeps something of both wheels, if a corrector drives already.
    fn wheel(&mut self, clock: f64, sides: Sides<f64>, list: fn(&mut Self) -> &mut Vec<WheelPoint>) {
        let Some(began) = self.began else { return };
        let Sides { left, right } = sides;
        keep(list(self), WheelPoint { time: clock - began, left, right });
    }

    fn believe(&mut self, data: &NavigatorData) {
        if let Some(covariance) = data.covariance {
            let [xx, xy, _, _, yy, ..] = covariance.0;
            keep(&mut self.beliefs, [data.pose.x.0, data.pose.y.0, xx, xy, yy]);
        }
    }

    /// Some ellipses along the way, in which the robot was with 95 %, as far as it knew.
    pub(super) fn ellipses(&self) -> Vec<Vec<(f64, f64)>> {
        let step = self.beliefs.len().div_ceil(ELLIPSES.0).max(1);
        self.beliefs.iter().rev().step_by(step).map(|belief| ellipse(*belief)).collect()
    }

    /// How fast the wheels were.
    pub(super) fn speeds(&self) -> &[WheelPoint] {
        &self.speeds
    }

    /// What is drawn below the paths: distances, and what there is of errors, speeds and signals.
    pub(super) fn panels(&self) -> Vec<Panel> {
        let sides = |names: [&'static str; 2], inks: [usize; 2], points: &[WheelPoint]| {
            let left = points.iter().map(|point| (point.time, point.left)).collect();
            let right = points.iter().map(|point| (point.time, point.right)).collect();
            [(names[0], inks[0], left), (names[1], inks[1], right)]
        };
        let mut panels = vec![Panel::due_and_real(&self.wheels)];
        if !self.errors.is_empty() {
            let lines = sides(["left wheel", "right wheel"], [1, 2], &self.errors);
            panels.push(Panel::of_lines("due less real (m)", lines.into()));
        }
        if !self.asked.is_empty() || !self.speeds.is_empty() {
            let asked = sides(["left wheel, asked", "right wheel, asked"], [6, 5], &self.asked);
            let real = sides(["left wheel, real", "right wheel, real"], [1, 2], &self.speeds);
            panels.push(Panel::of_lines("wheel speed (m/s)", asked.into_iter().chain(real).collect()));
        }
        if !self.signals.is_empty() {
            let lines = sides(["left motor", "right motor"], [1, 2], &self.signals);
            panels.push(Panel::of_lines("signal (share of full)", lines.into()));
        }
        panels
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.planned.is_empty() && self.truth.is_empty() && self.estimate.is_empty()
    }

    /// As the demo draws them.
    pub(super) fn paths(&self) -> Vec<PathSeries> {
        let paths = [
            PathSeries::planned(self.planned.clone()),
            PathSeries::driven(self.truth.clone()),
            PathSeries::estimated(self.estimate.clone()),
        ];
        paths.into_iter().filter(|path| !path.points.is_empty()).collect()
    }

    /// Where the robot was, as well as that is known.
    pub(super) fn path(&self) -> &[(f64, f64)] {
        [&self.truth, &self.estimate].into_iter().find(|path| !path.is_empty()).unwrap_or(&self.planned)
    }
}

/// The points of an ellipse around a position with these variances.
fn ellipse([x, y, xx, xy, yy]: [f64; 5]) -> Vec<(f64, f64)> {
    // Cholesky: a circle becomes the ellipse. What is not positive by rounding is taken for nothing.
    let a = xx.max(0.0).sqrt();
    let b = if a > 0.0 { xy / a } else { 0.0 };
    let c = (yy - b * b).max(0.0).sqrt();
    let radius = NINETY_FIVE.sqrt();
    (0..=ELLIPSES.1)
        .map(|step| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(step) / f64::from(ELLIPSES.1)).sin_cos();
            (x + radius * a * cos, y + radius * (b * cos + c * sin))
        })
        .collect()
}

fn read<M: axle_schema::Message>(sample: &Recorded) -> Result<M, Refusal> {
    decode_as(&sample.encoding, &sample.payload)
}

fn position(sample: &Recorded) -> Result<(f64, f64), Refusal> {
    let NavigatorData { pose, .. } = read(sample)?;
    Ok((pose.x.0, pose.y.0))
}

fn keep<T>(list: &mut Vec<T>, item: T) {
    if list.len() < MOST {
        list.push(item);
    }
}
