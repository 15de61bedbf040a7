//! Proofs in virtual time on the emulator, whose truth is known.

use crate::rig::{Rig, room};
use axle_emulator::{
    BoardParams, EmulatorParams, EncodersParams, GyroParams, MotorsParams, Random, WheelsParams,
};
use axle_robot::{BoardKind, RobotParams};
use axle_schema::calibration::Wiring;
use axle_schema::{Metres, MetresPerSecond, RadiansPerSecond, Seconds, Sides};
use std::collections::BTreeMap;

/// A robot with faults of usual size, drawn from the seed; every noise of the shipped emulator is on.
fn faulty(seed: u64) -> EmulatorParams {
    let mut random = Random::new(seed, 100);
    let mut around = |middle: f64, off: f64| middle + off * (2.0 * random.uniform() - 1.0);
    let size = around(1.0, 0.015);
    EmulatorParams {
        seed,
        motors: MotorsParams {
            gain: Sides::new(around(1.0, 0.08), around(1.0, 0.08)),
            gain_deviation: 0.0,
            backward: Sides::new(around(0.97, 0.03), around(0.97, 0.03)),
            dead_band: MetresPerSecond(around(0.03, 0.02)),
            breakaway: Sides::new(MetresPerSecond(around(0.05, 0.03)), MetresPerSecond(around(0.05, 0.03))),
            lag: Seconds(around(0.06, 0.03)),
            ..MotorsParams::default()
        },
        // What no turn can tell, the mean size of the wheels, is as described.
        wheels: WheelsParams { track: around(1.0, 0.06), size: Sides::new(size, 2.0 - size) },
        gyro: GyroParams { bias: RadiansPerSecond(around(0.0, 0.02)), ..GyroParams::default() },
        ..EmulatorParams::default()
    }
}

/// What a perfect calibration of this robot finds.
fn truth(params: &EmulatorParams) -> BTreeMap<String, f64> {
    let full = params.robot.wheel_speed.0 * 1.2;
    let mut truth = BTreeMap::new();
    for (side, gain, backward, breakaway, size) in [
        (
            "left",
            params.motors.gain.left,
            params.motors.backward.left,
            params.motors.breakaway.left,
            params.wheels.size.left,
        ),
        (
            "right",
            params.motors.gain.right,
            params.motors.backward.right,
            params.motors.breakaway.right,
            params.wheels.size.right,
        ),
    ] {
        for (way, gain) in [("forward", gain), ("backward", gain * backward)] {
            let kv = size / (gain * full);
            let band = params.motors.dead_band.0;
            truth.insert(format!("{side} {way} dead band"), breakaway.0.max(band) / full);
            truth.insert(format!("{side} {way} ks"), band / full);
            truth.insert(format!("{side} {way} kv"), kv);
            truth.insert(format!("{side} {way} ka"), kv * params.motors.lag.0);
        }
    }
    let track = params.robot.track.get() * params.wheels.track;
    truth.insert("wheel ratio".into(), params.wheels.size.right / params.wheels.size.left);
    for name in ["track", "track by squares", "track by turns"] {
        truth.insert(name.into(), track);
    }
    truth
}

#[test]
fn intervals_hold_the_truth_in_nine_of_ten_of_a_hundred_runs() {
    let mut held: BTreeMap<String, (u32, f64)> = BTreeMap::new();
    for seed in 0..100 {
        let params = faulty(seed);
        let (_, report) = Rig::new(params, None).calibrate(room(2.0), 5).expect("a calibration");
        let truth = truth(&params);
        assert_eq!(report.quantities.len(), truth.len(), "{report:?}");
        for quantity in &report.quantities {
            let real = truth[&quantity.name];
            let (count, width) = held.entry(quantity.name.clone()).or_default();
            *count += u32::from(quantity.estimate.holds(real));
            *width += (quantity.estimate.high - quantity.estimate.low) / 2.0 / 100.0;
        }
    }
    for (name, (count, width)) in &held {
        println!("{name}: {count} of 100, half an interval is {width:.5}");
    }
    assert!(held.values().all(|(count, _)| *count >= 90), "{held:?}");
}

#[test]
fn a_calibrated_square_closes_five_times_better() {
    let (mut before, mut after) = (0.0, 0.0);
    for seed in 0..10 {
        let params = faulty(seed);
        let (calibration, report) = Rig::new(params, None).calibrate(room(2.0), 5).expect("a calibration");
        for left in [true, false] {
            let raw = Rig::new(params, None).square(1.0, left);
            let calibrated = Rig::new(params, Some(calibration.clone())).square(1.0, left);
            before += raw.0.powi(2);
            after += calibrated.0.powi(2);
        }
        let (was, is) = report.worst_square().expect("squares");
        assert!(is < was, "the report says so too: {was} m, then {is} m");
    }
    let (before, after) = ((before / 20.0_f64).sqrt(), (after / 20.0_f64).sqrt());
    println!("squares of 1 m miss their start by {before:.4} m, calibrated by {after:.4} m");
    assert!(after * 5.0 < before, "{before} m, calibrated {after} m");
}

#[test]
fn a_calibrated_robot_does_what_the_gate_asks_of_its_wheels() {
    use axle_schema::Dwm;
    let params = faulty(3);
    let (calibration, _) = Rig::new(params, None).calibrate(room(2.0), 4).expect("a calibration");
    let goes = |calibration| {
        let mut rig = Rig::new(params, calibration);
        for beat in 0..40_u32 {
            let speed = |beat: u32| MetresPerSecond((f64::from(beat) * 0.05).min(0.4));
            let (from, to) = (speed(beat), speed(beat + 1));
            rig.command(Dwm::new(Sides::new(from, from), Sides::new(to, to), Seconds(0.05)).expect("finite"));
            (0..10).for_each(|_| rig.beat());
        }
        rig.place()
    };
    // Up to 0.4 m/s within 0.4 s, and 1.6 s of it: 0.72 m.
    let (raw, calibrated) = (goes(None), goes(Some(calibration)));
    assert!((raw.x.0 - 0.72).abs() > 0.02, "{raw:?}");
    assert!((calibrated.x.0 - 0.72).abs() < 0.006 && calibrated.heading.0.abs() < 0.03, "{calibrated:?}");
}

#[test]
fn crossed_cables_are_found_and_the_rest_is_measured_all_the_same() {
    let crossed = |swapped, left, right| Wiring { swapped, inverted: Sides::new(left, right) };
    for (motors, encoders) in [
        (crossed(true, false, false), crossed(false, false, false)),
        (crossed(false, true, false), crossed(true, false, true)),
        (crossed(true, true, true), crossed(true, false, false)),
    ] {
        let mut params = faulty(5);
        params.motors.wiring = motors;
        params.encoders.wiring = encoders;
        let (calibration, report) = Rig::new(params, None).calibrate(room(2.0), 2).expect("a calibration");
        assert_eq!((calibration.motors, calibration.encoders), (motors, encoders), "{:?}", report.findings);
        assert!(!report.findings.is_empty());
        let kv = report.find("left forward kv").expect("a number").estimate.value;
        assert!((kv - truth(&params)["left forward kv"]).abs() < 0.03 * kv, "{kv}");
        let (end, heading) = Rig::new(params, Some(calibration)).square(0.5, true);
        assert!(end < 0.02 && heading.abs() < 0.03, "{end} m, {heading} rad");
    }
}

#[test]
fn the_robot_stays_in_its_room_and_ends_in_the_middle() {
    let params = faulty(8);
    let mut rig = Rig::new(params, None);
    rig.calibrate(room(1.4), 3).expect("a calibration");
    let place = rig.place();
    assert!(place.x.0.hypot(place.y.0) < 0.06, "{place:?}");
}

#[test]
fn a_closet_a_dead_wheel_and_a_robot_that_falls_silent_are_refused() {
    let params = faulty(1);
    let said = Rig::new(params, None).calibrate(room(1.0), 3).expect_err("too small").to_string();
    assert!(said.contains("at least"), "{said}");
    let mut dead = params;
    dead.motors.breakaway.left = MetresPerSecond(0.5);
    let said = Rig::new(dead, None).calibrate(room(2.0), 3).expect_err("a dead motor").to_string();
    assert!(said.contains("left motor"), "{said}");
    let mut procedure =
        crate::Procedure::new(Rig::new(params, None).subject(room(2.0), 3)).expect("a procedure");
    let mut actions = (0..40_u32).map(|beat| procedure.beat(Seconds(f64::from(beat) * 0.05)));
    assert!(actions.any(|action| matches!(action, crate::Action::Fail(_))), "nothing was ever heard");
}

#[test]
fn without_noise_ticks_alone_are_no_excuse() {
    let mut params = faulty(2);
    params.motors.jitter = Metres::ZERO;
    params.gyro = GyroParams { noise_deviation: RadiansPerSecond::ZERO, ..params.gyro };
    params.encoders = EncodersParams { tick: Metres(0.002), ..EncodersParams::default() };
    let (_, report) = Rig::new(params, None).calibrate(room(2.0), 4).expect("a calibration");
    for quantity in &report.quantities {
        let (real, estimate) = (truth(&params)[&quantity.name], quantity.estimate);
        let half = (estimate.high - estimate.low) / 2.0;
        assert!((estimate.value - real).abs() < 3.0 * half + 1e-9, "{quantity:?}, and really {real}");
    }
}

/// A board that is told powers, and the faulty robot that it drives.
fn on_a_board(seed: u64) -> (EmulatorParams, RobotParams) {
    let full_speed = MetresPerSecond(1.2);
    let board = BoardParams { full_speed: Some(full_speed), ..BoardParams::default() };
    let mut robot = RobotParams::default();
    (robot.arduino.powers, robot.roomba.powers, robot.eddie.powers) = (true, true, true);
    robot.dwm_text.powers = true;
    (robot.roomba.full_speed, robot.orfa.full_speed) = (full_speed, full_speed);
    (EmulatorParams { board, ..faulty(seed) }, robot)
}

/// How often the intervals of these runs hold the truth, and the sum of half of each, by number.
fn held_on_a_board(
    kind: BoardKind,
    seeds: std::ops::Range<u64>,
    by_hand: bool,
) -> BTreeMap<String, (u32, f64)> {
    let mut held: BTreeMap<String, (u32, f64)> = BTreeMap::new();
    for seed in seeds {
        let (params, robot) = on_a_board(seed);
        let mut rig = Rig::with_board(params, None, (kind, robot));
        if by_hand {
            rig = rig.by_hand();
        }
        let (_, report) = rig.calibrate(room(2.0), 5).unwrap_or_else(|why| panic!("{kind:?} {seed}: {why}"));
        let truth = truth(&params);
        for quantity in &report.quantities {
            let (count, width) = held.entry(quantity.name.clone()).or_default();
            *count += u32::from(quantity.estimate.holds(truth[&quantity.name]));
            *width += (quantity.estimate.high - quantity.estimate.low) / 2.0;
        }
    }
    held
}

#[test]
fn over_a_serial_line_the_intervals_hold_the_truth_as_well() {
    // The board of text has a gyroscope; of the others a person measures the squares.
    let (mut all, mut held) = (0, 0);
    for kind in [BoardKind::DwmText, BoardKind::Arduino, BoardKind::Roomba, BoardKind::Eddie] {
        for (name, (count, width)) in held_on_a_board(kind, 0..3, kind != BoardKind::DwmText) {
            println!("{kind:?} {name}: {count} of 3, half an interval is {:.5}", width / 3.0);
            // What the line delays is part of ka, and the emulator knows nothing of it.
            if !name.ends_with("ka") {
                (all, held) = (all + 3, held + count);
            }
        }
    }
    assert_eq!(all, 3 * (3 * 14 + 16), "every number was measured");
    assert!(f64::from(held) >= 0.9 * f64::from(all), "{held} of {all}");
}
