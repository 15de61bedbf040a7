//! `axle record`: records any keys to MCAP, and works on recordings. What it makes is what the recorder service makes.

use crate::cli::{Record, RecordWork};
use crate::out::{data, note, table, usage};
use crate::params::load;
use crate::run::recorder::Recording;
use crate::settings::Settings;
use axle_recorder::{CopyError, Info, Part, ReadError, RecorderParams, copy};
use axle_schema::key;
use serde_json::json;
use std::path::Path;
use std::time::Duration;

pub(super) async fn record(settings: &Settings, args: Record) -> anyhow::Result<()> {
    match &args.work {
        None => make(settings, args).await,
        Some(RecordWork::Info { file, json }) => info(file, *json),
        Some(RecordWork::Recover { file, out }) => recover(file, out),
        Some(RecordWork::Cut { file, out, from, to, only }) => cut(file, out, *from, *to, only),
    }
}

/// Records until Ctrl-C, or for some time.
async fn make(settings: &Settings, args: Record) -> anyhow::Result<()> {
    let mut params: RecorderParams = load(args.params.as_deref())?;
    params.file = args.out.or(params.file);
    let keys = if args.keys.is_empty() { vec![key::everything(settings.robot.as_ref())] } else { args.keys };
    let who = settings.robot.as_ref().map_or("all", axle_schema::RobotId::as_str);
    let mut stop = crate::signal::stop()?;
    let mesh = settings.join("record").await?;
    let recording = Recording::begin(&mesh, &keys, who, params).map_err(|fault| {
        match fault.downcast_ref::<axle_mesh::Fault>() {
            Some(axle_mesh::Fault::KeyExpression(_)) => usage(fault),
            _ => fault,
        }
    })?;
    note(&format!("recording {} to {}; Ctrl-C ends", keys.join(", "), recording.path.display()));
    let path = recording.path.clone();
    if let Some(seconds) = args.seconds {
        stop = stop.or_after(Duration::from_secs_f64(seconds));
    }
    let totals = recording.end(&mut stop).await?;
    mesh.leave().await;
    let line =
        json!({ "file": path, "samples": totals.samples, "lost": totals.lost, "refused": totals.refused });
    data(&line.to_string())?;
    Ok(())
}

/// A file that is none, or is not there, is the fault of the command line.
pub(super) fn unreadable(fault: ReadError) -> anyhow::Error {
    usage(format!("{:#}", anyhow::Error::new(fault)))
}

#[allow(clippy::cast_precision_loss, reason = "for people")]
fn info(file: &Path, as_json: bool) -> anyhow::Result<()> {
    let info = Info::read(file).map_err(unreadable)?;
    let seconds = (info.span.1 - info.span.0) as f64 / 1e9;
    let hz = |samples: u64| if seconds > 0.0 { samples as f64 / seconds } else { 0.0 };
    let account = &info.account;
    if as_json {
        let streams: Vec<_> = info
            .streams
            .iter()
            .map(|(key, stream)| {
                json!({
                    "key": key, "encoding": stream.encoding, "samples": stream.samples, "bytes": stream.bytes,
                    "hz": hz(stream.samples), "lost": stream.lost, "missing": stream.missing,
                })
            })
            .collect();
        let line = json!({
            "file": file, "about": info.about, "seconds": seconds, "began": info.span.0 as f64 / 1e9,
            "samples": account.samples, "lost": account.lost, "damaged": account.damaged,
            "finished": account.finished, "cut": account.cut, "streams": streams,
        });
        return Ok(data(&line.to_string())?);
    }
    let rows = info.streams.iter().map(|(key, stream)| {
        let schema = stream.encoding.split_once(';').map_or(&*stream.encoding, |(_, schema)| schema);
        let lost = stream.lost.saturating_add(stream.missing);
        vec![
            key.clone(),
            known(key, schema),
            stream.samples.to_string(),
            format!("{:.1} Hz", hz(stream.samples)),
            format!("{:.1} kB", stream.bytes as f64 / 1e3),
            if lost > 0 { lost.to_string() } else { "-".into() },
        ]
    });
    table(&["key", "type", "samples", "rate", "size", "lost"], rows)?;
    for (name, value) in &info.about {
        note(&format!("{name}: {value}"));
    }
    note(&format!("{} samples in {seconds:.1} s", account.samples));
    match &account.cut {
        None => note("whole: closed with its index"),
        Some(cut) => note(&format!("not closed: {cut}; `axle record recover` makes a whole file of it")),
    }
    if account.damaged > 0 {
        note(&format!("{} chunks or records are damaged and were left out", account.damaged));
    }
    Ok(())
}

/// The schema of a stream, and that of its key where it is another one.
fn known(key: &str, schema: &str) -> String {
    match key::find(key).filter(|_| schema.contains('.') && !key::knows(schema)) {
        Some(entry) => format!("{schema} (here {})", entry.carries()),
        None => schema.to_owned(),
    }
}

fn recover(file: &Path, out: &Path) -> anyhow::Result<()> {
    let (account, totals) = copy(file, out, &Part::default()).map_err(uncopied)?;
    note(&format!("{} samples are in {}", totals.samples, out.display()));
    if account.damaged > 0 {
        note(&format!("{} damaged chunks or records could not be saved", account.damaged));
    }
    Ok(())
}

fn cut(file: &Path, out: &Path, from: f64, to: Option<f64>, only: &[String]) -> anyhow::Result<()> {
    let nanoseconds = |name: &str, seconds: f64| {
        if (0.0..=1e9).contains(&seconds) {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
            Ok((seconds * 1e9) as u64)
        } else {
            Err(usage(format!("--{name} {seconds}: write seconds, 0 to 1e9")))
        }
    };
    let from = nanoseconds("from", from)?;
    let to = to.map(|to| nanoseconds("to", to)).transpose()?;
    if to.is_some_and(|to| to < from) {
        return Err(usage("--to is before --from"));
    }
    let (_, totals) = copy(file, out, &Part { from, to, only: only.to_vec() }).map_err(uncopied)?;
    note(&format!("{} samples are in {}", totals.samples, out.display()));
    anyhow::ensure!(totals.samples > 0, "this part of the recording is empty");
    Ok(())
}

fn uncopied(fault: CopyError) -> anyhow::Error {
    match fault {
        CopyError::Read(fault) => unreadable(fault),
        other => anyhow::Error::new(other),
    }
}
