//! What the functional services are asked and answer: from way points to geometries to movements.

use crate::codec::Message;
use crate::contract::Bounds as _;
use crate::drivetrain::Drivetrain;
use crate::dwm::MAX_WHEEL_SPEED;
use crate::refusal::within;
use crate::way::MAX_POINTS;
use crate::{Dwm, Geometry, Metres, MetresPerSecond, Pose, Refusal, Seconds, Sides, WayTask};
use serde::{Deserialize, Serialize};

/// The most geometries a plan may have: a turn, a line and a final turn for every way point.
pub const MAX_LEGS: usize = 3 * MAX_POINTS;
/// The most movements a drive may have: speeding up, cruising and braking on every leg.
pub const MAX_DWMS: usize = 3 * MAX_LEGS;
/// The most remarks a plan may carry, and the most letters of one.
pub const MAX_NOTES: usize = 16;

/// Asks Pathfinder for a plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanAsk {
    /// The points to visit.
    pub way: WayTask,
    /// Where the robot is; left out, it is where odometry begins: (0, 0), heading 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<Pose>,
}

/// Pathfinder's answer: the geometries to drive, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Where the first leg begins.
    pub start: Pose,
    /// The pieces of the path; none when there is nothing to drive.
    pub legs: Vec<Leg>,
    /// Path of the middle of the axle.
    pub length: Metres,
    /// What the asker should know, in sentences: a repeated point, for example.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// One piece of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Leg {
    /// Its shape.
    pub geometry: Geometry,
    /// The way point it leads to, counted from 0.
    pub point: u32,
    /// The largest speed of the middle of the axle on this leg, if the way point gave one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed: Option<MetresPerSecond>,
}

/// Asks Pathdriver for movements.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveAsk {
    /// The pieces of the path.
    pub legs: Vec<Leg>,
    /// Wheel speeds at the beginning; left out, the robot stands.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speeds: Option<Sides<MetresPerSecond>>,
    /// The robot that will drive; left out, the one of Pathdriver's own parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<Drivetrain>,
}

/// Pathdriver's answer: the movements to make, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Drive {
    /// The movements; the last one ends at rest.
    pub dwms: Vec<Dwm>,
    /// How many movements each leg was made into, in the order of the legs.
    pub counts: Vec<u32>,
    /// The largest jump of a wheel speed between two movements; 0 where the answer allows none.
    pub jump: MetresPerSecond,
    /// Duration of all movements.
    pub duration: Seconds,
}

fn check_legs(legs: &[Leg]) -> Result<(), Refusal> {
    limit_list("legs of a plan", legs.len(), MAX_LEGS)?;
    for leg in legs {
        leg.geometry.check()?;
        if let Some(speed) = leg.speed {
            within("speed of a leg", speed.0, 1e-3, MAX_WHEEL_SPEED)?;
        }
    }
    Ok(())
}

/// Refuses a list that is longer than `limit`.
pub(crate) fn limit_list(what: &str, length: usize, limit: usize) -> Result<(), Refusal> {
    if length <= limit {
        Ok(())
    } else {
        Err(Refusal::TooLarge { what: what.into(), got: length as u64, limit: limit as u64 })
    }
}

impl Message for PlanAsk {
    const NAME: &'static str = "PlanAsk";
    const LIMIT: usize = 256 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        self.way.check()
    }
}
impl Message for Plan {
    const NAME: &'static str = "Plan";
    const LIMIT: usize = 1024 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("notes of a plan", self.notes.len(), MAX_NOTES)?;
        check_legs(&self.legs)
    }
}
impl Message for DriveAsk {
    const NAME: &'static str = "DriveAsk";
    const LIMIT: usize = 1024 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        self.robot.map_or(Ok(()), |robot| robot.check())?;
        let speeds = self.speeds.unwrap_or_default();
        for (side, speed) in [("left", speeds.left), ("right", speeds.right)] {
            let what = format!("{side} wheel speed at the beginning in m/s");
            within(&what, speed.0, -MAX_WHEEL_SPEED, MAX_WHEEL_SPEED)?;
        }
        check_legs(&self.legs)
    }
}
impl Message for Drive {
    const NAME: &'static str = "Drive";
    const LIMIT: usize = 4 * 1024 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("movements of a drive", self.dwms.len(), MAX_DWMS)?;
        for dwm in &self.dwms {
            within("wheel speed of a movement in m/s", dwm.peak_speed().0, 0.0, MAX_WHEEL_SPEED)?;
        }
        limit_list("legs of a drive", self.counts.len(), MAX_LEGS)
    }
}
