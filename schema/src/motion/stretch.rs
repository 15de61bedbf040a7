//! The part of a movement from its start to one instant, in the quantities that the integrals need.

use super::Motion;
use super::complex::Complex;
use super::double_double::{DoubleDouble, Two};
use super::{endpoint, quadrature};

/// A movement of wheels at constant acceleration, from its start to its end.
///
/// The accelerations of the wheels are never formed: to divide two rounded differences of speeds by the
/// duration and to subtract the results destroys every movement that is nearly straight, nearly a spin or
/// nearly a spiral (the decimal speeds (0.1, 0.2) → (0.3, 0.4) are enough). Sums and differences of wheel
/// speeds are kept exactly instead.
pub(super) struct Stretch {
    /// Speed of the robot's centre at the start, in m/s.
    pub(super) v0: f64,
    /// Speed of the robot's centre at the end, in m/s.
    pub(super) v1: f64,
    /// Right wheel speed less left wheel speed at the start, in m/s.
    pub(super) n0: DoubleDouble,
    /// The same at the end, in m/s.
    pub(super) n1: DoubleDouble,
    /// `n1 − n0`, in m/s.
    pub(super) m: DoubleDouble,
    /// `n0 + n1`, in m/s: twice the mean.
    both: DoubleDouble,
    /// `time/(2·track)`, in s/m: how far the robot turns for each m/s of `both`. It is ready before `both` is, and to
    /// multiply by it takes half as long as to divide by the track.
    pub(super) turn: DoubleDouble,
    /// How long it lasts, in seconds.
    pub(super) time: f64,
    /// Distance between the wheels, in metres.
    pub(super) track: f64,
}

impl Stretch {
    /// The whole of a movement: `speeds` are those of the left and the right wheel at the start, then at the
    /// end.
    pub(super) fn whole(speeds: [f64; 4], time: f64, track: f64) -> Self {
        let [v0l, v0r, v1l, v1r] = speeds;
        let n = DoubleDouble::sum(Two(v0r, v1r), -Two(v0l, v1l));
        let (n0, n1) = (n.first(), n.second());
        // n1 − n0 and n1 + n0, side by side.
        let sums = DoubleDouble::both(n1, n1) + DoubleDouble::both(-n0, n0);
        Self {
            v0: (v0l + v0r) / 2.0,
            v1: (v1l + v1r) / 2.0,
            n0,
            n1,
            m: sums.first(),
            both: sums.second(),
            turn: DoubleDouble::quotient(time, 2.0 * track),
            time,
            track,
        }
    }

    /// The first `share` (from 0 to 1) of a movement, which takes the time `time`.
    pub(super) fn part(speeds: [f64; 4], share: DoubleDouble, time: f64, track: f64) -> Self {
        Self::shared(speeds, share, DoubleDouble::quotient(time, 2.0 * track), time, track)
    }

    /// What of a movement of `duration` is over after `time`.
    pub(super) fn until(speeds: [f64; 4], time: f64, duration: f64, track: f64) -> Self {
        // Two quotients take no longer than one.
        let quotients = DoubleDouble::quotient(Two(time, time), Two(duration, 2.0 * track));
        Self::shared(speeds, quotients.first(), quotients.second(), time, track)
    }

    fn shared(speeds: [f64; 4], share: DoubleDouble, turn: DoubleDouble, time: f64, track: f64) -> Self {
        let [v0l, v0r, v1l, v1r] = speeds;
        // The sum and the difference of the wheels, side by side. In double-double, because either may cross zero near
        // this instant and should keep its digits there.
        let start = DoubleDouble::sum(Two(v0r, v0r), Two(v0l, -v0l));
        let end = DoubleDouble::sum(Two(v1r, v1r), Two(v1l, -v1l));
        let gain = (end - start) * DoubleDouble::both(share, share);
        let now = start + gain;
        let (n0, m) = (start.second(), gain.second());
        Self {
            v0: start.hi.0 / 2.0,
            v1: now.hi.0 / 2.0,
            n0,
            n1: now.second(),
            m,
            // The sum n0 + n1, written so that it need not wait for n1.
            both: n0.doubled() + m,
            turn,
            time,
            track,
        }
    }

    /// Turning rate at the end, in rad/s.
    pub(super) fn omega_end(&self) -> f64 {
        self.n1.hi / self.track
    }

    /// Where the stretch ends, in the frame of its start.
    pub(super) fn motion(&self) -> Motion {
        let omega = self.omega_end();
        let theta = self.both * self.turn;
        // Bounds the total variation of the heading, which may be far more than |θ| when the robot swings
        // back.
        let phase = (self.n0.hi.abs() + self.n1.hi.abs()) * self.turn.hi;
        let z = if phase == 0.0 {
            Complex { re: (self.v0 + self.v1) / 2.0 * self.time, im: 0.0 }
        } else if phase <= quadrature::PHASE_LIMIT {
            quadrature::displacement(self, phase, theta)
        } else {
            endpoint::displacement(self, theta)
        };
        // Adding zero turns a negative zero into the positive one.
        Motion {
            x: z.re + 0.0,
            y: z.im + 0.0,
            theta: theta.hi + 0.0,
            v: self.v1 + 0.0,
            omega: omega + 0.0,
            path: self.path(),
        }
    }

    /// Length of the way of the robot's centre, `∫|v| dt`, in metres.
    fn path(&self) -> f64 {
        let (start, end) = (self.v0.abs(), self.v1.abs());
        if (self.v0 < 0.0) == (self.v1 < 0.0) {
            return (start + end) / 2.0 * self.time;
        }
        // The speed changes its sign: two triangles, which share the time in proportion to their heights.
        let sum = start + end;
        (start * (start / sum) + end * (end / sum)) / 2.0 * self.time
    }
}
