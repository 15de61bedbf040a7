//! Processes come and go: in any order, alone or under `axle up`, and nothing is left behind.

mod demo;
mod doctor;
mod planner;
mod topology;
mod tournament;
mod up;

use crate::harness::{Process, Robot, SERVICES, World, all_alive, eventually, is_alive};
use nix::sys::signal::Signal;
use std::collections::BTreeMap;

#[tokio::test(flavor = "multi_thread")]
async fn services_that_start_before_their_router_say_so_and_come_alive_with_it() {
    let world = World::new().await;
    let mut services: BTreeMap<&str, Process> = BTreeMap::new();
    // Against the way of a task: each is there before what it hears.
    for name in SERVICES.into_iter().rev() {
        services.insert(name, world.run(name));
    }
    for service in services.values() {
        service.says(&format!("waiting for a router at {}", world.endpoint)).await;
        service.says("axle router").await;
    }
    let router = world.router();
    let mesh = world.join().await;
    all_alive(&mesh, &SERVICES).await;
    let robot = Robot { router, services, mesh, world };
    robot.knows_where_it_is().await;
    robot.reaches("0.3,0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_router_that_is_replaced_finds_all_services_again() {
    let mut robot = Robot::new().await;
    robot.router.tell(Signal::SIGKILL);
    robot.router.ended().await;
    robot.router = robot.world.router();
    // A new session, since one that was there before could remember what it saw.
    let late = robot.world.join().await;
    let alive = all_alive(&late, &SERVICES).await;
    for (name, service) in &robot.services {
        assert_eq!(alive[*name].pid, service.pid(), "{name} was not restarted");
    }
    robot.reaches("0.3,0").await;
    let ps = robot.world.done(&["ps", "--json"]).await;
    let rows = ps.is(0, &[]).json();
    let rows = rows.as_array().expect("a list");
    assert_eq!(rows.len(), SERVICES.len());
    // The gate may have refused what came late on a loaded machine; nobody else has anything to refuse.
    let is_fine = |row: &serde_json::Value| {
        row["answers"] == true && (row["refused"] == 0 || row["service"] == "emulator")
    };
    assert!(rows.iter().all(is_fine), "{rows:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_service_ends_at_once_when_it_is_told_to() {
    let mut robot = Robot::new().await;
    for (name, service) in &mut robot.services {
        service.tell(if name.len() % 2 == 0 { Signal::SIGTERM } else { Signal::SIGINT });
    }
    for (name, service) in &mut robot.services {
        let ended = service.ended().await;
        assert_eq!(ended.code, Some(0), "{name}: {}", ended.err);
        assert!(!is_alive(service.pid()));
    }
    let mesh = robot.world.join().await;
    let everybody = mesh.everybody(crate::harness::PATIENCE).await.expect("an answer");
    assert_eq!(everybody, [], "nobody is seen any more");
    robot.router.tell(Signal::SIGTERM);
    robot.router.ended().await.is(0, &[]);
    eventually("the router is gone", || (!is_alive(robot.router.pid())).then_some(())).await;
}
