//! What a process says of itself.

use crate::codec::Message;
use crate::id::Boot;
use crate::plan::limit_list;
use crate::{Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// The state of one process; the answer to the query of its status key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// The catalogue name of the service.
    pub service: String,
    /// The robot it serves, or `all`.
    pub robot: String,
    /// The computer.
    pub host: String,
    /// The process id there.
    pub pid: u32,
    /// The run of this process.
    pub boot: Boot,
    /// The version of Axle.
    pub version: String,
    /// Since the process joined the mesh.
    pub uptime: Seconds,
    /// Beats made; 0 for a functional service.
    pub beats: u64,
    /// Beats that came more than 5 ms after their time.
    pub late: u64,
    /// The lateness that 99 of 100 beats did not exceed.
    pub late_p99: Seconds,
    /// Messages published and replies given.
    pub sent: u64,
    /// Messages and queries taken.
    pub received: u64,
    /// Messages and queries that were refused or could not be read.
    pub refused: u64,
    /// The keys it publishes or answers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub says: Vec<String>,
    /// The keys it listens to.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hears: Vec<String>,
    /// What it has published, by key.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub said: Vec<Flow>,
    /// What has arrived at it, by key, before anybody looked at it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub heard: Vec<Flow>,
    /// Its wall time when it answers, since 1970: for comparing clocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall: Option<Seconds>,
    /// The certificate that it shows, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certificate: Option<Shown>,
}

/// The samples of one key since a process began.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Flow {
    /// The key.
    pub key: String,
    /// How many there were.
    pub count: u64,
    /// How many of them could not be read.
    #[serde(default, skip_serializing_if = "is_none")]
    pub refused: u64,
    /// Why the latest of those could not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
const fn is_none(count: &u64) -> bool {
    *count == 0
}

/// A certificate as its owner shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// Its owner.
    pub name: String,
    /// When it ends, since 1970.
    pub expires: Seconds,
}

/// The most keys of either kind that a status lists.
pub const MAX_KEYS: usize = 64;
impl Message for Status {
    const NAME: &'static str = "Status";
    const LIMIT: usize = 64 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        for (what, text) in [
            ("service", &self.service),
            ("robot", &self.robot),
            ("host", &self.host),
            ("version", &self.version),
        ] {
            limit_list(&format!("letters of {what}"), text.len(), 128)?;
        }
        limit_list("keys that a process says", self.says.len(), MAX_KEYS)?;
        limit_list("keys that a process hears", self.hears.len(), MAX_KEYS)?;
        limit_list("flows that a process says", self.said.len(), MAX_KEYS)?;
        limit_list("flows that a process hears", self.heard.len(), MAX_KEYS)
    }
}

/// The question for a [`Status`]; it has nothing to say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StatusAsk {}
impl Message for StatusAsk {
    const NAME: &'static str = "StatusAsk";
    const LIMIT: usize = 64;
}
