//! Beats: acting at one's own pace.
//!
//! A beat that could not be kept is skipped, never made up for: two steps at once would be steps with no time between
//! them. How late each beat came is counted and shown by `axle ps`.

use crate::{Clock, Counters, Mesh};
use axle_schema::Seconds;
use std::sync::Arc;
use std::time::Duration;

/// A beat of an asynchronous loop.
pub struct Beat {
    period: Duration,
    due: Duration,
    clock: Clock,
    counters: Arc<Counters>,
}

impl Mesh {
    /// A beat with the given period, at least 1 ms.
    #[must_use]
    pub fn beat(&self, period: Seconds) -> Beat {
        let period = Duration::from_secs_f64(period.0.clamp(1e-3, 3600.0));
        let due = self.clock().elapsed() + period;
        Beat { period, due, clock: self.clock(), counters: Arc::clone(&self.counters) }
    }

    /// Runs `act` at every beat on a thread of its own, which no other work of the process can hold up, until it
    /// returns `false`. It gets the time of this process, and never the same time twice.
    ///
    /// # Errors
    /// When the operating system gives no thread.
    pub fn beat_on_own_thread(
        &self,
        name: &str,
        period: Seconds,
        mut act: impl FnMut(Seconds) -> bool + Send + 'static,
    ) -> std::io::Result<std::thread::JoinHandle<()>> {
        let mut beat = self.beat(period);
        std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            loop {
                std::thread::sleep(beat.due.saturating_sub(beat.clock.elapsed()));
                if !act(beat.begin()) {
                    break;
                }
            }
        })
    }
}

impl Beat {
    /// Waits for the next beat and says its time.
    pub async fn next(&mut self) -> Seconds {
        tokio::time::sleep_until(self.clock.instant(self.due).into()).await;
        self.begin()
    }

    fn begin(&mut self) -> Seconds {
        let now = self.clock.elapsed();
        self.counters.beat(now.saturating_sub(self.due));
        self.due += self.period;
        if self.due <= now {
            // Beats that are over are skipped; the next one keeps the phase.
            let missed = (now - self.due).as_nanos() / self.period.as_nanos() + 1;
            self.due += self.period * u32::try_from(missed).unwrap_or(u32::MAX);
        }
        Seconds(now.as_secs_f64())
    }
}
