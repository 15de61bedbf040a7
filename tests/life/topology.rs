//! Topologies: what they say is wired is wired, also from elsewhere and over two computers.

use crate::harness::{PATIENCE, World, all_alive, driven, free_endpoint, join, r1, within};
use axle_schema::key;
use serde_json::Value;
use std::collections::BTreeSet;
use std::time::Duration;

const TWO: &str = include_str!("../../deploy/topologies/two-computers.toml");

/// The streams of `axle graph --json`: from, to, key.
fn streams(lines: &str) -> BTreeSet<(String, String, String)> {
    let text = |value: &Value| value.as_str().expect("a text").to_owned();
    lines
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).expect("JSON"))
        .filter(|wire| wire["kind"] == "stream")
        .map(|wire| (text(&wire["from"]), text(&wire["to"]), text(&wire["key"])))
        .collect()
}

/// What the services of a mesh really say to each other, by their own account; the recorder hears everything.
async fn declared_streams(mesh: &axle_mesh::Mesh) -> BTreeSet<(String, String, String)> {
    let everybody = mesh.everybody(Duration::from_secs(5)).await.expect("an answer");
    let statuses: Vec<_> = everybody.into_iter().filter_map(|(_, status)| status).collect();
    let mut wires = BTreeSet::new();
    for (from, says) in statuses.iter().flat_map(|status| status.says.iter().map(move |key| (status, key))) {
        for to in statuses.iter().filter(|to| to.service != "recorder" && to.hears.contains(says)) {
            let place = key::place(says).expect("a key");
            wires.insert((
                from.service.clone(),
                to.service.clone(),
                format!("{}/{}", place.service, place.name),
            ));
        }
    }
    wires
}

#[tokio::test(flavor = "multi_thread")]
async fn the_graph_shows_what_services_declare_and_nothing_else() {
    for name in ["demo", "composed"] {
        let world = World::new().await;
        let file = format!("{}/../../deploy/topologies/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let up = world.axle(&["up", &file, "--listen", &world.endpoint]);
        up.says("processes are alive").await;
        let mesh = world.join().await;
        let graph = world.done(&["graph", &file, "--json", "--live"]).await;
        let drawn = streams(&graph.is(0, &[]).out);
        // The drive says a stop only when it is told to, and then by no publisher of its own.
        let drawn: BTreeSet<_> = drawn.into_iter().filter(|(_, _, key)| key != "gate/stop").collect();
        assert_eq!(drawn, declared_streams(&mesh).await, "{name}");
        // Poses flow all the time; orders only with a task.
        let pulse = |line: &str, key: &str| line.contains(key) && line.contains("\"pulse\":\"alive\"");
        assert!(graph.out.lines().any(|line| pulse(line, "navigator/pose")), "{}", graph.out);
        let silent = graph.out.lines().filter(|line| line.contains("\"pulse\":\"silent\""));
        assert!(silent.clone().any(|line| line.contains("d-corrector/task")), "{}", graph.out);
        let svg = world.done(&["graph", &file, "--svg", "graph.svg"]).await;
        svg.is(0, &["drawn in graph.svg"]);
        let picture = std::fs::read_to_string(world.path().join("graph.svg")).expect("a picture");
        assert!(picture.contains("<svg") && picture.contains("navigator of r1"));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pose_can_come_from_elsewhere() {
    let world = World::new().await;
    let file = include_str!("../../deploy/topologies/demo.toml");
    let elsewhere = "inputs = { \"navigator/pose\" = \"emulator/truth\" }";
    let kind = "kind = \"pilot\"\n";
    let file = world.file("truth.toml", &file.replace(kind, &format!("{kind}{elsewhere}\n")));
    world.axle(&["check", &file]).ended().await.is(0, &["all is there"]);
    let up = world.axle(&["up", &file, "--listen", &world.endpoint]);
    up.says("processes are alive").await;
    let mesh = world.join().await;
    let wires = declared_streams(&mesh).await;
    let wired = |from: &str, key: &str| wires.contains(&(from.into(), "pilot".into(), key.into()));
    assert!(wired("emulator", "emulator/truth") && !wired("navigator", "navigator/pose"), "{wires:?}");
    driven(|| world.tool(&["go", "0.3,0"])).await.is(0, &["reached: 1 of 1 way points"]);
}

/// Waits until poses pass from the one computer to the other.
async fn knows_where_the_robot_is(mesh: &axle_mesh::Mesh) {
    let poses = mesh.inbox(&key::POSE.of(&r1()), 1).expect("poses");
    within(PATIENCE, "a pose from the other computer", poses.next()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_on_two_computers_drives_and_stops_when_the_link_between_them_is_lost() {
    let world = World::new().await;
    let onboard = free_endpoint();
    let text = TWO.replace("tcp/127.0.0.1:7447", &world.endpoint).replace("tcp/127.0.0.1:7448", &onboard);
    let file = world.file("two.toml", &text);
    world.axle(&["check", &file]).ended().await.is(0, &["2 computers", "all is there"]);
    // The robot comes first, and waits for the workstation.
    let robot = world.axle(&["up", &file, "--host", "onboard"]);
    robot.says("processes are alive").await;
    let workstation = world.axle(&["up", &file, "--host", "workstation"]);
    workstation.says("processes are alive").await;
    let mesh = world.join().await;
    let alive = all_alive(&mesh, &["pilot", "pathfinder", "d-corrector", "emulator"]).await;
    assert_eq!((&*alive["pilot"].host, &*alive["emulator"].host), ("workstation", "onboard"));
    knows_where_the_robot_is(&mesh).await;
    driven(|| world.tool(&["go", "0.3,0"])).await.is(0, &["reached: 1 of 1 way points"]);

    // A driver at the workstation is cut off: its router dies. The robot's own computer sees the wheels stop.
    let near = join(&onboard, "test").await;
    let eyes = crate::harness::Eyes::of(&near).await;
    let holding = world.tool(&["drive", "power", "0.3", "0.3", "--for", "30"]);
    eyes.sees_speed(0.15).await;
    drop(workstation);
    eyes.sees_rest().await;
    drop(holding);
    let again = world.axle(&["up", &file, "--host", "workstation"]);
    again.says("processes are alive").await;
    knows_where_the_robot_is(&world.join().await).await;
    driven(|| world.tool(&["go", "0,0"])).await.is(0, &["reached: 1 of 1 way points"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_topology_that_lacks_something_is_refused_by_check_and_told_by_up() {
    let world = World::new().await;
    let text = format!(
        "[hosts.local]\nrouter = \"{}\"\n[[services]]\nkind = \"navigator\"\nrobot = \"r1\"\n",
        world.endpoint
    );
    let file = world.file("half.toml", &text);
    let checked = world.axle(&["check", &file]).ended().await;
    checked.is(1, &["2 of its wires are wrong or missing"]);
    assert!(checked.out.contains("navigator of r1 needs source/recent, which nobody says; add source"));
    let up = world.axle(&["up", &file]);
    up.says("navigator of r1 needs source/recent").await;
    up.says("processes are alive").await;
    let stop = "[hosts.local]\nrouter = \"tcp/127.0.0.1:1\"\n[[services]]\nkind = \"emulator\"\nrobot = \"r1\"\n\
                inputs = { \"gate/stop\" = \"gate/command\" }\n";
    let file = world.file("deaf.toml", stop);
    world.axle(&["check", &file]).ended().await.is(2, &["it stops the wheels"]);
}
