//! Where a robot is that is driven by a differential wheeled movement (DWM).
//!
//! A DWM gives the speeds of the left and of the right wheel at its start and at its end, and its duration;
//! in between each wheel accelerates constantly. With `v = (vr+vl)/2` and `ω = (vr−vl)/Δ`, both linear in
//! time, the robot is at
//!
//! ```text
//! x(t) = ∫ v·cos θ dτ      y(t) = ∫ v·sin θ dτ      θ(t) = ∫ ω dτ      from τ = 0 to t
//! ```
//!
//! The paper on service-oriented control that Axle follows solves these integrals by six formulas for six
//! shapes of the way, the last one with Fresnel integrals. Each is exact (once its signs are corrected) and
//! useless next to the border of its shape: for (0.1, 0.2) → (0.3, 0.4) m/s in 1 s with a track of 0.2 m,
//! whose two accelerations differ by one rounding error, the Fresnel formula returns x = −1.4e14 m instead of
//! 0.24 m. So [`Wheels::at`] computes the same integrals by two methods that know no shapes, chosen by how
//! much the robot turns:
//!
//! * up to one turn, Gauss–Legendre quadrature with 8, 12 or 16 nodes (`quadrature`);
//! * beyond, an antiderivative at both ends, with the Fresnel integral where an inflection is near
//!   (`endpoint`), and with phases in double-double arithmetic, because the position depends on thousands of
//!   radians modulo one turn.
//!
//! **Accuracy**, against arithmetic of 60 and more digits, for speeds up to 1200 m/s, headings up to 5e4 rad
//! and durations from 1e-6 to 60 s: the position is within 2.5e-15 of the length of the way (the median is
//! 7e-17), the heading and the speed are the nearest `f64` (but for ties), the turning rate and the length of
//! the way have relative errors below 2.3e-16 and 5e-16. For all finite arguments, all results are finite
//! whose exact values are in range.
//!
//! **Conventions.** SI units; the frame is the pose of the robot at the start of the movement, x forward, y
//! left, heading counter-clockwise positive; the right wheel faster means a turn to the left.

mod complex;
mod double_double;
mod endpoint;
pub mod polynomial;
mod quadrature;
pub mod reckon;
mod scale;
mod shape;
pub mod simpson;
mod stretch;
mod tables;

pub use reckon::{accelerated, arc, chord, half_turn, point_and_shoot, slope};
pub use shape::{Shape, shape};

use stretch::Stretch;

/// State of the robot at one instant of a movement, in the frame of its start.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Motion {
    /// Displacement forward, in metres.
    pub x: f64,
    /// Displacement to the left, in metres.
    pub y: f64,
    /// Change of the heading in radians, counter-clockwise positive; not wrapped, since a movement may turn
    /// many times.
    pub theta: f64,
    /// Speed of the centre between the wheels in m/s, forward positive.
    pub v: f64,
    /// Turning rate in rad/s, counter-clockwise positive.
    pub omega: f64,
    /// Length of the way of the centre in metres, `∫|v| dt ≥ 0`; way forwards and way backwards add up.
    pub path: f64,
}

/// The raw numbers of a DWM: `v0` and `v1` are the speeds at the start and at the end, `l` and `r` the left
/// and the right wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheels {
    /// Speed of the left wheel at the start in m/s, any finite number.
    pub v0l: f64,
    /// Speed of the right wheel at the start in m/s, any finite number.
    pub v0r: f64,
    /// Speed of the left wheel at the end in m/s, any finite number.
    pub v1l: f64,
    /// Speed of the right wheel at the end in m/s, any finite number.
    pub v1r: f64,
    /// Duration in seconds, finite and at least 0.
    pub duration: f64,
    /// Distance between the wheels in metres, finite and above 0. It belongs to the robot rather than to the
    /// movement.
    pub track: f64,
}

impl Wheels {
    /// The state of the robot `t` seconds after the start of the movement.
    ///
    /// `t` is limited to `[0, duration]`: before a movement the robot stands at its start, after it at its
    /// end, and `v` and `omega` are those of the start and of the end. At `t == duration` the speeds are
    /// those of the end; a movement of no duration therefore goes nowhere and has the speeds of its end.
    ///
    /// A `NaN` among the arguments gives `NaN` in the result. A result beyond the range of `f64` is infinite.
    /// If that is the heading or the turning rate, the position still lies within `path` of the start, but
    /// its direction means nothing; so it is beyond some 1e30 rad, where even the double-double phase has no
    /// digits left.
    ///
    /// ```
    /// use axle_schema::motion::Wheels;
    ///
    /// let curve = Wheels { v0l: 0.2, v0r: 0.5, v1l: 0.4, v1r: 1.0, duration: 2.0, track: 0.3 };
    /// let end = curve.at(2.0);
    /// // Three radians on a circle of radius 0.35 m.
    /// assert!((end.x - 0.35 * 3f64.sin()).abs() < 1e-15);
    /// assert!((end.y - 0.35 * (1.0 - 3f64.cos())).abs() < 1e-15);
    /// assert!((end.theta - 3.0).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn at(&self, t: f64) -> Motion {
        if t >= self.duration {
            return self.end();
        }
        let time = if t < 0.0 { 0.0 } else { t };
        if self.is_tame(time) {
            return Stretch::until(self.speeds(), time, self.duration, self.track).motion();
        }
        scale::motion(self, time)
    }

    /// The state of the robot at the end of the movement: [`at`](Self::at) the time `duration`.
    #[must_use]
    pub fn end(&self) -> Motion {
        if self.is_tame(self.duration) {
            return Stretch::whole(self.speeds(), self.duration, self.track).motion();
        }
        scale::motion(self, self.duration)
    }

    /// The wheel speeds: left and right at the start, left and right at the end.
    fn speeds(&self) -> [f64; 4] {
        [self.v0l, self.v0r, self.v1l, self.v1r]
    }

    /// Whether no intermediate result can overflow, or lose digits by underflow, up to the time `time`.
    ///
    /// The limits leave room for the square of a turning rate, the most extreme quantity of the computation.
    fn is_tame(&self, time: f64) -> bool {
        const SMALL: f64 = 6.2e-61; // about 2⁻²⁰⁰
        const LARGE: f64 = 1.6e60; // about 2²⁰⁰
        let [a, b, c, d] = self.speeds().map(f64::abs);
        let speed = a.max(b).max(c.max(d));
        let usual = SMALL..=LARGE;
        usual.contains(&speed)
            && usual.contains(&self.track)
            && usual.contains(&time)
            && self.duration <= LARGE
    }
}
