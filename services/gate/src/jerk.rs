//! A setpoint whose acceleration changes no faster than a jerk limit allows, for robots that carry what may topple or
//! spill.
//!
//! Each wheel follows its target on its own: while the accelerations that the wheels have when a braking begins fade,
//! the ratio of their speeds changes, for at most `a / jerk` seconds. Braking takes that much longer, too.

use axle_schema::Seconds;

/// The length of the inner steps, s. Beats differ in length, and the law below holds for steps of one length.
const STEP: f64 = 0.001;

/// What one wheel may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits {
    /// Largest speed, m/s.
    pub(crate) speed: f64,
    /// Largest acceleration, m/s².
    pub(crate) acceleration: f64,
    /// Largest change of the acceleration, m/s³.
    pub(crate) jerk: f64,
}

/// The setpoint of one wheel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Setpoint {
    /// m/s.
    pub(crate) speed: f64,
    /// m/s².
    pub(crate) acceleration: f64,
}

impl Setpoint {
    /// The setpoint after `span`, on its way to a target that moves with a constant acceleration; `target` is where it
    /// is at the end of the span.
    pub(crate) fn toward(self, target: Self, limits: Limits, span: Seconds) -> Self {
        let numbers = [target.speed, target.acceleration, span.0];
        // Whatever is no number moves nothing.
        if !numbers.iter().all(|number| number.is_finite()) || span.0 <= 0.0 {
            return self;
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most 50 steps of a beat"
        )]
        let steps = (span.0 / STEP).ceil().clamp(1.0, 1000.0) as u32;
        let h = span.0 / f64::from(steps);
        (1..=steps).fold(self, |now, step| {
            let left = f64::from(steps - step) * h;
            let then = Self { speed: target.speed - target.acceleration * left, ..target };
            now.step(then, limits, h)
        })
    }

    fn step(self, target: Self, limits: Limits, h: f64) -> Self {
        let Limits { speed: fastest, acceleration: steepest, jerk } = limits;
        let speed = (self.speed + self.acceleration * h).clamp(-fastest, fastest);
        let next = Self { speed, acceleration: 0.0 };
        // Where both are smaller than one step can change, they are at their target.
        let is_near = (speed - target.speed).abs() <= 2.0 * jerk * h * h
            && (self.acceleration - target.acceleration).abs() <= 2.0 * jerk * h;
        if is_near && target.speed.abs() <= fastest && target.acceleration.abs() <= steepest {
            return target;
        }
        let error = self.speed - (target.speed - target.acceleration * h);
        let change = fastest_jerk(error, self.acceleration - target.acceleration, jerk, h);
        // A limit that has become smaller is come down to at the same pace.
        let most = steepest.max(self.acceleration.abs() - jerk * h);
        let wanted = (self.acceleration + change * h).clamp(-most, most);
        // A wheel that still gains speed must come out of its acceleration below its largest speed: with the acceleration a
        // it gains a² / (2 jerk) + a h / 2 until then, in steps of h. With the longest h the bound holds for all others,
        // and it never falls faster than by the jerk.
        let (left, h) = ((fastest - speed.abs()).max(0.0), h.max(STEP));
        let room = jerk * ((h * h / 4.0 + 2.0 * left / jerk).sqrt() - h / 2.0);
        let acceleration = if wanted * speed > 0.0 { wanted.clamp(-room, room) } else { wanted };
        Self { acceleration, ..next }
    }
}

/// The jerk that takes a double integrator to rest at zero in the shortest time without overshoot, in steps of `h`.
///
/// Source: J. Han, "From PID to active disturbance rejection control", the function fhan; symbols as there.
fn fastest_jerk(x1: f64, x2: f64, r: f64, h: f64) -> f64 {
    let d = r * h;
    let d0 = h * d;
    let y = x1 + h * x2;
    let a0 = (d * d + 8.0 * r * y.abs()).sqrt();
    let a = if y.abs() > d0 { x2 + (a0 - d) / 2.0 * y.signum() } else { x2 + y / h };
    if a.abs() > d { -r * a.signum() } else { -r * a / d }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: Limits = Limits { speed: 1.0, acceleration: 2.0, jerk: 10.0 };

    #[test]
    fn from_rest_to_a_speed_it_takes_the_time_of_the_ideal_ramp_and_does_not_overshoot() {
        // 0.8 m/s at 2 m/s² with 10 m/s³: 0.4 s of acceleration and 0.2 s for its rise and fall.
        let target = Setpoint { speed: 0.8, acceleration: 0.0 };
        let (mut now, mut time) = (Setpoint::default(), 0.0);
        while now != target {
            now = now.toward(target, LIMITS, Seconds(0.005));
            time += 0.005;
            assert!(now.speed <= 0.8 + 1e-9 && time < 1.0, "{now:?} after {time} s");
        }
        assert!((time - 0.6_f64).abs() < 0.02, "{time} s");
    }

    #[test]
    fn a_ramp_that_it_can_follow_is_caught_up_with() {
        let mut now = Setpoint::default();
        for beat in 1..=60_u32 {
            let speed = f64::from(beat) * 0.005;
            now = now.toward(Setpoint { speed, acceleration: 1.0 }, LIMITS, Seconds(0.005));
        }
        assert!((now.speed - 0.3).abs() < 1e-9 && (now.acceleration - 1.0).abs() < 1e-9, "{now:?}");
    }

    #[test]
    fn what_is_no_number_moves_nothing() {
        let now = Setpoint { speed: 0.3, acceleration: 0.1 };
        for (speed, acceleration, span) in
            [(f64::NAN, 0.0, 0.005), (0.1, f64::INFINITY, 0.005), (0.1, 0.0, f64::NAN), (0.1, 0.0, -1.0)]
        {
            assert_eq!(now.toward(Setpoint { speed, acceleration }, LIMITS, Seconds(span)), now);
        }
    }

    proptest! {
        #[test]
        fn no_limit_is_passed_whatever_is_asked_and_it_comes_to_rest(
            asks in prop::collection::vec((-1.5..1.5, -4.0..4.0, 0.0005..0.05), 1..80),
        ) {
            let mut now = Setpoint::default();
            for (speed, acceleration, span) in asks {
                let next = now.toward(Setpoint { speed, acceleration }, LIMITS, Seconds(span));
                prop_assert!(next.speed.abs() <= 1.0 + 1e-12 && next.acceleration.abs() <= 2.0 + 1e-12, "{next:?}");
                prop_assert!((next.speed - now.speed).abs() <= 2.0 * span + 1e-9);
                // The last step onto a target may be twice as steep, for a millisecond.
                let change = (next.acceleration - now.acceleration).abs();
                prop_assert!(change <= 10.0 * (span + 0.002) + 1e-9, "{now:?} to {next:?} in {span}");
                now = next;
            }
            // From 1 m/s: 0.5 s of braking, 0.2 s for each change of the acceleration, and 0.2 s to come out of one.
            for _ in 0..240 {
                now = now.toward(Setpoint::default(), LIMITS, Seconds(0.005));
            }
            prop_assert_eq!(now, Setpoint::default());
        }
    }
}
