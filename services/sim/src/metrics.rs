//! What is measured of a run, on the truth that only an emulator knows.

use crate::course::Brief;
use crate::robot::Robot;
use axle_schema::{Geometry, Pose, Seconds, Sides};
use std::collections::VecDeque;
use std::f64::consts::PI;

/// One measure; of each, less is better, but of the success rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Metric {
    /// Its name in JSON and CSV, with its unit.
    pub name: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// Whether more is better.
    pub more: bool,
}

/// All measures, in the order of [`Run::values`](crate::Run::values).
pub const METRICS: [Metric; 8] = [
    less("final_error_m", "final error"),
    less("heading_error_rad", "heading error"),
    less("cross_track_rms_m", "cross-track RMS"),
    less("cross_track_max_m", "cross-track max"),
    less("time_s", "time"),
    less("reversals", "reversals"),
    less("effort_m2_s3", "effort"),
    Metric { name: "success", title: "success", more: true },
];

const fn less(name: &'static str, title: &'static str) -> Metric {
    Metric { name, title, more: false }
}

/// A task has succeeded when its corrector says so and the robot really stands this near to the goal, in m and rad.
const NEAR: (f64, f64) = (0.05, PI / 18.0);
/// Slower than this, in m/s, a wheel has no direction that could change.
const SLOW: f64 = 2e-3;
/// How many changes of direction of a wheel are remembered, to tell those before the end.
const MEMORY: usize = 32;
/// For so long before the end of a task they count as hunting.
const HUNT: Seconds = Seconds(1.0);

/// The times of the last changes of direction of a wheel.
type Changes = VecDeque<Seconds>;

/// Watches a run.
pub(crate) struct Watch<'a> {
    brief: &'a Brief,
    goal: Pose,
    /// The beginnings of the legs.
    starts: Vec<Pose>,
    squares: f64,
    largest: f64,
    points: u32,
    effort: f64,
    setpoints: Sides<f64>,
    directions: Sides<i8>,
    reversals: u32,
    changes: Sides<Changes>,
    path: Vec<(f64, f64)>,
}

impl<'a> Watch<'a> {
    pub(crate) fn new(brief: &'a Brief) -> Self {
        let mut pose = brief.plan.start;
        let starts = brief.plan.legs.iter().map(|leg| {
            let start = pose;
            pose = leg.geometry.end_from(start);
            start
        });
        let starts = starts.collect();
        Self {
            brief,
            goal: brief.goal(),
            starts,
            squares: 0.0,
            largest: 0.0,
            points: 0,
            effort: 0.0,
            setpoints: Sides::default(),
            directions: Sides::default(),
            reversals: 0,
            changes: Sides::default(),
            path: Vec::new(),
        }
    }

    /// Looks at the robot after each of its beats; where it is, is looked at when `pose` says so.
    pub(crate) fn look(&mut self, robot: &Robot, pose: bool) {
        let now = robot.truth().stamp;
        let span = robot.period().0;
        let setpoints = robot.setpoints().map(|speed| speed.0);
        let [left, right] = setpoints.zip(self.setpoints, |is, was| (is - was) / span).both();
        self.effort += (left * left + right * right) / 2.0 * span;
        self.setpoints = setpoints;
        let is = robot.rims().map(|speed| if speed.0.abs() < SLOW { 0 } else { speed.0.signum() as i8 });
        let turned = is.zip(self.directions, |is, was| is * was < 0);
        for (turned, changes) in
            [(turned.left, &mut self.changes.left), (turned.right, &mut self.changes.right)]
        {
            if turned {
                self.reversals += 1;
                if changes.len() == MEMORY {
                    changes.pop_front();
                }
                changes.push_back(now);
            }
        }
        self.directions = is.zip(self.directions, |is, was| if is == 0 { was } else { is });
        if pose {
            let at = robot.truth().pose;
            let off = self.off(at);
            self.squares += off * off;
            self.largest = self.largest.max(off);
            self.points += 1;
            self.path.push((at.x.0, at.y.0));
        }
    }

    /// How often the worse wheel has changed its direction in the last second before `over`, and since then.
    pub(crate) fn hunting(&self, over: Seconds) -> usize {
        let since = |changes: &Changes| changes.iter().filter(|&&at| at >= over - HUNT).count();
        since(&self.changes.left).max(since(&self.changes.right))
    }

    /// The distance of a place from the path of the plan.
    fn off(&self, at: Pose) -> f64 {
        let legs = self.starts.iter().zip(&self.brief.plan.legs);
        let distance = legs.map(|(start, leg)| distance(&leg.geometry, at.seen_from(*start)));
        let nearest = distance.fold(f64::INFINITY, f64::min);
        // A plan without legs is the place where it begins.
        if nearest.is_finite() { nearest } else { at.distance(self.brief.plan.start).0 }
    }

    /// The measures at the end, and the path.
    pub(crate) fn end(self, at: Pose, time: Seconds, done: bool) -> ([f64; METRICS.len()], Vec<(f64, f64)>) {
        let error = at.distance(self.goal).0;
        let heading = (at.heading - self.goal.heading).wrapped().0.abs();
        let rms = (self.squares / f64::from(self.points.max(1))).sqrt();
        let success = f64::from(u8::from(done && error <= NEAR.0 && heading <= NEAR.1));
        let reversals = f64::from(self.reversals);
        let values = [error, heading, rms, self.largest, time.0, reversals, self.effort, success];
        (values, self.path)
    }
}

/// The distance of a place, told from the beginning of a geometry, from its path.
fn distance(geometry: &Geometry, at: Pose) -> f64 {
    let (x, y) = (at.x.0, at.y.0);
    match *geometry {
        Geometry::Turn { .. } => x.hypot(y),
        Geometry::Line { length } => (x - x.clamp(length.0.min(0.0), length.0.max(0.0))).hypot(y),
        Geometry::Arc { radius, angle } => {
            // The centre is at (0, r); the path has turned by the angle φ at the point (r sin φ, r - r cos φ).
            let (r, whole) = (radius.0, angle.0);
            let turned = (x * r.signum()).atan2((r - y) * r.signum());
            let on = |turn: f64| (0.0..=1.0).contains(&(turn / whole));
            if [turned, turned + 2.0 * PI, turned - 2.0 * PI].into_iter().any(on) {
                return (x.hypot(y - r) - r.abs()).abs();
            }
            let end = geometry.end_from(Pose::default());
            x.hypot(y).min((x - end.x.0).hypot(y - end.y.0))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Metres, Radians};
    use proptest::prelude::*;

    #[test]
    fn the_distance_from_a_geometry_is_that_of_its_nearest_point() {
        let arc = |radius, angle| Geometry::Arc { radius: Metres(radius), angle: Radians(angle) };
        for (geometry, at, expected) in [
            (Geometry::Line { length: Metres(2.0) }, (1.0, 0.3), 0.3),
            (Geometry::Line { length: Metres(2.0) }, (2.3, 0.4), 0.5),
            (Geometry::Line { length: Metres(-2.0) }, (-1.0, -0.1), 0.1),
            (Geometry::Turn { angle: Radians(1.0) }, (0.3, -0.4), 0.5),
            (arc(1.0, PI / 2.0), (0.0, 0.5), 0.5),
            (arc(1.0, PI / 2.0), (1.2, 1.0), 0.2),
            (arc(-1.0, -PI / 2.0), (1.2, -1.0), 0.2),
            (arc(-1.0, -PI), (0.0, -2.3), 0.3),
        ] {
            let off = distance(&geometry, Pose::new(at.0, at.1, 0.0));
            assert!((off - expected).abs() < 1e-12, "{geometry:?} from {at:?}: {off}");
        }
    }

    proptest! {
        #[test]
        fn no_sampled_point_of_an_arc_is_nearer(
            radius in prop_oneof![-2.0..-0.1, 0.1..2.0],
            angle in prop_oneof![-6.2..-0.1, 0.1..6.2],
            (x, y) in (-3.0..3.0, -3.0..3.0),
        ) {
            let arc = |angle: f64| Geometry::Arc { radius: Metres(radius), angle: Radians(angle) };
            let at = Pose::new(x, y, 0.0);
            let ours = distance(&arc(angle), at);
            let sampled = (0..=2000_u32)
                .map(|n| arc(angle * f64::from(n) / 2000.0).end_from(Pose::default()).distance(at).0)
                .fold(f64::INFINITY, f64::min);
            prop_assert!((ours - sampled).abs() < 4e-3, "{ours}, not {sampled}");
        }
    }
}
