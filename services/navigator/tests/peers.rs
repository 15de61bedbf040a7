//! What the tests of other projects prove about a fusion of odometry and fixes (WPILib's pose estimator and filter, BSD-3-
//! Clause, at caf0fb2: the cases are theirs, the numbers are given again here, and no code of theirs is used).

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

mod robot;

use axle_navigator::{EkfParams, Measurement, Method, Navigator, NavigatorParams};
use axle_schema::{EncodersData, Fix, HeadingFix, Metres, Numbers, Pose, Radians, Seconds};
use robot::{DT, Robot, fix};

fn params(ekf: EkfParams) -> NavigatorParams {
    NavigatorParams { method: Method::Ekf, ekf, ..NavigatorParams::default() }
}

/// A way like theirs, a loop of metres with fixes of 10 cm that are 0.25 s old: mean, largest and last error.
fn course(seed: u64, start: Pose, ekf: EkfParams) -> [f64; 3] {
    let mut robot =
        Robot::new(seed, &params(EkfParams { start_sd: Metres(0.0), start_heading_sd: Radians(0.0), ..ekf }));
    let mut navigator = Navigator::new(NavigatorParams { start, ..params(ekf) }).expect("valid");
    let _ = navigator.take(robot.encoders());
    let (mut sum, mut worst, mut n) = (0.0, 0.0_f64, 0.0);
    for step in 1..=1000_u32 {
        let (left, right) = robot.winding();
        for measurement in robot.drive(left, right).iter().rev() {
            let _ = navigator.measure(measurement);
        }
        // Every 0.1 s.
        if step % 5 == 0 && step >= 13 {
            let _ = navigator.measure(&robot.fix(13, 0.1));
        }
        let miss = navigator.position().expect("one").map.distance(robot.truth).0;
        // A wrong start is given the time to be found.
        if start == Pose::default() || step > 500 {
            sum += miss;
            worst = worst.max(miss);
            n += 1.0;
        }
    }
    [sum / n, worst, navigator.position().expect("one").map.distance(robot.truth).0]
}

#[test]
fn fixes_of_the_past_count_at_their_own_time() {
    let ekf = EkfParams { start_sd: Metres(0.02), start_heading_sd: Radians(0.01), ..EkfParams::default() };
    for seed in 1..20 {
        let [mean, worst, last] = course(seed, Pose::default(), ekf);
        assert!(mean < 0.05 && worst < 0.2 && last < 0.08, "seed {seed}: {mean}, {worst}, {last} m");
    }
}

#[test]
fn a_wrong_start_is_forgotten_from_whatever_direction() {
    for direction in 0..8 {
        let heading = f64::from(direction) * std::f64::consts::FRAC_PI_4;
        let ekf = EkfParams { start_sd: Metres(2.0), start_heading_sd: Radians(3.0), ..EkfParams::default() };
        let [mean, worst, last] = course(21, Pose::new(heading.cos(), heading.sin(), heading), ekf);
        assert!(mean < 0.06 && worst < 0.2 && last < 0.08, "{heading} rad: {mean}, {worst}, {last} m");
    }
}

#[test]
fn contradicting_fixes_are_no_reason_to_believe_one_of_them() {
    let ekf = EkfParams {
        start_sd: Metres(0.1),
        start_heading_sd: Radians(0.1),
        gate: 0.0,
        ..EkfParams::default()
    };
    let start = Pose::new(1.0, 2.0, 270_f64.to_radians());
    let mut navigator = Navigator::new(NavigatorParams { start, ..params(ekf) }).expect("valid");
    let _ = navigator.take(EncodersData::default());
    let fixes = [[0.0, 0.0, 0.0_f64], [3.0, 1.0, 90.0], [2.0, 4.0, 180.0]];
    for _ in 0..1000 {
        for [x, y, degrees] in fixes {
            let heading = Some(HeadingFix { angle: Radians(degrees.to_radians()), variance: 0.2025 });
            let _ = navigator.measure(&Measurement::Fix(Fix { heading, ..fix(0.0, x, y, 0.45) }));
        }
    }
    let map = navigator.position().expect("one").map;
    for [x, y, _] in fixes {
        assert!(map.distance(Pose::new(x, y, 0.0)).0 > 0.08, "{map:?}");
    }
}

#[test]
fn the_past_is_interpolated_and_reckoned_again() {
    // Both wheels at 1 m/s from 1 s to 2 s; then a fix of 0.9 s, before everything, as good as the start is.
    let ekf = EkfParams { start_sd: Metres(1.0), start_heading_sd: Radians(0.0), ..EkfParams::default() };
    let mut navigator =
        Navigator::new(NavigatorParams { k: Metres(0.0), start: Pose::new(1.0, 0.0, 0.0), ..params(ekf) })
            .expect("valid");
    for n in 50..=100 {
        let t = f64::from(n) * DT;
        let _ = navigator.take(EncodersData { stamp: Seconds(t), left: Metres(t), right: Metres(t) });
    }
    let check = |navigator: &Navigator, y: f64| {
        for (t, x) in [(1.02, 1.02), (1.01, 1.01), (0.5, 1.0), (2.5, 2.0)] {
            let (odom, map) = navigator.poses_at(Seconds(t)).expect("remembered");
            assert!(map.distance(Pose::new(x, y, 0.0)).0 < 1e-9, "at {t} s: {map:?}");
            assert!(odom.distance(Pose::new(x, 0.0, 0.0)).0 < 1e-9, "odom stays");
        }
    };
    check(&navigator, 0.0);
    let covariance = Numbers([1.0, 0.0, 0.0, 1.0]);
    let before = Fix { stamp: Seconds(0.9), x: Metres(1.0), y: Metres(0.2), covariance, heading: None };
    let _ = navigator.measure(&Measurement::Fix(before));
    check(&navigator, 0.1);
    // The same message once more, as a buffer repeats it, changes nothing.
    let _ = navigator.measure(&Measurement::Fix(before));
    check(&navigator, 0.1);
}
