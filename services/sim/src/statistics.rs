//! Means with intervals, by the bootstrap (Efron 1979): no shape of the errors is assumed.

use axle_emulator::Random;
use serde::Serialize;

/// How often is drawn anew.
const DRAWS: usize = 1000;

/// A mean, and the interval that it lies in with 95 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The mean.
    pub mean: f64,
    /// 2.5 % of the means of samples drawn anew are below it.
    pub low: f64,
    /// 2.5 % are above it.
    pub high: f64,
}

impl Interval {
    /// The mean of `values` and its interval; the draws come from `seed`. All zero without values.
    #[must_use]
    pub fn of(values: &[f64], seed: u64) -> Self {
        #[allow(clippy::cast_precision_loss, reason = "a count of runs")]
        let count = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / count;
        let first = values.first().copied().unwrap_or(mean);
        // Values that are all the same need no draws.
        #[allow(clippy::float_cmp, reason = "the very same value")]
        if values.iter().all(|&value| value == first) {
            return Self { mean: first, low: first, high: first };
        }
        let mut random = Random::new(seed, 30);
        let mut means: Vec<f64> = (0..DRAWS)
            .map(|_| (0..values.len()).map(|_| values[pick(&mut random, values.len())]).sum::<f64>() / count)
            .collect();
        means.sort_by(f64::total_cmp);
        Self { mean, low: means[DRAWS / 40], high: means[DRAWS - 1 - DRAWS / 40] }
    }
}

/// One of `count` places, each as likely as the others.
fn pick(random: &mut Random, count: usize) -> usize {
    // The upper half of a product of 64 by 64 bits; its bias is below 1e-15 for any count of runs.
    let (bits, count) = (u128::from(random.bits()), count as u128);
    #[allow(clippy::cast_possible_truncation, reason = "below the count")]
    let place = ((bits * count) >> 64) as usize;
    place
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_covers_the_truth_as_often_as_it_says() {
        // 400 samples of 30 normal numbers: 95 % of the intervals should hold the mean, a bit fewer for so few numbers.
        let mut random = Random::new(1, 0);
        let mut held = 0;
        for seed in 0..400 {
            let values: Vec<f64> = (0..30).map(|_| 5.0 + random.normal()).collect();
            let interval = Interval::of(&values, seed);
            assert!(interval.low <= interval.mean && interval.mean <= interval.high);
            held += u32::from((interval.low..=interval.high).contains(&5.0));
        }
        assert!((360..=392).contains(&held), "{held} of 400");
    }

    #[test]
    fn the_same_values_have_no_width_and_no_values_are_zero() {
        assert_eq!(Interval::of(&[2.5; 7], 1), Interval { mean: 2.5, low: 2.5, high: 2.5 });
        assert_eq!(Interval::of(&[], 1), Interval { mean: 0.0, low: 0.0, high: 0.0 });
        assert_eq!(Interval::of(&[1.0, 2.0, 4.0], 9), Interval::of(&[1.0, 2.0, 4.0], 9));
    }
}
