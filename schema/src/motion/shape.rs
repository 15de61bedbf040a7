//! The shape of the way that a movement takes, decided in exact arithmetic.

use super::Wheels;
use super::double_double::DoubleDouble;

/// The shape of the way of the robot's centre.
///
/// A movement has the first variant that fits, by the conditions at [`shape`]. The names are those of the
/// paper that Axle follows. No computation depends on the shape: it is a label for people, plots and logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// Both wheels stand.
    Rest,
    /// Both wheels have the same speed all the time.
    Line,
    /// Both wheels have opposite speeds all the time: the robot turns on the spot.
    Spin,
    /// The speeds of the wheels keep a constant ratio: an arc of a circle.
    Circle,
    /// The accelerations of the wheels are equal: the robot turns at a constant rate while its speed changes.
    /// The paper calls this a spiral; it is an involute of a circle, with a radius that is linear in the
    /// heading.
    Spiral,
    /// Everything else: a circle plus a clothoid. It is a pure clothoid, with a curvature that is linear in
    /// the length of the way, if and only if the accelerations of the wheels are opposite.
    Clothoid,
}

/// The shape of the way that a movement takes.
///
/// The conditions are decided for the real numbers that the `f64` speeds stand for, without rounding,
/// overflow or underflow. Decimal speeds seldom fulfil those of the circle and the spiral: (0.1, 0.2) → (0.3,
/// 0.4) m/s looks like a spiral, but 0.3 − 0.1 and 0.4 − 0.2 differ in binary, so it is a clothoid, if only
/// by 3e-17 m/s. Duration and track do not matter.
///
/// | shape | condition, the first match wins |
/// |---|---|
/// | [`Rest`](Shape::Rest) | `v0l = v0r = v1l = v1r = 0` |
/// | [`Line`](Shape::Line) | `v0l = v0r` and `v1l = v1r` |
/// | [`Spin`](Shape::Spin) | `v0l = −v0r` and `v1l = −v1r` |
/// | [`Circle`](Shape::Circle) | `v0l·v1r = v0r·v1l` |
/// | [`Spiral`](Shape::Spiral) | `v1l − v0l = v1r − v0r` |
/// | [`Clothoid`](Shape::Clothoid) | none of these |
///
/// The paper states the condition of the circle with quotients, which do not exist when a wheel starts from
/// rest.
#[must_use]
#[allow(
    clippy::float_cmp,
    reason = "the conditions are about exact values; a tolerance would be a different question"
)]
pub fn shape(wheels: &Wheels) -> Shape {
    let &Wheels { v0l, v0r, v1l, v1r, .. } = wheels;
    if [v0l, v0r, v1l, v1r].iter().all(|&speed| speed == 0.0) {
        Shape::Rest
    } else if v0l == v0r && v1l == v1r {
        Shape::Line
    } else if v0l == -v0r && v1l == -v1r {
        Shape::Spin
    } else if Product::of(v0l, v1r) == Product::of(v0r, v1l) {
        Shape::Circle
    } else if same_difference((v1l, v0l), (v1r, v0r)) {
        Shape::Spiral
    } else {
        Shape::Clothoid
    }
}

/// The exact product of two `f64`: `±odd·2^exponent`, or all zero. The form is unique, so equality is that of
/// the reals.
///
/// Integers, because the two-product of floating-point numbers is exact only where it neither overflows nor
/// underflows.
#[derive(PartialEq, Eq)]
struct Product {
    negative: bool,
    odd: u128,
    exponent: i32,
}

impl Product {
    fn of(a: f64, b: f64) -> Self {
        let ((a_digits, a_exponent), (b_digits, b_exponent)) = (integer(a), integer(b));
        let digits = u128::from(a_digits) * u128::from(b_digits);
        if digits == 0 {
            return Self { negative: false, odd: 0, exponent: 0 };
        }
        let zeros = digits.trailing_zeros();
        Self {
            negative: a.is_sign_negative() != b.is_sign_negative(),
            odd: digits >> zeros,
            exponent: a_exponent + b_exponent + zeros.cast_signed(),
        }
    }
}

/// `|a| = digits·2^exponent`, exactly, for finite `a`.
fn integer(a: f64) -> (u64, i32) {
    const FRACTION: u64 = (1 << 52) - 1;
    let bits = a.to_bits();
    let fraction = bits & FRACTION;
    // The field has eleven bits, so the conversion cannot fail.
    let field = i32::from((bits >> 52) as u16 & 0x7ff);
    if field == 0 { (fraction, -1074) } else { (fraction | (FRACTION + 1), field - 1075) }
}

/// Whether `a.0 − a.1 = b.0 − b.1` in the real numbers, for finite arguments.
#[allow(clippy::float_cmp, reason = "a rounded difference and its exact rest together are unique")]
fn same_difference(a: (f64, f64), b: (f64, f64)) -> bool {
    let (first, second) = (difference(a.0, a.1), difference(b.0, b.1));
    if first.hi.is_finite() || second.hi.is_finite() {
        // If only one is finite they differ by their size, and the comparison says so.
        return first == second;
    }
    // A difference overflows only if both of its terms are above 2^969, and then halving them is exact.
    difference(a.0 / 2.0, a.1 / 2.0) == difference(b.0 / 2.0, b.1 / 2.0)
}

/// `a − b`, exactly. The terms are ordered by size: unlike the variant that needs no order, this one can
/// overflow only if the difference itself does.
fn difference(a: f64, b: f64) -> DoubleDouble {
    if a.abs() >= b.abs() { DoubleDouble::ordered_sum(a, -b) } else { DoubleDouble::ordered_sum(-b, a) }
}
