//! Means with intervals, and least squares.

use nalgebra::{DMatrix, DVector};

/// A number that was measured several times, with what is known of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The mean of the passes.
    pub value: f64,
    /// Lower end of the interval that holds the truth with 95 %.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Standard deviation from pass to pass: how well a pass repeats another one.
    pub repeatability: f64,
}

impl Estimate {
    /// Whether the interval holds `truth`.
    #[must_use]
    pub fn holds(&self, truth: f64) -> bool {
        (self.low..=self.high).contains(&truth)
    }
}

/// The mean of independent passes, each of which is off by chance and by up to `resolution` (one deviation) through what
/// all of them share, such as whole ticks. Student's interval: it asks for nothing but that passes are alike, whatever
/// the noise of a reading is, and that their errors are about normal. `None` for fewer than two passes.
#[must_use]
pub fn of_passes(passes: &[f64], resolution: f64) -> Option<Estimate> {
    if passes.len() < 2 || !passes.iter().all(|pass| pass.is_finite()) {
        return None;
    }
    #[allow(clippy::cast_precision_loss, reason = "a few passes")]
    let count = passes.len() as f64;
    let value = passes.iter().sum::<f64>() / count;
    let variance = passes.iter().map(|pass| (pass - value).powi(2)).sum::<f64>() / (count - 1.0);
    let half = student(passes.len() - 1) * (variance / count + resolution * resolution / count).sqrt();
    Some(Estimate { value, low: value - half, high: value + half, repeatability: variance.sqrt() })
}

/// Student's quantile of 97.5 % for so many degrees of freedom.
#[must_use]
pub fn student(freedom: usize) -> f64 {
    /// From any table, for 1 to 20 degrees of freedom.
    const TABLE: [f64; 20] = [
        12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145,
        2.131, 2.120, 2.110, 2.101, 2.093, 2.086,
    ];
    #[allow(clippy::cast_precision_loss, reason = "a count")]
    let beyond = |freedom: usize| 1.96 + 2.5 / freedom as f64;
    match freedom {
        0 => f64::INFINITY,
        1..=20 => TABLE[freedom - 1],
        _ => beyond(freedom),
    }
}

/// The numbers x that make the sum of the squares of `rows · x - targets` least, and what is left of each row. `None`
/// where the rows do not determine them.
#[must_use]
pub fn least_squares<const N: usize>(rows: &[[f64; N]], targets: &[f64]) -> Option<([f64; N], Vec<f64>)> {
    let flat: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
    let (found, left) = solve(&flat, targets, N)?;
    Some((found.try_into().ok()?, left))
}

/// The same for a number of unknowns that is known at run time only.
#[must_use]
pub fn solve(rows: &[Vec<f64>], targets: &[f64], unknowns: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    let shaped = rows.iter().all(|row| row.len() == unknowns && row.iter().all(|value| value.is_finite()));
    if rows.len() < unknowns || rows.len() != targets.len() || !shaped || unknowns == 0 {
        return None;
    }
    // Columns are scaled to length 1, so that "nothing" has the same meaning for all of them.
    let mut scales = vec![0.0_f64; unknowns];
    for row in rows {
        for (scale, value) in scales.iter_mut().zip(row) {
            *scale += value * value;
        }
    }
    for scale in &mut scales {
        *scale = scale.sqrt();
        if *scale <= 0.0 {
            return None;
        }
    }
    let matrix = DMatrix::from_fn(rows.len(), unknowns, |row, column| rows[row][column] / scales[column]);
    let target = DVector::from_column_slice(targets);
    let decomposed = matrix.clone().svd(true, true);
    if decomposed.singular_values.iter().any(|value| value.is_nan() || *value <= 1e-9) {
        return None;
    }
    let found = decomposed.solve(&target, 1e-12).ok()?;
    let left = matrix * &found - target;
    let found = found.iter().zip(&scales).map(|(value, scale)| value / scale).collect();
    Some((found, left.iter().copied().collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn students_interval_holds_the_truth_as_often_as_it_says() {
        let mut bits = 1_u64;
        let mut uniform = || {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (bits >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut held = 0;
        for _ in 0..2000 {
            // The sum of twelve uniform numbers is about normal.
            let passes: Vec<f64> = (0..5).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect();
            held += u32::from(of_passes(&passes, 0.0).expect("passes").holds(0.0));
        }
        assert!((1870..1930).contains(&held), "{held} of 2000");
    }

    #[test]
    fn least_squares_finds_a_line_and_refuses_what_is_none() {
        let rows = [[1.0, 0.0], [1.0, 1.0], [1.0, 2.0], [1.0, 3.0]];
        let (found, left) = least_squares(&rows, &[1.0, 3.1, 4.9, 7.0]).expect("a line");
        assert!((found[0] - 1.03).abs() < 1e-12 && (found[1] - 1.98).abs() < 1e-12, "{found:?}");
        assert!(left.iter().sum::<f64>().abs() < 1e-12);
        assert!(least_squares(&[[1.0, 2.0], [2.0, 4.0]], &[1.0, 2.0]).is_none(), "one direction only");
        assert!(least_squares(&[[1.0, f64::NAN], [2.0, 4.0]], &[1.0, 2.0]).is_none());
        assert!(least_squares::<2>(&[[1.0, 1.0]], &[1.0]).is_none(), "too few rows");
        assert_eq!(of_passes(&[1.0], 0.0), None);
    }
}
