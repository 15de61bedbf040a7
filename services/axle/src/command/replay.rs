//! `axle replay FILE`: feeds services what they had when a recording was made, and compares what they say.

use crate::catalog::{self, CATALOG, Entry};
use crate::cli::Replay;
use crate::out::{data, note, table, usage};
use crate::replay::{Log, Report};
use crate::settings::Settings;
use serde_json::json;

pub(super) fn replay(settings: &Settings, args: &Replay) -> anyhow::Result<()> {
    let chosen = match &args.service {
        Some(name) => vec![named(name)?],
        None => CATALOG.iter().filter(|entry| entry.replay.is_some()).collect(),
    };
    if let (Some(file), [entry]) = (&args.against, &chosen[..]) {
        (entry.check)(Some(file))?;
    }
    let log = Log::read(&args.file, settings.robot.as_ref())?;
    if let Some(cut) = &log.account.cut {
        note(&format!("the recording is cut off: {cut}"));
    }
    if log.account.lost + log.account.damaged > 0 {
        let (lost, damaged) = (log.account.lost, log.account.damaged);
        note(&format!("{lost} samples never reached the recorder, {damaged} records are damaged"));
    }
    log.unread.words().inspect(|words| note(words));
    let mut reports = Vec::new();
    for entry in chosen {
        let Some(replay) = entry.replay else { continue };
        let report = replay(&log, entry.name, args.against.as_deref())?;
        // Services that did nothing in the recording are not in its list, unless one is asked for.
        if report.outputs > 0 || !report.unjudged.is_empty() || args.service.is_some() {
            reports.push((entry.name, report));
        }
    }
    for (name, report) in &reports {
        if args.json {
            let mut line = serde_json::to_value(report)?;
            line["service"] = json!(name);
            line["is_identical"] = json!(report.is_identical());
            line["fields"] = fields(report);
            data(&line.to_string())?;
        } else {
            explain(name, report);
        }
    }
    if !args.json && !reports.is_empty() {
        let rows = reports.iter().map(|(name, report)| row(name, report));
        table(&["service", "outputs", "identical", "differing", "not judged"], rows)?;
    }
    verdict(&reports)
}

/// A service of the catalogue that can be replayed.
fn named(name: &str) -> anyhow::Result<&'static Entry> {
    let entry = catalog::find(name).ok_or_else(|| super::unknown_service(name))?;
    if entry.replay.is_none() {
        let known: Vec<_> =
            CATALOG.iter().filter(|entry| entry.replay.is_some()).map(|entry| entry.name).collect();
        return Err(usage(format!("{name} cannot be replayed; these can: {}", known.join(", "))));
    }
    Ok(entry)
}

fn fields(report: &Report) -> serde_json::Value {
    let fields = report.fields.iter().map(|(field, (largest, count))| {
        json!({ "field": field, "outputs": count, "largest": largest.is_finite().then_some(largest) })
    });
    fields.collect()
}

fn row(name: &str, report: &Report) -> Vec<String> {
    let Report { outputs, identical, unjudged, .. } = report;
    let differing = outputs - identical;
    let skipped: u64 = unjudged.values().sum();
    [name.to_owned(), outputs.to_string(), identical.to_string(), differing.to_string(), skipped.to_string()]
        .to_vec()
}

/// Tells people what differs, and what was not judged.
fn explain(name: &str, report: &Report) {
    for (why, count) in &report.unjudged {
        note(&format!("{name}: {count} not judged: {why}"));
    }
    for difference in &report.differences {
        let crate::replay::Difference { time, stream, field, recorded, replayed } = difference;
        let by = match (recorded.as_f64(), replayed.as_f64()) {
            (Some(old), Some(new)) => format!(" ({:+.3e})", new - old),
            _ => String::new(),
        };
        note(&format!("{name}: at {time:.3} s {stream} {field}: recorded {recorded}, now {replayed}{by}"));
    }
    for (field, (largest, count)) in &report.fields {
        let largest = if largest.is_finite() { format!(", by {largest:.3e} at most") } else { String::new() };
        note(&format!("{name}: {field} differs in {count} outputs{largest}"));
    }
}

fn verdict(reports: &[(&str, Report)]) -> anyhow::Result<()> {
    anyhow::ensure!(!reports.is_empty(), "no service that can be replayed is in the recording");
    let differ: Vec<_> = reports
        .iter()
        .filter(|(_, report)| report.identical < report.outputs)
        .map(|(name, _)| *name)
        .collect();
    anyhow::ensure!(differ.is_empty(), "not the same bits: {}", differ.join(", "));
    let unjudged: Vec<_> =
        reports.iter().filter(|(_, report)| report.outputs == 0).map(|(name, _)| *name).collect();
    anyhow::ensure!(unjudged.is_empty(), "nothing could be judged of: {}", unjudged.join(", "));
    Ok(())
}
