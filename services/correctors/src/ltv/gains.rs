//! The gains of the regulator: a discrete algebraic Riccati equation for the speed of the moment.
//!
//! The unicycle, linearised about a straight reference at the speed v, falls apart: the error along the way is driven by
//! the speed alone, those to the side and of the heading by the turn rate alone. With a period T, exactly,
//!
//! ```text
//! e_x' = e_x + T·u_v        [e_y]' = [1  vT] [e_y] + [vT²/2] u_ω
//!                           [e_θ]    [0   1] [e_θ]   [  T  ]
//! ```

use super::LtvParams;
use axle_schema::{Pose, Seconds};
use nalgebra::{Matrix2, RowVector2, Vector2};

/// Slower than this the robot cannot be led to the side, and the equation has no solution; m/s.
const SLOWEST: f64 = 0.05;
/// The doubling below ends long before.
const MOST_ROUNDS: usize = 40;

/// The weights, and the gains for the speed for which they were asked last.
#[derive(Clone, Debug)]
pub(super) struct Gains {
    period: f64,
    /// Weights of the errors to the side and of the heading, and of the turn rate: inverse squares of what is tolerable.
    q: Matrix2<f64>,
    r: f64,
    along: f64,
    speed: f64,
    across: RowVector2<f64>,
}

impl Gains {
    pub(super) fn new(params: &LtvParams, period: Seconds) -> Self {
        let weight = |tolerable: f64| 1.0 / (tolerable * tolerable);
        let t = period.0;
        let q = Matrix2::new(weight(params.aside.0), 0.0, 0.0, weight(params.heading.0));
        let r = weight(params.turn_rate.0);
        let along = along(weight(params.along.0), weight(params.speed.0), t);
        Self { period: t, q, r, along, speed: SLOWEST, across: across(SLOWEST, t, &q, r) }
    }

    /// The correction of speed, m/s, and turn rate, rad/s, for an error in the frame of the robot.
    pub(super) fn correction(&mut self, speed: f64, error: Pose) -> (f64, f64) {
        // The slower the robot, the less it can be led to the side; one that stands would only turn.
        let aside = error.y.0 * (speed.abs() / SLOWEST).min(1.0);
        let speed = if speed.abs() < SLOWEST { SLOWEST.copysign(speed) } else { speed };
        // The gains change slowly with the speed; a plan that goes on at one speed keeps them.
        if (speed - self.speed).abs() > 1e-3 {
            self.speed = speed;
            self.across = across(speed, self.period, &self.q, self.r);
        }
        let error_across = Vector2::new(aside, error.heading.0);
        (self.along * error.x.0, (self.across * error_across).x)
    }
}

/// The gain along the way, 1/s: of x = x - x²T²/(r + T²x) + q the positive solution, k = T·x/(r + T²x).
fn along(q: f64, r: f64, t: f64) -> f64 {
    let tt = t * t;
    let x = (q * tt + (q * q * tt * tt + 4.0 * tt * q * r).sqrt()) / (2.0 * tt);
    t * x / (r + tt * x)
}

/// The gains to the side, for every metre and radian, by doubling (Chu, Fan, Lin, Wang 2004): each round takes twice as
/// many beats into account.
fn across(v: f64, t: f64, q: &Matrix2<f64>, r: f64) -> RowVector2<f64> {
    let a0 = Matrix2::new(1.0, v * t, 0.0, 1.0);
    let b = Vector2::new(v * t * t / 2.0, t);
    let (mut a, mut g, mut h) = (a0, b * b.transpose() / r, *q);
    for _ in 0..MOST_ROUNDS {
        let Some(w) = (Matrix2::identity() + g * h).try_inverse() else { break };
        let aw = a * w;
        let more = a.transpose() * h * w * a;
        g += aw * g * a.transpose();
        h += more;
        a = aw * a;
        if more.norm() <= 1e-12 * h.norm() {
            break;
        }
    }
    (b.transpose() * h * a0) / (r + (b.transpose() * h * b).x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gains_solve_their_equation_and_hold_the_robot() {
        let (t, r) = (0.05, 1.0);
        let q = Matrix2::new(277.0, 0.0, 0.0, 6.25);
        for v in [-1.0_f64, -0.3, 0.05, 0.5, 2.0] {
            let k = across(v, t, &q, r);
            let (a, b) = (Matrix2::new(1.0, v * t, 0.0, 1.0), Vector2::new(v * t * t / 2.0, t));
            // The cost of the closed loop, summed up beat by beat, gives the same gains: they are the best ones.
            let closed = a - b * k;
            let (mut cost, mut power) = (Matrix2::zeros(), Matrix2::identity());
            for _ in 0..20_000 {
                cost += power.transpose() * (q + k.transpose() * r * k) * power;
                power = closed * power;
            }
            assert!(power.norm() < 1e-6, "errors fade at {v} m/s");
            let best = (b.transpose() * cost * a) / (r + (b.transpose() * cost * b).x);
            assert!((best - k).norm() < 1e-6 * k.norm(), "{best} for {k} at {v} m/s");
        }
        // x = x - x²T²/(r + T²x) + q with q = 4, r = 1, T = 0.5: x = 2 + √20, k = x/2 / (1 + x/4).
        let x = 2.0 + 20.0_f64.sqrt();
        assert!((along(4.0, 1.0, 0.5) - x / 2.0 / (1.0 + x / 4.0)).abs() < 1e-12);
    }
}
