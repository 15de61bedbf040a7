//! What every sample carries beside its payload, in the Zenoh attachment.

use crate::codec::Message;
use crate::id::Boot;
use crate::unit::{deserialize_finite, finite};
use serde::{Deserialize, Serialize};

/// Sequence, source, stamp and cause of a sample. A plain client may leave it out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Meta {
    /// Counts the samples of one publisher on one key, from 0; a gap is a loss.
    pub seq: u64,
    /// The run of the process that published it.
    pub source: Boot,
    /// Wall time of the sender in seconds since 1970; for people and logs only, never for motion.
    #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
    pub stamp: f64,
    /// The sample that caused this one, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<Cause>,
}
impl Message for Meta {
    const NAME: &'static str = "Meta";
    const LIMIT: usize = 256;
}

/// Names another sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cause {
    /// The run of the process that published it.
    pub source: Boot,
    /// Its sequence number on its key.
    pub seq: u64,
}
