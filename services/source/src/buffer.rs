//! One bounded buffer of measurements in the order of their stamps.
//!
//! Samples come nearly in order, so that the place of a new one is looked for from the newest end. Gaps in the
//! sequence numbers of the publisher are counted as losses, and a late sample that fills a gap is taken off again.

use axle_schema::meta::Meta;
use axle_schema::{Boot, EncodersData, Fix, InertialData, Range, Seconds};
use std::collections::VecDeque;

/// A measurement at a stamp of the robot's clock.
pub(crate) trait Stamped: Copy {
    /// A stamp that goes back by more than this, in s, begins a new run of the robot; by less, it is only late.
    const RESTART: f64 = 1.0;
    /// Its stamp.
    fn stamp(&self) -> Seconds;
    /// Whether it says what `other`, which has the same stamp, has said already.
    fn repeats(&self, _other: &Self) -> bool {
        // A sensor has one value at a time.
        true
    }
}
impl Stamped for EncodersData {
    fn stamp(&self) -> Seconds {
        self.stamp
    }
}
impl Stamped for InertialData {
    fn stamp(&self) -> Seconds {
        self.stamp
    }
}
impl Stamped for Fix {
    /// A camera may think for seconds before it says where the robot was.
    const RESTART: f64 = 10.0;
    fn stamp(&self) -> Seconds {
        self.stamp
    }
    fn repeats(&self, other: &Self) -> bool {
        // Two beacons may be seen in the same picture.
        self == other
    }
}

impl Stamped for Range {
    /// As a fix, it may be thought about for a while.
    const RESTART: f64 = 10.0;
    fn stamp(&self) -> Seconds {
        self.stamp
    }
    fn repeats(&self, other: &Self) -> bool {
        // Several points may answer at once.
        self == other
    }
}

/// The newest measurements of one kind.
#[derive(Clone, Debug)]
pub(crate) struct Buffer<T> {
    capacity: usize,
    /// Sorted by stamp, oldest first.
    data: VecDeque<T>,
    /// The run of the process that publishes them.
    pub(crate) source: Option<Boot>,
    /// The first and the largest sequence number of that run.
    seqs: Option<(u64, u64)>,
    /// Samples of that run that never came.
    pub(crate) dropped: u64,
}

impl<T: Stamped> Buffer<T> {
    pub(crate) fn new(capacity: usize) -> Self {
        Self { capacity, data: VecDeque::with_capacity(capacity), source: None, seqs: None, dropped: 0 }
    }

    /// Forgets everything, also who published it.
    pub(crate) fn clear(&mut self) {
        self.data.clear();
        (self.source, self.seqs, self.dropped) = (None, None, 0);
    }

    /// Whether this sample begins a new run: of its publisher, or of the clock that stamps it.
    pub(crate) fn restarts(&self, meta: Option<Meta>, datum: &T) -> bool {
        let other = meta.is_some_and(|meta| self.source.is_some_and(|source| source != meta.source));
        other || self.newest().is_some_and(|newest| datum.stamp().0 < newest.0 - T::RESTART)
    }

    /// Keeps one measurement; it is dropped if it repeats one, or if the buffer is full of newer ones.
    pub(crate) fn insert(&mut self, meta: Option<Meta>, datum: T) {
        let place =
            self.data.iter().rposition(|kept| kept.stamp() <= datum.stamp()).map_or(0, |last| last + 1);
        let same = self.data.range(..place).rev().take_while(|kept| kept.stamp() >= datum.stamp());
        let repeated = same.into_iter().any(|kept| datum.repeats(kept));
        if let Some(Meta { seq, source, .. }) = meta {
            self.source = Some(source);
            // The same sample once more fills no gap.
            if !repeated || self.seqs.is_none_or(|(_, largest)| seq > largest) {
                self.count(seq);
            }
        }
        if repeated {
            return;
        }
        if self.data.len() < self.capacity {
            self.data.insert(place, datum);
        } else if place > 0 {
            self.data.pop_front();
            self.data.insert(place - 1, datum);
        }
    }

    fn count(&mut self, seq: u64) {
        let (first, largest) = self.seqs.unwrap_or((seq, seq));
        if seq > largest {
            self.dropped = self.dropped.saturating_add(seq - largest - 1);
        } else if seq > first && seq < largest {
            // Late, but not lost.
            self.dropped = self.dropped.saturating_sub(1);
        }
        self.seqs = Some((first, largest.max(seq)));
    }

    /// The stamp of the newest measurement.
    pub(crate) fn newest(&self) -> Option<Seconds> {
        self.data.back().map(Stamped::stamp)
    }

    /// All measurements from `begin` on, oldest first; none from NaN on.
    pub(crate) fn since(&self, begin: f64) -> Vec<T> {
        let first = self.data.partition_point(|datum| !(begin..).contains(&datum.stamp().0));
        self.data.range(first..).copied().collect()
    }
}
