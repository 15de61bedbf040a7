//! `axle drive distance` and `axle drive rotate`: an operation with its progress, until it is completed or cancelled.

use super::Client;
use crate::command::go::Bar;
use crate::out::{data, note};
use axle_mesh::Inbox;
use axle_schema::differential_drive::{
    DriveDistance, DriveStage, DriveState, OperationBegun, RotateDegrees, WheelState,
};
use axle_schema::{Refusal, Sides, TaskId, key};
use std::time::Duration;
use tokio::time::{Instant, timeout};

/// A drive that says nothing for so long is gone; it speaks once a second.
const SILENCE: Duration = Duration::from_secs(3);
/// After Ctrl-C the drive has this long to say that the operation is over.
const CANCELLING: Duration = Duration::from_secs(1);

/// What is asked for.
pub(super) enum Way {
    Distance(DriveDistance),
    Rotate(RotateDegrees),
}

impl Way {
    /// How far each wheel has to go, in metres.
    fn length(&self, state: &DriveState) -> f64 {
        match self {
            Self::Distance(request) => request.distance.0,
            Self::Rotate(request) => request.degrees.to_radians().abs() * state.track.0 / 2.0,
        }
    }
    async fn ask(&self, client: &Client) -> Result<OperationBegun, Refusal> {
        match self {
            Self::Distance(request) => client.ask(&key::DRIVE_DISTANCE, request).await,
            Self::Rotate(request) => client.ask(&key::DRIVE_ROTATE, request).await,
        }
    }
}

/// What the drive says while it drives.
struct Words {
    distances: Inbox<DriveDistance>,
    turns: Inbox<RotateDegrees>,
    updates: Inbox<DriveState>,
}

/// One word of it.
enum Word {
    Stage(Option<TaskId>, DriveStage, Option<Refusal>),
    Update(Box<DriveState>),
}

impl Words {
    async fn next(&self) -> anyhow::Result<Word> {
        let word = async {
            tokio::select! {
                biased;
                heard = self.distances.next() => {
                    let DriveDistance { operation, stage, why, .. } = heard.message;
                    Word::Stage(operation, stage, why)
                }
                heard = self.turns.next() => {
                    let RotateDegrees { operation, stage, why, .. } = heard.message;
                    Word::Stage(operation, stage, why)
                }
                heard = self.updates.next() => Word::Update(Box::new(heard.message)),
            }
        };
        timeout(SILENCE, word)
            .await
            .map_err(|_| anyhow::anyhow!("the drive said nothing for 3 s: it has ended, or the router has"))
    }
    /// Follows an operation to its end.
    async fn follow(
        &self,
        id: TaskId,
        mut show: impl FnMut(&DriveState),
    ) -> anyhow::Result<(DriveStage, Option<Refusal>)> {
        loop {
            match self.next().await? {
                Word::Update(state) => show(&state),
                Word::Stage(of, stage, why) if of == Some(id) => match stage {
                    DriveStage::Completed | DriveStage::Canceled => return Ok((stage, why)),
                    DriveStage::InitialRequest | DriveStage::Started => {}
                },
                Word::Stage(..) => {}
            }
        }
    }
}

/// Asks for the way, and sees it through.
pub(super) async fn run(client: &Client, way: Way, json: bool) -> anyhow::Result<()> {
    let (mesh, robot) = (&client.mesh, &client.robot);
    let mut stop = crate::signal::stop()?;
    let words = Words {
        distances: mesh.inbox(&key::DRIVE_DISTANCE_STAGE.of(robot), 64)?,
        turns: mesh.inbox(&key::DRIVE_ROTATE_STAGE.of(robot), 64)?,
        updates: mesh.inbox(&key::DRIVE_UPDATE.of(robot), 16)?,
    };
    let before = client.state().await?;
    let length = way.length(&before);
    let begun = Instant::now();
    let OperationBegun { operation } = way.ask(client).await?;
    let bar = Bar::new();
    let follow = words.follow(operation, |state| {
        let done = covered(&before, state);
        let share = if length > 0.0 { (done / length).min(1.0) } else { 1.0 };
        bar.set(share, format!("{done:.3} m of {length:.3} m, {:.1} s", begun.elapsed().as_secs_f64()));
    });
    let (stage, why) = tokio::select! {
        end = follow => end?,
        () = stop.wait() => {
            bar.clear();
            note("cancelling …");
            client.rest().await?;
            timeout(CANCELLING, words.follow(operation, |_| {})).await.map_err(|_| {
                anyhow::anyhow!("the drive did not say that the operation is over; `axle stop` stops the robot")
            })??
        }
    };
    bar.clear();
    let after = client.state().await?;
    let (took, done) = (begun.elapsed().as_secs_f64(), covered(&before, &after));
    if json {
        let line = serde_json::json!({
            "completed": stage == DriveStage::Completed, "operation": operation, "stage": stage, "why": why,
            "distance_m": done, "duration_s": took, "state": after,
        });
        data(&line.to_string())?;
    }
    let summary = format!("{done:.3} m of {length:.3} m by the encoders in {took:.1} s");
    match (stage, why) {
        (DriveStage::Completed, _) => {
            note(&format!("completed: {summary}"));
            Ok(())
        }
        (_, Some(why)) => anyhow::bail!("cancelled: {why}; {summary}"),
        (_, None) => anyhow::bail!("cancelled by another request; {summary}"),
    }
}

/// How far the wheels went on the average, without their signs.
fn covered(before: &DriveState, now: &DriveState) -> f64 {
    let Sides { left, right } = now
        .wheels
        .zip(before.wheels, |now: WheelState, then: WheelState| (now.distance - then.distance).abs().0);
    (left + right) / 2.0
}
