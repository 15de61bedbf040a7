//! Every interleaving of a few events, exhaustively: who obeys whom does not depend on luck.

use crate::rig::{BOOT, ask, drive};
use crate::{Event, Gate, GateParams, Outcome};
use axle_schema::command::{Class, Command, Enable, Lease, Motion, Reject, Release};
use axle_schema::{Drivetrain, Seconds, StopId, Tick};

/// How many events follow each other.
const DEPTH: usize = 5;

/// Two correctors, a person, and what a person at a distance does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Move {
    Asks(usize),
    Drives(usize),
    GivesBack(usize),
    Stop,
    Enable,
    Beat,
}
const MOVES: [Move; 10] = [
    Move::Asks(0),
    Move::Asks(1),
    Move::Asks(2),
    Move::Drives(0),
    Move::Drives(1),
    Move::Drives(2),
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
    stopped: bool,
    seq: u32,
}

impl World {
    fn makes(&mut self, next: Move) {
        if self.holder.is_some() && self.now.0 - self.heard.0 >= 0.15 {
            self.holder = None;
        }
        match next {
            Move::Asks(who) => {
                let may = !self.stopped
                    && self.holder.is_none_or(|holder| holder == who || CLASSES[who] > CLASSES[holder]);
                let outcome = self.gate.step(self.now, &Event::Lease(ask(&format!("h{who}"), CLASSES[who])));
                assert_eq!(matches!(outcome, Outcome::Granted(_)), may, "{next:?}: {outcome:?}");
                if let Outcome::Granted(lease) = outcome {
                    (self.leases[who], self.holder, self.heard) = (Some(lease), Some(who), self.now);
                }
            }
            Move::Drives(who) => {
                let Some(Lease { boot, epoch, .. }) = self.leases[who] else { return };
                self.seq += 1;
                let (seq, echo, dwm) = (self.seq, Tick::of(self.now), drive(0.5, 0.5, 0.1));
                let command = Command { boot, epoch, seq, echo, ttl_ms: 100, dwm };
                let outcome = self.gate.step(self.now, &Event::Command(command));
                let obeyed = outcome == Outcome::Done;
                assert_eq!(obeyed, self.holder == Some(who), "{next:?}: {outcome:?}");
                if obeyed {
                    self.heard = self.now;
                } else {
                    let why = [Reject::Fenced, Reject::Disabled].map(Outcome::Rejected);
                    assert!(why.contains(&outcome), "{next:?}: {outcome:?}");
                }
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
                let enable = Enable { stop, boot: BOOT, echo: Tick::of(self.now), by: "a test".into() };
                assert_eq!(self.gate.step(self.now, &Event::Enable(enable)), Outcome::Done);
                self.stopped = false;
            }
            Move::Beat => {
                self.now += Seconds(0.05);
                self.gate.step(self.now, &Event::Beat);
                if self.holder.is_some() && self.now.0 - self.heard.0 >= 0.15 {
                    self.holder = None;
                }
            }
        }
        self.agrees(next);
    }

    fn agrees(&self, last: Move) {
        let state = self.gate.state(self.now);
        assert_eq!(state.holder, self.holder.map(|who| format!("h{who}")), "after {last:?}");
        assert_eq!(state.enabled, !self.stopped, "after {last:?}");
        assert!(state.motion != Motion::Driving || self.holder.is_some(), "nobody drives after {last:?}");
    }
}

#[test]
fn in_every_order_of_events_there_is_one_holder_and_only_the_holder_is_obeyed() {
    fn explore(world: &World, depth: usize, count: &mut u32) {
        for next in MOVES {
            let mut world = world.clone();
            world.makes(next);
            *count += 1;
            if depth > 1 {
                explore(&world, depth - 1, count);
            }
        }
    }
    let params = GateParams { starts_enabled: true, ..GateParams::default() };
    let world = World {
        gate: Gate::new(params, &Drivetrain::default(), BOOT, None).expect("a gate"),
        now: Seconds::ZERO,
        leases: [None; 3],
        holder: None,
        heard: Seconds::ZERO,
        stopped: false,
        seq: 0,
    };
    let mut count = 0;
    explore(&world, DEPTH, &mut count);
    // 10 + 100 + … + 10^5.
    assert_eq!(count, 111_110);
}
