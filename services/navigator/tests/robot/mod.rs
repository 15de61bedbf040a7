//! A robot for the proofs: its noises are exactly those that the filter is told, and it repeats by its seed.

#![allow(dead_code, reason = "each proof uses its part")]

use axle_navigator::{Measurement, NavigatorParams};
use axle_schema::motion::arc;
use axle_schema::{
    EncodersData, Fix, InertialData, Metres, MetresPerSecondSquared, Numbers, Pose, Radians,
    RadiansPerSecond, Seconds,
};

/// Normal and uniform numbers by a seed (SplitMix64 and Box and Muller's polar form).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (2.0 * std::f64::consts::PI * self.uniform()).cos()
    }
}

pub(crate) const DT: f64 = 0.02;
pub(crate) const TRACK: f64 = 0.3;

/// A robot that knows where it is.
pub(crate) struct Robot {
    pub(crate) random: Random,
    pub(crate) truth: Pose,
    /// Its past: pose after each step.
    pub(crate) past: Vec<Pose>,
    pub(crate) step: u32,
    counted: [f64; 2],
    pub(crate) bias: f64,
    k: f64,
    wheel_noise: f64,
    gyro_noise: f64,
    /// How much farther than the robot each wheel turns, as a share: a slip.
    pub(crate) slip: [f64; 2],
    /// What the accelerometer reads too much, in m/s², if there is one; its noise; and the speed of the last span.
    push: Option<(f64, f64)>,
    speed: f64,
}

impl Robot {
    /// Its start, its bias and its noises are drawn as the parameters say.
    pub(crate) fn new(seed: u64, params: &NavigatorParams) -> Self {
        let mut random = Random(seed);
        let mut near = |mean: f64, sd: f64| mean + sd * random.normal();
        let (start, ekf) = (params.start, params.ekf);
        let truth = Pose::new(
            near(start.x.0, ekf.start_sd.0),
            near(start.y.0, ekf.start_sd.0),
            near(start.heading.0, ekf.start_heading_sd.0),
        );
        let bias = near(0.0, ekf.bias_sd);
        Self {
            truth,
            past: vec![truth],
            step: 0,
            counted: [0.0; 2],
            bias,
            k: params.k.0,
            wheel_noise: ekf.wheel_noise,
            gyro_noise: ekf.gyro_noise,
            slip: [0.0; 2],
            push: (ekf.accelerometer_noise > 0.0)
                .then(|| (ekf.accelerometer_bias_sd * random.normal(), ekf.accelerometer_noise)),
            speed: 0.0,
            random,
        }
    }

    pub(crate) fn now(&self) -> f64 {
        f64::from(self.step) * DT
    }

    pub(crate) fn encoders(&self) -> EncodersData {
        EncodersData {
            stamp: Seconds(self.now()),
            left: Metres(self.counted[0]),
            right: Metres(self.counted[1]),
        }
    }

    /// Drives one step at these wheel speeds; gives what encoders and gyro say.
    pub(crate) fn drive(&mut self, left: f64, right: f64) -> [Measurement; 2] {
        let mut real = [left * DT, right * DT];
        for (side, way) in real.iter_mut().enumerate() {
            self.counted[side] += *way;
            // Noise of the way or of its measurement is the same to a filter, but an accelerometer would feel the first.
            let variance = self.k * way.abs() + self.wheel_noise.powi(2) * DT;
            let noise = variance.sqrt() * self.random.normal();
            if self.push.is_some() {
                self.counted[side] -= noise;
            } else {
                *way += noise;
            }
            *way *= 1.0 - self.slip[side];
        }
        let (x, y, theta) = arc(real[0], real[1], TRACK);
        self.truth = self.truth.moved(Metres(x), Metres(y), Radians(theta));
        self.past.push(self.truth);
        self.step += 1;
        let noise = self.gyro_noise / DT.sqrt() * self.random.normal();
        let rate = theta / DT + self.bias + noise;
        // An accelerometer reads by what the speed has changed since the reading before, the mean of a span each.
        let speed = f64::midpoint(real[0], real[1]) / DT;
        let ax = self.push.map(|(bias, noise)| {
            let change = if self.step == 1 { 0.0 } else { speed - self.speed };
            let felt = change / DT + bias + noise / DT.sqrt() * self.random.normal();
            MetresPerSecondSquared(felt)
        });
        self.speed = speed;
        let stamp = Seconds(self.now());
        let gyro = InertialData { stamp, gyro: RadiansPerSecond(rate), ax, ay: None };
        [Measurement::Encoders(self.encoders()), Measurement::Inertial(gyro)]
    }

    /// A winding way: speeds of both wheels at a step.
    pub(crate) fn winding(&self) -> (f64, f64) {
        let t = self.now();
        let (v, omega) = (0.4 + 0.1 * (0.7 * t).sin(), 0.8 * (0.45 * t).sin() + 0.3 * (1.3 * t).cos());
        (v - omega * TRACK / 2.0, v + omega * TRACK / 2.0)
    }

    /// A fix of where the robot was some steps ago.
    pub(crate) fn fix(&mut self, steps_ago: u32, sd: f64) -> Measurement {
        let at = self.step.saturating_sub(steps_ago);
        let there = self.past[at as usize];
        let (x, y) = (there.x.0 + sd * self.random.normal(), there.y.0 + sd * self.random.normal());
        Measurement::Fix(fix(f64::from(at) * DT, x, y, sd))
    }
}

pub(crate) fn fix(stamp: f64, x: f64, y: f64, sd: f64) -> Fix {
    let covariance = Numbers([sd * sd, 0.0, 0.0, sd * sd]);
    Fix { stamp: Seconds(stamp), x: Metres(x), y: Metres(y), covariance, heading: None }
}

/// The squared normalised error of an estimate of the pose: of mean 3 if the covariance is honest.
pub(crate) fn nees(estimate: Pose, covariance: &[f64; 9], truth: Pose) -> f64 {
    let p = nalgebra::Matrix3::from_row_slice(covariance);
    let turn = (estimate.heading - truth.heading).wrapped().0;
    let e = nalgebra::Vector3::new(estimate.x.0 - truth.x.0, estimate.y.0 - truth.y.0, turn);
    e.dot(&(p.try_inverse().expect("a covariance of full rank") * e))
}

/// Whether a sum of squares is within the central 95 % of chi squared (Wilson and Hilferty).
pub(crate) fn bounds(degrees: f64) -> [f64; 2] {
    let spread = 2.0 / (9.0 * degrees);
    [-1.96, 1.96].map(|z: f64| degrees * (1.0 - spread + z * spread.sqrt()).powi(3))
}
