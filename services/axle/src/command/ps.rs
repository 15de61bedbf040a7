//! `axle ps`: every live service.

use crate::out::{data, note, table};
use crate::settings::Settings;
use axle_schema::key::Presence;
use axle_schema::presence::Status;
use std::time::Duration;

/// A process that does not answer within this time is silent.
const PATIENCE: Duration = Duration::from_millis(700);

pub(super) async fn ps(settings: &Settings, json: bool) -> anyhow::Result<()> {
    let mesh = settings.join("ps").await?;
    let mut everybody = mesh.everybody(PATIENCE).await?;
    if let Some(robot) = &settings.robot {
        everybody.retain(|(presence, _)| presence.robot == robot.as_str());
    }
    everybody.sort_by(|(a, _), (b, _)| (&a.robot, &a.service, a.pid).cmp(&(&b.robot, &b.service, b.pid)));
    if json {
        let rows: Vec<_> =
            everybody.iter().map(|(presence, status)| json_row(presence, status.as_ref())).collect();
        data(&serde_json::to_string(&rows)?)?;
    } else if everybody.is_empty() {
        note("no service is alive; start them with `axle up`, or one with `axle run SERVICE`");
    } else {
        let header = [
            "service", "robot", "host", "pid", "version", "uptime", "beats", "late", "late p99", "sent",
            "received", "refused",
        ];
        table(&header, everybody.iter().map(|(presence, status)| row(presence, status.as_ref())))?;
    }
    mesh.leave().await;
    Ok(())
}

fn row(presence: &Presence, status: Option<&Status>) -> Vec<String> {
    let Presence { robot, service, host, pid, .. } = presence;
    let mut row = vec![service.clone(), robot.clone(), host.clone(), pid.to_string()];
    match status {
        Some(status) => row.extend([
            status.version.clone(),
            format!("{:.0} s", status.uptime.0),
            status.beats.to_string(),
            status.late.to_string(),
            if status.beats > 0 { format!("{:.1} ms", status.late_p99.0 * 1e3) } else { "-".into() },
            status.sent.to_string(),
            status.received.to_string(),
            status.refused.to_string(),
        ]),
        None => row.extend(["silent: alive, but does not answer".to_owned()]),
    }
    row
}

fn json_row(presence: &Presence, status: Option<&Status>) -> serde_json::Value {
    let Presence { robot, service, host, pid, boot } = presence;
    serde_json::json!({
        "service": service, "robot": robot, "host": host, "pid": pid, "boot": boot,
        "answers": status.is_some(),
        "version": status.map(|status| &status.version),
        "uptime_s": status.map(|status| status.uptime),
        "beats": status.map(|status| status.beats),
        "late": status.map(|status| status.late),
        "late_p99_s": status.map(|status| status.late_p99),
        "sent": status.map(|status| status.sent),
        "received": status.map(|status| status.received),
        "refused": status.map(|status| status.refused),
    })
}
