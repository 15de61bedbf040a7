//! The displacement of a movement that turns little: Gauss–Legendre quadrature.
//!
//! The integrand `v·exp(iθ)` is entire, so the error of an `n`-node rule falls faster than geometrically once
//! it resolves the phase. There is no division by a speed, an acceleration or a curvature anywhere: straight,
//! circular and spiral movements and all their neighbours are one smooth case.

use super::complex::Complex;
use super::double_double::DoubleDouble;
use super::stretch::Stretch;
use super::tables::{GAUSS_8, GAUSS_12, GAUSS_16, RIPPLES, ROLLERS, Rule, SWELL, WAVES, Waves};
use std::f64::consts::TAU;

/// Largest phase, in radians, that [`displacement`] handles.
///
/// At every limit below, the worst error over all linear speed profiles is about 2e-16 of the path.
pub(super) const PHASE_LIMIT: f64 = TAU;
const PHASE_LIMIT_8: f64 = 0.35;
const PHASE_LIMIT_12: f64 = 2.5;

/// Where the robot is at the end of the stretch, in metres, given the total variation of its heading `phase`
/// in radians, at most [`PHASE_LIMIT`], and its heading there.
pub(super) fn displacement(stretch: &Stretch, phase: f64, theta: DoubleDouble) -> Complex {
    if phase <= PHASE_LIMIT_8 {
        // An angle this small needs no double-double, and the processor need not wait for one.
        let middle = |p: f64, q: f64| swell(p - q);
        integrate(&GAUSS_8, (&RIPPLES, &RIPPLES), stretch, middle)
    } else if phase <= PHASE_LIMIT_12 {
        integrate(&GAUSS_12, (&ROLLERS, &ROLLERS), stretch, |_, q| direction(theta.hi / 2.0 - q))
    } else {
        integrate(&GAUSS_16, (&WAVES, &ROLLERS), stretch, |_, q| direction(theta.hi / 2.0 - q))
    }
}

/// The rule in midpoint form. With `s = (1+x)·t/2` and everything expanded around `x = 0`,
///
/// ```text
/// θ = θm + p·x + q·x²      θm = p − q      p = (ω0+ω1)·t/4 = θ(t)/2      q = (ω1−ω0)·t/8
/// v = vm + dv·x            vm = (v0+v1)/2  dv = (v1−v0)/2
/// ```
///
/// and each pair of nodes `±x` joins to `2·exp(iqx²)·(vm·cos(px) + i·dv·x·sin(px))`. Neither `|p|` nor `2·|q|` exceeds half
/// of the phase, which bounds the angles of the sines and cosines: the first of the waves is for `px`, the second for `qx²`.
/// `middle` says the direction `exp(iθm)`, given `p` and `q`.
#[inline]
fn integrate<const N: usize, const S: usize, const C: usize, const S2: usize, const C2: usize>(
    rule: &Rule<N>,
    waves: (&Waves<S, C>, &Waves<S2, C2>),
    stretch: &Stretch,
    middle: impl Fn(f64, f64) -> Complex,
) -> Complex {
    // At the nodes a plain p is good enough.
    let p = (stretch.n0.hi + stretch.n1.hi) * stretch.turn.hi / 2.0;
    let q = stretch.m.hi * stretch.turn.hi / 4.0;
    let (vm, dv) = ((stretch.v0 + stretch.v1) / 2.0, (stretch.v1 - stretch.v0) / 2.0);

    let (sin_linear, cos_linear) = waves.0.at(&rule.nodes.map(|x| p * x));
    let (sin_square, cos_square) = waves.1.at(&rule.nodes.map(|x| q * x * x));
    let mut sum = Complex { re: 0.0, im: 0.0 };
    for k in 0..N {
        let even = rule.weights[k] * vm * cos_linear[k];
        let odd = rule.weights[k] * dv * rule.nodes[k] * sin_linear[k];
        sum.re += even * cos_square[k] - odd * sin_square[k];
        sum.im += even * sin_square[k] + odd * cos_square[k];
    }
    sum * middle(p, q) * stretch.time
}

/// The unit vector in this direction.
fn direction(angle: f64) -> Complex {
    let (sin, cos) = angle.sin_cos();
    Complex { re: cos, im: sin }
}

/// The same for angles up to three quarters of [`PHASE_LIMIT_8`], with sine and cosine side by side.
fn swell(angle: f64) -> Complex {
    let square = angle * angle;
    let mut sums = SWELL[SWELL.len() - 1];
    for row in SWELL[..SWELL.len() - 1].iter().rev() {
        sums = [sums[0] * square + row[0], sums[1] * square + row[1]];
    }
    Complex { re: sums[1], im: sums[0] * angle }
}

impl<const S: usize, const C: usize> Waves<S, C> {
    /// Sines and cosines of `N` angles side by side, so that the compiler can use vector registers.
    #[inline]
    fn at<const N: usize>(&self, angles: &[f64; N]) -> ([f64; N], [f64; N]) {
        let squares = angles.map(|x| x * x);
        let mut sin = polynomial(&self.sin, &squares);
        for k in 0..N {
            sin[k] *= angles[k];
        }
        (sin, polynomial(&self.cos, &squares))
    }
}

/// Horner's rule at `N` points side by side.
#[inline]
fn polynomial<const N: usize, const M: usize>(coefficients: &[f64; M], points: &[f64; N]) -> [f64; N] {
    let mut values = [coefficients[M - 1]; N];
    for coefficient in coefficients[..M - 1].iter().rev() {
        for k in 0..N {
            values[k] = values[k] * points[k] + coefficient;
        }
    }
    values
}
