//! Whether the filter knows what it does not know: NEES and NIS over 200 seeded runs.

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

use axle_navigator::{EkfParams, Event, Method, Navigator, NavigatorParams};
use axle_schema::{Metres, Radians};
use robot::{Robot, bounds, nees};

const RUNS: u32 = 200;

fn params() -> NavigatorParams {
    NavigatorParams {
        method: Method::Ekf,
        // The encoders of this robot have no ticks.
        tick: Metres(0.0),
        ekf: EkfParams {
            start_sd: Metres(0.05),
            start_heading_sd: Radians(0.1),
            gate: 0.0,
            ..EkfParams::default()
        },
        ..NavigatorParams::default()
    }
}

/// What many runs of a minute sum up to.
#[derive(Default, Debug)]
struct Sums {
    nees: f64,
    odom: f64,
    nis: f64,
    degrees: f64,
    slips: u32,
    worst: f64,
}

/// `late` is how many steps a fix comes late; `slips` lets a wheel slip on the way.
fn runs(params: &NavigatorParams, late: u32, slips: bool, gyro: bool) -> Sums {
    let mut sums = Sums::default();
    for seed in 0..RUNS {
        let mut robot = Robot::new(u64::from(seed) + 1, params);
        let mut navigator = Navigator::new(params.clone()).expect("valid");
        let origin = robot.truth;
        let _ = navigator.take(robot.encoders());
        for step in 1..=3000_u32 {
            let (left, right) = robot.winding();
            robot.slip = if slips && (1000..1040).contains(&step) { [0.0, 0.4] } else { [0.0; 2] };
            let [encoders, inertial] = robot.drive(left, right);
            if gyro {
                let _ = navigator.measure(&inertial);
            }
            let _ = navigator.measure(&encoders);
            // Later the heading in `odom` is so uncertain that no ellipse holds the positions.
            if step == 500 {
                let odom = navigator.position().expect("a position").odom;
                let moved = robot.truth.seen_from(origin);
                let truth = params.start.moved(moved.x, moved.y, moved.heading);
                sums.odom += nees(odom.pose, &odom.covariance.expect("one").0, truth);
            }
            if step % 50 == 0 {
                let _ = navigator.measure(&robot.fix(late, 0.02));
            }
        }
        let position = navigator.position().expect("a position");
        let here = nees(position.map, &position.map_covariance.0, robot.truth);
        sums.nees += here;
        sums.worst = sums.worst.max(position.map.distance(robot.truth).0);
        for innovation in navigator.innovations() {
            sums.nis += innovation.squared;
            sums.degrees += innovation.degrees as f64;
        }
        sums.slips += u32::from(navigator.events().iter().any(|event| matches!(event, Event::Slip { .. })));
    }
    sums
}

fn within(what: &str, sum: f64, degrees: f64) {
    let [low, high] = bounds(degrees);
    println!(
        "{what}: {:.3} a degree, 95 % within {:.3} to {:.3}",
        sum / degrees,
        low / degrees,
        high / degrees
    );
    assert!((low..=high).contains(&sum), "{what}: {sum:.1}, not within {low:.1} to {high:.1}");
}

#[test]
fn with_a_biased_gyro_and_fixes_the_covariance_is_honest() {
    let sums = runs(&params(), 0, false, true);
    within("NEES", sums.nees, f64::from(3 * RUNS));
    within("NEES of odom", sums.odom, f64::from(3 * RUNS));
    within("NIS", sums.nis, sums.degrees);
}

#[test]
fn with_fixes_that_come_late_it_is_as_honest() {
    let sums = runs(&params(), 13, false, true);
    within("NEES", sums.nees, f64::from(3 * RUNS));
    within("NIS", sums.nis, sums.degrees);
}

#[test]
fn without_a_gyro_it_is_honest_too() {
    let sums = runs(&params(), 0, false, false);
    within("NEES", sums.nees, f64::from(3 * RUNS));
    within("NEES of odom", sums.odom, f64::from(3 * RUNS));
    within("NIS", sums.nis, sums.degrees);
}

#[test]
fn with_an_accelerometer_it_is_honest_within_fifteen_per_cent() {
    // The noise is that of speeds which are measured: it does not grow with the way, and is as much at 0.4 m/s.
    let ekf = EkfParams {
        accelerometer_noise: 0.01,
        accelerometer_bias_sd: 0.1,
        wheel_noise: 0.006,
        ..params().ekf
    };
    let with = NavigatorParams { ekf, k: Metres(0.0), ..params() };
    let sums = runs(&with, 0, false, true);
    within("NIS", sums.nis, sums.degrees);
    // Neighbouring sums of the accelerometer have half a reading in common, which the filter does not know: it is honest,
    // but no closer than this.
    let degrees = f64::from(3 * RUNS);
    for (what, sum) in [("NEES", sums.nees), ("NEES of odom", sums.odom)] {
        println!("{what}: {:.3} a degree", sum / degrees);
        assert!((0.85..1.15).contains(&(sum / degrees)), "{what}: {sum:.1} of {degrees}");
    }
}

#[test]
fn a_slip_is_noticed_in_every_run_and_forgotten_by_the_next_fixes() {
    let sums = runs(&params(), 0, true, true);
    println!("{sums:?}");
    assert_eq!(sums.slips, RUNS);
    within("NEES", sums.nees, f64::from(3 * RUNS));
    // During the slip the distance is guessed from the turn; so the innovations right after it have no exact law.
    assert!((0.9..1.1).contains(&(sums.nis / sums.degrees)), "{}", sums.nis / sums.degrees);
}
