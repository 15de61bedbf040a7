//! A plan as a robot drives it: paths without a stop, and turns on the spot between them.

use crate::path::{Limits, Path};
use axle_schema::refusal::within;
use axle_schema::{Geometry, Message as _, Plan, Pose, Radians, Refusal};

/// A robot that stands farther than this from the start of its plan, in m and rad, has another plan.
const ELSEWHERE: (f64, f64) = (0.1, 0.3);

/// A part of a route; the robot stands between two of them.
#[derive(Clone, Debug)]
pub(crate) enum Part {
    /// On the spot.
    Turn {
        /// The heading before, as planned.
        from: Radians,
        /// Positive to the left.
        angle: Radians,
        /// It may miss its heading by so much, rad, where that is more than the tolerance.
        loose: f64,
    },
    /// Along a path.
    Way(Path),
}

/// The parts of a plan; neighbours are taken together where that is possible, and what goes nowhere is left out.
///
/// `jump` is what a wheel may change at once at a joint of two pieces, m/s.
///
/// # Errors
/// Names what is wrong with a plan.
pub(crate) fn parts(plan: &Plan, limits: &Limits, jump: f64) -> Result<Vec<Part>, Refusal> {
    plan.check()?;
    plan.start.check()?;
    let mut parts: Vec<Part> = Vec::new();
    let mut at = plan.start;
    for leg in &plan.legs {
        let geometry = match leg.geometry {
            // A circle of no radius is a turn on the spot (model.md 4.1).
            Geometry::Arc { radius, angle } if radius.0.abs() <= 0.0 => Geometry::Turn { angle },
            other => other,
        };
        let goes_on = match parts.last_mut() {
            Some(Part::Way(path)) => path.extend(at, leg, limits),
            Some(Part::Turn { angle: sum, .. }) => {
                if let Geometry::Turn { angle } = geometry {
                    *sum += angle;
                }
                matches!(geometry, Geometry::Turn { .. })
            }
            None => false,
        };
        match geometry {
            _ if goes_on => {}
            Geometry::Turn { angle } if angle.0.abs() > 0.0 => {
                parts.push(Part::Turn { from: at.heading, angle, loose: 0.0 });
            }
            Geometry::Turn { .. } => {}
            _ => parts.extend(Path::begin(at, leg, limits).map(Part::Way)),
        }
        at = leg.geometry.end_from(at);
        at.check()?;
    }
    for part in &mut parts {
        if let Part::Way(path) = part {
            path.limit(limits, jump);
        }
    }
    Ok(parts)
}

/// Refuses a plan that begins elsewhere than the robot is.
///
/// # Errors
/// Says how far away it is.
pub(crate) fn check_start(start: Pose, robot: Pose) -> Result<(), Refusal> {
    let hint = "have it planned from where the robot is";
    let (far, turned) = ELSEWHERE;
    within(
        &format!("distance in m of the robot from the start of its plan ({hint})"),
        start.distance(robot).0,
        0.0,
        far,
    )?;
    let angle = (robot.heading - start.heading).wrapped().0;
    within(&format!("heading in rad of the robot at the start of its plan ({hint})"), angle, -turned, turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Drivetrain, Leg, Metres};

    fn plan(geometries: &[Geometry]) -> Plan {
        let legs = geometries.iter().map(|&geometry| Leg { geometry, point: 0, speed: None }).collect();
        Plan { legs, ..Plan::default() }
    }

    #[test]
    fn legs_are_taken_together_until_the_robot_must_stand() {
        let line = |length| Geometry::Line { length: Metres(length) };
        let turn = |angle| Geometry::Turn { angle: Radians(angle) };
        let arc = Geometry::Arc { radius: Metres(1.0), angle: Radians(1.0) };
        let limits = Limits { robot: Drivetrain::default(), effort: 0.8, turn: f64::INFINITY };
        let plan = plan(&[turn(0.0), line(1.0), arc, line(0.0), line(-0.5), turn(1.0), turn(0.5), line(1.0)]);
        let parts = parts(&plan, &limits, 0.1).expect("a route");
        let words: Vec<String> = parts
            .iter()
            .map(|part| match part {
                Part::Turn { angle, .. } => format!("turn {}", angle.0),
                Part::Way(path) => format!("{} pieces, forward {}", path.pieces.len(), path.forward),
            })
            .collect();
        assert_eq!(
            words,
            ["2 pieces, forward true", "1 pieces, forward false", "turn 1.5", "1 pieces, forward true"]
        );
        assert!(super::parts(&self::plan(&[line(f64::NAN)]), &limits, 0.1).is_err());
    }

    #[test]
    fn a_plan_from_elsewhere_is_refused_with_the_distance() {
        let start = Pose::new(1.0, 2.0, 3.0);
        assert!(check_start(start, Pose::new(1.05, 2.0, 3.0 - std::f64::consts::TAU)).is_ok());
        let far = check_start(start, Pose::new(1.5, 2.0, 3.0)).expect_err("half a metre").to_string();
        assert!(far.contains("0.5") && far.contains("planned from where the robot is"), "{far}");
        assert!(
            check_start(start, Pose::new(1.0, 2.0, 2.0)).is_err()
                && check_start(start, Pose::new(f64::NAN, 0.0, 0.0)).is_err()
        );
    }
}
