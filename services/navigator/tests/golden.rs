//! The three integrators of the literature, as methods of the navigator, against the golden poses.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test ends at what is not as it should be, and says what it measured"
)]
#![allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers, and the very same bits"
)]

use axle_navigator::{Method, Navigator, NavigatorParams};
use axle_schema::{Drivetrain, EncodersData, Metres, MetresPerSecond, Pose, Seconds, Track};
use serde_json::Value;

#[test]
fn arc_point_and_shoot_and_half_turn_are_the_golden_ones() {
    let golden = include_str!("../../../schema/tests/data/golden_odometry.jsonl");
    let mut checked = 0;
    for line in golden.lines() {
        let case: Value = serde_json::from_str(line).expect("JSON");
        let number = |value: &Value| value.as_f64().expect("a number");
        let list = |value: &Value| value.as_array().expect("a list").iter().map(number).collect::<Vec<_>>();
        let start = list(&case["start"]);
        let start = Pose::new(start[0], start[1], start[2]);
        // The parameters refuse a start that is farther away than any robot.
        if start.x.0.abs().max(start.y.0.abs()) > 1e5 {
            continue;
        }
        let tolerance =
            1e-12 * (1.0 + start.x.0.hypot(start.y.0) + start.heading.0.abs() + number(&case["wheel_path"]));
        let index = list(&case["index"]);
        for (method, name) in
            [(Method::Arc, "exact"), (Method::PointAndShoot, "p6"), (Method::HalfTurn, "brown")]
        {
            let track = Track::new(Metres(number(&case["track"]))).expect("a track");
            let robot = Drivetrain { track, wheel_speed: MetresPerSecond(20.0), ..Drivetrain::default() };
            let params =
                NavigatorParams { method, start, robot, jump: Metres(10.0), ..NavigatorParams::default() };
            let mut navigator = Navigator::new(params).expect("valid");
            let mut datum = EncodersData::default();
            let mut poses = vec![];
            let _ = navigator.take(datum);
            for step in case["steps"].as_array().expect("steps") {
                let step = list(step);
                datum.stamp += Seconds(500.0);
                datum.left += Metres(step[0]);
                datum.right += Metres(step[1]);
                poses.push(navigator.take(datum).expect("a pose").pose);
            }
            assert_eq!(navigator.counts(), axle_navigator::Counts::default());
            for (at, pose) in index.iter().zip(case[name].as_array().expect("poses")) {
                let (ours, golden) = (poses[*at as usize], list(pose));
                let miss = (ours.x.0 - golden[0])
                    .hypot(ours.y.0 - golden[1])
                    .max((ours.heading.0 - golden[2]).abs());
                assert!(
                    miss <= tolerance,
                    "{} {name} {at}: misses by {miss}, {tolerance} allowed",
                    case["category"]
                );
                checked += 1;
            }
        }
    }
    assert!(checked > 500, "only {checked} poses");
}
