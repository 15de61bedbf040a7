//! What happened, and whether it may: the judge knows nothing of scenarios, processes and exit codes.
//!
//! Its law, for every history: never two holders of the wheels, no command obeyed that is too old or out of its order,
//! and no task that ends twice or goes on after its end.

use axle_schema::command::{Command, GateState};
use axle_schema::meta::{Cause, Meta};
use axle_schema::task::{CorrectorProgress, Phase, PilotProgress};
use axle_schema::{Boot, EncodersData, NavigatorData, TaskId, Tick};
use std::collections::BTreeMap;

/// The oldest echo that the gate accepts, and one reading of the encoders, in ms: what is older was stale.
pub(super) const OLDEST: f64 = 250.0 + 20.0;
/// Slower than this, in m/s, the robot stands.
const REST: f64 = 1e-3;
/// What a gate that brakes takes of the speed, m/s².
const A_STOP: f64 = 2.0;

/// What was heard.
#[derive(Clone, Debug)]
pub(super) struct Event {
    /// When, in s.
    pub(super) at: f64,
    pub(super) what: What,
}

#[derive(Clone, Debug)]
pub(super) enum What {
    /// How the robot truly moves, from its board.
    Truth(NavigatorData),
    /// The gate's account.
    State(Box<GateState>),
    /// A reading of the encoders; its cause is the command that the wheels obeyed.
    Reading {
        data: EncodersData,
        meta: Option<Meta>,
    },
    /// A command on its way to the gate.
    Command {
        command: Command,
        meta: Option<Meta>,
    },
    Pilot(Box<PilotProgress>),
    Corrector(Box<CorrectorProgress>),
    /// Where the robot believes to be, at the workstation.
    Pose(NavigatorData),
    /// A process came or went, as a router says.
    Came {
        place: &'static str,
        service: String,
        came: bool,
    },
}

/// What a history comes to.
#[derive(Clone, Debug, Default)]
pub(super) struct Verdict {
    /// What must not be, in sentences.
    pub(super) violations: Vec<String>,
    /// How old each command was when it was obeyed, in ms.
    pub(super) ages: Vec<f64>,
    /// From saying to hearing each command, in ms.
    pub(super) delays: Vec<f64>,
}

/// Judges a history.
pub(super) fn judge(events: &[Event]) -> Verdict {
    let mut verdict = Verdict::default();
    holders(events, &mut verdict.violations);
    obedience(events, &mut verdict);
    tasks(events, &mut verdict.violations);
    verdict
}

/// A grant has one holder.
fn holders(events: &[Event], violations: &mut Vec<String>) {
    let mut of: BTreeMap<(Boot, u32), String> = BTreeMap::new();
    for event in events {
        let What::State(state) = &event.what else { continue };
        let Some(holder) = &state.holder else { continue };
        let first = of.entry((state.boot, state.epoch)).or_insert_with(|| holder.clone());
        if first != holder {
            violations.push(format!("two holders of grant {}: {first} and {holder}", state.epoch));
            first.clone_from(holder);
        }
    }
}

/// A command that was heard.
struct Said {
    command: Command,
    meta: Meta,
    at: f64,
}

/// When a reading was given, by the clock of the bench and by the robot's, in s.
#[derive(Clone, Copy)]
struct Reading {
    source: Boot,
    number: u64,
    at: f64,
    stamp: f64,
}

/// A robot that gives no reading for so long, in s, is frozen or cut off: its beat and its readings take a third of that.
const STILL: f64 = 0.06;

/// Every command that the wheels obeyed was young enough, of the newest grant, and newer than the one before.
fn obedience(events: &[Event], verdict: &mut Verdict) {
    let mut said: BTreeMap<(Boot, u64), Said> = BTreeMap::new();
    for event in events {
        if let What::Command { command, meta: Some(meta) } = &event.what {
            // One that is said again was known before.
            said.entry((meta.source, meta.seq)).or_insert_with(|| {
                verdict.delays.push((event.at - meta.stamp) * 1e3);
                Said { command: *command, meta: *meta, at: event.at }
            });
        }
    }
    let mut last: Option<(Cause, &Said)> = None;
    let mut drivers: BTreeMap<(Boot, u32), Boot> = BTreeMap::new();
    let mut last_reading: Option<Reading> = None;
    for event in events {
        let What::Reading { data, meta: Some(Meta { seq: number, source, cause, .. }) } = &event.what else {
            continue;
        };
        // Whoever listens may be cut off too. Since when the wheels had obeyed a command by then, nobody can tell.
        let reading = Reading { source: *source, number: *number, at: event.at, stamp: data.stamp.0 };
        let before = last_reading.replace(reading).filter(|before| before.source == *source);
        let missed = before.is_some_and(|before| *number > before.number + 1);
        let Some(cause) = cause else { continue };
        if last.is_some_and(|(before, _)| before == *cause) {
            continue;
        }
        // A command that was never heard here cannot be judged; the robot's own router heard nearly all.
        let Some(now) = said.get(&(cause.source, cause.seq)) else { continue };
        let Command { boot, epoch, seq, echo, .. } = now.command;
        let age = f64::from(Tick::of(data.stamp).since(echo));
        // A robot may have obeyed in time, and been frozen before it gave a reading: so may one have that got the command
        // hardly later than it gave the last one. Whatever came later found it frozen, and was obeyed when it thawed.
        let froze =
            before.is_some_and(|before| data.stamp.0 - before.stamp > STILL && now.at < before.at + STILL);
        let is_known = !missed && !froze;
        if is_known {
            verdict.ages.push(age);
        }
        let mut wrong = |why: String| {
            verdict.violations.push(format!("command {seq} of grant {epoch} was obeyed: {why}"))
        };
        if age > OLDEST && is_known {
            wrong(format!("it was {age:.0} ms old"));
        }
        if boot != *source {
            wrong("it was for an earlier run of the robot".to_owned());
        }
        let driver = drivers.entry((boot, epoch)).or_insert(now.meta.source);
        if *driver != now.meta.source {
            wrong("another process had driven by this grant".to_owned());
        }
        if let Some((_, before)) = last.filter(|(_, before)| before.command.boot == boot) {
            let order = (before.command.epoch, before.command.seq);
            if (epoch, seq) <= order {
                wrong(format!("after command {} of grant {}", order.1, order.0));
            }
        }
        last = Some((*cause, now));
    }
}

/// A task ends once, and nothing is said of it afterwards but that.
fn tasks(events: &[Event], violations: &mut Vec<String>) {
    let mut ends: BTreeMap<(&str, TaskId), Phase> = BTreeMap::new();
    for event in events {
        let (who, task, phase) = match &event.what {
            What::Pilot(said) => ("pilot", said.task, &said.phase),
            What::Corrector(said) => ("corrector", said.task, &said.phase),
            _ => continue,
        };
        match ends.get(&(who, task)) {
            Some(end) if end != phase => {
                violations
                    .push(format!("the {who} said of task {task}: {phase:?}, after it had ended: {end:?}"));
            }
            None if phase.is_over() => drop(ends.insert((who, task), phase.clone())),
            _ => {}
        }
    }
}

/// How a task ended, by the pilot's own word.
pub(super) fn end_of(events: &[Event]) -> Option<Phase> {
    events.iter().rev().find_map(|event| match &event.what {
        What::Pilot(said) if said.phase.is_over() => Some(said.phase.clone()),
        _ => None,
    })
}

/// The true speeds from an instant on.
fn speeds(events: &[Event], from: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
    events.iter().filter(move |event| event.at >= from).filter_map(|event| match &event.what {
        What::Truth(data) => data.twist.map(|twist| (event.at, twist.v.0.abs())),
        _ => None,
    })
}

/// From a fault to the moment at which the wheels began to brake for good, in ms: from when they had half of their speed
/// left, and the deceleration that every brake of the gate and of the board has. None where the robot came to no rest.
pub(super) fn brake(events: &[Event], fault: f64) -> Option<f64> {
    let (_, speed) = speeds(events, fault).next()?;
    let rest = speeds(events, fault).find(|(_, now)| *now < REST)?.0;
    let (half, left) = speeds(events, fault).find(|(at, now)| *at <= rest && *now <= speed / 2.0)?;
    Some((half - fault - (speed - left) / A_STOP) * 1e3)
}

/// Whether the robot stands at the end of the history.
#[cfg(test)]
pub(super) fn stands(events: &[Event]) -> bool {
    speeds(events, 0.0).last().is_some_and(|(_, speed)| speed < REST)
}

/// When the first of these events came after an instant.
pub(super) fn first_after(events: &[Event], from: f64, is_it: impl Fn(&What) -> bool) -> Option<f64> {
    events
        .iter()
        .filter(|event| event.at >= from && is_it(&event.what))
        .map(|event| event.at)
        .min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests;
