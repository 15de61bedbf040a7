//! What a recording holds, in numbers.

use crate::{Account, Entry, ReadError, Recording};
use axle_schema::decode;
use axle_schema::meta::Meta;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

/// One stream of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stream {
    /// Its encoding; the last one, if there were several.
    pub encoding: String,
    /// Samples.
    pub samples: u64,
    /// Bytes of their payloads.
    pub bytes: u64,
    /// Samples of this key that the recorder knew to be lost.
    pub lost: u64,
    /// Samples that are missing by the sequence numbers of their publishers.
    pub missing: u64,
    /// When its first and its last sample came, in nanoseconds since 1970.
    pub span: (u64, u64),
}

/// What a recording holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Info {
    /// What the file says of itself.
    pub about: BTreeMap<String, String>,
    /// When the first and the last sample came, in nanoseconds since 1970.
    pub span: (u64, u64),
    /// By key.
    pub streams: BTreeMap<String, Stream>,
    /// Whether it is whole.
    pub account: Account,
}

impl Info {
    /// Reads a recording to its end.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let mut recording = Recording::open(path)?;
        let mut info = Self { span: (u64::MAX, 0), ..Self::default() };
        let mut last: HashMap<Arc<str>, Meta> = HashMap::new();
        for entry in recording.by_ref() {
            match entry {
                Entry::Sample(sample) => {
                    let at = sample.received;
                    info.span = (info.span.0.min(at), info.span.1.max(at));
                    let stream = info
                        .streams
                        .entry(sample.key.to_string())
                        .or_insert_with(|| Stream { span: (u64::MAX, 0), ..Stream::default() });
                    stream.samples += 1;
                    stream.bytes += sample.payload.len() as u64;
                    if let Some(meta) =
                        sample.attachment.as_deref().and_then(|bytes| decode::<Meta>(bytes).ok())
                    {
                        let before = last.insert(Arc::clone(&sample.key), meta);
                        let same = before.filter(|before| before.source == meta.source);
                        let between = same.map_or(0, |before| meta.seq.saturating_sub(before.seq + 1));
                        stream.missing = stream.missing.saturating_add(between);
                    }
                    stream.span = (stream.span.0.min(at), stream.span.1.max(at));
                    if *stream.encoding != *sample.encoding {
                        stream.encoding = sample.encoding.to_string();
                    }
                }
                Entry::Gap { key, lost, .. } => {
                    let stream = info.streams.entry(key).or_default();
                    stream.lost = stream.lost.saturating_add(lost);
                }
            }
        }
        if info.span.0 > info.span.1 {
            info.span = (0, 0);
        }
        info.about = recording.about().clone();
        info.account = recording.account().clone();
        Ok(info)
    }
}
