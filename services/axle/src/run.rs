//! Services as processes: one file for each kind, which joins the pure value to the mesh.

pub(crate) mod board;
pub(crate) mod composed;
pub(crate) mod corrector;
pub(crate) mod drive;
pub(crate) mod emulator;
pub(crate) mod functional;
pub(crate) mod latch;
pub(crate) mod motor;
pub(crate) mod navigator;
pub(crate) mod pilot;
pub(crate) mod recorder;
pub(crate) mod source;

use crate::catalog::{Entry, Scope};
use crate::settings::{Settings, join};
use crate::signal::Stop;
use axle_mesh::{Mesh, Patience, Visible};
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
    /// Where an AllStop is kept, so that it outlives the process.
    pub(crate) state: PathBuf,
    /// When to stop.
    pub(crate) stop: Stop,
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
    pub(crate) fn ready(&self) -> anyhow::Result<Visible> {
        let visible = self.mesh.become_visible()?;
        let robot = self.robot.as_ref().map_or("all robots", RobotId::as_str);
        tracing::info!("{} for {robot} is ready", self.service);
        Ok(visible)
    }
}

/// Runs one service until it is told to stop.
pub(crate) async fn run(
    entry: &'static Entry,
    settings: &Settings,
    params: Option<PathBuf>,
    inputs: Vec<(String, String)>,
) -> anyhow::Result<()> {
    (entry.check)(params.as_deref())?;
    let mut stop = crate::signal::stop()?;
    let robot = match entry.scope {
        Scope::AllRobots => settings.robot.clone(),
        Scope::OneRobot => Some(settings.one_robot()?),
    };
    let own = axle_mesh::Settings { inputs, ..settings.mesh(entry.name, robot.as_ref()) };
    let joining = join(own, Patience::Forever);
    let mesh = tokio::select! {
        mesh = joining => mesh?,
        () = stop.wait() => return Ok(()),
    };
    let context =
        Context { mesh: mesh.clone(), service: entry.name, robot, params, state: settings.state(), stop };
    let result = (entry.run)(context).await;
    mesh.leave().await;
    result
}
