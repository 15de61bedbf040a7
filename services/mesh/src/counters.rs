//! What a process counts of itself, for its status.

use axle_schema::Seconds;
use hdrhistogram::Histogram;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
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
    pub(crate) fn says(&self) -> Vec<String> {
        self.says.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
    pub(crate) fn hears(&self) -> Vec<String> {
        self.hears.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

fn note(list: &Mutex<Vec<String>>, key: &str) {
    let mut list = list.lock().unwrap_or_else(PoisonError::into_inner);
    if list.len() < axle_schema::presence::MAX_KEYS && !list.iter().any(|known| known == key) {
        list.push(key.to_owned());
    }
}
