//! What Source says: the latest measurements, and windows of older ones.

use crate::codec::Message;
use crate::id::Boot;
use crate::plan::limit_list;
use crate::refusal::within;
use crate::{EncodersData, Fix, InertialData, Position, Range, Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// The most measurements of one kind that a window holds.
pub const MAX_WINDOW: usize = 4096;

/// Asks Source for its measurements of an interval of the robot's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WindowAsk {
    /// From this many seconds before the latest measurement; left out, everything that is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since: Option<Seconds>,
}
impl Message for WindowAsk {
    const NAME: &'static str = "WindowAsk";
    const LIMIT: usize = 64;
    fn check(&self) -> Result<(), Refusal> {
        self.since.map_or(Ok(()), |since| within("since in seconds", since.0, 0.0, 1e9))
    }
}

/// Measurements in the order of their stamps, oldest first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// The run of the robot process whose clock stamped them.
    pub boot: Boot,
    /// Wheel distances.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub encoders: Vec<EncodersData>,
    /// Turn rates and accelerations.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inertial: Vec<InertialData>,
    /// Absolute positions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fixes: Vec<Fix>,
    /// Distances to known points.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ranges: Vec<Range>,
    /// Measurements that never reached the buffer since the robot's boot, known by gaps in their sequence numbers.
    #[serde(default)]
    pub dropped: u64,
    /// The newest position that the navigator has said: it goes on from there after a restart. In answers only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<Position>,
}
impl Message for Window {
    const NAME: &'static str = "Window";
    const LIMIT: usize = 1536 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("encoders of a window", self.encoders.len(), MAX_WINDOW)?;
        limit_list("inertial data of a window", self.inertial.len(), MAX_WINDOW)?;
        limit_list("fixes of a window", self.fixes.len(), MAX_WINDOW)?;
        limit_list("ranges of a window", self.ranges.len(), MAX_WINDOW)?;
        self.encoders.iter().try_for_each(Message::check)?;
        self.fixes.iter().try_for_each(Message::check)?;
        self.ranges.iter().try_for_each(Message::check)?;
        self.position.as_ref().map_or(Ok(()), Message::check)
    }
}
