//! `axle log SERVICE LEVEL`: makes a service log more or less while it runs.

use super::unknown_service;
use crate::catalog::{self, Scope};
use crate::cli::Log;
use crate::out::note;
use crate::settings::Settings;
use axle_schema::command::Done;
use axle_schema::id::ALL;
use axle_schema::log::SetLog;
use std::time::Duration;

/// A process that does not answer within this time is not waited for.
const PATIENCE: Duration = Duration::from_millis(1500);

pub(super) async fn log(settings: &Settings, args: Log) -> anyhow::Result<()> {
    let entry = catalog::find(&args.service).ok_or_else(|| unknown_service(&args.service))?;
    let robot = match (&settings.robot, entry.scope) {
        (None, Scope::AllRobots) => ALL.to_owned(),
        _ => settings.one_robot()?.to_string(),
    };
    let mesh = settings.join("log").await?;
    let processes = mesh.processes_of(&robot, entry.name, PATIENCE).await?;
    anyhow::ensure!(!processes.is_empty(), "no {} of {robot} is alive", entry.name);
    let question = SetLog { level: args.level };
    for (presence, _) in processes {
        let Done {} = mesh.ask_at(&presence.log_level(), &question, PATIENCE).await?;
        note(&format!("{} of {robot} (pid {}) logs at {}", entry.name, presence.pid, question.level));
    }
    mesh.leave().await;
    Ok(())
}
