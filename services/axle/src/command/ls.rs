//! `axle ls`: every stream with type, rate and size.

use crate::cli::Ls;
use crate::out::{data, is_watched, note, table};
use crate::settings::Settings;
use axle_schema::key;
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::time::{Instant, timeout_at};

/// What was heard of one stream.
#[derive(Default)]
struct Heard {
    schema: String,
    count: u64,
    bytes: u64,
    by: String,
    is_call: bool,
}

pub(super) async fn ls(settings: &Settings, args: &Ls) -> anyhow::Result<()> {
    let mesh = settings.join("ls").await?;
    let tap = mesh.tap(&key::everything(settings.robot.as_ref()), 65536)?;
    if is_watched() {
        note(&format!("listening for {} s …", args.seconds));
    }
    let end = Instant::now() + Duration::from_secs_f64(args.seconds);
    let mut streams: BTreeMap<String, Heard> = BTreeMap::new();
    while let Ok(raw) = timeout_at(end, tap.next()).await {
        let stream = streams.entry(raw.key).or_default();
        stream.schema =
            raw.encoding.split_once(';').map_or(raw.encoding.clone(), |(_, schema)| schema.to_owned());
        stream.count += 1;
        stream.bytes += raw.payload.len() as u64;
    }
    // What live services declare belongs to the list even when it was silent.
    for (_, status) in mesh.everybody(Duration::from_millis(700)).await? {
        let Some(status) = status else { continue };
        for says in status.says {
            if settings.robot.as_ref().is_some_and(|robot| !says.contains(&format!("/{robot}/"))) {
                continue;
            }
            let entry = key::find(&says);
            let stream = streams.entry(says).or_default();
            stream.by.clone_from(&status.service);
            stream.is_call = entry.is_some_and(|entry| entry.kind == key::Kind::Call);
            if stream.schema.is_empty() {
                stream.schema = entry.map_or_else(|| "?".into(), key::Entry::carries);
            }
        }
    }
    print(&streams, args)?;
    mesh.leave().await;
    Ok(())
}

fn print(streams: &BTreeMap<String, Heard>, args: &Ls) -> anyhow::Result<()> {
    #[allow(clippy::cast_precision_loss, reason = "rates for people")]
    let rate = |stream: &Heard| stream.count as f64 / args.seconds;
    #[allow(clippy::cast_precision_loss, reason = "sizes for people")]
    let size =
        |stream: &Heard| if stream.count > 0 { stream.bytes as f64 / stream.count as f64 } else { 0.0 };
    if args.json {
        let rows: Vec<_> = streams
            .iter()
            .map(|(key, stream)| {
                serde_json::json!({
                    "key": key, "type": stream.schema, "by": stream.by, "kind": if stream.is_call { "call" } else { "stream" },
                    "hz": rate(stream), "bytes": size(stream), "messages": stream.count,
                })
            })
            .collect();
        return Ok(data(&serde_json::to_string(&rows)?)?);
    }
    if streams.is_empty() {
        note("nothing is said on this mesh; start services with `axle up`");
        return Ok(());
    }
    let rows = streams.iter().map(|(key, stream)| {
        let (hz, bytes) = match (stream.is_call, stream.count) {
            (true, _) => ("call".into(), "-".into()),
            (false, 0) => ("silent".into(), "-".into()),
            (false, _) => (format!("{:.1} Hz", rate(stream)), format!("{:.0} B", size(stream))),
        };
        vec![key.clone(), stream.schema.clone(), hz, bytes, stream.by.clone()]
    });
    Ok(table(&["key", "type", "rate", "size", "by"], rows)?)
}
