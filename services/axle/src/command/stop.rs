//! `axle stop` and `axle enable`: the AllStop, and its end.

use crate::cli::Stop;
use crate::out::{data, note};
use crate::settings::Settings;
use axle_mesh::{Inbox, Mesh, Retry, random_bits};
use axle_schema::command::{AllStop, Class, Done, Enable, GateState};
use axle_schema::{RobotId, StopId, key};
use std::collections::BTreeSet;
use std::time::Duration;
use tokio::time::{Instant, timeout_at};

/// A stop is repeated at this pace until the gate acknowledges it.
const REPEAT: Duration = Duration::from_millis(50);
/// A gate that does not acknowledge (or a disk that does not store) a stop within this time is not waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// Stops one robot, or every robot that is there, and says which ones did not acknowledge it.
pub(super) async fn stop(settings: &Settings, args: &Stop) -> anyhow::Result<()> {
    let mesh = settings.join("stop").await?;
    let robots = if args.all { every_robot(&mesh).await? } else { vec![settings.one_robot()?] };
    if robots.is_empty() {
        note("no robot is there to be stopped");
    }
    let order = AllStop { id: StopId::from_random(random_bits()), by: mesh.name() };
    let outcomes = robots.iter().map(|robot| stop_one(&mesh, robot, &order));
    let outcomes = futures_util::future::join_all(outcomes).await;
    let mut silent = Vec::new();
    for (robot, outcome) in robots.iter().zip(outcomes) {
        let Receipt { state, took } = outcome?;
        if state.is_none() {
            silent.push(robot.as_str());
        }
        if args.json {
            let stored = state.as_ref().is_some_and(|state| state.stored);
            let line = serde_json::json!({
                "robot": robot, "stop": order.id, "acknowledged": state.is_some(), "stored": stored,
                "ms": took.as_secs_f64() * 1e3, "state": state,
            });
            data(&line.to_string())?;
        } else if let Some(state) = state {
            let ms = took.as_secs_f64() * 1e3;
            let id = order.id;
            note(&format!(
                "{robot} is stopped (stop {id}, acknowledged after {ms:.0} ms); `axle enable` lets it move again"
            ));
            if !state.stored {
                note(&format!(
                    "{robot} could not store the stop: after a restart of its process it is not in force"
                ));
            }
        }
    }
    let denied = mesh.unless_denied();
    mesh.leave().await;
    anyhow::ensure!(
        silent.is_empty(),
        "{} did not acknowledge the stop within 2 s and may still move; is the robot or emulator up?{denied}",
        silent.join(", ")
    );
    Ok(())
}

/// What came of a stop: the gate's state that acknowledges it, and how long that took.
struct Receipt {
    state: Option<GateState>,
    took: Duration,
}

/// Stops one robot; says whether its gate has acknowledged it.
pub(super) async fn stop_now(mesh: &Mesh, robot: &RobotId) -> anyhow::Result<bool> {
    let order = AllStop { id: StopId::from_random(random_bits()), by: mesh.name() };
    Ok(stop_one(mesh, robot, &order).await?.state.is_some())
}

async fn stop_one(mesh: &Mesh, robot: &RobotId, order: &AllStop) -> anyhow::Result<Receipt> {
    let states = mesh.inbox(&key::GATE_STATE.of(robot), 8)?;
    let started = Instant::now();
    let is_receipt = |state: &GateState| state.stop == Some(order.id) && !state.enabled;
    let acknowledged = loop {
        mesh.put_once(&key::STOP.of(robot), order)?;
        let until = Instant::now() + REPEAT;
        if let Some(state) = await_state(&states, until, is_receipt).await {
            break Some(state);
        }
        if started.elapsed() > PATIENCE {
            break None;
        }
    };
    let took = started.elapsed();
    // The wheels brake already; the disk may take a moment longer.
    let state = match acknowledged {
        Some(state) if !state.stored => {
            let stored =
                await_state(&states, started + PATIENCE, |state| is_receipt(state) && state.stored).await;
            Some(stored.unwrap_or(state))
        }
        other => other,
    };
    Ok(Receipt { state, took })
}

/// The robots of which any process is alive.
async fn every_robot(mesh: &Mesh) -> anyhow::Result<Vec<RobotId>> {
    let everybody = mesh.everybody(PATIENCE).await?;
    let robots: BTreeSet<String> = everybody.into_iter().map(|(presence, _)| presence.robot).collect();
    Ok(robots.into_iter().filter_map(|robot| RobotId::new(&robot).ok()).collect())
}

pub(super) async fn enable(settings: &Settings, json: bool) -> anyhow::Result<()> {
    let robot = settings.one_robot()?;
    let mesh = settings.join("enable").await?;
    enable_now(&mesh, &robot).await?;
    if json {
        data(&serde_json::json!({ "robot": robot, "enabled": true }).to_string())?;
    } else {
        note(&format!("{robot} may move"));
    }
    mesh.leave().await;
    Ok(())
}

/// Allows the wheels of one robot to move again.
pub(super) async fn enable_now(mesh: &Mesh, robot: &RobotId) -> anyhow::Result<()> {
    let state = newest_state(mesh, robot).await?;
    let ask = Enable {
        stop: state.stop,
        boot: state.boot,
        echo: state.tick,
        by: mesh.name(),
        class: Class::Manual,
    };
    let Done {} =
        mesh.ask(&key::ENABLE, Some(robot), &ask, Duration::from_secs(2), Retry::Idempotent).await?;
    Ok(())
}

/// The next state that the gate says; it speaks once a second at least.
async fn newest_state(mesh: &Mesh, robot: &RobotId) -> anyhow::Result<GateState> {
    let states = mesh.inbox(&key::GATE_STATE.of(robot), 1)?;
    await_state(&states, Instant::now() + PATIENCE, |_| true)
        .await
        .ok_or_else(|| anyhow::anyhow!("the gate of {robot} says nothing; is its robot or emulator up?"))
}

async fn await_state(
    states: &Inbox<GateState>,
    until: Instant,
    is_right: impl Fn(&GateState) -> bool,
) -> Option<GateState> {
    loop {
        let heard = timeout_at(until, states.next()).await.ok()?;
        if is_right(&heard.message) {
            return Some(heard.message);
        }
    }
}
