//! `axle bench fleet`: what a fleet of emulated robots costs, and how late its beats come.
//!
//! Each robot is four processes, as everywhere: emulator, source, navigator and corrector; two planners work for all. They
//! measure and correct at 10 Hz, and all of them drive while it is measured. A beat is late by what its command was said
//! after the earliest moment that the rhythm of its corrector allows.

use super::faults::quantile;
use super::process::Usage;
use crate::command::up::all_alive_within;
use crate::out::{data, note, table};
use crate::settings::{Settings, join};
use crate::signal;
use crate::supervisor::{Log, Supervisor};
use crate::topology::Topology;
use anyhow::Context as _;
use axle_mesh::{Mesh, Patience, Retry, random_bits};
use axle_schema::command::Command;
use axle_schema::meta::Meta;
use axle_schema::{Drive, DriveAsk, PlanAsk, Pose, RobotId, Task, TaskId, WayTask, decode, key};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::time::{Instant, sleep};

/// The pace of everybody, s.
const PERIOD: f64 = 0.1;
/// The way of each robot, in m: longer than is looked at.
const WAY: &str = "30,0";
/// How long is looked at a fleet that drives.
const LOOKING: Duration = Duration::from_secs(15);
/// How long all processes may take to be there; some hundred begin at once.
const STARTING: Duration = Duration::from_secs(180);
/// How long the robots have until all of them drive.
const DRIVING: Duration = Duration::from_secs(30);
/// Commands that may wait to be looked at.
const WAITING: usize = 65_536;

/// What was measured.
struct Measured {
    robots: u32,
    driving: usize,
    beats: usize,
    late_p50: f64,
    late_p99: f64,
    cpu_cores: f64,
    rss: u64,
    processes: usize,
    up: Duration,
}

/// Measures.
pub(crate) async fn fleet(settings: &Settings, json: bool, robots: u32) -> anyhow::Result<()> {
    let settings = &settings.alone();
    let mut stop = signal::stop()?;
    let scratch = std::env::temp_dir().join(format!("axle-bench-fleet-{}", std::process::id()));
    std::fs::create_dir_all(&scratch)?;
    let endpoint = super::free_endpoint()?;
    let topology = Topology::parse(&text(&endpoint, robots)?)?;
    let (host, _) = topology.host(None)?;
    let log = Log::File(Arc::new(Mutex::new(std::fs::File::create(scratch.join("bench.log"))?)));
    let began = Instant::now();
    let supervisor = Supervisor::start(&topology, host, &endpoint, None, "warn", None, &log)?;
    note(&format!("{} processes for {robots} robots …", supervisor.processes().len()));
    let measured = tokio::select! {
        measured = measure(settings, &endpoint, &supervisor, robots, began) => measured,
        () = stop.wait() => Err(anyhow::anyhow!("ended before everything was measured")),
    };
    supervisor.stop().await;
    drop(std::fs::remove_dir_all(&scratch));
    print(&measured?, json)
}

fn robot(number: u32) -> anyhow::Result<RobotId> {
    Ok(RobotId::new(&format!("r{number}"))?)
}

fn text(endpoint: &str, robots: u32) -> anyhow::Result<String> {
    let mut text = format!(
        "[hosts.local]\nrouter = \"{endpoint}\"\n[[services]]\nkind = \"pathfinder\"\n[[services]]\nkind = \"pathdriver\"\n"
    );
    let rates = "rates = { beat = 0.02, encoders_hz = 10.0, inertial_hz = 10.0, truth_hz = 1.0 }";
    for number in 1..=robots {
        let robot = robot(number)?;
        for (kind, params) in [
            ("emulator", format!("seed = {number}, {rates}")),
            ("source", String::new()),
            ("navigator", String::new()),
            ("d-corrector", format!("period = {PERIOD:?}, lead = 0.1")),
        ] {
            writeln!(text, "[[services]]\nkind = \"{kind}\"\nrobot = \"{robot}\"\nparams = {{ {params} }}")?;
        }
    }
    Ok(text)
}

async fn measure(
    settings: &Settings,
    endpoint: &str,
    supervisor: &Supervisor,
    robots: u32,
    began: Instant,
) -> anyhow::Result<Measured> {
    all_alive_within(settings, endpoint, supervisor, STARTING).await?;
    let up = began.elapsed();
    let own = axle_mesh::Settings { connect: vec![endpoint.to_owned()], ..settings.mesh("bench", None)? };
    let mesh = join(own, Patience::AtMost(Duration::from_secs(5))).await?;
    let drive = plan(&mesh).await?;
    let commands = mesh.inbox(&key::COMMAND.of_every_robot(), WAITING)?;
    note(&format!("all there after {:.1} s; they are sent on their way …", up.as_secs_f64()));
    for number in 1..=robots {
        let orders = mesh.publisher(&key::corrector_task::<Drive>("d-corrector").of(&robot(number)?))?;
        let order = Task { id: TaskId::from_random(random_bits()), plan: drive.clone() };
        let progress = mesh.inbox(&key::corrector_progress("d-corrector").of(&robot(number)?), 8)?;
        // An order may be lost like every sample, and hearing it twice changes nothing.
        let end = Instant::now() + DRIVING;
        while progress.latest().is_none_or(|heard| heard.message.task != order.id) {
            anyhow::ensure!(Instant::now() < end, "the corrector of r{number} does not take its task");
            orders.put(&order, None)?;
            sleep(Duration::from_millis(5)).await;
        }
    }
    while commands.take_raw().is_some() {}
    let usage = || Usage::of(supervisor.processes().into_iter().filter_map(|(_, pid)| pid));
    let (before, from) = (usage(), Instant::now());
    sleep(LOOKING).await;
    let (after, time) = (usage(), from.elapsed());
    let mut beats: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    while let Some(raw) = commands.take_raw() {
        let is_command = decode::<Command>(&raw.payload).is_ok();
        if let Some(Meta { stamp, .. }) = raw.meta().filter(|_| is_command) {
            beats.entry(raw.key).or_default().push(stamp);
        }
    }
    mesh.leave().await;
    let late: Vec<f64> = beats.values().flat_map(|stamps| lateness(stamps)).map(|late| late * 1e3).collect();
    Ok(Measured {
        robots,
        driving: beats.len(),
        beats: late.len(),
        late_p50: quantile(&late, 0.5),
        late_p99: quantile(&late, 0.99),
        cpu_cores: after.cpu.saturating_sub(before.cpu).as_secs_f64() / time.as_secs_f64(),
        rss: after.rss,
        processes: supervisor.processes().len(),
        up,
    })
}

/// The movements of one long way, for everybody.
async fn plan(mesh: &Mesh) -> anyhow::Result<Drive> {
    let patience = Duration::from_secs(10);
    let ask = PlanAsk { way: WayTask::parse(WAY)?, start: Some(Pose::default()), ..PlanAsk::default() };
    let plan = mesh.ask(&key::PLAN, None, &ask, patience, Retry::Idempotent).await.context("a plan")?;
    let ask = DriveAsk { legs: plan.legs, speeds: None, robot: None, manner: None };
    mesh.ask(&key::DRIVE, None, &ask, patience, Retry::Idempotent).await.context("its movements")
}

/// How much later than its rhythm allows each beat of one corrector came.
fn lateness(stamps: &[f64]) -> Vec<f64> {
    let Some(first) = stamps.first() else { return Vec::new() };
    let phases: Vec<f64> = stamps
        .iter()
        .map(|stamp| {
            let since = stamp - first;
            since - (since / PERIOD).round() * PERIOD
        })
        .collect();
    let earliest = phases.iter().copied().fold(f64::INFINITY, f64::min);
    phases.iter().map(|phase| phase - earliest).collect()
}

fn print(measured: &Measured, json: bool) -> anyhow::Result<()> {
    let Measured { robots, driving, beats, late_p50, late_p99, cpu_cores, rss, processes, up } = measured;
    #[allow(clippy::cast_precision_loss, reason = "megabytes for people")]
    let rss_mb = *rss as f64 / 1e6;
    if json {
        let line = serde_json::json!({
            "robots": robots, "beat_p99_late_ms": late_p99, "cpu_cores": cpu_cores, "rss_mb": rss_mb,
            "beat_p50_late_ms": late_p50, "beats": beats, "driving": driving, "processes": processes,
            "up_s": up.as_secs_f64(),
        });
        data(&line.to_string())?;
    } else {
        let rows = [
            ("robots that drive", format!("{driving} of {robots}, {processes} processes")),
            ("beats at 10 Hz", beats.to_string()),
            ("late, of 99 in 100", format!("{late_p99:.1} ms at most")),
            ("processors", format!("{cpu_cores:.2} cores")),
            ("memory", format!("{rss_mb:.0} MB, pages that processes share counted each time")),
            ("all there after", format!("{:.1} s", up.as_secs_f64())),
        ];
        table(&["what", "value"], rows.map(|(name, value)| vec![name.to_owned(), value]))?;
    }
    anyhow::ensure!(
        usize::try_from(*robots).is_ok_and(|robots| robots == *driving),
        "{driving} of {robots} robots drove"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::lateness;

    #[test]
    fn a_beat_is_late_by_what_it_misses_of_its_rhythm() {
        // The third one comes 30 ms late, the fourth is left out, the first was 5 ms late.
        let found = lateness(&[10.005, 10.1, 10.23, 10.4, 10.5]);
        for (found, wanted) in found.iter().zip([0.005, 0.0, 0.03, 0.0, 0.0]) {
            assert!((found - wanted).abs() < 1e-9, "{found:?}");
        }
        assert!(lateness(&[]).is_empty());
    }
}
