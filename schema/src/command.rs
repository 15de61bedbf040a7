//! What is said to the gate, the one door to the wheels, and what it says.
//!
//! The reasons for every field are in ARCHITECTURE.md, "The gate". In short: only the robot's own clock counts, so a
//! command repeats (echoes) the latest tick of it that its sender had seen, and the gate refuses what is too old.

use crate::codec::Message;
use crate::dwm::{MAX_DURATION, MAX_WHEEL_SPEED, strict};
use crate::id::{Boot, StopId, Tick};
use crate::refusal::within;
use crate::{Dwm, MetresPerSecond, Refusal, Seconds, Sides};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Who may take the wheels from whom: a higher class takes the lease at once, an equal one never.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// Programs that drive when nobody else does.
    Background,
    /// Correctors.
    Corrector,
    /// A person at a stick or a keyboard.
    Manual,
    /// May stop and hold, never drive.
    StopOnly,
}

/// Asks the gate for the right to command the wheels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeaseAsk {
    /// Who asks, in words that a person understands: `d-corrector@workstation/1234`.
    pub holder: String,
    /// How much it matters.
    pub class: Class,
    /// How often commands will come; silence of 2.5 periods (within 150 to 500 ms) brakes the wheels.
    pub period: Seconds,
}
impl Message for LeaseAsk {
    const NAME: &'static str = "LeaseAsk";
    const LIMIT: usize = 256;
    fn check(&self) -> Result<(), Refusal> {
        within("period of a lease in seconds", self.period.0, 1e-3, 1.0)?;
        crate::plan::limit_list("letters of a holder's name", self.holder.len(), 96)
    }
}

/// The right to command the wheels, until it is released, taken by a higher class, or not used.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lease {
    /// The run of the process that owns the wheels; commands repeat it.
    pub boot: Boot,
    /// Number of the grant; commands repeat it, and older numbers are fenced.
    pub epoch: u32,
    /// The robot's clock at the grant: an echo for the first command.
    pub tick: Tick,
    /// After this time without a command the wheels brake and the lease ends. The first command, before which nothing
    /// moves, may take longer: as long as an echo may be old, and a period.
    pub silence_stop: Seconds,
}
impl Message for Lease {
    const NAME: &'static str = "Lease";
    const LIMIT: usize = 256;
}

/// Gives a lease back.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Release {
    /// As in the lease.
    pub boot: Boot,
    /// As in the lease.
    pub epoch: u32,
}
impl Message for Release {
    const NAME: &'static str = "Release";
    const LIMIT: usize = 128;
}

/// A movement for the wheels, now.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    /// From the lease.
    pub boot: Boot,
    /// From the lease.
    pub epoch: u32,
    /// Grows with every command of a lease.
    pub seq: u32,
    /// The latest tick of the robot that the sender had seen when it computed this command.
    pub echo: Tick,
    /// For how many milliseconds after its arrival the sender wants the command to be obeyed.
    pub ttl_ms: u16,
    /// What the wheels shall do.
    #[serde(with = "strict")]
    pub dwm: Dwm,
}
impl Message for Command {
    const NAME: &'static str = "Command";
    const LIMIT: usize = 512;
    fn check(&self) -> Result<(), Refusal> {
        within("wheel speed of a command in m/s", self.dwm.peak_speed().0, 0.0, MAX_WHEEL_SPEED)?;
        let duration = self.dwm.duration().0;
        if duration > 0.0 {
            within("duration of a command in s", duration, 0.0, MAX_DURATION)
        } else {
            Err(Refusal::out_of_range("duration of a command", self.dwm.duration(), "more than 0 s"))
        }
    }
}

/// Stops the wheels at once, whoever drives. Needs no lease, and latches: nothing moves until [`Enable`] quotes it.
///
/// This is an operational stop, not a certified emergency stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AllStop {
    /// Chosen at random by the sender; the gate's state repeats it as the acknowledgement.
    pub id: StopId,
    /// Who stops, in words that a person understands.
    pub by: String,
}
impl Message for AllStop {
    const NAME: &'static str = "AllStop";
    const LIMIT: usize = 512;
}

/// Allows the wheels to move again after an [`AllStop`] or a boot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Enable {
    /// The id of the latest stop that the gate's state shows; left out when there was none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<StopId>,
    /// From the gate's state.
    pub boot: Boot,
    /// The tick of the gate's state that the sender had seen: an old, replayed enable is refused.
    pub echo: Tick,
    /// Who enables, in words that a person understands.
    pub by: String,
    /// As what: only a person lets a robot move again, so that below [`Class::Manual`] it is refused. Left out it is that.
    #[serde(default = "manual", skip_serializing_if = "is_manual")]
    pub class: Class,
}
const fn manual() -> Class {
    Class::Manual
}
#[allow(clippy::trivially_copy_pass_by_ref, reason = "the shape that serde asks for")]
const fn is_manual(class: &Class) -> bool {
    matches!(class, Class::Manual)
}
impl Message for Enable {
    const NAME: &'static str = "Enable";
    const LIMIT: usize = 512;
    fn check(&self) -> Result<(), Refusal> {
        crate::plan::limit_list("letters of who enables", self.by.len(), 96)
    }
}

/// What the wheels are doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// At rest.
    #[default]
    Standing,
    /// Obeying a command.
    Driving,
    /// Slowing down to rest at a bounded deceleration.
    Braking,
}

/// Why the wheels brake, or last braked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BrakeCause {
    /// No command came for too long.
    Silence,
    /// The last command ran out and no next one came.
    Expired,
    /// The holder gave the lease back.
    Released,
    /// A higher class took the lease.
    Preempted,
    /// Somebody stopped the robot.
    AllStop,
    /// The drive was disabled.
    Disabled,
}

/// Why a command was not obeyed. Each has its own count in [`GateState`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reject {
    /// More bytes than a command may have.
    Oversize,
    /// Not a command, or one with an unknown or missing field.
    Malformed,
    /// Not finite, not positive, or beyond the limits of the wheels.
    Limit,
    /// For an earlier run of the robot process.
    Boot,
    /// From somebody who does not hold the lease, or no longer.
    Fenced,
    /// A sequence number that was used before.
    Sequence,
    /// The echo is older than the gate accepts.
    Stale,
    /// The echo is in the future: no robot has said it yet.
    Future,
    /// The drive is stopped or disabled.
    Disabled,
    /// More commands than the gate reads in one beat.
    Flood,
}

/// The gate's own account, on change and once a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GateState {
    /// The run of the process that owns the wheels.
    pub boot: Boot,
    /// The robot's clock.
    pub tick: Tick,
    /// Number of the latest grant.
    pub epoch: u32,
    /// Who holds the lease.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holder: Option<String>,
    /// Whether commands may move the wheels.
    pub enabled: bool,
    /// The latest stop; an [`Enable`] must quote it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<StopId>,
    /// Whether the stop in force has been stored, so that it outlives a restart of the robot process.
    #[serde(default, skip_serializing_if = "is_false")]
    pub stored: bool,
    /// What the wheels are doing.
    pub motion: Motion,
    /// Why they brake, or last braked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<BrakeCause>,
    /// The speeds the gate asks of the wheels.
    pub wheels: Sides<MetresPerSecond>,
    /// Commands obeyed since boot.
    pub accepted: u64,
    /// Commands refused since boot, by reason.
    #[serde(default)]
    pub rejected: BTreeMap<Reject, u64>,
}
#[allow(clippy::trivially_copy_pass_by_ref, reason = "the shape that serde asks for")]
const fn is_false(flag: &bool) -> bool {
    !*flag
}
impl Message for GateState {
    const NAME: &'static str = "GateState";
    const LIMIT: usize = 2048;
}

/// An answer that says no more than yes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Done {}
impl Message for Done {
    const NAME: &'static str = "Done";
    const LIMIT: usize = 64;
}
