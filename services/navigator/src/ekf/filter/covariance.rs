//! A covariance of which only one half is kept: what is symmetric by its making cannot become anything else.

use nalgebra::{Matrix3, SMatrix};
use std::ops::{Index, IndexMut};

/// How many states there are.
pub(in crate::ekf) const N: usize = 9;

/// The lower half, row by row; so the first states are the first entries, however many are in use.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::ekf) struct Covariance([f64; N * (N + 1) / 2]);

const fn place((row, column): (usize, usize)) -> usize {
    let (low, high) = if row < column { (row, column) } else { (column, row) };
    high * (high + 1) / 2 + low
}

impl Index<(usize, usize)> for Covariance {
    type Output = f64;
    #[inline]
    fn index(&self, at: (usize, usize)) -> &f64 {
        &self.0[place(at)]
    }
}
impl IndexMut<(usize, usize)> for Covariance {
    #[inline]
    fn index_mut(&mut self, at: (usize, usize)) -> &mut f64 {
        &mut self.0[place(at)]
    }
}

impl Covariance {
    pub(super) const ZERO: Self = Self([0.0; N * (N + 1) / 2]);

    /// Both halves.
    pub(super) fn square(&self) -> SMatrix<f64, N, N> {
        SMatrix::from_fn(|row, column| self[(row, column)])
    }

    /// The mean of both halves; rounding takes no variance below 0.
    pub(super) fn of(square: &SMatrix<f64, N, N>) -> Self {
        let mut half = Self::ZERO;
        for row in 0..N {
            for column in 0..=row {
                half[(row, column)] = f64::midpoint(square[(row, column)], square[(column, row)]);
            }
            half[(row, row)] = half[(row, row)].max(0.0);
        }
        half
    }

    /// Of the pose.
    pub(super) fn pose(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|row, column| self[(row, column)])
    }

    /// Makes the pose independent of everything else.
    pub(super) fn place(&mut self, pose: &Matrix3<f64>) {
        for row in 0..N {
            for column in 0..=row.min(2) {
                self[(row, column)] = if row < 3 { pose[(row, column)] } else { 0.0 };
            }
        }
    }

    /// Corrects by a measurement of one number, of which the states think `h`, with variance `r`; gives the gain.
    ///
    /// For the optimal gain of one number Joseph's form is the change of rank one `P − K (P Hᵀ)ᵀ`.
    pub(super) fn correct(&mut self, h: &[f64; N], r: f64) -> [f64; N] {
        let mut ph = [0.0; N];
        for (row, entry) in ph.iter_mut().enumerate() {
            *entry = (0..N).map(|column| self[(row, column)] * h[column]).sum();
        }
        let s = h.iter().zip(&ph).map(|(h, ph)| h * ph).sum::<f64>() + r;
        if s <= 0.0 || !s.is_finite() {
            return [0.0; N];
        }
        let gain = ph.map(|entry| entry / s);
        for row in 0..N {
            for column in 0..=row {
                self[(row, column)] -= gain[row] * ph[column];
            }
            self[(row, row)] = self[(row, row)].max(0.0);
        }
        gain
    }

    /// `h P hᵀ`.
    pub(super) fn seen_by(&self, h: &[f64; N]) -> f64 {
        let row = |row: usize| (0..N).map(|column| self[(row, column)] * h[column]).sum::<f64>();
        (0..N).map(|at| h[at] * row(at)).sum()
    }
}
