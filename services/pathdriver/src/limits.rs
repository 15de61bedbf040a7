//! What a plan may ask of a robot: its wheels, and what it carries.

use axle_schema::contract::Bounds;
use axle_schema::refusal::within;
use axle_schema::{Drivetrain, Metres, MetresPerSecondSquared, RadiansPerSecond, Refusal};
use serde::{Deserialize, Serialize};

/// What the body of the robot bears, beside what its wheels can do: the table `[body]`. The defaults limit nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Body {
    /// Largest acceleration of the middle of the axle, 0.001 to 100 m/s².
    pub acceleration: MetresPerSecondSquared,
    /// Largest change of the turn rate, 0.001 to 1000 rad/s².
    pub turn_acceleration: f64,
    /// Largest lateral acceleration (speed times turn rate), 0.001 to 100 m/s².
    pub lateral: MetresPerSecondSquared,
}

impl Default for Body {
    fn default() -> Self {
        Self {
            acceleration: MetresPerSecondSquared(100.0),
            turn_acceleration: 1000.0,
            lateral: MetresPerSecondSquared(100.0),
        }
    }
}

impl Bounds for Body {
    fn check(&self) -> Result<(), Refusal> {
        within("body.acceleration in m/s²", self.acceleration.0, 1e-3, 100.0)?;
        within("body.turn_acceleration in rad/s²", self.turn_acceleration, 1e-3, 1000.0)?;
        within("body.lateral in m/s²", self.lateral.0, 1e-3, 100.0)
    }
}

/// All limits that a plan keeps; symbols as in model.md 4.4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits {
    /// What the wheels can do, and the largest speed and turn rate.
    pub(crate) robot: Drivetrain,
    /// a_lin, m/s².
    pub(crate) acceleration: f64,
    /// a_ang, rad/s².
    pub(crate) turn_acceleration: f64,
    /// a_lat, m/s².
    pub(crate) lateral: f64,
}

impl Limits {
    /// The robot as a plan may use it: `effort` is the share of every limit.
    pub(crate) fn at_effort(robot: Drivetrain, body: &Body, effort: f64) -> Self {
        Self {
            robot: Drivetrain {
                track: robot.track,
                wheel_speed: robot.wheel_speed * effort,
                wheel_acceleration: robot.wheel_acceleration * effort,
                speed: robot.speed * effort,
                turn_rate: RadiansPerSecond(robot.turn_rate.0 * effort),
            },
            acceleration: body.acceleration.0 * effort,
            turn_acceleration: body.turn_acceleration * effort,
            lateral: body.lateral.0 * effort,
        }
    }

    /// A robot whose wheels alone limit it.
    #[cfg(test)]
    pub(crate) fn of_wheels(robot: Drivetrain) -> Self {
        let none = f64::INFINITY;
        Self { robot, acceleration: none, turn_acceleration: none, lateral: none }
    }
}

/// What a joint of two legs may cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Allowed {
    /// The most that a wheel speed may jump, m/s.
    pub(crate) jump: f64,
    /// The most that one blend may move the rest of the path aside.
    pub(crate) offset: Metres,
}
