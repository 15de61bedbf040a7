//! `axle drive watch`: every update and notification of the drive, one line each.

use super::{Client, word};
use crate::out::data;
use axle_schema::differential_drive::{DriveDistance, DriveState, RotateDegrees, WheelState};
use axle_schema::{Refusal, key};

pub(super) async fn watch(client: &Client, json: bool, count: Option<u64>) -> anyhow::Result<()> {
    let (mesh, robot) = (&client.mesh, &client.robot);
    let distances = mesh.inbox(&key::DRIVE_DISTANCE_STAGE.of(robot), 256)?;
    let turns = mesh.inbox(&key::DRIVE_ROTATE_STAGE.of(robot), 256)?;
    let updates = mesh.inbox(&key::DRIVE_UPDATE.of(robot), 256)?;
    // Said at once when there is no drive; afterwards its silence is shown by the absence of lines.
    client.state().await?;
    let mut stop = crate::signal::stop()?;
    let mut lines = 0;
    while count.is_none_or(|count| lines < count) {
        let (what, value, text) = tokio::select! {
            biased;
            () = stop.wait() => return Ok(()),
            heard = distances.next() => {
                let stage = heard.message;
                ("distance", serde_json::to_value(&stage)?, distance(&stage)?)
            }
            heard = turns.next() => {
                let stage = heard.message;
                ("rotate", serde_json::to_value(&stage)?, turn(&stage)?)
            }
            heard = updates.next() => {
                let state = heard.message;
                ("update", serde_json::to_value(&state)?, update(&state)?)
            }
        };
        data(&if json { serde_json::json!({ what: value }).to_string() } else { text })?;
        lines += 1;
    }
    Ok(())
}

fn reason(why: Option<&Refusal>) -> String {
    why.map_or_else(String::new, |why| format!(": {why}"))
}

fn distance(stage: &DriveDistance) -> anyhow::Result<String> {
    let DriveDistance { distance, power, stage, why, .. } = stage;
    Ok(format!(
        "distance {} m at power {}: {}{}",
        distance.0,
        power.get(),
        word(stage)?,
        reason(why.as_ref())
    ))
}

fn turn(stage: &RotateDegrees) -> anyhow::Result<String> {
    let RotateDegrees { degrees, power, stage, why, .. } = stage;
    Ok(format!("rotate {degrees} degrees at power {}: {}{}", power.get(), word(stage)?, reason(why.as_ref())))
}

fn update(state: &DriveState) -> anyhow::Result<String> {
    let wheel = |wheel: WheelState| {
        format!("{:+.2} {:+.3} m/s {:+.4} m", wheel.power.get(), wheel.speed.0, wheel.distance.0)
    };
    let enabled = if state.enabled { "enabled" } else { "disabled" };
    let (operation, motion) = (word(&state.operation)?, word(&state.motion)?);
    let wheels = state.wheels.map(wheel);
    let stamp = state.stamp.0;
    Ok(format!("{stamp:.2} s {enabled} {operation} {motion}; left {}; right {}", wheels.left, wheels.right))
}
