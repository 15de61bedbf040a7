//! A recording in memory: the samples of one robot, found by their names.

use crate::out::usage;
use crate::unread::Unread;
use axle_recorder::{Account, Entry, Recording};
use axle_schema::codec::{Message, decode, decode_as};
use axle_schema::meta::{Cause, Meta};
use axle_schema::trace::{Named, Trace};
use axle_schema::traffic::TrafficState;
use axle_schema::{Refusal, RobotId, key};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;
use std::sync::Arc;

/// The most payload that is held, in bytes: hours of a robot.
const MOST: usize = 2 * 1024 * 1024 * 1024;

/// A sample.
#[derive(Clone, Debug)]
pub(crate) struct Item {
    /// Its encoding.
    pub(crate) encoding: Arc<str>,
    /// What its attachment says.
    pub(crate) meta: Option<Meta>,
    /// Its bytes.
    pub(crate) payload: Vec<u8>,
    /// When it arrived at the recorder, in nanoseconds since 1970.
    pub(crate) received: u64,
}

impl Item {
    /// Decodes it.
    ///
    /// # Errors
    /// What [`decode_as`] refuses.
    pub(crate) fn read<M: Message>(&self) -> Result<M, Refusal> {
        decode_as(&self.encoding, &self.payload)
    }
    /// Its name.
    pub(crate) fn name(&self) -> Option<Cause> {
        self.meta.map(|meta| Cause { source: meta.source, seq: meta.seq })
    }
}

/// What was said of one robot.
#[derive(Default)]
pub(crate) struct Log {
    /// The robot.
    pub(crate) robot: String,
    /// When the recording begins, in nanoseconds since 1970.
    pub(crate) began: u64,
    /// Samples that the recorder missed.
    pub(crate) account: Account,
    /// Samples of schemas that this program does not read.
    pub(crate) unread: Unread,
    /// What Traffic says of the fleet; nobody records it, so it is known only of the mesh now.
    pub(crate) traffic: Option<TrafficState>,
    streams: BTreeMap<String, Vec<Item>>,
    names: HashMap<(u64, u64), Vec<(String, usize)>>,
    bytes: usize,
}

impl Log {
    /// A log that is filled by [`Log::push`].
    pub(crate) fn of(robot: &str) -> Self {
        Self { robot: robot.to_owned(), ..Self::default() }
    }

    /// Reads a recording of one robot: the one that is named, or the only one.
    pub(crate) fn read(path: &Path, robot: Option<&RobotId>) -> anyhow::Result<Self> {
        let mut recording =
            Recording::open(path).map_err(|fault| usage(format!("{:#}", anyhow::Error::new(fault))))?;
        let mut robots = BTreeSet::new();
        let mut log = Self { robot: robot.map_or_else(String::new, ToString::to_string), ..Self::default() };
        for entry in recording.by_ref() {
            let Entry::Sample(sample) = entry else { continue };
            let Some(place) = key::place(&sample.key) else { continue };
            if place.robot != axle_schema::id::ALL {
                robots.insert(place.robot.to_owned());
            }
            let meta = sample.attachment.as_deref().and_then(|bytes| decode(bytes).ok());
            let item =
                Item { encoding: sample.encoding, meta, payload: sample.payload, received: sample.received };
            if robot.is_none_or(|robot| robot.as_str() == place.robot)
                && log.unread.is_known(&sample.key, &item.encoding)
            {
                anyhow::ensure!(
                    log.bytes < MOST,
                    "the recording is too large for this machine's memory; `axle record cut` makes a part of it"
                );
                log.push(&format!("{}/{}", place.service, place.name), item);
            }
        }
        log.account = recording.account().clone();
        let names = || robots.iter().cloned().collect::<Vec<_>>().join(", ");
        match robot {
            Some(robot) if !robots.contains(robot.as_str()) => {
                return Err(usage(format!("nothing of {robot} was recorded, but of {:?}", names())));
            }
            None if robots.len() > 1 => {
                return Err(usage(format!(
                    "several robots were recorded: {}; choose one by --robot",
                    names()
                )));
            }
            None => log.robot = names(),
            Some(_) => {}
        }
        Ok(log)
    }

    /// Adds a sample of a stream.
    pub(crate) fn push(&mut self, port: &str, item: Item) {
        if self.began == 0 || item.received < self.began {
            self.began = item.received;
        }
        self.bytes += item.payload.len();
        let list = match self.streams.get_mut(port) {
            Some(list) => list,
            None => self.streams.entry(port.to_owned()).or_default(),
        };
        if let Some(meta) = item.meta {
            self.names.entry((meta.source.0, meta.seq)).or_default().push((port.to_owned(), list.len()));
        }
        list.push(item);
    }

    /// The samples of a stream in the order of their arrival.
    pub(crate) fn stream(&self, port: &str) -> &[Item] {
        self.streams.get(port).map_or(&[], Vec::as_slice)
    }
    /// The streams.
    pub(crate) fn ports(&self) -> impl Iterator<Item = (&str, &[Item])> {
        self.streams.iter().map(|(port, items)| (port.as_str(), items.as_slice()))
    }

    /// The sample of this name. A service may hear a stream from elsewhere: then it stands under another one, but is a
    /// message of the same type.
    pub(crate) fn find(&self, named: &Named) -> Option<&Item> {
        let places = self.names.get(&(named.source.0, named.seq))?;
        let all = || {
            places.iter().filter_map(|place| {
                let (port, index) = place;
                Some((port.as_str(), self.streams.get(port)?.get(*index)?))
            })
        };
        let wanted = key::find_stream(&named.port).map(key::Entry::carries);
        all()
            .find(|(port, _)| *port == named.port)
            .or_else(|| all().find(|(_, item)| schema(&item.encoding) == wanted.as_deref()))
            .map(|(_, item)| item)
    }
    /// The sample of this name on one of these streams.
    pub(crate) fn find_on<'a>(&'a self, ports: &[&'a str], cause: Cause) -> Option<(&'a str, &'a Item)> {
        let places = self.names.get(&(cause.source.0, cause.seq))?;
        let place = places.iter().find(|(port, _)| ports.contains(&port.as_str()))?;
        let port = ports.iter().find(|port| **port == place.0)?;
        Some((port, self.streams.get(&place.0)?.get(place.1)?))
    }

    /// The traces of a service, each with whether it follows upon the one before it: its publishers one after the
    /// other, each in the order of its own numbers.
    pub(crate) fn traces(&self, service: &str) -> Vec<Traced> {
        let mut traces: Vec<(Meta, u64, Trace)> = self
            .stream(&format!("{service}/trace"))
            .iter()
            .filter_map(|item| Some((item.meta?, item.received, item.read().ok()?)))
            .collect();
        let mut order = Vec::new();
        for (meta, ..) in &traces {
            if !order.contains(&meta.source) {
                order.push(meta.source);
            }
        }
        traces.sort_by_key(|(meta, ..)| (order.iter().position(|source| *source == meta.source), meta.seq));
        traces.dedup_by_key(|(meta, ..)| (meta.source, meta.seq));
        let mut before: Option<Meta> = None;
        traces
            .into_iter()
            .map(|(meta, received, trace)| {
                let follows = before.is_some_and(|it| it.source == meta.source && it.seq + 1 == meta.seq);
                before = Some(meta);
                Traced { trace, follows, time: self.seconds(received) }
            })
            .collect()
    }
    /// Seconds since the beginning of the recording.
    #[allow(clippy::cast_precision_loss, reason = "microseconds are enough to find a place in a recording")]
    pub(crate) fn seconds(&self, received: u64) -> f64 {
        received.saturating_sub(self.began) as f64 / 1e9
    }
}

/// A trace of a recording.
pub(crate) struct Traced {
    /// What was said.
    pub(crate) trace: Trace,
    /// Whether the one before it is there too.
    pub(crate) follows: bool,
    /// Seconds since the beginning of the recording.
    pub(crate) time: f64,
}

fn schema(encoding: &str) -> Option<&str> {
    encoding.split_once(';').map(|(_, schema)| schema)
}
