//! What the motion is measured on: the reference vectors, and robot-like movements without end.

use axle_schema::motion::Wheels;
use axle_schema::motion::simpson::intervals;
use axle_schema::{Dwm, MetresPerSecond, Seconds, Sides};
use serde::Deserialize;

/// The reference vectors: movements and where they end, to 25 digits.
const GOLDEN: &str = include_str!("../../../../schema/tests/data/golden_dwm.jsonl");
/// Simpson's rule is as exact as the routine when it misses by no more than this share of the way.
pub(crate) const EQUAL: f64 = 1e-14;

/// A reference vector.
#[derive(Deserialize)]
pub(crate) struct Case {
    v0l: f64,
    v0r: f64,
    v1l: f64,
    v1r: f64,
    #[serde(rename = "T")]
    duration: f64,
    track: f64,
    t: f64,
    x: f64,
    y: f64,
    path: f64,
    category: String,
}

impl Case {
    /// The movement.
    pub(crate) fn wheels(&self) -> Wheels {
        let &Self { v0l, v0r, v1l, v1r, duration, track, .. } = self;
        Wheels { v0l, v0r, v1l, v1r, duration, track }
    }
    /// When the robot is looked at.
    pub(crate) const fn time(&self) -> f64 {
        self.t
    }
    /// By which share of its way the exact routine misses; 0 for a robot that stays where it is.
    pub(crate) fn error(&self) -> f64 {
        let motion = self.wheels().at(self.t);
        let miss = (motion.x - self.x).hypot(motion.y - self.y);
        if self.path > 0.0 { miss / self.path } else { miss }
    }
    /// With how many intervals Simpson's rule is as exact; none for a movement that is not like a robot's.
    pub(crate) fn intervals(&self) -> Option<u32> {
        let is_robot_like = self.category == "generic_robot" && self.path > 0.0;
        let found =
            is_robot_like.then(|| intervals(&self.wheels(), self.t, (self.x, self.y), EQUAL * self.path));
        found.flatten()
    }
}

/// All reference vectors.
pub(crate) fn golden() -> serde_json::Result<Vec<Case>> {
    GOLDEN.lines().map(serde_json::from_str).collect()
}

/// Robot-like movements, by a plain congruential generator so that every run has the same.
pub(crate) fn movements(count: u32) -> Vec<Dwm> {
    let mut state = 1_u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from((state >> 32) as u32) / 4_294_967_296.0
    };
    let mut speeds = move || [uniform(), uniform(), uniform(), uniform(), uniform()];
    (0..count)
        .filter_map(|_| {
            let [a, b, c, d, t] = speeds();
            let side = |left: f64, right: f64| {
                Sides::new(MetresPerSecond(3.0 * left - 1.5), MetresPerSecond(3.0 * right - 1.5))
            };
            Dwm::new(side(a, b), side(c, d), Seconds(0.05 + 2.0 * t)).ok()
        })
        .collect()
}
