//! The displacement of a movement that turns much: an antiderivative, evaluated at both ends.
//!
//! With `u` the time since the inflection (the instant when `ω = 2Cu` is zero), `v = A·u + Vc` and `θ = θ* +
//! C·u²`,
//!
//! ```text
//! ∫ v·exp(iθ) du = A/(2iC)·exp(iθ) + Vc·exp(iθ*)·F(u)        F(u) = ∫₀ᵘ exp(iCs²) ds
//! ```
//!
//! which is the paper's closed form (a circle plus a clothoid) before it is split into sines and Fresnel
//! integrals. As it stands it divides by `C`. Far from the inflection, `F(u) = ±F(∞) + G(u)`, and the parts
//! of both terms that grow for `C → 0` cancel by algebra, not by subtraction, when `G` is written with its
//! auxiliary function `σ`:
//!
//! ```text
//! exp(iθ)·[ (v/(iω))·(1+ρ) + (A/ω²)·σ ]        ρ = σ·2C/(iω²)
//! ```
//!
//! That form holds for `C = 0` as well, where it is the circle or the spiral. The constant
//! `±Vc·exp(iθ*)·F(∞)` is needed only where the two ends are not far on the same side of the inflection.

use super::complex::Complex;
use super::double_double::DoubleDouble;
use super::stretch::Stretch;
use super::tables::{FAR, NEAR};
use std::f64::consts::PI;

/// An end of the movement is far from the inflection where `φ = Cu² = ω²/(4C)`, the turn between the two, is
/// at least this many radians. The tables are made for it.
const PHI_FAR: f64 = 6.0;

/// Where the robot is at the end of the stretch, in metres, given its heading there. The stretch must turn:
/// not both of its ends may have `ω = 0`.
pub(super) fn displacement(stretch: &Stretch, theta: DoubleDouble) -> Complex {
    // A movement with C < 0 is the mirror image, y → −y, of one with C > 0, and a circle to the right of one
    // to the left.
    let mirrored = stretch.m.hi < 0.0 || (stretch.m.hi == 0.0 && stretch.n0.hi < 0.0);
    let mirror = if mirrored { -1.0 } else { 1.0 };
    let theta = if mirrored { -theta } else { theta };
    let rates = Rates::of(stretch);
    let start = End::new(stretch.v0, mirror * stretch.n0.hi, stretch.track, &rates);
    let end = End::new(stretch.v1, mirror * stretch.n1.hi, stretch.track, &rates);

    let mut z = Complex::direction(theta) * end.antiderivative(&rates) - start.antiderivative(&rates);
    if !(start.is_far() && end.is_far() && start.slowness * end.slowness > 0.0) {
        // The ends are at the times u0 and u1 since the inflection; in parts of the duration, u/t = n/m.
        let u0 = stretch.n0 / stretch.m;
        let u1 = stretch.n1.hi / stretch.m.hi;
        // θ* = −φ0 = −C·u0² = −(u0/t)·n0·t/(2Δ); no square of a speed is formed that could underflow.
        let phi0 = u0 * stretch.n0 * stretch.turn;
        let phi0 = if mirrored { -phi0 } else { phi0 };
        let phi1 = theta + phi0;
        // Vc = v − A·u loses least at the end that is nearer to the inflection.
        let gain = stretch.v1 - stretch.v0;
        let speed = if u0.hi.abs() < u1.abs() { stretch.v0 - gain * u0.hi } else { stretch.v1 - gain * u1 };
        let between = end.fresnel(phi1.hi, u1 * stretch.time, &rates)
            - start.fresnel(phi0.hi, u0.hi * stretch.time, &rates);
        z = z + Complex::direction(-phi0) * between * speed;
    }
    Complex { re: z.re, im: mirror * z.im }
}

/// What does not change during the movement.
struct Rates {
    /// Acceleration of the centre, `A`, in m/s².
    a: f64,
    /// Angular acceleration without its sign, `2C ≥ 0`, in rad/s².
    twist: f64,
    /// `A/2C`, the radius of the circle in the closed form, in metres; meaningless where `C` is tiny.
    radius: f64,
}

impl Rates {
    fn of(stretch: &Stretch) -> Self {
        let gain = stretch.v1 - stretch.v0;
        Self {
            a: gain / stretch.time,
            twist: stretch.m.hi.abs() / (stretch.track * stretch.time),
            radius: gain * stretch.track / stretch.m.hi.abs(),
        }
    }
}

/// One end of the movement, mirrored so that `C ≥ 0`.
struct End {
    /// Speed of the robot's centre, in m/s.
    v: f64,
    /// `1/ω`, the time in which the robot turns by a radian, in s/rad; infinite at the inflection. Of the divisions that
    /// the formulas have, it is the only one that is left.
    slowness: f64,
    /// `2C/ω² = 1/(2φ)`: 0 on a circle, infinite at the inflection.
    nearness: f64,
}

impl End {
    /// The end where the centre has the speed `v`, and the right wheel is faster than the left one by `n`.
    fn new(v: f64, n: f64, track: f64, rates: &Rates) -> Self {
        let slowness = track / n;
        Self { v, slowness, nearness: rates.twist * slowness * slowness }
    }

    fn is_far(&self) -> bool {
        self.nearness <= 0.5 / PHI_FAR
    }

    /// The antiderivative without the direction `exp(iθ)` of this end, and without the multiple of
    /// [`fresnel`](Self::fresnel).
    fn antiderivative(&self, rates: &Rates) -> Complex {
        if !self.is_far() {
            return Complex { re: 0.0, im: -rates.radius };
        }
        let sigma = polynomial(&FAR, 4.0 * PHI_FAR * self.nearness - 1.0);
        let rho = Complex { re: sigma.im * self.nearness, im: -sigma.re * self.nearness };
        let radius = self.v * self.slowness;
        let growth = rates.a * self.slowness * self.slowness;
        Complex { re: radius * rho.im + growth * sigma.re, im: growth * sigma.im - radius * (1.0 + rho.re) }
    }

    /// `F(u)` near the inflection, in seconds; far from it `±F(∞)`, which is all that
    /// [`antiderivative`](Self::antiderivative) leaves over.
    ///
    /// `phi` and `u` could be had from `ω`, but with more roundings, and `Vc·F(u)` may be far larger than the
    /// displacement.
    fn fresnel(&self, phi: f64, u: f64, rates: &Rates) -> Complex {
        if self.is_far() {
            let part = (PI / rates.twist).sqrt().copysign(self.slowness) / 2.0;
            return Complex { re: part, im: part };
        }
        // The limits matter only beyond some 1e30 rad, where the sum that gave `phi` has no digits left.
        let r = (phi / PHI_FAR).clamp(0.0, 1.0);
        let m = polynomial(&NEAR, 2.0 * r * r - 1.0);
        Complex { re: m.re, im: r * m.im } * u
    }
}

/// Two real polynomials at the same point, as one complex number.
///
/// Every fourth power is summed apart: a plain Horner scheme of this length would wait for one addition after the other.
fn polynomial<const N: usize>(rows: &[[f64; 2]; N], z: f64) -> Complex {
    let square = z * z;
    let fourth = square * square;
    let mut sums = [[0.0; 2]; 4];
    for (k, row) in rows.iter().enumerate().rev() {
        let sum = &mut sums[k % 4];
        *sum = [sum[0] * fourth + row[0], sum[1] * fourth + row[1]];
    }
    let [a, b, c, d] = sums;
    let part = |k: usize| (a[k] + z * b[k]) + square * (c[k] + z * d[k]);
    Complex { re: part(0), im: part(1) }
}
