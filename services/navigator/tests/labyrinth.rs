//! A real robot: the labyrinth log, which tests/data/README.md describes, against what others reach on it.

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

use axle_navigator::{EkfParams, Measurement, Method, Navigator, NavigatorParams, Range};
use axle_schema::{
    Drivetrain, EncodersData, Metres, MetresPerSecond, Pose, Radians, RadiansPerSecond, Seconds, Track,
};
use serde_json::Value;

/// Root mean square and largest error of the position.
fn errors(params: NavigatorParams) -> (f64, f64) {
    let mut navigator = Navigator::new(params).expect("valid");
    let (mut sum, mut worst, mut n) = (0.0, 0.0_f64, 0.0);
    for line in include_str!("data/labyrinth/labyrinth.jsonl").lines().skip(1) {
        let value: Value = serde_json::from_str(line).expect("JSON");
        let of = |what: &str, name: &str| value[what][name].as_f64().expect("a number");
        let stamp = Seconds(value["stamp"].as_f64().expect("a stamp"));
        let (left, right) = (Metres(of("encoders", "left")), Metres(of("encoders", "right")));
        let _ = navigator.take(EncodersData { stamp, left, right });
        let _ = navigator.measure(&Measurement::Range(Range {
            stamp,
            x: Metres(of("range", "x")),
            y: Metres(of("range", "y")),
            distance: Metres(of("range", "distance")),
            sd: Metres(of("range", "sd")),
        }));
        let map = navigator.position().expect("a position").map;
        let miss = map.distance(Pose::new(of("truth", "x"), of("truth", "y"), 0.0)).0;
        sum += miss * miss;
        worst = worst.max(miss);
        n += 1.0;
    }
    assert!(n > 232.0, "{n} lines");
    ((sum / n).sqrt(), worst)
}

fn params(method: Method, heading: f64, ekf: EkfParams) -> NavigatorParams {
    NavigatorParams {
        method,
        start: Pose::new(1.652_054_748_535_16, 2.219_178_009_033_2, heading),
        robot: Drivetrain {
            track: Track::new(Metres(0.157)).expect("a track"),
            wheel_speed: MetresPerSecond(2.0),
            turn_rate: RadiansPerSecond(10.0),
            ..Drivetrain::default()
        },
        ekf,
        ..NavigatorParams::default()
    }
}

#[test]
fn dead_reckoning_is_as_good_as_it_gets_there() {
    for method in [Method::Arc, Method::HalfTurn, Method::Accelerated, Method::Ticks, Method::Ekf] {
        let ekf = EkfParams { gate: 1e-9, ..EkfParams::default() };
        let (rms, worst) = errors(params(method, 2.989, ekf));
        println!("{}: {rms:.4} m, at most {worst:.4} m", method.name());
        assert!(rms < 0.0605, "{}: {rms} m; others reach 0.059 m", method.name());
    }
}

#[test]
fn ranges_do_not_spoil_it() {
    // What the log's own baseline tells the filter, and everything else as it is shipped: the baseline is 0.070 m, and
    // 0.181 m at most.
    let told = EkfParams {
        start_sd: Metres(0.01),
        start_heading_sd: Radians(0.05),
        range_bias: Metres(0.10),
        ..EkfParams::default()
    };
    // A gate as the baseline has it, and none; neither with an elbow.
    let nine = EkfParams { gate: 9.0 * 13.8 / 10.8, range_elbow: 0.0, ..told };
    let without = EkfParams { range_elbow: 0.0, ..told };
    for (what, ekf, allowed) in
        [("shipped", told, 0.067), ("gate 9", nine, 0.0715), ("no elbow", without, 0.0725)]
    {
        let (rms, worst) = errors(params(Method::Ekf, 3.0, ekf));
        println!("{what}: {rms:.4} m, at most {worst:.4} m");
        assert!(rms <= allowed && worst <= 0.181, "{what}: {rms} m, at most {worst} m");
    }
}
