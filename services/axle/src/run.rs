//! Services as processes: one file for each kind, which joins the pure value to the mesh.

pub(crate) mod board;
pub(crate) mod calibrator;
pub(crate) mod composed;
pub(crate) mod corrector;
pub(crate) mod drive;
pub(crate) mod emulated_board;
pub(crate) mod emulator;
pub(crate) mod functional;
pub(crate) mod gateway;
pub(crate) mod latch;
pub(crate) mod map;
pub(crate) mod motor;
pub(crate) mod navigator;
pub(crate) mod pathfinder;
pub(crate) mod pilot;
pub(crate) mod recorder;
pub(crate) mod robot;
pub(crate) mod serial;
pub(crate) mod source;
pub(crate) mod tracer;
pub(crate) mod traffic;
pub(crate) mod tuning;

use crate::catalog::{Entry, Scope};
use crate::keys::Owner;
use crate::notify::Fed;
use crate::settings::{Settings, join};
use crate::signal::Stop;
use axle_mesh::{Mesh, Patience, Visible};
use axle_robot::BoardKind;
use axle_schema::RobotId;
use std::future::Future;
use std::path::PathBuf;
use std::pin::Pin;

/// A running service.
pub(crate) type Running = Pin<Box<dyn Future<Output = anyhow::Result<()>> + Send>>;

/// What a service needs to run.
pub(crate) struct Context {
    /// The mesh it is on.
    pub(crate) mesh: Mesh,
    /// Its catalogue name.
    pub(crate) service: &'static str,
    /// The robot it works for; `None` = all.
    pub(crate) robot: Option<RobotId>,
    /// Its parameters file.
    pub(crate) params: Option<PathBuf>,
    /// The board that it drives or plays, where one is named.
    pub(crate) board: Option<BoardKind>,
    /// The port of the board, or the link to the port that is played.
    pub(crate) port: Option<PathBuf>,
    /// Where an AllStop is kept, so that it outlives the process.
    pub(crate) state: PathBuf,
    /// When to stop.
    pub(crate) stop: Stop,
}

/// A service that others see, and whose service manager knows that it works, as long as this is kept.
pub(crate) struct Ready {
    _fed: Fed,
    _visible: Visible,
}

impl Context {
    /// The robot it works for.
    ///
    /// # Errors
    /// Services of one robot are always started with one.
    pub(crate) fn one_robot(&self) -> anyhow::Result<RobotId> {
        self.robot.clone().ok_or_else(|| anyhow::anyhow!("{} needs a robot", self.service))
    }
    /// Everything is declared: from now on others see the service.
    pub(crate) fn ready(&self) -> anyhow::Result<Ready> {
        let visible = self.mesh.become_visible()?;
        let robot = self.robot.as_ref().map_or("all robots", RobotId::as_str);
        tracing::info!("{} for {robot} is ready", self.service);
        Ok(Ready { _visible: visible, _fed: crate::notify::service_ready(self.stop.clone(), &self.mesh) })
    }
}

/// A service that shows the certificate of another one would be kept from its own work by every router.
fn is_own(
    entry: &'static Entry,
    robot: Option<&RobotId>,
    identity: &axle_mesh::Identity,
) -> anyhow::Result<()> {
    let own = Owner::Service { kind: entry.name, robot: robot.cloned() }.to_string();
    if identity.name() == own {
        return Ok(());
    }
    Err(crate::out::usage(format!(
        "--identity {}: this is the certificate of {}, and the service is {own}: issue its own with `axle keys issue \
         {own}`",
        identity.directory().display(),
        identity.name()
    )))
}

/// Runs one service until it is told to stop.
pub(crate) async fn run(
    entry: &'static Entry,
    settings: &Settings,
    params: Option<PathBuf>,
    inputs: Vec<(String, String)>,
    (board, port): (Option<BoardKind>, Option<PathBuf>),
) -> anyhow::Result<()> {
    (entry.check)(params.as_deref())?;
    let mut stop = crate::signal::stop()?;
    let robot = match entry.scope {
        Scope::AllRobots => settings.robot.clone(),
        Scope::OneRobot => Some(settings.one_robot()?),
    };
    let own = axle_mesh::Settings { inputs, ..settings.mesh(entry.name, robot.as_ref())? };
    if let Some(identity) = &own.link.identity {
        is_own(entry, robot.as_ref(), identity)?;
    }
    let joining = join(own, Patience::Forever);
    let mesh = tokio::select! {
        mesh = joining => mesh?,
        () = stop.wait() => return Ok(()),
    };
    let _log = crate::log::travel(&mesh, entry.name, robot.as_ref())?;
    let (state, service) = (settings.state(), entry.name);
    let context = Context { mesh: mesh.clone(), service, robot, params, board, port, state, stop };
    let result = (entry.run)(context).await;
    mesh.leave().await;
    result
}
