//! The resolution of the encoders, as far as it shows: nobody can stand more exactly than is measured.
//!
//! The differences of readings are multiples of the tick. Their greatest common divisor is the tick, once there are
//! some; where readings are as good as continuous, it vanishes within a few of them.

use axle_schema::{EncodersData, Sides};

/// What is finer than this does not matter, m.
const FINE: f64 = 1e-4;
/// A tick that is coarser than this is not believed, m.
const COARSE: f64 = 0.01;
/// A reading is off by up to a tick, and what has happened since by as much as brings the next one.
const TICKS: f64 = 2.0;
/// So many differences must agree before their divisor is believed.
const ENOUGH: u32 = 8;

/// The divisor of the differences of one wheel.
#[derive(Clone, Copy, Debug, Default)]
struct Divisor {
    divisor: f64,
    count: u32,
}

impl Divisor {
    fn take(&mut self, difference: f64) {
        let difference = difference.abs();
        // A wheel that stands says nothing.
        if !(FINE..1e3).contains(&difference) {
            return;
        }
        let (mut larger, mut smaller) = (self.divisor.max(difference), self.divisor.min(difference));
        while smaller > FINE {
            // What is left of a multiple is a hair more than nothing, or a hair less than the divisor.
            let rest = larger % smaller;
            (larger, smaller) = (smaller, rest.min(smaller - rest));
        }
        // Below what matters there is no divisor any more.
        let exact = smaller < FINE / 10.0;
        self.divisor = if exact { larger } else { FINE };
        self.count = self.count.saturating_add(1);
    }
}

/// The resolution of both encoders.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Grain(Sides<Divisor>);

impl Grain {
    /// Takes two readings that follow each other.
    pub(crate) fn take(&mut self, before: &EncodersData, now: &EncodersData) {
        self.0.left.take((now.left - before.left).0);
        self.0.right.take((now.right - before.right).0);
    }

    /// What the coarser encoder leaves unknown, m; 0 while it is not known how coarse it is.
    pub(crate) fn blur(&self) -> f64 {
        let known = |wheel: Divisor| {
            let is_known = wheel.count >= ENOUGH && (FINE * 2.0..=COARSE).contains(&wheel.divisor);
            if is_known { wheel.divisor } else { 0.0 }
        };
        known(self.0.left).max(known(self.0.right)) * TICKS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Metres, Seconds};

    fn tick(readings: impl Iterator<Item = f64>) -> f64 {
        let readings: Vec<EncodersData> = readings
            .map(|left| EncodersData { stamp: Seconds(0.0), left: Metres(left), right: Metres(0.0) })
            .collect();
        let mut grain = Grain::default();
        readings.windows(2).for_each(|pair| grain.take(&pair[0], &pair[1]));
        grain.blur() / TICKS
    }
    fn way(n: i32) -> f64 {
        0.013 * f64::from(n) + 0.004 * (f64::from(n) * 0.7).sin()
    }

    #[test]
    fn the_tick_shows_in_what_is_read() {
        for size in [0.0005, 0.001, 0.005, 0.0071] {
            let read = tick((0..40).map(|n| 123.0 + (way(n) / size).floor() * size));
            assert!((read - size).abs() < 1e-9, "{read}, not {size}");
        }
    }

    #[test]
    fn fine_encoders_few_readings_and_broken_ones_show_nothing() {
        assert!(tick((0..40).map(way)).abs() <= 0.0, "continuous");
        assert!(tick((0..40).map(|n| (way(n) / 1e-5).floor() * 1e-5)).abs() <= 0.0, "0.01 mm");
        assert!(tick((0..5).map(|n| f64::from(n) * 0.005)).abs() <= 0.0, "four differences");
        assert!(tick((0..40).map(|n| if n % 3 == 0 { f64::NAN } else { way(n) })).abs() <= 0.0);
        assert!(tick((0..40).map(|n| f64::from(n) * 0.05)).abs() <= 0.0, "nobody has ticks of 5 cm");
    }
}
