//! What the methods of dead reckoning share: a pose, and a covariance that only grows.
//!
//! The covariance grows by the noise of the wheels, carried through the motion by its Jacobians (model.md 6.1 and 6.2,
//! without the gyro's bias); it begins with 0, since the frame `odom` begins where the robot is. It has no way to
//! shrink: that takes a fix. It is that of the arc for every method, since they differ in their systematic errors,
//! and not in what the wheels are uncertain by.

use axle_schema::{EncodersSpan, Metres, Pose, Radians};
use nalgebra::{Matrix2, Matrix3, Matrix3x2};

/// A displacement `(x, y, theta)` from the distances of the left and of the right wheel and the track.
pub(crate) type Step = fn(f64, f64, f64) -> (f64, f64, f64);

/// Pose and covariance, dead-reckoned.
#[derive(Clone, Debug)]
pub(crate) struct Reckoning {
    pose: Pose,
    covariance: Matrix3<f64>,
}

impl Reckoning {
    pub(crate) const fn new(pose: Pose, covariance: Matrix3<f64>) -> Self {
        Self { pose, covariance }
    }

    /// Moves by the displacement `step` that `span` is said to make; `k` is the variance of a wheel's distance for
    /// every metre of it.
    pub(crate) fn advance(&mut self, step: (f64, f64, f64), span: &EncodersSpan, track: f64, k: Metres) {
        let (left, right) = (span.left.0, span.right.0);
        let Jacobians { f, g } = jacobians(self.pose.heading.0, left, right, track);
        let q = Matrix2::new(k.0 * left.abs(), 0.0, 0.0, k.0 * right.abs());
        let p = f * self.covariance * f.transpose() + g * q * g.transpose();
        self.covariance = (p + p.transpose()) / 2.0;
        // Rounding may leave a variance of 0 a hair below it.
        self.covariance.set_diagonal(&self.covariance.diagonal().map(|variance| variance.max(0.0)));
        self.pose = self.pose.moved(Metres(step.0), Metres(step.1), Radians(step.2));
    }

    pub(crate) const fn pose(&self) -> Pose {
        self.pose
    }

    pub(crate) const fn covariance(&self) -> Matrix3<f64> {
        self.covariance
    }
}

/// How the next pose depends on the last one and on the distances of the wheels.
pub(crate) struct Jacobians {
    /// ∂(x, y, θ)' / ∂(x, y, θ).
    pub(crate) f: Matrix3<f64>,
    /// ∂(x, y, θ)' / ∂(left, right).
    pub(crate) g: Matrix3x2<f64>,
}

/// model.md 6.2, with its symbols: θ heading, sl and sr wheel distances, Δ track.
pub(crate) fn jacobians(theta: f64, sl: f64, sr: f64, track: f64) -> Jacobians {
    let Bend { moved: [dx, dy], by_length: [lx, ly], by_turn: [tx, ty] } =
        bend(theta, f64::midpoint(sl, sr), (sr - sl) / track);
    #[rustfmt::skip]
    let f = Matrix3::new(
        1.0, 0.0, -dy,
        0.0, 1.0, dx,
        0.0, 0.0, 1.0,
    );
    #[rustfmt::skip]
    let g = Matrix3x2::new(
        lx / 2.0 - tx / track, lx / 2.0 + tx / track,
        ly / 2.0 - ty / track, ly / 2.0 + ty / track,
        -1.0 / track, 1.0 / track,
    );
    Jacobians { f, g }
}

/// An arc, and how its end depends on its length and on its turn.
pub(crate) struct Bend {
    /// The displacement along x and y.
    pub(crate) moved: [f64; 2],
    /// ∂(x, y) / ∂s.
    pub(crate) by_length: [f64; 2],
    /// ∂(x, y) / ∂d: what an error of the turn does.
    pub(crate) by_turn: [f64; 2],
}

/// An arc of the length `s` that turns by `d`, begun at the heading `theta`: the chord form of model.md 1.3.
pub(crate) fn bend(theta: f64, s: f64, d: f64) -> Bend {
    let (sinc, slope) = sinc(d / 2.0);
    let (sin, cos) = (theta + d / 2.0).sin_cos();
    let (chord, change) = (s * sinc, s * slope / 2.0);
    Bend {
        moved: [chord * cos, chord * sin],
        by_length: [sinc * cos, sinc * sin],
        by_turn: [cos * change - chord * sin / 2.0, sin * change + chord * cos / 2.0],
    }
}

/// sin z / z and its derivative. The closed form of the derivative loses its digits near 0 (model.md 6.2), where both
/// series are exact to the last digit and need no sine.
fn sinc(z: f64) -> (f64, f64) {
    let q = z * z;
    if q < 0.04 {
        let sinc = 1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * (1.0 - q / 110.0))));
        let slope = -z / 3.0 * (1.0 - q / 10.0 * (1.0 - q / 28.0 * (1.0 - q / 54.0 * (1.0 - q / 88.0))));
        (sinc, slope)
    } else {
        let sinc = z.sin() / z;
        (sinc, (z.cos() - sinc) / z)
    }
}

/// Three rows of three as the wire wants them.
pub(crate) fn row_by_row(p: &Matrix3<f64>) -> [f64; 9] {
    [p[(0, 0)], p[(0, 1)], p[(0, 2)], p[(1, 0)], p[(1, 1)], p[(1, 2)], p[(2, 0)], p[(2, 1)], p[(2, 2)]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arc;
    use axle_schema::Seconds;
    use axle_schema::Track;
    use proptest::prelude::*;

    fn track(metres: f64) -> Track {
        Track::new(Metres(metres)).expect("a track")
    }
    fn span(left: f64, right: f64) -> EncodersSpan {
        EncodersSpan { duration: Seconds(0.1), left: Metres(left), right: Metres(right) }
    }

    #[derive(Clone)]
    struct Arc(Reckoning);
    impl Arc {
        fn new(pose: Pose) -> Self {
            Self(Reckoning::new(pose, Matrix3::zeros()))
        }
        fn advance(&mut self, span: &EncodersSpan, track: Track, k: Metres) {
            self.0.advance(arc::STEP(span.left.0, span.right.0, track.get()), span, track.get(), k);
        }
        fn covariance(&self) -> [f64; 9] {
            row_by_row(&self.0.covariance)
        }
        fn pose(&self) -> Pose {
            self.0.pose()
        }
    }

    #[test]
    fn driving_straight_spreads_the_heading_and_then_the_side() {
        // 1 m straight with k = 1e-4 m: each wheel has a variance of 1e-4 m². The length has half of it, the heading
        // 2e-4 / 0.09 rad², and the side a quarter of that in one step: the middle of the arc is half-way.
        let mut arc = Arc::new(Pose::default());
        arc.advance(&span(1.0, 1.0), track(0.3), Metres(1e-4));
        let p = arc.covariance();
        for (index, expected) in
            [(0, 5e-5), (8, 2e-4 / 0.09), (4, 2e-4 / 0.09 / 4.0), (5, 2e-4 / 0.09 / 2.0), (1, 0.0)]
        {
            assert!((p[index] - expected).abs() < 1e-15, "entry {index} is {}, not {expected}", p[index]);
        }
    }

    #[test]
    fn standing_still_adds_no_doubt() {
        let mut arc = Arc::new(Pose::default());
        arc.advance(&span(0.5, 0.4), track(0.3), Metres(1e-4));
        let before = arc.covariance();
        arc.advance(&span(0.0, 0.0), track(0.3), Metres(1e-4));
        assert!(before.iter().zip(arc.covariance()).all(|(a, b)| (a - b).abs() < 1e-18));
    }

    proptest! {
        #[test]
        fn the_jacobians_are_the_slopes_of_the_motion(
            (x, y, theta) in (-5.0..5.0, -5.0..5.0, -7.0..7.0),
            (left, right) in (-0.5..0.5, -0.5..0.5),
            // Both sides of the switch to the series, and far from it.
            nearly_straight in proptest::option::of(-0.02..0.02_f64),
            width in 0.1..1.0_f64,
        ) {
            let right = nearly_straight.map_or(right, |turn| left + turn * width);
            let Jacobians { f, g } = jacobians(theta, left, right, width);
            let moved = |[x, y, theta, left, right]: [f64; 5]| {
                let step = span(left, right).navigator_span(track(width));
                let pose = Pose::new(x, y, theta).moved(step.x, step.y, step.heading);
                [pose.x.0, pose.y.0, pose.heading.0]
            };
            let point = [x, y, theta, left, right];
            let h = 1e-6;
            for column in 0..5 {
                let (mut low, mut high) = (point, point);
                low[column] -= h;
                high[column] += h;
                let (low, high) = (moved(low), moved(high));
                for row in 0..3 {
                    let slope = (high[row] - low[row]) / (2.0 * h);
                    let ours = if column < 3 { f[(row, column)] } else { g[(row, column - 3)] };
                    prop_assert!((ours - slope).abs() < 1e-7, "[{row}, {column}] is {ours}, not {slope}");
                }
            }
        }

        #[test]
        fn splitting_a_span_of_constant_speeds_changes_nothing(
            (left, right) in (-1.0..1.0, -1.0..1.0),
            parts in 1..200_u32,
            heading in -7.0..7.0,
        ) {
            let whole = &mut Arc::new(Pose::new(0.3, -0.4, heading));
            let split = &mut whole.clone();
            whole.advance(&span(left, right), track(0.3), Metres(1e-4));
            let n = f64::from(parts);
            (0..parts).for_each(|_| split.advance(&span(left / n, right / n), track(0.3), Metres(1e-4)));
            prop_assert!(whole.pose().distance(split.pose()).0 < 1e-12);
            prop_assert!((whole.pose().heading.0 - split.pose().heading.0).abs() < 1e-12);
            let p = split.covariance();
            prop_assert!((p[1] - p[3]).abs() < 1e-18 && (p[8] - whole.covariance()[8]).abs() < 1e-15);
        }

        #[test]
        fn a_covariance_stays_one(steps in proptest::collection::vec((-0.2..0.2, -0.2..0.2), 1..200)) {
            let mut arc = Arc::new(Pose::default());
            for (left, right) in steps {
                arc.advance(&span(left, right), track(0.3), Metres(1e-3));
            }
            let least = arc.0.covariance.symmetric_eigenvalues().min();
            let largest = arc.0.covariance.amax();
            prop_assert!(least >= -1e-12 * largest, "eigenvalue {least} beside {largest}");
        }
    }
}
