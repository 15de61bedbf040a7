//! `axle calibrate --watch`: listens while others drive, and proposes what the calibration should be.

use super::{Args, Facts, PATIENCE, lease, release};
use crate::out::{data, note};
use axle_calibrator::{Proposal, Watch};
use axle_mesh::{Mesh, Retry};
use axle_schema::calibration::Calibrate;
use axle_schema::command::{Class, Done};
use axle_schema::{Refusal, RobotId, key};
use std::time::Duration;
use tokio::time::{Instant, sleep_until};

/// How often the comparison is looked at.
const LOOK: Duration = Duration::from_secs(1);

/// Watches until it is told to stop.
pub(super) async fn watch(mesh: &Mesh, robot: &RobotId, facts: Facts, args: &Args) -> anyhow::Result<()> {
    let mut watch = Watch::new(facts.calibration, facts.track)?;
    let motors = mesh.inbox(&key::MOTORS.of(robot), 512)?;
    let inertial = mesh.inbox(&key::INERTIAL.of(robot), 512)?;
    let mut stop = crate::signal::stop()?;
    let end = args.seconds.map(|seconds| Instant::now() + Duration::from_secs(u64::from(seconds)));
    let over = async move {
        match end {
            Some(end) => sleep_until(end).await,
            None => std::future::pending().await,
        }
    };
    let mut over = std::pin::pin!(over);
    let mut look = tokio::time::interval(LOOK);
    let mut told: Option<Vec<String>> = None;
    note("watching; drive the robot, straight on and around");
    loop {
        tokio::select! {
            heard = motors.next() => {
                while let Some(heard) = inertial.take() {
                    watch.hear_inertial(&heard.message);
                }
                watch.hear_signals(&heard.message);
            }
            _ = look.tick() => {
                let Some(proposal) = watch.proposal() else { continue };
                let names: Vec<String> = proposal.changes.iter().map(|(name, _)| name.clone()).collect();
                if told.as_ref() != Some(&names) {
                    say(&proposal, args.json)?;
                    told = Some(names);
                }
                if args.adapt {
                    match adapt(mesh, robot, &proposal).await {
                        Ok(()) => {
                            note(&format!("calibration {} is applied", proposal.calibration.version));
                            watch.adopt(proposal.calibration)?;
                            told = None;
                        }
                        // Somebody drives: it is tried again.
                        Err(refusal) => tracing::debug!("not applied yet: {refusal}"),
                    }
                }
            }
            () = stop.wait() => break,
            () = &mut over => break,
        }
    }
    note(&format!("{} windows of a second told something", watch.windows()));
    Ok(())
}

/// Has it applied, if nobody holds the wheels and they stand.
async fn adapt(mesh: &Mesh, robot: &RobotId, proposal: &Proposal) -> Result<(), Refusal> {
    let lease = lease(mesh, robot, Class::Background).await?;
    let mut calibration = proposal.calibration.clone();
    let numbers: Vec<&str> = proposal.changes.iter().map(|(name, _)| name.as_str()).collect();
    calibration.made = format!("by the watch: {}", numbers.join(", ")).chars().take(120).collect();
    let question = Calibrate { boot: lease.boot, epoch: lease.epoch, calibration };
    let applied: Result<Done, Refusal> =
        mesh.ask(&key::CALIBRATE, Some(robot), &question, PATIENCE, Retry::Never).await;
    release(mesh, robot, lease).await;
    applied.map(|_| ())
}

fn say(proposal: &Proposal, json: bool) -> anyhow::Result<()> {
    if json {
        let changes: Vec<serde_json::Value> = proposal
            .changes
            .iter()
            .map(|(name, factor)| {
                serde_json::json!({ "name": name, "factor": factor.value, "low": factor.low, "high": factor.high })
            })
            .collect();
        let line = serde_json::json!({ "changes": changes, "calibration": proposal.calibration });
        return Ok(data(&line.to_string())?);
    }
    for (name, factor) in &proposal.changes {
        let half = (factor.high - factor.low) / 2.0 * 100.0;
        data(&format!("{name} is off by {:+.2} % (± {half:.2} %)", (factor.value - 1.0) * 100.0))?;
    }
    Ok(())
}
