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
use std::collections::BTreeSet;
use std::time::Duration;
use tokio::time::{Instant, sleep_until};

/// Messages that may wait for a slow terminal; older ones are dropped and counted.
const WAITING: usize = 4096;
/// A tap that hears nothing for so long says so.
const SILENCE: Duration = Duration::from_secs(2);
/// Processes have so long to say which robots there are.
const PATIENCE: Duration = Duration::from_millis(700);

pub(super) async fn tap(settings: &Settings, args: &Tap) -> anyhow::Result<()> {
    let condition = args.condition.as_deref().map(Condition::parse).transpose().map_err(usage)?;
    let mut course = args.field.as_deref().map(Path::parse).transpose().map_err(usage)?.map(Course::of);
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
    let (mut heard, mut dropped) = (0_u64, 0);
    let end = args.time.map(|time| Instant::now() + Duration::from_secs_f64(time));
    let mut silent_at = Some(Instant::now() + SILENCE);
    let mut report = Report::new(args);
    let mut say = |raw: &Raw, report: &mut Report| -> anyhow::Result<u64> {
        if condition.as_ref().is_some_and(|condition| !holds(condition, raw)) {
            return Ok(0);
        }
        match (&mut course, report.is_on()) {
            (Some(course), _) => course.say(raw, args.json)?,
            (None, true) => report.count(raw),
            (None, false) => data(&line::line(raw, args.json)?)?,
        }
        Ok(1)
    };
    let is_enough = |heard: u64| args.count.is_some_and(|count| heard >= count);
    for raw in &past.samples {
        heard += say(raw, &mut report)?;
        if is_enough(heard) {
            mesh.leave().await;
            return Ok(());
        }
    }
    loop {
        tokio::select! {
            raw = tap.next() => {
                silent_at = None;
                if !past.has(&raw) {
                    heard += say(&raw, &mut report)?;
                }
            }
            () = report.due() => report.print()?,
            () = at(silent_at) => {
                silent_at = None;
                let near = near::names(&mesh, &args.keys).await.unwrap_or_default();
                note(&format!("nothing was said on {} for 2 s; {near}", args.keys));
            }
            () = at(end) => break,
            () = stop.wait() => break,
        }
        if tap.dropped() > dropped && !report.is_on() {
            dropped = tap.dropped();
            note(&format!("{dropped} messages were dropped: the terminal is slower than the streams"));
        }
        if is_enough(heard) {
            break;
        }
    }
    if report.is_on() {
        report.print()?;
    }
    mesh.leave().await;
    Ok(())
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
