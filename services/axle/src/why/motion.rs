//! Why the wheels turned as they did: way, plan, movements, order, correction, command, wheels.

use super::{Explanation, Link};
use crate::replay::{Item, Log};
use axle_schema::command::{Command, GateState};
use axle_schema::meta::Cause;
use axle_schema::task::CorrectorProgress;
use axle_schema::trace::{Named, Trace};
use axle_schema::window::Window;
use axle_schema::{
    Drive, Dwm, EncodersData, Geometry, Leg, NavigatorData, Plan, Seconds, Sides, Signals, Task, TaskId,
    WayTask, key,
};

/// A state of the gate or a signal that is older than this, in s, says nothing of the moment.
const FRESH: f64 = 1.5;

/// Explains the measurement of that time, or the newest that a command has caused.
pub(super) fn explain(log: &Log, at: Option<Seconds>) -> Option<Explanation> {
    let encoders = log.stream(&key::ENCODERS.port().to_string());
    let caused = |item: &&Item| item.meta.is_some_and(|meta| meta.cause.is_some());
    let is_before = |item: &&Item| {
        at.is_none_or(|at| item.read::<EncodersData>().is_ok_and(|data| data.stamp.0 <= at.0 + 1e-9))
    };
    let moment = match at {
        Some(_) => encoders.iter().rev().find(is_before)?,
        None => encoders.iter().rev().find(caused).or(encoders.last())?,
    };
    let data: EncodersData = moment.read().ok()?;
    let about = format!("{} at {:.3} s of its own clock", log.robot, data.stamp.0);
    let mut links = vec![wheels(log, moment, &data)];
    match moment.meta.and_then(|meta| meta.cause) {
        Some(cause) => command(log, cause, &data, moment.received, &mut links),
        None => {
            links.push(Link::new("gate/command", "no command was obeyed since the robot's process began"))
        }
    }
    links.reverse();
    Some(Explanation { about, links })
}

/// What the robot measured, what its motors were given, and what the gate said of it.
fn wheels(log: &Log, moment: &Item, data: &EncodersData) -> Link {
    let mut link = Link::new("robot/encoders", "the wheels have covered this")
        .before(0.0)
        .fact("left", metres(data.left.0))
        .fact("right", metres(data.right.0));
    if let Some(item) = last_before(log, "robot/signals", moment)
        && let Ok(Signals { left, right }) = item.read()
    {
        link = link.fact("signals", format!("left {:.3}, right {:.3}", left.get(), right.get()));
    }
    if let Some(item) = last_before(log, "gate/state", moment)
        && let Ok(state) = item.read::<GateState>()
    {
        let holder = state.holder.as_deref().unwrap_or("nobody");
        let enabled = if state.enabled { "" } else { ", disabled" };
        let brake = state.cause.map_or_else(String::new, |cause| format!(", last braked by {cause:?}"));
        link = link.fact("gate", format!("{:?} for {holder}{enabled}{brake}", state.motion));
        let rejected: u64 = state.rejected.values().sum();
        if rejected > 0 {
            let reasons: Vec<_> =
                state.rejected.iter().map(|(why, count)| format!("{why:?} {count}")).collect();
            link = link.fact("commands refused since boot", reasons.join(", "));
        }
    }
    link
}

/// The newest sample of a stream that is not much older than the moment, and not younger.
fn last_before<'a>(log: &'a Log, port: &str, moment: &Item) -> Option<&'a Item> {
    let items = log.stream(port);
    let item = items.iter().rev().find(|item| item.received <= moment.received)?;
    (since(item.received, moment.received) <= FRESH).then_some(item)
}

fn command(log: &Log, cause: Cause, data: &EncodersData, moment: u64, links: &mut Vec<Link>) {
    let port = key::COMMAND.port().to_string();
    let Some((_, item)) = log.find_on(&[&port], cause) else {
        links.push(Link::new("gate/command", "a command that was not recorded"));
        return;
    };
    let Ok(command) = item.read::<Command>() else { return };
    let mut link = Link::new("gate/command", format!("command {} of lease {}", command.seq, command.epoch))
        .before(since(item.received, moment))
        .fact("movement", movement(&command.dwm));
    let echo = f64::from(command.echo.0) / 1e3;
    // The tick wraps after 49 days; then there is nothing to compare.
    if (0.0..60.0).contains(&(data.stamp.0 - echo)) {
        link =
            link.fact("echo", format!("computed from what was measured {} before", ms(data.stamp.0 - echo)));
    }
    links.push(link);
    match item.meta.and_then(|meta| meta.cause) {
        Some(cause) => correction(log, cause, (item, &command), moment, links),
        None => links.push(Link::new("", "the command names no cause: it came from a plain client")),
    }
}

fn correction(
    log: &Log,
    cause: Cause,
    (said, command): (&Item, &Command),
    moment: u64,
    links: &mut Vec<Link>,
) {
    let ports: Vec<&str> =
        log.ports().map(|(port, _)| port).filter(|port| port.ends_with("/progress")).collect();
    let Some((port, item)) = log.find_on(&ports, cause) else {
        links.push(Link::new("", "what caused the command was not recorded, or is no correction"));
        return;
    };
    let Ok(progress) = item.read::<CorrectorProgress>() else { return };
    let service = port.trim_end_matches("/progress");
    let mut link = Link::new(port, format!("{service} corrected")).before(since(item.received, moment)).fact(
        "plan",
        format!("{:.1} % should be behind after {:.3} s", progress.fraction * 1e2, progress.elapsed.0),
    );
    if let (Some(due), Some(real)) = (progress.due, progress.real) {
        let error = Sides::new(due.left.0 - real.left.0, due.right.0 - real.right.0);
        link = link
            .fact("due", pair(due.map(|due| due.0)))
            .fact("covered", pair(real.map(|real| real.0)))
            .fact("error", pair(error));
    }
    let trace = said.name().and_then(|name| trace(log, service, name));
    let inputs = trace.as_ref().map_or_else(Vec::new, |trace| inputs(log, trace, command));
    for (name, value) in inputs {
        link = link.fact(&name, value);
    }
    links.push(link);
    order(log, service, &progress, moment, links);
}

/// The trace of the beat that gave this command.
fn trace(log: &Log, service: &str, command: Cause) -> Option<Trace> {
    let wanted = Named::new(key::COMMAND.port(), command);
    let traces = log.stream(&format!("{service}/trace"));
    traces.iter().filter_map(|item| item.read::<Trace>().ok()).find(|trace| trace.said.contains(&wanted))
}

/// What a corrector had before it, and how old it was by the robot's clock.
fn inputs(log: &Log, trace: &Trace, command: &Command) -> Vec<(String, String)> {
    let newest = f64::from(command.echo.0) / 1e3;
    let mut facts = Vec::new();
    if let Some(at) = trace.at {
        facts.push(("beat".to_owned(), format!("at {:.3} s of its own clock", at.0)));
    }
    for named in &trace.took {
        let Some(item) = log.find(named) else {
            facts.push((named.port.clone(), format!("sample {} was not recorded", named.seq)));
            continue;
        };
        if let Ok(window) = item.read::<Window>() {
            if let Some(last) = window.encoders.last() {
                let words = format!(
                    "sample {}, {} readings to {:.3} s",
                    named.seq,
                    window.encoders.len(),
                    last.stamp.0
                );
                facts.push((named.port.clone(), words));
            }
        } else if let Ok(NavigatorData { stamp, pose, .. }) = item.read() {
            let age = ms((newest - stamp.0).max(0.0));
            let words = format!(
                "sample {}: x {:.4} m, y {:.4} m, heading {:.4} rad, {age} older than the readings",
                named.seq, pose.x.0, pose.y.0, pose.heading.0
            );
            facts.push((named.port.clone(), words));
        }
    }
    facts
}

/// The order that the corrector follows, and back to the way.
fn order(log: &Log, service: &str, progress: &CorrectorProgress, moment: u64, links: &mut Vec<Link>) {
    let port = format!("{service}/task");
    let mut place = Place::default();
    if let Some((item, task)) = task::<Drive>(log, &port, progress.task) {
        place = Place::of(&task.plan, progress.elapsed.0);
        links.push(
            place
                .movement(&task.plan, Link::new(&port, format!("{service} was ordered to drive")))
                .before(since(item.received, moment)),
        );
    } else if let Some((item, task)) = task::<Plan>(log, &port, progress.task) {
        links.push(
            Link::new(&port, format!("{service} was ordered to follow a plan"))
                .before(since(item.received, moment))
                .fact("task", progress.task.to_string())
                .fact("legs", task.plan.legs.len().to_string()),
        );
    } else {
        let words =
            format!("the order of task {} was said before this began, or was not recorded", progress.task);
        links.push(Link::new(&port, words));
    }
    if let Some((item, task)) = task::<Drive>(log, "pilot/drive", progress.task) {
        if place.dwm.is_none() {
            place = Place::of(&task.plan, progress.elapsed.0);
        }
        let link = Link::new("pilot/drive", "Pathdriver turned geometries into movements")
            .before(since(item.received, moment))
            .fact("movements", format!("{} in {:.3} s", task.plan.dwms.len(), task.plan.duration.0));
        links.push(link);
    }
    let mut point = None;
    if let Some((item, Task { plan, .. })) = task::<Plan>(log, "pilot/plan", progress.task) {
        let mut link = Link::new("pilot/plan", "Pathfinder turned the way into geometries")
            .before(since(item.received, moment))
            .fact("legs", format!("{}, {:.3} m", plan.legs.len(), plan.length.0));
        if let Some((number, leg)) = place.leg.and_then(|leg| Some((leg, plan.legs.get(leg)?))) {
            point = Some(leg.point);
            link = link.fact("now", format!("leg {} of {}: {}", number + 1, plan.legs.len(), shape(leg)));
        }
        links.push(link);
    }
    if let Some((item, Task { plan, .. })) = task::<WayTask>(log, "pilot/way", progress.task) {
        let mut link = Link::new("pilot/way", "somebody asked for a way")
            .before(since(item.received, moment))
            .fact("task", progress.task.to_string())
            .fact("points", plan.points.len().to_string());
        if let Some((number, to)) = point.and_then(|point| Some((point, plan.points.get(point as usize)?))) {
            let words =
                format!("point {} of {}: x {} m, y {} m", number + 1, plan.points.len(), to.x.0, to.y.0);
            link = link.fact("now", words);
        }
        links.push(link);
    }
}

/// The last sample of a stream that is this task.
fn task<'a, P>(log: &'a Log, port: &str, id: TaskId) -> Option<(&'a Item, Task<P>)>
where
    Task<P>: axle_schema::Message,
{
    let first = log.stream(port).iter().filter_map(|item| Some((item, item.read::<Task<P>>().ok()?)));
    first.into_iter().find(|(_, task)| task.id == id)
}

/// Where in a drive the corrector was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Place {
    /// The movement, and the time within it.
    dwm: Option<(usize, f64)>,
    leg: Option<usize>,
}

impl Place {
    fn of(drive: &Drive, elapsed: f64) -> Self {
        let mut left = elapsed.max(0.0);
        let Some(last) = drive.dwms.len().checked_sub(1) else { return Self::default() };
        let mut index = 0;
        while let Some(dwm) = drive.dwms.get(index).filter(|dwm| index < last && dwm.duration().0 <= left) {
            left -= dwm.duration().0;
            index += 1;
        }
        let mut before = 0_usize;
        let leg = drive.counts.iter().position(|count| {
            before += *count as usize;
            index < before
        });
        Self { dwm: Some((index, left)), leg }
    }
    fn movement(self, drive: &Drive, link: Link) -> Link {
        let Some((index, within)) = self.dwm else { return link };
        let Some(dwm) = drive.dwms.get(index) else { return link };
        let place = if within > dwm.duration().0 {
            format!("{:.3} s after it", within - dwm.duration().0)
        } else {
            format!("{within:.3} s into it")
        };
        let words = format!("movement {} of {}, {place}: ", index + 1, drive.dwms.len());
        link.fact("now", words + &movement(dwm))
    }
}

fn movement(dwm: &Dwm) -> String {
    let (start, end) = (dwm.start(), dwm.end());
    format!(
        "left {:.4} to {:.4} m/s, right {:.4} to {:.4} m/s, in {:.3} s",
        start.left.0,
        end.left.0,
        start.right.0,
        end.right.0,
        dwm.duration().0
    )
}

fn shape(leg: &Leg) -> String {
    match leg.geometry {
        Geometry::Line { length } => format!("a line of {:.4} m", length.0),
        Geometry::Turn { angle } => format!("a turn of {:.4} rad on the spot", angle.0),
        Geometry::Arc { radius, angle } => {
            format!("an arc of radius {:.4} m and {:.4} rad", radius.0, angle.0)
        }
    }
}

fn pair(sides: Sides<f64>) -> String {
    format!("left {}, right {}", metres(sides.left), metres(sides.right))
}

fn metres(value: f64) -> String {
    format!("{value:.4} m")
}

fn ms(seconds: f64) -> String {
    format!("{:.1} ms", seconds * 1e3)
}

/// Seconds between two times of the recorder.
#[allow(clippy::cast_precision_loss, reason = "a difference for people")]
fn since(earlier: u64, later: u64) -> f64 {
    later.saturating_sub(earlier) as f64 / 1e9
}
