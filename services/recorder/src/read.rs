//! Reading: whatever is left of a recording, from its start to its last whole message.
//!
//! The frame of MCAP is so simple (a byte, a length, a body) that a damaged file is better read by hand: a chunk whose
//! checksum is wrong is left out and counted, one that was cut off gives the messages before the cut, and nothing is
//! asked of the index at the end, which a crash does not leave. Memory is bounded by the largest record.

use crate::{DERIVED, GAP_TOPIC, META_SUFFIX};
use mcap::records::{Record, op};
use std::collections::{BTreeMap, HashMap, VecDeque};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The largest record that is read into memory, in bytes; Axle's own chunks stay far below it.
const MAX_RECORD: u64 = 64 * 1024 * 1024;
/// The most schemas or channels that are remembered: as many as MCAP can number.
const MAX_KNOWN: usize = 65_536;

/// Why a recording could not be opened. Once open, damage is counted, not an error.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The system refused to open or read it.
    #[error("cannot read the recording {}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
    /// It is something else.
    #[error("{} is not an MCAP file", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
}

/// A sample, as it was recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// The key on which it was said.
    pub key: Arc<str>,
    /// Its encoding, for example `application/cbor;axle.Dwm.v1`.
    pub encoding: Arc<str>,
    /// Its bytes.
    pub payload: Vec<u8>,
    /// The bytes of its attachment.
    pub attachment: Option<Vec<u8>>,
    /// When it arrived at the recorder, in nanoseconds since 1970.
    pub received: u64,
    /// When it was said, by the sender's clock, in nanoseconds since 1970; the same as `received` if unknown.
    pub published: u64,
}

/// What a recording holds, in the order in which it came.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Entry {
    /// A sample.
    Sample(Recorded),
    /// Samples that did not reach the recorder.
    Gap {
        /// Their key.
        key: String,
        /// How many.
        lost: u64,
        /// When it was noticed, in nanoseconds since 1970.
        at: u64,
    },
}

/// What was found, complete when the iteration has ended.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// Samples read.
    pub samples: u64,
    /// Samples that the recorder knew to be lost.
    pub lost: u64,
    /// Chunks and records that were left out: their checksum or their inside is wrong, or they are compressed.
    pub damaged: u64,
    /// Whether the recording was closed well, with its index and its end.
    pub finished: bool,
    /// Where and why the file ends too early; `None` for a finished one.
    pub cut: Option<String>,
}

/// A channel of the file.
#[derive(Clone)]
struct Known {
    topic: Arc<str>,
    encoding: Arc<str>,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Payload,
    Meta,
    Gap,
    /// Made from what stands beside it.
    Derived,
}

/// A recording that is read: an iterator over its entries.
pub struct Recording {
    file: BufReader<File>,
    at: u64,
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, Known>,
    /// The attachment that waits for its sample: key, sequence, arrival, bytes.
    waiting: Option<(Arc<str>, u32, u64, Vec<u8>)>,
    ready: VecDeque<Entry>,
    account: Account,
    about: BTreeMap<String, String>,
    /// Whether chunks have come: then nothing is expected outside them.
    chunked: bool,
    over: bool,
}

/// What the file gives next.
enum Next {
    Record(u8, Vec<u8>),
    /// A record that the end of the file cuts, with what is left of its body.
    Cut(u8, Vec<u8>),
    End,
}

impl Recording {
    /// Opens a recording: finished, cut off, or just begun.
    ///
    /// # Errors
    /// When the file cannot be read or is not MCAP.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let failed = |source| ReadError::Open { path: path.to_owned(), source };
        let mut file = BufReader::new(File::open(path).map_err(failed)?);
        let mut magic = Vec::new();
        file.by_ref().take(mcap::MAGIC.len() as u64).read_to_end(&mut magic).map_err(failed)?;
        if !mcap::MAGIC.starts_with(&magic) {
            return Err(ReadError::NotMcap { path: path.to_owned() });
        }
        let mut recording = Self {
            file,
            at: magic.len() as u64,
            schemas: HashMap::new(),
            channels: HashMap::new(),
            waiting: None,
            ready: VecDeque::new(),
            account: Account::default(),
            about: BTreeMap::new(),
            chunked: false,
            over: false,
        };
        if magic.len() < mcap::MAGIC.len() {
            recording.cut("within its first bytes");
        }
        Ok(recording)
    }

    /// What was found so far; complete when the iteration has ended.
    #[must_use]
    pub const fn account(&self) -> &Account {
        &self.account
    }

    /// What the file says of itself; known when its first sample is.
    #[must_use]
    pub const fn about(&self) -> &BTreeMap<String, String> {
        &self.about
    }

    fn cut(&mut self, why: &str) {
        self.over = true;
        self.account.cut = Some(format!("byte {}: the recording ends {why}", self.at));
    }

    /// Reads until something is ready or the file is over.
    fn advance(&mut self) {
        let next = match self.next_record() {
            Ok(next) => next,
            Err(fault) => return self.cut(&format!("since it cannot be read: {fault}")),
        };
        match next {
            Next::Record(op::CHUNK, body) => self.chunk(&body, true),
            Next::Record(op::DATA_END, _) => self.ending(),
            // The specification forbids it; a file system leaves zeros where a power cut took the data.
            Next::Record(0, _) => self.cut("in zeros"),
            // Behind a damaged length lie pieces of a chunk, which no checksum vouches for.
            Next::Record(op::SCHEMA | op::CHANNEL | op::MESSAGE, _) if self.chunked => {
                self.account.damaged += 1
            }
            Next::Record(opcode, body) => {
                self.account.damaged += u64::from(!self.record(opcode, &body));
            }
            Next::Cut(opcode, body) => {
                if opcode == op::CHUNK {
                    self.chunk(&body, false);
                }
                self.cut("within a record");
            }
            Next::End => self.cut("without its index"),
        }
    }

    fn next_record(&mut self) -> std::io::Result<Next> {
        let mut head = Vec::with_capacity(9);
        self.file.by_ref().take(9).read_to_end(&mut head)?;
        let [opcode, rest @ ..] = head.as_slice() else { return Ok(Next::End) };
        let Ok(length) = <[u8; 8]>::try_from(rest) else { return Ok(Next::Cut(*opcode, Vec::new())) };
        let length = u64::from_le_bytes(length);
        if length > MAX_RECORD {
            return Err(std::io::Error::other(format!("a record says it has {length} bytes")));
        }
        let mut body = Vec::new();
        self.file.by_ref().take(length).read_to_end(&mut body)?;
        if (body.len() as u64) < length {
            return Ok(Next::Cut(*opcode, body));
        }
        self.at += 9 + length;
        Ok(Next::Record(*opcode, body))
    }

    /// After the data: whether the rest, which only repeats and indexes it, ends as it should.
    fn ending(&mut self) {
        let mut last = None;
        loop {
            match self.next_record() {
                Ok(Next::Record(op::FOOTER, _)) => {
                    let mut magic = Vec::new();
                    let read = self.file.by_ref().take(mcap::MAGIC.len() as u64).read_to_end(&mut magic);
                    if read.is_ok() && magic == mcap::MAGIC {
                        self.over = true;
                        self.account.finished = true;
                        return;
                    }
                }
                Ok(Next::Record(..)) => {}
                Ok(Next::Cut(..) | Next::End) => break,
                Err(fault) => {
                    last = Some(fault);
                    break;
                }
            }
        }
        match last {
            Some(fault) => self.cut(&format!("within its index: {fault}")),
            None => self.cut("within its index; no data is missing"),
        }
    }

    /// Takes a chunk apart. One that is all there is believed only if its checksum is right.
    fn chunk(&mut self, body: &[u8], framed: bool) {
        self.chunked = true;
        let Some(chunk) = Chunk::parse(body) else {
            self.account.damaged += u64::from(framed);
            return;
        };
        if framed && !chunk.whole
            || chunk.whole && chunk.crc != 0 && chunk.crc != crc32fast::hash(chunk.records)
        {
            self.account.damaged += 1;
            return;
        }
        let mut rest = chunk.records;
        while let Some((head, after)) = rest.split_first_chunk::<9>() {
            let [opcode, length @ ..] = *head;
            let body = usize::try_from(u64::from_le_bytes(length))
                .ok()
                .and_then(|length| after.split_at_checked(length));
            let Some((body, after)) = body else { break };
            rest = after;
            if opcode == 0 || !self.record(opcode, body) {
                self.account.damaged += 1;
                return;
            }
        }
        if chunk.whole && !rest.is_empty() {
            self.account.damaged += 1;
        }
    }

    /// Takes one record; whether it makes sense.
    fn record(&mut self, opcode: u8, body: &[u8]) -> bool {
        // Only these are parsed: the others say nothing that a reader without an index needs.
        if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA) {
            return true;
        }
        match mcap::read::parse_record(opcode, body) {
            Ok(Record::Schema { header, .. }) => {
                if self.schemas.len() < MAX_KNOWN {
                    self.schemas.insert(header.id, header.name);
                }
                true
            }
            Ok(Record::Channel(channel)) => {
                let known = self.known(channel);
                self.channels.insert(known.0, known.1);
                true
            }
            Ok(Record::Metadata(metadata)) => {
                if metadata.name == "axle" && self.about.is_empty() {
                    self.about = metadata.metadata;
                }
                true
            }
            Ok(Record::Message { header, data }) => self.message(&header, &data),
            _ => false,
        }
    }

    fn known(&self, channel: mcap::records::Channel) -> (u16, Known) {
        let kind = if channel.topic == GAP_TOPIC {
            Kind::Gap
        } else if channel.metadata.contains_key(DERIVED) {
            Kind::Derived
        } else if channel.topic.ends_with(META_SUFFIX) {
            Kind::Meta
        } else {
            Kind::Payload
        };
        let topic = match kind {
            Kind::Meta => channel.topic.strip_suffix(META_SUFFIX).unwrap_or(&channel.topic),
            Kind::Payload | Kind::Gap | Kind::Derived => &channel.topic,
        };
        // Recordings of others have no encoding in their metadata: it is put together from what they have.
        let encoding = channel.metadata.get("encoding").cloned().unwrap_or_else(|| {
            let schema = self.schemas.get(&channel.schema_id).map_or("", String::as_str);
            let semicolon = if schema.is_empty() { "" } else { ";" };
            format!("application/{}{semicolon}{schema}", channel.message_encoding)
        });
        (channel.id, Known { topic: topic.into(), encoding: encoding.into(), kind })
    }

    fn message(&mut self, header: &mcap::records::MessageHeader, data: &[u8]) -> bool {
        let Some(known) = self.channels.get(&header.channel_id) else { return false };
        let (topic, encoding, at) = (Arc::clone(&known.topic), Arc::clone(&known.encoding), header.log_time);
        match known.kind {
            Kind::Derived => {}
            Kind::Meta => self.waiting = Some((topic, header.sequence, at, data.to_vec())),
            Kind::Payload => {
                let fits = |(key, sequence, received, _): &(Arc<str>, u32, u64, Vec<u8>)| {
                    *key == topic && *sequence == header.sequence && *received == at
                };
                let attachment = self.waiting.take().filter(fits).map(|(.., bytes)| bytes);
                self.account.samples += 1;
                self.ready.push_back(Entry::Sample(Recorded {
                    key: topic,
                    encoding,
                    payload: data.to_vec(),
                    attachment,
                    received: at,
                    published: header.publish_time,
                }));
            }
            Kind::Gap => {
                let Ok(gap) = serde_json::from_slice::<serde_json::Value>(data) else { return false };
                let (Some(key), Some(lost)) = (gap["key"].as_str(), gap["lost"].as_u64()) else {
                    return false;
                };
                self.account.lost = self.account.lost.saturating_add(lost);
                self.ready.push_back(Entry::Gap { key: key.to_owned(), lost, at });
            }
        }
        true
    }
}

impl Iterator for Recording {
    type Item = Entry;

    fn next(&mut self) -> Option<Entry> {
        while self.ready.is_empty() && !self.over {
            self.advance();
        }
        self.ready.pop_front()
    }
}

/// The inside of a chunk that is not compressed.
struct Chunk<'a> {
    crc: u32,
    records: &'a [u8],
    /// Whether all of it is there.
    whole: bool,
}

impl<'a> Chunk<'a> {
    fn parse(body: &'a [u8]) -> Option<Self> {
        // Start, end and size have 8 bytes each; then come the checksum, the name of the compression, and the length.
        let (_, rest) = body.split_at_checked(24)?;
        let (crc, rest) = rest.split_first_chunk::<4>()?;
        let (name, rest) = rest.split_first_chunk::<4>()?;
        let (length, rest) = rest.split_first_chunk::<8>()?;
        let records = usize::try_from(u64::from_le_bytes(*length)).ok().and_then(|length| rest.get(..length));
        let none = u32::from_le_bytes(*name) == 0;
        none.then(|| Self {
            crc: u32::from_le_bytes(*crc),
            records: records.unwrap_or(rest),
            whole: records.is_some(),
        })
    }
}
