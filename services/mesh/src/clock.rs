//! Clocks of a process: its own monotonic time, and the wall time for logs.

use axle_schema::Seconds;
use std::sync::OnceLock;
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

/// The variable that makes the wall clock of one process wrong, for trials of what wrong clocks do: `SECONDS` are added to
/// it, with `SECONDS@AFTER` so many seconds after the process first looked at it.
pub const STEP: &str = "AXLE_WALL_STEP";

/// A step of the wall clock.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    seconds: f64,
    after: Duration,
}

impl Step {
    /// `3600` or `-3600@2.5`; what is none of both is no step.
    fn parse(text: &str) -> Option<Self> {
        let (seconds, after) = text.split_once('@').unwrap_or((text, "0"));
        let seconds = seconds.parse().ok().filter(|seconds: &f64| seconds.is_finite())?;
        Some(Self { seconds, after: Duration::try_from_secs_f64(after.parse().ok()?).ok()? })
    }
}

/// What is added to the clock of the system now.
fn step() -> f64 {
    static BEGUN: OnceLock<Option<(Instant, Step)>> = OnceLock::new();
    let read = || Some((Instant::now(), Step::parse(&std::env::var(STEP).ok()?)?));
    match BEGUN.get_or_init(read) {
        Some((begun, step)) if begun.elapsed() >= step.after => step.seconds,
        _ => 0.0,
    }
}

/// Wall time in seconds since 1970: for people and logs, never for motion.
#[must_use]
pub fn wall() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64()) + step()
}

/// Wall time in nanoseconds since 1970, as recordings count it.
#[must_use]
pub fn wall_nanoseconds() -> u64 {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| u64::try_from(since.as_nanos()).unwrap_or(u64::MAX));
    // Where there is no step, and there is none outside of trials, the nanoseconds stay exact.
    #[allow(clippy::cast_possible_truncation, reason = "a step of 292 years is far enough")]
    let step = (step() * 1e9) as i64;
    now.saturating_add_signed(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_the_clock_is_read_or_is_none() {
        let check = |text: &str, step: Option<(f64, f64)>| {
            let step = step.map(|(seconds, after)| Step { seconds, after: Duration::from_secs_f64(after) });
            assert_eq!(Step::parse(text), step, "{text:?}");
        };
        check("3600", Some((3600.0, 0.0)));
        check("-315360000@2.5", Some((-315_360_000.0, 2.5)));
        for wrong in ["", "x", "1@", "1@-1", "inf", "1@inf", "@1"] {
            check(wrong, None);
        }
    }
}
