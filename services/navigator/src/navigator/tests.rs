//! The service, reading by reading.

use super::*;
use axle_schema::Metres;
use axle_schema::contract::Params as _;
use axle_schema::{MetresPerSecond, Numbers};

fn at(stamp: f64, left: f64, right: f64) -> EncodersData {
    EncodersData { stamp: Seconds(stamp), left: Metres(left), right: Metres(right) }
}
fn navigator() -> Navigator {
    Navigator::new(NavigatorParams::default()).expect("the defaults are within their ranges")
}

#[test]
fn the_parameter_file_holds_the_defaults() {
    let read: NavigatorParams = toml::from_str(NavigatorParams::FILE).expect("the file is valid");
    assert_eq!(read, NavigatorParams::default());
    let written = toml::Table::try_from(NavigatorParams::default()).expect("parameters are a table");
    let table: toml::Table = toml::from_str(NavigatorParams::FILE).expect("the file is a table");
    assert_eq!(table, written, "the file lists every field");
    let wrong = NavigatorParams { k: Metres(f64::NAN), ..NavigatorParams::default() };
    assert!(Navigator::new(wrong).expect_err("NaN is no noise").to_string().contains("k in m"));
}

#[test]
fn the_first_reading_is_the_anchor() {
    let start = Pose::new(1.0, 2.0, 0.5);
    let mut navigator =
        Navigator::new(NavigatorParams { start, ..NavigatorParams::default() }).expect("valid");
    let first = navigator.take(at(7.0, 100.0, -30.0)).expect("a first pose");
    assert_eq!((first.pose, first.stamp, first.twist), (start, Seconds(7.0), None));
    assert_eq!(first.covariance, Some(Numbers([0.0; 9])));
}

#[test]
fn a_quarter_of_a_circle_ends_where_the_arithmetic_says() {
    // Radius 0.5 m, 90 degrees to the left, track 0.3 m: wheels on 0.35 m and 0.65 m, in 20 readings of 0.1 s.
    let mut navigator = navigator();
    let mut last = None;
    for n in 0..=20 {
        let angle = f64::from(n) / 20.0 * std::f64::consts::FRAC_PI_2;
        last = navigator.take(at(f64::from(n) * 0.1, 0.35 * angle, 0.65 * angle));
    }
    let last = last.expect("a pose");
    assert!((last.pose.x.0 - 0.5).abs() < 1e-12 && (last.pose.y.0 - 0.5).abs() < 1e-12, "{:?}", last.pose);
    let twist = last.twist.expect("a twist");
    let rate = std::f64::consts::FRAC_PI_2 / 2.0;
    assert!((twist.omega.0 - rate).abs() < 1e-9 && (twist.v.0 - 0.5 * rate).abs() < 1e-9, "{twist:?}");
    assert!(last.check().is_ok(), "the datum may be sent");
}

#[test]
fn a_repeated_an_older_and_a_broken_reading_are_dropped_and_counted() {
    let mut navigator = navigator();
    assert!(navigator.take(at(5.0, 0.0, 0.0)).is_some());
    for wrong in
        [at(5.0, 0.01, 0.01), at(4.5, 0.01, 0.01), at(f64::NAN, 0.0, 0.0), at(6.0, f64::INFINITY, 0.0)]
    {
        assert_eq!(navigator.take(wrong), None, "{wrong:?}");
    }
    assert_eq!(navigator.counts(), Counts { stale: 4, ..Counts::default() });
    let next = navigator.take(at(5.1, 0.02, 0.02)).expect("the next reading counts");
    assert!((next.pose.x.0 - 0.02).abs() < 1e-15);
}

#[test]
fn a_restarted_robot_goes_on_from_where_it_was() {
    let mut navigator = navigator();
    let _ = navigator.take(at(100.0, 0.0, 0.0));
    let _ = navigator.take(at(100.1, 0.05, 0.05));
    let again = navigator.take(at(0.0, 0.0, 0.0)).expect("a new anchor");
    assert!((again.pose.x.0 - 0.05).abs() < 1e-15 && again.twist.is_none());
    let next = navigator.take(at(0.1, 0.01, 0.01)).expect("motion from there");
    assert!((next.pose.x.0 - 0.06).abs() < 1e-15);
    assert_eq!(navigator.counts(), Counts { restarts: 1, ..Counts::default() });
}

#[test]
fn a_reading_that_no_wheel_can_have_made_moves_nothing() {
    let mut navigator = navigator();
    let _ = navigator.take(at(0.0, 0.0, 0.0));
    // 1.5 times 1 m/s for 0.1 s and 0.05 m are 0.2 m.
    let jumped = navigator.take(at(0.1, 0.21, 0.0)).expect("a new anchor");
    assert_eq!((jumped.pose, jumped.twist), (Pose::default(), None));
    let next = navigator.take(at(0.2, 0.22, 0.01)).expect("motion from there");
    assert!((next.pose.x.0 - 0.01).abs() < 1e-15, "{:?}", next.pose);
    assert_eq!(next.twist.map(|twist| (twist.v - MetresPerSecond(0.1)).0.abs() < 1e-12), Some(true));
    assert_eq!(navigator.counts(), Counts { jumps: 1, ..Counts::default() });
}
