//! `axle bench mesh`: what Axle adds to bare Zenoh, and what the whole mesh costs at rest.
//!
//! Ratios are taken side by side in one run: one round of Axle, one round of bare Zenoh, and so on, through the same
//! router and between the same processes. Single times on a shared machine say little; their ratios hold.

pub(crate) mod board;
mod cases;
pub(crate) mod faults;
pub(crate) mod fleet;
pub(crate) mod motion;
pub(crate) mod navigator;
mod process;
mod proxy;
pub(crate) mod record;
pub(crate) mod stop;
pub(crate) mod taps;
pub(crate) mod tournament;

use crate::command::up::all_alive;
use crate::out::{data, note, table};
use crate::settings::{Settings, join};
use crate::signal::{self, Stop};
use crate::supervisor::{Log, Supervisor};
use crate::topology::{self, Topology};
use anyhow::Context as _;
use axle_mesh::{Mesh, Patience, Retry};
use axle_schema::{NavigatorData, PlanAsk, Pose, RobotId, Seconds, WayTask, encode, key};
use process::Usage;
use std::net::TcpListener;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::process::{Child, Command};
use tokio::time::{Instant, timeout};

/// Rounds before anything is counted.
const WARM_UP: u32 = 200;
/// A round that takes longer was lost.
const LOST: Duration = Duration::from_secs(2);
/// How long the resting mesh is looked at.
const REST: Duration = Duration::from_secs(3);

/// Measures.
pub(crate) async fn mesh(settings: &Settings, json: bool, rounds: u32) -> anyhow::Result<()> {
    let mut stop = signal::stop()?;
    let bed = Bed::start(settings, &mut stop, None).await?;
    let measured = tokio::select! {
        measured = bed.measure(settings, rounds) => measured,
        () = stop.wait() => Err(anyhow::anyhow!("ended before everything was measured")),
    };
    bed.end().await;
    measured?.print(json)
}

/// The other end: answers bare queries, and sends back what it hears, bare and typed.
pub(crate) async fn peer(settings: &Settings) -> anyhow::Result<()> {
    let robot = settings.one_robot()?;
    let mesh = join(settings.mesh("bench-peer", Some(&robot))?, Patience::Forever).await?;
    let bare = mesh.bare();
    let typed = async {
        let (there, back) = key::BENCH;
        let there = mesh.inbox(&there.of(&robot), 1)?;
        let back = mesh.publisher(&back.of(&robot))?;
        let _visible = mesh.become_visible()?;
        loop {
            let heard = there.next().await;
            back.put(&heard.message, None)?;
        }
        #[allow(unreachable_code, reason = "tells the type of the error")]
        anyhow::Ok(())
    };
    let failed = |fault| anyhow::anyhow!("bare Zenoh: {fault}");
    let mut stop = signal::stop()?;
    tokio::select! {
        ended = bare.answer() => ended.map_err(failed)?,
        ended = bare.echo() => ended.map_err(failed)?,
        ended = typed => ended?,
        () = stop.wait() => {}
    }
    mesh.leave().await;
    Ok(())
}

/// What this share of the sorted values does not exceed; of no values it is no number.
pub(crate) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "an index"
    )]
    let index = (last as f64 * share).ceil() as usize;
    sorted.get(index).copied().unwrap_or(f64::NAN)
}

/// An endpoint of this computer that nobody listens on.
pub(crate) fn free_endpoint() -> anyhow::Result<String> {
    let free = TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr());
    Ok(format!("tcp/{}", free.context("find a free port")?))
}

/// A mesh to measure on.
struct Bed {
    supervisor: Supervisor,
    peer: Child,
    endpoint: String,
    robot: RobotId,
    up: Duration,
    scratch: std::path::PathBuf,
}

impl Bed {
    /// Starts the shipped topology on a free port, with that method of the navigator, and the other end of the bench.
    async fn start(settings: &Settings, stop: &mut Stop, method: Option<&str>) -> anyhow::Result<Self> {
        let scratch = std::env::temp_dir().join(format!("axle-bench-{}", std::process::id()));
        std::fs::create_dir_all(&scratch)?;
        let endpoint = free_endpoint()?;
        let mut topology = Topology::parse(topology::DEFAULT)?;
        for service in topology.services.iter_mut().filter(|service| service.kind == "recorder") {
            service.params.insert("file".into(), scratch.join("bench.mcap").display().to_string().into());
        }
        for service in topology.services.iter_mut().filter(|service| service.kind == "navigator") {
            service.params.extend(method.map(|method| ("method".to_owned(), method.into())));
        }
        // Not the robot of the mesh: its recorder would hear every typed hop and no bare one.
        let robot = RobotId::new("bench")?;
        let (host, _) = topology.host(None)?;
        let log = Log::File(Arc::new(Mutex::new(std::fs::File::create(scratch.join("bench.log"))?)));
        let started = Instant::now();
        let supervisor = Supervisor::start(&topology, host, &endpoint, None, &settings.log, None, &log)?;
        let alive = tokio::select! {
            alive = all_alive(settings, &endpoint, &supervisor) => alive,
            () = stop.wait() => Err(anyhow::anyhow!("ended before the mesh was up")),
        };
        let up = started.elapsed();
        let peer = Command::new(std::env::current_exe()?)
            .args(["bench-peer", "--connect", &endpoint, "--robot", robot.as_str(), "--log", "error"])
            .kill_on_drop(true)
            .spawn()
            .context("start the other end");
        match (alive, peer) {
            (Ok(()), Ok(peer)) => Ok(Self { supervisor, peer, endpoint, robot, up, scratch }),
            (alive, peer) => {
                supervisor.stop().await;
                alive.and(peer.map(drop))?;
                anyhow::bail!("the mesh did not start")
            }
        }
    }

    async fn end(mut self) {
        // It is killed with this process at the latest.
        drop(self.peer.start_kill());
        self.supervisor.stop().await;
        drop(std::fs::remove_dir_all(&self.scratch));
    }

    async fn measure(&self, settings: &Settings, rounds: u32) -> anyhow::Result<Measured> {
        let usage = || Usage::of(self.supervisor.processes().into_iter().filter_map(|(_, pid)| pid));
        note("the mesh at rest …");
        let (before, began) = (usage(), Instant::now());
        tokio::time::sleep(REST).await;
        let after = usage();
        let cpu_cores = after.cpu.saturating_sub(before.cpu).as_secs_f64() / began.elapsed().as_secs_f64();

        let mut own = settings.mesh("bench", Some(&self.robot))?;
        own.connect = vec![self.endpoint.clone()];
        let mesh = join(own, Patience::AtMost(Duration::from_secs(5))).await?;
        note(&format!("{rounds} queries of each …"));
        let query = queries(&mesh, &self.robot, rounds).await?;
        note(&format!("{rounds} hops there and back of each …"));
        let hop = hops(&mesh, &self.robot, rounds).await?;
        mesh.leave().await;
        let processes = self.supervisor.processes().len();
        Ok(Measured { query, hop, up: self.up, rss: after.rss, cpu_cores, processes, rounds })
    }
}

/// Pathfinder asked for the square, against a bare query of the same sizes.
async fn queries(mesh: &Mesh, robot: &RobotId, rounds: u32) -> anyhow::Result<Pair> {
    let ask = PlanAsk {
        way: WayTask::parse("0,0 1,0 1,1 0,1 0,0")?,
        start: Some(Pose::default()),
        ..PlanAsk::default()
    };
    let ask_once = || mesh.ask(&key::PLAN, Some(robot), &ask, LOST, Retry::Idempotent);
    let sizes = (encode(&ask)?.len(), encode(&ask_once().await?)?.len());
    let bare = mesh.bare();
    let mut pair = Pair::new();
    for round in 0..rounds + WARM_UP {
        let began = Instant::now();
        ask_once().await?;
        let axle = began.elapsed();
        let began = Instant::now();
        let came = timeout(LOST, bare.query(sizes.0, sizes.1)).await.context("a bare query was lost")?;
        let came = came.map_err(|fault| anyhow::anyhow!("bare Zenoh: {fault}"))?;
        anyhow::ensure!(came == sizes.1, "a bare query brought {came} bytes instead of {}", sizes.1);
        if round >= WARM_UP {
            pair.record(axle, began.elapsed());
        }
    }
    Ok(pair)
}

/// A pose there and back, against bare samples of the same size.
async fn hops(mesh: &Mesh, robot: &RobotId, rounds: u32) -> anyhow::Result<Pair> {
    let (there, back) = key::BENCH;
    let there = mesh.publisher(&there.of(robot))?;
    let back = mesh.inbox(&back.of(robot), 1)?;
    let caller = mesh.bare().caller().await.map_err(|fault| anyhow::anyhow!("bare Zenoh: {fault}"))?;
    let pose =
        NavigatorData { stamp: Seconds(12.34), pose: Pose::new(0.1, 0.2, 0.3), ..NavigatorData::default() };
    let size = encode(&pose)?.len();
    // The first rounds wait until each end knows of the other.
    let began = Instant::now();
    loop {
        there.put(&pose, None)?;
        let bare = timeout(Duration::from_millis(50), caller.round(size)).await;
        let typed = timeout(Duration::from_millis(50), back.next()).await;
        if bare.is_ok() && typed.is_ok() {
            break;
        }
        anyhow::ensure!(
            began.elapsed() < Duration::from_secs(10),
            "the other end of the bench does not answer"
        );
    }
    let mut pair = Pair::new();
    for round in 0..rounds + WARM_UP {
        // What is left of an earlier, slow round would answer this one.
        let _late = back.latest();
        let began = Instant::now();
        there.put(&pose, None)?;
        timeout(LOST, back.next()).await.context("a hop was lost")?;
        let axle = began.elapsed();
        let began = Instant::now();
        let bare = timeout(LOST, caller.round(size)).await.context("a bare hop was lost")?;
        bare.map_err(|fault| anyhow::anyhow!("bare Zenoh: {fault}"))?;
        if round >= WARM_UP {
            pair.record(axle, began.elapsed());
        }
    }
    Ok(pair)
}

/// Times of Axle and of bare Zenoh, taken in turn.
struct Pair {
    axle: Vec<Duration>,
    bare: Vec<Duration>,
}

impl Pair {
    const fn new() -> Self {
        Self { axle: Vec::new(), bare: Vec::new() }
    }
    fn record(&mut self, axle: Duration, bare: Duration) {
        self.axle.push(axle);
        self.bare.push(bare);
    }
    /// Microseconds that a share of the rounds did not exceed: of Axle, of bare Zenoh, and their ratio.
    fn at(&self, share: f64) -> (f64, f64, f64) {
        let at = |times: &[Duration]| {
            let mut times: Vec<f64> = times.iter().map(|time| time.as_secs_f64() * 1e6).collect();
            times.sort_by(f64::total_cmp);
            quantile(&times, share)
        };
        let (axle, bare) = (at(&self.axle), at(&self.bare));
        (axle, bare, axle / bare)
    }
    fn to_json(&self) -> serde_json::Value {
        let ((axle_p50, bare_p50, p50), (axle_p99, bare_p99, p99)) = (self.at(0.5), self.at(0.99));
        serde_json::json!({
            "p50_ratio": p50, "p99_ratio": p99,
            "axle_p50_us": axle_p50, "axle_p99_us": axle_p99, "bare_p50_us": bare_p50, "bare_p99_us": bare_p99,
        })
    }
}

/// Everything that was measured.
struct Measured {
    query: Pair,
    hop: Pair,
    up: Duration,
    rss: u64,
    cpu_cores: f64,
    processes: usize,
    rounds: u32,
}

impl Measured {
    fn print(&self, json: bool) -> anyhow::Result<()> {
        #[allow(clippy::cast_precision_loss, reason = "megabytes for people")]
        let rss_mb = self.rss as f64 / 1e6;
        if json {
            let line = serde_json::json!({
                "query": self.query.to_json(), "hop": self.hop.to_json(), "rounds": self.rounds,
                "up_s": self.up.as_secs_f64(), "processes": self.processes,
                "rest": { "rss_mb": rss_mb, "cpu_cores": self.cpu_cores },
            });
            return Ok(data(&line.to_string())?);
        }
        let rows = [("query of Pathfinder", &self.query), ("hop, there and back", &self.hop)]
            .into_iter()
            .flat_map(|(name, pair)| {
                [("p50", 0.5), ("p99", 0.99)].map(|(share, quantile)| {
                    let (axle, bare, ratio) = pair.at(quantile);
                    vec![
                        format!("{name}, {share}"),
                        format!("{axle:.0} µs"),
                        format!("{bare:.0} µs"),
                        format!("{ratio:.2}"),
                    ]
                })
            });
        table(&["", "axle", "bare Zenoh", "ratio"], rows)?;
        data(&format!(
            "{} processes: all alive after {:.2} s; at rest {rss_mb:.0} MB and {:.1} % of a core",
            self.processes,
            self.up.as_secs_f64(),
            self.cpu_cores * 100.0
        ))?;
        Ok(())
    }
}
