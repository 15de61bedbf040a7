//! The D-corrector on whole courses.

use super::plant::{Course, IDEAL, Plant, REAL, STEP, drive, run, way};
use axle_correctors::{DCorrector, DParams};
use axle_schema::{Seconds, Sides};

const LINE: &str = "1.3,0";
const SQUARE: &str = "1,0 1,1 0,1 0,0";
const TURN: &str = "0,0,2.5";

/// The course of a typed way, and how long its drive takes, s.
fn course(params: &DParams, plant: Plant, typed: &str) -> (Course, f64) {
    let path = way(typed);
    let drive = drive(&path);
    (run::<DCorrector>(params, params.period, plant, &path, &drive), drive.duration.0)
}

fn reached((course, duration): &(Course, f64), worst: f64, what: &str) {
    assert!(course.result.is_ok(), "{what}: {course:?}");
    assert!(course.end <= 0.0021 && course.worst < worst, "{what}: {course:?}");
    // A wheel that has gone back for a millimetre rests for a second before it goes back again.
    assert!(course.reversals <= 1 && course.time - duration < 3.0, "{what}: {course:?}");
}

#[test]
fn an_ideal_robot_is_led_along_its_plan_to_the_millimetre() {
    let params = DParams { lead: Seconds(0.01), ..DParams::default() };
    for way in [LINE, SQUARE, TURN] {
        reached(&course(&params, IDEAL, way), 0.005, way);
    }
}

#[test]
fn the_defaults_converge_without_ringing_for_delays_of_up_to_two_periods() {
    for way in [LINE, SQUARE, TURN] {
        for (up, down) in [(0, 0), (2, 3), (4, 6), (6, 9), (8, 12)] {
            for motor in [0.0, 0.04] {
                for gain in [Sides::new(1.03, 0.97), Sides::new(0.97, 0.97), Sides::new(1.03, 1.03)] {
                    let course = course(&DParams::default(), Plant { up, down, motor, gain, ..REAL }, way);
                    let delay = (up + down) as f64 * STEP;
                    reached(&course, 0.05, &format!("{way}, delay {delay} s, motors {motor} s, {gain:?}"));
                }
            }
        }
    }
}

#[test]
fn a_short_silence_and_missed_beats_are_survived() {
    let gap = Plant { mute: (1.0, 1.4), ..REAL };
    reached(&course(&DParams::default(), gap, SQUARE), 0.06, "0.4 s without measurements");
    let lazy = Plant { missed: 4, ..REAL };
    reached(&course(&DParams::default(), lazy, SQUARE), 0.06, "every fourth beat is missed");
}

#[test]
fn other_periods_converge_as_well() {
    for period in [0.02, 0.1] {
        let params = DParams { period: Seconds(period), ..DParams::default() };
        let plant = Plant { up: 2, down: 2, ..REAL };
        reached(&course(&params, plant, SQUARE), 0.06, &format!("period {period} s"));
    }
}

#[test]
fn a_robot_that_does_not_do_what_it_is_told_fails_with_the_reason() {
    let check = |plant: Plant, way: &str, words: &str| {
        let (course, _) = course(&DParams::default(), plant, way);
        let refusal = course.result.expect_err(words).to_string();
        assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
    };
    check(Plant { gain: Sides::new(1.0, 0.0), ..REAL }, LINE, "the right wheel does not follow: it is 0.3");
    check(Plant { gain: Sides::new(-1.0, 1.0), ..REAL }, LINE, "the left wheel does not follow");
    check(Plant { mute: (1.0, f64::INFINITY), ..REAL }, LINE, "no measurement for 0.5");
    check(Plant { gain: Sides::new(0.0, 0.0), ..REAL }, "0.1,0", "still 0.10");
}
