//! The few operations on complex numbers that the position of a robot needs; `x + iy` is the point (x, y).

use super::double_double::DoubleDouble;
use std::ops::{Add, Mul, Sub};

/// A complex number, or a point of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Complex {
    pub(super) re: f64,
    pub(super) im: f64,
}

impl Complex {
    /// The unit vector in the direction `angle`, in radians.
    ///
    /// The angle is in double-double because it may be large: its `hi` alone would miss the direction by half
    /// an ulp of thousands of radians.
    pub(super) fn direction(angle: DoubleDouble) -> Self {
        let (sin, cos) = angle.hi.sin_cos();
        // Below this bound the next term of the Taylor series, lo²/2, is far below an ulp. Above it, that is
        // beyond 1e7 rad, the addition theorem keeps the vector on the unit circle.
        if angle.lo.abs() < 1e-9 {
            return Self { re: cos - angle.lo * sin, im: sin + angle.lo * cos };
        }
        let (sin_lo, cos_lo) = angle.lo.sin_cos();
        Self { re: cos, im: sin } * Self { re: cos_lo, im: sin_lo }
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl Mul<f64> for Complex {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self { re: self.re * factor, im: self.im * factor }
    }
}
