//! `axle up`: everything starts together, is kept alive, and ends together, however it ends.

use crate::harness::{
    Eyes, PATIENCE, Process, World, all_alive, children, driven, eventually, is_alive, within,
};
use axle_mesh::Mesh;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::time::{Duration, Instant};

/// The services of the shipped topology; the router has no presence.
const KINDS: [&str; 9] = [
    "pathfinder",
    "pathdriver",
    "emulator",
    "source",
    "navigator",
    "d-corrector",
    "pilot",
    "drive",
    "recorder",
];
/// The design allows two seconds to end everything.
const ENDING: Duration = Duration::from_secs(2);
/// What a loaded machine adds to it.
const SLACK: Duration = Duration::from_secs(1);

/// `axle up` with the shipped topology, all alive; its children in the order of their ids.
async fn up(world: &World) -> (Process, Mesh, Vec<u32>) {
    let up = world.axle(&["up", "--listen", &world.endpoint]);
    let mesh = world.join().await;
    all_alive(&mesh, &KINDS).await;
    up.says("all 10 processes are alive").await;
    let pids = children(up.pid());
    assert_eq!(pids.len(), 10, "nine services and the router");
    (up, mesh, pids)
}

async fn are_gone(pids: &[u32], since: Instant) {
    eventually("all processes are gone", || (!pids.iter().any(|pid| is_alive(*pid))).then_some(())).await;
    assert!(since.elapsed() < ENDING + SLACK, "it took {:?}", since.elapsed());
}

#[tokio::test(flavor = "multi_thread")]
async fn ctrl_c_brakes_the_robot_and_leaves_no_process() {
    let world = World::new().await;
    let (mut up, mesh, pids) = up(&world).await;
    let eyes = Eyes::of(&mesh).await;
    let mut go = eyes.under_way(|| world.tool(&["go", "4,0"])).await;
    let begun = Instant::now();
    up.tell(Signal::SIGINT);
    up.ended().await.is(0, &["ending: the robot brakes, then all processes stop"]);
    are_gone(&pids, begun).await;
    // That the robot stands before its process ends cannot be seen from here, since the router ends as well:
    // `drive::faults` has a test of that.
    go.ended().await.is(1, &[]);
    let left: Vec<_> = std::fs::read_dir(world.path()).expect("the directory").flatten().collect();
    let left: Vec<_> = left.iter().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    assert!(!left.iter().any(|name| name.starts_with("axle-")), "written parameters are removed: {left:?}");
    assert!(left.iter().any(|name| name == "recordings"), "the recording stays: {left:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_supervisor_takes_its_children_with_it() {
    let world = World::new().await;
    let (mut up, _mesh, pids) = up(&world).await;
    let begun = Instant::now();
    up.tell(Signal::SIGKILL);
    up.ended().await;
    are_gone(&pids, begun).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_child_is_started_again() {
    let world = World::new().await;
    let (up, mesh, pids) = up(&world).await;
    let mut comings = mesh.watch_presence().expect("presence");
    let alive = all_alive(&mesh, &["navigator"]).await;
    let before = alive["navigator"].pid;
    assert!(pids.contains(&before));
    kill(Pid::from_raw(i32::try_from(before).expect("a pid")), Signal::SIGKILL).expect("killed");
    let again = async {
        loop {
            let (presence, came) = comings.next().await;
            if came && presence.service == "navigator" && presence.pid != before {
                return presence.pid;
            }
        }
    };
    let pid = within(PATIENCE, "the navigator is alive again", again).await;
    assert!(children(up.pid()).contains(&pid));
    up.says("navigator | ended (signal: 9 (SIGKILL)); starts again in 0.2 s").await;
    let others = children(up.pid()).into_iter().filter(|pid| pids.contains(pid)).count();
    assert_eq!(others, 9, "nobody else was restarted");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_emulator_comes_back_and_drives() {
    let world = World::new().await;
    let (_up, mesh, _) = up(&world).await;
    let eyes = Eyes::of(&mesh).await;
    let mut go = eyes.under_way(|| world.tool(&["go", "4,0"])).await;
    let boot = eyes.hears("the gate's account", |_| true).await.boot;
    let alive = all_alive(&mesh, &["emulator"]).await;
    let pid = i32::try_from(alive["emulator"].pid).expect("a pid");
    kill(Pid::from_raw(pid), Signal::SIGKILL).expect("killed");
    go.ended().await.is(1, &["not reached"]);
    let state = eyes.hears("a new robot process", |state| state.boot != boot).await;
    assert_eq!(
        (state.accepted, state.holder),
        (0, None),
        "what was leased of the old one is nothing to the new one"
    );
    // The new robot stands at its start; where it believes to be is the navigator's affair.
    let truth = eyes.sees_rest().await;
    assert!(truth.pose.x.0.abs() < 1e-9, "{truth:?}");
    let poses = mesh.inbox(&axle_schema::key::POSE.of(&crate::harness::r1()), 1).expect("poses");
    let pose = within(PATIENCE, "a pose", poses.next()).await.message.pose;
    let way = format!("{:.3},{:.3}", pose.x.0 + 0.2, pose.y.0);
    driven(|| world.tool(&["go", &way])).await.is(0, &["reached: 1 of 1 way points"]);
}
