//! Distances out of encoder counters that wrap, begin anew, or lie.

use crate::board::Fault;
use axle_schema::{Metres, Seconds, Sides};

/// A board that was not heard for longer than this may have been anywhere: its counters say nothing of the meantime.
const LONG: Seconds = Seconds(5.0);

/// What the wheels have covered since the process began.
#[derive(Clone, Debug)]
pub struct Odometer {
    /// Distance of a wheel for one count.
    tick: Sides<f64>,
    /// The counters wrap at 2 to this power.
    bits: u32,
    /// The fastest that a wheel can run, m/s.
    fastest: f64,
    last: Option<(Seconds, Sides<i64>)>,
    /// What both wheels have covered, in counts; whole, so that nothing is lost by adding.
    counted: Sides<i64>,
    /// What came as distances and not as counts.
    covered: Sides<Metres>,
    /// Readings in a row that no wheel can have done.
    doubts: u32,
}

/// What a reading of the counters was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// The wheels went on.
    On,
    /// The first one, or the first after long: distances go on from what they were.
    First,
    /// The counters have begun anew: the board has restarted.
    Anew,
}

impl Odometer {
    /// Counters that wrap at 2 to the power `bits`, of wheels that do `tick` metres for a count and at most `fastest`
    /// m/s.
    #[must_use]
    pub fn new(tick: Sides<Metres>, bits: u32, fastest: f64) -> Self {
        Self {
            tick: tick.map(|tick| tick.0),
            bits: bits.clamp(8, 63),
            fastest,
            last: None,
            counted: Sides::default(),
            covered: Sides::default(),
            doubts: 0,
        }
    }

    /// Takes a reading that came at `at`.
    ///
    /// # Errors
    /// [`Fault::Absurd`] for one that no wheel can have done; it changes nothing. When the same place is told again,
    /// distances go on from there.
    pub fn count(&mut self, at: Seconds, counts: Sides<i64>) -> Result<Reading, Fault> {
        let Some((then, before)) = self.last else {
            self.last = Some((at, counts));
            return Ok(Reading::First);
        };
        let span = (at - then).0;
        if !(0.0..LONG.0).contains(&span) {
            self.last = Some((at, counts));
            return Ok(Reading::First);
        }
        // Twice as far as a wheel can go, and a few counts for bytes that were late.
        let possible = self.tick.map(|tick| 2.0 * self.fastest * (span + 0.05) / tick + 8.0);
        let moved = counts.zip(before, |now, before| wrapped(now.wrapping_sub(before), self.bits));
        if is_possible(moved, possible) {
            self.doubts = 0;
            self.counted = self.counted.zip(moved, |sum, moved| sum.saturating_add(moved));
            self.last = Some((at, counts));
            return Ok(Reading::On);
        }
        // A counter that jumps to about zero began anew, at some time since the last reading.
        let since = counts.map(|count| wrapped(count, self.bits));
        if is_possible(since, possible) {
            self.doubts = 0;
            self.counted = self.counted.zip(since, |sum, moved| sum.saturating_add(moved));
            self.last = Some((at, counts));
            return Ok(Reading::Anew);
        }
        self.doubts += 1;
        if self.doubts >= 3 {
            // Whoever says the same three times means it. What the wheels did meanwhile nobody knows.
            self.doubts = 0;
            self.last = Some((at, counts));
            return Ok(Reading::Anew);
        }
        Err(Fault::Absurd)
    }

    /// Takes what the wheels have covered since the last time; `span` is how long ago that was.
    ///
    /// # Errors
    /// [`Fault::Absurd`] for what no wheel can have done; it changes nothing.
    pub fn cover(&mut self, span: Seconds, covered: Sides<Metres>) -> Result<(), Fault> {
        let possible = 2.0 * self.fastest * (span.0.clamp(0.0, LONG.0) + 0.05) + 0.02;
        if !covered.both().iter().all(|distance| distance.0.abs() <= possible) {
            return Err(Fault::Absurd);
        }
        self.covered = self.covered.zip(covered, |sum, distance| sum + distance);
        Ok(())
    }

    /// The counters of the next reading have nothing to do with those of the last one.
    pub const fn restart(&mut self) {
        self.last = None;
    }

    /// What both wheels have covered.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "2^53 counts are more than a wheel does in its life")]
    pub fn distances(&self) -> Sides<Metres> {
        self.counted.zip(self.tick, |count, tick| Metres(count as f64 * tick)).zip(self.covered, |a, b| a + b)
    }
}

/// The difference of two counters of `bits` bits: the nearest number that it may stand for, with its sign.
const fn wrapped(difference: i64, bits: u32) -> i64 {
    let unused = 64 - bits;
    (difference << unused) >> unused
}

fn is_possible(moved: Sides<i64>, possible: Sides<f64>) -> bool {
    #[allow(clippy::cast_precision_loss, reason = "what is not exact is far out of range")]
    let within = |moved: i64, possible: f64| moved.unsigned_abs() as f64 <= possible;
    within(moved.left, possible.left) && within(moved.right, possible.right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn odometer(bits: u32) -> Odometer {
        Odometer::new(Sides::new(Metres(0.001), Metres(0.002)), bits, 1.0)
    }

    #[test]
    fn counters_wrap_in_both_directions() {
        let mut odometer = odometer(16);
        let mut now = 0.0;
        for (left, right) in [(65_530, 5), (5, 65_530), (0, 65_535), (65_535, 0)] {
            assert!(odometer.count(Seconds(now), Sides::new(left, right)).is_ok());
            now += 0.02;
        }
        // 65530 -> 5 -> 0 -> 65535 is +11 -5 -1; 5 -> 65530 -> 65535 -> 0 is -11 +5 +1.
        let Sides { left, right } = odometer.distances();
        assert!((left.0 - 0.005).abs() < 1e-12 && (right.0 + 0.010).abs() < 1e-12, "{left} {right}");
    }

    #[test]
    fn a_board_that_restarts_and_one_that_lies_change_no_distance_by_much() {
        let mut odometer = odometer(32);
        let both = |count| Sides::new(count, count);
        assert_eq!(odometer.count(Seconds(0.0), both(100_000)), Ok(Reading::First));
        assert_eq!(odometer.count(Seconds(0.02), both(100_010)), Ok(Reading::On));
        assert_eq!(odometer.count(Seconds(0.04), both(2_000_000_000)), Err(Fault::Absurd));
        assert_eq!(odometer.count(Seconds(0.06), both(100_020)), Ok(Reading::On));
        assert_eq!(odometer.count(Seconds(0.08), both(3)), Ok(Reading::Anew));
        assert!((odometer.distances().left.0 - 0.023).abs() < 1e-12, "{:?}", odometer.distances());
        for _ in 0..2 {
            assert_eq!(odometer.count(Seconds(0.1), both(-5_000_000)), Err(Fault::Absurd));
        }
        assert_eq!(odometer.count(Seconds(0.1), both(-5_000_000)), Ok(Reading::Anew));
        assert_eq!(odometer.count(Seconds(60.0), both(70_000)), Ok(Reading::First), "after a minute");
        assert!((odometer.distances().left.0 - 0.023).abs() < 1e-12);
        assert_eq!(odometer.cover(Seconds(0.02), Sides::new(Metres(7.0), Metres(7.0))), Err(Fault::Absurd));
        assert_eq!(
            odometer.cover(Seconds(0.02), Sides::new(Metres(f64::NAN), Metres(0.0))),
            Err(Fault::Absurd)
        );
    }

    proptest! {
        #[test]
        fn any_counts_give_finite_distances(
            counts in prop::collection::vec((any::<i64>(), any::<i64>(), -1e3..1e3f64), 1..50), bits in 1_u32..80,
        ) {
            let mut odometer = odometer(bits);
            for (left, right, at) in counts {
                let _ = odometer.count(Seconds(at), Sides::new(left, right));
                prop_assert!(odometer.distances().both().iter().all(|distance| distance.is_finite()));
            }
        }

        #[test]
        fn however_often_a_counter_wraps_the_distance_is_right(steps in prop::collection::vec(-30_i64..30, 1..2000)) {
            let mut odometer = odometer(8);
            let mut sum = 0;
            for (index, step) in steps.iter().enumerate() {
                sum += step;
                let at = Seconds(0.02 * index as f64);
                prop_assert!(odometer.count(at, Sides::new(sum.rem_euclid(256), 0)).is_ok());
            }
            let expected = (sum - steps[0]) as f64 * 0.001;
            prop_assert!((odometer.distances().left.0 - expected).abs() < 1e-9);
        }
    }
}
