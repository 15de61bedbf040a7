//! Manners at the goal: a wheel may go back once, not to and fro.
//!
//! A motor that does not creep, a coarse encoder or a slow link make a wheel run past its end by more than it may be off;
//! going back for it, it may run past it again. The authors of the paper lost amplifiers to that (paper, III.D). Near the
//! goal a wheel that has gone back therefore rests for a second before it goes back again, and within some tolerances of
//! the goal it is left where it is.

use axle_schema::{Seconds, Sides};

/// How long a wheel that has changed its direction does not change it again, s.
const PAUSE: Seconds = Seconds(1.0);

/// For so long before the end of a drive in time no wheel is driven against it, s.
pub(crate) const LATE: f64 = PAUSE.0;

/// The directions of both wheels.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Manners(Sides<Way>);

/// The direction of a wheel, 0 before the first one, when it changed last, and whether it has changed near the goal.
#[derive(Clone, Copy, Debug, Default)]
struct Way {
    sign: f64,
    turned: Option<Seconds>,
    has_turned: bool,
}

/// How near the goal is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Nearness {
    /// Directions change as often as the plan wants.
    Far,
    /// No wheel changes its direction twice in a second.
    Near,
    /// So near that the robot may stay where it is.
    Enough,
}

impl Manners {
    /// The speeds in m/s at the beat `at`; rest where a wheel would go back again too soon, or for what is near enough
    /// already.
    pub(crate) fn allow(&mut self, speeds: Sides<f64>, nearness: Nearness, at: Seconds) -> Sides<f64> {
        let before = self.0;
        let again = before.zip(speeds, |way, speed| way.goes_back_again(speed, nearness, at));
        if again.left || again.right {
            return Sides::new(0.0, 0.0);
        }
        self.0 = before.zip(speeds, |way, speed| way.then(speed, nearness, at));
        speeds
    }
}

impl Way {
    /// Whether the wheel has gone back already, and shall again.
    fn goes_back_again(self, speed: f64, nearness: Nearness, at: Seconds) -> bool {
        let soon = self.turned.is_some_and(|turned| at - turned < PAUSE);
        let again = match nearness {
            Nearness::Far => false,
            Nearness::Near => soon,
            Nearness::Enough => soon || self.has_turned,
        };
        again && self.sign * speed < 0.0
    }

    /// The direction after this speed.
    fn then(self, speed: f64, nearness: Nearness, at: Seconds) -> Self {
        let turns = self.sign * speed < 0.0;
        Self {
            sign: if speed.abs() > 0.0 { speed.signum() } else { self.sign },
            turned: if turns { Some(at) } else { self.turned },
            has_turned: nearness > Nearness::Far && (self.has_turned || turns),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Nearness::{Enough, Far, Near};
    use super::*;

    /// What becomes of the speeds of the left wheel, which are asked for `apart` seconds after each other.
    fn after(apart: f64, speeds: &[(f64, Nearness)]) -> Vec<f64> {
        let mut manners = Manners::default();
        let beat = |(beat, &(left, nearness)): (u32, &(f64, Nearness))| {
            manners.allow(Sides::new(left, 0.1), nearness, Seconds(apart * f64::from(beat))).left
        };
        (0..).zip(speeds).map(beat).collect()
    }

    #[test]
    fn a_wheel_goes_back_once_where_the_goal_is_near_enough() {
        let speeds = |speeds: &[f64]| -> Vec<_> { speeds.iter().map(|&speed| (speed, Enough)).collect() };
        for apart in [0.05, 2.0] {
            let once = [0.2, 0.0, 0.1, -0.1, 0.0, -0.05];
            assert_eq!(after(apart, &speeds(&once)), once);
            assert_eq!(after(apart, &speeds(&[-0.2, 0.1, -0.1, 0.1])), [-0.2, 0.1, 0.0, 0.1]);
            assert_eq!(after(apart, &speeds(&[0.0, 0.1])), [0.0, 0.1]);
        }
    }

    #[test]
    fn near_the_goal_it_rests_for_a_second_before_it_goes_back_again() {
        let to_and_fro = [(0.2, Near), (-0.2, Near), (0.2, Near), (-0.2, Near)];
        assert_eq!(after(1.1, &to_and_fro), [0.2, -0.2, 0.2, -0.2]);
        assert_eq!(after(0.4, &to_and_fro), [0.2, -0.2, 0.0, -0.2]);
        let patient = [(0.2, Near), (-0.2, Near), (0.2, Near), (0.2, Near), (0.2, Near)];
        assert_eq!(after(0.4, &patient), [0.2, -0.2, 0.0, 0.0, 0.2]);
    }

    #[test]
    fn far_from_it_the_plan_decides_and_the_direction_in_which_it_came_near_counts() {
        let plan = [(0.2, Far), (-0.2, Far), (0.2, Far), (-0.2, Far)];
        assert_eq!(after(0.05, &plan), [0.2, -0.2, 0.2, -0.2]);
        assert_eq!(after(0.05, &[(0.2, Far), (-0.1, Enough), (0.1, Enough)]), [0.2, -0.1, 0.0]);
        assert_eq!(after(0.05, &[(0.2, Far), (-0.1, Far), (0.1, Near)]), [0.2, -0.1, 0.0]);
        assert_eq!(
            after(2.0, &[(0.2, Near), (-0.2, Near), (0.1, Far), (-0.2, Enough)]),
            [0.2, -0.2, 0.1, -0.2]
        );
    }
}
