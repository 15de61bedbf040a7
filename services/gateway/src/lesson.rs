//! The teaching view: one movement, where it really ends, and where the formulas of the tutorial believe it to end.
//!
//! The movement is that of Lucas' tutorial, equations 7 and 8: two wheel speeds and two accelerations. The exact path is
//! Axle's own (`axle_schema::motion`). The formulas see what encoders see: the distances of both wheels in each of
//! `samples` equal parts of the time. They are the arc of equation 5, "point and shoot" of equation 6, and Brown's
//! improvement of it.

use axle_schema::dwm::MAX_WHEEL_SPEED;
use axle_schema::motion::{arc, half_turn, point_and_shoot};
use axle_schema::refusal::within;
use axle_schema::{
    Dwm, Metres, MetresPerSecond, NavigatorData, Pose, Radians, Refusal, Seconds, Sides, Track,
};
use serde::{Deserialize, Serialize};

/// Into how many parts the exact path is drawn.
const PARTS: f64 = 240.0;
/// The longest movement of a lesson, s.
const MAX_TIME: f64 = 60.0;
/// The most samples.
const MAX_SAMPLES: u32 = 200;
/// The fastest wheel of a lesson, m/s.
const MAX_SPEED: f64 = 5.0;

/// The movement that the sliders show.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Movement {
    /// Wheel speeds at the start, m/s.
    pub speeds: Sides<f64>,
    /// Accelerations of the wheels, m/s².
    pub accelerations: Sides<f64>,
    /// Its duration, 0.1 to 60 s.
    pub time: f64,
    /// The distance between the wheels, 0.01 to 10 m.
    pub track: f64,
    /// How often the encoders are read meanwhile, 1 to 200.
    pub samples: u32,
}

/// A path, and how far from the true end it ends.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Believed {
    /// The formula.
    pub name: &'static str,
    /// x and y in m of its points.
    pub path: Vec<(f64, f64)>,
    /// Distance of its end from the true one, m.
    pub off: f64,
}

/// What the teaching view draws.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lesson {
    /// x and y in m of the exact path.
    pub path: Vec<(f64, f64)>,
    /// Where it ends.
    pub end: Pose,
    /// The length that the wheels measure: the way of the middle of the axle with its sign, m.
    pub distance: f64,
    /// The name of the curve.
    pub shape: String,
    /// What the formulas make of it.
    pub believed: Vec<Believed>,
}

impl Movement {
    /// Refuses numbers that make no lesson.
    ///
    /// # Errors
    /// [`Refusal::OutOfRange`] with the name of the number.
    pub fn check(&self) -> Result<(), Refusal> {
        within("time in s", self.time, 0.1, MAX_TIME)?;
        within("track in m", self.track, 0.01, 10.0)?;
        within("samples", f64::from(self.samples), 1.0, f64::from(MAX_SAMPLES))?;
        for (side, speed, acceleration) in [
            ("left", self.speeds.left, self.accelerations.left),
            ("right", self.speeds.right, self.accelerations.right),
        ] {
            within(&format!("{side} speed in m/s"), speed, -MAX_SPEED, MAX_SPEED)?;
            within(&format!("{side} acceleration in m/s²"), acceleration, -MAX_SPEED, MAX_SPEED)?;
            let end = speed + acceleration * self.time;
            within(&format!("{side} speed at the end in m/s"), end, -MAX_WHEEL_SPEED, MAX_WHEEL_SPEED)?;
        }
        Ok(())
    }

    /// Computes the lesson.
    ///
    /// # Errors
    /// As [`Movement::check`].
    pub fn lesson(&self) -> Result<Lesson, Refusal> {
        self.check()?;
        let track = Track::new(Metres(self.track))?;
        let start = self.speeds.map(MetresPerSecond);
        let end = self.speeds.zip(self.accelerations, |v, a| MetresPerSecond(v + a * self.time));
        let dwm = Dwm::new(start, end, Seconds(self.time))?;
        let poses = dwm.poses(NavigatorData::default(), track, Seconds(self.time / PARTS));
        let path: Vec<_> = poses.map(|data| (data.pose.x.0, data.pose.y.0)).collect();
        let end = dwm.pose_at(Pose::default(), track, Seconds(self.time));
        let span = dwm.encoders_span();
        let believed =
            [("arc", arc as Formula), ("point-and-shoot", point_and_shoot), ("half-turn", half_turn)]
                .map(|(name, formula)| {
                    let poses = self.reckon(&dwm, formula);
                    let off = poses.last().map_or(0.0, |last| last.distance(end).0);
                    Believed { name, path: poses.iter().map(|pose| (pose.x.0, pose.y.0)).collect(), off }
                })
                .to_vec();
        let distance = 0.5 * (span.left.0 + span.right.0);
        Ok(Lesson { path, end, distance, shape: format!("{:?}", dwm.shape(track)), believed })
    }

    /// The poses that a formula believes in, one a sample.
    fn reckon(&self, dwm: &Dwm, formula: Formula) -> Vec<Pose> {
        let mut poses = vec![Pose::default()];
        let mut pose = Pose::default();
        let mut before = Sides::new(Metres::ZERO, Metres::ZERO);
        for sample in 1..=self.samples {
            let t = self.time * f64::from(sample) / f64::from(self.samples);
            let now = dwm.distances_at(Seconds(t));
            let Sides { left, right } = now.zip(before, |now, before| (now - before).0);
            let (x, y, theta) = formula(left, right, self.track);
            pose = pose.moved(Metres(x), Metres(y), Radians(theta));
            poses.push(pose);
            before = now;
        }
        poses
    }
}

/// Distances of the left and the right wheel, and the track: a displacement.
type Formula = fn(f64, f64, f64) -> (f64, f64, f64);

#[cfg(test)]
mod tests {
    use super::*;

    fn lesson(speeds: (f64, f64), accelerations: (f64, f64), samples: u32) -> Lesson {
        let (speeds, accelerations) =
            (Sides::new(speeds.0, speeds.1), Sides::new(accelerations.0, accelerations.1));
        Movement { speeds, accelerations, time: 2.0, track: 0.3, samples }.lesson().expect("a lesson")
    }

    #[test]
    fn the_formulas_miss_as_the_tutorial_says() {
        // A circle of radius 0.3 m, 0.6 m long: the arc is exact, however it is sampled.
        let circle = lesson((0.15, 0.45), (0.0, 0.0), 1);
        let (x, y) = (0.3 * 2.0_f64.sin(), 0.3 * (1.0 - 2.0_f64.cos()));
        assert!((circle.end.x.0 - x).abs() < 1e-12 && (circle.end.y.0 - y).abs() < 1e-12);
        assert!(circle.believed[0].off < 1e-12, "{}", circle.believed[0].off);
        // Point and shoot goes straight along the last heading, Brown along the middle one.
        let shot = circle.believed[1].path[1];
        assert!((shot.0 - 0.6 * 2.0_f64.cos()).abs() < 1e-12 && (shot.1 - 0.6 * 2.0_f64.sin()).abs() < 1e-12);
        let brown = circle.believed[2].path[1];
        assert!(
            (brown.0 - 0.6 * 1.0_f64.cos()).abs() < 1e-12 && (brown.1 - 0.6 * 1.0_f64.sin()).abs() < 1e-12
        );
        assert!(circle.believed[1].off > 3.0 * circle.believed[2].off && circle.believed[2].off > 0.01);
    }

    #[test]
    fn with_acceleration_only_the_exact_path_is_right_and_more_samples_bring_the_others_closer() {
        let (few, many) = (lesson((0.2, 0.5), (0.4, 0.05), 4), lesson((0.2, 0.5), (0.4, 0.05), 64));
        assert_eq!(few.end, many.end);
        for (few, many) in few.believed.iter().zip(&many.believed) {
            assert!(few.off > 2.0 * many.off && many.off > 0.0, "{}: {} {}", few.name, few.off, many.off);
        }
        assert_eq!(few.path.len(), 241);
        let last = few.path[240];
        assert!((last.0 - few.end.x.0).abs() < 1e-12 && (last.1 - few.end.y.0).abs() < 1e-12);
        assert!((few.distance - 1.15).abs() < 1e-12);
    }

    #[test]
    fn numbers_that_make_no_lesson_are_refused_by_name() {
        let right = Movement {
            speeds: Sides::new(0.1, 0.2),
            accelerations: Sides::new(0.0, 0.0),
            time: 1.0,
            track: 0.3,
            samples: 10,
        };
        for (wrong, words) in [
            (Movement { time: 0.0, ..right }, "time"),
            (Movement { time: f64::NAN, ..right }, "time"),
            (Movement { track: 0.0, ..right }, "track"),
            (Movement { samples: 0, ..right }, "samples"),
            (Movement { samples: 201, ..right }, "samples"),
            (Movement { speeds: Sides::new(0.0, 9.0), ..right }, "right speed"),
            (Movement { accelerations: Sides::new(f64::INFINITY, 0.0), ..right }, "left acceleration"),
            (Movement { accelerations: Sides::new(5.0, 0.0), time: 60.0, ..right }, "at the end"),
        ] {
            let refusal = wrong.lesson().expect_err(words).to_string();
            assert!(refusal.contains(words), "{refusal:?} says {words:?}");
        }
    }
}
