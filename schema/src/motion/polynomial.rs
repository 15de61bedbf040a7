//! A robot whose wheel speeds are polynomials of time.
//!
//! A motor at constant power does not accelerate constantly. For that G.W. Lucas proposes accelerations that are
//! polynomials of time ("A Tutorial and Elementary Trajectory Model for the Differential Steering System of Robot Wheel
//! Actuators", section "Acceleration") and evaluates them numerically. The heading and the length of the way still have
//! closed forms; the position is integrated here, to the same accuracy as that of a DWM.

use super::Motion;
use super::complex::Complex;
use super::double_double::DoubleDouble;
use super::tables::{GAUSS_16, Rule};

/// The highest power of time in a wheel speed.
pub const MAX_DEGREE: usize = 16;

/// Wheel speeds `c[0] + c[1]·t + c[2]·t² + …` from the time 0 on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolynomialWheels<'a> {
    /// Coefficients of the left wheel's speed in m/s, m/s², m/s³ …, finite; at most [`MAX_DEGREE`] + 1.
    pub left: &'a [f64],
    /// Coefficients of the right wheel's speed.
    pub right: &'a [f64],
    /// Distance between the wheels in metres, finite and above 0.
    pub track: f64,
}

/// Coefficients of a polynomial on the unit interval, lowest power first.
type Coefficients = [DoubleDouble; MAX_DEGREE + 1];

const ZERO: DoubleDouble = DoubleDouble { hi: 0.0, lo: 0.0 };

impl PolynomialWheels<'_> {
    /// The state of the robot at the time `t ≥ 0`, in the frame of its pose at the time 0; none if there are more than
    /// [`MAX_DEGREE`] + 1 coefficients, if `t` is negative, the track is not above 0, or a number is not finite, and if
    /// the robot would turn by more than some 1e4 rad.
    ///
    /// The position is within 1e-14 of the length of the way for headings up to 1000 rad, unless the coefficients
    /// cancel each other so much that `f64` coefficients themselves do not determine it. It is the sum of 16-node
    /// Gauss–Legendre quadratures over panels of time, halved until a bound of the error of each is below 1e-16 of the
    /// way: for a function that is bounded by `M` on the ellipse of Bernstein with the sum of half-axes `ρ` the error
    /// is at most `64/15·M·ρ⁻³²/(1−ρ⁻²)`, and for a polynomial phase `M` follows from its coefficients.
    ///
    /// ```
    /// use axle_schema::motion::polynomial::PolynomialWheels;
    ///
    /// // The motors lose force as they get faster: v = t − t²/4 on both sides.
    /// let speed = [0.0, 1.0, -0.25];
    /// let motion = PolynomialWheels { left: &speed, right: &speed, track: 0.3 }.at(1.0).unwrap();
    /// assert!((motion.x - (0.5 - 0.25 / 3.0)).abs() < 1e-16);
    /// assert_eq!((motion.y, motion.theta, motion.v), (0.0, 0.0, 0.75));
    /// ```
    #[must_use]
    pub fn at(&self, t: f64) -> Option<Motion> {
        let longest = self.left.len().max(self.right.len());
        let finite = self.left.iter().chain(self.right).all(|c| c.is_finite());
        let usual = t >= 0.0 && t.is_finite() && self.track > 0.0 && self.track.is_finite();
        if longest > MAX_DEGREE + 1 || !finite || !usual {
            return None;
        }
        let course = Course::of(self, t);
        if !course.is_finite() {
            return None;
        }
        let path = path(&course.v.map(|c| c.hi));
        let mut sum = Complex { re: 0.0, im: 0.0 };
        if path > 0.0 {
            course.add_panels(path, &mut sum)?;
        }
        let theta = value(&course.theta, 1.0);
        let (v, omega) = if t > 0.0 {
            (value(&course.v, 1.0).hi / t, value(&course.omega, 1.0).hi / t)
        } else {
            let start = |side: &[f64]| side.first().copied().unwrap_or(0.0);
            let (left, right) = (start(self.left), start(self.right));
            (0.5 * left + 0.5 * right, (right - left) / self.track)
        };
        Some(Motion {
            x: sum.re + 0.0,
            y: sum.im + 0.0,
            theta: theta.hi + 0.0,
            v: v + 0.0,
            omega: omega + 0.0,
            path,
        })
    }
}

/// The movement over the unit interval `u = τ/t`: speeds are per unit of `u`, that is in metres and radians.
struct Course {
    v: Coefficients,
    omega: Coefficients,
    /// The integral of `omega` that is 0 at 0.
    theta: [DoubleDouble; MAX_DEGREE + 2],
}

/// The largest absolute value of `u` on the ellipse of Bernstein around `[0, 1]` with `ρ = 6`: `((ρ + 1/ρ)/2 + 1)/2`.
const GROWTH: f64 = 2.041_666_666_666_667;
/// With `|Im θ|` below 12 on the ellipse and `|v|` below 1000 times its mean, the bound of the error of a panel is
/// 4e-17 of the way.
const LARGEST_PHASE: f64 = 12.0;
const LARGEST_SPEED: f64 = 1000.0;
/// Limits the work: so many panels of this size are some 10 ms, and enough for more than 1e4 rad.
const SMALLEST_PANEL: f64 = 1.0 / 16_384.0;

impl Course {
    fn of(wheels: &PolynomialWheels<'_>, t: f64) -> Self {
        let (mut v, mut omega) = ([ZERO; MAX_DEGREE + 1], [ZERO; MAX_DEGREE + 1]);
        let mut theta = [ZERO; MAX_DEGREE + 2];
        let mut power = DoubleDouble { hi: t, lo: 0.0 };
        for k in 0..=MAX_DEGREE {
            let coefficient = |side: &[f64]| side.get(k).copied().unwrap_or(0.0);
            let (left, right) = (coefficient(wheels.left), coefficient(wheels.right));
            // A power that overflows must not make NaN of a coefficient that is not there.
            if left != 0.0 || right != 0.0 {
                v[k] = DoubleDouble::sum(left, right) * power * 0.5;
                omega[k] = DoubleDouble::sum(right, -left) * power / wheels.track;
                theta[k + 1] = omega[k] / float(k + 1);
            }
            power = power * t;
        }
        Self { v, omega, theta }
    }

    fn is_finite(&self) -> bool {
        let finite = |c: &DoubleDouble| c.hi.is_finite() && c.lo.is_finite();
        self.v.iter().chain(&self.omega).chain(&self.theta).all(finite)
    }

    /// Adds the displacement of all panels; none if there would be too many.
    fn add_panels(&self, path: f64, sum: &mut Complex) -> Option<()> {
        let (mut start, mut size) = (0.0, 1.0);
        while start < 1.0 {
            let v = shifted(&self.v, start).map(|c| c.hi);
            let omega = shifted(&self.omega, start).map(|c| c.hi);
            let bound = |c: &[f64; MAX_DEGREE + 1], size: f64| {
                c.iter().rev().fold(0.0, |sum, c| sum * (size * GROWTH) + c.abs())
            };
            while bound(&omega, size) * size * GROWTH > LARGEST_PHASE
                || bound(&v, size) > LARGEST_SPEED * path
            {
                size /= 2.0;
                if size < SMALLEST_PANEL {
                    return None;
                }
            }
            let direction = Complex::direction(value(&self.theta, start));
            *sum = *sum + direction * panel(&GAUSS_16, &v, &omega, size);
            start += size;
            // Powers of two keep every start exact; the next panel may be twice as long if it then ends where such a
            // panel may end.
            while (start / (2.0 * size)).fract() == 0.0 && start + 2.0 * size <= 1.0 {
                size *= 2.0;
            }
        }
        Some(())
    }
}

/// The displacement of one panel in the frame of its start, from the coefficients there.
fn panel<const N: usize>(
    rule: &Rule<N>,
    v: &[f64; MAX_DEGREE + 1],
    omega: &[f64; MAX_DEGREE + 1],
    size: f64,
) -> Complex {
    let mut turning = *omega;
    for (k, c) in turning.iter_mut().enumerate() {
        *c /= float(k + 1);
    }
    let horner = |c: &[f64; MAX_DEGREE + 1], u: f64| c.iter().rev().fold(0.0, |sum, c| sum * u + c);
    let mut sum = Complex { re: 0.0, im: 0.0 };
    for (node, weight) in rule.nodes.iter().zip(&rule.weights) {
        for node in [-node, *node] {
            let u = (1.0 + node) / 2.0 * size;
            let (sin, cos) = (horner(&turning, u) * u).sin_cos();
            sum = sum + Complex { re: cos, im: sin } * (weight * horner(v, u));
        }
    }
    sum * (size / 2.0)
}

/// The coefficients around `start`: Taylor's shift by repeated synthetic division.
fn shifted(coefficients: &Coefficients, start: f64) -> Coefficients {
    let mut shifted = *coefficients;
    for low in 0..MAX_DEGREE {
        for k in (low..MAX_DEGREE).rev() {
            shifted[k] = shifted[k] + shifted[k + 1] * start;
        }
    }
    shifted
}

fn value(coefficients: &[DoubleDouble], u: f64) -> DoubleDouble {
    coefficients.iter().rev().fold(ZERO, |sum, c| sum * u + *c)
}

#[allow(clippy::cast_precision_loss, reason = "powers and counts are small")]
const fn float(count: usize) -> f64 {
    count as f64
}

/// `∫|v| du` over the unit interval: the antiderivative between the zeros of `v`.
fn path(v: &[f64; MAX_DEGREE + 1]) -> f64 {
    let antiderivative =
        |u: f64| v.iter().enumerate().rev().fold(0.0, |sum, (k, c)| sum * u + c / float(k + 1)) * u;
    let mut places = zeros(v);
    places.insert(0, 0.0);
    places.push(1.0);
    places.windows(2).map(|pair| (antiderivative(pair[1]) - antiderivative(pair[0])).abs()).sum()
}

/// The places in (0, 1) where the polynomial changes its sign, in their order.
///
/// Between two neighbouring zeros of its derivative a polynomial is monotonic and has one zero at most, which
/// bisection finds to the last bit; the zeros of the derivative come from its own derivative in turn.
fn zeros(v: &[f64]) -> Vec<f64> {
    let Some(degree) = v.iter().rposition(|c| *c != 0.0).filter(|degree| *degree > 0) else {
        return Vec::new();
    };
    let v = &v[..=degree];
    let derivative: Vec<f64> = v.iter().enumerate().skip(1).map(|(k, c)| c * float(k)).collect();
    let mut places = zeros(&derivative);
    places.insert(0, 0.0);
    places.push(1.0);
    let at = |u: f64| v.iter().rev().fold(0.0, |sum, c| sum * u + c);
    let crossing = |pair: &[f64]| {
        let (mut low, mut high) = (pair[0], pair[1]);
        let rises = at(high) > 0.0;
        if (at(low) > 0.0) == rises {
            return None;
        }
        // Each step halves the interval: after these no f64 is left between its ends.
        for _ in 0..1100 {
            let middle = f64::midpoint(low, high);
            if middle <= low || middle >= high {
                break;
            }
            if (at(middle) > 0.0) == rises { high = middle } else { low = middle }
        }
        Some(high)
    };
    places.windows(2).filter_map(crossing).filter(|zero| *zero < 1.0).collect()
}
