//! `axle demo`: the main job. Starts a router and one process per service, drives an emulated robot along a way
//! through all of them, and shows how well it went: a table, a chart and a recording.

mod account;
mod watch;

use crate::bench::free_endpoint;
use crate::catalog;
use crate::cli::Demo;
use crate::command::go::{Bar, cancel, follow};
use crate::command::up::all_alive;
use crate::out::{note, usage};
use crate::settings::{Settings, join};
use crate::signal::Stop;
use crate::supervisor::{Log, Supervisor};
use crate::topology::{self, Service, Topology};
use account::Account;
use anyhow::Context as _;
use axle_mesh::{Mesh, Patience, Retry};
use axle_robot::BoardKind;
use axle_schema::task::{Accepted, GoAsk, PilotProgress};
use axle_schema::{RobotId, key};
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::time::Instant;
use watch::Watch;

/// The pilot has this long to take the task.
const PATIENCE: Duration = Duration::from_secs(5);

/// Runs the demonstration.
pub(crate) async fn demo(settings: &Settings, args: Demo) -> anyhow::Result<()> {
    let corrector =
        catalog::find(&args.corrector).filter(|entry| entry.takes.is_some()).ok_or_else(|| {
            let known = catalog::corrector_names();
            usage(format!("--corrector {:?} is unknown; known: {known}", args.corrector))
        })?;
    let robot = settings.one_robot()?;
    let files = Files::prepare(&args.out)?;
    if args.board.is_some_and(|kind| !kind.has_encoders()) {
        return Err(usage("--board: this board measures nothing, so that nobody could drive by it"));
    }
    let mut topology = build_topology(&args, corrector.name, &robot, &files)?;
    let page = match args.page {
        Some(page) => Some(free_page(page)?),
        None => None,
    };
    if let Some(page) = page {
        topology.add_page(page, None, None)?;
    }
    if let Some(kind) = args.board {
        put_on_a_board(&mut topology, kind, &robot, &files);
    }
    let mut stop = crate::signal::stop()?;
    let log = Log::File(Arc::new(Mutex::new(std::fs::File::create(&files.log).context("create the log")?)));
    let (supervisor, endpoint) = start(settings, &topology, &log, &files, &mut stop).await?;
    if let Some(page) = page {
        note(&format!("watch it at http://{page}"));
    }
    let driven = drive(settings, &args, &robot, &endpoint, corrector.name, &supervisor, &mut stop).await;
    if let (Some(page), Ok(_)) = (page, &driven) {
        note(&format!("the robot is yours at http://{page}; Ctrl-C ends"));
        stop.wait().await;
    }
    supervisor.stop().await;
    let driven =
        driven.with_context(|| format!("the demo did not end well; {} says more", files.log.display()))?;
    let account = Account::of(&args, &files, driven)?;
    account.report(args.json)?;
    account.verdict()
}

/// The address of the page, or the next one that is free: the demonstration says it before anybody asks.
fn free_page(wanted: SocketAddr) -> anyhow::Result<SocketAddr> {
    let ports = wanted.port()..=wanted.port().saturating_add(9);
    for port in ports {
        if let Ok(free) = TcpListener::bind(SocketAddr::new(wanted.ip(), port)) {
            return Ok(free.local_addr()?);
        }
    }
    Err(usage(format!("--page {wanted}: neither this port nor one of the nine after it is free")))
}

/// What the demonstration writes.
pub(crate) struct Files {
    chart: std::path::PathBuf,
    recording: std::path::PathBuf,
    log: std::path::PathBuf,
    /// The link to the terminal of an emulated board, while there is one.
    port: std::path::PathBuf,
}

impl Files {
    /// Makes the directory and removes what an earlier demonstration wrote into it.
    fn prepare(out: &Path) -> anyhow::Result<Self> {
        std::fs::create_dir_all(out).map_err(|fault| {
            usage(format!("--out {}: cannot make this directory: {fault}", out.display()))
        })?;
        let out = std::path::absolute(out)?;
        let files = Self {
            chart: out.join("demo.svg"),
            recording: out.join("demo.mcap"),
            log: out.join("demo.log"),
            port: out.join("board"),
        };
        for file in [&files.chart, &files.recording, &files.log] {
            match std::fs::remove_file(file) {
                Err(fault) if fault.kind() != std::io::ErrorKind::NotFound => {
                    return Err(usage(format!("--out: cannot replace {}: {fault}", file.display())));
                }
                _ => {}
            }
        }
        Ok(files)
    }
}

/// The shipped topology with the seed, the corrector and the recording of this demonstration.
fn build_topology(args: &Demo, corrector: &str, robot: &RobotId, files: &Files) -> anyhow::Result<Topology> {
    let mut topology = Topology::parse(topology::DEFAULT)?;
    topology.robots =
        topology.robots.into_values().map(|body| (topology::RobotName(robot.clone()), body)).collect();
    for Service { kind, robot: of, params, .. } in &mut topology.services {
        if of.is_some() {
            *of = Some(robot.clone());
        }
        match kind.as_str() {
            "emulator" => {
                let seed =
                    i64::try_from(args.seed).map_err(|_| usage("--seed: at most 9223372036854775807"))?;
                params.insert("seed".into(), seed.into());
            }
            "recorder" => {
                params.insert("file".into(), files.recording.display().to_string().into());
            }
            "pilot" => {
                params.insert("corrector".into(), corrector.into());
            }
            kind_name if kind_name.ends_with("-corrector") => corrector.clone_into(kind),
            _ => {}
        }
    }
    Ok(topology)
}

/// The emulator plays a board, and another service drives that through a serial line, with a body as such robots have.
fn put_on_a_board(topology: &mut Topology, kind: BoardKind, robot: &RobotId, files: &Files) {
    for body in topology.robots.values_mut() {
        *body = kind.body();
    }
    let (board, port) = (Some(kind.name().to_owned()), Some(files.port.display().to_string()));
    let mut bridge = None;
    for service in topology.services.iter_mut().filter(|service| service.kind == "emulator") {
        (service.board, service.port) = (board.clone(), port.clone());
        // Nobody can be hurt by an emulated robot.
        let mut gate = toml::Table::new();
        gate.insert("starts_enabled".into(), true.into());
        let params = [("gate".to_owned(), gate.into())].into_iter().collect();
        bridge =
            Some(Service { kind: "robot".into(), robot: Some(robot.clone()), params, ..service.clone() });
    }
    topology.services.extend(bridge);
}

/// Starts everything on a free port and waits until all are alive.
async fn start(
    settings: &Settings,
    topology: &Topology,
    log: &Log,
    files: &Files,
    stop: &mut Stop,
) -> anyhow::Result<(Supervisor, String)> {
    let endpoint = free_endpoint()?;
    let (host, _) = topology.host(None)?;
    let started = Instant::now();
    let supervisor = Supervisor::start(topology, host, &endpoint, None, &settings.log, None, log)?;
    let alive = tokio::select! {
        alive = all_alive(settings, &endpoint, &supervisor) => alive,
        () = stop.wait() => Err(anyhow::anyhow!("ended before the mesh was up")),
    };
    if let Err(fault) = alive {
        supervisor.stop().await;
        return Err(fault.context(format!("{} says more", files.log.display())));
    }
    note(&format!(
        "{} processes on {endpoint}, alive after {:.1} s",
        supervisor.processes().len(),
        started.elapsed().as_secs_f64()
    ));
    Ok((supervisor, endpoint))
}

/// What was heard while the robot drove.
pub(crate) struct Driven {
    end: PilotProgress,
    seen: watch::Seen,
    statuses: Vec<axle_schema::presence::Status>,
    processes: Vec<(String, Option<u32>)>,
}

/// Drives the task and listens to everything.
async fn drive(
    settings: &Settings,
    args: &Demo,
    robot: &RobotId,
    endpoint: &str,
    corrector: &'static str,
    supervisor: &Supervisor,
    stop: &mut Stop,
) -> anyhow::Result<Driven> {
    let mut own = settings.mesh("demo", Some(robot))?;
    own.connect = vec![endpoint.to_owned()];
    let mesh = join(own, Patience::AtMost(PATIENCE)).await?;
    let watch = Watch::start(&mesh, robot, corrector)?;
    tokio::time::timeout(PATIENCE, watch.sees_the_robot())
        .await
        .context("no pose of the emulated robot came within 5 s")?;
    let words = mesh.inbox(&key::GO_PROGRESS.of(robot), 64)?;
    let ask = GoAsk { way: args.way.clone(), corrector: Some(corrector.to_owned()), confirm: Vec::new() };
    let Accepted { task } = mesh.ask(&key::GO, Some(robot), &ask, PATIENCE, Retry::Never).await?;
    let bar = Bar::new();
    let end = tokio::select! {
        end = follow(&words, task, |progress| bar.show(progress)) => end,
        () = stop.wait() => {
            cancel(&mesh, robot, task).await;
            Err(anyhow::anyhow!("cancelled"))
        }
    };
    bar.clear();
    let end = end?;
    // The verdict is about a robot that stands: the last centimetres belong to it.
    if tokio::time::timeout(Duration::from_secs(3), watch.sees_rest()).await.is_err() {
        note("the robot does not stand 3 s after the end of its task");
    }
    let statuses = statuses(&mesh).await?;
    let processes = supervisor.processes().into_iter().map(|(job, pid)| (job.name, pid)).collect();
    let seen = watch.end();
    mesh.leave().await;
    Ok(Driven { end, seen, statuses, processes })
}

async fn statuses(mesh: &Mesh) -> anyhow::Result<Vec<axle_schema::presence::Status>> {
    let everybody = mesh.everybody(Duration::from_secs(1)).await?;
    Ok(everybody.into_iter().filter_map(|(_, status)| status).collect())
}
