//! `axle bench stop`: how soon the wheels brake when whoever commands them dies, freezes or is cut off.
//!
//! Several robots drive side by side, each commanded by a process of its own over a wire of its own. Each injection
//! lets one robot drive, kills (SIGKILL) or freezes (SIGSTOP) its commander, or cuts its wire, and waits until the gate
//! says that it brakes and that the wheels stand. After a freeze or a cut the commander comes back, with all that it
//! had said: none of it may be obeyed when it is too old. At last each robot is stopped from another process.

mod commander;
mod history;
mod injection;
mod report;

pub(crate) use commander::command;

use crate::command::up::all_alive;
use crate::out::note;
use crate::settings::{Settings, join};
use crate::signal::{self, Stop};
use crate::supervisor::{Log, Supervisor};
use crate::topology::Topology;
use anyhow::Context as _;
use axle_gate::{Gate, GateParams};
use axle_mesh::{Mesh, Patience};
use axle_schema::command::{Class, Command, LeaseAsk};
use axle_schema::{Boot, Drivetrain, Dwm, RobotId, Seconds, Tick, encode};
use indicatif::{ProgressBar, ProgressDrawTarget};
use injection::{Fault, Injected, Site};
use report::Report;
use std::fmt::Write as _;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::time::Instant;

/// Robots that drive side by side.
const ROBOTS: u32 = 6;
/// Outages in seconds: most of them short, since what is old after 2 s is old after 60, and few long ones.
const OUTAGES: [f64; 8] = [0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0];
const LONG: [(u32, f64); 3] = [(40, 5.0), (100, 10.0), (400, 60.0)];

/// Measures.
pub(crate) async fn stop(settings: &Settings, json: bool, injections: u32) -> anyhow::Result<()> {
    let mut stop = signal::stop()?;
    let bed = Bed::start(settings, &mut stop).await?;
    let bar = ProgressBar::with_draw_target(Some(injections.into()), ProgressDrawTarget::stderr_with_hz(4));
    let measured = tokio::select! {
        measured = bed.measure(settings, injections, &bar) => measured,
        () = stop.wait() => Err(anyhow::anyhow!("ended before everything was measured")),
    };
    bar.finish_and_clear();
    bed.end().await;
    Report::of(&measured?, gate_cost()?).print(json)
}

/// The mesh: a router, and a robot for each site.
struct Bed {
    supervisor: Supervisor,
    endpoint: String,
    scratch: std::path::PathBuf,
}

fn robot(index: u32) -> anyhow::Result<RobotId> {
    Ok(RobotId::new(&format!("bench-{index}"))?)
}

impl Bed {
    async fn start(settings: &Settings, stop: &mut Stop) -> anyhow::Result<Self> {
        let scratch = std::env::temp_dir().join(format!("axle-bench-stop-{}", std::process::id()));
        std::fs::create_dir_all(&scratch)?;
        let endpoint = super::free_endpoint()?;
        let mut text = format!("[hosts.local]\nrouter = \"{endpoint}\"\n");
        for index in 0..ROBOTS {
            write!(text, "[[services]]\nkind = \"emulator\"\nrobot = \"{}\"\n", robot(index)?)?;
        }
        let topology = Topology::parse(&text)?;
        let (host, _) = topology.host(None)?;
        let log = Log::File(Arc::new(Mutex::new(std::fs::File::create(scratch.join("bench.log"))?)));
        let supervisor = Supervisor::start(&topology, host, &endpoint, None, &settings.log, None, &log)?;
        let alive = tokio::select! {
            alive = all_alive(settings, &endpoint, &supervisor) => alive,
            () = stop.wait() => Err(anyhow::anyhow!("ended before the mesh was up")),
        };
        match alive {
            Ok(()) => Ok(Self { supervisor, endpoint, scratch }),
            Err(fault) => {
                supervisor.stop().await;
                Err(fault)
            }
        }
    }

    async fn end(self) {
        self.supervisor.stop().await;
        drop(std::fs::remove_dir_all(&self.scratch));
    }

    async fn measure(
        &self,
        settings: &Settings,
        injections: u32,
        bar: &ProgressBar,
    ) -> anyhow::Result<Vec<Injected>> {
        note(&format!("{injections} kills, freezes and cuts of whoever commands, on {ROBOTS} robots …"));
        let mut own = settings.mesh("bench", None)?;
        own.connect = vec![self.endpoint.clone()];
        let mesh = join(own, Patience::AtMost(Duration::from_secs(5))).await?;
        let sites = (0..ROBOTS).map(|index| self.measure_one(&mesh, index, injections, bar));
        let measured = futures_util::future::try_join_all(sites).await?;
        mesh.leave().await;
        Ok(measured.into_iter().flatten().collect())
    }

    /// Every injection of one robot, one after the other.
    async fn measure_one(
        &self,
        mesh: &Mesh,
        index: u32,
        injections: u32,
        bar: &ProgressBar,
    ) -> anyhow::Result<Vec<Injected>> {
        let mut site = Site::new(mesh, robot(index)?, &self.endpoint).await?;
        let mut measured = Vec::new();
        for number in (index..injections).step_by(ROBOTS as usize) {
            // Robots are neighbours in the list of injections, so each meets every kind of fault.
            let outage = LONG
                .iter()
                .rev()
                .find(|(every, _)| number % every == every - 1)
                .map_or(OUTAGES[(number / 7) as usize % OUTAGES.len()], |(_, outage)| *outage);
            let outage = Duration::from_secs_f64(outage);
            let fault = match (number + index) % 3 {
                0 => Fault::Kill,
                1 => Fault::Freeze(outage),
                _ => Fault::Cut(outage),
            };
            let injected =
                site.inject(fault).await.with_context(|| format!("injection {number}: {fault:?}"))?;
            measured.push(injected);
            bar.inc(1);
        }
        Ok(measured)
    }
}

/// What the gate costs a command, in microseconds: bytes in, decision out.
fn gate_cost() -> anyhow::Result<f64> {
    const COMMANDS: u32 = 20_000;
    let params = GateParams { starts_enabled: true, ..GateParams::default() };
    let mut gate = Gate::new(params, &Drivetrain::default(), Boot(1), None)?;
    let ask = LeaseAsk { holder: "bench".into(), class: Class::Corrector, period: Seconds(0.05) };
    let lease = gate.lease(Seconds::ZERO, &ask)?;
    let encoding = axle_schema::codec::encoding_of::<Command>();
    let mut spent = Duration::ZERO;
    for seq in 1..=COMMANDS {
        let now = Seconds(f64::from(seq) * 0.01);
        let dwm = Dwm::rest(Seconds(0.05));
        let command =
            Command { boot: lease.boot, epoch: lease.epoch, seq, echo: Tick::of(now), ttl_ms: 150, dwm };
        let bytes = encode(&command)?;
        let began = Instant::now();
        let verdict = gate.command(now, &encoding, &bytes);
        spent += began.elapsed();
        anyhow::ensure!(verdict.is_ok(), "the gate refused a command of the bench: {verdict:?}");
        gate.beat(now);
    }
    Ok(spent.as_secs_f64() * 1e6 / f64::from(COMMANDS))
}
