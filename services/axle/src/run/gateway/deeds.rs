//! What pages ask, done: each question becomes a question to a service, as any client would ask it.

use super::live::Page;
use super::stick::{Answer, Order};
use super::{Gate, Hall, feed, lock};
use crate::path;
use axle_gateway::desk::{Errand, SessionId};
use axle_gateway::words::{Ask, way};
use axle_mesh::{Retry, random_bits};
use axle_schema::calibration::GetCalibration;
use axle_schema::codec::Message;
use axle_schema::command::{AllStop, Class, Done, Enable};
use axle_schema::differential_drive::{
    DriveState, DriveStopped, EnableDrive, GetDrive, OperationBegun, ResetEncoders, StopDrive,
};
use axle_schema::key::Call;
use axle_schema::task::{Accepted, Cancel, GoAsk};
use axle_schema::traffic::Confirm;
use axle_schema::{NavigatorData, Plan, PlanAsk, Refusal, RobotId, Seconds, Sides, StopId, key};
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{Instant, timeout_at};

/// Services have this long to answer.
const PATIENCE: Duration = Duration::from_secs(3);
/// A stop is repeated at this pace until the gate acknowledges it, and for so long at most.
const REPEAT: Duration = Duration::from_millis(50);
const STOPPING: Duration = Duration::from_secs(2);

/// Does what a page asks, and says what came of it.
pub(super) async fn perform(hall: &Arc<Hall>, page: &Page, ask: Ask) -> Result<Value, Refusal> {
    match ask {
        // The connection itself answers these.
        Ask::Hello { .. }
        | Ask::Watch { .. }
        | Ask::Echo { .. }
        | Ask::Hide {}
        | Ask::Release {}
        | Ask::Power { .. }
        | Ask::Speed { .. } => Ok(Value::Null),
        Ask::Go { robot, points, corrector, confirm } => {
            let question = GoAsk { way: way(&points)?, corrector, confirm };
            let Accepted { task } = put(hall, &key::GO, &robot, &question).await?;
            hall.act(hall.desk().begin(page.session, Errand::Task(robot, task)));
            Ok(json!({ "task": task }))
        }
        Ask::Cancel { robot, task } => {
            hall.serves(&robot)?;
            let done: Result<Done, _> = hall
                .mesh
                .ask(&key::GO_CANCEL, Some(&robot), &Cancel { id: task }, PATIENCE, Retry::Idempotent)
                .await;
            done.map(|Done {}| Value::Null)
        }
        Ask::Confirm { robot } => {
            let confirm = Confirm { by: hall.mesh.name() };
            put(hall, &key::CONFIRM, &robot, &confirm).await.map(|Done {}| Value::Null)
        }
        Ask::Plan { robot, points } => plan(hall, &robot, &points).await,
        Ask::Stop { robot } => stop(hall, &robot).await,
        Ask::Enable { robot, stop } => enable(hall, &robot, stop).await,
        Ask::Distance { robot, set } => {
            begun(hall, page, &robot, put(hall, &key::DRIVE_DISTANCE, &robot, &set).await)
        }
        Ask::Rotate { robot, set } => {
            begun(hall, page, &robot, put(hall, &key::DRIVE_ROTATE, &robot, &set).await)
        }
        Ask::Reset { robot } => {
            put(hall, &key::DRIVE_RESET, &robot, &ResetEncoders {}).await.map(|Done {}| Value::Null)
        }
        Ask::EnableDrive { robot, enable, stop } => {
            put(hall, &key::DRIVE_ENABLE, &robot, &EnableDrive { enable, stop })
                .await
                .map(|Done {}| Value::Null)
        }
        Ask::StopDrive { robot } => {
            let stop = StopDrive { by: hall.mesh.name() };
            let DriveStopped { stop } = put(hall, &key::DRIVE_ALL_STOP, &robot, &stop).await?;
            Ok(json!({ "stop": stop }))
        }
        Ask::GetDrive { robot } => {
            let state: DriveState = put(hall, &key::DRIVE_GET, &robot, &GetDrive {}).await?;
            serde_json::to_value(state).map_err(Refusal::internal)
        }
        Ask::Calibration { robot } => {
            let applied = put(hall, &key::CALIBRATION, &robot, &GetCalibration {}).await?;
            serde_json::to_value(applied).map_err(Refusal::internal)
        }
        Ask::Lesson(movement) => serde_json::to_value(movement.lesson()?).map_err(Refusal::internal),
    }
}

/// Asks a service once.
async fn put<Q: Message, A: Message>(
    hall: &Hall,
    call: &Call<Q, A>,
    robot: &RobotId,
    question: &Q,
) -> Result<A, Refusal> {
    hall.serves(robot)?;
    hall.mesh.ask(call, Some(robot), question, PATIENCE, Retry::Never).await
}

fn begun(
    hall: &Arc<Hall>,
    page: &Page,
    robot: &RobotId,
    answer: Result<OperationBegun, Refusal>,
) -> Result<Value, Refusal> {
    let OperationBegun { operation } = answer?;
    hall.act(hall.desk().begin(page.session, Errand::Operation(robot.clone(), operation)));
    Ok(json!({ "operation": operation }))
}

/// Moves the stick, at once: only one page at a time, and nothing that is old.
pub(super) fn steer(
    hall: &Hall,
    session: SessionId,
    robot: &RobotId,
    echo: u64,
    order: Order,
) -> Result<Answer, Refusal> {
    hall.serves(robot)?;
    let asked = match order {
        Order::Power(set) => Sides::new(set.left.get(), set.right.get()),
        Order::Speed(set) => Sides::new(set.left.0, set.right.0),
    };
    #[allow(clippy::cast_precision_loss, reason = "milliseconds of a process that runs for less than an age")]
    let echo = Seconds(echo as f64 / 1e3);
    hall.desk().hold(hall.now(), session, robot, echo, asked)?;
    hall.sticks.give(robot, order)
}

/// What Pathfinder makes of points from where the robot is.
async fn plan(hall: &Hall, robot: &RobotId, points: &[axle_schema::WayPoint]) -> Result<Value, Refusal> {
    hall.serves(robot)?;
    let pose = hall
        .newest(robot, "navigator/pose")
        .and_then(|pose| serde_json::from_value::<NavigatorData>(pose).ok());
    let question = PlanAsk { way: way(points)?, start: pose.map(|data| data.pose), ..PlanAsk::default() };
    // Pathfinder works for every robot; without one of its own the question goes to any.
    let plan: Plan = hall.mesh.ask(&key::PLAN, Some(robot), &question, PATIENCE, Retry::Idempotent).await?;
    Ok(json!({ "path": feed::thinned(&path::of_plan(&plan)), "length": plan.length, "notes": plan.notes }))
}

/// Stops, and waits until the gate acknowledges it.
async fn stop(hall: &Hall, robot: &RobotId) -> Result<Value, Refusal> {
    hall.serves(robot)?;
    let order = AllStop { id: StopId::from_random(random_bits()), by: hall.mesh.name() };
    let began = Instant::now();
    let is_receipt = |gate: &Gate| gate.state.stop == Some(order.id) && !gate.state.enabled;
    while began.elapsed() < STOPPING {
        hall.mesh.put_once(&key::STOP.of(robot), &order)?;
        if let Some(gate) = gate(hall, robot, Instant::now() + REPEAT, is_receipt).await {
            let ms = began.elapsed().as_secs_f64() * 1e3;
            return Ok(json!({ "stop": order.id, "ms": ms, "stored": gate.state.stored }));
        }
    }
    let hint = "it did not acknowledge the stop within 2 s and may still move; is the robot or emulator up?";
    Err(Refusal::unavailable(format!("the gate of {robot}"), hint))
}

/// Enables, if the stop that the page shows is the one in force.
async fn enable(hall: &Hall, robot: &RobotId, stop: Option<StopId>) -> Result<Value, Refusal> {
    hall.serves(robot)?;
    // The gate wants a fresh echo; it speaks once a second at least.
    let asked = hall.now();
    let fresh =
        gate(hall, robot, Instant::now() + STOPPING, |gate| gate.at > asked).await.ok_or_else(|| {
            Refusal::unavailable(
                format!("the gate of {robot}"),
                "it says nothing; is its robot or emulator up?",
            )
        })?;
    let Gate { state, .. } = fresh;
    if state.stop != stop {
        let why = "another stop came meanwhile; look again before you enable".to_owned();
        return Err(Refusal::Disabled { why });
    }
    let question =
        Enable { stop, boot: state.boot, echo: state.tick, by: hall.mesh.name(), class: Class::Manual };
    put(hall, &key::ENABLE, robot, &question).await.map(|Done {}| Value::Null)
}

/// Waits for what the gate of a robot says.
async fn gate(
    hall: &Hall,
    robot: &RobotId,
    until: Instant,
    is_right: impl Fn(&Gate) -> bool,
) -> Option<Gate> {
    let mut news = hall.news.subscribe();
    loop {
        let right = lock(&hall.gates).get(robot).filter(|gate| is_right(gate)).cloned();
        if right.is_some() {
            return right;
        }
        timeout_at(until, news.changed()).await.ok()?.ok()?;
    }
}

/// Ends what a lost page had begun.
pub(super) async fn end(hall: &Hall, errand: Errand) {
    let told = match &errand {
        Errand::Task(robot, task) => {
            tracing::info!(%task, "the page that began the task is lost: cancelled");
            let cancel = Cancel { id: *task };
            let done: Result<Done, _> =
                hall.mesh.ask(&key::GO_CANCEL, Some(robot), &cancel, PATIENCE, Retry::Idempotent).await;
            done.map(drop)
        }
        Errand::Operation(robot, operation) => {
            tracing::info!(%operation, "the page that began the operation is lost: cancelled");
            hall.sticks.rest(robot).await;
            Ok(())
        }
    };
    if let Err(refusal) = told {
        tracing::warn!("what a lost page had begun was not ended: {refusal}");
    }
}
