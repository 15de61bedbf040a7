//! The seven settings of a process: robot, connect, listen, params, host, state, log. Each is a flag and an `AXLE_…` variable.

use crate::out::usage;
use axle_mesh::{Mesh, Patience};
use axle_schema::{RobotId, id::ALL};
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;
use tracing_subscriber::EnvFilter;

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
}

impl Settings {
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
    pub(crate) fn mesh(&self, service: &str, robot: Option<&RobotId>) -> axle_mesh::Settings {
        axle_mesh::Settings {
            connect: self.connect.clone(),
            host: self.host_name(),
            service: service.to_owned(),
            robot: robot.map_or_else(|| ALL.to_owned(), ToString::to_string),
            inputs: Vec::new(),
        }
    }
    /// Joins the mesh for a command that a person waits for: an absent router is said within two seconds.
    pub(crate) async fn join(&self, command: &str) -> anyhow::Result<Mesh> {
        let patience = Patience::AtMost(Duration::from_secs(2));
        join(self.mesh(command, self.robot.as_ref()), patience).await
    }
}

/// Joins the mesh; a wrong endpoint is a usage error.
pub(crate) async fn join(settings: axle_mesh::Settings, patience: Patience) -> anyhow::Result<Mesh> {
    let endpoints = settings.connect.join(", ");
    let waiting = move |waited: Duration| {
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
        axle_mesh::Fault::Endpoint(_) => usage(format!("--connect: {fault}")),
        other => other.into(),
    })
}

/// Starts the log on stderr.
pub(crate) fn start_log(level: &str) {
    // Zenoh's own log says what happens on links; its errors are told by Axle in its own words.
    let filter = match level {
        "error" | "warn" | "info" | "debug" | "trace" | "off" => format!("{level},zenoh=off"),
        other => other.to_owned(),
    };
    let parsed = EnvFilter::builder().parse(&filter);
    let wrong = parsed.as_ref().err().map(ToString::to_string);
    tracing_subscriber::fmt()
        .with_env_filter(parsed.unwrap_or_else(|_| EnvFilter::new("info,zenoh=off")))
        .with_writer(std::io::stderr)
        .with_target(false)
        .with_ansi(
            std::io::IsTerminal::is_terminal(&std::io::stderr()) && std::env::var_os("NO_COLOR").is_none(),
        )
        .init();
    if let Some(wrong) = wrong {
        tracing::warn!("--log {level}: {wrong}; logging at info");
    }
}
