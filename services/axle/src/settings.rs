//! The nine settings of a process: robot, connect, listen, params, host, state, log, identity, lease. Each is a flag and
//! an `AXLE_…` variable.

use crate::out::usage;
use axle_mesh::identity::{secured, span};
use axle_mesh::{Identity, Link, Mesh, Patience, Reach};
use axle_schema::{RobotId, id::ALL};
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

/// Settings that every command takes.
#[derive(Clone, Debug, Args)]
pub(crate) struct Settings {
    /// The robot: 1 to 32 of a-z, 0-9 and -
    #[arg(long, global = true, env = "AXLE_ROBOT", hide_env_values = true, value_name = "ID")]
    pub(crate) robot: Option<RobotId>,
    /// The router to connect to; several are tried in turn
    #[arg(
        long,
        global = true,
        env = "AXLE_CONNECT", hide_env_values = true,
        value_name = "tcp/HOST:PORT",
        value_delimiter = ',',
        default_value = axle_router::DEFAULT_ENDPOINT
    )]
    pub(crate) connect: Vec<String>,
    /// The name of this computer [default: its host name]
    #[arg(long, global = true, env = "AXLE_HOST", hide_env_values = true, value_name = "NAME")]
    pub(crate) host: Option<String>,
    /// Where the process that owns the wheels keeps an AllStop [default: the state directory of systemd or of the person]
    #[arg(long, global = true, env = "AXLE_STATE", hide_env_values = true, value_name = "DIR")]
    pub(crate) state: Option<PathBuf>,
    /// Who this process is: a directory of `axle keys`; with one, every link is encrypted and shows its certificate
    #[arg(long, global = true, env = "AXLE_IDENTITY", hide_env_values = true, value_name = "DIR")]
    pub(crate) identity: Option<PathBuf>,
    /// After how many milliseconds of silence others take this process for dead: 400 suits wires, 1000 suits Wi-Fi
    #[arg(
        long,
        global = true,
        env = "AXLE_LEASE", hide_env_values = true,
        value_name = "MS",
        default_value_t = Link::default().lease_ms,
        value_parser = lease
    )]
    pub(crate) lease: u32,
    /// What to log on stderr: error, warn, info, debug, trace, or per part (axle=debug,zenoh=warn)
    #[arg(
        long,
        global = true,
        env = "AXLE_LOG",
        hide_env_values = true,
        value_name = "LEVEL",
        default_value = "info"
    )]
    pub(crate) log: String,
    /// How lines of the log stand on stderr: human, or json, one object a line
    #[arg(
        long,
        global = true,
        env = "AXLE_LOG_FORMAT",
        hide_env_values = true,
        hide_possible_values = true,
        value_name = "FORMAT",
        default_value = "human"
    )]
    pub(crate) log_format: crate::log::Format,
}

/// A certificate that ends within so many seconds is announced.
pub(crate) const SOON: f64 = 14.0 * 86_400.0;

fn lease(text: &str) -> Result<u32, String> {
    let (least, most) = axle_mesh::config::LEASES.into_inner();
    match text.parse() {
        Ok(ms) if (least..=most).contains(&ms) => Ok(ms),
        _ => Err(format!("write milliseconds, {least} to {most}")),
    }
}

impl Settings {
    /// The same for a command that starts a mesh of its own on this computer: nobody there asks for certificates.
    pub(crate) fn alone(&self) -> Self {
        Self { identity: None, ..self.clone() }
    }
    /// Who this process is, if it has an identity.
    ///
    /// # Errors
    /// A usage error for an identity that is not in order.
    pub(crate) fn identity(&self) -> anyhow::Result<Option<Identity>> {
        let Some(directory) = &self.identity else { return Ok(None) };
        let identity = Identity::read(directory, axle_mesh::clock::wall())
            .map_err(|fault| usage(format!("--identity: {fault}")))?;
        let left = identity.certificate.expires - axle_mesh::clock::wall();
        if left < SOON {
            let name = identity.name();
            tracing::warn!(
                "the certificate of {name} ends in {}; issue it anew with `axle keys issue {name}`",
                span(left)
            );
        }
        Ok(Some(identity))
    }
    /// How this process holds its links.
    ///
    /// # Errors
    /// As [`Settings::identity`].
    pub(crate) fn link(&self) -> anyhow::Result<Link> {
        Ok(Link { lease_ms: self.lease, identity: self.identity()? })
    }
    /// An endpoint as this process uses it: with an identity, encrypted.
    pub(crate) fn endpoint(&self, endpoint: &str) -> String {
        if self.identity.is_some() { secured(endpoint) } else { endpoint.to_owned() }
    }
    /// The robot that was named, or `r1`.
    pub(crate) fn one_robot(&self) -> anyhow::Result<RobotId> {
        Ok(self.robot.clone().map_or_else(|| RobotId::new("r1"), Ok)?)
    }
    /// The name of this computer.
    pub(crate) fn host_name(&self) -> String {
        self.host.clone().unwrap_or_else(|| {
            let read = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
            read.or_else(|| std::env::var("HOSTNAME").ok())
                .map_or_else(|| "localhost".into(), |name| name.trim().into())
        })
    }
    /// Where an AllStop is kept.
    pub(crate) fn state(&self) -> PathBuf {
        self.state.clone().unwrap_or_else(crate::run::latch::default_directory)
    }
    /// How this process is known on the mesh as `service`.
    ///
    /// # Errors
    /// As [`Settings::identity`].
    pub(crate) fn mesh(&self, service: &str, robot: Option<&RobotId>) -> anyhow::Result<axle_mesh::Settings> {
        Ok(axle_mesh::Settings {
            connect: self.connect.iter().map(|endpoint| self.endpoint(endpoint)).collect(),
            host: self.host_name(),
            service: service.to_owned(),
            robot: robot.map_or_else(|| ALL.to_owned(), ToString::to_string),
            inputs: Vec::new(),
            link: self.link()?,
        })
    }
    /// Joins the mesh for a command that a person waits for: an absent router is said within two seconds.
    pub(crate) async fn join(&self, command: &str) -> anyhow::Result<Mesh> {
        let patience = Patience::AtMost(Duration::from_secs(2));
        join(self.mesh(command, self.robot.as_ref())?, patience).await
    }
}

/// Joins the mesh; a wrong endpoint is a usage error.
pub(crate) async fn join(settings: axle_mesh::Settings, patience: Patience) -> anyhow::Result<Mesh> {
    let endpoints = settings.connect.join(", ");
    let mut told = None;
    let waiting = move |waited: Duration, obstacle: Option<Reach>| {
        // Somebody is there, and waiting alone will not help: said when it is found, and again when it changes.
        if obstacle != told
            && let Some(obstacle) = &obstacle
        {
            tracing::warn!("{obstacle}");
        }
        told = obstacle;
        if patience == Patience::Forever {
            let seconds = waited.as_secs();
            // At first every few seconds, then once a minute: a log is not a clock.
            if seconds <= 3 || (seconds <= 60 && seconds.is_multiple_of(10)) || seconds.is_multiple_of(60) {
                tracing::info!(
                    "waiting for a router at {endpoints} ({seconds} s); start one with `axle router`"
                );
            }
        }
    };
    Mesh::join(settings, patience, waiting).await.map_err(|fault| match fault {
        axle_mesh::Fault::Endpoint(_) | axle_mesh::Fault::NoIdentity { .. } => {
            usage(format!("--connect: {fault}"))
        }
        other => other.into(),
    })
}
