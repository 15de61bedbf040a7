//! Why a robot stands though it has a task: it waits for another robot, and that one for the next, or for a person.

use super::{Explanation, Link};
use crate::replay::{Item, Log};
use axle_schema::task::PilotProgress;
use axle_schema::traffic::{Mover, TrafficState};
use axle_schema::{EncodersData, Seconds, key};
use std::collections::BTreeSet;

/// A word of the pilot that is older than this, in ns, says nothing of the moment: it speaks ten times in a second.
const FRESH: u64 = 1_500_000_000;

/// Explains for whom the robot waited at that time, or waits now.
pub(super) fn explain(log: &Log, at: Option<Seconds>) -> Option<Explanation> {
    let (item, progress) = latest(log, at)?;
    let waiting = progress.waiting?;
    let told = log.traffic.as_ref().map_or_else(Vec::new, |state| chain(state, &log.robot));
    // What Traffic says a moment later may be another story already, and of a person it knows nothing.
    let mut links = if told.iter().any(|link| link.what.contains(&waiting)) {
        told.into_iter().rev().collect()
    } else {
        vec![Link::new(key::GO_PROGRESS.port().to_string(), format!("{} waits {waiting}", log.robot))]
    };
    let points = format!("{} of {} reached", progress.reached, progress.points);
    let last = links.pop()?.fact("task", progress.task.to_string()).fact("way points", points);
    links.push(last);
    let about = match at {
        Some(at) => format!("{} stood still at {:.3} s of its own clock", log.robot, at.0),
        None => {
            format!("{} stands still, {:.1} s after the log begins", log.robot, log.seconds(item.received))
        }
    };
    Some(Explanation { about, links })
}

/// Whether the robot waits now.
pub(crate) fn waits(log: &Log) -> bool {
    latest(log, None).is_some_and(|(_, progress)| progress.waiting.is_some())
}

/// What the pilot said at that time of the robot's clock, or last.
fn latest(log: &Log, at: Option<Seconds>) -> Option<(&Item, PilotProgress)> {
    let words = log.stream(&key::GO_PROGRESS.port().to_string());
    let until = match at {
        None => u64::MAX,
        Some(at) => {
            let encoders = log.stream(&key::ENCODERS.port().to_string());
            let is_before =
                |item: &&Item| item.read::<EncodersData>().is_ok_and(|data| data.stamp.0 <= at.0 + 1e-9);
            encoders.iter().rev().find(is_before)?.received
        }
    };
    let item = words.iter().rev().find(|item| item.received <= until)?;
    let is_fresh = at.is_none() || until - item.received <= FRESH;
    let progress =
        item.read::<PilotProgress>().ok().filter(|progress| is_fresh && !progress.phase.is_over())?;
    Some((item, progress))
}

/// For whom a robot waits, for whom those wait in their turn, and what the last of them does; each robot once.
pub(crate) fn chain(state: &TrafficState, robot: &str) -> Vec<Link> {
    let find = |name: &str| state.robots.iter().find(|mover| mover.robot.as_str() == name);
    let (mut links, mut seen) = (Vec::new(), BTreeSet::new());
    let mut open = vec![robot.to_owned()];
    while let Some(name) = open.pop() {
        let Some(mover) = find(&name).filter(|_| seen.insert(name.clone())) else { continue };
        for wait in &mover.waits {
            links.push(Link::new("traffic", format!("{name} waits for {}: {}", wait.robot, wait.why)));
            open.push(wait.robot.to_string());
        }
        if mover.waits.is_empty() {
            links.push(Link::new("traffic", format!("{name} {}", stage(mover))));
        }
    }
    let order: Vec<&str> =
        state.robots.iter().filter(|mover| mover.turn.is_some()).map(|mover| mover.robot.as_str()).collect();
    if let (Some(first), false) = (links.first_mut(), order.is_empty()) {
        first.facts.push(("they can all end their tasks in this order".to_owned(), order.join(", ")));
    }
    links
}

/// What a robot does that waits for nobody.
fn stage(mover: &Mover) -> String {
    if mover.passed >= mover.pieces {
        format!("stands at ({}) and has no way to drive", place(mover))
    } else if mover.until > mover.passed {
        format!("drives: {} of {} pieces are behind it", mover.passed, mover.pieces)
    } else {
        "has not begun to drive".to_owned()
    }
}

/// Where a robot is, as Traffic knows it.
pub(crate) fn place(mover: &Mover) -> String {
    // Adding 0 makes a plain zero of a negative one.
    format!("{:.1}, {:.1}", mover.place.x.0 + 0.0, mover.place.y.0 + 0.0)
}
