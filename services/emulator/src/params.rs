//! What of the emulated robot may be chosen.

use crate::board::BoardParams;
use axle_gate::GateParams;
use axle_schema::contract::{Bounds, Params};
use axle_schema::refusal::within;
use axle_schema::{Drivetrain, Pose, Refusal, Seconds};
use serde::{Deserialize, Serialize};

mod body;
mod senses;
pub use body::{BatteryParams, MotorsParams, ResponseParams, SlipParams, WallsParams, WheelsParams};
pub use senses::{AccelerometersParams, EncodersParams, GyroParams};

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
    /// How its wheels differ from what everybody believes.
    pub wheels: WheelsParams,
    /// Whether the calibration that is kept for this robot is applied.
    pub calibrated: bool,
    /// What its battery gives.
    pub battery: BatteryParams,
    /// How its wheels slip.
    pub slip: SlipParams,
    /// Whether walls stand in its way.
    pub walls: WallsParams,
    /// How finely its encoders count.
    pub encoders: EncodersParams,
    /// How well its gyroscope measures.
    pub gyro: GyroParams,
    /// How well its accelerometers measure.
    pub accelerometers: AccelerometersParams,
    /// What is odd about its board, where it is emulated with one.
    pub board: BoardParams,
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
            wheels: WheelsParams::default(),
            calibrated: true,
            battery: BatteryParams::default(),
            slip: SlipParams::default(),
            walls: WallsParams::default(),
            encoders: EncodersParams::default(),
            gyro: GyroParams::default(),
            accelerometers: AccelerometersParams::default(),
            board: BoardParams::default(),
        }
    }
}
impl Default for Rates {
    fn default() -> Self {
        Self { beat: Seconds(0.005), encoders_hz: 50.0, inertial_hz: 50.0, truth_hz: 20.0 }
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
        self.motors.check()?;
        self.wheels.check()?;
        self.battery.check()?;
        self.slip.check()?;
        self.walls.check()?;
        self.encoders.check()?;
        self.gyro.check()?;
        self.accelerometers.check()?;
        self.board.check()
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
            "[motors]\ngain = { left = 0.0, right = 1.0 }",
            "[motors]\nlag = -0.1",
            "[motors]\nbreakaway = { left = 0.0, right = 0.6 }",
            "[motors.response]\ntime = 3.0",
            "[wheels]\ntrack = 0.0",
            "[wheels]\nsize = { left = 1.0, right = 2.0 }",
            "[battery]\nsag = 1.0",
            "[slip]\nshare = 1.5",
            "[walls]\nbody = 0",
            "[gyro]\nbias = 1.0",
            "[accelerometers]\nnoise_deviation = -1",
            "[gate]\na_max = 1",
        ] {
            let params: EmulatorParams = toml::from_str(text).expect("parameters");
            assert!(params.check().is_err(), "{text:?} is refused");
        }
    }
}
