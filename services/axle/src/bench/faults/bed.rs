//! What the faults are let loose on: a robot with a board on a serial line, on two computers with a faulty link between
//! them, and a third one that nothing ever happens to.
//!
//! The board is played by the emulator at the third router, and is reached by its serial line alone. So what the wheels
//! really do is heard whatever becomes of the mesh, and of the process that owns the wheels.

use super::ears::Ears;
use crate::bench::free_endpoint;
use crate::bench::proxy::{Bytes, Proxy};
use crate::command::up::all_alive;
use crate::settings::{Settings, join};
use crate::supervisor::{Log, Supervisor};
use crate::topology::{Place, Topology};
use anyhow::Context as _;
use axle_mesh::{Mesh, Patience};
use axle_schema::RobotId;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::process::{Child, Command};
use tokio::time::Instant;

/// The computers, and what runs there. Commands cross the link, as they do from a workstation.
const HOSTS: [(&str, &[&str]); 3] = [
    ("eyes", &["emulator"]),
    ("workstation", &["pathfinder", "pathdriver", "pilot", "d-corrector"]),
    ("onboard", &["robot", "source", "navigator"]),
];

/// What is different about a bed.
#[derive(Clone, Debug, Default)]
pub(super) struct Making {
    /// Where the processes of a computer run.
    pub(super) places: BTreeMap<&'static str, Place>,
    /// The addresses of routers that are reached by a network.
    pub(super) addresses: BTreeMap<&'static str, &'static str>,
    /// Where an AllStop is kept, and where a recorder writes.
    pub(super) disk: Option<PathBuf>,
    /// The directory of keys; everything is encrypted.
    pub(super) keys: Option<PathBuf>,
}

/// The robot, the two computers that drive it, and the eyes.
pub(super) struct Bed {
    supervisors: BTreeMap<&'static str, Supervisor>,
    pub(super) endpoints: BTreeMap<&'static str, String>,
    pub(super) link: Proxy,
    pub(super) ears: Ears,
    pub(super) robot: RobotId,
    /// A session at the workstation's router, and one at the robot's own.
    pub(super) meshes: BTreeMap<&'static str, Mesh>,
    pub(super) settings: Settings,
    pub(super) scratch: PathBuf,
    pub(super) making: Making,
    /// When its first process was started.
    pub(super) begun: Instant,
}

fn text(
    endpoints: &BTreeMap<&str, String>,
    link: &str,
    scratch: &Path,
    making: &Making,
) -> anyhow::Result<String> {
    let mut text = "lease_ms = 400\n".to_owned();
    for (host, endpoint) in endpoints {
        writeln!(text, "[hosts.{host}]\nrouter = \"{endpoint}\"")?;
        if *host == "onboard" {
            writeln!(text, "links = [\"{link}\"]")?;
        }
        if making.addresses.contains_key(host) {
            writeln!(text, "insecure_lan = true")?;
        }
    }
    for (host, services) in HOSTS {
        for kind in services {
            writeln!(text, "[[services]]\nkind = \"{kind}\"\nhost = \"{host}\"")?;
            if !kind.starts_with("path") {
                writeln!(text, "robot = \"r1\"")?;
            }
            if matches!(*kind, "emulator" | "robot") {
                writeln!(text, "board = \"dwm-text\"\nport = {:?}", scratch.join("board"))?;
            }
            match *kind {
                // What the wheels do is looked at as often as the gate decides.
                "emulator" => writeln!(text, "params = {{ rates = {{ truth_hz = 200.0 }} }}")?,
                // Nobody can be hurt by an emulated robot, and nobody is at the desk.
                "robot" => writeln!(text, "params = {{ gate = {{ starts_enabled = true }} }}")?,
                _ => {}
            }
        }
    }
    if let Some(disk) = &making.disk {
        let file = disk.join("faults.mcap");
        writeln!(text, "[[services]]\nkind = \"recorder\"\nhost = \"workstation\"\nrobot = \"r1\"")?;
        writeln!(text, "params = {{ file = {file:?} }}")?;
    }
    Ok(text)
}

impl Bed {
    pub(super) async fn make(settings: &Settings, making: &Making, seed: u64) -> anyhow::Result<Self> {
        static NEXT: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
        let number = NEXT.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let scratch = std::env::temp_dir().join(format!("axle-faults-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&scratch)?;
        let mut endpoints = BTreeMap::new();
        for (host, _) in HOSTS {
            let own = making.addresses.get(host).copied().unwrap_or("127.0.0.1");
            endpoints.insert(host, free_endpoint()?.replace("127.0.0.1", own));
        }
        let bytes = if making.keys.is_some() { Bytes::Sealed } else { Bytes::Messages };
        let link = Proxy::to(&endpoints["workstation"], bytes, seed).await?;
        // From another network the proxy cannot be dialled: there the link is a cable.
        let dialled = if making.addresses.is_empty() { &link.endpoint } else { &endpoints["workstation"] };
        let text = text(&endpoints, dialled, &scratch, making)?;
        let file = scratch.join("faults.toml");
        std::fs::write(&file, &text)?;
        let mut topology = Topology::parse(&text)?;
        for (host, place) in &making.places {
            if let Some(host) = topology.hosts.get_mut(*host) {
                host.place = place.clone();
            }
        }
        let settings = match &making.keys {
            Some(keys) => super::keys::issue(settings, keys, &file).await?,
            None => settings.alone(),
        };
        let robot = RobotId::new("r1")?;
        let begun = Instant::now();
        let mut bed = Opening { supervisors: BTreeMap::new() };
        let opened = bed.open(&settings, &topology, &endpoints, making, &scratch).await;
        let meshes = match opened {
            Ok(meshes) => meshes,
            Err(fault) => {
                bed.close().await;
                return Err(fault.context(format!("{} says more", scratch.join("faults.log").display())));
            }
        };
        let ears = Ears::of(&meshes, &robot)?;
        let (supervisors, making) = (bed.supervisors, making.clone());
        Ok(Self { supervisors, endpoints, link, ears, robot, meshes, settings, scratch, making, begun })
    }

    /// Ends everything.
    pub(super) async fn end(self) {
        for mesh in self.meshes.into_values() {
            mesh.leave().await;
        }
        (Opening { supervisors: self.supervisors }).close().await;
        drop(std::fs::remove_dir_all(&self.scratch));
    }

    /// The process of a service, or of the router of a computer: `router-onboard`.
    pub(super) fn process(&self, name: &str) -> Option<u32> {
        let (host, kind) = match name.strip_prefix("router-") {
            Some(host) => (host, "router"),
            None => (HOSTS.iter().find(|(_, services)| services.contains(&name))?.0, name),
        };
        let processes = self.supervisors.get(host)?.processes();
        processes.into_iter().find(|(job, _)| job.name == kind).and_then(|(_, pid)| pid)
    }

    /// Every process but the eyes', by name.
    pub(super) fn processes(&self) -> BTreeMap<String, Option<u32>> {
        let hosts = self.supervisors.iter().filter(|(host, _)| **host != "eyes");
        let named = hosts.flat_map(|(host, supervisor)| {
            supervisor.processes().into_iter().map(move |(job, pid)| {
                let is_router = job.name == "router";
                (if is_router { format!("router-{host}") } else { job.name }, pid)
            })
        });
        named.collect()
    }

    /// Sends a signal to a process; one that is just being restarted has nothing to be told.
    pub(super) fn tell(&self, name: &str, signal: Signal) -> anyhow::Result<()> {
        let pid = self.process(name).and_then(|pid| i32::try_from(pid).ok());
        let pid = pid.with_context(|| format!("{name} does not run"))?;
        kill(Pid::from_raw(pid), signal).with_context(|| format!("{signal} to {name}"))
    }

    /// Starts `axle` with these arguments, as somebody at the workstation.
    pub(super) fn tool(&self, args: &[&str]) -> anyhow::Result<Child> {
        self.tool_as(self.settings.identity.as_deref(), &[], args)
    }

    /// The same with another identity, or none, and these variables.
    pub(super) fn tool_as(
        &self,
        identity: Option<&Path>,
        variables: &[(&str, &str)],
        args: &[&str],
    ) -> anyhow::Result<Child> {
        let endpoint = &self.endpoints["workstation"];
        let endpoint = identity.map_or_else(|| endpoint.clone(), |_| axle_mesh::identity::secured(endpoint));
        let mut command = Command::new(std::env::current_exe()?);
        command.args(args).args(["--connect", &endpoint, "--robot", "r1", "--log", "error"]);
        if let Some(identity) = identity {
            command.arg("--identity").arg(identity);
        }
        command
            .envs(variables.iter().copied())
            .env("NO_COLOR", "1")
            .env_remove("AXLE_IDENTITY")
            .stdin(std::process::Stdio::null())
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .context("start a tool")
    }
}

/// The supervisors of a bed that is being made or taken down.
struct Opening {
    supervisors: BTreeMap<&'static str, Supervisor>,
}

impl Opening {
    async fn open(
        &mut self,
        settings: &Settings,
        topology: &Topology,
        endpoints: &BTreeMap<&'static str, String>,
        making: &Making,
        scratch: &Path,
    ) -> anyhow::Result<BTreeMap<&'static str, Mesh>> {
        let log = Log::File(Arc::new(Mutex::new(std::fs::File::create(scratch.join("faults.log"))?)));
        let keys = making.keys.as_deref();
        let own = scratch.join("state");
        for (host, _) in HOSTS {
            let state = making.disk.as_deref().filter(|_| host == "onboard").unwrap_or(&own);
            let endpoint = settings.endpoint(&endpoints[host]);
            let supervisor = Supervisor::start(topology, host, &endpoint, keys, "info", Some(state), &log)?;
            supervisor.begin();
            self.supervisors.insert(host, supervisor);
        }
        let mut meshes = BTreeMap::new();
        for (host, _) in HOSTS {
            let endpoint = settings.endpoint(&endpoints[host]);
            all_alive(settings, &endpoint, &self.supervisors[host]).await?;
            let own = axle_mesh::Settings { connect: vec![endpoint], ..settings.mesh("bench", None)? };
            meshes.insert(host, join(own, Patience::AtMost(Duration::from_secs(5))).await?);
        }
        Ok(meshes)
    }

    async fn close(self) {
        let ending = self.supervisors.into_values().map(Supervisor::stop);
        futures_util::future::join_all(ending).await;
    }
}
