//! What the encoders have said: distances since the last reset, speeds, and how old the newest reading is.

use axle_schema::{EncodersData, Metres, MetresPerSecond, Seconds, Sides};
use std::collections::VecDeque;

/// Speeds are means over so much of the robot's time: a tick of an encoder is then a small error.
const WINDOW: Seconds = Seconds(0.1);
/// A stamp that goes back by more than this is of a robot that has restarted.
const RESTART: Seconds = Seconds(1.0);
/// The most readings that are kept.
const MOST: usize = 64;

/// The readings of both encoders.
#[derive(Clone, Debug, Default)]
pub(crate) struct Odometer {
    readings: VecDeque<EncodersData>,
    /// When the newest one was heard.
    heard: Option<Seconds>,
    /// What both encoders showed at the last reset.
    zero: Sides<Metres>,
}

impl Odometer {
    /// Takes a reading. A robot that has restarted counts from zero again.
    pub(crate) fn hear(&mut self, now: Seconds, reading: EncodersData) {
        if let Some(newest) = self.readings.back() {
            let since = reading.stamp - newest.stamp;
            if since < -RESTART {
                *self = Self::default();
            } else if since <= Seconds::ZERO {
                return;
            }
        }
        self.readings.push_back(reading);
        self.heard = Some(now);
        while self.readings.len() > MOST
            || self.readings.get(1).is_some_and(|second| reading.stamp - second.stamp >= WINDOW)
        {
            self.readings.pop_front();
        }
    }
    pub(crate) fn newest(&self) -> Option<EncodersData> {
        self.readings.back().copied()
    }
    /// How long ago the newest reading was heard.
    pub(crate) fn age(&self, now: Seconds) -> Option<Seconds> {
        self.heard.map(|heard| now - heard)
    }
    /// Sets the distances to zero.
    pub(crate) fn reset(&mut self) {
        self.zero = self.newest().map(|reading| reading.sides()).unwrap_or_default();
    }
    /// Distances since the last reset.
    pub(crate) fn distances(&self) -> Sides<Metres> {
        let newest = self.newest().map(|reading| reading.sides()).unwrap_or_default();
        newest.zip(self.zero, |distance, zero| distance - zero)
    }
    pub(crate) fn speeds(&self) -> Sides<MetresPerSecond> {
        match (self.readings.front(), self.readings.back()) {
            (Some(first), Some(last)) if last.stamp > first.stamp => {
                last.sides().zip(first.sides(), |to, from| (to - from) / (last.stamp - first.stamp))
            }
            _ => Sides::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(stamp: f64, left: f64, right: f64) -> EncodersData {
        EncodersData { stamp: Seconds(stamp), left: Metres(left), right: Metres(right) }
    }

    #[test]
    fn distances_count_from_the_reset_and_speeds_are_means() {
        let mut odometer = Odometer::default();
        for k in 0..20 {
            let t = f64::from(k) * 0.02;
            odometer.hear(Seconds(t), reading(t, 0.5 * t, -0.25 * t));
        }
        let speeds = odometer.speeds();
        assert!((speeds.left.0 - 0.5).abs() < 1e-12 && (speeds.right.0 + 0.25).abs() < 1e-12, "{speeds:?}");
        assert!((odometer.distances().left.0 - 0.19).abs() < 1e-12);
        odometer.reset();
        assert_eq!(odometer.distances(), Sides::default());
        odometer.hear(Seconds(0.4), reading(0.4, 0.29, -0.095));
        assert!((odometer.distances().left.0 - 0.1).abs() < 1e-12);
        assert_eq!(odometer.age(Seconds(0.5)).map(|age| (age.0 * 1e3).round()), Some(100.0));
    }

    #[test]
    fn an_old_reading_changes_nothing_and_a_restart_begins_anew() {
        let mut odometer = Odometer::default();
        odometer.hear(Seconds(5.0), reading(5.0, 1.0, 1.0));
        odometer.reset();
        odometer.hear(Seconds(5.1), reading(4.9, 0.9, 0.9));
        assert_eq!(odometer.newest(), Some(reading(5.0, 1.0, 1.0)));
        odometer.hear(Seconds(5.2), reading(0.1, 0.01, 0.0));
        assert_eq!((odometer.distances().left, odometer.speeds()), (Metres(0.01), Sides::default()));
    }
}
