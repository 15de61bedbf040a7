//! `axle stop` and `axle enable`: the AllStop, and its end.

use crate::out::{data, note};
use crate::settings::Settings;
use axle_mesh::{Inbox, Mesh, Retry, random_bits};
use axle_schema::command::{AllStop, Done, Enable, GateState};
use axle_schema::{RobotId, StopId, key};
use std::time::Duration;
use tokio::time::{Instant, timeout_at};

/// A stop is repeated at this pace until the gate acknowledges it.
const REPEAT: Duration = Duration::from_millis(50);
/// A gate that does not acknowledge within this time has not been reached.
const PATIENCE: Duration = Duration::from_secs(2);

pub(super) async fn stop(settings: &Settings, json: bool) -> anyhow::Result<()> {
    let robot = settings.one_robot()?;
    let mesh = settings.join("stop").await?;
    let states = mesh.inbox(&key::GATE_STATE.of(&robot), 8)?;
    let id = StopId::from_random(random_bits());
    let order = AllStop { id, by: mesh.name() };
    let started = Instant::now();
    let acknowledged = loop {
        mesh.put_once(&key::STOP.of(&robot), &order)?;
        let until = Instant::now() + REPEAT;
        if let Some(state) =
            await_state(&states, until, |state| state.stop == Some(id) && !state.enabled).await
        {
            break Some(state);
        }
        if started.elapsed() > PATIENCE {
            break None;
        }
    };
    let took = started.elapsed();
    let Some(state) = acknowledged else {
        anyhow::bail!(
            "{robot} did not acknowledge the stop within 2 s: it may still move; is its robot or emulator up?"
        );
    };
    if json {
        let line = serde_json::json!({ "robot": robot, "stop": id, "acknowledged": true, "ms": took.as_secs_f64() * 1e3, "state": state });
        data(&line.to_string())?;
    } else {
        note(&format!(
            "{robot} is stopped (stop {id}, acknowledged after {:.0} ms); `axle enable` lets it move again",
            took.as_secs_f64() * 1e3
        ));
    }
    mesh.leave().await;
    Ok(())
}

pub(super) async fn enable(settings: &Settings, json: bool) -> anyhow::Result<()> {
    let robot = settings.one_robot()?;
    let mesh = settings.join("enable").await?;
    let state = newest_state(&mesh, &robot).await?;
    let ask = Enable { stop: state.stop, boot: state.boot, echo: state.tick, by: mesh.name() };
    let Done {} =
        mesh.ask(&key::ENABLE, Some(&robot), &ask, Duration::from_secs(2), Retry::Idempotent).await?;
    if json {
        data(&serde_json::json!({ "robot": robot, "enabled": true }).to_string())?;
    } else {
        note(&format!("{robot} may move"));
    }
    mesh.leave().await;
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
