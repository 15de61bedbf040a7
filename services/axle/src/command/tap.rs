//! `axle tap KEYS`: any stream, decoded, one line a message. Read-only, bounded, and never slows a robot.

mod field;
mod line;
mod near;
mod report;
mod since;

use crate::cli::Tap;
use crate::out::{data, note, usage};
use crate::settings::Settings;
use axle_mesh::{Fault, Mesh, Raw};
use axle_schema::key::Presence;
use axle_schema::{RobotId, Seconds};
use field::{Condition, Course, Path};
use report::Report;
use since::Past;
use std::borrow::Borrow;
use std::collections::BTreeSet;
use std::time::Duration;
use tokio::time::{Instant, sleep, sleep_until};

/// Messages that may wait for a slow terminal; older ones are dropped and counted.
const WAITING: usize = 4096;
/// What has come is looked at so often, as screens show pictures: a process that wakes for every message costs the
/// processor more than the messages do.
const GLANCE: Duration = Duration::from_millis(20);
/// A tap that hears nothing for so long says so.
const SILENCE: Duration = Duration::from_secs(2);
/// Processes have so long to say which robots there are.
const PATIENCE: Duration = Duration::from_millis(700);

pub(super) async fn tap(settings: &Settings, args: &Tap) -> anyhow::Result<()> {
    let mut show = Show::of(args)?;
    let mesh = settings.join("tap").await?;
    let tap = mesh.tap(&args.keys, WAITING).map_err(|fault| match fault {
        Fault::KeyExpression(_) => usage(fault),
        other => other.into(),
    })?;
    let mut stop = crate::signal::stop()?;
    let past = match args.since {
        Some(since) => {
            Past::ask(&mesh, &tap, &robots(&mesh, settings, &args.keys).await?, Seconds(since)).await?
        }
        None => Past::default(),
    };
    let mut dropped = 0;
    let end = args.time.map(|time| Instant::now() + Duration::from_secs_f64(time));
    let mut silent_at = Some(Instant::now() + SILENCE);
    show.all(past.samples.iter())?;
    while !show.is_full() {
        tokio::select! {
            raw = tap.next() => {
                silent_at = None;
                // Who is flooded looks up too, for the signal to stop.
                let waiting = std::iter::once(raw).chain(std::iter::from_fn(|| tap.take())).take(WAITING);
                show.all(waiting.filter(|raw| !past.has(raw)))?;
                if !show.is_full() {
                    sleep(GLANCE).await;
                }
            }
            () = show.report.due() => show.report.print()?,
            () = at(silent_at) => {
                silent_at = None;
                let near = near::names(&mesh, &args.keys).await.unwrap_or_default();
                note(&format!("nothing was said on {} for 2 s; {near}", args.keys));
            }
            () = at(end) => break,
            () = stop.wait() => break,
        }
        if tap.dropped() > dropped && !show.report.is_on() {
            dropped = tap.dropped();
            note(&format!("{dropped} messages were dropped: the terminal is slower than the streams"));
        }
    }
    if show.report.is_on() {
        show.report.print()?;
    }
    mesh.leave().await;
    Ok(())
}

/// What is shown of what is heard.
struct Show {
    condition: Option<Condition>,
    course: Option<Course>,
    report: Report,
    json: bool,
    /// How many messages are shown at most.
    most: Option<u64>,
    shown: u64,
}

impl Show {
    fn of(args: &Tap) -> anyhow::Result<Self> {
        Ok(Self {
            condition: args.condition.as_deref().map(Condition::parse).transpose().map_err(usage)?,
            course: args.field.as_deref().map(Path::parse).transpose().map_err(usage)?.map(Course::of),
            report: Report::new(args),
            json: args.json,
            most: args.count,
            shown: 0,
        })
    }
    fn is_full(&self) -> bool {
        self.most.is_some_and(|most| self.shown >= most)
    }
    /// Shows these until it is full; all lines are written in one go.
    fn all(&mut self, samples: impl Iterator<Item = impl Borrow<Raw>>) -> anyhow::Result<()> {
        let mut lines = Vec::new();
        for raw in samples {
            if self.is_full() {
                break;
            }
            let raw = raw.borrow();
            if self.condition.as_ref().is_some_and(|condition| !holds(condition, raw)) {
                continue;
            }
            self.shown += 1;
            match (&mut self.course, self.report.is_on()) {
                (Some(course), _) => lines.push(course.line(raw, self.json)),
                (None, true) => self.report.count(raw),
                (None, false) => lines.push(line::line(raw, self.json)?),
            }
        }
        if !lines.is_empty() {
            data(&lines.join("\n"))?;
        }
        Ok(())
    }
}

/// The robots that a key expression may be about, of those that have a Source.
async fn robots(mesh: &Mesh, settings: &Settings, keys: &str) -> anyhow::Result<Vec<RobotId>> {
    let named = keys.split('/').nth(1).unwrap_or_default();
    if let Ok(robot) = RobotId::new(named) {
        return Ok(vec![robot]);
    }
    if let Some(robot) = &settings.robot {
        return Ok(vec![robot.clone()]);
    }
    let everybody = mesh.everybody(PATIENCE).await?;
    let sources = everybody.into_iter().filter(|(Presence { service, .. }, _)| service == "source");
    let robots: BTreeSet<String> = sources.map(|(presence, _)| presence.robot).collect();
    Ok(robots.iter().filter_map(|robot| RobotId::new(robot).ok()).collect())
}

/// Waits until then, or for ever.
async fn at(instant: Option<Instant>) {
    match instant {
        Some(instant) => sleep_until(instant).await,
        None => std::future::pending().await,
    }
}

/// What cannot be read fulfils no condition.
fn holds(condition: &Condition, raw: &Raw) -> bool {
    line::read(raw).is_ok_and(|value| condition.holds(&value))
}
