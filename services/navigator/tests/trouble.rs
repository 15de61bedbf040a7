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
use axle_schema::Boot;
use axle_schema::window::Window;
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

/// From where it believes to be to where it is.
fn miss(robot: &Robot, navigator: &Navigator) -> [f64; 2] {
    let map = navigator.position().expect("one").map;
    [robot.truth.x.0 - map.x.0, robot.truth.y.0 - map.y.0]
}

#[test]
fn wheels_that_slip_alike_are_told_by_the_accelerometer_only() {
    let with = EkfParams { accelerometer_noise: 0.01, wheel_noise: 0.002, ..params().ekf };
    let params = || NavigatorParams { k: Metres(0.0), ..params() };
    for seed in 1..20 {
        let mut far = [0.0; 2];
        for (far, ekf) in far.iter_mut().zip([with, params().ekf]) {
            let told = ekf.accelerometer_noise > 0.0;
            // Both robots have one; one filter does not use it.
            let mut robot = Robot::new(seed, &NavigatorParams { ekf: with, ..params() });
            let mut navigator = Navigator::new(NavigatorParams { ekf, ..params() }).expect("valid");
            let _ = navigator.take(robot.encoders());
            drive(&mut robot, &mut navigator, 500, false, Some);
            assert_eq!(navigator.events(), [], "seed {seed}");
            let before = miss(&robot, &navigator);
            // Straight on, so that the gyro feels nothing of it.
            robot.slip = [0.5; 2];
            for _ in 0..40 {
                for measurement in robot.drive(0.4, 0.4).into_iter().rev() {
                    let _ = navigator.measure(&measurement);
                }
            }
            robot.slip = [0.0; 2];
            let events = navigator.events();
            let skids = events.iter().filter(|event| matches!(event, Event::Skid { .. })).count();
            assert_eq!((skids, events.len()), (usize::from(told), skids), "seed {seed}: {events:?}");
            drive(&mut robot, &mut navigator, 50, false, Some);
            let after = miss(&robot, &navigator);
            *far = (after[0] - before[0]).hypot(after[1] - before[1]);
        }
        // Half of 0.32 m was not driven.
        assert!(far[1] > 0.12 && far[0] < 0.5 * far[1], "seed {seed}: {far:?} m");
    }
}

#[test]
fn lost_gyro_readings_are_no_slip() {
    for seed in 1..20 {
        let (mut robot, mut navigator) = begin(seed, &params());
        drive(&mut robot, &mut navigator, 500, false, Some);
        // Turns begin and end within the holes, as a robot's do when its computer is too busy: what the gyro says after a
        // hole is not what the robot did in it.
        for step in 0..2000_u32 {
            let turns = step % 20 < 8;
            let (left, right) = if turns { (0.1, 0.4) } else { (0.25, 0.25) };
            let is_lost = (3..11).contains(&(step % 20)) && step % 100 > 40;
            for measurement in robot.drive(left, right).into_iter().rev() {
                if !(is_lost && matches!(measurement, Measurement::Inertial(_))) {
                    let _ = navigator.measure(&measurement);
                }
            }
        }
        assert_eq!(navigator.events(), [], "seed {seed}");
    }
}

#[test]
fn coarse_ticks_are_no_slip() {
    // 1.3 cm from tick to tick and 0.4 m/s: every other reading has no tick, and the gyro turns smoothly.
    for seed in 1..20 {
        let coarse = NavigatorParams { tick: Metres(0.013), ..params() };
        let (mut robot, mut navigator) = begin(seed, &coarse);
        drive(&mut robot, &mut navigator, 3000, true, |measurement| Some(ticked(measurement, 0.013)));
        assert_eq!(navigator.events(), [], "seed {seed}");
    }
}

/// The encoders as they are read in whole ticks.
fn ticked(measurement: Measurement, tick: f64) -> Measurement {
    let cut = |way: Metres| Metres((way.0 / tick).floor() * tick);
    match measurement {
        Measurement::Encoders(data) => {
            Measurement::Encoders(EncodersData { left: cut(data.left), right: cut(data.right), ..data })
        }
        other => other,
    }
}

#[test]
fn a_robot_that_begins_to_move_within_a_tick_does_not_slip() {
    let felt = EkfParams { accelerometer_noise: 0.01, ..EkfParams::default() };
    for (seed, ekf) in (1..200).flat_map(|seed| [(seed, EkfParams::default()), (seed, felt)]) {
        // Wheels that stand do not tick, and of those that move only the ticks shall be noise.
        let ekf = EkfParams { wheel_noise: 1e-6, ..ekf };
        let quiet = NavigatorParams { k: Metres(1e-7), ekf, ..params() };
        let tick = quiet.tick.0;
        let (mut robot, mut navigator) = begin(seed, &quiet);
        drive(&mut robot, &mut navigator, 500, false, |measurement| Some(ticked(measurement, tick)));
        let mut step = |left: f64, right: f64| {
            for measurement in robot.drive(left, right).into_iter().rev() {
                let _ = navigator.measure(&ticked(measurement, tick));
            }
            navigator.events()
        };
        for slower in (0..50).rev() {
            let _ = step(0.4 * f64::from(slower) / 50.0, 0.4 * f64::from(slower) / 50.0);
        }
        for (acceleration, turns) in [1.5, 0.35, 0.11].into_iter().flat_map(|a| [(a, true), (a, false)]) {
            let sign = if turns { -1.0 } else { 1.0 };
            // It stands longer than what was driven before counts; then it gathers speed, and brakes as fast.
            for _ in 0..100 {
                let _ = step(0.0, 0.0);
            }
            for (at, now) in (0..10).chain((0..10).rev()).enumerate() {
                let speed = acceleration * robot::DT * f64::from(now);
                let events = step(sign * speed, speed);
                // Later the ticks of both wheels, which turn alike here, are no longer by chance.
                if at < 6 {
                    assert_eq!(events, [], "seed {seed}, {acceleration} m/s², turns: {turns}, step {at}");
                }
            }
        }
    }
}

#[test]
fn dead_reckoning_is_watched_as_well_and_stops_where_it_is_told() {
    for (watch, method) in [(true, Method::Arc), (true, Method::Ticks), (false, Method::Arc)] {
        let watched = NavigatorParams { method, watch, ..params() };
        let (mut robot, mut navigator) = begin(23, &watched);
        drive(&mut robot, &mut navigator, 500, false, Some);
        robot.slip = [0.0, 0.5];
        drive(&mut robot, &mut navigator, 50, false, Some);
        let events = navigator.events();
        assert_eq!(events.iter().any(|event| matches!(event, Event::Slip { .. })), watch, "{events:?}");
        assert!(events.iter().all(|event| navigator.stops(event)), "{events:?}");
    }
    let lenient = NavigatorParams { stop: vec!["kidnapped".into()], ..params() };
    let navigator = Navigator::new(lenient).expect("valid");
    let silent = Event::Silent { stamp: Seconds(1.0), sensor: Sensor::Encoders, since: Seconds(0.0) };
    assert!(!navigator.stops(&silent));
    let unknown = NavigatorParams { stop: vec!["kidnaped".into()], ..params() };
    let refused = Navigator::new(unknown).expect_err("a misspelt event").to_string();
    assert!(refused.contains("kidnaped") && refused.contains("kidnapped"), "{refused}");
}

#[test]
fn a_navigator_goes_on_where_another_one_was() {
    for method in Method::ALL {
        let all = NavigatorParams { method, ..params() };
        let (mut robot, mut first) = begin(29, &all);
        let mut before = Vec::new();
        drive(&mut robot, &mut first, 500, true, |measurement| {
            before.push(measurement);
            Some(measurement)
        });
        let _ = first.hear(&Window { boot: Boot(7), ..Window::default() });
        let last = first.position().expect("one");
        // Nobody but Source listens for a while; it has something of the time before as well.
        let mut since = Window { boot: Boot(7), ..Window::default() };
        let mut keep = |measurement: Measurement| match measurement {
            Measurement::Encoders(data) => since.encoders.push(data),
            Measurement::Inertial(data) => since.inertial.push(data),
            Measurement::Fix(fix) => since.fixes.push(fix),
            Measurement::Range(range) => since.ranges.push(range),
        };
        before.into_iter().for_each(&mut keep);
        for _ in 0..100 {
            let (left, right) = robot.winding();
            robot.drive(left, right).into_iter().rev().for_each(&mut keep);
        }
        let begins = Navigator::resume(all.clone(), &last, &Window::default()).expect("a position");
        let begins = begins.position().expect("one").map;
        assert!(begins.distance(last.map).0 < 1e-12, "{}: {begins:?}", method.name());
        let second = Navigator::resume(all.clone(), &last, &since).expect("a position");
        let _ = first.hear(&since);
        let [first, second] = [first, second].map(|navigator| navigator.position().expect("one"));
        let apart = first.map.distance(second.map).0.max(first.odom.pose.distance(second.odom.pose).0);
        // The bias of the gyro is to be learned again.
        assert!(apart < 0.02, "{}: {apart} m apart", method.name());
        assert!(second.map_covariance.0[0] > 0.5 * first.map_covariance.0[0], "it is no surer than before");
    }
    let nowhere = axle_schema::Position { map: Pose::new(f64::NAN, 0.0, 0.0), ..Default::default() };
    assert!(Navigator::resume(params(), &nowhere, &Window::default()).is_err());
}

#[test]
fn windows_of_another_run_of_the_robot_begin_anew() {
    let mut navigator = Navigator::new(params()).expect("valid");
    let at = |boot, stamp: f64, way: f64| Window {
        boot: Boot(boot),
        encoders: vec![EncodersData { stamp: Seconds(stamp), left: Metres(way), right: Metres(way) }],
        ..Window::default()
    };
    let _ = navigator.hear(&at(1, 1.0, 0.0));
    let here = navigator.hear(&at(1, 1.1, 0.05)).expect("a pose").pose;
    assert_eq!(navigator.hear(&at(1, 1.1, 0.05)), None, "a window that repeats says nothing new");
    // The robot was gone for so short a time that its stamps alone would tell nothing.
    let again = navigator.hear(&at(2, 1.15, 0.0)).expect("a pose").pose;
    assert!(again.distance(here).0 < 1e-12, "{again:?}");
    let next = navigator.hear(&at(2, 1.25, 0.05)).expect("a pose").pose;
    assert!((next.x.0 - here.x.0 - 0.05).abs() < 1e-12, "{next:?}");
    assert_eq!((navigator.counts().restarts, navigator.position().expect("one").boot), (1, Boot(2)));
}
