//! Hearing what is said on a key.
//!
//! Zenoh calls back from the task that reads the link: whoever lingers there stalls every stream of the process, and
//! a stall longer than the lease ends the session. So the callback only stores, in a queue that forgets the oldest
//! when it is full; decoding happens in the beat of the service.

use crate::counters::Count;
use crate::{Alarm, Counters, Fault, Mesh};
use axle_schema::Refusal;
use axle_schema::codec::{Message, decode, decode_as};
use axle_schema::key::Key;
use axle_schema::meta::Meta;
use std::collections::VecDeque;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use zenoh::Wait as _;
use zenoh::sample::Sample;

/// A sample as it came, not decoded yet.
#[derive(Clone, Debug)]
pub struct Raw {
    /// The concrete key.
    pub key: String,
    /// The encoding, for example `application/cbor;axle.Dwm.v1`.
    pub encoding: String,
    /// The payload.
    pub payload: Vec<u8>,
    /// The attachment, empty if there was none.
    pub attachment: Vec<u8>,
    /// Whether the sample deletes the key.
    pub deletes: bool,
    /// When it came, as wall time in nanoseconds since 1970.
    pub received: u64,
}

impl Raw {
    fn of(Stamped { sample, at }: &Stamped) -> Self {
        Self {
            key: sample.key_expr().as_str().to_owned(),
            encoding: sample.encoding().to_string(),
            payload: sample.payload().to_bytes().into_owned(),
            attachment: sample.attachment().map(|bytes| bytes.to_bytes().into_owned()).unwrap_or_default(),
            deletes: sample.kind() == zenoh::sample::SampleKind::Delete,
            received: *at,
        }
    }
    /// The sequence, source and cause of the sample, if its attachment has them.
    #[must_use]
    pub fn meta(&self) -> Option<Meta> {
        decode(&self.attachment).ok()
    }
}

/// The most bytes of payload that wait in one queue, whatever its capacity in samples.
const MAX_WAITING: usize = 32 * 1024 * 1024;

/// What waits in a queue.
trait Arrived {
    /// The bytes of its payload.
    fn size(&self) -> usize;
}

/// A sample, and when it came.
struct Stamped {
    sample: Sample,
    at: u64,
}

impl Stamped {
    fn now(sample: Sample) -> Self {
        Self { sample, at: crate::clock::wall_nanoseconds() }
    }
}

impl Arrived for Stamped {
    fn size(&self) -> usize {
        self.sample.payload().len()
    }
}

impl Arrived for Raw {
    fn size(&self) -> usize {
        self.payload.len()
    }
}

/// A queue between a callback and a beat, bounded in samples and in bytes.
struct Cell<A> {
    queue: Mutex<Queue<A>>,
    capacity: usize,
    arrived: Notify,
    alarm: OnceLock<Alarm>,
    dropped: AtomicU64,
}

struct Queue<A> {
    samples: VecDeque<A>,
    bytes: usize,
}

impl<A: Arrived> Queue<A> {
    fn pop(&mut self) -> Option<A> {
        let arrived = self.samples.pop_front()?;
        self.bytes -= arrived.size();
        Some(arrived)
    }
}

impl<A: Arrived> Cell<A> {
    fn new(capacity: usize) -> Arc<Self> {
        Arc::new(Self {
            queue: Mutex::new(Queue { samples: VecDeque::new(), bytes: 0 }),
            capacity,
            arrived: Notify::new(),
            alarm: OnceLock::new(),
            dropped: AtomicU64::new(0),
        })
    }
    fn store(&self, arrived: A) {
        let size = arrived.size();
        let mut queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        while queue.samples.len() >= self.capacity || queue.bytes + size > MAX_WAITING {
            self.dropped.fetch_add(1, Relaxed);
            if queue.pop().is_none() {
                return;
            }
        }
        queue.bytes += size;
        queue.samples.push_back(arrived);
        drop(queue);
        self.arrived.notify_one();
        self.ring();
    }
    fn ring(&self) {
        if let Some(alarm) = self.alarm.get() {
            alarm.ring();
        }
    }
    fn oldest(&self) -> Option<A> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner).pop()
    }
    fn newest(&self) -> Option<A> {
        let mut queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        let newest = queue.samples.pop_back();
        queue.samples.clear();
        queue.bytes = 0;
        newest
    }
    async fn next(&self) -> A {
        loop {
            if let Some(sample) = self.oldest() {
                return sample;
            }
            self.arrived.notified().await;
        }
    }
}

/// What was heard: a message, and what its attachment says of it.
#[derive(Clone, Debug)]
pub struct Heard<M> {
    /// The message.
    pub message: M,
    /// Sequence, source and cause; plain clients leave them out.
    pub meta: Option<Meta>,
}

/// Samples of one key, waiting to be taken.
pub struct Inbox<M> {
    cell: Arc<Cell<Stamped>>,
    oversized: Arc<AtomicU64>,
    counters: Arc<Counters>,
    count: Arc<Count>,
    complaints: Complaints,
    // Dropping the subscriber undeclares it.
    _subscriber: zenoh::pubsub::Subscriber<()>,
    carries: PhantomData<fn() -> M>,
}

/// Raw samples of a key expression, waiting to be taken: for taps and recorders.
pub struct Tap {
    expression: zenoh::key_expr::KeyExpr<'static>,
    cell: Arc<Cell<Raw>>,
    counters: Arc<Counters>,
    _subscriber: zenoh::pubsub::Subscriber<()>,
}

impl Mesh {
    /// Hears a key; at most `capacity` samples wait, the oldest is forgotten for a new one.
    ///
    /// # Errors
    /// [`Fault::Declare`].
    pub fn inbox<M: Message>(&self, key: &Key<M>, capacity: usize) -> Result<Inbox<M>, Fault> {
        let heard_from = self.rewired(key.as_str());
        let cell = Cell::new(capacity);
        let (store, counters) = (Arc::clone(&cell), Arc::clone(&self.counters));
        let oversized = Arc::new(AtomicU64::new(0));
        let count_oversized = Arc::clone(&oversized);
        let count = self.counters.count_heard(&heard_from);
        let arrived = Arc::clone(&count);
        let subscriber = self
            .session
            .declare_subscriber(heard_from.clone())
            .callback(move |sample| {
                arrived.one();
                // An oversized payload is not even stored: it costs no memory and no decoding.
                if sample.payload().len() > M::LIMIT {
                    counters.refused.fetch_add(1, Relaxed);
                    count_oversized.fetch_add(1, Relaxed);
                    store.ring();
                } else {
                    store.store(Stamped::now(sample));
                }
            })
            .wait()
            .map_err(|source| Fault::Declare { key: key.to_string(), source })?;
        self.counters.note_hears(&heard_from);
        Ok(Inbox {
            cell,
            oversized,
            counters: Arc::clone(&self.counters),
            count,
            complaints: Complaints::new(key.to_string()),
            _subscriber: subscriber,
            carries: PhantomData,
        })
    }

    /// Hears everything that a key expression matches, undecoded; read-only, bounded, never slows a sender.
    ///
    /// # Errors
    /// [`Fault::KeyExpression`] and [`Fault::Declare`].
    pub fn tap(&self, expression: &str, capacity: usize) -> Result<Tap, Fault> {
        let expression = zenoh::key_expr::KeyExpr::autocanonize(expression.to_owned())
            .map_err(|_| Fault::KeyExpression(expression.to_owned()))?;
        let cell = Cell::new(capacity);
        let store = Arc::clone(&cell);
        let key = expression.to_string();
        let subscriber = self
            .session
            .declare_subscriber(expression.clone())
            // A copy: a sample holds the whole buffer that it was received in, however small it is itself.
            .callback(move |sample| store.store(Raw::of(&Stamped::now(sample))))
            .wait()
            .map_err(|source| Fault::Declare { key, source })?;
        Ok(Tap { expression, cell, counters: Arc::clone(&self.counters), _subscriber: subscriber })
    }
}

impl<M: Message> Inbox<M> {
    /// From now on rings this alarm for every sample that comes, unless it rings one already.
    pub fn rings(&self, alarm: Alarm) {
        drop(self.cell.alarm.set(alarm));
    }
    /// The newest message that waits, if any; older ones are forgotten.
    pub fn latest(&self) -> Option<Heard<M>> {
        self.read(&self.cell.newest()?)
    }
    /// The oldest message that waits, if any.
    pub fn take(&self) -> Option<Heard<M>> {
        loop {
            let sample = self.cell.oldest()?;
            if let Some(heard) = self.read(&sample) {
                return Some(heard);
            }
        }
    }
    /// The oldest message, as soon as there is one.
    pub async fn next(&self) -> Heard<M> {
        loop {
            let sample = self.cell.next().await;
            if let Some(heard) = self.read(&sample) {
                return heard;
            }
        }
    }
    /// The oldest sample as it came, for a reader that judges it itself.
    pub fn take_raw(&self) -> Option<Raw> {
        let sample = self.cell.oldest()?;
        self.counters.received.fetch_add(1, Relaxed);
        Some(Raw::of(&sample))
    }
    /// Samples that were forgotten because nobody took them in time.
    pub fn dropped(&self) -> u64 {
        self.cell.dropped.load(Relaxed)
    }
    /// Samples that were not even stored, since they were larger than the message may be.
    pub fn oversized(&self) -> u64 {
        self.oversized.load(Relaxed)
    }

    fn read(&self, Stamped { sample, .. }: &Stamped) -> Option<Heard<M>> {
        self.counters.received.fetch_add(1, Relaxed);
        match decode_as(&sample.encoding().to_string(), &sample.payload().to_bytes()) {
            Ok(message) => {
                let meta = sample.attachment().and_then(|bytes| decode(&bytes.to_bytes()).ok());
                Some(Heard { message, meta })
            }
            Err(refusal) => {
                self.counters.refused.fetch_add(1, Relaxed);
                self.count.refused(&refusal);
                self.complaints.say(&refusal);
                None
            }
        }
    }
}

impl Tap {
    /// Whether it hears this key.
    #[must_use]
    pub fn hears(&self, key: &str) -> bool {
        zenoh::key_expr::KeyExpr::new(key).is_ok_and(|key| self.expression.intersects(&key))
    }
    /// The oldest sample, as soon as there is one.
    pub async fn next(&self) -> Raw {
        let raw = self.cell.next().await;
        self.counters.received.fetch_add(1, Relaxed);
        raw
    }
    /// The oldest sample that waits, if any.
    pub fn take(&self) -> Option<Raw> {
        let raw = self.cell.oldest()?;
        self.counters.received.fetch_add(1, Relaxed);
        Some(raw)
    }
    /// Samples that were forgotten because nobody took them in time.
    pub fn dropped(&self) -> u64 {
        self.cell.dropped.load(Relaxed)
    }
}

/// Logs refusals of one key at most once a second: a flood of bad messages must not become a flood of logs.
struct Complaints {
    key: String,
    last: Mutex<(Option<Instant>, u64)>,
}

impl Complaints {
    const fn new(key: String) -> Self {
        Self { key, last: Mutex::new((None, 0)) }
    }
    fn say(&self, refusal: &Refusal) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        last.1 += 1;
        if last.0.is_none_or(|at| at.elapsed() >= Duration::from_secs(1)) {
            tracing::warn!(key = %self.key, refused = last.1, "{refusal}");
            *last = (Some(Instant::now()), 0);
        }
    }
}
