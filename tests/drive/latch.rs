//! An AllStop outlives the process that owns the wheels, and comes from anybody, in any size.

use crate::harness::{Robot, Stranger, all_alive, r1, stands};
use axle_schema::command::{GateState, Motion};
use axle_schema::key;
use nix::sys::signal::Signal;

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_outlives_a_crash_of_the_process_that_owns_the_wheels() {
    let mut robot = Robot::new().await;
    let mut go = robot.on_its_way().await;
    let stop = robot.world.done(&["stop", "--json"]).await;
    let receipt = stop.is(0, &[]).json();
    assert_eq!((&receipt["acknowledged"], &receipt["stored"]), (&true.into(), &true.into()));
    go.ended().await.is(1, &["AllStop"]);

    robot.service("emulator").tell(Signal::SIGKILL);
    robot.services.get_mut("emulator").expect("the emulator").ended().await;
    let again = robot.world.run("emulator");
    again.says("is still in force").await;
    robot.services.insert("emulator", again);
    all_alive(&robot.mesh, &["emulator"]).await;
    let eyes = robot.eyes().await;
    let state = eyes.hears("the gate's account", |_| true).await;
    assert_eq!((state.enabled, state.stored, state.motion), (false, true, Motion::Standing));
    assert_eq!(serde_json::to_value(state.stop).expect("a stop"), receipt["stop"]);
    robot.go("1,0").ended().await.is(1, &["not reached: the drive is disabled", "AllStop"]);
    assert!(eyes.truths().iter().all(stands), "nothing moves after a stop");

    robot.world.done(&["enable"]).await.is(0, &["r1 may move"]);
    robot.drives_again().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_that_is_too_large_to_be_read_stops_all_the_same() {
    let robot = Robot::new().await;
    let mut go = robot.on_its_way().await;
    let eyes = robot.eyes().await;
    let stranger = Stranger::join(&robot.world.endpoint).await;
    stranger.say(key::STOP.of(&r1()).as_str(), "", [0; 100_000]);
    let state = eyes.hears("the drive is disabled", |state| !state.enabled).await;
    assert_eq!(state.stop, None, "it has no name");
    go.ended().await.is(1, &["the drive is disabled"]);
    eyes.sees_rest().await;
    robot.world.done(&["enable"]).await.is(0, &["r1 may move"]);
    robot.drives_again().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_of_all_names_each_robot_and_who_did_not_acknowledge() {
    let robot = Robot::new().await;
    // A second robot of which only a part is there: nobody owns its wheels, as far as the mesh knows.
    let lost = robot.world.tool(&["run", "source", "--robot", "r2"]);
    lost.says("is ready").await;
    let stop = robot.world.done(&["stop", "--all", "--json"]).await;
    stop.is(1, &["r2 did not acknowledge"]);
    let lines: Vec<serde_json::Value> =
        stop.out.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let names: Vec<_> =
        lines.iter().map(|line| (line["robot"].clone(), line["acknowledged"].clone())).collect();
    assert_eq!(names, [("r1".into(), true.into()), ("r2".into(), false.into())]);
    let state: GateState = serde_json::from_value(lines[0]["state"].clone()).expect("the gate's state");
    assert!(!state.enabled && state.stored);
}
