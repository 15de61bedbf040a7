//! `axle traffic [ROBOT]`: who of a fleet waits for whom. `axle confirm`: a person lets a robot drive on.

use crate::cli::Traffic;
use crate::out::{data, note, table};
use crate::settings::Settings;
use crate::why::waiting::{chain, place};
use axle_mesh::Retry;
use axle_schema::command::Done;
use axle_schema::key;
use axle_schema::traffic::{Confirm, Mover, TrafficAsk, TrafficState};
use std::time::Duration;

/// Whoever is asked has this long to answer.
const PATIENCE: Duration = Duration::from_secs(3);

pub(super) async fn traffic(settings: &Settings, args: &Traffic) -> anyhow::Result<()> {
    let mesh = settings.join("traffic").await?;
    let state = mesh.ask(&key::TRAFFIC, None, &TrafficAsk {}, PATIENCE, Retry::Idempotent).await?;
    mesh.leave().await;
    match (&args.robot, args.json) {
        (None, true) => Ok(data(&serde_json::to_string(&state)?)?),
        (None, false) => print_all(&state),
        (Some(robot), json) => {
            let lines = explain(&state, robot)?;
            if json {
                return Ok(data(&serde_json::json!({ "robot": robot, "why": lines }).to_string())?);
            }
            lines.iter().try_for_each(|line| Ok(data(line)?))
        }
    }
}

fn print_all(state: &TrafficState) -> anyhow::Result<()> {
    if state.robots.is_empty() {
        note("no robot has asked; does `traffic = true` stand in the parameters of the pilots?");
        return Ok(());
    }
    let rows = state.robots.iter().map(|mover| {
        let order = mover.turn.map_or_else(|| "-".to_owned(), |turn| turn.to_string());
        let waits: Vec<&str> = mover.waits.iter().map(|wait| wait.robot.as_str()).collect();
        let way = format!("{} {} {}", mover.passed, mover.until, mover.pieces);
        vec![order, mover.robot.to_string(), stage(mover).to_owned(), way, place(mover), waits.join(", ")]
    });
    let header = ["order", "robot", "what", "passed, given, all", "at x, y", "waits for"];
    Ok(table(&header, rows)?)
}

const fn stage(mover: &Mover) -> &'static str {
    if mover.passed >= mover.pieces {
        "stands"
    } else if mover.until > mover.passed {
        "drives"
    } else {
        "waits"
    }
}

/// Why a robot waits, and why those do for which it waits, each once.
fn explain(state: &TrafficState, robot: &str) -> anyhow::Result<Vec<String>> {
    let find = |name: &str| state.robots.iter().find(|mover| mover.robot.as_str() == name);
    if find(robot).is_none() {
        let known: Vec<&str> = state.robots.iter().map(|mover| mover.robot.as_str()).collect();
        anyhow::bail!("unknown robot {robot:?}; Traffic knows: {}", known.join(", "));
    }
    let links = chain(state, robot);
    let mut lines: Vec<String> = links.iter().map(|link| link.what.clone()).collect();
    lines.extend(links.iter().flat_map(|link| &link.facts).map(|(name, value)| format!("{name}: {value}")));
    Ok(lines)
}

pub(super) async fn confirm(settings: &Settings) -> anyhow::Result<()> {
    let robot = settings.one_robot()?;
    let mesh = settings.join("confirm").await?;
    let mut by = mesh.name();
    by.truncate(by.floor_char_boundary(96));
    let Done {} = mesh.ask(&key::CONFIRM, Some(&robot), &Confirm { by }, PATIENCE, Retry::Never).await?;
    mesh.leave().await;
    note(&format!("{robot} may drive on"));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::traffic::Wait;
    use axle_schema::{Pose, RobotId, TaskId};

    fn mover(name: &str, passed: u32, until: u32, waits: &[&str]) -> Mover {
        let robot = |name: &str| RobotId::new(name).expect("a name");
        let waits = waits.iter().map(|name| Wait { robot: robot(name), why: "it is there".into() }).collect();
        let place = Pose::new(1.0, -0.0, 0.0);
        Mover { robot: robot(name), task: TaskId(1), place, passed, until, pieces: 5, turn: Some(1), waits }
    }

    #[test]
    fn the_chain_of_those_who_wait_is_told_once_each() {
        let robots = vec![
            mover("r1", 1, 3, &[]),
            mover("r2", 2, 2, &["r1", "r3"]),
            mover("r3", 0, 0, &["r1"]),
            mover("r4", 5, 5, &[]),
        ];
        let state = TrafficState { robots };
        let lines = explain(&state, "r2").expect("it is known");
        assert_eq!(
            lines,
            [
                "r2 waits for r1: it is there",
                "r2 waits for r3: it is there",
                "r3 waits for r1: it is there",
                "r1 drives: 1 of 5 pieces are behind it",
                "they can all end their tasks in this order: r1, r2, r3, r4",
            ]
        );
        assert!(explain(&state, "r4").expect("it is known")[0].contains("stands at (1.0, 0.0)"));
        assert!(explain(&state, "r9").expect_err("no such robot").to_string().contains("r1, r2, r3, r4"));
    }
}
