//! Clocks of a process: its own monotonic time, and the wall time for logs.

use axle_schema::Seconds;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Monotonic time since the process joined the mesh; the only clock that decides anything.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    start: Instant,
}

impl Clock {
    /// A clock that shows 0 now.
    #[must_use]
    pub fn start() -> Self {
        Self { start: Instant::now() }
    }
    /// Time since the start.
    #[must_use]
    pub fn now(&self) -> Seconds {
        Seconds(self.start.elapsed().as_secs_f64())
    }
    /// The instant at which the clock shows `at`.
    #[must_use]
    pub(crate) fn instant(&self, at: Duration) -> Instant {
        self.start + at
    }
    /// Time since the start, exactly.
    #[must_use]
    pub(crate) fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }
}

/// Wall time in seconds since 1970: for people and logs, never for motion.
#[must_use]
pub fn wall() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

/// Wall time in nanoseconds since 1970, as recordings count it.
#[must_use]
pub fn wall_nanoseconds() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
}
