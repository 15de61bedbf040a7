//! SetDrivePower, SetDriveSpeed, DriveDistance, RotateDegrees and ResetEncoders.

use super::clause::{Clause, Finding, Probing, expect};
use super::client::{Client, SOON, duty};
use axle_schema::command::Motion;
use axle_schema::differential_drive::{
    DriveDistance, DriveStage, OperationBegun, SetDrivePower, SetDriveSpeed,
};
use axle_schema::{Metres, MetresPerSecond, Refusal, Sides, TaskId, key};
use std::time::Duration;
use tokio::time::{Instant, sleep};

pub(super) const CLAUSES: &[Clause] = &[
    Clause::must(
        "power-forward",
        "Positive powers turn both wheels forward, negative ones backward.",
        power_signs,
    ),
    Clause::must("power-turn", "Powers of opposite signs turn the robot on the spot.", power_turn),
    Clause::must("power-more", "More power makes the wheels run faster.", power_more),
    Clause::must(
        "power-supersedes",
        "A new power supersedes the one before, without a stop.",
        power_supersedes,
    ),
    Clause::must("power-zero", "A power of zero for both wheels stops the robot.", power_zero),
    Clause::must("power-range", "Powers lie between -1 and 1.", power_range),
    Clause::may("speed", "SetDriveSpeed sets the speed of the wheels in m/s.", speed),
    Clause::may("speed-limit", "A speed that no wheel can have is a fault.", speed_limit),
    Clause::may(
        "distance",
        "DriveDistance drives the distance, and says Started and then Completed.",
        distance,
    ),
    Clause::may("distance-back", "A negative power drives the distance backward.", distance_back),
    Clause::may("distance-answer", "DriveDistance is answered at once, not at its end.", distance_answer),
    Clause::may("distance-negative", "A negative distance is a fault.", distance_negative),
    Clause::may("distance-zero", "A distance of zero completes.", distance_zero),
    Clause::may(
        "rotate-left",
        "RotateDegrees turns left by a positive angle, and says Started and then Completed.",
        rotate_left,
    ),
    Clause::may("rotate-right", "A negative angle turns right.", rotate_right),
    Clause::may(
        "cancel-distance",
        "Another DriveDistance cancels the one in progress, and is driven itself.",
        cancel_distance,
    ),
    Clause::may("cancel-rotate", "A RotateDegrees cancels a DriveDistance in progress.", cancel_rotate),
    Clause::may("cancel-power", "A SetDrivePower cancels a DriveDistance in progress.", cancel_power),
    Clause::may("reset-encoders", "ResetEncoders sets the encoders of both wheels back to zero.", reset),
];

/// How far both wheels went while a power was held for a while.
async fn driven(client: &mut Client, left: f64, right: f64, time: Duration) -> Result<Sides<f64>, Refusal> {
    let before = client.wheels().await?;
    client.power(left, right).await?;
    sleep(time).await;
    let after = client.wheels().await?;
    client.power(0.0, 0.0).await?;
    Ok(before.zip(after, |before, after| after - before))
}

const A_MOMENT: Duration = Duration::from_millis(600);

fn power_signs(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let ahead = driven(client, 0.3, 0.3, A_MOMENT).await?;
        client.settle().await?;
        let back = driven(client, -0.3, -0.3, A_MOMENT).await?;
        let is_so = ahead.both().iter().all(|way| *way > 0.01) && back.both().iter().all(|way| *way < -0.01);
        let words = format!(
            "{:.3} and {:.3} m, then {:.3} and {:.3} m",
            ahead.left, ahead.right, back.left, back.right
        );
        Ok(expect(is_so, &words, || words.clone()))
    })
}

fn power_turn(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let Sides { left, right } = driven(client, -0.2, 0.2, A_MOMENT).await?;
        let is_so = left < -0.01 && right > 0.01 && (left + right).abs() < 0.3 * (right - left);
        Ok(expect(is_so, format!("{left:.3} and {right:.3} m"), || {
            format!("the wheels went {left:.3} and {right:.3} m")
        }))
    })
}

fn power_more(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let less = driven(client, 0.15, 0.15, A_MOMENT).await?;
        client.settle().await?;
        let more = driven(client, 0.45, 0.45, A_MOMENT).await?;
        client.settle().await?;
        driven(client, -0.4, -0.4, A_MOMENT).await?;
        let (less, more) = (less.left + less.right, more.left + more.right);
        let words = format!("{:.3} m with 0.15, {:.3} m with 0.45", less / 2.0, more / 2.0);
        Ok(expect(more > less + 0.01, &words, || words.clone()))
    })
}

fn power_supersedes(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.power(0.2, 0.2).await?;
        client.until(SOON, |state| state.motion == Motion::Driving).await?;
        client.power(0.25, 0.15).await?;
        let mut stood = false;
        for _ in 0..8 {
            stood |= client.get().await?.motion != Motion::Driving;
            sleep(Duration::from_millis(40)).await;
        }
        client.power(0.0, 0.0).await?;
        Ok(expect(!stood, "it went on", || "it braked in between".into()))
    })
}

fn power_zero(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.power(0.3, 0.3).await?;
        client.until(SOON, |state| state.motion == Motion::Driving).await?;
        client.power(0.0, 0.0).await?;
        let (state, stands) = client.look(SOON, |state| state.motion == Motion::Standing).await?;
        Ok(expect(stands && state.enabled, "it stands, and is enabled", || {
            format!("it is {:?}", state.motion)
        }))
    })
}

fn speed(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        client.speed(0.1, 0.2).await?;
        sleep(Duration::from_millis(500)).await;
        let (before, from) = (client.get().await?, Instant::now());
        sleep(Duration::from_millis(300)).await;
        let after = client.get().await?;
        // By the robot's clock where it goes on, so that the way of the answer is no error.
        let stamps = after.stamp.0 - before.stamp.0;
        let time = if stamps > 0.0 { stamps } else { from.elapsed().as_secs_f64() };
        client.power(0.0, 0.0).await?;
        let Sides { left, right } =
            before.wheels.zip(after.wheels, |before, after| (after.distance.0 - before.distance.0) / time);
        let is_so = (left - 0.1).abs() < 0.03 && (right - 0.2).abs() < 0.05;
        let words = format!("{left:.3} and {right:.3} m/s for 0.1 and 0.2 m/s");
        Ok(if is_so { Finding::Pass(words) } else { Finding::Optional(words) })
    })
}

/// A request must be refused; what is taken instead is ended.
async fn is_fault<A>(answer: Result<A, Refusal>, client: &Client, what: &str) -> Result<Finding, Refusal> {
    match answer {
        Err(refusal @ Refusal::Unavailable { .. }) => Err(refusal),
        Err(refusal) => Ok(Finding::Pass(refusal.to_string())),
        Ok(_) => {
            client.power(0.0, 0.0).await?;
            Ok(Finding::Fail(format!("it took {what}")))
        }
    }
}

fn power_range(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let ask = SetDrivePower { left: duty(0.123_456_789), right: duty(0.1), hold: None };
        is_fault(client.odd(&key::DRIVE_POWER, &ask, 0.123_456_789, 2.0).await, client, "a power of 2").await
    })
}

fn speed_limit(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let (fine, right) = (0.123_456_789, MetresPerSecond(0.1));
        let ask = SetDriveSpeed { left: MetresPerSecond(fine), right, hold: None };
        is_fault(client.odd(&key::DRIVE_SPEED, &ask, fine, 1e4).await, client, "a speed of 10000 m/s").await
    })
}

/// Follows an operation to its end; how far both wheels went, or what is wrong with its notifications.
async fn completes(
    client: &mut Client,
    begun: OperationBegun,
    before: Sides<f64>,
    patience: Duration,
) -> Result<Result<Sides<f64>, String>, Refusal> {
    let OperationBegun { operation } = begun;
    if !client.stage(operation, DriveStage::Completed, patience).await {
        let said = client.stages_of(operation);
        client.power(0.0, 0.0).await?;
        return Ok(Err(format!("it was not completed within {patience:?}; it said {said:?}")));
    }
    // What is said after the end would be too much.
    sleep(Duration::from_millis(200)).await;
    client.hear();
    let said = client.stages_of(operation);
    if said != [DriveStage::Started, DriveStage::Completed] {
        return Ok(Err(format!("it said {said:?} instead of Started, Completed")));
    }
    let after = client.wheels().await?;
    Ok(Ok(before.zip(after, |before, after| after - before)))
}

/// Whether both wheels went so far, within 2 cm or a tenth: the contract asks for no accuracy, but a drive whose
/// distances mean nothing offers none.
fn went(wheels: Result<Sides<f64>, String>, left: f64, right: f64) -> Finding {
    let wheels = match wheels {
        Ok(wheels) => wheels,
        Err(words) => return Finding::Fail(words),
    };
    let is_near = |is: f64, due: f64| (is - due).abs() <= 0.02_f64.max(0.1 * due.abs());
    let words = format!("{:.3} and {:.3} m for {left:.3} and {right:.3} m", wheels.left, wheels.right);
    expect(is_near(wheels.left, left) && is_near(wheels.right, right), &words, || words.clone())
}

fn distance(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let before = client.wheels().await?;
        let begun = client.distance(0.3, 0.4).await?;
        let patience = client.time_for(0.3, 0.4);
        Ok(went(completes(client, begun, before, patience).await?, 0.3, 0.3))
    })
}

fn distance_back(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let before = client.wheels().await?;
        let begun = client.distance(0.3, -0.4).await?;
        let patience = client.time_for(0.3, 0.4);
        Ok(went(completes(client, begun, before, patience).await?, -0.3, -0.3))
    })
}

fn distance_answer(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let asked = Instant::now();
        let begun = client.distance(0.3, 0.2).await?;
        let took = asked.elapsed();
        client.hear();
        let is_over = client.position(begun.operation, DriveStage::Completed).is_some();
        client.power(0.0, 0.0).await?;
        let words = format!("after {:.0} ms", took.as_secs_f64() * 1e3);
        Ok(expect(!is_over && took < Duration::from_secs(1), &words, || format!("answered {words}")))
    })
}

fn distance_negative(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let (fine, stage) = (0.123_456_789, DriveStage::InitialRequest);
        let ask =
            DriveDistance { distance: Metres(fine), power: duty(0.3), stage, operation: None, why: None };
        is_fault(client.odd(&key::DRIVE_DISTANCE, &ask, fine, -0.1).await, client, "a distance of -0.1 m")
            .await
    })
}

fn distance_zero(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let before = client.wheels().await?;
        let begun = client.distance(0.0, 0.3).await?;
        let patience = client.time_for(0.0, 0.3);
        Ok(went(completes(client, begun, before, patience).await?, 0.0, 0.0))
    })
}

async fn turn(client: &mut Client, degrees: f64) -> Result<Finding, Refusal> {
    let state = client.get().await?;
    let before = state.wheels.map(|wheel| wheel.distance.0);
    let begun = client.rotate(degrees, 0.3).await?;
    let each = state.track.0 / 2.0 * degrees.to_radians();
    let patience = client.time_for(each, 0.3);
    Ok(went(completes(client, begun, before, patience).await?, -each, each))
}

fn rotate_left(client: &mut Client) -> Probing<'_> {
    Box::pin(turn(client, 90.0))
}

fn rotate_right(client: &mut Client) -> Probing<'_> {
    Box::pin(turn(client, -90.0))
}

/// What the notifications of an operation that another one cancelled must be, and whether the other came too early.
fn canceled(client: &Client, first: TaskId, second: Option<TaskId>) -> Finding {
    let said = client.stages_of(first);
    if said != [DriveStage::Started, DriveStage::Canceled] && said != [DriveStage::Canceled] {
        return Finding::Fail(format!("the cancelled operation said {said:?}"));
    }
    let canceled = client.position(first, DriveStage::Canceled);
    let started = second.and_then(|second| client.position(second, DriveStage::Started));
    Finding::Pass(match (canceled, started) {
        (Some(canceled), Some(started)) if started < canceled => {
            "Started of the new one came before Canceled of the old one, which the contract allows".into()
        }
        _ => "Canceled".into(),
    })
}

fn cancel_distance(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let first = client.distance(0.6, 0.3).await?.operation;
        client.stage(first, DriveStage::Started, SOON).await;
        let second = client.distance(0.2, -0.3).await?.operation;
        let is_done = client.stage(second, DriveStage::Completed, client.time_for(0.5, 0.3)).await;
        client.stage(first, DriveStage::Canceled, SOON).await;
        if !is_done {
            let said = client.stages_of(second);
            return Ok(Finding::Fail(format!("the second one was not completed; it said {said:?}")));
        }
        Ok(canceled(client, first, Some(second)))
    })
}

fn cancel_rotate(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let first = client.distance(0.6, 0.3).await?.operation;
        client.stage(first, DriveStage::Started, SOON).await;
        let second = client.rotate(30.0, 0.3).await?.operation;
        let is_done = client.stage(second, DriveStage::Completed, client.time_for(0.5, 0.3)).await;
        client.stage(first, DriveStage::Canceled, SOON).await;
        if !is_done {
            let said = client.stages_of(second);
            return Ok(Finding::Fail(format!("the turn was not completed; it said {said:?}")));
        }
        // Distances and turns are said on keys of their own: which came first is not known here.
        Ok(canceled(client, first, None))
    })
}

fn cancel_power(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        let first = client.distance(0.6, 0.3).await?.operation;
        client.stage(first, DriveStage::Started, SOON).await;
        client.power(0.1, 0.1).await?;
        client.stage(first, DriveStage::Canceled, SOON).await;
        client.power(0.0, 0.0).await?;
        Ok(canceled(client, first, None))
    })
}

fn reset(client: &mut Client) -> Probing<'_> {
    Box::pin(async {
        driven(client, 0.2, 0.3, A_MOMENT).await?;
        client.settle().await?;
        let before = client.wheels().await?;
        client.reset().await?;
        let (state, is_zero) = client
            .look(SOON, |state| state.wheels.both().iter().all(|wheel| wheel.distance.0.abs() < 0.005))
            .await?;
        let (left, right) = (state.wheels.left.distance.0, state.wheels.right.distance.0);
        if before.both().iter().all(|way| way.abs() < 0.005) {
            return Ok(Finding::Fail("the encoders did not count before".into()));
        }
        Ok(expect(is_zero, "both are zero", || format!("they are {left:.3} and {right:.3} m")))
    })
}
