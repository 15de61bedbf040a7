//! What a differential-wheeled robot can do: its track and its limits.

use crate::contract::Bounds;
use crate::refusal::within;
use crate::{Metres, MetresPerSecond, MetresPerSecondSquared, RadiansPerSecond, Refusal, Track};
use serde::{Deserialize, Serialize};

/// The body of a robot as planners, correctors, the navigator and the gate need it.
///
/// One description serves them all: a topology gives it once for each robot, since a wrong track in one of several
/// files is the commonest fault of this field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Drivetrain {
    /// Distance between the contact points of the wheels, 1 mm to 100 m.
    pub track: Track,
    /// Largest speed of a wheel, up to 20 m/s.
    pub wheel_speed: MetresPerSecond,
    /// Largest acceleration of a wheel, up to 100 m/s².
    pub wheel_acceleration: MetresPerSecondSquared,
    /// Largest speed of the middle of the axle.
    pub speed: MetresPerSecond,
    /// Largest turn rate, up to 100 rad/s.
    pub turn_rate: RadiansPerSecond,
}

impl Drivetrain {
    /// Radius of the circle around the middle of the axle that holds the whole robot where nobody says another: 0.25 m.
    ///
    /// A plan that is looked at before and the one that the pilot has made are of one robot, so Pathfinder's `body` and the
    /// pilot's `radius` begin with the same.
    pub const BODY: Metres = Metres(0.25);
}

impl Default for Drivetrain {
    /// A small indoor robot: 30 cm between the wheels, half a metre per second.
    fn default() -> Self {
        #[allow(clippy::expect_used, reason = "a constant within its range")]
        Self {
            track: Track::new(Metres(0.3)).expect("0.3 m is a track"),
            wheel_speed: MetresPerSecond(1.0),
            wheel_acceleration: MetresPerSecondSquared(1.5),
            speed: MetresPerSecond(0.6),
            turn_rate: RadiansPerSecond(2.0),
        }
    }
}

impl Bounds for Drivetrain {
    fn check(&self) -> Result<(), Refusal> {
        within("robot.wheel_speed in m/s", self.wheel_speed.0, 1e-3, crate::dwm::MAX_WHEEL_SPEED)?;
        within("robot.wheel_acceleration in m/s²", self.wheel_acceleration.0, 1e-3, 100.0)?;
        within("robot.speed in m/s", self.speed.0, 1e-3, crate::dwm::MAX_WHEEL_SPEED)?;
        within("robot.turn_rate in rad/s", self.turn_rate.0, 1e-3, 100.0)
    }
}
