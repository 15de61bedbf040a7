//! AllStop, EnableDrive, Get and Update.

use super::clause::{Clause, Finding, Probing, expect};
use super::client::{Client, SOON};
use axle_schema::command::Motion;
use axle_schema::differential_drive::{DriveStage, EnableDrive};
use axle_schema::{Refusal, Seconds};
use std::time::Duration;
use tokio::time::sleep;

pub(super) const CLAUSES: &[Clause] = &[
    Clause::must("get", "Get answers with the state of both wheels and whether the drive is enabled.", get),
    Clause::must("enabled-stands", "Enabling the drive moves nothing by itself.", enabled_stands),
    Clause::must(
        "all-stop",
        "AllStop sets the power of both wheels to zero and disables the drive.",
        all_stop,
    ),
    Clause::must(
        "disabled-faults",
        "While the drive is disabled, every request to move is a fault.",
        disabled_faults,
    ),
    Clause::must(
        "enable-again",
        "After an AllStop, EnableDrive(true) lets the robot move again.",
        enable_again,
    ),
    Clause::must(
        "enable-quotes",
        "An EnableDrive that does not quote the stop in force does not end it (Axle's own).",
        enable_quotes,
    ),
    Clause::must("disable-running", "A drive that is disabled while it runs stops at once.", disable_running),
    Clause::may("disable-cancels", "AllStop cancels an operation in progress.", all_stop_cancels),
    Clause::must("update", "Update brings the new state when it changes.", update),
    Clause::must("update-moving", "From Update it can be told whether the drive is moving.", update_moving),
    Clause::must("silence", "A power that is not renewed ends by itself (Axle's own).", silence),
];

fn get(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let state = client.get().await?;
        let is_finite = state.wheels.both().iter().all(|wheel| wheel.distance.0.is_finite());
        let words = format!("track {} m, full speed {} m/s", state.track.0, state.full_speed.0);
        Ok(expect(is_finite && state.track.0 > 0.0 && state.full_speed.0 > 0.0, &words, || words.clone()))
    })
}

fn enabled_stands(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let before = client.wheels().await?;
        sleep(Duration::from_millis(500)).await;
        let after = client.wheels().await?;
        let moved =
            before.zip(after, |before, after| (after - before).abs()).both().into_iter().fold(0.0, f64::max);
        Ok(expect(moved < 0.005, "it stands", || format!("a wheel moved by {moved} m")))
    })
}

fn all_stop(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.power(0.3, 0.3).await?;
        client.until(SOON, |state| state.motion == Motion::Driving).await?;
        let stopped = client.stop().await?;
        let (state, stands) =
            client.look(SOON, |state| !state.enabled && state.motion == Motion::Standing).await?;
        if !stands {
            return Ok(Finding::Fail(format!("it is {:?} and enabled: {}", state.motion, state.enabled)));
        }
        Ok(expect(state.stop == Some(stopped.stop), format!("stop {}", stopped.stop), || {
            format!("the answer names stop {}, the state {:?}", stopped.stop, state.stop)
        }))
    })
}

fn disabled_faults(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.stop().await?;
        client.until(SOON, |state| !state.enabled && state.motion == Motion::Standing).await?;
        let before = client.wheels().await?;
        let mut taken = Vec::new();
        let mut note = |name, is_taken: bool| {
            if is_taken {
                taken.push(name)
            }
        };
        note("SetDrivePower", client.power(0.3, 0.3).await.is_ok());
        note("SetDriveSpeed", client.speed(0.1, 0.1).await.is_ok());
        note("DriveDistance", client.distance(0.1, 0.3).await.is_ok());
        note("RotateDegrees", client.rotate(20.0, 0.3).await.is_ok());
        sleep(Duration::from_millis(300)).await;
        let after = client.wheels().await?;
        let moved =
            before.zip(after, |before, after| (after - before).abs()).both().into_iter().fold(0.0, f64::max);
        if moved > 0.005 {
            return Ok(Finding::Fail(format!("a wheel moved by {moved} m while the drive was disabled")));
        }
        Ok(expect(taken.is_empty(), "all four are refused", || format!("it took {}", taken.join(", "))))
    })
}

fn enable_again(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.stop().await?;
        let state = client.until(SOON, |state| !state.enabled && state.motion == Motion::Standing).await?;
        client.enable(EnableDrive { enable: true, stop: state.stop }).await?;
        client.until(SOON, |state| state.enabled).await?;
        client.power(0.3, 0.3).await?;
        let (_, drives) = client.look(SOON, |state| state.motion == Motion::Driving).await?;
        client.power(0.0, 0.0).await?;
        Ok(expect(drives, "it moves again", || "enabled, it does not move".into()))
    })
}

fn enable_quotes(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.stop().await?;
        client.until(SOON, |state| !state.enabled).await?;
        let answer = client.enable(EnableDrive { enable: true, stop: None }).await;
        let state = client.get().await?;
        Ok(match answer {
            Err(refusal) if !state.enabled => Finding::Pass(format!("refused: {refusal}")),
            _ if state.enabled => Finding::Fail("an enable that quotes no stop ended the AllStop".into()),
            _ => Finding::Fail("it says that it enabled the drive, and did not".into()),
        })
    })
}

fn disable_running(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.power(0.3, 0.3).await?;
        client.until(SOON, |state| state.motion == Motion::Driving).await?;
        client.enable(EnableDrive { enable: false, stop: None }).await?;
        let (state, stands) =
            client.look(SOON, |state| !state.enabled && state.motion == Motion::Standing).await?;
        Ok(expect(stands, "it stands and is disabled", || {
            format!("{:?}, enabled: {}", state.motion, state.enabled)
        }))
    })
}

fn all_stop_cancels(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let begun = client.distance(0.5, 0.3).await?;
        client.stage(begun.operation, DriveStage::Started, SOON).await;
        client.stop().await?;
        let canceled = client.stage(begun.operation, DriveStage::Canceled, SOON).await;
        let stages = client.stages_of(begun.operation);
        Ok(expect(canceled, "Canceled was said", || format!("only {stages:?} were said")))
    })
}

fn update(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.enable(EnableDrive { enable: false, stop: None }).await?;
        let end = tokio::time::Instant::now() + SOON;
        loop {
            match tokio::time::timeout_at(end, client.updates.next()).await {
                Ok(heard) if !heard.message.enabled => return Ok(Finding::Pass("it came".into())),
                Ok(_) => {}
                Err(_) => {
                    return Ok(Finding::Fail("no Update said within 2 s that the drive was disabled".into()));
                }
            }
        }
    })
}

fn update_moving(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.power(0.3, 0.3).await?;
        let end = tokio::time::Instant::now() + SOON;
        loop {
            match tokio::time::timeout_at(end, client.updates.next()).await {
                Ok(heard) if heard.message.motion == Motion::Driving => {
                    client.power(0.0, 0.0).await?;
                    return Ok(Finding::Pass("driving".into()));
                }
                Ok(_) => {}
                Err(_) => return Ok(Finding::Fail("no Update said within 2 s that the drive moves".into())),
            }
        }
    })
}

fn silence(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.power(0.2, 0.2).await?;
        let began = client.until(SOON, |state| state.motion == Motion::Driving).await?.stamp;
        let longest = axle_schema::differential_drive::MAX_HOLD;
        let (state, stands) = client
            .look(Duration::from_secs_f64(longest + 1.0), |state| state.motion == Motion::Standing)
            .await?;
        if !stands {
            client.power(0.0, 0.0).await?;
            return Err(Refusal::Failed { why: format!("it drives on after {longest} s without a word") });
        }
        let after = Seconds(state.stamp.0 - began.0);
        Ok(Finding::Pass(format!("it stands {after:.1} later")))
    })
}
