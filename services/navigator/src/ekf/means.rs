//! Readings that are means, in the order of their stamps, and what they sum up to between two instants: the angle of a
//! gyro, the change of speed of an accelerometer.

use std::collections::VecDeque;

/// Between readings that are farther apart than this, in s, nobody knows what the robot did.
const LONGEST: f64 = 0.25;
/// Where readings are so many times farther apart than usual, some in between were lost.
const HOLE: f64 = 2.5;
/// By how much a reading lets the usual distance grow: two that came close together are forgotten after half a second.
const GROWTH: f64 = 1.1;

/// Values at stamps in s.
#[derive(Clone, Debug, Default)]
pub(super) struct Means {
    readings: VecDeque<(f64, f64)>,
    /// How far apart readings usually are, in s: the least that was seen lately.
    usual: Option<f64>,
}

impl Means {
    /// Keeps a reading; gives the stamp from which on sums may have changed, or nothing for a repeated stamp.
    pub(super) fn insert(&mut self, stamp: f64, value: f64) -> Option<f64> {
        let at = self.readings.partition_point(|reading| reading.0 < stamp);
        if self.readings.get(at).is_some_and(|reading| reading.0 <= stamp) {
            return None;
        }
        if let Some(last) = self.readings.back().filter(|last| last.0 < stamp) {
            let apart = stamp - last.0;
            self.usual = Some(self.usual.map_or(apart, |usual| apart.min(GROWTH * usual)));
        }
        self.readings.insert(at, (stamp, value));
        Some(if at == 0 { f64::NEG_INFINITY } else { self.readings[at - 1].0 })
    }

    /// Forgets what is older than the last reading up to `stamp`.
    pub(super) fn forget(&mut self, stamp: f64) {
        while self.readings.get(1).is_some_and(|reading| reading.0 <= stamp) {
            let _ = self.readings.pop_front();
        }
    }

    pub(super) fn clear(&mut self) {
        self.readings.clear();
        self.usual = None;
    }

    /// Whether no reading from `from` to `to` seems to be lost. A mean is that of the time since the reading before it,
    /// which need not be the one that came: over a hole the integral is a guess, and no evidence against the wheels.
    pub(super) fn is_whole(&self, from: f64, to: f64) -> bool {
        let first = self.readings.partition_point(|reading| reading.0 <= from).saturating_sub(1);
        let last = self.readings.partition_point(|reading| reading.0 < to);
        let mut apart = (first..last.min(self.readings.len().saturating_sub(1)))
            .map(|at| self.readings[at + 1].0 - self.readings[at].0);
        self.usual.is_some_and(|usual| apart.all(|apart| apart <= HOLE * usual))
    }

    /// The integral from `from` to `to`, where readings reach from one to the other. A reading is the mean since the one
    /// before it, so that their sum is the whole.
    pub(super) fn between(&self, from: f64, to: f64) -> Option<f64> {
        let first = self.readings.partition_point(|reading| reading.0 <= from).checked_sub(1)?;
        let mut sum = 0.0;
        for at in first..self.readings.len() {
            let (t0, _) = self.readings[at];
            if t0 >= to {
                return Some(sum);
            }
            let &(t1, mean) = self.readings.get(at + 1)?;
            if t1 - t0 > LONGEST {
                return None;
            }
            sum += (t1.min(to) - t0.max(from)) * mean;
            if t1 >= to {
                return Some(sum);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_integral_is_the_sum_of_the_readings_in_whatever_order_they_came() {
        let mut means = Means::default();
        for n in [0, 3, 1, 2, 4] {
            assert!(means.insert(f64::from(n) * 0.1, f64::from(n)).is_some());
        }
        assert_eq!(means.insert(0.2, 5.0), None, "a repeated stamp");
        let sum = means.between(0.05, 0.35).expect("covered");
        assert!((sum - (0.05 + 0.2 + 0.3 + 0.2)).abs() < 1e-12, "{sum}");
        assert_eq!((means.between(0.2, 0.41), means.between(-0.1, 0.2)), (None, None));
        means.forget(0.25);
        assert!(means.between(0.2, 0.4).is_some() && means.between(0.1, 0.4).is_none());
        assert!(means.is_whole(0.2, 0.4) && means.is_whole(0.25, 0.35));
        let _ = means.insert(0.7, 0.0);
        assert!(means.between(0.3, 0.6).is_none() && !means.is_whole(0.35, 0.6) && means.is_whole(0.2, 0.4));
        let _ = means.insert(1.0, 0.0);
        assert_eq!(means.between(0.3, 0.9), None, "nobody knows what happened in 0.6 s");
    }
}
