//! The wheels as a corrector commands them: within the limits of the robot, without a jump, and remembered.
//!
//! Commands take their time to the wheels, and measurements to the corrector. What was commanded in between is known,
//! so that the state in which the next command will find the robot can be computed from the newest measurement.

use crate::friction::Friction;
use axle_schema::{Drivetrain, Dwm, EncodersSpan, MetresPerSecond, Pose, Refusal, Seconds, Sides};
use std::collections::VecDeque;

/// Commands that are remembered: 1.5 s at beats of 10 ms.
const MEMORY: usize = 160;

/// What was commanded last, and before.
#[derive(Clone, Debug)]
pub(crate) struct Wheels {
    robot: Drivetrain,
    period: Seconds,
    last: Dwm,
    /// What is added to every speed, since motors rub.
    pub(crate) friction: Friction,
    /// What was to come of the commands, and their beats, oldest first.
    said: VecDeque<(Seconds, Dwm)>,
}

impl Wheels {
    /// Wheels at rest.
    pub(crate) fn new(robot: Drivetrain, period: Seconds, friction: Friction) -> Self {
        let (last, said) = (Dwm::rest(Seconds::ZERO), VecDeque::with_capacity(MEMORY));
        Self { robot, period, last, friction, said }
    }

    /// The movement from the end of the last one towards `target`, both wheels in step, as far as the limits allow.
    ///
    /// A wheel that would be too fast slows both down, so that the curvature stays.
    ///
    /// # Errors
    /// Refuses speeds that are not finite.
    pub(crate) fn command(&mut self, target: Sides<MetresPerSecond>, at: Seconds) -> Result<Dwm, Refusal> {
        let target = self.friction.overcome(target.map(|speed| speed.0)).map(MetresPerSecond);
        let peak = target.left.abs().max(target.right.abs()).0;
        let fit = (self.robot.wheel_speed.0 / peak).min(1.0);
        let from = self.last.end();
        let change = target.zip(from, |to, from| to * fit - from);
        let largest = change.left.abs().max(change.right.abs()).0;
        let share = (self.robot.wheel_acceleration.0 * self.period.0 / largest).min(1.0);
        // Exactly the target where it can be reached: rest must be rest.
        let end = if share < 1.0 {
            from.zip(change, |from, change| from + change * share)
        } else {
            target.map(|to| to * fit)
        };
        // The quotients and minima above pass over what is no number.
        let end = end.zip(target, |end, target| if target.is_finite() { end } else { target });
        self.last = Dwm::new(from, end, self.period)?;
        if self.said.len() == MEMORY {
            self.said.pop_front();
        }
        self.said.push_back((at, Dwm::new(self.felt(from), self.felt(end), self.period)?));
        Ok(self.last)
    }

    /// The gate has brought the wheels to rest, whatever was commanded.
    pub(crate) fn rest(&mut self) {
        self.last = Dwm::rest(Seconds::ZERO);
        self.said.clear();
    }

    /// What was commanded last.
    pub(crate) const fn last(&self) -> &Dwm {
        &self.last
    }

    /// How fast the wheels run after the last command, as far as it is known how they rub.
    pub(crate) fn speeds(&self) -> Sides<MetresPerSecond> {
        self.felt(self.last.end())
    }

    fn felt(&self, speeds: Sides<MetresPerSecond>) -> Sides<MetresPerSecond> {
        self.friction.felt(speeds.map(|speed| speed.0)).map(MetresPerSecond)
    }

    /// Learns how the wheels rub from the ways of a time, in m; says what they were really asked, for the sake of it.
    pub(crate) fn learn(&mut self, asked: Sides<f64>, made: Sides<f64>, passed: Seconds) -> Sides<f64> {
        self.friction.learn(asked, made, passed);
        if passed.0 <= 0.0 {
            return asked;
        }
        self.friction.overcome(asked.map(|way| way / passed.0)).map(|speed| speed * passed.0)
    }

    /// Whether the last command ends at rest.
    pub(crate) fn stand(&self) -> bool {
        let end = self.last.end();
        end.left.abs().max(end.right.abs()) <= MetresPerSecond::ZERO
    }

    /// What the wheels do by the commands of the beats from `from` to `to`, piece by piece, oldest first.
    fn spans(&self, from: Seconds, to: Seconds) -> impl Iterator<Item = EncodersSpan> {
        let first = self.said.iter().rposition(|&(at, _)| at <= from).unwrap_or(0);
        let ends = self.said.iter().skip(first + 1).map(|&(at, _)| at).chain([to]);
        self.said.iter().skip(first).zip(ends).map(move |(&(at, dwm), end)| {
            let (begin, end) = (from.max(at) - at, end.min(to) - at);
            let mut span = EncodersSpan::default();
            if end > begin {
                // Beyond its end a command is held for a short while; the next one is seldom late.
                let held = (end - dwm.duration()).max(Seconds::ZERO).min(self.period)
                    - (begin - dwm.duration()).max(Seconds::ZERO).min(self.period);
                let more = dwm.distances_at(end).zip(dwm.distances_at(begin), |end, begin| end - begin);
                let more = more.zip(dwm.end(), |more, speed| more + speed * held);
                span = EncodersSpan { duration: end - begin, left: more.left, right: more.right };
            }
            span
        })
    }

    /// Where the robot is after the commands of the beats from `from` to `to`, if it was at `pose` before.
    pub(crate) fn pose_after(&self, pose: Pose, from: Seconds, to: Seconds) -> Pose {
        self.spans(from, to).fold(pose, |pose, span| {
            let step = span.navigator_span(self.robot.track);
            pose.moved(step.x, step.y, step.heading)
        })
    }

    /// What the wheels cover by the commands of the beats from `from` to `to`, m.
    pub(crate) fn covered(&self, from: Seconds, to: Seconds) -> Sides<f64> {
        self.spans(from, to)
            .fold(Sides::new(0.0, 0.0), |sum, span| sum.zip(span.sides(), |sum, distance| sum + distance.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both(left: f64, right: f64) -> Sides<MetresPerSecond> {
        Sides::new(MetresPerSecond(left), MetresPerSecond(right))
    }

    #[test]
    fn a_command_goes_as_far_as_the_limits_allow_with_both_wheels_in_step() {
        let mut wheels = Wheels::new(Drivetrain::default(), Seconds(0.1), Friction::new(0.06));
        // 1.5 m/s² for 0.1 s are 0.15 m/s; the left wheel makes half the way of the right one.
        let dwm = wheels.command(both(0.2, 0.4), Seconds(0.0)).expect("finite");
        assert!((dwm.end().left.0 - 0.075).abs() < 1e-15 && (dwm.end().right.0 - 0.15).abs() < 1e-15);
        let dwm = wheels.command(both(0.1, 0.2), Seconds(0.1)).expect("finite");
        assert_eq!(dwm.end(), both(0.1, 0.2), "what can be reached is reached");
        for beat in 2..20 {
            wheels.command(both(3.0, 1.5), Seconds(f64::from(beat) * 0.1)).expect("finite");
        }
        assert_eq!(wheels.last().end(), both(1.0, 0.5), "too fast a wheel slows both down");
        assert!(wheels.command(both(f64::NAN, 0.0), Seconds(2.0)).is_err());
        assert!(wheels.command(both(0.0, f64::INFINITY), Seconds(2.0)).is_err());
    }

    #[test]
    fn what_was_commanded_is_covered_between_any_two_times() {
        let mut wheels = Wheels::new(Drivetrain::default(), Seconds(0.1), Friction::new(0.06));
        assert_eq!(wheels.covered(Seconds(-1.0), Seconds(1.0)), Sides::new(0.0, 0.0));
        wheels.command(both(0.1, 0.1), Seconds(0.0)).expect("finite");
        wheels.command(both(0.1, 0.1), Seconds(0.1)).expect("finite");
        // 5 mm while speeding up, then 10 mm for every 0.1 s, held for one period more.
        for (from, to, distance) in [
            (-1.0, 0.1, 0.005),
            (0.05, 0.1, 0.00375),
            (0.1, 0.15, 0.005),
            (0.0, 0.2, 0.015),
            (0.2, 9.0, 0.01),
        ] {
            let covered = wheels.covered(Seconds(from), Seconds(to));
            assert!((covered.left - distance).abs() < 1e-12, "from {from} to {to}: {covered:?}");
        }
        let pose = wheels.pose_after(Pose::default(), Seconds(0.0), Seconds(0.2));
        assert!((pose.x.0 - 0.015).abs() < 1e-12 && pose.y.0.abs() < 1e-12);
    }
}
