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
}

/// The most keys of either kind that a status lists.
pub const MAX_KEYS: usize = 64;
impl Message for Status {
    const NAME: &'static str = "Status";
    const LIMIT: usize = 16 * 1024;
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
        limit_list("keys that a process hears", self.hears.len(), MAX_KEYS)
    }
}

/// The question for a [`Status`]; it has nothing to say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StatusAsk {}
impl Message for StatusAsk {
    const NAME: &'static str = "StatusAsk";
    const LIMIT: usize = 64;
}
