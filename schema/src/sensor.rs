//! What else a robot measures and is told: inertia, absolute fixes, motor signals.

use crate::codec::Message;
use crate::refusal::within;
use crate::unit::{Duty, Numbers, deserialize_finite, finite};
use crate::{Metres, MetresPerSecondSquared, Radians, RadiansPerSecond, Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// What a gyroscope and accelerometers say at a stamp of the robot's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InertialData {
    /// Seconds since the boot of the robot process.
    pub stamp: Seconds,
    /// Turn rate about the vertical axis, counter-clockwise positive: the mean since the reading before, so that the
    /// readings sum up to the turn.
    pub gyro: RadiansPerSecond,
    /// Acceleration forward, where it is measured: the mean since the reading before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ax: Option<MetresPerSecondSquared>,
    /// Acceleration to the left, where it is measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ay: Option<MetresPerSecondSquared>,
}

/// An absolute position, from a barcode or a beacon, in the frame `map`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fix {
    /// Seconds since the boot of the robot process.
    pub stamp: Seconds,
    /// Position along x.
    pub x: Metres,
    /// Position along y.
    pub y: Metres,
    /// Covariance of (x, y), row by row, in m².
    pub covariance: Numbers<4>,
    /// The heading, where the sensor knows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading: Option<HeadingFix>,
}

/// An absolute heading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeadingFix {
    /// Direction of the robot's x axis.
    pub angle: Radians,
    /// Its variance, in rad².
    #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
    pub variance: f64,
}

/// The distance to a known point, such as an ultra-wideband anchor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// Seconds since the boot of the robot process.
    pub stamp: Seconds,
    /// The point's position along x, in `map`.
    pub x: Metres,
    /// The point's position along y, in `map`.
    pub y: Metres,
    /// How far it is from the middle of the axle.
    pub distance: Metres,
    /// Standard deviation of the distance, above 0.
    pub sd: Metres,
}

/// The duty cycles of both motors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Signals {
    /// Of the left motor.
    pub left: Duty,
    /// Of the right motor.
    pub right: Duty,
}

impl Message for InertialData {
    const NAME: &'static str = "InertialData";
    const LIMIT: usize = 256;
}
impl Message for Fix {
    const NAME: &'static str = "Fix";
    const LIMIT: usize = 512;
    fn check(&self) -> Result<(), Refusal> {
        within("variance of x", self.covariance.0[0], 0.0, f64::MAX)?;
        within("variance of y", self.covariance.0[3], 0.0, f64::MAX)?;
        self.heading
            .map_or(Ok(()), |heading| within("variance of the heading", heading.variance, 0.0, f64::MAX))
    }
}
impl Message for Range {
    const NAME: &'static str = "Range";
    const LIMIT: usize = 256;
    fn check(&self) -> Result<(), Refusal> {
        within("sd of the distance in m", self.sd.0, 1e-9, 1e9)
    }
}
impl Message for Signals {
    const NAME: &'static str = "Signals";
    const LIMIT: usize = 128;
}
