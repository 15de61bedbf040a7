//! Logs: on the mesh, as JSON, and more or less of them while a service runs.

use crate::harness::{PATIENCE, World, all_alive, declared, eventually, within};
use axle_schema::key;
use axle_schema::log::LogLevel;
use serde_json::Value;

#[tokio::test(flavor = "multi_thread")]
async fn a_level_is_changed_while_a_service_runs_and_its_lines_travel_the_mesh() {
    let world = World::new().await;
    let _router = world.router();
    let pathfinder = world.run("pathfinder");
    let mesh = world.join().await;
    all_alive(&mesh, &["pathfinder"]).await;
    let lines = mesh.inbox(&key::every_log(None), 64).expect("logs");
    declared(&mesh).await;
    world.done(&["log", "pathfinder", "debug"]).await.is(0, &["pathfinder of all", "logs at debug"]);
    let line = within(PATIENCE, "a line", lines.next()).await;
    assert_eq!((line.message.level, &*line.message.text), (LogLevel::Info, "logs at debug from now on"));
    pathfinder.says("logs at debug from now on").await;
    let tap = world.tool(&["tap", "axle/*/*/log", "--count", "1", "--json"]);
    // What is tapped is what is said while the tap listens.
    let tapped = async {
        loop {
            world.done(&["log", "pathfinder", "info"]).await.is(0, &["logs at info"]);
            if let Some(line) = tap.out().lines().next() {
                return line.to_owned();
            }
        }
    };
    let tapped: Value = serde_json::from_str(&within(PATIENCE, "a tapped line", tapped).await).expect("JSON");
    assert_eq!((&tapped["type"], &tapped["value"]["level"]), (&"axle.LogLine.v1".into(), &"info".into()));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_level_and_an_unknown_service_are_refused() {
    let world = World::new().await;
    let _router = world.router();
    let _pathfinder = world.run("pathfinder");
    let mesh = world.join().await;
    all_alive(&mesh, &["pathfinder"]).await;
    world.done(&["log", "pathfinder", "loud"]).await.is(1, &["unknown level \"loud\"", "debug, trace"]);
    world.done(&["log", "parrot", "info"]).await.is(2, &["unknown service \"parrot\""]);
    world.done(&["log", "navigator", "info"]).await.is(1, &["no navigator of r1 is alive"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn json_lines_name_service_robot_and_task() {
    let world = World::new().await;
    let _router = world.router();
    let corrector = world.tool(&["run", "d-corrector", "--host", "lab", "--log-format", "json"]);
    let mesh = world.join().await;
    all_alive(&mesh, &["d-corrector"]).await;
    let robot = crate::harness::r1();
    let orders = mesh.publisher(&key::corrector_task("d-corrector").of(&robot)).expect("orders");
    declared(&mesh).await;
    // Without a gate it fails, and says so with the task.
    let plan = axle_schema::Drive::default();
    let task = axle_schema::Task { id: axle_schema::TaskId(77), plan };
    let failed = eventually("the corrector says that the task failed", || {
        drop(orders.put(&task, None));
        let said = corrector.err();
        let line = said.lines().find(|line| line.contains("task failed"))?;
        Some(serde_json::from_str::<Value>(line).expect("a line of JSON"))
    })
    .await;
    assert_eq!((&failed["service"], &failed["robot"]), (&"d-corrector".into(), &"r1".into()), "{failed}");
    assert_eq!((&failed["span"], &failed["fields"]["task"]), (&"beat".into(), &"4d".into()), "{failed}");
    assert_eq!(failed["level"], "warn");
    for line in corrector.err().lines() {
        assert!(serde_json::from_str::<Value>(line).is_ok(), "{line}");
    }
}
