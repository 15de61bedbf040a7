//! Units as types: a number that crosses a function or the wire says what it measures.
//!
//! Every unit is a tuple struct over `f64`; the field is public, so that a formula can work on plain numbers and wrap
//! its result: `Metres(2.0).0`. Only the products that mean something are defined (`Metres / Seconds`). On the wire a
//! unit is a bare CBOR number. Reading accepts an integer where a float is meant (Python and JavaScript write `1` for
//! `1.0`) and refuses what is not finite; writing refuses it too, so that NaN can enter the mesh nowhere.

use serde::de::{Deserializer, Error as _, Unexpected, Visitor};
use serde::ser::{Error as _, Serializer};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Reads a finite number; integers are taken for floats.
///
/// # Errors
/// Refuses NaN, infinities and everything that is not a number.
pub fn deserialize_finite<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    struct Finite;
    impl Visitor<'_> for Finite {
        type Value = f64;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a finite number")
        }
        fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<f64, E> {
            if value.is_finite() {
                Ok(value)
            } else {
                Err(E::custom(format_args!("{value} is not a finite number")))
            }
        }
        fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<f64, E> {
            #[allow(clippy::cast_precision_loss, reason = "the nearest float is what an integer means here")]
            Ok(value as f64)
        }
        fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<f64, E> {
            #[allow(clippy::cast_precision_loss, reason = "the nearest float is what an integer means here")]
            Ok(value as f64)
        }
        fn visit_str<E: serde::de::Error>(self, value: &str) -> Result<f64, E> {
            Err(E::invalid_type(Unexpected::Str(value), &self))
        }
    }
    from.deserialize_any(Finite)
}

/// Writes a finite number.
///
/// # Errors
/// Refuses NaN and infinities.
pub fn serialize_finite<S: Serializer>(value: f64, to: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        to.serialize_f64(value)
    } else {
        Err(S::Error::custom(format_args!("{value} is not a finite number and cannot be sent")))
    }
}

/// [`serialize_finite`] as serde's field attributes want it.
///
/// # Errors
/// Refuses NaN and infinities.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
pub fn finite<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    serialize_finite(*value, to)
}

macro_rules! units {
    ($($(#[$doc:meta])* $name:ident $symbol:literal;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        pub struct $name(pub f64);

        impl $name {
            /// Nothing of it.
            pub const ZERO: Self = Self(0.0);
            /// The absolute value.
            #[must_use]
            pub const fn abs(self) -> Self { Self(self.0.abs()) }
            /// The smaller of the two.
            #[must_use]
            pub const fn min(self, other: Self) -> Self { Self(self.0.min(other.0)) }
            /// The larger of the two.
            #[must_use]
            pub const fn max(self, other: Self) -> Self { Self(self.0.max(other.0)) }
            /// Whether the number is neither NaN nor infinite.
            #[must_use]
            pub const fn is_finite(self) -> bool { self.0.is_finite() }
        }
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(&self.0, f)?;
                f.write_str($symbol)
            }
        }
        impl Add for $name { type Output = Self; fn add(self, other: Self) -> Self { Self(self.0 + other.0) } }
        impl Sub for $name { type Output = Self; fn sub(self, other: Self) -> Self { Self(self.0 - other.0) } }
        impl Neg for $name { type Output = Self; fn neg(self) -> Self { Self(-self.0) } }
        impl Mul<f64> for $name { type Output = Self; fn mul(self, factor: f64) -> Self { Self(self.0 * factor) } }
        impl Div<f64> for $name { type Output = Self; fn div(self, divisor: f64) -> Self { Self(self.0 / divisor) } }
        impl Div for $name { type Output = f64; fn div(self, other: Self) -> f64 { self.0 / other.0 } }
        impl AddAssign for $name { fn add_assign(&mut self, other: Self) { self.0 += other.0; } }
        impl SubAssign for $name { fn sub_assign(&mut self, other: Self) { self.0 -= other.0; } }
        impl std::iter::Sum for $name {
            fn sum<I: Iterator<Item = Self>>(items: I) -> Self { Self(items.map(|item| item.0).sum()) }
        }
        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> { serialize_finite(self.0, to) }
        }
        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                deserialize_finite(from).map(Self)
            }
        }
    )*};
}

units! {
    /// A length, a coordinate or a distance driven; distances of a wheel are signed, forward positive.
    Metres " m";
    /// A duration, or a stamp counted from the start of a clock.
    Seconds " s";
    /// An angle, counter-clockwise positive. Not wrapped: a movement may turn many times.
    Radians " rad";
    /// A speed, forward positive.
    MetresPerSecond " m/s";
    /// A turn rate, counter-clockwise positive.
    RadiansPerSecond " rad/s";
    /// An acceleration.
    MetresPerSecondSquared " m/s²";
    /// A curvature, to the left positive: the inverse of a signed radius.
    PerMetre " 1/m";
    /// A number without a unit.
    Ratio "";
}

impl Div<Seconds> for Metres {
    type Output = MetresPerSecond;
    fn div(self, time: Seconds) -> MetresPerSecond {
        MetresPerSecond(self.0 / time.0)
    }
}
impl Mul<Seconds> for MetresPerSecond {
    type Output = Metres;
    fn mul(self, time: Seconds) -> Metres {
        Metres(self.0 * time.0)
    }
}
impl Div<MetresPerSecond> for Metres {
    type Output = Seconds;
    fn div(self, speed: MetresPerSecond) -> Seconds {
        Seconds(self.0 / speed.0)
    }
}
impl Div<Seconds> for MetresPerSecond {
    type Output = MetresPerSecondSquared;
    fn div(self, time: Seconds) -> MetresPerSecondSquared {
        MetresPerSecondSquared(self.0 / time.0)
    }
}
impl Mul<Seconds> for MetresPerSecondSquared {
    type Output = MetresPerSecond;
    fn mul(self, time: Seconds) -> MetresPerSecond {
        MetresPerSecond(self.0 * time.0)
    }
}
impl Div<Seconds> for Radians {
    type Output = RadiansPerSecond;
    fn div(self, time: Seconds) -> RadiansPerSecond {
        RadiansPerSecond(self.0 / time.0)
    }
}

impl Radians {
    /// The same direction in (-π, π]; for output and comparison, never inside a span.
    #[must_use]
    pub fn wrapped(self) -> Self {
        use std::f64::consts::{PI, TAU};
        let remainder = self.0 % TAU;
        Self(if remainder > PI {
            remainder - TAU
        } else if remainder <= -PI {
            remainder + TAU
        } else {
            remainder
        })
    }
}

/// The share of full power given to a motor, in [-1, 1]; positive drives forward.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Duty(f64);

impl Duty {
    /// A duty cycle.
    ///
    /// # Errors
    /// Refuses what is not in [-1, 1].
    pub fn new(value: f64) -> Result<Self, crate::Refusal> {
        // Written so that NaN fails as well.
        if (-1.0..=1.0).contains(&value) {
            Ok(Self(value))
        } else {
            Err(crate::Refusal::out_of_range("duty cycle", value, "-1 to 1"))
        }
    }
    /// The number, in [-1, 1].
    #[must_use]
    pub const fn get(self) -> f64 {
        self.0
    }
}
impl Serialize for Duty {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        serialize_finite(self.0, to)
    }
}
impl<'de> Deserialize<'de> for Duty {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Self::new(deserialize_finite(from)?).map_err(D::Error::custom)
    }
}

/// A list of finite numbers of fixed length, such as the nine entries of a covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers<const N: usize>(pub [f64; N]);
impl<const N: usize> Default for Numbers<N> {
    fn default() -> Self {
        Self([0.0; N])
    }
}

impl<const N: usize> Serialize for Numbers<N> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeSeq as _;
        let mut items = to.serialize_seq(Some(N))?;
        for &value in &self.0 {
            if !value.is_finite() {
                return Err(S::Error::custom(format_args!(
                    "{value} is not a finite number and cannot be sent"
                )));
            }
            items.serialize_element(&value)?;
        }
        items.end()
    }
}
impl<'de, const N: usize> Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Item(f64);
        impl<'de> Deserialize<'de> for Item {
            fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                deserialize_finite(from).map(Self)
            }
        }
        struct List<const N: usize>;
        impl<'de, const N: usize> Visitor<'de> for List<N> {
            type Value = Numbers<N>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a list of {N} finite numbers")
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, mut seq: A) -> Result<Numbers<N>, A::Error> {
                let mut numbers = [0.0; N];
                for (index, number) in numbers.iter_mut().enumerate() {
                    *number =
                        seq.next_element::<Item>()?.ok_or_else(|| A::Error::invalid_length(index, &self))?.0;
                }
                match seq.next_element::<serde::de::IgnoredAny>()? {
                    None => Ok(Numbers(numbers)),
                    Some(_) => Err(A::Error::invalid_length(N + 1, &self)),
                }
            }
        }
        from.deserialize_seq(List)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_wraps_into_the_half_open_circle() {
        use std::f64::consts::PI;
        for (angle, wrapped) in
            [(0.0, 0.0), (PI, PI), (-PI, PI), (3.0 * PI, PI), (-0.5, -0.5), (7.0, 7.0 - 2.0 * PI)]
        {
            assert!((Radians(angle).wrapped().0 - wrapped).abs() < 1e-12, "{angle} wraps to {wrapped}");
        }
    }

    #[test]
    fn units_divide_into_units() {
        assert_eq!(Metres(6.0) / Seconds(2.0), MetresPerSecond(3.0));
        assert_eq!(MetresPerSecond(3.0) * Seconds(2.0), Metres(6.0));
        assert_eq!(MetresPerSecond(3.0) / Seconds(2.0), MetresPerSecondSquared(1.5));
        assert_eq!(format!("{:.2}", Metres(1.0)), "1.00 m");
    }

    #[test]
    fn a_duty_cycle_stays_within_full_power() {
        assert!(Duty::new(1.0).is_ok());
        for wrong in [1.0001, -2.0, f64::NAN, f64::INFINITY] {
            assert!(Duty::new(wrong).is_err(), "{wrong} is refused");
        }
    }
}
