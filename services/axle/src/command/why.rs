//! `axle why ROBOT`: from what its wheels did back to the way it was sent, live or from a recording.

use crate::cli::Why;
use crate::out::{data, note};
use crate::replay::{Item, Log};
use crate::settings::Settings;
use crate::why::{Explanation, explain};
use axle_mesh::Retry;
use axle_schema::traffic::TrafficAsk;
use axle_schema::{Seconds, key};
use std::time::Duration;
use tokio::time::{Instant, timeout_at};

/// Samples that may wait while the mesh is heard.
const WAITING: usize = 65_536;

pub(super) async fn why(settings: &Settings, args: &Why) -> anyhow::Result<()> {
    let settings = args.settings(settings);
    let log = match &args.file {
        Some(file) => Log::read(file, Some(&args.whose))?,
        None => listen(&settings, args).await?,
    };
    log.unread.words().inspect(|words| note(words));
    let explained = explain(&log, args.at.map(Seconds));
    anyhow::ensure!(
        !explained.is_empty(),
        "nothing is known of {} {}",
        args.whose,
        args.at.map_or_else(|| "yet".to_owned(), |at| format!("at {at} s of its own clock"))
    );
    for explanation in &explained {
        if args.json {
            data(&serde_json::to_string(explanation)?)?;
        } else {
            print(explanation)?;
        }
    }
    Ok(())
}

/// Traffic has this long to say who waits for whom.
const PATIENCE: Duration = Duration::from_secs(1);

/// Hears the mesh for a moment.
async fn listen(settings: &Settings, args: &Why) -> anyhow::Result<Log> {
    let mesh = settings.join("why").await?;
    let tap = mesh.tap(&key::everything(Some(&args.whose)), WAITING)?;
    note(&format!("listening for {} s; what was said before is not known", args.seconds));
    let end = Instant::now() + Duration::from_secs_f64(args.seconds);
    let mut log = Log::of(args.whose.as_str());
    while let Ok(raw) = timeout_at(end, tap.next()).await {
        let Some(place) = key::place(&raw.key) else { continue };
        let (port, meta) = (format!("{}/{}", place.service, place.name), raw.meta());
        let item = Item { encoding: raw.encoding.into(), meta, payload: raw.payload, received: raw.received };
        log.push(&port, item);
    }
    if crate::why::waiting::waits(&log) {
        // A robot without a fleet waits for people only, and nobody answers.
        let asked = mesh.ask(&key::TRAFFIC, None, &TrafficAsk {}, PATIENCE, Retry::Never).await;
        log.traffic = asked.ok();
    }
    mesh.leave().await;
    Ok(log)
}

fn print(explanation: &Explanation) -> std::io::Result<()> {
    data(&explanation.about)?;
    for link in &explanation.links {
        let before = link.before.map_or_else(String::new, |before| format!(", {before:.3} s before"));
        let stream = if link.stream.is_empty() { String::new() } else { format!(" ({})", link.stream) };
        data(&format!("- {}{stream}{before}", link.what))?;
        for (name, value) in &link.facts {
            data(&format!("    {name}: {value}"))?;
        }
    }
    Ok(())
}
