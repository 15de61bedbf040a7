//! Who may drive, and how that ends: by the end of the way, by a person, by a newer task, by an AllStop.

use super::FAR;
use crate::harness::{PATIENCE, Robot, all_alive, declared, r1, stands, within};
use axle_mesh::Retry;
use axle_schema::command::{Class, GateState, Lease, LeaseAsk, Motion};
use axle_schema::{Refusal, Seconds, key};
use nix::sys::signal::Signal;

#[tokio::test(flavor = "multi_thread")]
async fn ctrl_c_cancels_a_task_and_the_robot_stands() {
    let robot = Robot::new().await;
    let mut go = robot.on_its_way().await;
    let eyes = robot.eyes().await;
    go.tell(Signal::SIGINT);
    go.ended().await.is(1, &["cancelled: 0 of 1 way points"]);
    eyes.sees_rest().await;
    let state = eyes.hears("the lease was given back", |state| state.holder.is_none()).await;
    assert!(state.enabled, "a cancellation is no stop: {state:?}");
    robot.drives_again().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_all_stop_latches_until_it_is_ended_by_name() {
    let robot = Robot::new().await;
    let mut go = robot.on_its_way().await;
    let eyes = robot.eyes().await;
    let stop = robot.world.done(&["stop", "--json"]).await;
    let receipt = stop.is(0, &[]).json();
    assert_eq!(receipt["acknowledged"], true);
    let state: GateState = serde_json::from_value(receipt["state"].clone()).expect("the gate's state");
    assert!(!state.enabled && state.stop.is_some() && state.holder.is_none(), "{state:?}");
    go.ended().await.is(1, &["the drive is disabled", "AllStop", "axle enable"]);
    eyes.sees_rest().await;

    robot.go(FAR).ended().await.is(1, &["not reached: the drive is disabled", "AllStop", "axle enable"]);
    assert!(eyes.truths().iter().all(stands), "nothing moves after a stop");
    robot.world.done(&["enable"]).await.is(0, &["r1 may move"]);
    let before = eyes.sees("the robot", |_| true).await;
    assert!(stands(&before), "an enable moves nothing by itself");
    robot.drives_again().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_newer_task_replaces_the_running_one() {
    let robot = Robot::new().await;
    let mut first = robot.on_its_way().await;
    let mut second = robot.go("0,0");
    first.ended().await.is(1, &["replaced by a newer task"]);
    let second = second.ended().await;
    if second.was_late() {
        robot.reaches("0,0").await;
    } else {
        second.is(0, &["reached: 1 of 1 way points"]);
    }
    let eyes = robot.eyes().await;
    let truth = eyes.sees_rest().await;
    assert!(truth.pose.x.0.hypot(truth.pose.y.0) < 0.05, "it stands where the second one ends: {truth:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_of_the_same_class_takes_the_wheels_and_the_holder_is_named() {
    let robot = Robot::new().await;
    let states = robot.mesh.inbox(&key::GATE_STATE.of(&r1()), 64).expect("states");
    declared(&robot.mesh).await;
    let holder = format!("d-corrector@lab/{}", robot.service("d-corrector").pid());
    let mut go = robot.eyes().await.under_way(|| robot.go("1.2,0")).await;
    for class in [Class::Corrector, Class::Background] {
        let ask = LeaseAsk { holder: "stranger@lab/1".into(), class, period: Seconds(0.05) };
        let granted =
            robot.mesh.ask::<_, Lease>(&key::LEASE, Some(&r1()), &ask, PATIENCE, Retry::Never).await;
        assert_eq!(granted, Err(Refusal::Busy { holder: holder.clone() }));
    }
    let ended = go.ended().await;
    if !ended.was_late() {
        ended.is(0, &["reached: 1 of 1 way points"]);
    }
    let holders: Vec<_> =
        std::iter::from_fn(|| states.take()).filter_map(|heard| heard.message.holder).collect();
    assert!(!holders.is_empty() && holders.iter().all(|name| *name == holder), "{holders:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn of_two_processes_of_one_corrector_one_has_the_wheels_and_the_task_says_who() {
    let robot = Robot::new().await;
    let second = robot.world.run("d-corrector");
    let mut comings = robot.mesh.watch_presence().expect("presence");
    let came = async { while comings.next().await.0.pid != second.pid() {} };
    within(PATIENCE, "the second corrector is alive", came).await;
    let eyes = robot.eyes().await;
    // Both hear the order and both ask for the wheels: that is a mistake of who started them, and it is said.
    robot.go(FAR).ended().await.is(1, &["not reached: busy: d-corrector@lab/", " has it"]);
    eyes.sees_rest().await;
    let states: Vec<_> = std::iter::from_fn(|| eyes.states.take()).map(|heard| heard.message).collect();
    let mut epochs: Vec<_> = states.iter().map(|state| (state.epoch, state.holder.clone())).collect();
    epochs.retain(|(_, holder)| holder.is_some());
    epochs.dedup();
    assert!(epochs.len() <= 1, "one grant, one holder: {epochs:?}");
    drop(second);
    all_alive(&robot.mesh, &["d-corrector"]).await;
    let idle = eyes.hears("the wheels are free", |state| state.holder.is_none()).await;
    assert_eq!(idle.motion, Motion::Standing);
    robot.drives_again().await;
}
