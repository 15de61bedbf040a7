//! Correctors on whole courses, in virtual time, with a small robot of this file: delays, ticks, wrong gains, noise.
#![allow(clippy::expect_used, reason = "a test fails by a panic")]
#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "small numbers")]

use axle_correctors::{DCorrector, DParams};
use axle_pathdriver::{Pathdriver, PathdriverParams};
use axle_pathfinder::{Pathfinder, PathfinderParams};
use axle_schema::contract::{Corrector, Functional as _, Seen, Step};
use axle_schema::{
    Drive, DriveAsk, Dwm, EncodersData, Metres, PlanAsk, Refusal, Seconds, Sides, Task, TaskId, WayTask,
};
use std::collections::VecDeque;

/// The step of the virtual time, s; encoders are read at every fourth, a beat is at every tenth.
const STEP: f64 = 0.005;

/// A robot: what lies between a command and its measurement.
#[derive(Clone, Copy, Debug)]
struct Plant {
    /// Of a measurement on its way to the corrector, and of a command on its way back, in steps of 5 ms.
    up: usize,
    down: usize,
    /// How fast the wheels really run for a speed of 1.
    gain: Sides<f64>,
    /// Time constant of the motors, s.
    motor: f64,
    /// Noise of a reading beside the tick, m.
    noise: f64,
    /// The distance of one tick of the encoders, m.
    tick: f64,
    /// Between which times no measurement comes, s.
    mute: (f64, f64),
    /// One beat in so many does not come; 0 for none.
    missed: usize,
}

const IDEAL: Plant = Plant {
    up: 0,
    down: 0,
    gain: Sides::new(1.0, 1.0),
    motor: 0.0,
    noise: 0.0,
    tick: 0.0,
    mute: (0.0, 0.0),
    missed: 0,
};
/// Delay of a period in sum, ticks of 0.5 mm, gain errors of 3 % to both sides, noise.
const REAL: Plant =
    Plant { up: 4, down: 6, gain: Sides::new(1.03, 0.97), motor: 0.02, noise: 2e-4, tick: 5e-4, ..IDEAL };

/// What a run was like.
#[derive(Debug)]
struct Course {
    result: Result<(), Refusal>,
    /// Error of the wheels at the end by the encoders, and the largest one on the way, m.
    end: f64,
    worst: f64,
    /// How often the real wheels changed their direction in the last second; the worse of the two.
    reversals: usize,
    /// Duration beyond that of the plan, s.
    extra: f64,
    /// All commands, in their order.
    commands: Vec<Dwm>,
}

/// The drive of a typed way, by the services that make it.
fn plan(way: &str) -> Drive {
    let way = WayTask::parse(way).expect("a way");
    let plan =
        Pathfinder::answer(&PathfinderParams::default(), &PlanAsk { way, start: None }).expect("a plan");
    let ask = DriveAsk { legs: plan.legs, speeds: None, robot: None };
    Pathdriver::answer(&PathdriverParams::default(), &ask).expect("a drive")
}

/// A robot at work: its wheels, and what is on its way to and from it.
struct Robot {
    plant: Plant,
    random: u64,
    speed: Sides<f64>,
    covered: Sides<f64>,
    readings: VecDeque<(usize, EncodersData)>,
    orders: VecDeque<(usize, Dwm)>,
    playing: Option<(usize, Dwm)>,
}

impl Robot {
    fn new(plant: Plant) -> Self {
        Self {
            plant,
            random: 12345,
            speed: Sides::new(0.0, 0.0),
            covered: Sides::new(0.3, -0.2),
            readings: VecDeque::new(),
            orders: VecDeque::new(),
            playing: None,
        }
    }

    /// Evenly spread between plus and minus `noise`.
    fn noise(&mut self) -> f64 {
        self.random =
            self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.plant.noise * (f64::from((self.random >> 33) as u32) / f64::from(1_u32 << 30) - 1.0)
    }

    /// Reads the encoders, and hands out the newest reading that has arrived.
    fn sense(&mut self, n: usize) -> Option<EncodersData> {
        let (time, Plant { mute, tick, .. }) = (n as f64 * STEP, self.plant);
        if n.is_multiple_of(4) && !(mute.0 < time && time < mute.1) {
            let [left, right] = self.covered.both().map(|distance| {
                let distance = distance + self.noise();
                Metres(if tick > 0.0 { (distance / tick).floor() * tick } else { distance })
            });
            let datum = EncodersData { stamp: Seconds(7.0 + time), left, right };
            self.readings.push_back((n + self.plant.up, datum));
        }
        let mut newest = None;
        while self.readings.front().is_some_and(|&(due, _)| due <= n) {
            newest = self.readings.pop_front().map(|(_, datum)| datum);
        }
        newest
    }

    /// Moves the wheels by one step.
    fn act(&mut self, n: usize) {
        while self.orders.front().is_some_and(|&(due, _)| due <= n) {
            self.playing = self.orders.pop_front();
        }
        let Some((begin, dwm)) = self.playing else { return };
        let asked = dwm.speeds_at(Seconds(((n - begin) as f64 + 0.5) * STEP));
        let share = STEP / (STEP + self.plant.motor);
        let asked = asked.zip(self.plant.gain, |asked, gain| asked.0 * gain);
        self.speed = self.speed.zip(asked, |is, asked| is + (asked - is) * share);
        self.covered = self.covered.zip(self.speed, |distance, speed| distance + speed * STEP);
    }
}

fn run(params: &DParams, plant: Plant, plan: &Drive) -> Course {
    let beat = (params.period.0 / STEP).round() as usize;
    let mut robot = Robot::new(plant);
    let mut seen = Seen::default();
    let mut running: Option<DCorrector> = None;
    let mut speeds: Vec<Sides<f64>> = Vec::new();
    let mut course =
        Course { result: Ok(()), end: 0.0, worst: 0.0, reversals: 0, extra: 0.0, commands: vec![] };
    for n in 0_usize.. {
        seen.encoders = robot.sense(n).or(seen.encoders);
        let missed = plant.missed > 0 && (n / beat).is_multiple_of(plant.missed);
        // Beats do not keep step with the encoders.
        if n % beat == 3 && !missed && seen.encoders.is_some() {
            seen.at = Seconds(100.0 + n as f64 * STEP);
            if let Some(corrector) = &mut running {
                match beat_once(corrector, &seen, plan, &mut course) {
                    Some(dwm) => robot.orders.push_back((n + plant.down, dwm)),
                    None => break,
                }
            } else {
                let task = Task { id: TaskId(1), plan: plan.clone() };
                running =
                    Some(DCorrector::begin(params, params.period, task, &seen).expect("a plan to follow"));
            }
        }
        robot.act(n);
        speeds.push(robot.speed);
    }
    course.reversals = reversals(&speeds, |speed| speed.left).max(reversals(&speeds, |speed| speed.right));
    course
}

/// One beat, and what it says of the course; nothing when it was the last one.
fn beat_once(corrector: &mut DCorrector, seen: &Seen, plan: &Drive, course: &mut Course) -> Option<Dwm> {
    let step = corrector.step(seen);
    let account = corrector.account();
    assert!((0.0..=1.0).contains(&account.fraction), "{account:?}");
    let (due, real) = (account.due.expect("due distances"), account.real.expect("real distances"));
    let errors = due.zip(real, |due, real| (due - real).abs().0);
    course.end = errors.left.max(errors.right);
    course.worst = course.worst.max(course.end);
    course.extra = account.elapsed.0 - plan.duration.0;
    match step {
        Step::Drive(dwm) => {
            course.commands.push(dwm);
            Some(dwm)
        }
        Step::Done => None,
        Step::Fail(refusal) => {
            course.result = Err(refusal);
            None
        }
    }
}

/// How often a wheel changed its direction in the last second.
fn reversals(speeds: &[Sides<f64>], side: fn(&Sides<f64>) -> f64) -> usize {
    let last = &speeds[speeds.len().saturating_sub(200)..];
    let forward: Vec<bool> = last.iter().map(side).filter(|v| v.abs() > 1e-4).map(|v| v > 0.0).collect();
    forward.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

const LINE: &str = "1.3,0";
const SQUARE: &str = "1,0 1,1 0,1 0,0";
const TURN: &str = "0,0,2.5";

fn reached(course: &Course, worst: f64, what: &str) {
    assert!(course.result.is_ok(), "{what}: {course:?}");
    assert!(course.end <= 0.0021 && course.worst < worst, "{what}: {course:?}");
    assert!(course.reversals <= 1 && course.extra < 2.0, "{what}: {course:?}");
}

#[test]
fn an_ideal_robot_is_led_along_its_plan_to_the_millimetre() {
    let params = DParams { lead: Seconds(0.01), ..DParams::default() };
    for way in [LINE, SQUARE, TURN] {
        reached(&run(&params, IDEAL, &plan(way)), 0.005, way);
    }
}

#[test]
fn the_defaults_converge_without_ringing_for_delays_of_up_to_two_periods() {
    for way in [LINE, SQUARE, TURN] {
        let plan = plan(way);
        for (up, down) in [(0, 0), (2, 3), (4, 6), (6, 9), (8, 12)] {
            for motor in [0.0, 0.04] {
                for gain in [Sides::new(1.03, 0.97), Sides::new(0.97, 0.97), Sides::new(1.03, 1.03)] {
                    let course = run(&DParams::default(), Plant { up, down, motor, gain, ..REAL }, &plan);
                    let delay = (up + down) as f64 * STEP;
                    reached(&course, 0.05, &format!("{way}, delay {delay} s, motors {motor} s, {gain:?}"));
                }
            }
        }
    }
}

#[test]
fn every_command_goes_on_from_the_last_one_within_the_limits_and_the_last_one_is_rest() {
    let params = DParams::default();
    let robot = params.robot;
    let course = run(&params, REAL, &plan(SQUARE));
    let mut last = Sides::default();
    for dwm in &course.commands {
        assert_eq!(dwm.start(), last, "{dwm:?} jumps");
        assert!((dwm.duration().0 - 0.05).abs() < 1e-15 && dwm.peak_speed() <= robot.wheel_speed);
        for a in dwm.accelerations().both() {
            assert!(a.0.abs() <= robot.wheel_acceleration.0 * (1.0 + 1e-9), "{dwm:?} accelerates by {a}");
        }
        last = dwm.end();
    }
    let rest = course.commands[course.commands.len() - 1];
    assert!(rest.peak_speed().0 <= 0.0, "{rest:?} is not rest");
}

#[test]
fn the_same_measurements_lead_to_the_same_commands() {
    let plan = plan(SQUARE);
    let first = run(&DParams::default(), REAL, &plan);
    assert_eq!(first.commands, run(&DParams::default(), REAL, &plan).commands);
}

#[test]
fn a_short_silence_and_missed_beats_are_survived() {
    let gap = Plant { mute: (1.0, 1.4), ..REAL };
    reached(&run(&DParams::default(), gap, &plan(SQUARE)), 0.06, "0.4 s without measurements");
    let lazy = Plant { missed: 4, ..REAL };
    reached(&run(&DParams::default(), lazy, &plan(SQUARE)), 0.06, "every fourth beat is missed");
}

#[test]
fn other_periods_converge_as_well() {
    for period in [0.02, 0.1] {
        let params = DParams { period: Seconds(period), ..DParams::default() };
        let plant = Plant { up: 2, down: 2, ..REAL };
        reached(&run(&params, plant, &plan(SQUARE)), 0.06, &format!("period {period} s"));
    }
}

#[test]
fn a_robot_that_does_not_do_what_it_is_told_fails_with_the_reason() {
    let check = |plant: Plant, way: &str, words: &str| {
        let course = run(&DParams::default(), plant, &plan(way));
        let refusal = course.result.expect_err(words).to_string();
        assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
    };
    check(Plant { gain: Sides::new(1.0, 0.0), ..REAL }, LINE, "the right wheel does not follow: it is 0.3");
    check(Plant { gain: Sides::new(-1.0, 1.0), ..REAL }, LINE, "the left wheel does not follow");
    check(Plant { mute: (1.0, f64::INFINITY), ..REAL }, LINE, "no measurement for 0.5");
    check(Plant { gain: Sides::new(0.0, 0.0), ..REAL }, "0.1,0", "still 0.10");
}
