//! `axle doctor`: what it finds between the services of a topology.

use super::{Keys, demo};
use crate::harness::{Eyes, PATIENCE, Process, Stranger, World, all_alive, free_endpoint, r1, within};
use axle_schema::key;
use nix::sys::signal::Signal;
use serde_json::Value;

/// The findings of `axle doctor --json`.
fn findings(ended: &crate::harness::Ended) -> Vec<Value> {
    ended.out.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

/// The verdicts on whatever these words are about.
fn verdicts(found: &[Value], about: &str) -> Vec<String> {
    let text = |value: &Value| value.as_str().expect("a text").to_owned();
    let own = found.iter().filter(|finding| text(&finding["about"]).contains(about));
    own.map(|finding| text(&finding["verdict"])).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_doctor_names_what_is_missing_silent_or_unreadable_and_what_to_do() {
    let world = World::new().await;
    let topology = world.file("topology.toml", &demo(&world));
    let doctor = async || world.done(&["doctor", "--topology", &topology, "--json"]).await;
    doctor().await.is(1, &["unreachable: nothing listens at"]);

    let _router = world.router();
    let kinds =
        ["pathfinder", "pathdriver", "emulator", "source", "d-corrector", "pilot", "drive", "recorder"];
    let services: Vec<Process> = kinds.iter().map(|kind| world.run(kind)).collect();
    let navigator = world.run("navigator");
    let mesh = world.join().await;
    all_alive(&mesh, &kinds).await;
    Eyes::of(&mesh).await.hears("the gate's account", |_| true).await;
    let poses = mesh.inbox(&key::POSE.of(&r1()), 1).expect("poses");
    within(PATIENCE, "a pose", poses.next()).await;
    let ended = doctor().await;
    let found = findings(ended.is(0, &["are well"]));
    assert_eq!(verdicts(&found, "navigator/pose"), ["flows"; 2], "the pilot and the corrector hear poses");
    assert_eq!(verdicts(&found, "asks gate/lease"), ["answers"; 2]);
    assert_eq!(verdicts(&found, "says d-corrector/task"), ["at rest"]);
    assert_eq!(verdicts(&found, "clock of lab"), ["clock"]);

    // A stream of another type: the one who listens says what it cannot read.
    let stranger = Stranger::join(&world.endpoint).await;
    let flood = async {
        loop {
            stranger.say(key::POSE.of(&r1()).as_str(), "application/cbor;axle.Pose.v9", "x");
            tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        }
    };
    let ended = tokio::select! {
        ended = doctor() => ended,
        () = flood => unreachable!("a flood without an end"),
    };
    ended.is(1, &["schema differs", "cannot read what comes on"]);

    // One that hangs, and one that is gone.
    services[3].freeze().await;
    let ended = doctor().await;
    let found = findings(ended.is(1, &["source of r1"]));
    let verdict = verdicts(&found, "source/recent");
    assert!(verdict.iter().all(|word| word == "silent" || word == "nobody says it"), "{verdict:?}");
    services[3].tell(Signal::SIGCONT);
    drop(navigator);
    let ended = doctor().await;
    let found =
        findings(ended.is(1, &["start it on local with `axle run navigator --robot r1 --host local`"]));
    assert_eq!(verdicts(&found, "says navigator/pose"), ["nobody says it"; 2]);
    assert!(verdicts(&found, "says source/recent to navigator").iter().all(|word| word == "nobody listens"));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_doctor_finds_routers_that_do_not_link() {
    let world = World::new().await;
    let onboard = free_endpoint();
    let two = include_str!("../../deploy/topologies/two-computers.toml");
    let two = two.replace("tcp/127.0.0.1:7447", &world.endpoint).replace("tcp/127.0.0.1:7448", &onboard);
    let apart = world.file("apart.toml", &two.replace("links = ", "# links = "));
    let up = |host| world.axle(&["up", &apart, "--host", host]);
    let (near, far) = (up("workstation"), up("onboard"));
    near.says("processes are alive").await;
    far.says("processes are alive").await;
    let ended = world.axle(&["doctor", "--topology", &apart, "--json"]).ended().await;
    let found = findings(ended.is(1, &["the routers of onboard and workstation do not link"]));
    let crossing = verdicts(&found, "says navigator/pose to pilot of r1");
    assert_eq!(crossing, ["connected but not relayed"]);
    let within = verdicts(&found, "says navigator/pose to d-corrector of r1");
    assert_eq!(within, ["flows"], "what stays on one computer is well");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_doctor_tells_rules_names_clocks_and_inputs_apart() {
    let world = World::new().await;
    let keys = Keys::new(&world, "keys", &demo(&world)).await;
    keys.people().await;
    // A router whose rules let nobody hear poses, and that is reached by a name that it does not show as well.
    let rules = keys.directory().join("router@local/access.json");
    let text = std::fs::read_to_string(&rules).expect("rules");
    assert!(text.contains("/navigator/pose"));
    std::fs::write(&rules, text.replace("/navigator/pose", "/navigator/nothing")).expect("rules");
    let elsewhere = free_endpoint().replace("127.0.0.1", "127.0.0.2");
    let identity = keys.of("router@local");
    let listen = ["router", "--listen", &world.endpoint, "--listen", &elsewhere, "--identity", &identity];
    let _router = world.axle(&listen);

    let run = |kind: &str, args: &[&str]| {
        let of = if kind.starts_with("path") { "all" } else { "r1" };
        keys.tool(&format!("{kind}@{of}"), &[&["run", kind, "--host", "lab"], args].concat())
    };
    let mut services: Vec<Process> =
        ["pathfinder", "pathdriver", "emulator", "navigator", "d-corrector", "drive", "recorder"]
            .iter()
            .map(|kind| run(kind, &[]))
            .collect();
    // One hears another pose than the topology says, and one is on a computer whose clock is wrong.
    services.push(run("pilot", &["--input", "navigator/pose=emulator/truth"]));
    let source = keys.of("source@r1");
    let args = ["run", "source", "--host", "moon", "--connect", &world.endpoint, "--identity", &source];
    services.push(Process::with_env(&args, &[(axle_mesh::clock::STEP, "5")], world.path()));
    let mesh = super::roles::join(&world.endpoint, &keys.of("ann")).await;
    all_alive(&mesh, &["pathfinder", "emulator", "navigator", "d-corrector", "pilot", "source"]).await;
    Eyes::of(&mesh).await.hears("the gate's account", |_| true).await;

    let doctor = keys.tool("ann", &["doctor", "--topology", &keys.topology, "--json"]).ended().await;
    let found = findings(doctor.is(1, &["axle keys issue --topology FILE", "started with other inputs"]));
    assert_eq!(verdicts(&found, "says navigator/pose to d-corrector"), ["denied by access rules"]);
    assert_eq!(verdicts(&found, "says navigator/pose to pilot"), ["nobody listens"]);
    assert_eq!(verdicts(&found, "says source/recent to navigator"), ["flows"]);
    assert_eq!(
        (verdicts(&found, "clock of lab"), verdicts(&found, "clock of moon")),
        (vec!["clock".to_owned()], vec!["clock offset".to_owned()])
    );
    let clock = found.iter().find(|finding| finding["about"] == "clock of moon").expect("a clock");
    let detail = clock["detail"].as_str().expect("a text");
    let ahead: f64 = detail.split(' ').next().and_then(|number| number.parse().ok()).expect("milliseconds");
    assert!((4800.0..5200.0).contains(&ahead) && detail.contains('±'), "{detail}");
    assert!(verdicts(&found, "router of local").contains(&"reachable".to_owned()));

    let mut doctor = world.axle(&[
        "doctor",
        "--topology",
        &keys.topology,
        "--json",
        "--connect",
        &elsewhere,
        "--identity",
        &keys.of("ann"),
    ]);
    let ended = doctor.ended().await;
    let found = findings(ended.is(1, &["certificate name mismatch", "127.0.0.2"]));
    assert_eq!(verdicts(&found, "router of local"), ["certificate name mismatch"]);
}
