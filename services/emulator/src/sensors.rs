//! The sensors: encoders that count whole ticks, a gyroscope and accelerometers with bias, noise and drift.

use crate::params::EmulatorParams;
use crate::random::Random;
use axle_schema::{
    EncodersData, InertialData, Metres, MetresPerSecond, MetresPerSecondSquared, NavigatorData, Pose,
    Radians, RadiansPerSecond, Seconds, Sides,
};

/// Everything that measures. Each has its own stream of random numbers, so that how often one is read changes no other.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sensors {
    params: EmulatorParams,
    gyro_bias: RadiansPerSecond,
    /// Of the axes forward and to the left.
    bias: [MetresPerSecondSquared; 2],
    gyro_noise: Random,
    gyro_drift: Random,
    encoder_noise: Random,
    accelerometer_noise: Random,
    /// What each encoder counted last.
    counted: Sides<Metres>,
    /// What each wheel had covered then, and its way to and fro.
    distances: Sides<Metres>,
    way: Sides<Metres>,
    /// At the latest reading: time, true heading and true speed.
    read: (Seconds, Radians, MetresPerSecond),
}

impl Sensors {
    /// Sensors of a robot that stands at `start`.
    pub(crate) fn new(params: &EmulatorParams, gyro_bias: RadiansPerSecond, start: Pose) -> Self {
        let mut accelerometer_noise = Random::new(params.seed, 7);
        let bias = [(); 2].map(|()| params.accelerometers.bias_deviation * accelerometer_noise.normal());
        Self {
            params: *params,
            gyro_bias,
            bias,
            gyro_noise: Random::new(params.seed, 2),
            gyro_drift: Random::new(params.seed, 5),
            encoder_noise: Random::new(params.seed, 6),
            accelerometer_noise,
            counted: Sides::default(),
            distances: Sides::default(),
            way: Sides::default(),
            read: (Seconds::ZERO, start.heading, MetresPerSecond::ZERO),
        }
    }

    /// What the encoders count when the rims have covered `distances`: the last whole tick of each.
    pub(crate) fn encoders(&mut self, now: Seconds, distances: Sides<Metres>) -> EncodersData {
        let (tick, noise) = (self.params.encoders.tick, self.params.encoders.noise);
        let stuck = self.are_stuck(distances);
        let mut read = |distance: Metres| {
            let noisy =
                if noise > Metres::ZERO { distance + noise * self.encoder_noise.normal() } else { distance };
            tick * (noisy / tick).floor()
        };
        let counts = distances.map(&mut read);
        self.counted = Sides {
            left: if stuck.left { self.counted.left } else { counts.left },
            right: if stuck.right { self.counted.right } else { counts.right },
        };
        let wheels = self.counted.map(|distance| distance.0);
        let Sides { left, right } = self.params.encoders.wiring.to_channels(wheels).map(Metres);
        EncodersData { stamp: now, left, right }
    }

    /// Whether each wheel has come so far that its encoder counts no more.
    fn are_stuck(&mut self, distances: Sides<Metres>) -> Sides<bool> {
        let changes = distances.zip(self.distances, |now, before| (now - before).abs());
        self.distances = distances;
        self.way = self.way.zip(changes, |way, change| way + change);
        self.way.zip(self.params.encoders.stuck, |way, end| end > Metres::ZERO && way > end)
    }

    /// What gyroscope and accelerometers measure when the robot really does `truth`: the means since the latest
    /// reading. Means and not instants, since real ones filter, and so that the sum of the readings is the turn.
    pub(crate) fn inertial(&mut self, truth: &NavigatorData) -> InertialData {
        let (stamp, heading, speed) = self.read;
        let span = truth.stamp - stamp;
        let twist = truth.twist.unwrap_or_default();
        let later = span.0 > 0.0;
        let rate = if later { (truth.pose.heading - heading) / span } else { twist.omega };
        let forward = if later { (twist.v - speed) / span } else { MetresPerSecondSquared::ZERO };
        self.read = (truth.stamp, truth.pose.heading, twist.v);
        if later && self.params.gyro.drift > RadiansPerSecond::ZERO {
            self.gyro_bias += self.params.gyro.drift * (span.0.sqrt() * self.gyro_drift.normal());
        }
        let noise = self.params.gyro.noise_deviation * self.gyro_noise.normal();
        let mut felt = |truth: MetresPerSecondSquared, bias: MetresPerSecondSquared| {
            truth + bias + self.params.accelerometers.noise_deviation * self.accelerometer_noise.normal()
        };
        // What pulls to the left on a left bend is the acceleration of the bend.
        let sideways = MetresPerSecondSquared(rate.0 * f64::midpoint(speed.0, twist.v.0));
        let (ax, ay) = (felt(forward, self.bias[0]), felt(sideways, self.bias[1]));
        InertialData { stamp: truth.stamp, gyro: rate + self.gyro_bias + noise, ax: Some(ax), ay: Some(ay) }
    }
}
