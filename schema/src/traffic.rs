//! What robots of a fleet and Traffic say to each other, and the word of a person who confirms.
//!
//! A robot tells Traffic its whole way once, cut into pieces, and from then on only how many pieces are behind it.
//! Traffic answers how many it may drive.

use crate::codec::Message;
use crate::id::{RobotId, TaskId};
use crate::plan::{Leg, MAX_LEGS, MAX_NOTES, limit_list};
use crate::refusal::within;
use crate::{Metres, Pose, Refusal};
use serde::{Deserialize, Serialize};

/// The most robots of a fleet.
pub const MAX_ROBOTS: usize = 64;

/// Tells Traffic where a robot is and what it wants to drive; asked again and again while it drives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Claim {
    /// Who it is.
    pub robot: RobotId,
    /// The task it drives.
    pub task: TaskId,
    /// Pieces of the way that are behind it.
    pub passed: u32,
    /// Pieces that it was allowed to drive so far: a Traffic that was started anew believes it.
    pub until: u32,
    /// The way, when it is new; left out, it is the one that was told before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub way: Option<ClaimedWay>,
}

/// The way of a robot. A piece ends with each leg that is not a turn, and with the last leg.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClaimedWay {
    /// Where it begins, in a frame that all robots of the fleet share.
    pub start: Pose,
    /// What is driven from there; none for a robot that stays where it is.
    pub legs: Vec<Leg>,
    /// The circle around the middle of the axle that the robot and its load never leave, 0.01 to 5 m.
    pub radius: Metres,
}

/// Traffic's answer to a [`Claim`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Clearance {
    /// The task that it is about.
    pub task: TaskId,
    /// Pieces of the way that may be driven, counted from its beginning; it never becomes less.
    pub until: u32,
    /// All pieces of the way.
    pub pieces: u32,
    /// Whom the robot waits for; none while it may drive on.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub waits: Vec<Wait>,
}

/// One reason to wait.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Wait {
    /// For whom.
    pub robot: RobotId,
    /// What that robot does, in a sentence.
    pub why: String,
}

/// Asks Traffic for its whole account.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrafficAsk {}

/// Every robot that Traffic knows, in the order in which they can end their tasks one after the other; those that
/// cannot, and those without a task, come last.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrafficState {
    /// The robots.
    pub robots: Vec<Mover>,
}

/// One robot in Traffic's account.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mover {
    /// Who.
    pub robot: RobotId,
    /// Its task.
    pub task: TaskId,
    /// Where the pieces end that are behind it.
    pub place: Pose,
    /// Pieces behind it.
    pub passed: u32,
    /// Pieces that it may drive.
    pub until: u32,
    /// All pieces of its way; 0 for a robot that stays.
    pub pieces: u32,
    /// Its place in the order, from 1; none where it cannot end its task as things are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn: Option<u32>,
    /// Whom it waits for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub waits: Vec<Wait>,
}

/// A person's word that a robot may drive on from where it is loaded or unloaded.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Confirm {
    /// Who confirms, in words that a person understands; at most 96 bytes.
    pub by: String,
}

fn check_waits(waits: &[Wait]) -> Result<(), Refusal> {
    limit_list("robots to wait for", waits.len(), MAX_ROBOTS)
}

impl Message for Claim {
    const NAME: &'static str = "Claim";
    const LIMIT: usize = 1024 * 1024 + 512;
    fn check(&self) -> Result<(), Refusal> {
        let Some(way) = &self.way else { return Ok(()) };
        way.start.check()?;
        within("radius of the robot in m", way.radius.0, 0.01, 5.0)?;
        limit_list("legs of a way", way.legs.len(), MAX_LEGS)?;
        way.legs.iter().try_for_each(|leg| leg.geometry.check())
    }
}
impl Message for Clearance {
    const NAME: &'static str = "Clearance";
    const LIMIT: usize = 32 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        check_waits(&self.waits)
    }
}
impl Message for TrafficAsk {
    const NAME: &'static str = "TrafficAsk";
    const LIMIT: usize = 64;
}
impl Message for TrafficState {
    const NAME: &'static str = "TrafficState";
    const LIMIT: usize = 256 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("robots of a fleet", self.robots.len(), MAX_ROBOTS)?;
        self.robots
            .iter()
            .try_for_each(|mover| limit_list("robots to wait for", mover.waits.len(), MAX_NOTES))
    }
}
impl Message for Confirm {
    const NAME: &'static str = "Confirm";
    const LIMIT: usize = 256;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("bytes of who confirms", self.by.len(), 96)
    }
}
