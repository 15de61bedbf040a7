//! Being seen: who is there, who has gone, and whoever comes late sees it too.

use crate::harness::{Meeting, PATIENCE, World, all_alive, join, within};
use axle_mesh::Comings;
use axle_schema::key::Presence;
use nix::sys::signal::Signal;
use std::time::{Duration, Instant};

async fn until(comings: &mut Comings, what: &str, is_so: impl Fn(&Presence, bool) -> bool) -> Presence {
    let change = async {
        loop {
            let (presence, alive) = comings.next().await;
            if is_so(&presence, alive) {
                return presence;
            }
        }
    };
    within(PATIENCE, what, change).await
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_comes_late_sees_who_is_there() {
    let meeting = Meeting::new().await;
    let early = meeting.join("navigator").await;
    let visible = early.become_visible().expect("visible");
    let late = meeting.join("late").await;
    let mut comings = late.watch_presence().expect("presence");
    let seen = until(&mut comings, "the early one is seen", |presence, alive| {
        alive && presence.service == "navigator"
    })
    .await;
    assert_eq!((seen.boot, seen.pid, &*seen.host), (early.boot(), std::process::id(), "lab"));
    let everybody = late.everybody(PATIENCE).await.expect("an answer");
    let [(presence, Some(status))] = &everybody[..] else { panic!("{everybody:?}") };
    assert_eq!(*presence, seen);
    assert_eq!((status.boot, &*status.service, status.refused), (early.boot(), "navigator", 0));
    drop(visible);
    until(&mut comings, "the early one goes", |presence, alive| !alive && *presence == seen).await;
    assert_eq!(late.everybody(PATIENCE).await.expect("an answer"), []);
}

#[tokio::test(flavor = "multi_thread")]
async fn two_processes_of_one_service_are_two_and_a_strange_host_name_does_no_harm() {
    let meeting = Meeting::new().await;
    let mut meshes = Vec::new();
    for host in ["lab", "lab", "Büro/3 #7*$?"] {
        let settings = axle_mesh::Settings {
            connect: vec![meeting.endpoint.clone()],
            host: host.into(),
            service: "navigator".into(),
            robot: "r1".into(),
            inputs: Vec::new(),
            link: axle_mesh::Link::default(),
        };
        let mesh = axle_mesh::Mesh::join(settings, axle_mesh::Patience::AtMost(PATIENCE), |_, _| {}).await;
        let mesh = mesh.expect("a router");
        let visible = mesh.become_visible().expect("visible");
        meshes.push((mesh, visible));
    }
    let everybody = meeting.join("test").await.everybody(PATIENCE).await.expect("an answer");
    assert_eq!(everybody.len(), 3);
    assert!(everybody.iter().all(|(_, status)| status.is_some()), "{everybody:?}");
    assert!(everybody.iter().any(|(presence, _)| presence.host == "B-ro-3--7---"), "{everybody:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_process_vanishes_at_once_and_a_frozen_one_with_its_lease() {
    let world = World::new().await;
    let _router = world.router();
    let (killed, frozen) = (world.run("pathfinder"), world.run("pathdriver"));
    let mesh = world.join().await;
    all_alive(&mesh, &["pathfinder", "pathdriver"]).await;
    let mut comings = mesh.watch_presence().expect("presence");

    killed.tell(Signal::SIGKILL);
    let begun = Instant::now();
    until(&mut comings, "the killed one goes", |presence, alive| !alive && presence.pid == killed.pid())
        .await;
    assert!(begun.elapsed() < Duration::from_secs(1), "it took {:?}", begun.elapsed());

    frozen.freeze().await;
    let begun = Instant::now();
    until(&mut comings, "the frozen one goes", |presence, alive| !alive && presence.pid == frozen.pid())
        .await;
    // The lease is 1 s; the rest is for a loaded machine.
    assert!(begun.elapsed() < Duration::from_secs(3), "it took {:?}", begun.elapsed());
    frozen.tell(Signal::SIGCONT);
    until(&mut comings, "it comes back by itself", |presence, alive| alive && presence.pid == frozen.pid())
        .await;
    let statuses = join(&world.endpoint, "late").await.everybody(PATIENCE).await.expect("an answer");
    let [(presence, Some(_))] = &statuses[..] else { panic!("{statuses:?}") };
    assert_eq!(presence.pid, frozen.pid());
}
