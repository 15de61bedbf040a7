//! Whole plans: the golden one of the model, and the laws that every drive obeys.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by a panic")]

use axle_pathdriver::{Pathdriver, PathdriverParams, Strategy as Planned};
use axle_schema::contract::Functional as _;
use axle_schema::{
    Drive, DriveAsk, Drivetrain, Geometry, Leg, Message as _, Metres, MetresPerSecond,
    MetresPerSecondSquared, Pose, Radians, RadiansPerSecond, Sides, Track,
};
use proptest::prelude::*;
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn leg(geometry: Geometry) -> Leg {
    Leg { geometry, point: 0, speed: None }
}

fn answer(effort: f64, robot: Drivetrain, legs: Vec<Leg>) -> Drive {
    let params = PathdriverParams { effort, ..PathdriverParams::default() };
    let ask = DriveAsk { legs, robot: Some(robot), ..DriveAsk::default() };
    Pathdriver::answer(&params, &ask).expect("a plan that can be driven")
}

/// Where the robot ends. Every movement of "stop" has one ratio of its wheels, so that the arc is exact.
fn end(drive: &Drive, track: Track) -> Pose {
    drive.dwms.iter().fold(Pose::default(), |pose, dwm| {
        let span = dwm.encoders_span().navigator_span(track);
        pose.moved(span.x, span.y, span.heading)
    })
}

fn golden_leg(value: &Value) -> Leg {
    let size = |index: usize| number(&value[index]);
    leg(match value[0].as_str().expect("a kind") {
        "line" => Geometry::Line { length: Metres(size(1)) },
        "turn" => Geometry::Turn { angle: Radians(size(1)) },
        "arc" => Geometry::Arc { radius: Metres(size(1)), angle: Radians(size(2)) },
        kind => panic!("unknown geometry {kind}"),
    })
}

#[test]
fn the_golden_plans_are_driven_as_the_model_computes_them() {
    let cases: Value = serde_json::from_str(include_str!("data/golden_plan.json")).expect("valid JSON");
    let jumps: Vec<f64> =
        cases.as_array().expect("a list").iter().map(|case| number(&case["jump"])).collect();
    assert_eq!(jumps, [0.0, 0.15], "the first case stops after every leg, the second goes on");
    for (case, strategy) in cases.as_array().expect("a list").iter().zip([Planned::Stop, Planned::Continuous])
    {
        golden(case, strategy);
    }
}

fn golden(case: &Value, strategy: Planned) {
    let limits = &case["limits"];
    let robot = Drivetrain {
        track: Track::new(Metres(number(&case["track"]))).expect("a track"),
        wheel_speed: MetresPerSecond(number(&limits["v_wheel"])),
        wheel_acceleration: MetresPerSecondSquared(number(&limits["a_wheel"])),
        speed: MetresPerSecond(number(&limits["v_lin"])),
        turn_rate: RadiansPerSecond(number(&limits["omega"])),
    };
    let legs: Vec<Leg> = case["geometries"].as_array().expect("a list").iter().map(golden_leg).collect();
    let params = PathdriverParams {
        strategy,
        jump: MetresPerSecond(number(&case["jump"])),
        effort: 1.0,
        ..PathdriverParams::default()
    };
    let ask = DriveAsk { legs, robot: Some(robot), ..DriveAsk::default() };
    let drive = Pathdriver::answer(&params, &ask).expect("a plan that can be driven");

    let golden = case["dwms"].as_array().expect("a list");
    assert_eq!(drive.dwms.len(), golden.len());
    for (dwm, row) in drive.dwms.iter().zip(golden) {
        let (start, end) = (dwm.start(), dwm.end());
        let got = [start.left.0, start.right.0, end.left.0, end.right.0, dwm.duration().0];
        for (index, got) in got.into_iter().enumerate() {
            assert!((got - number(&row[index + 1])).abs() < 1e-12, "{dwm:?} is not {row}");
        }
    }
    let counted =
        drive.counts.iter().enumerate().flat_map(|(leg, &count)| std::iter::repeat_n(leg, count as usize));
    assert!(counted.zip(golden).all(|(leg, row)| row[0].as_u64() == Some(leg as u64)));
    assert!((drive.duration.0 - number(&case["total_T"])).abs() < 1e-12, "{}", drive.duration);
    let (end, pose) = (end(&drive, robot.track), &case["end_pose"]);
    for (got, index) in [(end.x.0, 0), (end.y.0, 1), (end.heading.0, 2)] {
        assert!((got - number(&pose[index])).abs() < 1e-12, "ends at {end:?}, not {pose}");
    }
    // The joints of line and arc reach 0.5 m/s, where each wheel jumps by all that is allowed.
    assert!((drive.jump.0 - number(&case["jump"])).abs() < 1e-12, "{}", drive.jump);
}

#[test]
fn the_longest_plan_makes_an_answer_that_may_be_sent() {
    let legs = vec![leg(Geometry::Line { length: Metres(1.234_567_890_123) }); axle_schema::plan::MAX_LEGS];
    let drive = answer(0.8, Drivetrain::default(), legs);
    assert!(drive.check().is_ok());
    let size = axle_schema::encode(&drive).expect("a drive that can be written").len();
    assert!(size < Drive::LIMIT, "{size} bytes");
}

fn any_geometry() -> impl Strategy<Value = Geometry> {
    prop_oneof![
        (-3.0..3.0).prop_map(|length| Geometry::Line { length: Metres(length) }),
        (-7.0..7.0).prop_map(|angle| Geometry::Turn { angle: Radians(angle) }),
        (-2.0..2.0, -4.0..4.0)
            .prop_map(|(radius, angle)| Geometry::Arc { radius: Metres(radius), angle: Radians(angle) }),
    ]
}

proptest! {
    #[test]
    fn no_drive_exceeds_a_limit_or_jumps_and_it_ends_where_its_legs_end(
        geometries in proptest::collection::vec(any_geometry(), 0..20),
        speeds in proptest::collection::vec(proptest::option::of(0.01..2.0), 20),
        effort in 0.05..1.0,
        (track, wheel_speed, acceleration, speed, turn_rate) in (0.05..1.0, 0.1..2.0, 0.2..5.0, 0.1..2.0, 0.2..6.0),
    ) {
        let robot = Drivetrain {
            track: Track::new(Metres(track)).expect("a track"),
            wheel_speed: MetresPerSecond(wheel_speed),
            wheel_acceleration: MetresPerSecondSquared(acceleration),
            speed: MetresPerSecond(speed),
            turn_rate: RadiansPerSecond(turn_rate),
        };
        let legs: Vec<Leg> = geometries
            .iter()
            .zip(&speeds)
            .map(|(&geometry, speed)| Leg { geometry, point: 0, speed: speed.map(MetresPerSecond) })
            .collect();
        let drive = answer(effort, robot, legs.clone());

        let slack = 1.0 + 1e-9;
        let mut last = Sides::<MetresPerSecond>::default();
        let owners = drive.counts.iter().enumerate().flat_map(|(leg, &n)| std::iter::repeat_n(leg, n as usize));
        for (dwm, owner) in drive.dwms.iter().zip(owners) {
            prop_assert!(dwm.peak_speed().0 <= wheel_speed * effort * slack);
            for a in dwm.accelerations().both() {
                prop_assert!(a.0.abs() <= acceleration * effort * (1.0 + 1e-6), "{a} in {dwm:?}");
            }
            for at in [dwm.start(), dwm.end()] {
                let v = (at.left.0 + at.right.0).abs() / 2.0;
                let asked = legs[owner].speed.map_or(f64::INFINITY, |speed| speed.0);
                prop_assert!(v <= asked.min(speed * effort) * slack);
                prop_assert!((at.right.0 - at.left.0).abs() / track <= turn_rate * effort * slack);
            }
            let jump = last.zip(dwm.start(), |before, after| (before - after).abs().0);
            prop_assert!(jump.left <= 1e-12 && jump.right <= 1e-12, "{jump:?} before {dwm:?}");
            last = dwm.end();
        }
        prop_assert_eq!(last, Sides::default(), "the last movement ends at rest");

        let sum: f64 = drive.dwms.iter().map(|dwm| dwm.duration().0).sum();
        prop_assert!((drive.duration.0 - sum).abs() <= 1e-12 * (1.0 + sum));
        let due = geometries.iter().fold(Pose::default(), |pose, geometry| geometry.end_from(pose));
        let end = end(&drive, robot.track);
        prop_assert!(end.distance(due).0 < 1e-9 && (end.heading.0 - due.heading.0).abs() < 1e-9);
    }
}
