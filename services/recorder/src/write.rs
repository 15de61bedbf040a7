//! Writing: samples into chunks, chunks onto the disk.

use crate::derived::{Derived, Shown};
use crate::{
    CHUNK, DERIVED, GAP_TOPIC, MAX_CHANNELS, MAX_NAME, MAX_PAYLOAD, META_SUFFIX, RecorderParams, cddl,
};
use axle_schema::codec::schema_of;
use axle_schema::meta::Meta;
use mcap::records::MessageHeader;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

/// Room that a message takes in a chunk beside its bytes: its record's header and its entry in the index.
const OVERHEAD: usize = 48;

/// Something that was said.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// The key on which it was said.
    pub key: &'a str,
    /// Its encoding, for example `application/cbor;axle.Dwm.v1`; may be empty.
    pub encoding: &'a str,
    /// Its bytes.
    pub payload: &'a [u8],
    /// The bytes of its attachment, a [`Meta`] where Axle said it.
    pub attachment: Option<&'a [u8]>,
    /// When it arrived here, in nanoseconds since 1970.
    pub received: u64,
}

/// What a recording holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Samples written.
    pub samples: u64,
    /// Samples that are known to be lost.
    pub lost: u64,
    /// Samples that were refused for their size or their number of channels.
    pub refused: u64,
    /// Bytes of the samples and their attachments.
    pub bytes: u64,
}

/// Why something was not recorded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The file could not be made; one that exists is never overwritten.
    #[error("cannot create the recording {}", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
    /// The file could not be written: the disk may be full. The recording has ended.
    #[error("cannot write the recording; what was flushed before is safe")]
    Write(#[source] mcap::McapError),
    /// The disk did not confirm what was written. The recording has ended.
    #[error("cannot sync the recording to disk; what was flushed before is safe")]
    Sync(#[source] std::io::Error),
    /// The file has reached its limit. The recording has ended; `finish` still closes it well.
    #[error("the recording has reached its limit of {limit} bytes")]
    Full {
        /// The limit.
        limit: u64,
    },
    /// The recording has ended by an earlier error.
    #[error("the recording has ended by an earlier error")]
    Ended,
    /// A part of the sample is larger than its limit. Only this sample is not recorded.
    #[error("the {part} of a sample on {key} has {got} bytes, at most {limit} are recorded")]
    TooLarge {
        /// Payload, attachment, key or encoding.
        part: &'static str,
        /// The key, shortened.
        key: String,
        /// The size that came.
        got: usize,
        /// The size that is recorded.
        limit: usize,
    },
    /// There are too many keys. Only this sample is not recorded.
    #[error("{key} is not recorded: the file has {MAX_CHANNELS} channels already")]
    TooManyChannels {
        /// The key.
        key: String,
    },
}

impl RecordError {
    /// Whether the recording has ended; otherwise only one sample is missing, and the next may be recorded.
    #[must_use]
    pub const fn is_final(&self) -> bool {
        !matches!(self, Self::TooLarge { .. } | Self::TooManyChannels { .. })
    }
}

/// The channels of one key and encoding.
#[derive(Clone, Copy)]
struct Pair {
    payload: u16,
    /// For attachments: made when the first one comes.
    meta: Option<u16>,
}

/// A recording that grows.
///
/// Dropping it closes the file as well as it can, and tells nobody how that went; [`Recorder::finish`] does.
pub struct Recorder {
    file: File,
    writer: Option<mcap::Writer<BufWriter<File>>>,
    /// By key, then by encoding: found without making a new string for every sample.
    channels: HashMap<String, HashMap<String, Pair>>,
    count: usize,
    gap: Option<u16>,
    /// Bytes in the open chunk.
    pending: usize,
    /// Bytes given to the writer so far, in payloads and headers.
    size: u64,
    flushed: u64,
    period: u64,
    limit: u64,
    totals: Totals,
    derived: Option<Derived>,
}

impl Recorder {
    /// Makes a new file at `path`; `about` says what it is (version, host, topology …) to whoever opens it, and `now`
    /// is the time in nanoseconds since 1970.
    ///
    /// # Errors
    /// [`RecordError::Create`], also when the file exists, and when it cannot be written.
    pub fn create(
        path: &Path,
        about: &BTreeMap<String, String>,
        params: &RecorderParams,
        now: u64,
    ) -> Result<Self, RecordError> {
        let failed = |source| RecordError::Create { path: path.to_owned(), source };
        let file = File::create_new(path).map_err(failed)?;
        let recorder = Self::to(file, about, params, now)?;
        // The name of a new file survives a power cut only when its folder is synced; some systems cannot do that.
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
            folder.sync_all().ok();
        }
        Ok(recorder)
    }

    /// Records into an open, empty file.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn to(
        file: File,
        about: &BTreeMap<String, String>,
        params: &RecorderParams,
        now: u64,
    ) -> Result<Self, RecordError> {
        let shared = file.try_clone().map_err(|fault| RecordError::Write(fault.into()))?;
        let mut writer = writer(shared).map_err(RecordError::Write)?;
        let metadata = mcap::records::Metadata { name: "axle".to_owned(), metadata: about.clone() };
        writer.write_metadata(&metadata).map_err(RecordError::Write)?;
        let mut recorder = Self {
            file,
            writer: Some(writer),
            channels: HashMap::new(),
            count: 0,
            gap: None,
            pending: 0,
            size: 0,
            flushed: now,
            period: billionths(params.flush.0),
            limit: billionths(params.file_gb),
            totals: Totals::default(),
            derived: params.derived.then(Derived::default),
        };
        // A full disk is better known now than in a second.
        recorder.flush(now)?;
        Ok(recorder)
    }

    /// Records a sample; closes and syncs the chunk when it is large enough.
    ///
    /// # Errors
    /// See [`RecordError`]; after one that [`RecordError::is_final`] every call fails.
    pub fn write(&mut self, sample: Sample<'_>) -> Result<(), RecordError> {
        self.try_write(sample).inspect_err(|_| self.totals.refused += 1)
    }

    fn try_write(&mut self, sample: Sample<'_>) -> Result<(), RecordError> {
        fits("key", sample.key, sample.key.len(), MAX_NAME)?;
        fits("encoding", sample.key, sample.encoding.len(), MAX_NAME)?;
        fits("payload", sample.key, sample.payload.len(), MAX_PAYLOAD)?;
        fits("attachment", sample.key, sample.attachment.map_or(0, <[u8]>::len), MAX_NAME)?;
        let meta = sample.attachment.and_then(|bytes| axle_schema::decode::<Meta>(bytes).ok());
        let pair = self.pair(&sample, meta.is_some())?;
        let mut header = MessageHeader {
            channel_id: pair.payload,
            #[allow(clippy::cast_possible_truncation, reason = "MCAP keeps 32 bits; the attachment has all")]
            sequence: meta.map_or(0, |meta| meta.seq as u32),
            log_time: sample.received,
            publish_time: meta.map_or(sample.received, |meta| billionths(meta.stamp)),
        };
        if let (Some(channel_id), Some(bytes)) = (pair.meta, sample.attachment) {
            self.put(MessageHeader { channel_id, ..header }, bytes)?;
        }
        header.channel_id = pair.payload;
        self.put(header, sample.payload)?;
        self.totals.samples += 1;
        self.totals.bytes += (sample.payload.len() + sample.attachment.map_or(0, <[u8]>::len)) as u64;
        let shown = self.derived.as_mut().map(|derived| derived.of(&sample)).unwrap_or_default();
        for shown in shown {
            self.show(&shown, sample.received)?;
        }
        if self.pending >= CHUNK {
            self.flush(sample.received)?;
        }
        Ok(())
    }

    /// Writes a derived message. One for which the file has no channel left is not missed.
    fn show(&mut self, shown: &Shown, now: u64) -> Result<(), RecordError> {
        let name = shown.view.name();
        let known = self.channels.get(&shown.topic).and_then(|encodings| encodings.get(name)).copied();
        let channel_id = match known {
            Some(pair) => pair.payload,
            None => {
                let schema = shown.view.schema();
                let about = BTreeMap::from([(DERIVED.to_owned(), "true".to_owned())]);
                let schema = Some((name, "jsonschema", schema.as_bytes()));
                let payload = match self.channel(&shown.topic, "json", schema, &about) {
                    Err(RecordError::TooManyChannels { .. }) => return Ok(()),
                    other => other?,
                };
                let pair = Pair { payload, meta: None };
                self.channels.entry(shown.topic.clone()).or_default().insert(name.to_owned(), pair);
                payload
            }
        };
        let header = MessageHeader { channel_id, sequence: 0, log_time: now, publish_time: now };
        self.put(header, shown.json.to_string().as_bytes())
    }

    /// Records that `lost` samples of `key` never came, known at the time `now`.
    ///
    /// # Errors
    /// As [`Recorder::write`].
    pub fn gap(&mut self, key: &str, lost: u64, now: u64) -> Result<(), RecordError> {
        fits("key", key, key.len(), MAX_NAME)?;
        let channel_id = match self.gap {
            Some(channel) => channel,
            None => {
                let schema = ("axle.Gap.v1", "jsonschema", GAP_SCHEMA.as_bytes());
                let channel = self.channel(GAP_TOPIC, "json", Some(schema), &BTreeMap::new())?;
                *self.gap.insert(channel)
            }
        };
        let text = serde_json::json!({ "key": key, "lost": lost }).to_string();
        let header = MessageHeader { channel_id, sequence: 0, log_time: now, publish_time: now };
        self.put(header, text.as_bytes())?;
        self.totals.lost = self.totals.lost.saturating_add(lost);
        Ok(())
    }

    /// Closes and syncs the chunk when a period has passed since the last time; says whether it did. Call this a few
    /// times in every period, whether samples come or not.
    ///
    /// # Errors
    /// [`RecordError::Write`] and [`RecordError::Sync`]; the recording has ended.
    pub fn flush_if_due(&mut self, now: u64) -> Result<bool, RecordError> {
        // Wall time may step, in both directions: either way it is time.
        if now.abs_diff(self.flushed) < self.period {
            return Ok(false);
        }
        self.flush(now)?;
        Ok(true)
    }

    /// Closes the chunk and syncs the file.
    ///
    /// # Errors
    /// As [`Recorder::flush_if_due`].
    pub fn flush(&mut self, now: u64) -> Result<(), RecordError> {
        self.flushed = now;
        self.attempt(mcap::Writer::flush)?;
        self.pending = 0;
        self.file.sync_data().map_err(|fault| {
            self.writer = None;
            RecordError::Sync(fault)
        })
    }

    /// What was recorded so far.
    #[must_use]
    pub const fn totals(&self) -> Totals {
        self.totals
    }

    /// Writes the index and the end, and syncs.
    ///
    /// # Errors
    /// As [`Recorder::flush_if_due`]. The file keeps what was flushed before.
    pub fn finish(mut self) -> Result<Totals, RecordError> {
        self.attempt(mcap::Writer::finish)?;
        // The last bytes are still in the buffer, and a finished writer cannot be asked to flush.
        if let Some(writer) = self.writer.take() {
            writer.into_inner().flush().map_err(|fault| RecordError::Write(fault.into()))?;
        }
        self.file.sync_all().map_err(RecordError::Sync)?;
        Ok(self.totals)
    }

    /// Adds a message to the open chunk.
    fn put(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), RecordError> {
        let size = bytes.len() + OVERHEAD;
        if self.size + size as u64 > self.limit {
            return Err(RecordError::Full { limit: self.limit });
        }
        self.attempt(|writer| writer.write_to_known_channel(&header, bytes))?;
        self.size += size as u64;
        self.pending += size;
        Ok(())
    }

    /// The channels of a sample.
    fn pair(&mut self, sample: &Sample<'_>, known: bool) -> Result<Pair, RecordError> {
        let found =
            self.channels.get(sample.key).and_then(|encodings| encodings.get(sample.encoding)).copied();
        if let Some(pair) = found
            && (pair.meta.is_some() || sample.attachment.is_none())
        {
            return Ok(pair);
        }
        let payload = match found {
            Some(pair) => pair.payload,
            None => self.payload_channel(sample)?,
        };
        let meta = match sample.attachment {
            Some(_) => Some(self.meta_channel(sample.key, known)?),
            None => None,
        };
        let pair = Pair { payload, meta };
        self.channels.entry(sample.key.to_owned()).or_default().insert(sample.encoding.to_owned(), pair);
        Ok(pair)
    }

    fn payload_channel(&mut self, sample: &Sample<'_>) -> Result<u16, RecordError> {
        let (outer, inner) = sample.encoding.split_once(';').unwrap_or((sample.encoding, ""));
        let format = match outer {
            "application/cbor" => "cbor",
            "application/json" => "json",
            other => other,
        };
        let text = message_name(inner).and_then(|name| cddl::excerpt(axle_schema::CDDL, name));
        let schema = text.as_ref().map(|text| (inner, "cddl", text.as_bytes()));
        let about = BTreeMap::from([("encoding".to_owned(), sample.encoding.to_owned())]);
        self.channel(sample.key, format, schema, &about)
    }

    /// A channel for attachments. Those of strangers, which are no [`Meta`], are recorded too, as what they are first.
    fn meta_channel(&mut self, key: &str, known: bool) -> Result<u16, RecordError> {
        let name = schema_of::<Meta>();
        let text = message_name(&name).and_then(|name| cddl::excerpt(axle_schema::CDDL, name));
        let schema = text.as_ref().filter(|_| known).map(|text| (name.as_str(), "cddl", text.as_bytes()));
        let format = if known { "cbor" } else { "" };
        self.channel(&format!("{key}{META_SUFFIX}"), format, schema, &BTreeMap::new())
    }

    fn channel(
        &mut self,
        topic: &str,
        format: &str,
        schema: Option<(&str, &str, &[u8])>,
        about: &BTreeMap<String, String>,
    ) -> Result<u16, RecordError> {
        if self.count >= MAX_CHANNELS {
            return Err(RecordError::TooManyChannels { key: shown(topic) });
        }
        let (id, size) = self.attempt(|writer| {
            let schema_id = match schema {
                Some((name, encoding, data)) => writer.add_schema(name, encoding, data)?,
                None => 0,
            };
            let id = writer.add_channel(schema_id, topic, format, about)?;
            Ok((id, schema.map_or(0, |(_, _, data)| data.len()) + topic.len() + OVERHEAD))
        })?;
        self.count += 1;
        self.size += size as u64;
        self.pending += size;
        Ok(id)
    }

    /// Puts a full disk in the place of the file.
    #[cfg(all(test, target_os = "linux"))]
    pub(crate) fn swap_for_a_full_disk(&mut self) -> std::io::Result<()> {
        self.file = File::options().write(true).open("/dev/full")?;
        self.writer = Some(writer(self.file.try_clone()?).map_err(std::io::Error::other)?);
        Ok(())
    }

    /// Lets the writer do something; its first failure ends the recording, since nobody knows what reached the file.
    fn attempt<T>(
        &mut self,
        act: impl FnOnce(&mut mcap::Writer<BufWriter<File>>) -> mcap::McapResult<T>,
    ) -> Result<T, RecordError> {
        let writer = self.writer.as_mut().ok_or(RecordError::Ended)?;
        act(writer).map_err(|fault| {
            self.writer = None;
            RecordError::Write(fault)
        })
    }
}

fn writer(file: File) -> mcap::McapResult<mcap::Writer<BufWriter<File>>> {
    mcap::WriteOptions::new()
        .compression(None)
        .library(concat!("axle-recorder/", env!("CARGO_PKG_VERSION")))
        // The recorder closes chunks itself, and a chunk reaches the file in one piece.
        .chunk_size(None)
        .disable_seeking(true)
        .create(BufWriter::new(file))
}

/// What the losses look like, for tools that show JSON.
const GAP_SCHEMA: &str =
    r#"{"type":"object","properties":{"key":{"type":"string"},"lost":{"type":"integer"}}}"#;

/// `Dwm` of `axle.Dwm.v1`.
fn message_name(schema: &str) -> Option<&str> {
    let (root, rest) = schema.split_once('.')?;
    let (name, version) = rest.rsplit_once(".v")?;
    (root == "axle" && version.parse::<u8>().is_ok()).then_some(name)
}

fn fits(part: &'static str, key: &str, got: usize, limit: usize) -> Result<(), RecordError> {
    if got <= limit { Ok(()) } else { Err(RecordError::TooLarge { part, key: shown(key), got, limit }) }
}

/// The beginning of a key: a stranger chose its length.
fn shown(key: &str) -> String {
    key.chars().take(120).collect()
}

/// A number in billionths: seconds in nanoseconds, GB in bytes. Negative numbers give 0, large ones the maximum.
fn billionths(number: f64) -> u64 {
    // Whole and fraction apart: a float cannot hold the nanoseconds since 1970.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the conversions saturate")]
    let (whole, part) = (number.trunc() as u64, (number.fract() * 1e9).round() as u64);
    whole.saturating_mul(1_000_000_000).saturating_add(part)
}
