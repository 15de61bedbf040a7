//! Laws of the simulator, and proofs that its judgement is one: time, order, silence, and who comes out last.

use crate::run::{Ending, Mill, run};
use crate::seat::{Seat, seats};
use crate::{ALL, COURSES, Course, Run, SCENARIOS, Scenario, TRIALS, Tournament, World};
use axle_correctors::{DCorrector, DParams};
use axle_gate::Gate;
use axle_schema::command::{BrakeCause, Motion};
use axle_schema::contract::{Account, Corrector, Seen, Step};
use axle_schema::series::Datum as _;
use axle_schema::{Drive, Dwm, EncodersData, MetresPerSecond, Refusal, Seconds, Sides, Task};
use proptest::prelude::*;

/// A D-corrector whose feedback has the wrong sign: the farther it is off, the farther it drives away.
struct Wrong {
    drive: Drive,
    begin: EncodersData,
    began: Seconds,
    last: Sides<MetresPerSecond>,
}

impl Wrong {
    fn speeds(&self, t: f64) -> Sides<MetresPerSecond> {
        let mut rest = t;
        for dwm in &self.drive.dwms {
            if rest < dwm.duration().0 {
                return dwm.speeds_at(Seconds(rest));
            }
            rest -= dwm.duration().0;
        }
        Sides::default()
    }
    fn due(&self, t: f64) -> Sides<f64> {
        let mut rest = t;
        self.drive.dwms.iter().fold(Sides::default(), |sum, dwm| {
            let more = dwm.distances_at(Seconds(rest.clamp(0.0, dwm.duration().0)));
            rest -= dwm.duration().0;
            sum.zip(more, |sum: f64, more| sum + more.0)
        })
    }
}

impl Corrector for Wrong {
    type Params = DParams;
    type Plan = Drive;
    fn period(_: &DParams) -> Seconds {
        Seconds(0.05)
    }
    fn begin(_: &DParams, _: Seconds, task: Task<Drive>, seen: &Seen) -> Result<Self, Refusal> {
        let begin = seen.encoders.ok_or_else(|| Refusal::unavailable("encoders", "start the robot"))?;
        Ok(Self { drive: task.plan, begin, began: seen.at, last: Sides::default() })
    }
    fn step(&mut self, seen: &Seen) -> Step {
        let t = (seen.at - self.began).0;
        let real = self.begin.span_to(&seen.encoders.unwrap_or(self.begin)).sides();
        if t > self.drive.duration.0 + 1.0 {
            return Step::Done;
        }
        let error = self.due(t).zip(real, |due, real| due - real.0);
        let most = 1.5 * 0.05;
        let end = self.speeds(t + 0.05).zip(error, |due, e| due.0 - 1.5 * e);
        let end = end.zip(self.last, |to, from| to.clamp(from.0 - most, from.0 + most).clamp(-0.9, 0.9));
        let dwm = Dwm::new(self.last, end.map(MetresPerSecond), Seconds(0.05)).expect("finite");
        self.last = dwm.end();
        Step::Drive(dwm)
    }
    fn resume(&mut self, _: &Seen, _: Seconds) {}
    fn account(&self) -> Account {
        Account::default()
    }
}

fn wrong() -> Seat {
    Seat::of::<Wrong>("wrong", &[])
}
fn d() -> Seat {
    Seat::of::<DCorrector>("d-corrector", &[])
}
fn all_of(tournament: &Tournament) -> Vec<Run> {
    (0..tournament.jobs()).map(|job| tournament.play(job).expect("a run")).collect()
}
fn tournament(seats: Vec<Seat>, courses: &[&str], scenarios: &[&str], runs: usize) -> Tournament {
    let course = |name: &&str| Course::find(name).expect("a course");
    let scenario = |name: &&str| Scenario::find(name).expect("a scenario");
    let (courses, scenarios) =
        (courses.iter().map(course).collect(), scenarios.iter().map(scenario).collect());
    Tournament { seats, courses, scenarios, runs, seed: 1 }
}

#[test]
fn every_corrector_reaches_the_end_of_every_course_with_a_clean_robot() {
    for seat in seats() {
        for course in COURSES {
            let brief = course.brief(3).expect(course.name);
            let run = run(&seat, &brief, &World::clean(3)).expect("a run");
            assert_eq!(run.ending, Ending::Done, "{} on {}", seat.name, course.name);
            let [error, heading, ..] = run.values;
            assert!(error < 0.05 && heading < 0.1, "{} on {}: {:?}", seat.name, course.name, run.values);
        }
    }
}

#[test]
fn poor_motors_and_coarse_encoders_hinder_no_corrector() {
    for seat in seats() {
        for (course, scenario) in
            COURSES.iter().flat_map(|course| ["ticks", "motors"].map(|name| (course, name)))
        {
            let world = Scenario::find(scenario).expect("a scenario").world(7);
            let run = run(&seat, &course.brief(7).expect(course.name), &world).expect("a run");
            let success = run.values[7] > 0.0;
            assert!(
                success,
                "{} on {}, {scenario}: {:?} {:?}",
                seat.name, course.name, run.ending, run.values
            );
        }
    }
}

#[test]
fn no_corrector_hunts_at_any_goal_in_any_scenario() {
    let mut faults = String::new();
    for (seat, course) in
        seats().iter().flat_map(|seat| COURSES.iter().map(move |course| (seat.clone(), course)))
    {
        for scenario in SCENARIOS.iter().chain(TRIALS) {
            let run = run(&seat, &course.brief(2).expect(course.name), &scenario.world(2)).expect("a run");
            if run.hunting > 1 {
                let times = run.hunting;
                faults += &format!("{} on {}, {}: {times} times\n", seat.name, course.name, scenario.name);
            }
        }
    }
    assert!(faults.is_empty(), "a wheel changed its direction in the last second:\n{faults}");
}

/// Over a link that takes so long up and down, in s, every corrector succeeds on every course, with this `lead` or its own.
fn succeeds_over(up: f64, down: f64, lead: Option<f64>) {
    for seat in seats() {
        let mut values = seat.values();
        let last = values.last_mut().expect("the lead is the last knob of all");
        *last = lead.unwrap_or(*last);
        let seat = seat.tuned(&values).expect("within the range");
        // The seed decides where in the beats of the robot those of the corrector lie.
        for (seed, course) in (1..).zip(COURSES) {
            let mut world = World::clean(seed);
            (world.up.delay, world.down.delay) = (Seconds(up), Seconds(down));
            let run = run(&seat, &course.brief(seed).expect(course.name), &world).expect("a run");
            let what = format!("{} on {}, {up} s up and {down} s down", seat.name, course.name);
            assert!(run.ending == Ending::Done && run.values[7] > 0.0, "{what}: {:?}", run.ending);
            assert!(run.hunting <= 1, "{what}: {} reversals", run.hunting);
        }
    }
}

#[test]
fn a_link_of_100_ms_there_and_back_ends_no_task() {
    succeeds_over(0.04, 0.06, None);
    succeeds_over(0.01, 0.09, None);
}

#[test]
fn a_link_of_180_ms_ends_none_where_the_lead_knows_of_it() {
    succeeds_over(0.08, 0.1, Some(0.2));
    succeeds_over(0.02, 0.16, Some(0.2));
}

#[test]
fn a_feedback_of_the_wrong_sign_comes_out_last() {
    let mut all = seats();
    all.insert(0, wrong());
    let tournament = tournament(all, &["straight", "square"], &["clean", "unequal-wheels", "motors"], 3);
    let rows = tournament.rows(&all_of(&tournament));
    let totals: Vec<_> = rows.iter().filter(|row| (row.course, row.scenario) == (ALL, ALL)).collect();
    let bad = totals.iter().find(|row| row.corrector == "wrong").expect("it has played");
    for good in totals.iter().filter(|row| row.corrector != "wrong") {
        assert!(bad.estimates[0].mean.low > good.estimates[0].mean.high, "{bad:?}\n{good:?}");
        assert!(bad.estimates[7].mean.mean < good.estimates[7].mean.mean, "{bad:?}\n{good:?}");
    }
    assert!(bad.estimates[0].behind.low > 0.0, "it is behind the best, beyond doubt: {bad:?}");
}

#[test]
fn who_else_plays_and_in_which_order_changes_nothing() {
    let small = tournament(vec![d()], &["square"], &["slip"], 3);
    let large = tournament(vec![wrong(), d()], &["straight", "square"], &["clean", "slip"], 3);
    let runs = all_of(&large);
    let backwards: Vec<_> = (0..large.jobs()).rev().map(|job| large.play(job).expect("a run")).collect();
    assert!(runs.iter().eq(backwards.iter().rev()));
    let of = |rows: Vec<crate::Row>| {
        let cell = rows.into_iter().find(|row| row.corrector == "d-corrector" && row.course == "square");
        cell.map(|row| row.estimates.map(|estimate| estimate.mean))
    };
    let slip = |row: &crate::Row| row.scenario == "slip";
    assert_eq!(
        of(small.rows(&all_of(&small)).into_iter().filter(slip).collect()),
        of(large.rows(&runs).into_iter().filter(slip).collect())
    );
}

#[test]
fn a_cut_link_is_seen_by_the_gate_and_the_robot_comes_to_rest() {
    let (seat, brief) = (d(), Course::find("straight").expect("a course").brief(1).expect("a plan"));
    let mut mill = Mill::new(&seat, &brief, &World::clean(1)).expect("a mill");
    while mill.now < Seconds(2.0) {
        mill.beat();
    }
    assert_eq!(mill.robot.gate.motion(), Motion::Driving);
    mill.down.cut(Seconds(2.0));
    let cause = |gate: &Gate| gate.state(Seconds(9.0)).cause;
    while mill.robot.gate.motion() == Motion::Driving {
        mill.beat();
    }
    // The last command was sent at most a beat before the cut, lasts 50 ms, and is held for 50 ms more.
    assert!(mill.now <= Seconds(2.11), "{:?}", mill.now);
    assert_eq!(cause(&mill.robot.gate), Some(BrakeCause::Expired));
    while !mill.robot.rests() {
        mill.beat();
        assert!(mill.now < Seconds(2.6), "0.5 m/s at 2 m/s² is 0.25 s");
    }
    assert_eq!(cause(&mill.robot.gate), Some(BrakeCause::Silence), "150 ms without a command end the lease");
    while mill.now < Seconds(4.0) {
        mill.beat();
    }
    let crate::host::Stage::Over(Err(refusal)) = &mill.host.stage else { panic!("the host knows of it") };
    assert!(refusal.to_string().contains("took the wheels back"), "{refusal}");
}

#[test]
fn every_corrector_ends_its_task_in_every_scenario() {
    for (row, scenario) in SCENARIOS.iter().enumerate() {
        for (column, seat) in seats().iter().enumerate() {
            let course = &COURSES[(row + column) % COURSES.len()];
            let seed = 7;
            let run = run(seat, &course.brief(seed).expect("a plan"), &scenario.world(seed)).expect("a run");
            let what = format!("{}, {}, {}", seat.name, course.name, scenario.name);
            assert_eq!(run.ending, Ending::Done, "{what}");
        }
    }
}

#[test]
fn lost_commands_brake_the_robot_and_do_not_end_the_task() {
    for seat in seats() {
        let brief = Course::find("square").expect("a course").brief(1).expect("a plan");
        let mut world = World::clean(1);
        world.down.loss = 0.1;
        let mut mill = Mill::new(&seat, &brief, &world).expect("a mill");
        let mut slipped = 0;
        let mut holds = true;
        while !matches!(mill.host.stage, crate::host::Stage::Over(_)) {
            mill.beat();
            let held = mill.robot.gate.state(mill.now).holder.is_some();
            slipped += u32::from(holds && !held && mill.now > Seconds(1.0));
            holds = held;
            assert!(mill.now < Seconds(60.0), "{} comes to no end", seat.name);
        }
        let crate::host::Stage::Over(end) = &mill.host.stage else { panic!("it is over") };
        assert_eq!(end, &Ok(()), "{} after {slipped} losses", seat.name);
        assert!(slipped > 0, "{}: a tenth of the commands is lost, and nothing happens", seat.name);
        while !mill.robot.rests() {
            mill.beat();
        }
    }
}

#[test]
fn a_corrector_without_measurements_gives_up_and_the_robot_stands() {
    let (seat, brief) = (d(), Course::find("straight").expect("a course").brief(1).expect("a plan"));
    let mut mill = Mill::new(&seat, &brief, &World::clean(1)).expect("a mill");
    while mill.now < Seconds(2.0) {
        mill.beat();
    }
    mill.up.cut(Seconds(2.0));
    while mill.now < Seconds(4.0) {
        mill.beat();
    }
    let crate::host::Stage::Over(Err(refusal)) = &mill.host.stage else { panic!("it has given up") };
    assert!(refusal.to_string().contains("no measurement"), "{refusal}");
    assert!(mill.robot.rests());
    // Long before it gave up, the gate refused its echoes.
    assert!(mill.robot.truth().pose.x.0 < 0.5 * 2.0 + 0.5, "{:?}", mill.robot.truth());
}

/// What a corrector is shown: its clock must grow, and stamps and distances of a robot that drives on never go back.
struct Probe {
    inner: DCorrector,
    last: Option<Seen>,
}
impl Corrector for Probe {
    type Params = DParams;
    type Plan = Drive;
    fn period(params: &DParams) -> Seconds {
        DCorrector::period(params)
    }
    fn begin(params: &DParams, period: Seconds, task: Task<Drive>, seen: &Seen) -> Result<Self, Refusal> {
        Ok(Self { inner: DCorrector::begin(params, period, task, seen)?, last: None })
    }
    fn step(&mut self, seen: &Seen) -> Step {
        let last = self.last.replace(*seen).unwrap_or_default();
        assert!(seen.at > last.at, "{seen:?} after {last:?}");
        let stamps = |seen: &Seen| {
            let encoders = seen.encoders.map(|datum| datum.stamp.0);
            [encoders, seen.inertial.map(|datum| datum.stamp.0), seen.pose.map(|datum| datum.stamp.0)]
        };
        for (is, was) in stamps(seen).into_iter().zip(stamps(&last)) {
            assert!(is >= was, "{seen:?} after {last:?}");
        }
        self.inner.step(seen)
    }
    fn resume(&mut self, seen: &Seen, pause: Seconds) {
        self.inner.resume(seen, pause);
    }
    fn account(&self) -> Account {
        self.inner.account()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn the_same_seed_gives_the_same_bits_and_time_never_goes_back(
        seed in any::<u64>(),
        course in 0..COURSES.len(),
        scenario in 0..SCENARIOS.len(),
    ) {
        let brief = COURSES[course].brief(seed).expect("a plan");
        let world = SCENARIOS[scenario].world(seed);
        let probe = Seat::of::<Probe>("probe", &[]);
        let first = run(&probe, &brief, &world).expect("a run");
        prop_assert_eq!(format!("{first:?}"), format!("{:?}", run(&probe, &brief, &world).expect("a run")));
        prop_assert!(first.values.iter().all(|value| value.is_finite()), "{:?}", first.values);
        prop_assert_eq!(first.path, run(&d(), &brief, &world).expect("a run").path);
    }
}
