//! What goes wrong on a robot: each fault is noticed with its evidence, and none spoils the pose for good.

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

use axle_navigator::{
    Counts, EkfParams, Event, Measurement, Method, Navigator, NavigatorParams, Sensor, Side,
};
use axle_schema::{EncodersData, InertialData, Metres, Numbers, Pose, Radians, RadiansPerSecond, Seconds};
use robot::{Robot, fix};

fn params() -> NavigatorParams {
    NavigatorParams { method: Method::Ekf, ..NavigatorParams::default() }
}

/// Drives a robot on its winding way for some steps; `spoil` may change what is heard.
fn drive(
    robot: &mut Robot,
    navigator: &mut Navigator,
    steps: u32,
    fixes: bool,
    mut spoil: impl FnMut(Measurement) -> Option<Measurement>,
) {
    for _ in 0..steps {
        let (left, right) = robot.winding();
        let mut heard: Vec<_> = robot.drive(left, right).into_iter().rev().collect();
        if fixes && robot.step.is_multiple_of(25) {
            heard.push(robot.fix(0, 0.02));
        }
        for measurement in heard.into_iter().filter_map(&mut spoil) {
            let _ = navigator.measure(&measurement);
        }
    }
}

fn begin(seed: u64, params: &NavigatorParams) -> (Robot, Navigator) {
    let robot = Robot::new(seed, params);
    let mut navigator = Navigator::new(params.clone()).expect("valid");
    let _ = navigator.take(robot.encoders());
    (robot, navigator)
}

fn off(robot: &Robot, navigator: &Navigator) -> f64 {
    navigator.position().expect("a position").map.distance(robot.truth).0
}

#[test]
fn a_kidnapped_robot_is_found_again() {
    for seed in 1..20 {
        let (mut robot, mut navigator) = begin(seed, &params());
        drive(&mut robot, &mut navigator, 500, true, Some);
        assert!(off(&robot, &navigator) < 0.1 && navigator.events().is_empty());
        let from = robot.truth;
        robot.truth = Pose::new(from.x.0 + 4.0, from.y.0 - 3.0, from.heading.0 + 2.0);
        drive(&mut robot, &mut navigator, 1000, true, Some);
        let events = navigator.events();
        let Some(Event::Kidnapped { distance, fixes, squared, .. }) = events.first() else {
            panic!("seed {seed}: {events:?}")
        };
        assert!((4.0..6.0).contains(&distance.0) && *fixes >= 3 && *squared > 100.0, "{events:?}");
        let heading = (navigator.position().expect("one").map.heading - robot.truth.heading).wrapped().0;
        assert!(off(&robot, &navigator) < 0.1 && heading.abs() < 0.2, "seed {seed}: {heading} rad");
    }
}

#[test]
fn fixes_that_are_metres_off_are_not_believed() {
    let (mut robot, mut navigator) = begin(3, &params());
    let mut n = 0;
    drive(&mut robot, &mut navigator, 2000, true, |measurement| match measurement {
        Measurement::Fix(mut fix) => {
            n += 1;
            if n % 5 == 0 {
                fix.x += Metres(3.0 + f64::from(n % 7));
            }
            Some(Measurement::Fix(fix))
        }
        other => Some(other),
    });
    assert!(off(&robot, &navigator) < 0.1);
    assert_eq!(navigator.events(), []);
    assert!((16..20).contains(&navigator.counts().rejected), "{:?}", navigator.counts());
}

#[test]
fn a_gyro_in_degrees_is_recognised_and_left_out() {
    let (mut robot, mut navigator) = begin(5, &params());
    drive(&mut robot, &mut navigator, 1500, true, |measurement| match measurement {
        Measurement::Inertial(data) => {
            let gyro = RadiansPerSecond(data.gyro.0.to_degrees());
            Some(Measurement::Inertial(InertialData { gyro, ..data }))
        }
        other => Some(other),
    });
    let events = navigator.events();
    let ratio = events.iter().find_map(|event| match event {
        Event::GyroScale { ratio, .. } => Some(*ratio),
        _ => None,
    });
    // The wheels' own noise makes the ratio smaller than 57.3.
    assert!((30.0..65.0).contains(&ratio.expect("it is said")), "{events:?}");
    assert!(events[0].to_string().contains("degrees"), "{}", events[0]);
    assert!(off(&robot, &navigator) < 0.1);
}

#[test]
fn a_stuck_encoder_is_named() {
    let (mut robot, mut navigator) = begin(7, &params());
    drive(&mut robot, &mut navigator, 500, false, Some);
    let stuck = robot.encoders().left;
    drive(&mut robot, &mut navigator, 100, false, |measurement| match measurement {
        Measurement::Encoders(data) => Some(Measurement::Encoders(EncodersData { left: stuck, ..data })),
        other => Some(other),
    });
    let events = navigator.events();
    let named = events
        .iter()
        .any(|event| matches!(event, Event::StuckEncoder { side: Side::Left, other, .. } if other.0 >= 0.05));
    assert!(named, "{events:?}");
}

#[test]
fn a_sensor_that_falls_silent_is_named_once() {
    let (mut robot, mut navigator) = begin(9, &params());
    drive(&mut robot, &mut navigator, 200, false, Some);
    drive(&mut robot, &mut navigator, 300, false, |measurement| {
        matches!(measurement, Measurement::Encoders(_)).then_some(measurement)
    });
    let events = navigator.events();
    assert!(
        matches!(events[..], [Event::Silent { sensor: Sensor::Gyro, since: Seconds(4.0), .. }]),
        "{events:?}"
    );
}

#[test]
fn a_minute_without_data_makes_it_unsure_and_fixes_bring_it_back() {
    let (mut robot, mut navigator) = begin(11, &params());
    drive(&mut robot, &mut navigator, 500, true, Some);
    let sure = navigator.position().expect("one").map_covariance.0[0];
    drive(&mut robot, &mut navigator, 3000, true, |_| None);
    drive(&mut robot, &mut navigator, 1, false, Some);
    let unsure = navigator.position().expect("one").map_covariance.0[0];
    assert!(unsure > 1000.0 * sure, "variance of x: {sure}, then {unsure} m²");
    drive(&mut robot, &mut navigator, 1500, true, Some);
    assert!(off(&robot, &navigator) < 0.1, "off by {} m", off(&robot, &navigator));
}

#[test]
fn stamps_and_numbers_that_make_no_sense_do_no_harm() {
    for method in Method::ALL {
        let (mut robot, mut navigator) = begin(13, &NavigatorParams { method, ..params() });
        drive(&mut robot, &mut navigator, 100, false, Some);
        let before = navigator.position().expect("one").map;
        let here = robot.encoders();
        for stamp in [here.stamp.0, f64::NAN, f64::INFINITY, 1e300] {
            let _ = navigator.take(EncodersData { stamp: Seconds(stamp), ..here });
        }
        let _ = navigator.take(EncodersData { left: Metres(f64::NAN), ..here });
        for measurement in [
            Measurement::Fix(fix(2.0, f64::NAN, 0.0, 0.1)),
            Measurement::Fix(fix(2.0, 0.0, 0.0, 0.0)),
            Measurement::Inertial(InertialData {
                gyro: RadiansPerSecond(f64::NAN),
                ..InertialData::default()
            }),
        ] {
            assert!(navigator.measure(&measurement).is_none());
        }
        assert_eq!((navigator.counts().stale, navigator.counts().restarts), (8, 0), "{}", method.name());
        // The encoders begin anew, and the clock leaps by hours and comes back: motion counts from each new reading.
        for stamp in [here.stamp.0 + 7200.0, 0.5] {
            let _ =
                navigator.take(EncodersData { stamp: Seconds(stamp), left: Metres(0.0), right: Metres(0.0) });
        }
        assert_eq!(navigator.counts().restarts, 2, "{}", method.name());
        let after = navigator.position().expect("one");
        assert!(after.map.distance(before).0 < 1e-9, "{}: {after:?}", method.name());
        // A wrap of the counters within a span is a reading that no wheel can have made.
        let wrap = EncodersData { stamp: Seconds(0.52), left: Metres(-800.0), right: Metres(0.004) };
        let _ = navigator.take(wrap);
        let counts = navigator.counts();
        assert_eq!(counts.jumps, 1, "{}", method.name());
        assert!(navigator.position().expect("one").map.distance(before).0 < 1e-9);
        assert_ne!(counts, Counts::default());
    }
}

#[test]
fn setting_the_position_moves_map_and_not_odom() {
    for method in Method::ALL {
        let (mut robot, mut navigator) = begin(17, &NavigatorParams { method, ..params() });
        drive(&mut robot, &mut navigator, 300, false, Some);
        let then = navigator.position().expect("one");
        drive(&mut robot, &mut navigator, 50, false, Some);
        let before = navigator.position().expect("one");
        // It is told where it was a second ago.
        let there = Pose::new(10.0, -5.0, 1.0);
        let p = Numbers([1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-4]);
        navigator.set_position(then.odom.stamp, there, &p).expect("within its memory");
        let after = navigator.position().expect("one");
        assert_eq!(after.odom.pose, before.odom.pose, "{}", method.name());
        let moved = before.odom.pose.seen_from(then.odom.pose);
        let expected = there.moved(moved.x, moved.y, moved.heading);
        assert!(after.map.distance(expected).0 < 1e-2, "{}: {after:?}, not {expected:?}", method.name());
        assert!(after.map_covariance.0[0] < before.map_covariance.0[0].max(0.01), "uncertainty restarts");
        let by_origin =
            after.map_to_odom.moved(after.odom.pose.x, after.odom.pose.y, after.odom.pose.heading);
        assert!(by_origin.distance(after.map).0 < 1e-9);
        // What came before is obsolete.
        assert!(navigator.set_position(Seconds(1.0), there, &p).is_err(), "{}", method.name());
        let wrong = Numbers([1.0, 2.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        assert!(navigator.set_position(after.odom.stamp, there, &wrong).is_err());
    }
}

#[test]
fn without_a_gyro_the_heading_is_unknown_until_the_robot_drives() {
    let ekf = EkfParams { start_sd: Metres(1.0), start_heading_sd: Radians(3.0), ..EkfParams::default() };
    let wrong = NavigatorParams { ekf, ..params() };
    for seed in 1..30 {
        let (mut robot, mut navigator) = begin(seed, &wrong);
        let no_gyro = |measurement| (!matches!(measurement, Measurement::Inertial(_))).then_some(measurement);
        for _ in 0..500 {
            let _ = robot.drive(0.0, 0.0);
            if robot.step.is_multiple_of(25) {
                let _ = navigator.measure(&robot.fix(0, 0.02));
            }
            let _ = navigator.take(robot.encoders());
        }
        let standing = navigator.position().expect("one").map_covariance.0[8].sqrt();
        assert!(standing > 1.5, "ten seconds of fixes told a standing robot its heading: {standing} rad");
        drive(&mut robot, &mut navigator, 1000, true, no_gyro);
        let position = navigator.position().expect("one");
        let sd = position.map_covariance.0[8].sqrt();
        let error = (position.map.heading - robot.truth.heading).wrapped().0;
        assert!(sd < 0.15 && error.abs() < 4.0 * sd, "seed {seed}: {error} rad, said {sd}");
        assert!(off(&robot, &navigator) < 0.15, "seed {seed}: off by {} m", off(&robot, &navigator));
        // Without fixes nothing holds it.
        drive(&mut robot, &mut navigator, 3000, false, no_gyro);
        let later = navigator.position().expect("one").map_covariance.0[8].sqrt();
        assert!(later > 2.0 * sd, "seed {seed}: {sd}, then {later} rad");
    }
}
