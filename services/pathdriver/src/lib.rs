//! Pathdriver: geometries to movements.
//!
//! Hears [`DriveAsk`] (the legs of a plan, and which robot drives), says [`Drive`] (what both wheels do, movement by
//! movement). It is the functional service between Pathfinder and the D-corrector (paper, section II). No movement
//! that it answers asks more of a wheel than the robot's limits times `effort`.
//!
//! What cannot be driven is refused with the number of the leg and the reason. Each strategy is one file; a new one
//! is that file, a variant of [`Strategy`] and a line in `answer`.

use axle_schema::contract::{Bounds, Functional, Params};
use axle_schema::refusal::within;
use axle_schema::{Drive, DriveAsk, Drivetrain, Message as _, Refusal};
use serde::{Deserialize, Serialize};

mod leg;
mod stop;

/// How one leg goes over into the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Rest after every leg: exact, no jump of a wheel speed, slow (model.md 4.4, P1).
    #[default]
    Stop,
}

/// Parameters of Pathdriver: `deploy/params/pathdriver.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathdriverParams {
    /// How one leg goes over into the next.
    pub strategy: Strategy,
    /// Share of the robot's limits that a plan may use, 0.05 to 1; the rest is headroom for a corrector.
    pub effort: f64,
    /// The robot that drives, where the question does not describe it.
    pub robot: Drivetrain,
}

impl Default for PathdriverParams {
    fn default() -> Self {
        Self { strategy: Strategy::default(), effort: 0.8, robot: Drivetrain::default() }
    }
}

impl Bounds for PathdriverParams {
    fn check(&self) -> Result<(), Refusal> {
        within("effort", self.effort, 0.05, 1.0)?;
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
        let robot = at_effort(ask.robot.unwrap_or(params.robot), params.effort);
        match params.strategy {
            Strategy::Stop => stop::drive(&robot, ask),
        }
    }
}

/// The robot as a plan may use it.
fn at_effort(robot: Drivetrain, effort: f64) -> Drivetrain {
    Drivetrain {
        track: robot.track,
        wheel_speed: robot.wheel_speed * effort,
        wheel_acceleration: robot.wheel_acceleration * effort,
        speed: robot.speed * effort,
        turn_rate: axle_schema::RadiansPerSecond(robot.turn_rate.0 * effort),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Geometry, Leg, Metres, MetresPerSecond, Sides};

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
        let speeds = Some(Sides::new(MetresPerSecond(f64::NAN), MetresPerSecond(0.0)));
        refused(&DriveAsk { speeds, ..ask(line(1.0)) }, "left wheel speed at the beginning");
        refused(&ask(line(1e4)), "leg 1");
    }
}
