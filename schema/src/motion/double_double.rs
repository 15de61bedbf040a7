//! Numbers of about 106 bits, as the unevaluated sum of two `f64`.
//!
//! A heading may be the small difference of thousands of radians, and the position needs the sine of every
//! intermediate phase to full precision; plain `f64` phases cost up to two digits. The algorithms are those
//! of Dekker (1971) and Knuth in the variants whose error bounds Joldes, Muller and Popescu proved ("Tight
//! and rigorous error bounds for basic building blocks of double-word arithmetic", ACM TOMS 44, 2017); `u`
//! below is 2⁻⁵³. The bounds assume that nothing overflows and no low part is subnormal, which the callers
//! ensure by scaling.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// What the two parts are: a number, or two of them side by side.
pub(super) trait Part:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The same number everywhere.
    fn all(number: f64) -> Self;
    /// `self·b + c`, rounded once.
    fn fused(self, b: Self, c: Self) -> Self;
}

impl Part for f64 {
    #[inline]
    fn all(number: f64) -> Self {
        number
    }
    #[inline]
    fn fused(self, b: Self, c: Self) -> Self {
        self.mul_add(b, c)
    }
}

/// Two numbers to which the same is done: the processor does it to both at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Two(pub(super) f64, pub(super) f64);

impl Part for Two {
    #[inline]
    fn all(number: f64) -> Self {
        Self(number, number)
    }
    #[inline]
    fn fused(self, b: Self, c: Self) -> Self {
        Self(self.0.mul_add(b.0, c.0), self.1.mul_add(b.1, c.1))
    }
}
impl Add for Two {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }
}
impl Sub for Two {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0, self.1 - other.1)
    }
}
impl Mul for Two {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0, self.1 * other.1)
    }
}
impl Div for Two {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0, self.1 / other.1)
    }
}
impl Neg for Two {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

/// `hi + lo`, with `hi` the nearest `f64` to the sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DoubleDouble<T = f64> {
    /// The value rounded to `f64`.
    pub(super) hi: T,
    /// What the rounding took away.
    pub(super) lo: T,
}

/// Whether the target multiplies and adds in one instruction. Without it `mul_add` is a slow library call.
const FUSED: bool = cfg!(any(target_feature = "fma", target_arch = "aarch64"));

impl<T: Part> DoubleDouble<T> {
    /// `a + b`, exactly (Knuth's `2Sum`).
    #[inline]
    pub(super) fn sum(a: T, b: T) -> Self {
        let hi = a + b;
        let of_b = hi - a;
        let of_a = hi - of_b;
        Self { hi, lo: (a - of_a) + (b - of_b) }
    }

    /// `a + b`, exactly, provided that `|a| ≥ |b|` or `a == 0` (Dekker's `Fast2Sum`).
    #[inline]
    pub(super) fn ordered_sum(a: T, b: T) -> Self {
        let hi = a + b;
        Self { hi, lo: b - (hi - a) }
    }

    /// `a·b`, exactly; both ways give the same bits.
    #[inline]
    pub(super) fn product(a: T, b: T) -> Self {
        let hi = a * b;
        if FUSED {
            return Self { hi, lo: a.fused(b, -hi) };
        }
        let (a_hi, a_lo) = split(a);
        let (b_hi, b_lo) = split(b);
        Self { hi, lo: ((a_hi * b_hi - hi) + a_hi * b_lo + a_lo * b_hi) + a_lo * b_lo }
    }

    /// `a/b`, with a relative error below 3.5u².
    #[inline]
    pub(super) fn quotient(a: T, b: T) -> Self {
        Self { hi: a, lo: T::all(0.0) } / b
    }

    /// Twice the number, exactly.
    #[inline]
    pub(super) fn doubled(self) -> Self {
        let two = T::all(2.0);
        Self { hi: two * self.hi, lo: two * self.lo }
    }
}

impl DoubleDouble<Two> {
    /// Two numbers side by side.
    #[inline]
    pub(super) fn both(first: DoubleDouble, second: DoubleDouble) -> Self {
        Self { hi: Two(first.hi, second.hi), lo: Two(first.lo, second.lo) }
    }
    /// The first of them.
    #[inline]
    pub(super) fn first(self) -> DoubleDouble {
        DoubleDouble { hi: self.hi.0, lo: self.lo.0 }
    }
    /// The second of them.
    #[inline]
    pub(super) fn second(self) -> DoubleDouble {
        DoubleDouble { hi: self.hi.1, lo: self.lo.1 }
    }
}

/// The upper 26 bits of `a`, and the rest, so that products of parts are exact (Veltkamp).
#[inline]
fn split<T: Part>(a: T) -> (T, T) {
    let scaled = T::all(134_217_729.0) * a; // 2²⁷ + 1
    let hi = scaled - (scaled - a);
    (hi, a - hi)
}

/// Relative error below 3u² + 13u³, whatever cancels (`AccurateDWPlusDW`).
impl<T: Part> Add for DoubleDouble<T> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        let high = Self::sum(self.hi, other.hi);
        let low = Self::sum(self.lo, other.lo);
        let first = Self::ordered_sum(high.hi, high.lo + low.hi);
        Self::ordered_sum(first.hi, low.lo + first.lo)
    }
}

impl<T: Part> Neg for DoubleDouble<T> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }
}

impl<T: Part> Sub for DoubleDouble<T> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

/// Relative error below 2u² (`DWTimesFP1`).
impl<T: Part> Mul<T> for DoubleDouble<T> {
    type Output = Self;
    #[inline]
    fn mul(self, other: T) -> Self {
        let high = Self::product(self.hi, other);
        let first = Self::ordered_sum(high.hi, self.lo * other);
        Self::ordered_sum(first.hi, first.lo + high.lo)
    }
}

/// Relative error below 7u² (`DWTimesDW1`).
impl<T: Part> Mul for DoubleDouble<T> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let high = Self::product(self.hi, other.hi);
        Self::ordered_sum(high.hi, high.lo + (self.hi * other.lo + self.lo * other.hi))
    }
}

/// Relative error below 3.5u² (`DWDivFP3`).
impl<T: Part> Div<T> for DoubleDouble<T> {
    type Output = Self;
    #[inline]
    fn div(self, other: T) -> Self {
        let hi = self.hi / other;
        let back = Self::product(hi, other);
        // Both differences are exact: `back` lies within an ulp of `self.hi`.
        let rest = ((self.hi - back.hi) - back.lo) + self.lo;
        Self::ordered_sum(hi, rest / other)
    }
}

/// Relative error below 15u² + 56u³ (`DWDivDW2`).
impl<T: Part> Div for DoubleDouble<T> {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let hi = self.hi / other.hi;
        let back = other * hi;
        let rest = (self.hi - back.hi) + (self.lo - back.lo);
        Self::ordered_sum(hi, rest / other.hi)
    }
}

#[cfg(test)]
mod tests {
    use super::DoubleDouble;

    #[test]
    fn a_sum_keeps_what_rounding_takes() {
        let sum = DoubleDouble::sum(1.0, 1e-30);
        assert_eq!((sum.hi.to_bits(), sum.lo.to_bits()), (1f64.to_bits(), 1e-30f64.to_bits()));
    }

    #[test]
    fn a_product_is_exact() {
        // (2⁵² + 1)² = 2¹⁰⁴ + 2⁵³ + 1 needs 105 bits.
        let a = 4_503_599_627_370_497.0;
        let square = DoubleDouble::product(a, a);
        assert_eq!(square.hi.to_bits(), (2f64.powi(104) + 2f64.powi(53)).to_bits());
        assert_eq!(square.lo.to_bits(), 1f64.to_bits());
    }

    #[test]
    fn a_quotient_times_its_divisor_gives_the_dividend_back() {
        for (a, b) in [(1.0, 3.0), (0.1, 0.7), (-5e10, 0.3), (2.0, 1e-20)] {
            let back = DoubleDouble::quotient(a, b) * b;
            let error = back - DoubleDouble { hi: a, lo: 0.0 };
            assert!((error.hi / a).abs() < 1e-31, "{a}/{b}: {error:?}");
            let quotient = back / DoubleDouble::quotient(a, b);
            assert!(((quotient.hi - b) + quotient.lo).abs() < 1e-30 * b, "{a}/({a}/{b}): {quotient:?}");
        }
    }
}
