//! What of the emulated robot may be chosen.

use axle_gate::GateParams;
use axle_schema::contract::{Bounds, Params};
use axle_schema::refusal::within;
use axle_schema::{Drivetrain, Metres, Pose, RadiansPerSecond, Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// Parameters of the emulator and of the gate before it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatorParams {
    /// Where its errors are drawn from: the same seed, commands and times give the same robot, bit for bit.
    pub seed: u64,
    /// The body of the robot.
    pub robot: Drivetrain,
    /// The gate.
    pub gate: GateParams,
    /// How often it moves and speaks.
    pub rates: Rates,
    /// Where it stands at first.
    pub start: Pose,
    /// How badly its motors obey.
    pub motors: MotorsParams,
    /// How finely its encoders count.
    pub encoders: EncodersParams,
    /// How well its gyroscope measures.
    pub gyro: GyroParams,
}

/// How often the emulated robot moves and speaks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rates {
    /// Time from beat to beat of gate and physics, 0.005 to 0.02 s.
    pub beat: Seconds,
    /// Encoder readings in a second, 1 to 200.
    pub encoders_hz: f64,
    /// Gyroscope readings in a second, 1 to 200.
    pub inertial_hz: f64,
    /// True poses in a second, 1 to 200.
    pub truth_hz: f64,
}

/// How badly the motors obey.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotorsParams {
    /// Standard deviation of the constant gain of each wheel around 1, 0 to 0.1. The gains are drawn once, from the
    /// seed, within three deviations.
    pub gain_deviation: f64,
    /// Standard deviation of the distance of a wheel after 1 m, in m, 0 to 0.05. It grows with the square root of
    /// the distance, so that the length of the beats does not matter, and a wheel at rest rests.
    pub jitter: Metres,
}

/// How finely the encoders count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EncodersParams {
    /// Distance of the rim of a wheel from tick to tick, 1e-6 to 0.1 m.
    pub tick: Metres,
}

/// How well the gyroscope measures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GyroParams {
    /// Standard deviation of the constant bias, 0 to 0.5 rad/s. The bias is drawn once, from the seed.
    pub bias_deviation: RadiansPerSecond,
    /// Standard deviation of the white noise of a reading, 0 to 0.5 rad/s.
    pub noise_deviation: RadiansPerSecond,
}

impl Default for EmulatorParams {
    fn default() -> Self {
        Self {
            seed: 1,
            robot: Drivetrain::default(),
            // Nobody can be hurt by an emulated robot, and a demonstration shall drive without a person at the desk.
            gate: GateParams { starts_enabled: true, ..GateParams::default() },
            rates: Rates::default(),
            start: Pose::default(),
            motors: MotorsParams::default(),
            encoders: EncodersParams::default(),
            gyro: GyroParams::default(),
        }
    }
}
impl Default for Rates {
    fn default() -> Self {
        Self { beat: Seconds(0.005), encoders_hz: 50.0, inertial_hz: 50.0, truth_hz: 20.0 }
    }
}
impl Default for MotorsParams {
    fn default() -> Self {
        Self { gain_deviation: 0.01, jitter: Metres(0.001) }
    }
}
impl Default for EncodersParams {
    /// A wheel of 64 mm with 400 ticks in a turn.
    fn default() -> Self {
        Self { tick: Metres(0.0005) }
    }
}
impl Default for GyroParams {
    fn default() -> Self {
        Self { bias_deviation: RadiansPerSecond(0.005), noise_deviation: RadiansPerSecond(0.005) }
    }
}

impl Bounds for EmulatorParams {
    fn check(&self) -> Result<(), Refusal> {
        self.robot.check()?;
        self.gate.fits(&self.robot)?;
        within("rates.beat in s", self.rates.beat.0, 0.005, 0.02)?;
        within("rates.encoders_hz", self.rates.encoders_hz, 1.0, 200.0)?;
        within("rates.inertial_hz", self.rates.inertial_hz, 1.0, 200.0)?;
        within("rates.truth_hz", self.rates.truth_hz, 1.0, 200.0)?;
        within("start.x in m", self.start.x.0, -1e4, 1e4)?;
        within("start.y in m", self.start.y.0, -1e4, 1e4)?;
        within("start.heading in rad", self.start.heading.0, -1e3, 1e3)?;
        within("motors.gain_deviation", self.motors.gain_deviation, 0.0, 0.1)?;
        within("motors.jitter in m", self.motors.jitter.0, 0.0, 0.05)?;
        within("encoders.tick in m", self.encoders.tick.0, 1e-6, 0.1)?;
        within("gyro.bias_deviation in rad/s", self.gyro.bias_deviation.0, 0.0, 0.5)?;
        within("gyro.noise_deviation in rad/s", self.gyro.noise_deviation.0, 0.0, 0.5)
    }
}

impl Params for EmulatorParams {
    const FILE: &'static str = include_str!("../../../deploy/params/emulator.toml");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_file_holds_every_default() {
        let file: toml::Table = toml::from_str(EmulatorParams::FILE).expect("a table");
        let defaults = toml::Table::try_from(EmulatorParams::default()).expect("a table");
        assert_eq!(file, defaults);
        let params: EmulatorParams = toml::from_str(EmulatorParams::FILE).expect("parameters");
        assert_eq!(params, EmulatorParams::default());
        params.check().expect("within their ranges");
    }

    #[test]
    fn unknown_fields_and_values_out_of_range_are_refused() {
        for text in
            ["tick = 1", "[encoders]\ntock = 1.0", "[gate]\nmax_agee = 0.25", "[encoders]\ntick = nan"]
        {
            assert!(toml::from_str::<EmulatorParams>(text).is_err(), "{text:?} is refused");
        }
        for text in [
            "[rates]\nbeat = 0.1",
            "[encoders]\ntick = 0",
            "[motors]\ngain_deviation = 0.5",
            "[gate]\na_max = 1",
        ] {
            let params: EmulatorParams = toml::from_str(text).expect("parameters");
            assert!(params.check().is_err(), "{text:?} is refused");
        }
    }
}
