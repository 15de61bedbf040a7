//! Recorder: MCAP out of everything that is said, and back.
//!
//! Hears whatever its caller hands it: samples with their keys, encodings and attachments. Says nothing; it fills a
//! file. No network, no clock, no thread: the caller brings the samples and the time, and calls from a thread that
//! may wait for the disk, never from a control loop.
//!
//! What happens when it fails: a file is whole up to its last flush whatever kills the process, since a chunk is
//! written in one piece and synced at least once a period. A full disk is an error value, after which the recorder
//! refuses everything: the recording ends, the robot drives on. [`Recording`] opens what is left.
//!
//! # The file
//!
//! * One channel for every key and encoding: topic = the key, message encoding `cbor`, schema `axle.Dwm.v1` in CDDL.
//!   `log_time` is the arrival at the recorder, `publish_time` the sender's stamp, `sequence` the lower 32 bits of the
//!   sender's count. The exact encoding is in the channel's metadata.
//! * The attachment of a sample stands just before it on a channel of its own, the key and `/@meta`, schema
//!   `axle.Meta.v1`: sequence, source and cause are kept for replay and for "why did it do that".
//! * Samples that never reached the recorder are counted on the channel [`GAP_TOPIC`], as JSON: `{"key": …, "lost": 3}`.
//! * Beside them stand derived channels, marked so in their metadata, whose topics begin with `/`: poses, transforms,
//!   paths, a scene and a log in Foxglove's well-known schemas, as JSON. Reading back leaves them out.
//! * No compression: the file can be read by anything, and a crash cannot cut through a compressed block.

pub mod cddl;
mod copy;
mod derived;
mod foxglove;
mod info;
mod read;
mod series;
#[cfg(test)]
mod tests;
mod write;

pub use copy::{CopyError, Part, copy};
pub use derived::{Derived, Shown};
pub use foxglove::View;
pub use info::{Info, Stream};
pub use read::{Account, Entry, ReadError, Recorded, Recording};
pub use series::Series;
pub use write::{RecordError, Recorder, Sample, Totals};

use axle_schema::contract::{Bounds, Params};
use axle_schema::refusal::within;
use axle_schema::{Refusal, Seconds};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The topic of the records of losses.
pub const GAP_TOPIC: &str = "@gap";
/// What follows the key in the topic of its attachments.
pub const META_SUFFIX: &str = "/@meta";
/// What marks a derived channel in its metadata.
pub const DERIVED: &str = "derived";
/// The most channels of one recording, those of attachments included.
pub const MAX_CHANNELS: usize = 4096;
/// The largest payload that is recorded, in bytes; no message of Axle is larger than 5 MiB.
pub const MAX_PAYLOAD: usize = 8 * 1024 * 1024;
/// The largest attachment, key or encoding that is recorded, in bytes.
pub const MAX_NAME: usize = 4096;
/// A chunk is closed and synced when it holds this much, in bytes, however young it is.
pub const CHUNK: usize = 256 * 1024;

/// How the recorder works.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecorderParams {
    /// Where recordings are made; each is named after its robot and the time.
    pub directory: PathBuf,
    /// The very file to make, instead of a named one in `directory`; one that exists is never overwritten.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The most time between two syncs to disk, 0.1 to 1 s: what a crash may lose.
    pub flush: Seconds,
    /// The largest file, 0.001 to 1000 GB.
    pub file_gb: f64,
    /// How many files a recording may have, 1 to 10000. When the newest is full, a further one is begun and the oldest is
    /// removed; with 1, the recording ends.
    pub files: u32,
    /// A further file is begun after so many minutes too, 0.01 to 100000, if there may be several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file_minutes: Option<f64>,
    /// Whether what Foxglove can show by itself is written beside the data.
    pub derived: bool,
}

impl Default for RecorderParams {
    fn default() -> Self {
        Self {
            directory: "recordings".into(),
            file: None,
            flush: Seconds(1.0),
            file_gb: 4.0,
            files: 1,
            file_minutes: None,
            derived: true,
        }
    }
}
impl Bounds for RecorderParams {
    fn check(&self) -> Result<(), Refusal> {
        within("flush in s", self.flush.0, 0.1, 1.0)?;
        within("file_gb in GB", self.file_gb, 0.001, 1000.0)?;
        within("files", f64::from(self.files), 1.0, 10_000.0)?;
        self.file_minutes.map_or(Ok(()), |minutes| within("file_minutes", minutes, 0.01, 100_000.0))
    }
}
impl Params for RecorderParams {
    const FILE: &'static str = include_str!("../../../deploy/params/recorder.toml");
}
