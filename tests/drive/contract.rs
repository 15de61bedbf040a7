//! The Generic Differential Drive contract through real processes: a router, an emulated robot, the drive, its clients.

use crate::harness::{Ended, Eyes, PATIENCE, Process, World, all_alive, declared, r1, stands, within};
use axle_mesh::{Inbox, Mesh, Retry};
use axle_schema::codec::Message;
use axle_schema::command::{Done, Motion};
use axle_schema::differential_drive::{
    DriveDistance, DriveOperation, DriveStage, DriveState, DriveStopped, EnableDrive, GetDrive,
    OperationBegun, ResetEncoders, SetDrivePower, StopDrive,
};
use axle_schema::key::Call;
use axle_schema::{Duty, Metres, Pose, Refusal, Seconds, TaskId, key};
use nix::sys::signal::Signal;

/// A robot with a drive, and everything that the drive says.
pub(super) struct Contract {
    pub(super) world: World,
    pub(super) mesh: Mesh,
    pub(super) eyes: Eyes,
    stages: Inbox<DriveDistance>,
    updates: Inbox<DriveState>,
    drive: Process,
    _others: [Process; 2],
}

impl Contract {
    pub(super) async fn new() -> Self {
        let world = World::new().await;
        let others = [world.router(), world.run("emulator")];
        let drive = world.run("drive");
        let mesh = world.join().await;
        let stages = mesh.inbox(&key::DRIVE_DISTANCE_STAGE.of(&r1()), 256).expect("stages");
        let updates = mesh.inbox(&key::DRIVE_UPDATE.of(&r1()), 4096).expect("updates");
        all_alive(&mesh, &["emulator", "drive"]).await;
        let eyes = Eyes::of(&mesh).await;
        let contract = Self { world, mesh, eyes, stages, updates, drive, _others: others };
        contract.hears("the drive is enabled", |state| state.enabled).await;
        contract
    }
    async fn ask<Q: Message, A: Message>(&self, call: &Call<Q, A>, question: &Q) -> Result<A, Refusal> {
        self.mesh.ask(call, Some(&r1()), question, PATIENCE, Retry::Never).await
    }
    async fn state(&self) -> DriveState {
        self.ask(&key::DRIVE_GET, &GetDrive {}).await.expect("the state")
    }
    /// The next update of which this holds.
    pub(super) async fn hears(&self, what: &str, is_so: impl Fn(&DriveState) -> bool) -> DriveState {
        let heard = async {
            loop {
                let state = self.updates.next().await.message;
                if is_so(&state) {
                    return state;
                }
            }
        };
        within(PATIENCE, what, heard).await
    }
    /// Begins a distance.
    async fn begins(&self, distance: f64, power: f64) -> TaskId {
        let OperationBegun { operation } =
            self.ask(&key::DRIVE_DISTANCE, &request(distance, power)).await.expect("an operation");
        operation
    }
    /// The next notification.
    async fn stage(&self) -> (TaskId, DriveStage, Option<Refusal>) {
        let heard = within(PATIENCE, "a notification", self.stages.next()).await.message;
        (heard.operation.expect("it is named"), heard.stage, heard.why)
    }
    /// `axle drive …`.
    fn tool(&self, args: &[&str]) -> Process {
        self.world.tool(&[&["drive"], args].concat())
    }
    async fn done(&self, args: &[&str]) -> Ended {
        self.tool(args).ended().await
    }
    /// Runs an operation to its end, once more or twice if the machine was too busy; where the robot stood before.
    async fn operates(&self, args: &[&str]) -> (Pose, Ended) {
        for _ in 0..3 {
            let before = self.eyes.sees_rest().await.pose;
            let ended = self.done(args).await;
            if !ended.was_late() {
                return (before, ended);
            }
        }
        panic!("this machine is too busy for a robot to drive")
    }
}

fn request(distance: f64, power: f64) -> DriveDistance {
    let (distance, power, stage) = (Metres(distance), duty(power), DriveStage::InitialRequest);
    DriveDistance { distance, power, stage, operation: None, why: None }
}

fn duty(power: f64) -> Duty {
    Duty::new(power).expect("within full power")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_distance_and_a_turn_end_where_they_should_by_the_truth() {
    let contract = Contract::new().await;
    let (before, ended) = contract.operates(&["distance", "0.6", "--power", "0.5", "--json"]).await;
    let report = ended.is(0, &["completed: 0.6", "of 0.600 m"]).json();
    assert_eq!((&report["completed"], &report["state"]["operation"]), (&true.into(), &"idle".into()));
    let after = contract.eyes.sees_rest().await.pose;
    assert!((before.distance(after).0 - 0.6).abs() < 0.01, "{before:?} to {after:?}");

    let (before, ended) = contract.operates(&["rotate", "-90", "--power", "0.3"]).await;
    ended.is(0, &["completed"]);
    let after = contract.eyes.sees_rest().await.pose;
    let turned = (after.heading - before.heading).0.to_degrees();
    assert!((turned + 90.0).abs() < 1.0, "{turned} degrees");

    let (before, ended) = contract.operates(&["distance", "0.2", "--power", "-0.4"]).await;
    ended.is(0, &["completed"]);
    let after = contract.eyes.sees_rest().await.pose;
    assert!(
        (before.distance(after).0 - 0.2).abs() < 0.01 && after.y.0 > before.y.0,
        "{before:?} to {after:?}"
    );
    let is_over =
        |state: &DriveState| state.operation == DriveOperation::Idle && state.motion == Motion::Standing;
    contract.hears("the drive has nothing to do", is_over).await;
    contract
        .eyes
        .hears("the wheels were given back", |state| state.epoch > 0 && state.holder.is_none())
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_of_another_client_cancels_the_operation_before_it_starts_itself() {
    let contract = Contract::new().await;
    let mut first = contract.tool(&["distance", "5", "--power", "0.5"]);
    contract.eyes.sees_speed(0.2).await;
    let (running, stage, _) = contract.stage().await;
    assert_eq!(stage, DriveStage::Started);
    let second = contract.begins(0.1, 0.3).await;
    assert_eq!(contract.stage().await, (running, DriveStage::Canceled, None));
    let (id, stage, _) = contract.stage().await;
    assert_eq!((id, stage), (second, DriveStage::Started));
    first.ended().await.is(1, &["cancelled by another request"]);
    let (id, stage, _) = contract.stage().await;
    assert!(
        id == second && matches!(stage, DriveStage::Completed | DriveStage::Canceled),
        "it ends: {stage:?}"
    );
    contract.eyes.sees_rest().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_all_stop_in_mid_operation_latches_until_an_enable_quotes_it() {
    let contract = Contract::new().await;
    let mut client = contract.tool(&["distance", "5", "--power", "0.5"]);
    contract.eyes.sees_speed(0.2).await;
    let stopped = contract.ask(&key::DRIVE_ALL_STOP, &StopDrive { by: "a test".into() }).await;
    let DriveStopped { stop } = stopped.expect("it was acknowledged");
    client.ended().await.is(1, &["cancelled: the drive is disabled", "AllStop"]);
    contract.eyes.sees_rest().await;
    let state = contract.state().await;
    assert!(!state.enabled && state.stop == Some(stop), "{state:?}");

    contract.done(&["power", "0.3", "0.3"]).await.is(1, &["the drive is disabled", "AllStop"]);
    contract.done(&["distance", "0.1"]).await.is(1, &["the drive is disabled"]);
    let bare = contract.ask(&key::DRIVE_ENABLE, &EnableDrive { enable: true, stop: None }).await;
    let refusal = bare.expect_err("the stop is not quoted").to_string();
    assert!(refusal.contains(&format!("AllStop {stop}")), "{refusal}");
    assert!(contract.eyes.truths().iter().rev().take(5).all(stands), "nothing moves");

    contract.done(&["enable"]).await.is(0, &["r1 may move"]);
    let (_, ended) = contract.operates(&["distance", "0.1"]).await;
    ended.is(0, &["completed"]);
    contract.done(&["disable"]).await.is(0, &["r1 is stopped and disabled"]);
    contract.done(&["rotate", "-10"]).await.is(1, &["the drive is disabled"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn powers_of_a_client_that_dies_run_out() {
    let contract = Contract::new().await;
    let mut client = contract.tool(&["power", "0.4", "0.4", "--for", "60"]);
    contract.eyes.sees_speed(0.25).await;
    client.tell(Signal::SIGKILL);
    let killed = contract.eyes.sees("a moment", |_| true).await.stamp;
    client.ended().await;
    let rest = contract.eyes.sees("the robot stands", stands).await;
    // The client's hold of 0.5 s, 0.32 m/s braked with 2 m/s², and a machine that does other things too.
    let took = rest.stamp - killed;
    assert!(took < Seconds(0.5 + 0.16 + 0.6), "it stood {took} after its client died");
    contract.hears("the wheels are free", |state| state.operation == DriveOperation::Idle).await;
    let hold = contract.done(&["speed", "0.2", "-0.2", "--for", "0.5"]).await;
    hold.is(0, &["the wheels brake"]);
    contract.eyes.sees_rest().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drive_that_is_killed_leaves_a_robot_that_brakes() {
    let contract = Contract::new().await;
    let _client = contract.tool(&["distance", "5", "--power", "0.5"]);
    contract.eyes.sees_speed(0.2).await;
    contract.drive.tell(Signal::SIGKILL);
    let killed = contract.eyes.sees("a moment", |_| true).await.stamp;
    let rest = contract.eyes.sees("the robot stands", stands).await;
    let took = rest.stamp - killed;
    assert!(took < Seconds(0.17 + 0.2 + 0.6), "it stood {took} after its drive died");
}

#[tokio::test(flavor = "multi_thread")]
async fn ctrl_c_cancels_and_the_robot_stands() {
    let contract = Contract::new().await;
    let mut client = contract.tool(&["rotate", "3600", "--power", "0.5"]);
    contract.hears("it turns", |state| state.wheels.right.speed.0 > 0.2).await;
    client.tell(Signal::SIGINT);
    client.ended().await.is(1, &["cancelling", "cancelled by another request"]);
    contract.eyes.sees_rest().await;
    assert!(contract.state().await.enabled, "a cancellation is no stop");
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_that_make_no_sense_are_refused_and_move_nothing() {
    let contract = Contract::new().await;
    let far = contract.ask(&key::DRIVE_DISTANCE, &request(1.0, 0.0)).await.expect_err("it never arrives");
    assert!(far.to_string().contains("power"), "{far}");
    let staged = DriveDistance { stage: DriveStage::Started, ..request(1.0, 0.5) };
    let staged = contract.ask(&key::DRIVE_DISTANCE, &staged).await.expect_err("no request");
    assert!(staged.to_string().contains("initial_request"), "{staged}");
    contract.done(&["distance", "-1"]).await.is(1, &["a negative power drives backward"]);
    contract.done(&["speed", "3", "0"]).await.is(1, &["left speed in m/s"]);
    contract.done(&["power", "2", "0"]).await.is(2, &["-1 to 1"]);
    contract.done(&["power", "0", "0"]).await.is(0, &[]);
    let Done {} = contract.ask(&key::DRIVE_POWER, &SetDrivePower::default()).await.expect("at rest it is");
    assert!(contract.eyes.truths().iter().all(stands));
    let accepted = contract.eyes.states.latest().map_or(0, |heard| heard.message.accepted);
    assert_eq!(accepted, 0, "no command was sent");
}

#[tokio::test(flavor = "multi_thread")]
async fn its_state_is_shown_watched_and_reset() {
    let contract = Contract::new().await;
    let mut watch = contract.tool(&["watch", "--json"]);
    watch_says(&watch, "update").await;
    let (_, ended) = contract.operates(&["distance", "0.1"]).await;
    ended.is(0, &["completed"]);
    watch_says(&watch, "\"stage\":\"completed\"").await;
    watch.tell(Signal::SIGINT);
    let ended = watch.ended().await;
    let lines: Vec<serde_json::Value> =
        ended.is(0, &[]).out.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let stages: Vec<_> = lines.iter().filter_map(|line| line["distance"]["stage"].as_str()).collect();
    assert!(stages.starts_with(&["started"]) && stages.contains(&"completed"), "{stages:?}");
    assert!(lines.iter().any(|line| line["update"]["operation"] == "distance"));

    let before = contract.done(&["state", "--json"]).await.is(0, &[]).json();
    assert!(before["wheels"]["left"]["distance"].as_f64().expect("a number") > 0.09, "{before}");
    let Done {} = contract.ask(&key::DRIVE_RESET, &ResetEncoders {}).await.expect("a reset");
    let after = contract.done(&["state"]).await;
    assert!(
        after.is(0, &[]).out.contains("0.0000") && after.out.contains("enabled; idle; the wheels are"),
        "{after:?}"
    );
    contract.done(&["reset"]).await.is(0, &["at zero"]);
    declared(&contract.mesh).await;
}

async fn watch_says(watch: &Process, words: &str) {
    crate::harness::eventually("axle drive watch prints", || watch.out().contains(words).then_some(())).await;
}
