//! Dead reckoning from encoders: from the distances that two wheels covered to the displacement of the robot.
//!
//! All three functions take the signed distance of the left and of the right wheel and the distance between
//! the wheels, which is above 0, and return `(x, y, theta)`: the displacement of the robot's centre in the
//! frame of the pose before it (x forward, y left), and the change of its heading (counter-clockwise
//! positive, not wrapped).
//!
//! [`arc`] is the one to use. The two others are the approximations of the literature, kept to show what they
//! cost: with a turn of 10° per sample [`point_and_shoot`] misses by 8.7 % of the distance and [`half_turn`]
//! by 0.13 %. On a closed circle both errors vanish, which is why a full circle proves nothing about an
//! odometer.

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

/// The signed distance of the robot's centre and half of its turn; halved first, so that the sum of two
/// finite distances cannot overflow.
fn centre(left: f64, right: f64, track: f64) -> (f64, f64) {
    (0.5 * left + 0.5 * right, (0.5 * right - 0.5 * left) / track)
}
