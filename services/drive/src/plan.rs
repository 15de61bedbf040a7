//! The movements of an operation, and how speeds change from beat to beat.

use crate::DriveParams;
use crate::say::Stages;
use axle_schema::dwm::MAX_DURATION;
use axle_schema::{Drive, Dwm, Metres, MetresPerSecond, Refusal, Seconds, Sides};

/// A way shorter than this needs no movement, m.
const NOTHING: f64 = 1e-9;

/// Speeding up, cruising and braking over the way of an operation; `None` where there is no way to go.
///
/// Both wheels go equally far, so the acceleration limit is reached by both: v the speed, a the acceleration,
/// d the way; v²/a is what speeding up and braking need, and below that the robot turns to braking half-way.
///
/// # Errors
/// Refuses a power that never arrives.
pub(crate) fn plan(stages: &Stages, params: &DriveParams) -> Result<Option<Drive>, Refusal> {
    let way = stages.way(params.robot.track.get());
    let d = way.left.abs().0;
    if d <= NOTHING {
        return Ok(None);
    }
    let a = params.robot.wheel_acceleration.0;
    let v = (params.full_speed().0 * stages.power()).min((d * a).sqrt());
    let cruise = (d - v * v / a) / v;
    // Written so that a division by 0 fails as well.
    if !(0.0..=MAX_DURATION).contains(&(cruise.max(0.0) + 2.0 * v / a)) {
        let limit = "so much power that it takes an hour at most";
        return Err(Refusal::out_of_range("power of a distance or a turn", stages.power(), limit));
    }
    let rest = Sides::default();
    let fast = way.map(|way: Metres| MetresPerSecond(v * way.0.signum()));
    let mut dwms = vec![Dwm::new(rest, fast, Seconds(v / a))?];
    if cruise > 1e-6 {
        dwms.push(Dwm::steady(fast, Seconds(cruise))?);
    }
    dwms.push(Dwm::new(fast, rest, Seconds(v / a))?);
    let counts = dwms.iter().map(|_| 1).collect();
    let duration = dwms.iter().map(Dwm::duration).sum();
    Ok(Some(Drive { dwms, counts, jump: MetresPerSecond::ZERO, duration, ..Drive::default() }))
}

/// The speeds after moving from `from` toward `target`, where no wheel changes by more than `change`. Both wheels go
/// the same share of their way, so that the path bends as little as possible.
pub(crate) fn toward(
    from: Sides<MetresPerSecond>,
    target: Sides<MetresPerSecond>,
    change: MetresPerSecond,
) -> Sides<MetresPerSecond> {
    let way = from.zip(target, |from, to| to - from);
    let longest = way.left.abs().max(way.right.abs());
    if longest <= change {
        return target;
    }
    from.zip(way, |from, way| from + way * (change / longest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::Duty;
    use axle_schema::differential_drive::{DriveDistance, DriveStage, RotateDegrees};

    fn duty(power: f64) -> Duty {
        Duty::new(power).expect("within full power")
    }
    fn distance(distance: f64, power: f64) -> Stages {
        let (distance, power, stage) = (Metres(distance), duty(power), DriveStage::InitialRequest);
        Stages::Distance(DriveDistance { distance, power, stage, operation: None, why: None })
    }
    fn rotate(degrees: f64, power: f64) -> Stages {
        let (power, stage) = (duty(power), DriveStage::InitialRequest);
        Stages::Rotate(RotateDegrees { degrees, power, stage, operation: None, why: None })
    }
    fn covered(stages: &Stages) -> (usize, f64, f64) {
        let drive = plan(stages, &DriveParams::default()).expect("a plan").expect("a way");
        let span = drive.dwms.iter().fold(Sides::default(), |sum: Sides<Metres>, dwm| {
            sum.zip(dwm.encoders_span().sides(), |sum, way| sum + way)
        });
        assert!(drive.dwms.windows(2).all(|pair| pair[0].end() == pair[1].start()), "without a jump");
        (drive.dwms.len(), span.left.0, span.right.0)
    }

    #[test]
    fn an_operation_covers_its_way() {
        let near = |(n, left, right): (usize, f64, f64), expected: (usize, f64, f64)| {
            assert_eq!(n, expected.0);
            assert!(
                (left - expected.1).abs() < 1e-12 && (right - expected.2).abs() < 1e-12,
                "{left} {right}"
            );
        };
        near(covered(&distance(1.5, 0.5)), (3, 1.5, 1.5));
        near(covered(&distance(1.5, -0.5)), (3, -1.5, -1.5));
        // 0.8 m/s at 1.5 m/s² needs 0.43 m: 0.1 m is driven without cruising.
        near(covered(&distance(0.1, 1.0)), (2, 0.1, 0.1));
        // A quarter of a circle of 0.15 m radius.
        let quarter = 0.15 * std::f64::consts::FRAC_PI_2;
        near(covered(&rotate(90.0, 0.2)), (3, -quarter, quarter));
        near(covered(&rotate(-90.0, -0.2)), (3, quarter, -quarter));
    }

    #[test]
    fn nothing_to_drive_is_no_plan_and_no_power_never_arrives() {
        let params = DriveParams::default();
        assert_eq!(plan(&distance(0.0, 0.0), &params), Ok(None));
        assert_eq!(plan(&rotate(0.0, 1.0), &params), Ok(None));
        for stages in [distance(1.0, 0.0), rotate(90.0, 0.0), distance(1000.0, 0.001)] {
            let refusal = plan(&stages, &params).expect_err("it never arrives").to_string();
            assert!(refusal.contains("power"), "{refusal}");
        }
    }

    #[test]
    fn both_wheels_go_the_same_share_of_their_way() {
        let speeds = |left, right| Sides::new(MetresPerSecond(left), MetresPerSecond(right));
        assert_eq!(toward(speeds(0.0, 0.0), speeds(0.4, -0.8), MetresPerSecond(0.1)), speeds(0.05, -0.1));
        assert_eq!(toward(speeds(0.35, -0.7), speeds(0.4, -0.8), MetresPerSecond(0.2)), speeds(0.4, -0.8));
    }
}
