//! What of the gate may be chosen, and within which limits.

use axle_schema::contract::Bounds;
use axle_schema::refusal::within;
use axle_schema::{Drivetrain, MetresPerSecondSquared, Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// Parameters of the gate; they are part of the parameters of the process that owns the wheels.
///
/// No value switches a check off: the ranges forbid it, and no zero means "never".
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GateParams {
    /// The oldest echo of the robot's clock that a command may carry, 0.05 to 1 s. It bounds how old the measurements
    /// are that a command was computed from, network both ways included, and ends its movement when they are that old;
    /// for holders who may be silent for longer than 150 ms, later by the difference.
    pub max_age: Seconds,
    /// How long the last speed is held when a movement is over and no next one came, 0 to 0.1 s (0 brakes at once).
    /// It rides out the jitter of a commander whose movements last exactly one period.
    pub grace: Seconds,
    /// Deceleration of the faster wheel when the gate brakes, 0.25 to 20 m/s².
    pub a_stop: MetresPerSecondSquared,
    /// Largest acceleration of a wheel in setpoints and commands, 0.25 to 100 m/s². A bit more than the
    /// `robot.wheel_acceleration` that planners keep to, so that corrections have room, and never less.
    pub a_max: MetresPerSecondSquared,
    /// Largest change of the acceleration of a setpoint, 1 to 1000 m/s³; left out, there is no such limit. For robots
    /// that carry what may topple or spill. Every braking takes up to `2 a_stop / jerk` longer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jerk: Option<f64>,
    /// Whether the wheels may move right after a boot without an enable. Not for a robot of metal: after a crash
    /// and restart somebody may stand in front of it. A stored AllStop is stronger.
    pub starts_enabled: bool,
}

impl Default for GateParams {
    fn default() -> Self {
        Self {
            max_age: Seconds(0.25),
            grace: Seconds(0.05),
            a_stop: MetresPerSecondSquared(2.0),
            a_max: MetresPerSecondSquared(2.5),
            jerk: None,
            starts_enabled: false,
        }
    }
}

impl Bounds for GateParams {
    fn check(&self) -> Result<(), Refusal> {
        within("gate.max_age in s", self.max_age.0, 0.05, 1.0)?;
        within("gate.grace in s", self.grace.0, 0.0, 0.1)?;
        within("gate.a_stop in m/s²", self.a_stop.0, 0.25, 20.0)?;
        within("gate.a_max in m/s²", self.a_max.0, 0.25, 100.0)?;
        self.jerk.map_or(Ok(()), |jerk| within("gate.jerk in m/s³", jerk, 1.0, 1000.0))
    }
}

impl GateParams {
    /// Checks that the gate lets through what the planners of this robot ask for.
    ///
    /// # Errors
    /// Refuses an `a_max` below the wheel acceleration of the robot, and what [`Bounds::check`] refuses.
    pub fn fits(&self, robot: &Drivetrain) -> Result<(), Refusal> {
        self.check()?;
        within(
            "gate.a_max in m/s² (not below robot.wheel_acceleration)",
            self.a_max.0,
            robot.wheel_acceleration.0,
            100.0,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gate_cannot_be_configured_off() {
        let fine = GateParams::default();
        assert!(fine.fits(&Drivetrain::default()).is_ok());
        let wrong = [
            GateParams { max_age: Seconds(0.0), ..fine },
            GateParams { max_age: Seconds(10.0), ..fine },
            GateParams { max_age: Seconds(f64::NAN), ..fine },
            GateParams { grace: Seconds(-1.0), ..fine },
            GateParams { grace: Seconds(1.0), ..fine },
            GateParams { a_stop: MetresPerSecondSquared(0.0), ..fine },
            GateParams { a_stop: MetresPerSecondSquared(f64::INFINITY), ..fine },
            GateParams { a_max: MetresPerSecondSquared(f64::NAN), ..fine },
            GateParams { a_max: MetresPerSecondSquared(1.0), ..fine },
            GateParams { jerk: Some(0.0), ..fine },
            GateParams { jerk: Some(f64::NAN), ..fine },
        ];
        for params in wrong {
            assert!(params.fits(&Drivetrain::default()).is_err(), "{params:?} is refused");
        }
    }
}
