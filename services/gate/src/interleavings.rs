//! Every interleaving of up to eight events, exhaustively: who obeys whom does not depend on luck.
//!
//! There are 12^8 of them, some 430 million, but few different gates: two histories that leave the same gate behind have
//! the same future, and are followed on once. A walk without this shortcut, to a smaller depth, meets the same gates.

use crate::rig::{BOOT, ask, drive};
use crate::{Event, Gate, GateParams, MAX_BEAT, Outcome};
use axle_schema::command::{Class, Command, Enable, Lease, Motion, Reject, Release};
use axle_schema::{Drivetrain, MetresPerSecond, Seconds, Sides, StopId, Tick};
use std::collections::HashSet;

/// How many events follow each other.
const DEPTH: usize = 8;
/// From beat to beat, s: a sum of powers of two, so that times add up exactly.
const BEAT: f64 = 0.0625;

/// Silence that ends a lease, before its first command and after it, s.
const FIRST: f64 = 0.25 + 0.06;
const SILENCE: f64 = 0.15;

/// Two correctors, a person, and what a person at a distance does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Move {
    Asks(usize),
    Drives(usize),
    /// Says its latest command once more.
    Repeats(usize),
    /// Commands by what it saw too long ago.
    IsLate(usize),
    GivesBack(usize),
    Stop,
    Enable,
    Beat,
}
const MOVES: [Move; 12] = [
    Move::Asks(0),
    Move::Asks(1),
    Move::Asks(2),
    Move::Drives(0),
    Move::Drives(1),
    Move::Drives(2),
    Move::Repeats(0),
    Move::IsLate(0),
    Move::GivesBack(0),
    Move::Stop,
    Move::Enable,
    Move::Beat,
];
const CLASSES: [Class; 3] = [Class::Corrector, Class::Corrector, Class::Manual];

/// What an observer of the whole history knows, by rules of its own that are simpler than the gate's.
#[derive(Clone)]
struct World {
    gate: Gate,
    now: Seconds,
    leases: [Option<Lease>; 3],
    holder: Option<usize>,
    heard: Seconds,
    /// For how long the holder may be silent: until the first command longer.
    patience: f64,
    stopped: bool,
    seq: u32,
    /// The latest command of each.
    said: [Option<Command>; 3],
}

/// Everything of a world that its future depends on: times as they are by now, and of an epoch whether it is the latest.
type Essence = (bool, Option<(usize, i64, bool)>, Option<(i64, i64)>, [i64; 2], [Option<bool>; 3], [bool; 3]);

/// A number as a whole one, so that rounding makes no new worlds.
fn grain(number: f64) -> i64 {
    #[allow(clippy::cast_possible_truncation, reason = "a few metres and seconds in billionths")]
    let grain = (number * 1e9).round() as i64;
    grain
}

impl World {
    fn makes(&mut self, next: Move) {
        self.waits();
        match next {
            Move::Asks(who) => {
                let may = !self.stopped
                    && self.holder.is_none_or(|holder| holder == who || CLASSES[who] > CLASSES[holder]);
                let outcome = self.gate.step(self.now, &Event::Lease(ask(&format!("h{who}"), CLASSES[who])));
                assert_eq!(matches!(outcome, Outcome::Granted(_)), may, "{next:?}: {outcome:?}");
                if let Outcome::Granted(lease) = outcome {
                    (self.leases[who], self.holder) = (Some(lease), Some(who));
                    (self.heard, self.patience) = (self.now, FIRST);
                }
            }
            Move::Drives(who) => {
                let Some(command) = self.command(who) else { return };
                self.said[who] = Some(command);
                let outcome = self.gate.step(self.now, &Event::Command(command));
                let obeyed = outcome == Outcome::Done;
                assert_eq!(obeyed, self.holder == Some(who), "{next:?}: {outcome:?}");
                if obeyed {
                    (self.heard, self.patience) = (self.now, SILENCE);
                } else {
                    let why = [Reject::Fenced, Reject::Disabled].map(Outcome::Rejected);
                    assert!(why.contains(&outcome), "{next:?}: {outcome:?}");
                }
            }
            Move::Repeats(who) => {
                let Some(command) = self.said[who] else { return };
                let outcome = self.gate.step(self.now, &Event::Command(command));
                assert!(matches!(outcome, Outcome::Rejected(_)), "{next:?}: {outcome:?}");
            }
            Move::IsLate(who) => {
                let Some(mut command) = self.command(who) else { return };
                command.echo = Tick(command.echo.0.wrapping_sub(300));
                let outcome = self.gate.step(self.now, &Event::Command(command));
                assert!(matches!(outcome, Outcome::Rejected(_)), "{next:?}: {outcome:?}");
            }
            Move::GivesBack(who) => {
                let Some(Lease { boot, epoch, .. }) = self.leases[who] else { return };
                self.gate.step(self.now, &Event::Release(Release { boot, epoch }));
                self.holder = self.holder.filter(|holder| *holder != who);
            }
            Move::Stop => {
                self.gate.step(self.now, &Event::Stop(StopId(7)));
                (self.stopped, self.holder) = (true, None);
            }
            Move::Enable => {
                let stop = self.gate.state(self.now).stop;
                let enable = Enable {
                    stop,
                    boot: BOOT,
                    echo: Tick::of(self.now),
                    by: "a test".into(),
                    class: Class::Manual,
                };
                assert_eq!(self.gate.step(self.now, &Event::Enable(enable)), Outcome::Done);
                self.stopped = false;
            }
            Move::Beat => {
                self.now += Seconds(BEAT);
                let before = self.gate.wheels;
                self.gate.step(self.now, &Event::Beat);
                self.keeps_limits(before);
                self.waits();
            }
        }
        self.agrees(next);
    }

    /// The holder who has been silent for too long is none any more.
    fn waits(&mut self) {
        self.holder = self.holder.filter(|_| self.now.0 - self.heard.0 < self.patience);
    }

    /// The next command of somebody who has, or had, a lease.
    fn command(&mut self, who: usize) -> Option<Command> {
        let Lease { boot, epoch, .. } = self.leases[who]?;
        self.seq += 1;
        let (seq, echo, dwm) = (self.seq, Tick::of(self.now), drive(0.5, -0.5, 1.0));
        Some(Command { boot, epoch, seq, echo, ttl_ms: 1000, dwm })
    }

    /// The default limits: 1 m/s, 2.5 m/s² in driving and 2 m/s² in braking.
    fn keeps_limits(&self, before: Sides<MetresPerSecond>) {
        for (is, was) in self.gate.wheels.both().into_iter().zip(before.both()) {
            assert!((is - was).abs().0 <= 2.5 * MAX_BEAT.0 + 1e-12 && is.abs().0 <= 1.0, "{was} to {is}");
            assert!(!self.stopped || is.abs() <= was.abs(), "faster after a stop: {was} to {is}");
        }
    }

    /// When nobody says anything more, the wheels stand: 150 ms of silence, 0.25 s of braking from 0.5 m/s, two beats.
    fn comes_to_rest(&self) {
        let mut silent = self.clone();
        for _ in 0..10 {
            silent.makes(Move::Beat);
        }
        assert_eq!(silent.gate.motion(), Motion::Standing, "after silence: {:?}", silent.gate);
    }

    fn essence(&self) -> Essence {
        let held = self.gate.held.as_ref().map(|held| {
            let who = self.holder.expect("the observer agrees");
            (who, grain((self.now - held.heard).0), self.gate.seq.is_some())
        });
        let course = self
            .gate
            .course
            .as_ref()
            .map(|course| (grain((self.now - course.since).0), grain(course.lasts.0)));
        let leases = self.leases.map(|lease| lease.map(|lease| lease.epoch == self.gate.epoch));
        let said = self.said.map(|said| said.is_some());
        (self.stopped, held, course, self.gate.wheels.both().map(|speed| grain(speed.0)), leases, said)
    }

    fn agrees(&self, last: Move) {
        let state = self.gate.state(self.now);
        assert_eq!(state.holder, self.holder.map(|who| format!("h{who}")), "after {last:?}");
        assert_eq!(state.enabled, !self.stopped, "after {last:?}");
        assert!(state.motion != Motion::Driving || self.holder.is_some(), "nobody drives after {last:?}");
    }
}

fn world() -> World {
    let params = GateParams { starts_enabled: true, ..GateParams::default() };
    let mut gate = Gate::new(params, &Drivetrain::default(), BOOT, None).expect("a gate");
    gate.beat(Seconds::ZERO);
    World {
        gate,
        now: Seconds::ZERO,
        leases: [None; 3],
        holder: None,
        heard: Seconds::ZERO,
        patience: FIRST,
        stopped: false,
        seq: 0,
        said: [None; 3],
    }
}

/// The worlds that are new after each number of events.
fn merged(depth: usize) -> HashSet<Essence> {
    let mut known = HashSet::from([world().essence()]);
    let mut frontier = vec![world()];
    for _ in 0..depth {
        let mut next = Vec::new();
        for (world, act) in frontier.iter().flat_map(|world| MOVES.map(|act| (world, act))) {
            let mut world = world.clone();
            world.makes(act);
            if known.insert(world.essence()) {
                world.comes_to_rest();
                next.push(world);
            }
        }
        frontier = next;
    }
    known
}

#[test]
fn in_every_order_of_events_there_is_one_holder_and_only_the_holder_is_obeyed() {
    let known = merged(DEPTH);
    assert!(known.len() > 500, "{} worlds", known.len());
}

#[test]
fn histories_that_are_followed_on_once_miss_no_gate() {
    fn explore(world: &World, depth: usize, known: &mut HashSet<Essence>) {
        known.insert(world.essence());
        if depth > 0 {
            for act in MOVES {
                let mut world = world.clone();
                world.makes(act);
                explore(&world, depth - 1, known);
            }
        }
    }
    let mut known = HashSet::new();
    explore(&world(), 4, &mut known);
    assert!(known == merged(4), "both walks meet the same gates");
}
