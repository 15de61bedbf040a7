//! The D-corrector, beat by beat; whole courses are in tests/closed_loop.

use super::*;
use axle_schema::TaskId;

fn task(dwms: Vec<Dwm>) -> Task<Drive> {
    Task { id: TaskId(1), plan: Drive { dwms, ..Drive::default() } }
}
fn seen(at: f64, stamp: f64, left: f64, right: f64) -> Seen {
    let encoders = EncodersData { stamp: Seconds(stamp), left: Metres(left), right: Metres(right) };
    Seen { at: Seconds(at), encoders: Some(encoders), ..Seen::default() }
}
fn begin(params: &DParams, dwms: Vec<Dwm>) -> Result<DCorrector, Refusal> {
    DCorrector::begin(params, params.period, task(dwms), &seen(0.0, 0.0, 0.0, 0.0))
}
fn fails(step: &Step, words: &str) {
    let Step::Fail(refusal) = step else { panic!("{step:?} does not fail") };
    assert!(refusal.to_string().contains(words), "{refusal} does not say {words:?}");
}

#[test]
fn the_parameter_file_holds_the_defaults() {
    let read: DParams = toml::from_str(DParams::FILE).expect("the file is valid");
    assert_eq!(read, DParams::default());
    let written = toml::Table::try_from(DParams::default()).expect("parameters are a table");
    let table: toml::Table = toml::from_str(DParams::FILE).expect("the file is a table");
    assert_eq!(table, written, "the file lists every field");
    for pole in [-0.1, 1.0, f64::NAN] {
        let wrong = begin(&DParams { pole, ..DParams::default() }, vec![]);
        assert!(wrong.expect_err("no such pole").to_string().contains("pole"));
    }
}

#[test]
fn an_error_fades_with_the_double_pole() {
    // The plant of model.md 4.5: e' = e - (w + w')ΔT/2, without delay. Then e(i+2) = 2p e(i+1) - p² e(i).
    for pole in [0.0, 0.5, 0.7] {
        let params = DParams { pole, lead: Seconds::ZERO, ..DParams::default() };
        let mut corrector = begin(&params, vec![Dwm::rest(Seconds(100.0))]).expect("a plan");
        let mut real = -0.002;
        let mut errors = Vec::new();
        for beat in 1..10 {
            errors.push(-real);
            let time = f64::from(beat) * 0.05;
            let Step::Drive(dwm) = corrector.step(&seen(time, time, real, 0.0)) else { panic!("it goes on") };
            real += dwm.encoders_span().left.0;
            assert!(dwm.encoders_span().right.0.abs() < 1e-15, "the right wheel has no error");
        }
        for e in errors.windows(3) {
            assert!((e[2] - 2.0 * pole * e[1] + pole * pole * e[0]).abs() < 1e-12, "pole {pole}: {errors:?}");
        }
    }
}

#[test]
fn an_empty_plan_is_done_at_the_first_beat() {
    let mut corrector = begin(&DParams::default(), vec![]).expect("nothing to drive is no fault");
    assert_eq!(corrector.step(&seen(0.05, 0.05, 0.0, 0.0)), Step::Done);
    assert!((corrector.account().fraction - 1.0).abs() < 1e-15);
}

#[test]
fn a_task_without_measurements_is_refused_with_what_to_start() {
    let nothing = DCorrector::begin(&DParams::default(), Seconds(0.05), task(vec![]), &Seen::default());
    let words = nothing.expect_err("nothing is seen").to_string();
    assert!(words.contains("unavailable") && words.contains("start the robot or the emulator"), "{words}");
}

#[test]
fn silence_and_a_restart_fail_with_the_reason() {
    let long = vec![Dwm::rest(Seconds(100.0))];
    let mut corrector = begin(&DParams::default(), long.clone()).expect("a plan");
    assert!(matches!(corrector.step(&seen(0.45, 0.0, 0.0, 0.0)), Step::Drive(_)));
    fails(&corrector.step(&seen(0.55, 0.0, 0.0, 0.0)), "no measurement for 0.55 s");
    fails(&corrector.step(&Seen { at: Seconds(f64::NAN), ..Seen::default() }), "no measurement");

    let mut corrector = begin(&DParams::default(), long).expect("a plan");
    assert!(matches!(corrector.step(&seen(0.05, 0.9, 0.0, 0.0)), Step::Drive(_)));
    assert!(matches!(corrector.step(&seen(0.10, 0.8, 5.0, 5.0)), Step::Drive(_)), "an old one is not used");
    fails(
        &corrector.step(&seen(0.15, -2.0, 0.0, 0.0)),
        "the robot restarted: its clock went back from 0.900 s to -2.000 s",
    );
}

#[test]
fn a_broken_measurement_is_passed_over_and_three_of_them_are_too_much() {
    let mut corrector = begin(&DParams::default(), vec![Dwm::rest(Seconds(100.0))]).expect("a plan");
    for time in [0.05, 0.1] {
        let step = corrector.step(&seen(time, time, 0.0, f64::NAN));
        assert!(matches!(step, Step::Drive(dwm) if dwm.peak_speed() == MetresPerSecond::ZERO));
    }
    fails(&corrector.step(&seen(0.15, 0.15, 0.0, f64::NAN)), "cannot be believed");
}

#[test]
fn the_law_of_the_paper_rings_and_the_damped_one_does_not() {
    // A constant demand of 0.2 m/s, that begins while the robot stands: the paper's answer is 0.4, 0, 0.4, 0 m/s.
    let both = Sides::new(MetresPerSecond(0.2), MetresPerSecond(0.2));
    let plan = || {
        vec![
            Dwm::steady(both, Seconds(5.0)).expect("finite"),
            Dwm::new(both, Sides::default(), Seconds(1.0)).expect("finite"),
        ]
    };
    for (law, rings) in [(Law::Paper, true), (Law::Damped, false)] {
        let robot = Drivetrain {
            wheel_acceleration: axle_schema::MetresPerSecondSquared(50.0),
            ..Drivetrain::default()
        };
        let params = DParams { law, robot, lead: Seconds::ZERO, ..DParams::default() };
        let mut corrector = begin(&params, plan()).expect("a plan");
        // It begins at rest.
        corrector.last = Dwm::rest(Seconds::ZERO);
        let (mut real, mut speeds) = (0.0, Vec::new());
        for beat in 1..80 {
            let time = f64::from(beat) * 0.05;
            let Step::Drive(dwm) = corrector.step(&seen(time, time, real, real)) else {
                panic!("it goes on")
            };
            real += dwm.encoders_span().left.0;
            speeds.push(dwm.end().left.0);
        }
        let leap = speeds[70..].windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        assert_eq!(leap > 0.1, rings, "{law:?}: {:?}", &speeds[70..]);
    }
}

#[test]
fn the_sum_of_the_paper_stands_while_a_limit_holds_the_wheels_back() {
    let gains = Gains { integral: 5.0, ..Gains::default() };
    let params = DParams { law: Law::Paper, gains, ..DParams::default() };
    let mut corrector = begin(&params, vec![Dwm::rest(Seconds(100.0))]).expect("a plan");
    for beat in 1..=4 {
        let time = f64::from(beat) * 0.05;
        assert!(matches!(corrector.step(&seen(time, time, -0.2, -0.2)), Step::Drive(_)));
    }
    // 0.2 m are far more than the wheels can do in a beat: only the first beat, before any limit, has counted.
    assert!((corrector.sum.left - 0.2 * 0.05).abs() < 1e-12, "{:?}", corrector.sum);
}

#[test]
fn gains_of_zero_and_below_are_refused() {
    for proportional in [0.0, -1.0, f64::NAN] {
        let gains = Gains { proportional, ..Gains::default() };
        let wrong = begin(&DParams { gains, ..DParams::default() }, vec![]);
        assert!(wrong.expect_err("no such gain").to_string().contains("gains.proportional"));
    }
}
