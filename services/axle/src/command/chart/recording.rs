//! A recording: the plan, where the robot was and where it believed to be, and what its wheels did.

use crate::chart::{PathSeries, WheelPoint, Wheels};
use crate::path::of_plan;
use axle_recorder::{Entry, Recorded, Recording};
use axle_schema::codec::decode_as;
use axle_schema::task::CorrectorProgress;
use axle_schema::{NavigatorData, Plan, Refusal, Sides, Task, WayTask, key};
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
    robot: Option<String>,
}

impl Heard {
    /// Reads a recording to its end, which may be where a crash cut it off.
    pub(super) fn read(path: &Path, complain: &dyn Fn(&str)) -> anyhow::Result<Self> {
        let mut recording = Recording::open(path)?;
        let (mut heard, mut refused) = (Self::default(), 0_u64);
        for entry in recording.by_ref() {
            let Entry::Sample(sample) = entry else { continue };
            refused += u64::from(heard.sample(&sample).is_err());
        }
        let account = recording.account();
        if let Some(why) = &account.cut {
            complain(&format!("the recording is cut off: {why}"));
        }
        if refused + account.damaged > 0 {
            complain(&format!("{} samples and chunks could not be read", refused + account.damaged));
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
            ("navigator", "pose") => keep(&mut self.estimate, position(sample)?),
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
        let lists = [(&mut self.wheels.due, beat.due), (&mut self.wheels.real, beat.real)];
        for (list, distances) in lists {
            if let Some(Sides { left, right }) = distances {
                keep(list, WheelPoint { time, left: left.0, right: right.0 });
            }
        }
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
