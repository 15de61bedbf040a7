//! How well the encoders, the gyroscope and the accelerometers measure.

use axle_schema::calibration::Wiring;
use axle_schema::contract::Bounds;
use axle_schema::refusal::within;
use axle_schema::{Metres, MetresPerSecondSquared, RadiansPerSecond, Refusal, Sides};
use serde::{Deserialize, Serialize};

/// How finely the encoders count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EncodersParams {
    /// Distance of the rim of a wheel from tick to tick, 1e-6 to 0.1 m.
    pub tick: Metres,
    /// Standard deviation of the noise of a reading, before it is cut to whole ticks, 0 to 0.1 m.
    pub noise: Metres,
    /// How the encoders are connected.
    pub wiring: Wiring,
    /// The way of each wheel, to and fro, after which its encoder counts no more, as one does whose cable has come off;
    /// 0 to 1e6 m, and 0 for one that counts for ever.
    pub stuck: Sides<Metres>,
}

/// How well the gyroscope measures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GyroParams {
    /// What is added to every reading, -0.5 to 0.5 rad/s.
    pub bias: RadiansPerSecond,
    /// Standard deviation of the constant bias around `bias`, 0 to 0.5 rad/s. It is drawn once, from the seed.
    pub bias_deviation: RadiansPerSecond,
    /// Standard deviation of the white noise of a reading, 0 to 0.5 rad/s.
    pub noise_deviation: RadiansPerSecond,
    /// Standard deviation of what the bias has changed by after 1 s, 0 to 0.5 rad/s; it walks at random.
    pub drift: RadiansPerSecond,
}

/// How well the accelerometers measure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AccelerometersParams {
    /// Standard deviation of the constant bias of each axis, 0 to 5 m/s². It is drawn once, from the seed.
    pub bias_deviation: MetresPerSecondSquared,
    /// Standard deviation of the white noise of a reading, 0 to 5 m/s².
    pub noise_deviation: MetresPerSecondSquared,
}

impl Default for EncodersParams {
    /// A wheel of 64 mm with 400 ticks in a turn.
    fn default() -> Self {
        Self {
            tick: Metres(0.0005),
            noise: Metres::ZERO,
            wiring: Wiring::default(),
            stuck: Sides::new(Metres::ZERO, Metres::ZERO),
        }
    }
}
impl Default for GyroParams {
    fn default() -> Self {
        Self {
            bias: RadiansPerSecond::ZERO,
            bias_deviation: RadiansPerSecond(0.005),
            noise_deviation: RadiansPerSecond(0.005),
            drift: RadiansPerSecond::ZERO,
        }
    }
}
impl Default for AccelerometersParams {
    fn default() -> Self {
        Self { bias_deviation: MetresPerSecondSquared(0.05), noise_deviation: MetresPerSecondSquared(0.05) }
    }
}

impl Bounds for EncodersParams {
    fn check(&self) -> Result<(), Refusal> {
        within("encoders.tick in m", self.tick.0, 1e-6, 0.1)?;
        within("encoders.noise in m", self.noise.0, 0.0, 0.1)?;
        within("encoders.stuck.left in m", self.stuck.left.0, 0.0, 1e6)?;
        within("encoders.stuck.right in m", self.stuck.right.0, 0.0, 1e6)
    }
}
impl Bounds for GyroParams {
    fn check(&self) -> Result<(), Refusal> {
        within("gyro.bias in rad/s", self.bias.0, -0.5, 0.5)?;
        within("gyro.bias_deviation in rad/s", self.bias_deviation.0, 0.0, 0.5)?;
        within("gyro.noise_deviation in rad/s", self.noise_deviation.0, 0.0, 0.5)?;
        within("gyro.drift in rad/s", self.drift.0, 0.0, 0.5)
    }
}
impl Bounds for AccelerometersParams {
    fn check(&self) -> Result<(), Refusal> {
        within("accelerometers.bias_deviation in m/s²", self.bias_deviation.0, 0.0, 5.0)?;
        within("accelerometers.noise_deviation in m/s²", self.noise_deviation.0, 0.0, 5.0)
    }
}
