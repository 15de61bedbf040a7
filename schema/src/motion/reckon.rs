//! Dead reckoning from encoders: from the distances that two wheels covered to the displacement of the robot.
//!
//! The functions that return `(x, y, theta)` take the signed distance of the left and of the right wheel and the distance between
//! the wheels, which is above 0; `(x, y, theta)` is the displacement of the robot's centre in the
//! frame of the pose before it (x forward, y left), and the change of its heading (counter-clockwise
//! positive, not wrapped).
//!
//! [`arc`] is the one to use, and [`accelerated`] where speeds change much within a sample. The two others,
//! [`point_and_shoot`] and [`half_turn`], are the approximations of the literature, kept to show what they
//! cost: with a turn of 10° per sample [`point_and_shoot`] misses by 8.7 % of the distance and [`half_turn`]
//! by 0.13 %. On a closed circle both errors vanish, which is why a full circle proves nothing about an
//! odometer.

use super::Wheels;

/// The exact displacement when both wheels kept constant speeds, or at least a constant ratio of speeds.
///
/// Then the robot moved on an arc of a circle, and its displacement is the chord of the arc, `s·sinc(θ/2)`,
/// in the direction of half the turn (G.W. Lucas, "A Tutorial and Elementary Trajectory Model for the
/// Differential Steering System of Robot Wheel Actuators", equation 5, in a form without singularity:
/// `sin(z)/z` loses no digits for any `z ≠ 0`, so that there is no threshold below which the robot would be
/// taken to go straight). The relative error is a few units in the last place of the distance.
///
/// ```
/// use axle_schema::motion::arc;
///
/// // A quarter turn to the left around the left wheel: the centre stays half a track away from it.
/// let (x, y, theta) = arc(0.0, 0.3 * std::f64::consts::FRAC_PI_2, 0.3);
/// assert!((x - 0.15).abs() < 1e-15 && (y - 0.15).abs() < 1e-15);
/// assert!((theta - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// ```
#[must_use]
pub fn arc(left: f64, right: f64, track: f64) -> (f64, f64, f64) {
    let (distance, half) = centre(left, right, track);
    let (x, y) = chord(distance, 2.0 * half);
    (x, y, 2.0 * half)
}

/// The displacement `(x, y)` in metres along an arc of the signed length `distance` in metres that turns by `theta`
/// radians, in the frame of its start: the form that needs no radius and has no singularity (model.md, 1.3).
///
/// This is also the odometer whose turn comes from a gyroscope rather than from the wheels.
///
/// ```
/// let (x, y) = axle_schema::motion::chord(2.0, 0.0);
/// assert_eq!((x, y), (2.0, 0.0));
/// ```
#[must_use]
pub fn chord(distance: f64, theta: f64) -> (f64, f64) {
    let half = 0.5 * theta;
    let (sin, cos) = half.sin_cos();
    let sinc = if half == 0.0 { 1.0 } else { sin / half };
    let chord = distance * sinc;
    (chord * cos, chord * sin)
}

/// The displacement as if the robot first turned on the spot and then went straight.
///
/// Equation 6 of G.W. Lucas (see [`arc`]). It equals the exact displacement times `exp(iθ/2)/sinc(θ/2)`:
/// rotated by half the turn and too long, an error of about `θ/2` of the distance per sample. Taking smaller
/// samples only divides the error by their number.
#[must_use]
pub fn point_and_shoot(left: f64, right: f64, track: f64) -> (f64, f64, f64) {
    let (distance, half) = centre(left, right, track);
    let theta = 2.0 * half;
    let (sin, cos) = theta.sin_cos();
    (distance * cos, distance * sin, theta)
}

/// The displacement as if the robot did half of its turn, went straight, and did the other half.
///
/// Tom Brown's improvement of [`point_and_shoot`], as reported by G.W. Lucas (see [`arc`]). The halved turn
/// is for the position only: the heading still changes by the full turn. The direction is exact; the length
/// is too long by the factor `1/sinc(θ/2)`, about `1 + θ²/24`.
#[must_use]
pub fn half_turn(left: f64, right: f64, track: f64) -> (f64, f64, f64) {
    let (distance, half) = centre(left, right, track);
    let (sin, cos) = half.sin_cos();
    (distance * cos, distance * sin, 2.0 * half)
}

/// The exact displacement when each wheel covered its distance within `duration` seconds at a constant acceleration.
///
/// This is what [`arc`] misses when speeds change within a sample: its direction errs by about
/// `−CT²/6 + A·ω̄T²/(12·v̄)` rad (model.md, 5). `accelerations` are those of the left and of the right wheel in m/s²;
/// [`slope`] estimates them from the samples before and after. Without acceleration this is [`arc`]. For a duration that
/// is not above 0 no acceleration means anything, and the result is that of [`arc`], too.
///
/// ```
/// use axle_schema::motion::{accelerated, Wheels};
///
/// // v=(.2,.5)→(1,.6), T=2, Δ=.3: a clothoid, of which encoders see 1.2 m and 1.1 m.
/// let (x, y, _) = accelerated(1.2, 1.1, [0.4, 0.05], 2.0, 0.3);
/// let end = Wheels { v0l: 0.2, v0r: 0.5, v1l: 1.0, v1r: 0.6, duration: 2.0, track: 0.3 }.end();
/// assert!((x - end.x).hypot(y - end.y) < 1e-15);
/// ```
#[must_use]
pub fn accelerated(
    left: f64,
    right: f64,
    accelerations: [f64; 2],
    duration: f64,
    track: f64,
) -> (f64, f64, f64) {
    let ends = |distance: f64, acceleration: f64| {
        let (mean, change) = (distance / duration, 0.5 * acceleration * duration);
        (mean - change, mean + change)
    };
    let ((v0l, v1l), (v0r, v1r)) = (ends(left, accelerations[0]), ends(right, accelerations[1]));
    if !(duration > 0.0 && [v0l, v0r, v1l, v1r].iter().all(|speed| speed.is_finite())) {
        return arc(left, right, track);
    }
    let end = Wheels { v0l, v0r, v1l, v1r, duration, track }.end();
    (end.x, end.y, end.theta)
}

/// The acceleration of one wheel in m/s² within a sample, from its mean speeds in m/s over the sample before, this one
/// and the one after, each with its duration in seconds (above 0). The neighbours that are missing are left out.
///
/// It is the slope between the middles of the neighbours, and exact if the acceleration is the same in all of them.
/// Unlike a chain that is continuous in speed (model.md 4.3, c) it looks at its neighbours only, and cannot ring.
#[must_use]
pub fn slope(before: Option<(f64, f64)>, here: (f64, f64), after: Option<(f64, f64)>) -> f64 {
    let (from, to) = (before.unwrap_or(here), after.unwrap_or(here));
    let inside = if before.is_some() && after.is_some() { here.1 } else { 0.0 };
    let time = 0.5 * from.1 + inside + 0.5 * to.1;
    if before.is_none() && after.is_none() { 0.0 } else { (to.0 - from.0) / time }
}

/// The signed distance of the robot's centre and half of its turn; halved first, so that the sum of two
/// finite distances cannot overflow.
fn centre(left: f64, right: f64, track: f64) -> (f64, f64) {
    (0.5 * left + 0.5 * right, (0.5 * right - 0.5 * left) / track)
}
