//! What a process counts of itself, for its status.

use axle_schema::presence::Flow;
use axle_schema::{Refusal, Seconds};
use hdrhistogram::Histogram;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A beat that comes this much after its time counts as late.
pub(crate) const LATE: Duration = Duration::from_millis(5);

/// Counts of messages and beats.
#[derive(Debug)]
pub struct Counters {
    /// Messages published and replies given.
    pub sent: AtomicU64,
    /// Messages and queries taken.
    pub received: AtomicU64,
    /// Messages and queries that were refused or could not be read.
    pub refused: AtomicU64,
    beats: AtomicU64,
    late: AtomicU64,
    lateness_us: Mutex<Histogram<u64>>,
    says: Mutex<Vec<String>>,
    hears: Mutex<Vec<String>>,
    said: Mutex<Vec<Arc<Count>>>,
    heard: Mutex<Vec<Arc<Count>>>,
}

/// The samples of one key.
#[derive(Debug)]
pub(crate) struct Count {
    key: String,
    samples: AtomicU64,
    refused: AtomicU64,
    why: Mutex<Option<String>>,
}

impl Count {
    pub(crate) fn one(&self) {
        self.samples.fetch_add(1, Relaxed);
    }
    pub(crate) fn refused(&self, refusal: &Refusal) {
        self.refused.fetch_add(1, Relaxed);
        // A stranger's words are cut before they are kept.
        let why = refusal.to_string().chars().take(160).collect();
        *self.why.lock().unwrap_or_else(PoisonError::into_inner) = Some(why);
    }
    fn flow(&self) -> Flow {
        Flow {
            key: self.key.clone(),
            count: self.samples.load(Relaxed),
            refused: self.refused.load(Relaxed),
            why: self.why.lock().unwrap_or_else(PoisonError::into_inner).clone(),
        }
    }
}

impl Counters {
    pub(crate) fn new() -> Self {
        // Two digits from 1 µs to 60 s: a few kilobytes, of fixed size.
        #[allow(clippy::expect_used, reason = "the bounds are constants that fit each other")]
        let lateness = Histogram::new_with_bounds(1, 60_000_000, 2).expect("bounds of a histogram");
        Self {
            sent: AtomicU64::new(0),
            received: AtomicU64::new(0),
            refused: AtomicU64::new(0),
            beats: AtomicU64::new(0),
            late: AtomicU64::new(0),
            lateness_us: Mutex::new(lateness),
            says: Mutex::new(Vec::new()),
            hears: Mutex::new(Vec::new()),
            said: Mutex::new(Vec::new()),
            heard: Mutex::new(Vec::new()),
        }
    }

    /// Counts one beat that came `lateness` after its time.
    pub(crate) fn beat(&self, lateness: Duration) {
        self.beats.fetch_add(1, Relaxed);
        if lateness > LATE {
            self.late.fetch_add(1, Relaxed);
        }
        let us = u64::try_from(lateness.as_micros()).unwrap_or(u64::MAX).max(1);
        self.lateness_us.lock().unwrap_or_else(PoisonError::into_inner).saturating_record(us);
    }
    /// Counts a message that its reader refused.
    pub fn count_refused(&self) {
        self.refused.fetch_add(1, Relaxed);
    }
    /// Beats made.
    #[must_use]
    pub fn beats(&self) -> u64 {
        self.beats.load(Relaxed)
    }
    /// Beats that came late.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.late.load(Relaxed)
    }
    /// The lateness that the given share of the beats did not exceed.
    #[must_use]
    pub fn lateness(&self, quantile: f64) -> Seconds {
        let histogram = self.lateness_us.lock().unwrap_or_else(PoisonError::into_inner);
        Seconds(Duration::from_micros(histogram.value_at_quantile(quantile)).as_secs_f64())
    }

    pub(crate) fn note_says(&self, key: &str) {
        note(&self.says, key);
    }
    pub(crate) fn note_hears(&self, key: &str) {
        note(&self.hears, key);
    }
    /// Where the samples that are published on a key are counted.
    pub(crate) fn count_said(&self, key: &str) -> Arc<Count> {
        count(&self.said, key)
    }
    /// Where the samples that arrive on a key are counted.
    pub(crate) fn count_heard(&self, key: &str) -> Arc<Count> {
        count(&self.heard, key)
    }
    pub(crate) fn said(&self) -> Vec<Flow> {
        self.said.lock().unwrap_or_else(PoisonError::into_inner).iter().map(|count| count.flow()).collect()
    }
    pub(crate) fn heard(&self) -> Vec<Flow> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).iter().map(|count| count.flow()).collect()
    }
    pub(crate) fn says(&self) -> Vec<String> {
        self.says.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
    pub(crate) fn hears(&self) -> Vec<String> {
        self.hears.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// The count of a key; those beyond the bound of the status are counted for nobody.
fn count(list: &Mutex<Vec<Arc<Count>>>, key: &str) -> Arc<Count> {
    let mut list = list.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = list.iter().find(|count| count.key == key) {
        return Arc::clone(known);
    }
    let new = Arc::new(Count {
        key: key.to_owned(),
        samples: AtomicU64::new(0),
        refused: AtomicU64::new(0),
        why: Mutex::new(None),
    });
    if list.len() < axle_schema::presence::MAX_KEYS {
        list.push(Arc::clone(&new));
    }
    new
}

fn note(list: &Mutex<Vec<String>>, key: &str) {
    let mut list = list.lock().unwrap_or_else(PoisonError::into_inner);
    // What is about the process itself is no wire between services.
    if key.contains("/@") || key.ends_with("/log") {
        return;
    }
    if list.len() < axle_schema::presence::MAX_KEYS && !list.iter().any(|known| known == key) {
        list.push(key.to_owned());
    }
}
