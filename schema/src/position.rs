//! Where the robot is in both frames, and how it is told.

use crate::codec::Message;
use crate::id::Boot;
use crate::refusal::within;
use crate::unit::Numbers;
use crate::{EncodersData, NavigatorData, Pose, Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// Where the robot is in both frames of REP-105.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Position {
    /// The run of the robot process whose clock and whose encoders these are.
    pub boot: Boot,
    /// The reading of the encoders that it belongs to: a navigator that takes over goes on from here.
    pub wheels: EncodersData,
    /// Pose, twist and covariance in `odom`, which is continuous and drifts.
    pub odom: NavigatorData,
    /// The pose in `map`, which does not drift and jumps with each fix.
    pub map: Pose,
    /// Covariance of (x, y, heading) in `map`, row by row.
    pub map_covariance: Numbers<9>,
    /// Where the origin of `odom` is in `map`; fixes move it.
    pub map_to_odom: Pose,
}

impl Message for Position {
    const NAME: &'static str = "Position";
    const LIMIT: usize = 2048;
    fn check(&self) -> Result<(), Refusal> {
        self.wheels.check()?;
        self.odom.check()?;
        self.map.check()?;
        self.map_to_odom.check()?;
        variances(&self.map_covariance)
    }
}

/// Asks the navigator where the robot is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetPosition {}
impl Message for GetPosition {
    const NAME: &'static str = "GetPosition";
    const LIMIT: usize = 64;
}

/// Tells the navigator where the robot is: an absolute reference. Uncertainty restarts with it, and what was measured
/// before it is obsolete.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetPosition {
    /// In `map`.
    pub pose: Pose,
    /// Covariance of (x, y, heading), row by row; left out, that of 1 cm and 1 degree.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<Numbers<9>>,
    /// When the robot was there, by its own clock; left out, at the newest measurement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stamp: Option<Seconds>,
}

impl SetPosition {
    /// The covariance, or that of 1 cm and 1 degree.
    #[must_use]
    pub fn covariance(&self) -> Numbers<9> {
        let heading = 1_f64.to_radians().powi(2);
        self.covariance.unwrap_or(Numbers([1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, heading]))
    }
}

impl Message for SetPosition {
    const NAME: &'static str = "SetPosition";
    const LIMIT: usize = 512;
    fn check(&self) -> Result<(), Refusal> {
        self.pose.check()?;
        self.covariance.as_ref().map_or(Ok(()), variances)
    }
}

fn variances(covariance: &Numbers<9>) -> Result<(), Refusal> {
    for (name, index) in [("x", 0), ("y", 4), ("heading", 8)] {
        within(&format!("variance of {name}"), covariance.0[index], 0.0, f64::MAX)?;
    }
    Ok(())
}
