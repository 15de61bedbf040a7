//! The gyro's readings in the order of their stamps, and the angle between two instants.

use std::collections::VecDeque;

/// Between readings that are farther apart than this, in s, nobody knows what the robot turned by.
const LONGEST: f64 = 0.25;

/// Rates in rad/s at stamps in s.
#[derive(Clone, Debug, Default)]
pub(super) struct Gyro {
    readings: VecDeque<(f64, f64)>,
}

impl Gyro {
    /// Keeps a reading; gives the stamp from which on angles may have changed, or nothing for a repeated stamp.
    pub(super) fn insert(&mut self, stamp: f64, rate: f64) -> Option<f64> {
        let at = self.readings.partition_point(|reading| reading.0 < stamp);
        if self.readings.get(at).is_some_and(|reading| reading.0 <= stamp) {
            return None;
        }
        self.readings.insert(at, (stamp, rate));
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
    }

    /// The angle from `from` to `to`, where readings reach from one to the other. A reading is the mean rate since the one
    /// before it, so that their sum is the turn.
    pub(super) fn angle(&self, from: f64, to: f64) -> Option<f64> {
        let first = self.readings.partition_point(|reading| reading.0 <= from).checked_sub(1)?;
        let mut angle = 0.0;
        for at in first..self.readings.len() {
            let (t0, _) = self.readings[at];
            if t0 >= to {
                return Some(angle);
            }
            let &(t1, rate) = self.readings.get(at + 1)?;
            if t1 - t0 > LONGEST {
                return None;
            }
            angle += (t1.min(to) - t0.max(from)) * rate;
            if t1 >= to {
                return Some(angle);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_is_the_sum_of_the_readings_in_whatever_order_they_came() {
        let mut gyro = Gyro::default();
        for n in [0, 3, 1, 2, 4] {
            assert!(gyro.insert(f64::from(n) * 0.1, f64::from(n)).is_some());
        }
        assert_eq!(gyro.insert(0.2, 5.0), None, "a repeated stamp");
        let angle = gyro.angle(0.05, 0.35).expect("covered");
        assert!((angle - (0.05 + 0.2 + 0.3 + 0.2)).abs() < 1e-12, "{angle}");
        assert_eq!((gyro.angle(0.2, 0.41), gyro.angle(-0.1, 0.2)), (None, None));
        gyro.forget(0.25);
        assert!(gyro.angle(0.2, 0.4).is_some() && gyro.angle(0.1, 0.4).is_none());
        let _ = gyro.insert(1.0, 0.0);
        assert_eq!(gyro.angle(0.3, 0.9), None, "nobody knows what happened in 0.6 s");
    }
}
