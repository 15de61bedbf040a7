//! `axle doctor --self`: whether one process works, shown by a round trip of data through its router.
//!
//! A process that exists may hang, and a token on the mesh outlives its owner by a lease. So a service is asked for
//! its status over the router that it uses, a beat must go on between two answers, and a planner must answer a
//! question of its trade. A router must carry a question and its answer between two sessions. What lies between two
//! services is not looked at here but in [`pairs`], for `axle doctor` without `--self`.

mod clocks;
mod pairs;

use crate::catalog::{self, Scope};
use crate::cli::Doctor;
use crate::out::data;
use crate::settings::Settings;
use axle_mesh::{Mesh, Retry};
use axle_schema::key::chunk;
use axle_schema::presence::Status;
use axle_schema::traffic::TrafficAsk;
use axle_schema::{DriveAsk, Geometry, Leg, MapAsk, Metres, PlanAsk, Refusal, RobotId, WayTask, id, key};
use std::future::Future;
use std::pin::Pin;
use std::time::Duration;
use tokio::time::Instant;

/// A process that does not answer within this time is silent.
const PATIENCE: Duration = Duration::from_millis(700);
/// A router carries a question and its answer within this time, on a computer that is busy too: whoever is judged by this
/// is started anew, and with a router all of its links are lost.
const CARRIED: Duration = Duration::from_secs(2);
/// A planner has this long for a question that takes microseconds.
const DEADLINE: Duration = Duration::from_secs(1);
/// The slowest beat of Axle is 5 Hz: one that has not come for so long will not come.
const STUCK: Duration = Duration::from_secs(1);

/// Says whether the process is well, in a line.
///
/// # Errors
/// What is wrong with it, and what to do.
pub(super) async fn doctor(settings: &Settings, args: &Doctor) -> anyhow::Result<()> {
    if !args.own {
        if args.service.is_some() && std::env::var_os("AXLE_SERVICE").is_none() {
            return Err(crate::out::usage("to look at one service, write `axle doctor --self SERVICE`"));
        }
        let topology = super::check::read(args.topology.as_deref())?;
        return pairs::examine(settings, &topology, args.json).await;
    }
    let started = Instant::now();
    let name = args.service.as_deref().unwrap_or_default();
    let found = if name == "router" { router(settings).await } else { service(settings, name).await };
    let ms = (started.elapsed().as_secs_f64() * 1e4).round() / 10.0;
    if args.json {
        let reason = found.as_ref().err().map(|fault| format!("{fault:#}"));
        let line = serde_json::json!({
            "service": name, "healthy": found.is_ok(), "found": found.as_ref().ok(), "reason": reason, "ms": ms,
        });
        data(&line.to_string())?;
    } else if let Ok(found) = &found {
        data(&format!("{name} is healthy: {found}, in {ms:.0} ms"))?;
    }
    found.map(drop)
}

/// A router is well when one session hears the answer of another through it.
async fn router(settings: &Settings) -> anyhow::Result<String> {
    let (answering, asking) = (settings.join("doctor").await?, settings.join("doctor").await?);
    let visible = answering.become_visible()?;
    let robot = settings.robot.as_ref().map_or(id::ALL, RobotId::as_str);
    let doctors = asking.processes_of(robot, "doctor", CARRIED).await?;
    let is_carried =
        doctors.iter().any(|(presence, status)| presence.boot == answering.boot() && status.is_some());
    drop(visible);
    answering.leave().await;
    asking.leave().await;
    anyhow::ensure!(
        is_carried,
        "the router at {} takes connections but carried no answer within {CARRIED:?}; restart it",
        settings.connect.join(", ")
    );
    Ok("it carries questions and answers between two sessions".into())
}

/// A service is well when it answers for itself, its beat goes on, and it answers questions of its trade.
async fn service(settings: &Settings, name: &str) -> anyhow::Result<String> {
    let entry = catalog::find(name).ok_or_else(|| super::unknown_service(name))?;
    let robot = match entry.scope {
        Scope::AllRobots => settings.robot.clone(),
        Scope::OneRobot => Some(settings.one_robot()?),
    };
    let mesh = settings.join("doctor").await?;
    let found = examine(&mesh, settings, name, robot.as_ref()).await;
    mesh.leave().await;
    found
}

async fn examine(
    mesh: &Mesh,
    settings: &Settings,
    name: &str,
    robot: Option<&RobotId>,
) -> anyhow::Result<String> {
    let own =
        Own { mesh, name, robot: robot.map_or(id::ALL, RobotId::as_str), host: chunk(&settings.host_name()) };
    let first = own.status().await?;
    let mut found = "it answers for itself".to_owned();
    if first.beats > 0 {
        let beats = own.next_beat(&first).await?;
        found.push_str(&format!(", its beat goes on ({beats} so far)"));
    }
    if let Some((_, question)) = QUESTIONS.iter().find(|(service, _)| *service == name) {
        question(mesh, robot).await.map_err(|refusal| {
            anyhow::anyhow!("{name} is alive but does not do its work: {refusal}; its log says more")
        })?;
        found.push_str(", and a question of its trade");
    }
    Ok(found)
}

/// The process that is looked at.
struct Own<'a> {
    mesh: &'a Mesh,
    name: &'a str,
    robot: &'a str,
    host: String,
}

impl Own<'_> {
    /// What it says of itself.
    async fn status(&self) -> anyhow::Result<Status> {
        let Self { mesh, name, robot, host } = self;
        let mut here = mesh.processes_of(robot, name, PATIENCE).await?;
        here.retain(|(presence, _)| presence.host == *host);
        let is_there = !here.is_empty();
        // Of several on one computer (an old run whose token is still there) the one that answers counts.
        here.into_iter().find_map(|(_, status)| status).ok_or_else(|| {
            if is_there {
                anyhow::anyhow!("{name} for {robot} on {host} is on the mesh but silent: it hangs; restart it")
            } else {
                anyhow::anyhow!(
                    "no {name} for {robot} on {host} is on the mesh: it has not begun, hangs, or has lost its \
                     router; its log says why"
                )
            }
        })
    }

    /// Asks until the beat has gone on, and says how many there were.
    async fn next_beat(&self, first: &Status) -> anyhow::Result<u64> {
        let started = Instant::now();
        loop {
            let next = self.status().await?;
            if next.boot != first.boot || next.beats > first.beats {
                return Ok(next.beats);
            }
            anyhow::ensure!(
                started.elapsed() < STUCK,
                "{} answers, but its beat has stood still for {STUCK:?} after {} beats; restart it",
                self.name,
                first.beats
            );
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

/// A question whose answer every working planner knows.
type Question = for<'a> fn(&'a Mesh, Option<&'a RobotId>) -> Asking<'a>;
type Asking<'a> = Pin<Box<dyn Future<Output = Result<(), Refusal>> + Send + 'a>>;

/// A question for each service that answers for all robots. It is answered by the nearest instance: one of this router's.
const QUESTIONS: &[(&str, Question)] = &[
    ("pathfinder", |mesh, robot| Box::pin(plan(mesh, robot))),
    ("pathdriver", |mesh, robot| Box::pin(drive(mesh, robot))),
    ("map", |mesh, robot| Box::pin(map(mesh, robot))),
    ("traffic", |mesh, robot| Box::pin(traffic(mesh, robot))),
];

async fn plan(mesh: &Mesh, robot: Option<&RobotId>) -> Result<(), Refusal> {
    let ask = PlanAsk { way: WayTask::parse("0,0 1,0")?, ..PlanAsk::default() };
    let plan = mesh.ask(&key::PLAN, robot, &ask, DEADLINE, Retry::Idempotent).await?;
    some(&plan.legs, "geometries for a way of a metre")
}

async fn drive(mesh: &Mesh, robot: Option<&RobotId>) -> Result<(), Refusal> {
    let leg = Leg { geometry: Geometry::Line { length: Metres(1.0) }, point: 0, speed: None };
    let ask = DriveAsk { legs: vec![leg], speeds: None, robot: None, manner: None };
    let drive = mesh.ask(&key::DRIVE, robot, &ask, DEADLINE, Retry::Idempotent).await?;
    some(&drive.dwms, "movements for a line of a metre")
}

async fn map(mesh: &Mesh, robot: Option<&RobotId>) -> Result<(), Refusal> {
    mesh.ask(&key::MAP, robot, &MapAsk::default(), DEADLINE, Retry::Idempotent).await.map(drop)
}

/// A fleet without robots is a good answer.
async fn traffic(mesh: &Mesh, robot: Option<&RobotId>) -> Result<(), Refusal> {
    mesh.ask(&key::TRAFFIC, robot, &TrafficAsk {}, DEADLINE, Retry::Idempotent).await.map(drop)
}

fn some<T>(list: &[T], what: &str) -> Result<(), Refusal> {
    if list.is_empty() { Err(Refusal::missing(what, "it answered with none")) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_answers_for_all_robots_is_asked_a_question() {
        for entry in catalog::CATALOG {
            let is_asked = QUESTIONS.iter().any(|(service, _)| *service == entry.name);
            let answers = !(entry.wires)(entry.name).answers.is_empty();
            assert_eq!(is_asked, entry.scope == Scope::AllRobots && answers, "{}", entry.name);
        }
    }
}
