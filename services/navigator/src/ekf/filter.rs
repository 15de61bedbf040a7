//! The filter itself: one state, its covariance, and what motion and measurements do to them (model.md 6).
//!
//! The state is (x, y, θ, b, εl, εr, ετ): the pose, the bias of the gyro in rad/s, and the relative errors of both wheel
//! radii and of the track. A state whose variance is 0 stays what it is, so that the errors of the robot's measures cost
//! nothing where they are taken as exact. Updates are those of Joseph's form or what it is for a single number: symmetric,
//! with variances that stay variances.

use crate::params::EkfParams;
use crate::reckoning::{jacobians, turn_slope};
use axle_schema::motion::arc;
use axle_schema::{Metres, Numbers, Pose, Radians};
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2};

/// How many states there are.
pub(super) const N: usize = 7;
/// States and both wheels' noises of a span.
const A: usize = N + 2;
type State = SVector<f64, N>;
type Covariance = SMatrix<f64, N, N>;

/// Turns and distances of one span.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Duration, in s.
    pub(super) dt: f64,
    /// What the encoders say the left wheel covered, in m.
    pub(super) left: f64,
    /// What they say of the right wheel.
    pub(super) right: f64,
    /// The gyro's angle, in rad.
    pub(super) gyro: Option<f64>,
    /// Variance of each wheel's distance beyond that of its noise, in m².
    pub(super) extra: f64,
    /// Variance of the position beyond that, in m²: a path that nobody saw.
    pub(super) unseen: f64,
}

/// What the gyro thought of the encoders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Innovation {
    /// Of the gyro, in rad.
    pub(super) nu: f64,
    /// Its variance, in rad².
    pub(super) s: f64,
}

/// Noises that do not change (model.md 6.1).
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise {
    pub(super) track: f64,
    pub(super) k: f64,
    /// Variance of the gyro's angle after 1 s.
    pub(super) gyro: f64,
    /// Variance of the bias after 1 s.
    pub(super) bias: f64,
}

/// State and covariance at an instant.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    pub(super) x: State,
    pub(super) p: Covariance,
}

impl Filter {
    pub(super) fn new(start: Pose, covariance: &Matrix3<f64>, params: &EkfParams) -> Self {
        let mut filter = Self { x: State::zeros(), p: Covariance::zeros() };
        let sds = [params.bias_sd, params.wheel_sd, params.wheel_sd, params.track_sd];
        for (index, sd) in sds.into_iter().enumerate() {
            filter.p[(3 + index, 3 + index)] = sd * sd;
        }
        filter.place(start, covariance);
        filter
    }

    /// Puts the robot at a pose that does not depend on anything before it.
    pub(super) fn place(&mut self, pose: Pose, covariance: &Matrix3<f64>) {
        self.x.fixed_rows_mut::<3>(0).copy_from_slice(&[pose.x.0, pose.y.0, pose.heading.0]);
        self.p.fixed_view_mut::<3, N>(0, 0).fill(0.0);
        self.p.fixed_view_mut::<N, 3>(0, 0).fill(0.0);
        self.p.fixed_view_mut::<3, 3>(0, 0).copy_from(covariance);
    }

    pub(super) fn pose(&self) -> Pose {
        Pose::new(self.x[0], self.x[1], self.x[2])
    }

    pub(super) fn covariance(&self) -> Matrix3<f64> {
        self.p.fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// Moves by a span (model.md 6.2 and 6.3): first the gyro corrects what the wheels are said to have covered, together
    /// with everything that depends on it, then the robot moves. Gives what the gyro thought of it.
    pub(super) fn predict(&mut self, motion: &Motion, noise: &Noise) -> Option<Innovation> {
        let Motion { dt, .. } = *motion;
        let mut pa = SMatrix::<f64, A, A>::zeros();
        pa.fixed_view_mut::<N, N>(0, 0).copy_from(&self.p);
        let (ml, mr) = (motion.left, motion.right);
        pa[(N, N)] = noise.k * ml.abs() + motion.extra;
        pa[(N + 1, N + 1)] = noise.k * mr.abs() + motion.extra;
        let track = noise.track * (1.0 + self.x[6]);
        let (mut sl, mut sr) = ((1.0 + self.x[4]) * ml, (1.0 + self.x[5]) * mr);
        let mut innovation = None;
        if let Some(gyro) = motion.gyro {
            let d = (sr - sl) / track;
            let mut h = SVector::<f64, A>::zeros();
            h[3] = dt;
            (h[4], h[5]) = (-ml / track, mr / track);
            h[6] = -d / (1.0 + self.x[6]);
            (h[N], h[N + 1]) = (-1.0 / track, 1.0 / track);
            let nu = gyro - (self.x[3] * dt + d);
            let (gain, s) = scalar(&mut pa, &h, noise.gyro * dt);
            self.x += gain.fixed_rows::<N>(0) * nu;
            // The measures may just have been corrected, so that the distances are those of the corrected wheels.
            (sl, sr) = ((1.0 + self.x[4]) * ml + gain[N] * nu, (1.0 + self.x[5]) * mr + gain[N + 1] * nu);
            innovation = Some(Innovation { nu, s });
        }
        self.travel((sl, sr), (ml, mr), noise.track, &pa);
        self.p[(3, 3)] += noise.bias * dt;
        self.p[(0, 0)] += motion.unseen;
        self.p[(1, 1)] += motion.unseen;
        innovation
    }

    /// The motion itself: `X ← f`, `P ← [F|G] Pa [F|G]ᵀ`. Only the pose moves, so only its rows are multiplied.
    fn travel(&mut self, (sl, sr): (f64, f64), (ml, mr): (f64, f64), track: f64, pa: &SMatrix<f64, A, A>) {
        let width = track * (1.0 + self.x[6]);
        let (theta, d) = (self.x[2], (sr - sl) / width);
        let steps = jacobians(theta, sl, sr, width);
        let by_turn = turn_slope(theta, f64::midpoint(sl, sr), d);
        let mut j = SMatrix::<f64, 3, A>::zeros();
        j.fixed_view_mut::<3, 3>(0, 0).copy_from(&steps.f);
        for row in 0..3 {
            let (left, right) = (steps.g[(row, 0)], steps.g[(row, 1)]);
            (j[(row, 4)], j[(row, 5)]) = (left * ml, right * mr);
            j[(row, 6)] = -by_turn[row] * d / (1.0 + self.x[6]);
            (j[(row, N)], j[(row, N + 1)]) = (left, right);
        }
        let half = j * pa;
        let pose = half * j.transpose();
        self.p.copy_from(&pa.fixed_view::<N, N>(0, 0));
        let rest = half.fixed_view::<3, 4>(0, 3).into_owned();
        self.p.fixed_view_mut::<3, 3>(0, 0).copy_from(&((pose + pose.transpose()) / 2.0));
        self.p.fixed_view_mut::<3, 4>(0, 3).copy_from(&rest);
        self.p.fixed_view_mut::<4, 3>(3, 0).copy_from(&rest.transpose());
        let (x, y, turn) = arc(sl, sr, width);
        let pose = self.pose().moved(Metres(x), Metres(y), Radians(turn));
        self.x.fixed_rows_mut::<3>(0).copy_from_slice(&[pose.x.0, pose.y.0, pose.heading.0]);
    }

    /// A position `z` of a sensor at the body offset `o` (model.md 6.4). Gives the squared normalised innovation; the
    /// state stays as it is where that is larger than `gate`.
    pub(super) fn fix(&mut self, z: [f64; 2], r: &Numbers<4>, o: [f64; 2], gate: f64) -> f64 {
        let (sin, cos) = self.x[2].sin_cos();
        let mut h = SMatrix::<f64, 2, N>::zeros();
        (h[(0, 0)], h[(1, 1)]) = (1.0, 1.0);
        (h[(0, 2)], h[(1, 2)]) = (-sin * o[0] - cos * o[1], cos * o[0] - sin * o[1]);
        let nu = Vector2::new(
            z[0] - (self.x[0] + cos * o[0] - sin * o[1]),
            z[1] - (self.x[1] + sin * o[0] + cos * o[1]),
        );
        let across = f64::midpoint(r.0[1], r.0[2]);
        let r = Matrix2::new(r.0[0], across, across, r.0[3]);
        let s = h * self.p * h.transpose() + r;
        let Some(inverse) = s.try_inverse() else { return f64::INFINITY };
        let squared = nu.dot(&(inverse * nu));
        if squared.is_finite() && squared <= gate {
            let gain = self.p * h.transpose() * inverse;
            self.x += gain * nu;
            let a = Covariance::identity() - gain * h;
            let p = a * self.p * a.transpose() + gain * r * gain.transpose();
            self.p = (p + p.transpose()) / 2.0;
        }
        squared
    }

    /// A heading with its variance; as [`Filter::fix`].
    pub(super) fn heading(&mut self, angle: f64, variance: f64, gate: f64) -> f64 {
        let nu = Radians(angle - self.x[2]).wrapped().0;
        let mut h = State::zeros();
        h[2] = 1.0;
        self.measure(nu, &h, variance, gate)
    }

    /// The distance to a point; as [`Filter::fix`].
    pub(super) fn range(&mut self, point: [f64; 2], distance: f64, variance: f64, gate: f64) -> f64 {
        let (dx, dy) = (self.x[0] - point[0], self.x[1] - point[1]);
        let far = dx.hypot(dy);
        // On the point itself the distance has no direction to learn from.
        if far < 1e-6 {
            return 0.0;
        }
        let mut h = State::zeros();
        (h[0], h[1]) = (dx / far, dy / far);
        self.measure(distance - far, &h, variance, gate)
    }

    fn measure(&mut self, nu: f64, h: &State, r: f64, gate: f64) -> f64 {
        let squared = nu * nu / (h.dot(&(self.p * h)) + r);
        if squared.is_finite() && squared <= gate {
            let (gain, _) = scalar(&mut self.p, h, r);
            self.x += gain * nu;
        }
        squared
    }
}

/// Corrects a covariance by a measurement of one number; gives the gain and the innovation's variance.
///
/// For the optimal gain of one number Joseph's form is the change of rank one `P − K (P Hᵀ)ᵀ`; written for one triangle
/// and copied to the other it is symmetric to the bit, and no variance can fall below 0.
fn scalar<const M: usize>(p: &mut SMatrix<f64, M, M>, h: &SVector<f64, M>, r: f64) -> (SVector<f64, M>, f64) {
    let ph = *p * h;
    let s = h.dot(&ph) + r;
    if s <= 0.0 || !s.is_finite() {
        return (SVector::zeros(), s);
    }
    let gain = ph / s;
    for row in 0..M {
        for column in row..M {
            let value = p[(row, column)] - gain[row] * ph[column];
            (p[(row, column)], p[(column, row)]) = (value, value);
        }
        p[(row, row)] = p[(row, row)].max(0.0);
    }
    (gain, s)
}

#[cfg(test)]
mod tests;
