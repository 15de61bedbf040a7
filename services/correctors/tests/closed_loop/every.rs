//! Every corrector on every course, with every robot.

use super::plant::{
    Course, IDEAL, Plant, REAL, STEP, arc, courses, drive, line, obeys_limits, plan, run, turn, way,
};
use axle_correctors::g::Feedback;
use axle_correctors::w::{Driver, Field};
use axle_correctors::{
    ArcCorrector, ArcParams, DCorrector, DParams, GCorrector, GParams, LtvCorrector, LtvParams,
    PursuitCorrector, PursuitParams, WCorrector, WParams,
};
use axle_schema::contract::Corrector;
use axle_schema::{Drive, Plan, Pose, Seconds, Sides};

/// Drives a plan with beats of a length, and a robot.
type Drives = Box<dyn Fn(Seconds, Plant, &Plan) -> Course>;

/// A corrector with its parameters, whatever kind of plan it takes.
struct Runner {
    name: &'static str,
    drive: Drives,
    /// How far from its goal it may end with an ideal robot and with a real one, m; and how far astray on the way, m.
    ends: (f64, f64),
    astray: f64,
    /// How often a wheel may change its direction in the last second.
    reversals: usize,
}

fn on_plans<C: Corrector<Plan = Plan>>(
    name: &'static str,
    params: C::Params,
    ends: (f64, f64),
    astray: f64,
) -> Runner {
    let drive = Box::new(move |period, plant, path: &Plan| run::<C>(&params, period, plant, path, path));
    Runner { name, drive, ends, astray, reversals: 1 }
}
fn on_drives<C: Corrector<Plan = Drive>>(
    name: &'static str,
    params: C::Params,
    ends: (f64, f64),
    astray: f64,
) -> Runner {
    let drive =
        Box::new(move |period, plant, path: &Plan| run::<C>(&params, period, plant, path, &drive(path)));
    Runner { name, drive, ends, astray, reversals: 1 }
}

/// All of them, in all their variants. Those that know the wheels only cannot see where they went astray; those that
/// drive to points leave the arcs of a plan.
fn runners() -> Vec<Runner> {
    let w = |field, driver| WParams { field, driver, ..WParams::default() };
    let (paper, gyro) = (Driver::Multiplicative, GParams { feedback: Feedback::Gyro, ..GParams::default() });
    let mut runners = vec![
        on_drives::<DCorrector>("d", DParams::default(), (0.006, 0.1), 0.1),
        on_plans::<GCorrector>("g", GParams::default(), (0.006, 0.1), 0.1),
        on_plans::<GCorrector>("g by gyro", gyro, (0.015, 0.1), 0.1),
        on_plans::<WCorrector>("w, path, smooth", w(Field::Path, Driver::Smooth), (0.006, 0.015), 0.05),
        on_plans::<WCorrector>("w, path, multiplicative", w(Field::Path, paper), (0.02, 0.03), 0.1),
        on_plans::<WCorrector>("w, points, smooth", w(Field::Points, Driver::Smooth), (0.01, 0.02), 0.2),
        on_plans::<WCorrector>("w, points, multiplicative", w(Field::Points, paper), (0.01, 0.02), 0.2),
        on_plans::<ArcCorrector>("arc", ArcParams::default(), (0.006, 0.015), 0.2),
        on_plans::<PursuitCorrector>("pursuit", PursuitParams::default(), (0.006, 0.015), 0.05),
        on_drives::<LtvCorrector>("ltv", LtvParams::default(), (0.006, 0.015), 0.05),
    ];
    // Not what is shipped: the paper's driver comes to the last point from any side, backs when it has gone too far, and
    // turns on the spot at the end.
    runners
        .iter_mut()
        .filter(|runner| runner.name == "w, points, multiplicative")
        .for_each(|w| w.reversals = 2);
    runners
}

const BEAT: Seconds = Seconds(0.05);

/// What is wrong with a course that should have reached its goal.
fn fault(runner: &Runner, what: &str, course: &Course, end: f64, astray: f64) -> String {
    let reached = course.result.is_ok() && course.missed_by() <= end && course.reversals <= runner.reversals;
    if reached && course.astray <= astray {
        return String::new();
    }
    format!(
        "{} on {what}: {:?}, {:.1} mm and {:.3} rad off, {:.1} mm astray, {} reversals, {:.2} s\n",
        runner.name,
        course.result,
        course.missed_by() * 1e3,
        course.miss.heading.0,
        course.astray * 1e3,
        course.reversals,
        course.time
    )
}

#[test]
fn every_corrector_reaches_the_goal_of_every_course() {
    let mut faults = String::new();
    for runner in runners() {
        for (name, path) in courses() {
            for (robot, plant, end) in [("ideal", IDEAL, runner.ends.0), ("real", REAL, runner.ends.1)] {
                let course = (runner.drive)(BEAT, plant, &path);
                faults += &fault(&runner, &format!("{name}, {robot}"), &course, end, runner.astray);
                obeys_limits(&course, BEAT);
            }
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

#[test]
fn delays_of_up_to_two_periods_slow_motors_and_uneven_wheels_are_mastered() {
    let mut faults = String::new();
    let path = way("1,0 1,1");
    for runner in runners() {
        for (up, down) in [(0, 0), (2, 3), (8, 12)] {
            for (motor, gain) in [(0.0, Sides::new(0.97, 0.97)), (0.04, Sides::new(0.97, 1.03))] {
                let course = (runner.drive)(BEAT, Plant { up, down, motor, gain, ..REAL }, &path);
                let what = format!("delay {} s, motors {motor} s, {gain:?}", (up + down) as f64 * STEP);
                faults += &fault(&runner, &what, &course, runner.ends.1 * 1.5, 0.15);
            }
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

#[test]
fn beats_of_10_to_200_ms_do() {
    let mut faults = String::new();
    for runner in runners() {
        for beat in [0.01, 0.02, 0.1, 0.2] {
            let course = (runner.drive)(Seconds(beat), REAL, &way("1,0 1,1"));
            faults += &fault(&runner, &format!("beats of {beat} s"), &course, runner.ends.1 * 2.0, 0.2);
            obeys_limits(&course, Seconds(beat));
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

#[test]
fn a_short_silence_and_missed_beats_are_survived() {
    let mut faults = String::new();
    for runner in runners() {
        for (what, plant) in [
            ("0.3 s without measurements", Plant { mute: (1.0, 1.3), ..REAL }),
            ("every fourth beat missed", Plant { missed: 4, ..REAL }),
        ] {
            let course = (runner.drive)(BEAT, plant, &way("1,0 1,1"));
            faults += &fault(&runner, what, &course, runner.ends.1 * 2.0, 0.2);
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

#[test]
fn motors_that_do_not_creep_and_coarse_encoders_reach_the_goal_without_hunting() {
    let mut faults = String::new();
    // Below 25 mm/s a motor stands; wheels are known to 5 mm, and the robot's place no better than that.
    for (what, plant, end) in [
        ("dead band", Plant { dead: 0.025, up: 2, down: 2, motor: 0.08, ..IDEAL }, 0.03),
        ("ticks of 5 mm", Plant { tick: 0.005, up: 2, down: 2, ..IDEAL }, 0.03),
    ] {
        for runner in runners() {
            for (name, path) in courses() {
                let course = (runner.drive)(BEAT, plant, &path);
                let end = runner.ends.0.max(end);
                faults += &fault(&runner, &format!("{name}, {what}"), &course, end, runner.astray + 0.02);
                if course.miss.heading.wrapped().0.abs() > 0.16 {
                    faults +=
                        &format!("{} on {name}, {what}: turned by {}\n", runner.name, course.miss.heading.0);
                }
                obeys_limits(&course, BEAT);
            }
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

#[test]
fn every_corrector_ends_with_the_heading_of_its_plan() {
    let mut faults = String::new();
    for runner in runners() {
        for (name, path) in courses() {
            let turned = (runner.drive)(BEAT, IDEAL, &path).miss.heading.wrapped().0;
            if turned.abs() > 0.135 {
                faults += &format!("{} on {name}: turned by {turned:.3} rad\n", runner.name);
            }
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

#[test]
fn a_plan_that_is_shorter_than_a_beat_is_driven() {
    let mut faults = String::new();
    for runner in runners() {
        for (what, path) in [("1 cm", plan(&[line(0.01)])), ("0.03 rad", plan(&[turn(0.03)]))] {
            let course = (runner.drive)(Seconds(0.2), IDEAL, &path);
            faults += &fault(&runner, what, &course, 0.006, 0.006);
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

#[test]
fn a_robot_before_a_wall_and_one_that_is_silent_fail_with_the_reason_and_brake() {
    for runner in runners() {
        for (plant, words) in [
            (Plant { wall: 1.0, ..REAL }, &["blocked", "not follow"][..]),
            (
                Plant { gain: Sides::new(1.0, 0.0), ..REAL },
                &["blocked", "not follow", "ratio", "come no closer"],
            ),
            (Plant { mute: (1.0, f64::INFINITY), ..REAL }, &["silent"]),
        ] {
            let course = (runner.drive)(BEAT, plant, &plan(&[line(3.0), arc(1.0, 1.0)]));
            let refusal = course.result.as_ref().expect_err(words[0]).to_string();
            assert!(words.iter().any(|word| refusal.contains(word)), "{}: {refusal}", runner.name);
            assert!(
                course.time < 8.0,
                "{}: it took {} s to see that it is {}",
                runner.name,
                course.time,
                words[0]
            );
            obeys_limits(&course, BEAT);
        }
    }
}

#[test]
fn the_same_measurements_lead_to_the_same_commands() {
    for runner in runners() {
        let path = way("1,0 1,1");
        let first = (runner.drive)(BEAT, REAL, &path);
        assert_eq!(first.commands, (runner.drive)(BEAT, REAL, &path).commands, "{}", runner.name);
    }
}

#[test]
fn the_frame_of_the_plan_is_that_of_the_poses() {
    // The same course from elsewhere, with a heading that has counted turns.
    for runner in runners() {
        let legs = way("1,0 1,1").legs;
        let there = Plan { start: Pose::new(-7.0, 3.0, 20.0), legs, ..Plan::default() };
        let faults =
            fault(&runner, "a course elsewhere", &(runner.drive)(BEAT, IDEAL, &there), runner.ends.0, 0.2);
        assert!(faults.is_empty(), "{faults}");
    }
}
