//! `axle bench taps`: what it costs those who drive that others look on.
//!
//! A message of the size of a command goes there and back between two processes, through the router, at the pace of a
//! corrector, while nobody looks, while 5 and 50 processes `axle tap` print everything, and while one of those is frozen:
//! it reads nothing more, and its queue at the router is full. What must hold is that nobody waits for them.

use super::process::Usage;
use super::{Bed, LOST};
use crate::out::{data, note, table};
use crate::settings::{Settings, join};
use crate::signal;
use anyhow::Context as _;
use axle_mesh::{Mesh, Patience};
use axle_schema::{NavigatorData, Pose, Seconds, key};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::process::Stdio;
use std::time::Duration;
use tokio::process::{Child, Command};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep, timeout};

/// A hundred messages a second are more than any corrector sends.
const PACE: Duration = Duration::from_millis(10);
/// A tap that has printed so many bytes hears everything.
const PRINTED: u64 = 4096;
/// All taps hear everything after this time at the latest.
const COMING: Duration = Duration::from_secs(60);
/// A queue of the router that nobody reads is full after this time.
const FILLING: Duration = Duration::from_secs(3);

/// One phase: how many looked on, and how long the messages took.
struct Phase {
    name: &'static str,
    taps: usize,
    /// In milliseconds, sorted.
    times: Vec<f64>,
    /// Cores that the taps used all together.
    cores: f64,
}

impl Phase {
    fn at(&self, share: f64) -> f64 {
        let last = self.times.len().saturating_sub(1);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "an index"
        )]
        let index = (last as f64 * share).round() as usize;
        self.times.get(index).copied().unwrap_or(0.0)
    }
}

/// Measures.
pub(crate) async fn taps(settings: &Settings, json: bool, rounds: u32) -> anyhow::Result<()> {
    let mut stop = signal::stop()?;
    let bed = Bed::start(settings, &mut stop, None).await?;
    let measured = tokio::select! {
        measured = measure(&bed, settings, rounds) => measured,
        () = stop.wait() => Err(anyhow::anyhow!("ended before everything was measured")),
    };
    bed.end().await;
    print(&measured?, json)
}

async fn measure(bed: &Bed, settings: &Settings, rounds: u32) -> anyhow::Result<Vec<Phase>> {
    let mut own = settings.mesh("bench", Some(&bed.robot))?;
    own.connect = vec![bed.endpoint.clone()];
    let mesh = join(own, Patience::AtMost(Duration::from_secs(5))).await?;
    let mut looking: Vec<Child> = Vec::new();
    let mut phases = Vec::new();
    for (name, count, freezes) in [
        ("nobody looks on", 0, false),
        ("5 taps", 5, false),
        ("50 taps", 50, false),
        ("50 taps, one of them frozen", 50, true),
    ] {
        note(&format!("{name} …"));
        while looking.len() < count {
            looking.push(tap(&bed.endpoint)?);
        }
        all_print(&looking).await?;
        if freezes && let Some(pid) = looking.first().and_then(Child::id) {
            kill(Pid::from_raw(i32::try_from(pid)?), Signal::SIGSTOP).context("freeze a tap")?;
            sleep(FILLING).await;
        }
        let usage = || Usage::of(looking.iter().filter_map(Child::id)).cpu;
        let (before, began) = (usage(), Instant::now());
        let times = hops(&mesh, bed, rounds).await?;
        let cores = usage().saturating_sub(before).as_secs_f64() / began.elapsed().as_secs_f64();
        phases.push(Phase { name, taps: count, times, cores });
    }
    mesh.leave().await;
    Ok(phases)
}

/// Somebody who looks at everything; it goes with this process.
fn tap(endpoint: &str) -> anyhow::Result<Child> {
    Command::new(std::env::current_exe()?)
        .args(["tap", &key::everything(None), "--json", "--connect", endpoint, "--log", "error"])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .kill_on_drop(true)
        .spawn()
        .context("start a tap")
}

/// Waits until each one prints what it hears.
async fn all_print(looking: &[Child]) -> anyhow::Result<()> {
    let printed = |pid: u32| -> u64 {
        let account = std::fs::read_to_string(format!("/proc/{pid}/io")).unwrap_or_default();
        let line = account.lines().find_map(|line| line.strip_prefix("wchar:"));
        line.and_then(|bytes| bytes.trim().parse().ok()).unwrap_or(0)
    };
    let end = Instant::now() + COMING;
    while looking.iter().filter_map(Child::id).any(|pid| printed(pid) < PRINTED) {
        anyhow::ensure!(Instant::now() < end, "not every tap hears something after {COMING:?}");
        sleep(Duration::from_millis(20)).await;
    }
    Ok(())
}

/// Messages there and back at a steady pace, in milliseconds, sorted. One that is lost counts as long as it was waited for.
async fn hops(mesh: &Mesh, bed: &Bed, rounds: u32) -> anyhow::Result<Vec<f64>> {
    let (there, back) = key::BENCH;
    let there = mesh.publisher(&there.of(&bed.robot))?;
    let back = mesh.inbox(&back.of(&bed.robot), 1)?;
    let pose =
        NavigatorData { stamp: Seconds(12.34), pose: Pose::new(0.1, 0.2, 0.3), ..NavigatorData::default() };
    let end = Instant::now() + Duration::from_secs(10);
    loop {
        there.put(&pose, None)?;
        if timeout(Duration::from_millis(50), back.next()).await.is_ok() {
            break;
        }
        anyhow::ensure!(Instant::now() < end, "the other end of the bench does not answer");
    }
    let mut pace = interval(PACE);
    pace.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut times = Vec::new();
    for _ in 0..rounds {
        pace.tick().await;
        // What is left of a lost round would answer this one.
        while back.take().is_some() {}
        let began = Instant::now();
        there.put(&pose, None)?;
        // One that is lost has taken as long as it was waited for.
        drop(timeout(LOST, back.next()).await);
        times.push(began.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok(times)
}

fn print(phases: &[Phase], json: bool) -> anyhow::Result<()> {
    let base = phases.first().map_or(0.0, |phase| phase.at(0.99));
    let apart = phases.iter().map(|phase| phase.at(0.99) - base).fold(0.0, f64::max);
    if json {
        let rows = phases.iter().map(|phase| {
            serde_json::json!({
                "name": phase.name, "taps": phase.taps, "rounds": phase.times.len(), "taps_cores": phase.cores,
                "p50_ms": phase.at(0.5), "p99_ms": phase.at(0.99), "max_ms": phase.at(1.0),
            })
        });
        let line = serde_json::json!({ "phases": rows.collect::<Vec<_>>(), "p99_apart_ms": apart });
        return Ok(data(&line.to_string())?);
    }
    let rows = phases.iter().map(|phase| {
        let mut row = vec![phase.name.to_owned()];
        row.extend([0.5, 0.99, 1.0].map(|share| format!("{:.2} ms", phase.at(share))));
        row.push(format!("{:.2}", phase.cores));
        row
    });
    table(&["there and back while", "p50", "p99", "longest", "cores of taps"], rows)?;
    note(&format!("the 99th percentiles are at most {apart:.2} ms above the one of nobody"));
    Ok(())
}
