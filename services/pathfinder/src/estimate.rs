//! How long a plan takes, estimated: within the limits of the robot, at rest only where it must be.
//!
//! The robot must rest before and behind every turn on the spot and wherever it goes over from forward to backward. In
//! between it runs at the speed that each leg allows. What the joints of arcs and lines cost is Pathdriver's decision;
//! here they cost the time of going over from one speed to the other.

use axle_schema::{Drivetrain, Geometry, Leg, Seconds};

/// The time for all legs.
pub(crate) fn time(legs: &[Leg], robot: &Drivetrain) -> Seconds {
    let mut total = 0.0;
    let mut run: Vec<(f64, f64)> = Vec::new();
    let mut forward = true;
    for leg in legs {
        let (length, curvature) = match leg.geometry {
            Geometry::Line { length } => (length.0, 0.0),
            Geometry::Arc { radius, angle } if radius.0.abs() > 0.0 => (radius.0 * angle.0, 1.0 / radius.0),
            Geometry::Turn { angle } | Geometry::Arc { angle, .. } => {
                total += run_time(&run, robot) + turn_time(angle.0.abs(), robot);
                run.clear();
                continue;
            }
        };
        if !run.is_empty() && (length > 0.0) != forward {
            total += run_time(&run, robot);
            run.clear();
        }
        forward = length > 0.0;
        run.push((length.abs(), speed(leg, curvature.abs(), robot)));
    }
    Seconds(total + run_time(&run, robot))
}

/// How fast the middle of the axle may run on a leg.
fn speed(leg: &Leg, curvature: f64, robot: &Drivetrain) -> f64 {
    let own = leg.speed.map_or(robot.speed.0, |speed| speed.0.min(robot.speed.0));
    let outer = robot.wheel_speed.0 / (1.0 + curvature * robot.track.get() / 2.0);
    let turning = if curvature > 0.0 { robot.turn_rate.0 / curvature } else { f64::INFINITY };
    own.min(outer).min(turning)
}

/// A turn on the spot from rest to rest.
fn turn_time(angle: f64, robot: &Drivetrain) -> f64 {
    let half = robot.track.get() / 2.0;
    rest_to_rest(angle * half, robot.wheel_speed.0.min(robot.turn_rate.0 * half), robot.wheel_acceleration.0)
}

fn rest_to_rest(length: f64, speed: f64, acceleration: f64) -> f64 {
    if length >= speed * speed / acceleration {
        length / speed + speed / acceleration
    } else {
        2.0 * (length / acceleration).sqrt()
    }
}

/// Legs one after the other without a rest: forth and back over the speeds at their joints (model.md, 4.4).
#[allow(clippy::indexing_slicing, reason = "joints are counted here")]
fn run_time(legs: &[(f64, f64)], robot: &Drivetrain) -> f64 {
    let a = robot.wheel_acceleration.0;
    // Squares of the speeds at the joints, limited by the legs on both sides; at the ends the robot rests.
    let mut joints = vec![0.0; legs.len() + 1];
    for (joint, pair) in legs.windows(2).enumerate() {
        joints[joint + 1] = pair[0].1.min(pair[1].1).powi(2);
    }
    for (joint, &(length, _)) in legs.iter().enumerate().rev() {
        joints[joint] = f64::min(joints[joint], joints[joint + 1] + 2.0 * a * length);
    }
    for (joint, &(length, _)) in legs.iter().enumerate() {
        joints[joint + 1] = f64::min(joints[joint + 1], joints[joint] + 2.0 * a * length);
    }
    let times = legs.iter().zip(joints.windows(2)).map(|(&(length, speed), ends)| {
        let peak = (a * length + f64::midpoint(ends[0], ends[1])).min(speed * speed).sqrt();
        let steady = (length - (2.0 * peak * peak - ends[0] - ends[1]) / (2.0 * a)).max(0.0);
        (2.0 * peak - ends[0].sqrt() - ends[1].sqrt()) / a + if peak > 0.0 { steady / peak } else { 0.0 }
    });
    times.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Metres, MetresPerSecond, MetresPerSecondSquared, Radians};

    #[test]
    fn single_legs_take_the_time_of_the_model() {
        let robot = Drivetrain {
            wheel_speed: MetresPerSecond(1.0),
            wheel_acceleration: MetresPerSecondSquared(1.5),
            speed: MetresPerSecond(0.8),
            ..Drivetrain::default()
        };
        let leg = |geometry| Leg { geometry, point: 0, speed: None };
        let line = |length| leg(Geometry::Line { length: Metres(length) });
        let check = |legs: &[Leg], seconds: f64| {
            let found = time(legs, &robot).0;
            assert!((found - seconds).abs() < 1e-9, "{found} s, not {seconds} s");
        };
        // model.md 4.4, "Single-segment checks".
        check(&[line(1.0)], 2.0 * 0.533_333_333_333_333_3 + 0.716_666_666_666_666_7);
        check(&[line(0.2)], 2.0 * (0.2_f64 / 1.5).sqrt());
        // Two halves are as long as the whole, and there and back is twice as long.
        check(&[line(0.5), line(0.5)], 2.0 * 0.533_333_333_333_333_3 + 0.716_666_666_666_666_7);
        check(&[line(0.2), line(-0.2)], 4.0 * (0.2_f64 / 1.5).sqrt());
        // A quarter turn: 0.2356 m at each wheel, at most 2 rad/s · 0.15 m = 0.3 m/s.
        let quarter = std::f64::consts::FRAC_PI_2;
        check(&[leg(Geometry::Turn { angle: Radians(-quarter) })], quarter * 0.15 / 0.3 + 0.3 / 1.5);
        check(&[], 0.0);
    }
}
