//! The filter itself: one state, its covariance, and what motion and measurements do to them (model.md 6).
//!
//! The state is (x, y, θ, b, v, a, εl, εr, ετ): the pose, the bias of the gyro in rad/s, the mean speed of the last span in
//! m/s and the bias of the accelerometer in m/s², and the relative errors of both wheel radii and of the track. The first
//! four are always in use; speed and accelerometer where the parameters trust one, the measures of the robot where they do
//! not take them as exact. Updates are those of Joseph's form, or what it is for a single number.

mod covariance;
mod motion;

use crate::params::EkfParams;
use axle_schema::{Numbers, Pose, Radians};
pub(super) use covariance::Covariance;
use covariance::N;
pub(super) use motion::{Innovation, Motion, Noise, Push};
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2};

/// The gyro's bias.
const BIAS: usize = 3;
/// The speed.
const SPEED: usize = 4;
/// The accelerometer's bias.
const PUSH: usize = 5;
/// The relative error of the left radius.
const LEFT: usize = 6;
/// Of the right one.
const RIGHT: usize = 7;
/// Of the track.
pub(super) const TRACK: usize = 8;

/// State and covariance at an instant.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    pub(super) x: [f64; N],
    pub(super) p: Covariance,
    /// For how long both wheels are said to slip, in s.
    pub(super) skidded: f64,
    /// How many states are in use: 4, 6 or 9.
    states: usize,
}

impl Filter {
    pub(super) fn new(start: Pose, covariance: &Matrix3<f64>, params: &EkfParams) -> Self {
        let measured = params.wheel_sd > 0.0 || params.track_sd > 0.0;
        let states = if measured {
            N
        } else if params.accelerometer_noise > 0.0 {
            LEFT
        } else {
            SPEED
        };
        let mut filter = Self { x: [0.0; N], p: Covariance::ZERO, skidded: 0.0, states };
        let sds = [
            (BIAS, params.bias_sd),
            (PUSH, params.accelerometer_bias_sd),
            (LEFT, params.wheel_sd),
            (RIGHT, params.wheel_sd),
            (TRACK, params.track_sd),
        ];
        for (state, sd) in sds.into_iter().filter(|(state, _)| *state < states) {
            filter.p[(state, state)] = sd * sd;
        }
        filter.place(start, covariance);
        filter
    }

    /// Puts the robot at a pose that does not depend on anything before it.
    pub(super) fn place(&mut self, pose: Pose, covariance: &Matrix3<f64>) {
        self.x[..3].copy_from_slice(&[pose.x.0, pose.y.0, pose.heading.0]);
        self.p.place(covariance);
    }

    pub(super) const fn pose(&self) -> Pose {
        Pose::new(self.x[0], self.x[1], self.x[2])
    }

    /// The gyro's bias, in rad/s.
    pub(super) const fn bias(&self) -> f64 {
        self.x[BIAS]
    }

    /// The gyro's bias, and the relative errors of left radius, right radius and track.
    pub(super) const fn learned(&self) -> [f64; 4] {
        [self.x[BIAS], self.x[LEFT], self.x[RIGHT], self.x[TRACK]]
    }

    pub(super) fn covariance(&self) -> Matrix3<f64> {
        self.p.pose()
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
        let p = self.p.square();
        let s = h * p * h.transpose() + r;
        let Some(inverse) = s.try_inverse() else { return f64::INFINITY };
        let squared = nu.dot(&(inverse * nu));
        if squared.is_finite() && squared <= gate {
            let gain = p * h.transpose() * inverse;
            self.add(&(gain * nu));
            let a = SMatrix::<f64, N, N>::identity() - gain * h;
            self.p = Covariance::of(&(a * p * a.transpose() + gain * r * gain.transpose()));
        }
        squared
    }

    fn add(&mut self, correction: &SVector<f64, N>) {
        self.x.iter_mut().zip(correction).for_each(|(x, by)| *x += by);
    }

    /// A heading with its variance; as [`Filter::fix`].
    pub(super) fn heading(&mut self, angle: f64, variance: f64, gate: f64) -> f64 {
        let nu = Radians(angle - self.x[2]).wrapped().0;
        let mut h = [0.0; N];
        h[2] = 1.0;
        let squared = nu * nu / (self.p.seen_by(&h) + variance);
        self.measure(nu, &h, variance, squared <= gate);
        squared
    }

    /// The distance to a point; as [`Filter::fix`]. Ranges have a long tail: what differs by more than `elbow` standard
    /// deviations counts as if it differed by so much (P. J. Huber 1964), in the state and in the covariance alike.
    pub(super) fn range(
        &mut self,
        point: [f64; 2],
        distance: f64,
        variance: f64,
        gate: f64,
        elbow: f64,
    ) -> f64 {
        let (dx, dy) = (self.x[0] - point[0], self.x[1] - point[1]);
        let far = dx.hypot(dy);
        // On the point itself the distance has no direction to learn from.
        if far < 1e-6 {
            return 0.0;
        }
        let mut h = [0.0; N];
        (h[0], h[1]) = (dx / far, dy / far);
        let nu = distance - far;
        let seen = self.p.seen_by(&h);
        let s = seen + variance;
        let squared = nu * nu / s;
        // Huber's weight is that of a larger variance of the innovation.
        let variance = s * (squared.sqrt() / elbow).max(1.0) - seen;
        self.measure(nu, &h, variance, squared <= gate);
        squared
    }

    fn measure(&mut self, nu: f64, h: &[f64; N], r: f64, believed: bool) {
        if believed && nu.is_finite() {
            let gain = self.p.correct(h, r);
            self.x.iter_mut().zip(gain).for_each(|(x, gain)| *x += gain * nu);
        }
    }
}

#[cfg(test)]
mod tests;
