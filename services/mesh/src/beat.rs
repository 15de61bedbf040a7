//! Beats: acting at one's own pace.
//!
//! A beat that could not be kept is skipped, never made up for: two steps at once would be steps with no time between
//! them. How late each beat came is counted and shown by `axle ps`. What cannot wait for the next beat rings an [`Alarm`].

use crate::{Clock, Counters, Mesh};
use axle_schema::Seconds;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::Thread;
use std::time::Duration;

/// A beat of an asynchronous loop.
pub struct Beat {
    period: Duration,
    due: Duration,
    clock: Clock,
    counters: Arc<Counters>,
}

/// Wakes a thread with a beat before its time. Cloning shares it.
#[derive(Clone, Default)]
pub struct Alarm(Arc<Bell>);

#[derive(Default)]
struct Bell {
    rings: AtomicBool,
    wakes: OnceLock<Thread>,
}

impl Alarm {
    /// Has the thread act as soon as it can. It acts once more between two beats at the most, however often this is
    /// called: a flood of alarms costs no more than the beats do.
    pub fn ring(&self) {
        self.0.rings.store(true, Ordering::Release);
        if let Some(thread) = self.0.wakes.get() {
            thread.unpark();
        }
    }
    /// Waits for so long, or until it rings, or until the thread is woken for nothing; says whether it rings.
    fn rings_within(&self, time: Duration) -> bool {
        if !self.0.rings.load(Ordering::Acquire) {
            std::thread::park_timeout(time);
        }
        self.0.rings.load(Ordering::Acquire)
    }
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
    /// returns `false`; and once in between when the alarm rings. It gets the time of this process, and never the same
    /// time twice.
    ///
    /// # Errors
    /// When the operating system gives no thread.
    pub fn beat_on_own_thread(
        &self,
        name: &str,
        period: Seconds,
        alarm: Alarm,
        mut act: impl FnMut(Seconds) -> bool + Send + 'static,
    ) -> std::io::Result<std::thread::JoinHandle<()>> {
        let mut beat = self.beat(period);
        std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            beat.run(&alarm, |at| {
                let _span = tracing::info_span!("beat", at = at.0).entered();
                act(at)
            });
        })
    }
}

impl Beat {
    /// Waits for the next beat and says its time.
    pub async fn next(&mut self) -> Seconds {
        tokio::time::sleep_until(self.clock.instant(self.due).into()).await;
        self.begin()
    }

    /// Acts on this thread until it is told not to.
    fn run(&mut self, alarm: &Alarm, mut act: impl FnMut(Seconds) -> bool) {
        // An alarm has one thread; where it is not this one, only its beats come.
        drop(alarm.0.wakes.set(std::thread::current()));
        let mut was_early = false;
        loop {
            let at = self.due_or(alarm, &mut was_early);
            // What came until now is seen now.
            alarm.0.rings.store(false, Ordering::Release);
            if !act(at) {
                return;
            }
        }
    }

    /// Waits on this thread for the next beat, or for the alarm if it has not rung since the last one; the time.
    fn due_or(&mut self, alarm: &Alarm, was_early: &mut bool) -> Seconds {
        loop {
            let rest = self.due.saturating_sub(self.clock.elapsed());
            if rest.is_zero() {
                *was_early = false;
                return self.begin();
            }
            if *was_early {
                std::thread::sleep(rest);
            } else if alarm.rings_within(rest) {
                *was_early = true;
                return Seconds(self.clock.elapsed().as_secs_f64());
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    fn beat(period: Duration) -> Beat {
        Beat { period, due: period, clock: Clock::start(), counters: Arc::new(Counters::new()) }
    }

    #[test]
    fn a_thread_with_a_beat_of_a_minute_hears_an_alarm_at_once() {
        let alarm = Alarm::default();
        // The first one rings before the thread is there.
        alarm.ring();
        let (said, heard) = mpsc::channel();
        let rung = alarm.clone();
        std::thread::spawn(move || beat(Duration::from_secs(60)).run(&rung, |at| said.send(at).is_ok()));
        let at = heard.recv_timeout(Duration::from_secs(30)).expect("long before the beat");
        assert!(at.0 < 30.0, "{at}");
    }

    #[test]
    fn alarms_make_a_thread_act_once_between_two_beats() {
        let alarm = Alarm::default();
        let period = Duration::from_millis(20);
        let mut beat = beat(period);
        let mut was_early = false;
        drop(alarm.0.wakes.set(std::thread::current()));
        let mut times = Vec::new();
        for _ in 0..4 {
            alarm.ring();
            times.push((beat.due_or(&alarm, &mut was_early), was_early));
        }
        // Early or, on a machine that was busy, not; but never early twice, and a beat comes at its time.
        assert!(times.windows(2).all(|two| !(two[0].1 && two[1].1)), "{times:?}");
        let beats: Vec<_> = times.iter().filter(|(_, early)| !early).collect();
        assert!(beats.len() >= 2 && beats[0].0.0 >= period.as_secs_f64(), "{times:?}");
    }
}
