//! `axle tap KEYS`: any stream, decoded, one line a message. Read-only, bounded, and never slows a robot.

use crate::cli::Tap;
use crate::out::{data, note, usage};
use crate::settings::Settings;
use axle_mesh::{Fault, Raw};
use axle_schema::{codec, key};
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::time::{Instant, sleep_until};

/// Messages that may wait for a slow terminal; older ones are dropped and counted.
const WAITING: usize = 4096;
/// A tap that hears nothing for so long says so.
const SILENCE: Duration = Duration::from_secs(2);

pub(super) async fn tap(settings: &Settings, args: &Tap) -> anyhow::Result<()> {
    let mesh = settings.join("tap").await?;
    let tap = mesh.tap(&args.keys, WAITING).map_err(|fault| match fault {
        Fault::KeyExpression(_) => usage(fault),
        other => other.into(),
    })?;
    let mut stop = crate::signal::stop()?;
    let (mut heard, mut dropped) = (0_u64, 0);
    let mut silent_at = Some(Instant::now() + SILENCE);
    let mut report = Report::new(args.hz || args.bw);
    loop {
        let silence = async {
            match silent_at {
                Some(at) => sleep_until(at).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            raw = tap.next() => {
                heard += 1;
                silent_at = None;
                if report.is_on { report.count(&raw) } else { data(&line(&raw, args.json)?)? }
            }
            () = report.due() => report.print(args)?,
            () = silence => {
                silent_at = None;
                note(&format!("nothing was said on {} for 2 s; `axle ls` lists the streams", args.keys));
            }
            () = stop.wait() => break,
        }
        if tap.dropped() > dropped && !report.is_on {
            dropped = tap.dropped();
            note(&format!("{dropped} messages were dropped: the terminal is slower than the streams"));
        }
        if args.count.is_some_and(|count| heard >= count) {
            break;
        }
    }
    if report.is_on {
        report.print(args)?;
    }
    mesh.leave().await;
    Ok(())
}

/// One message as a line.
fn line(raw: &Raw, json: bool) -> serde_json::Result<String> {
    let value = read(raw);
    if json {
        let meta = raw.meta();
        let (value, problem) = match value {
            Ok(value) => (Some(value), None),
            Err(problem) => (None, Some(problem)),
        };
        #[allow(clippy::cast_precision_loss, reason = "microseconds are enough for a line of text")]
        let received = raw.received as f64 / 1e9;
        let mut line = serde_json::json!({
            "key": raw.key, "type": schema(raw), "received": received, "bytes": raw.payload.len(),
            "meta": meta, "value": value,
        });
        if let Some(problem) = problem {
            line["problem"] = problem.into();
        }
        return serde_json::to_string(&line);
    }
    Ok(match value {
        Ok(value) => format!("{} {}", raw.key, brief(&value)),
        Err(problem) => format!("{} ({} bytes, {}) {problem}", raw.key, raw.payload.len(), schema(raw)),
    })
}

/// Decodes a sample by its schema; what Axle does not know is shown as what it says of itself.
fn read(raw: &Raw) -> Result<serde_json::Value, String> {
    if raw.deletes {
        return Err("deleted".into());
    }
    match key::to_json(&raw.key, &raw.encoding, &raw.payload) {
        Err(axle_schema::Refusal::Unknown { .. }) => {
            codec::inspect(&raw.payload).map_err(|refusal| refusal.to_string())
        }
        other => other.map_err(|refusal| refusal.to_string()),
    }
}

fn schema(raw: &Raw) -> &str {
    raw.encoding.split_once(';').map_or(&*raw.encoding, |(_, schema)| schema)
}

/// The value in one line for people: floats are cut to what an eye takes in, long lists to their length.
fn brief(value: &serde_json::Value) -> String {
    use serde_json::Value;
    match value {
        Value::Number(number) if number.is_f64() => {
            let number = number.as_f64().unwrap_or_default();
            if number.abs() >= 1e-3 || number.abs() < f64::MIN_POSITIVE {
                let text = format!("{number:.4}");
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            } else {
                format!("{number:.2e}")
            }
        }
        Value::Array(items) if items.len() > 4 => format!("[… {} items]", items.len()),
        Value::Array(items) => format!("[{}]", items.iter().map(brief).collect::<Vec<_>>().join(", ")),
        Value::Object(fields) => {
            let fields: Vec<_> =
                fields.iter().map(|(name, value)| format!("{name}: {}", brief(value))).collect();
            format!("{{{}}}", fields.join(", "))
        }
        other => other.to_string(),
    }
}

/// Rates or bandwidths, once a second.
struct Report {
    is_on: bool,
    since: Instant,
    streams: BTreeMap<String, (u64, u64)>,
}

impl Report {
    fn new(is_on: bool) -> Self {
        Self { is_on, since: Instant::now(), streams: BTreeMap::new() }
    }
    fn count(&mut self, raw: &Raw) {
        let stream = self.streams.entry(raw.key.clone()).or_default();
        stream.0 += 1;
        stream.1 += raw.payload.len() as u64;
    }
    async fn due(&self) {
        if self.is_on {
            sleep_until(self.since + Duration::from_secs(1)).await;
        } else {
            std::future::pending().await
        }
    }
    #[allow(clippy::cast_precision_loss, reason = "rates for people")]
    fn print(&mut self, args: &Tap) -> anyhow::Result<()> {
        let seconds = self.since.elapsed().as_secs_f64().max(1e-3);
        for (key, (count, bytes)) in &self.streams {
            let (hz, bytes) = (*count as f64 / seconds, *bytes as f64 / seconds);
            if args.json {
                data(&serde_json::json!({ "key": key, "hz": hz, "bytes_per_second": bytes }).to_string())?;
            } else if args.hz {
                data(&format!("{key} {hz:.1} Hz"))?;
            } else {
                data(&format!("{key} {:.2} kB/s", bytes / 1000.0))?;
            }
        }
        self.since = Instant::now();
        self.streams.values_mut().for_each(|stream| *stream = (0, 0));
        Ok(())
    }
}
