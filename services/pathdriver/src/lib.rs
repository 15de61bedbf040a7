//! Pathdriver: geometries to movements.
//!
//! Hears [`DriveAsk`] (the legs of a plan, and which robot drives), says [`Drive`] (what both wheels do, movement by
//! movement, and what jumps and offsets that cost). It is the functional service between Pathfinder and the D-corrector (paper, section II). No movement
//! that it answers asks more of a wheel or of the body than the robot's limits times `effort`.
//!
//! What cannot be driven is refused with the number of the leg and the reason. Each strategy is one file; a new one
//! is that file, a variant of [`Strategy`] and a line in `answer`.

use axle_schema::contract::{Bounds, Functional, Params};
use axle_schema::refusal::within;
use axle_schema::{Drive, DriveAsk, Drivetrain, Manner, Message as _, Metres, MetresPerSecond, Refusal};
use serde::{Deserialize, Serialize};

mod continuous;
mod leg;
mod limits;
mod stop;

use limits::{Allowed, Limits};

pub use axle_schema::{Joints, Strategy};
pub use limits::Body;

/// Parameters of Pathdriver: `deploy/params/pathdriver.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathdriverParams {
    /// How the speeds are chosen, where the question does not say it.
    pub strategy: Strategy,
    /// How legs of different curvature meet in a continuous drive, where the question does not say it.
    pub joints: Joints,
    /// The most that a wheel speed may jump, 0 to 1 m/s.
    pub jump: MetresPerSecond,
    /// The most that one blend may move the rest of the path aside, 0 to 0.1 m.
    pub offset: Metres,
    /// Share of the robot's limits that a plan may use, 0.05 to 1; the rest is headroom for a corrector.
    pub effort: f64,
    /// What the body of the robot bears, beside what its wheels can do.
    pub body: Body,
    /// The robot that drives, where the question does not describe it.
    pub robot: Drivetrain,
}

impl Default for PathdriverParams {
    fn default() -> Self {
        Self {
            strategy: Strategy::default(),
            joints: Joints::default(),
            // What the wheels of the default robot change in a beat of a corrector, 50 ms at 80 % of 1.5 m/s².
            jump: MetresPerSecond(0.06),
            offset: Metres(0.001),
            effort: 0.8,
            body: Body::default(),
            robot: Drivetrain::default(),
        }
    }
}

impl Bounds for PathdriverParams {
    fn check(&self) -> Result<(), Refusal> {
        within("jump in m/s", self.jump.0, 0.0, Manner::MAX_JUMP)?;
        within("offset in m", self.offset.0, 0.0, Manner::MAX_OFFSET)?;
        within("effort", self.effort, 0.05, 1.0)?;
        self.body.check()?;
        self.robot.check()
    }
}

impl Params for PathdriverParams {
    const FILE: &'static str = include_str!("../../../deploy/params/pathdriver.toml");
}

/// The service that makes movements of a path.
#[derive(Clone, Copy, Debug)]
pub struct Pathdriver;

impl Functional for Pathdriver {
    type Params = PathdriverParams;
    type Ask = DriveAsk;
    type Answer = Drive;

    fn answer(params: &PathdriverParams, ask: &DriveAsk) -> Result<Drive, Refusal> {
        params.check()?;
        ask.check()?;
        let limits = Limits::at_effort(ask.robot.unwrap_or(params.robot), &params.body, params.effort);
        let manner = ask.manner.unwrap_or_default();
        match manner.strategy.unwrap_or(params.strategy) {
            Strategy::Stop => stop::drive(&limits, ask),
            Strategy::Continuous => {
                let allowed = Allowed {
                    jump: manner.jump.unwrap_or(params.jump).0,
                    offset: manner.offset.unwrap_or(params.offset),
                };
                continuous::drive(&limits, manner.joints.unwrap_or(params.joints), allowed, ask)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Geometry, Leg, MetresPerSecondSquared, RadiansPerSecond, Sides};

    fn refused(ask: &DriveAsk, words: &str) {
        let refusal = Pathdriver::answer(&PathdriverParams::default(), ask).expect_err(words).to_string();
        assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
    }

    #[test]
    fn the_parameter_file_holds_the_defaults() {
        let read: PathdriverParams = toml::from_str(PathdriverParams::FILE).expect("the file is valid");
        assert_eq!(read, PathdriverParams::default());
        let written = toml::Table::try_from(PathdriverParams::default()).expect("parameters are a table");
        let table: toml::Table = toml::from_str(PathdriverParams::FILE).expect("the file is a table");
        assert_eq!(table, written, "the file lists every field");
        assert!(toml::from_str::<PathdriverParams>("efort = 0.1").is_err(), "a misspelt field is refused");
    }

    #[test]
    fn a_parameter_out_of_its_range_is_refused_by_name() {
        for effort in [0.0, 1.1, f64::NAN] {
            let params = PathdriverParams { effort, ..PathdriverParams::default() };
            assert!(params.check().expect_err("effort is wrong").to_string().contains("effort"));
        }
    }

    #[test]
    fn a_bad_question_is_refused_by_the_name_of_its_fault() {
        let line =
            |length| Leg { geometry: Geometry::Line { length: Metres(length) }, point: 0, speed: None };
        let ask = |leg| DriveAsk { legs: vec![leg], ..DriveAsk::default() };
        refused(&ask(line(f64::NAN)), "length of a line is out of range: NaN");
        refused(&ask(Leg { speed: Some(MetresPerSecond(0.0)), ..line(1.0) }), "speed of a leg");
        let robot = Drivetrain { wheel_speed: MetresPerSecond(f64::NAN), ..Drivetrain::default() };
        refused(&DriveAsk { robot: Some(robot), ..ask(line(1.0)) }, "robot.wheel_speed in m/s");
        let usual = Drivetrain::default();
        for (what, robot) in [
            ("robot.wheel_speed in m/s", Drivetrain { wheel_speed: MetresPerSecond(0.0), ..usual }),
            (
                "robot.wheel_acceleration in m/s²",
                Drivetrain { wheel_acceleration: MetresPerSecondSquared(0.0), ..usual },
            ),
            ("robot.speed in m/s", Drivetrain { speed: MetresPerSecond(-1.0), ..usual }),
            ("robot.turn_rate in rad/s", Drivetrain { turn_rate: RadiansPerSecond(0.0), ..usual }),
        ] {
            refused(&DriveAsk { robot: Some(robot), ..ask(line(1.0)) }, what);
        }
        let many = vec![line(0.1); 1_000_000];
        refused(&DriveAsk { legs: many, ..DriveAsk::default() }, "legs of a plan is too large: 1000000");
        let speeds = Some(Sides::new(MetresPerSecond(f64::NAN), MetresPerSecond(0.0)));
        refused(&DriveAsk { speeds, ..ask(line(1.0)) }, "left wheel speed at the beginning");
        refused(&ask(line(1e4)), "leg 1");
    }
}
