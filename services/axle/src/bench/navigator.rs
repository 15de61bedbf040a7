//! `axle bench navigator`: how long a measurement takes through the navigator, in the mesh.
//!
//! The shipped topology runs as processes, with the filter as the navigator's method. From the stamp at which Source sends a
//! window to the stamp at which the navigator sends the pose of it: that is the hop through the router as well, so that what
//! the navigator itself takes is less. Both stamps are of the same computer.

use super::Bed;
use crate::out::{data, note};
use crate::settings::{Settings, join};
use crate::signal;
use anyhow::Context as _;
use axle_mesh::{Inbox, Patience};
use axle_schema::meta::Cause;
use axle_schema::window::Window;
use axle_schema::{NavigatorData, key};
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::time::timeout;

/// A window for which no pose comes within this time was lost.
const LOST: Duration = Duration::from_secs(10);
/// Windows before anything is counted: the navigator is still beginning.
const WARM_UP: usize = 50;

/// Measures.
pub(crate) async fn navigator(settings: &Settings, json: bool, rounds: u32) -> anyhow::Result<()> {
    let mut stop = signal::stop()?;
    let bed = Bed::start(settings, &mut stop, Some("ekf")).await?;
    let measured = tokio::select! {
        measured = measure(&bed, settings, rounds) => measured,
        () = stop.wait() => Err(anyhow::anyhow!("ended before everything was measured")),
    };
    bed.end().await;
    print(&mut measured?, json)
}

async fn measure(bed: &Bed, settings: &Settings, rounds: u32) -> anyhow::Result<Vec<f64>> {
    let mut own = settings.mesh("bench", Some(&bed.robot))?;
    own.connect = vec![bed.endpoint.clone()];
    let mesh = join(own, Patience::AtMost(Duration::from_secs(5))).await?;
    let recent = mesh.inbox(&key::RECENT.of_every_robot(), 1024)?;
    let poses = mesh.inbox(&key::POSE.of_every_robot(), 1024)?;
    note(&format!("{rounds} poses …"));
    let times = listen(&recent, &poses, WARM_UP + rounds as usize).await;
    mesh.leave().await;
    times.map(|mut times| times.split_off(WARM_UP))
}

/// Seconds from window to pose, of so many.
async fn listen(
    recent: &Inbox<Window>,
    poses: &Inbox<NavigatorData>,
    count: usize,
) -> anyhow::Result<Vec<f64>> {
    let mut sent: BTreeMap<(u64, u64), f64> = BTreeMap::new();
    let mut times = Vec::with_capacity(count);
    while times.len() < count {
        let pose =
            timeout(LOST, poses.next()).await.context("no pose came")?.meta.context("a pose without meta")?;
        // Source sends first, so that its window is here when the pose is.
        while let Some(heard) = recent.take() {
            if let Some(meta) = heard.meta {
                sent.insert((meta.source.0, meta.seq), meta.stamp);
            }
        }
        let Some(Cause { source, seq }) = pose.cause else { continue };
        times.extend(sent.remove(&(source.0, seq)).map(|sent| pose.stamp - sent));
        while sent.len() > 1024 {
            sent.pop_first();
        }
    }
    Ok(times)
}

fn print(times: &mut [f64], json: bool) -> anyhow::Result<()> {
    times.sort_by(f64::total_cmp);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "an index"
    )]
    let at = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize] * 1e6;
    let [p50, p99, most] = [0.5, 0.99, 1.0].map(at);
    if json {
        let line = serde_json::json!({ "rounds": times.len(), "p50_us": p50, "p99_us": p99, "max_us": most });
        return Ok(data(&line.to_string())?);
    }
    Ok(data(&format!(
        "from Source to the pose, {} times: p50 {p50:.0} µs, p99 {p99:.0} µs, at most {most:.0} µs",
        times.len()
    ))?)
}
