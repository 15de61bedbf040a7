//! One leg as a problem of one dimension (model.md 4.4, "One geometry").
//!
//! A geometry is driven with a constant ratio of the wheel speeds, so that the only freedom is how fast the leading
//! (faster) wheel runs. What strategies choose is its speed at the two ends of the leg.

use crate::limits::Limits;
use axle_schema::{Dwm, Leg, MetresPerSecond, Refusal, Seconds, Sides};

/// Phases shorter than this, in s, come from rounding and are left out (model.md 4.4).
pub(crate) const LEAST_PHASE: f64 = 1e-12;

/// A leg seen from its leading wheel; symbols as in model.md 4.4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Course {
    /// Speeds of the wheels for a leading wheel at 1; the larger of the absolute values is 1.
    pub(crate) k: Sides<f64>,
    /// Distance of the leading wheel, m.
    pub(crate) s: f64,
    /// The largest speed of the leading wheel, m/s.
    pub(crate) u_max: f64,
    /// The acceleration of the leading wheel, m/s².
    pub(crate) a: f64,
    /// Speed of the middle of the axle for a leading wheel at 1, signed.
    pub(crate) kv: f64,
    /// Turn rate for a leading wheel at 1, signed, 1/m.
    pub(crate) k_omega: f64,
}

impl Course {
    /// The leg within `limits`; none for a leg that moves no wheel.
    pub(crate) fn of(leg: &Leg, limits: &Limits) -> Option<Self> {
        let robot = &limits.robot;
        let distances = leg.geometry.wheel_distances(robot.track);
        let s = distances.left.0.abs().max(distances.right.0.abs());
        if !(s > 0.0 && s.is_finite()) {
            return None;
        }
        let k = distances.map(|distance| distance.0 / s);
        let kv = f64::midpoint(k.left, k.right);
        let k_omega = (k.right - k.left) / robot.track.get();
        let v_lin = leg.speed.map_or(robot.speed.0, |speed| speed.0.min(robot.speed.0));
        // A line has kω = 0 and a turn has kv = 0: the quotient is then infinite and limits nothing.
        let u_max = robot
            .wheel_speed
            .0
            .min(v_lin / kv.abs())
            .min(robot.turn_rate.0 / k_omega.abs())
            .min((limits.lateral / (kv * k_omega).abs()).sqrt());
        let a = robot
            .wheel_acceleration
            .0
            .min(limits.acceleration / kv.abs())
            .min(limits.turn_acceleration / k_omega.abs());
        Some(Self { k, s, u_max, a, kv, k_omega })
    }

    /// The same leg without `begin` and `end` of the distance of its leading wheel, m.
    pub(crate) fn without(&self, begin: f64, end: f64) -> Self {
        Self { s: (self.s - begin - end).max(0.0), ..*self }
    }

    /// Speeding up from `u0`, cruising, braking to `u1`: the fastest movements along the leg. Needs `u0` and `u1`
    /// within `u_max`, and |u1² - u0²| ≤ 2aS.
    ///
    /// # Errors
    /// Refuses what [`Dwm`] refuses; within the limits of a robot there is no such case.
    pub(crate) fn movements(&self, u0: f64, u1: f64) -> Result<Vec<Dwm>, Refusal> {
        let Self { s, u_max, a, .. } = *self;
        let (u0_u0, u1_u1) = (u0 * u0, u1 * u1);
        let u_p = u_max.min((a * s + f64::midpoint(u0_u0, u1_u1)).sqrt()).max(u0).max(u1);
        let cruise = (s - (u_p * u_p - u0_u0) / (2.0 * a) - (u_p * u_p - u1_u1) / (2.0 * a)).max(0.0);
        let phases = [(u0, u_p, (u_p - u0) / a), (u_p, u_p, cruise / u_p), (u_p, u1, (u_p - u1) / a)];
        phases
            .into_iter()
            .filter(|&(_, _, duration)| duration > LEAST_PHASE)
            .map(|(from, to, duration)| Dwm::new(self.speeds(from), self.speeds(to), Seconds(duration)))
            .collect()
    }

    /// The wheel speeds when the leading wheel runs at `u`.
    pub(crate) fn speeds(&self, u: f64) -> Sides<MetresPerSecond> {
        // Adding 0 makes 0 of -0, which only confuses people who read it.
        self.k.map(|k| MetresPerSecond(k * u + 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Drivetrain, Geometry, Metres, MetresPerSecondSquared, Radians, RadiansPerSecond};

    fn limits() -> Limits {
        let robot = Drivetrain {
            wheel_speed: MetresPerSecond(1.0),
            wheel_acceleration: MetresPerSecondSquared(1.5),
            speed: MetresPerSecond(0.8),
            turn_rate: RadiansPerSecond(2.0),
            ..Drivetrain::default()
        };
        Limits::of_wheels(robot)
    }

    fn within(geometry: Geometry, limits: &Limits) -> Course {
        Course::of(&Leg { geometry, point: 0, speed: None }, limits).expect("a leg that moves")
    }
    fn course(geometry: Geometry) -> Course {
        within(geometry, &limits())
    }

    #[test]
    fn the_single_legs_of_the_model_take_their_times() {
        // model.md 4.4, "Single-segment checks": length, u0, u1, and the durations of the phases.
        let cases: [(f64, f64, f64, &[f64]); 3] = [
            (1.0, 0.0, 0.0, &[0.533_333_333_333, 0.716_666_666_667, 0.533_333_333_333]),
            (0.2, 0.0, 0.0, &[0.365_148_371_670, 0.365_148_371_670]),
            (0.4, 0.3, 0.5, &[0.333_333_333_333, 0.108_333_333_333, 0.2]),
        ];
        for (length, u0, u1, durations) in cases {
            let movements =
                course(Geometry::Line { length: Metres(length) }).movements(u0, u1).expect("finite");
            let got: Vec<f64> = movements.iter().map(|dwm| dwm.duration().0).collect();
            assert_eq!(got.len(), durations.len(), "{length} m: {got:?}");
            assert!(got.iter().zip(durations).all(|(a, b)| (a - b).abs() < 1e-11), "{length} m: {got:?}");
        }
    }

    #[test]
    fn the_limit_that_binds_depends_on_the_shape() {
        let check = |geometry, u_max: f64| {
            let course = course(geometry);
            assert!((course.u_max - u_max).abs() < 1e-12, "{course:?} is not limited to {u_max} m/s");
        };
        // The middle of the axle at 0.8 m/s; the outer wheel at 1 m/s; the turn rate at 2 rad/s, 0.15 m out.
        check(Geometry::Line { length: Metres(-1.0) }, 0.8);
        check(Geometry::Arc { radius: Metres(0.5), angle: Radians(1.0) }, 1.0);
        check(Geometry::Turn { angle: Radians(-1.0) }, 0.3);
        // The right wheel stands, the left one leads on a circle of 0.3 m around it.
        check(Geometry::Arc { radius: Metres(-0.15), angle: Radians(-1.0) }, 0.6);
    }

    #[test]
    fn the_body_limits_what_the_wheels_could() {
        let arc = Geometry::Arc { radius: Metres(0.5), angle: Radians(1.0) };
        // On this arc the middle of the axle runs at u / 1.3 and turns at u / 0.65.
        let calm = |limits: Limits| within(arc, &limits);
        let aside = calm(Limits { lateral: 0.5, ..limits() });
        assert!((aside.u_max - (0.5_f64 * 1.3 * 0.65).sqrt()).abs() < 1e-12, "{aside:?}");
        let along = calm(Limits { acceleration: 0.5, ..limits() });
        assert!((along.a - 0.65).abs() < 1e-12, "{along:?}");
        let round = calm(Limits { turn_acceleration: 1.0, ..limits() });
        assert!((round.a - 0.65).abs() < 1e-12, "{round:?}");
        let turn = within(Geometry::Turn { angle: Radians(1.0) }, &Limits { lateral: 0.01, ..limits() });
        assert!((turn.u_max - 0.3).abs() < 1e-12, "who turns on the spot is not pressed aside: {turn:?}");
    }

    #[test]
    fn a_leg_without_length_moves_no_wheel() {
        for geometry in [Geometry::Line { length: Metres(0.0) }, Geometry::Turn { angle: Radians(-0.0) }] {
            assert_eq!(Course::of(&Leg { geometry, point: 0, speed: None }, &limits()), None);
        }
    }
}
