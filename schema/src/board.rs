//! What the process that speaks with a real board says of it: its line, what it touches, its battery; and its servos.

use crate::codec::Message;
use crate::plan::limit_list;
use crate::refusal::within;
use crate::unit::{deserialize_finite, finite};
use crate::{Radians, Refusal, Seconds, Sides};
use serde::{Deserialize, Serialize};

/// How far the conversation with a board is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LinkState {
    /// The port cannot be opened, or was unplugged; it is tried again and again.
    #[default]
    Absent,
    /// The port is open, and the board has not yet said what it is.
    Greeting,
    /// The board answers and drives.
    Up,
    /// The board answers, but has taken the wheels away by itself: a cliff, a lifted wheel, a button.
    Halted,
}

/// What was wrong with the bytes of a line, since the process began. Nothing of it moves a wheel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LineFaults {
    /// Bytes or lines that mean nothing.
    pub garbage: u32,
    /// Lines that were longer than any of the protocol.
    pub overlong: u32,
    /// Frames whose checksum was wrong.
    pub checksum: u32,
    /// Frames that did not end in their time.
    pub half: u32,
    /// Numbers that no wheel can have done, or that are out of the range of the protocol.
    pub absurd: u32,
    /// Requests that the board refused.
    pub refused: u32,
    /// Requests that the board did not answer in time.
    pub unanswered: u32,
    /// Frames that are missing by their numbers.
    pub missed: u32,
    /// Pieces of the stream that came faster than they could be taken in, and were left out.
    pub flooded: u32,
}

/// What the bridge to a board says of it: on change, and once a second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoardState {
    /// When, by the robot's clock.
    pub stamp: Seconds,
    /// The kind of board, for example `roomba`.
    pub board: String,
    /// The port.
    pub port: String,
    /// How far the conversation is.
    pub link: LinkState,
    /// What the board said of itself when it was greeted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// Why it does not drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<Refusal>,
    /// How often the port was opened.
    pub opened: u32,
    /// How often the board was found restarted.
    pub restarts: u32,
    /// What was wrong with the bytes.
    pub faults: LineFaults,
}

/// What the robot touches, and where the ground is missing. A sensor that the board does not have says `false`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactsData {
    /// When the bytes came, by the robot's clock.
    pub stamp: Seconds,
    /// The bumper is pressed.
    pub bump: Sides<bool>,
    /// The wheel hangs in the air.
    #[serde(default)]
    pub drop: Sides<bool>,
    /// There is no ground before the wheel, at the side or in front.
    #[serde(default)]
    pub cliff: Sides<bool>,
}

/// The battery of the robot; what the board does not measure is left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BatteryData {
    /// When the bytes came, by the robot's clock.
    pub stamp: Seconds,
    /// Voltage, V.
    #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
    pub voltage: f64,
    /// Current into the battery, A: negative while it is used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub current: Option<Amperes>,
    /// What is left of its charge, 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left: Option<Share>,
}

/// A current, A.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Amperes(#[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")] pub f64);

/// A share of a whole, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Share(#[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")] pub f64);

/// Where a servo shall turn to; the limits are those of the robot's parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ServoAngle {
    /// The angle, counter-clockwise from the middle of the servo.
    pub angle: Radians,
}

impl Message for BoardState {
    const NAME: &'static str = "BoardState";
    const LIMIT: usize = 4096;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("letters of the board", self.board.len(), 32)?;
        limit_list("letters of the port", self.port.len(), 256)?;
        limit_list("letters of the version", self.version.as_ref().map_or(0, String::len), 96)
    }
}
impl Message for ContactsData {
    const NAME: &'static str = "ContactsData";
    const LIMIT: usize = 256;
}
impl Message for BatteryData {
    const NAME: &'static str = "BatteryData";
    const LIMIT: usize = 256;
    fn check(&self) -> Result<(), Refusal> {
        within("voltage in V", self.voltage, 0.0, 1000.0)?;
        self.current.map_or(Ok(()), |current| within("current in A", current.0, -1000.0, 1000.0))?;
        self.left.map_or(Ok(()), |left| within("charge that is left", left.0, 0.0, 1.0))
    }
}
impl Message for ServoAngle {
    const NAME: &'static str = "ServoAngle";
    const LIMIT: usize = 64;
    fn check(&self) -> Result<(), Refusal> {
        within("angle of a servo in rad", self.angle.0, -6.3, 6.3)
    }
}
