//! Random numbers that are the same for the same seed: an emulated run can be run again.

use std::f64::consts::TAU;

/// SplitMix64 (Steele, Lea, Flood 2014): the state goes through all 64-bit numbers in steps of a constant, and each
/// is mixed into an output. Small, fast and good enough for noise; not for secrets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Random(u64);

impl Random {
    /// The sequence number `stream` of a seed; the streams of one seed have nothing to do with each other.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut random = Self(seed);
        let start = random.bits();
        Self(start ^ stream.wrapping_mul(0xD1B5_4A32_D192_ED03))
    }

    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// A uniform number in (0, 1]: never 0, of which there is no logarithm.
    pub fn uniform(&mut self) -> f64 {
        #[allow(clippy::cast_precision_loss, reason = "53 bits fit a float exactly")]
        let bits = ((self.bits() >> 11) + 1) as f64;
        bits / (1_u64 << 53) as f64
    }

    /// A waiting time without memory, of mean 1.
    pub fn waiting(&mut self) -> f64 {
        -self.uniform().ln()
    }

    /// A normal number of mean 0 and standard deviation 1 (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_zero_and_deviation_one() {
        let mut random = Random::new(1, 0);
        let count = 100_000;
        let numbers: Vec<f64> = (0..count).map(|_| random.normal()).collect();
        let mean = numbers.iter().sum::<f64>() / f64::from(count);
        let variance = numbers.iter().map(|number| (number - mean).powi(2)).sum::<f64>() / f64::from(count);
        let tails = numbers.iter().filter(|number| number.abs() > 2.0).count();
        // The mean has deviation 0.003, and 4.55 % lie beyond two deviations.
        assert!(mean.abs() < 0.012 && (variance - 1.0).abs() < 0.02, "{mean}, {variance}");
        assert!((4300..4800).contains(&tails), "{tails}");
    }

    #[test]
    fn seeds_and_streams_differ_and_repeat() {
        let first = |seed, stream| Random::new(seed, stream).normal().to_bits();
        assert_eq!(first(7, 1), first(7, 1));
        assert_ne!(first(7, 1), first(7, 2));
        assert_ne!(first(7, 1), first(8, 1));
    }
}
