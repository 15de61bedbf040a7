//! Command lines and files. Exit code 2: the line or a file is wrong; 1: it is right, but it cannot be done.

use crate::harness::{Ended, Process, World, all_alive, free_endpoint};
use nix::sys::signal::Signal;
use std::net::TcpListener;
use std::time::Duration;

/// `axle` without a mesh: what is wrong is seen before anybody is asked.
async fn refused(world: &World, args: &[&str], words: &[&str]) {
    let ended = world.axle(args).ended().await;
    ended.is(2, words);
    assert!(ended.out.is_empty(), "data is for programs: {}", ended.out);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_way_is_refused_by_the_name_of_its_point() {
    let world = World::new().await;
    let long = "0,0 ".repeat(20_000);
    for (way, words) in [
        ("", &["at least one point", "\"1,0\""][..]),
        ("   ", &["at least one point"]),
        ("0,0 1", &["way point 2 \"1\"", "x and y"]),
        ("nan,0", &["x of way point 1 is out of range: NaN"]),
        ("0,0 1,inf", &["y of way point 2 is out of range: inf", "-100000 to 100000"]),
        ("0,-1e300", &["y of way point 1 is out of range: -1e300"]),
        ("1,0,99999", &["heading of way point 1"]),
        ("1;0", &["\"1;0\" is not a number", "x,y x,y"]),
        ("0,0 \u{1b}[31m,1", &["way point 2"]),
        (&long, &["way points is too large: 20000, at most 4096"]),
    ] {
        refused(&world, &["plan", way], words).await;
    }
    refused(&world, &["go", "1,0 x,1"], &["way point 2", "\"x\" is not a number"]).await;
    refused(&world, &["demo", "--way", "1e9,0"], &["x of way point 1"]).await;
    refused(&world, &["plan", "1,0", "--from", "1,0 2,0"], &["--from", "x,y,heading"]).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_line_is_refused_with_what_is_known() {
    let world = World::new().await;
    let file = world.file("file", "");
    let inside = format!("{file}/out");
    for (args, words) in [
        (&["fly"][..], &["fly", "axle"][..]),
        (&[], &["Usage"]),
        (&["ps", "--colour"], &["--colour"]),
        (&["ps", "--robot", "a/b"], &["a/b", "'/'", "a-z, 0-9 and -"]),
        (&["run", "pilot", "--robot", "R1"], &["R1", "a-z, 0-9 and -"]),
        (&["go", "1,0", "--robot", "all"], &["\"all\""]),
        (&["run", "parrot"], &["parrot", "known: pilot, pathfinder"]),
        (&["params", "parrot"], &["parrot", "known: pilot, pathfinder"]),
        (&["demo", "--corrector", "parrot"], &["parrot", "known: d-corrector"]),
        (&["demo", "--corrector", "pilot"], &["\"pilot\" is unknown", "d-corrector"]),
        (&["demo", "--seed", "-1"], &["-1"]),
        (&["demo", "--seed", "18446744073709551615"], &["--seed", "9223372036854775807"]),
        (&["demo", "--out", &inside], &["--out", "cannot make this directory"]),
        (&["ps", "--connect", "127.0.0.1:7447"], &["\"127.0.0.1:7447\" is not an endpoint", "tcp/HOST:PORT"]),
        (&["run", "pilot", "--connect", "tcp/127.0.0.1:99999"], &["99999", "tcp/HOST:PORT"]),
        (&["router", "--listen", "udp/127.0.0.1:7447"], &["udp/127.0.0.1:7447", "tcp/HOST:PORT"]),
        (&["router", "--listen", "tcp/0.0.0.0:20000"], &["tcp/0.0.0.0:20000", "--insecure-lan"]),
        (&["up", "--listen", "7447"], &["--listen", "tcp/HOST:PORT"]),
        (&["up", "--host", "moon"], &["moon", "local"]),
        (&["tap", "axle/**", "--count", "0"], &["--count", "0"]),
        (&["ls", "--for", "nan"], &["--for", "0.1 to 3600"]),
    ] {
        refused(&world, args, words).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_setting_of_the_environment_is_refused_like_a_flag() {
    let world = World::new().await;
    let mut ps = Process::with_env(&["ps"], &[("AXLE_ROBOT", "a/b")], world.path());
    ps.ended().await.is(2, &["a/b", "a-z, 0-9 and -"]);
    let mut ps = Process::with_env(&["ps"], &[("AXLE_CONNECT", "nowhere")], world.path());
    ps.ended().await.is(2, &["\"nowhere\" is not an endpoint"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_router_that_is_not_there_is_said_soon() {
    let world = World::new().await;
    let words = [&format!("no router answers at {}", world.endpoint), "axle router", "axle up", "--connect"];
    let lines =
        [&["plan", "1,0"][..], &["go", "1,0"], &["ps"], &["ls"], &["tap", "axle/**"], &["stop"], &["enable"]];
    let tools: Vec<_> = lines.map(|line| world.tool(line)).into();
    for mut tool in tools {
        let ended = tool.ended().await;
        ended.is(1, &words);
        // Two seconds for the router, the rest for a loaded machine.
        assert!(ended.took < Duration::from_secs(4), "it took {:?}", ended.took);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_port_that_is_taken_is_named_with_the_way_out() {
    let world = World::new().await;
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let endpoint = format!("tcp/127.0.0.1:{}", taken.local_addr().expect("an address").port());
    for command in ["router", "up"] {
        let ended = world.axle(&[command, "--listen", &endpoint]).ended().await;
        ended.is(1, &[&endpoint, "another port", "--listen tcp/127.0.0.1:PORT"]);
    }
    let _router = world.router();
    drop(world.join().await);
    world.router().ended().await.is(1, &[&world.endpoint, "another port"]);
}

/// How a service ends that cannot begin, with or without a router.
async fn run(world: &World, service: &str, params: &str) -> Ended {
    world.done(&["run", service, "--params", params]).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_parameter_file_is_refused_with_its_line_before_a_router_is_waited_for() {
    let world = World::new().await;
    run(&world, "pathfinder", "no/such.toml").await.is(2, &["no/such.toml", "cannot read"]);
    let directory = world.path().display().to_string();
    run(&world, "pilot", &directory).await.is(2, &[&directory, "cannot read"]);
    for (service, text, words) in [
        ("pathfinder", "merge = 0.1\nmerg = 0.1\n", &["line 2", "merg"][..]),
        ("pathfinder", "\nmerge = nan\n", &["line 2", "merge", "NaN is not a finite number"]),
        ("pathfinder", "merge = 7\n", &["merge in m", "7", "0 to 1"]),
        ("pathfinder", "merge = \"far\"\n", &["line 1", "merge"]),
        ("pathdriver", "effort = 2\n", &["effort", "2", "0.05 to 1"]),
        ("pilot", "corrector = \"parrot\"\n", &["parrot", "known: d-corrector"]),
        ("d-corrector", "[robot]\ntrack = 0\n", &["track", "0"]),
        ("emulator", "\n\n[gate]\nmax_agee = 1\n", &["line 4", "max_agee"]),
        ("emulator", "[gate]\na_max = 1.0\n", &["gate.a_max", "1"]),
        ("source", "encoders = 0\n", &["encoders", "0"]),
        ("source", "encoders = 1000000\n", &["encoders", "1000000", "4096"]),
        ("navigator", "method = \"magic\"\n", &["line 1", "magic", "arc"]),
        ("recorder", "flush = 60\n", &["flush", "60", "0.1 to 1"]),
        ("recorder", "this is no TOML", &["line 1"]),
    ] {
        let file = world.file(&format!("{service}.toml"), text);
        let name = format!("{service}.toml");
        run(&world, service, &file).await.is(2, words).is(2, &[&name]);
    }
    let binary = world.path().join("binary.toml");
    std::fs::write(&binary, [0xff, 0xfe, 0x00]).expect("a file");
    run(&world, "pathfinder", &binary.display().to_string()).await.is(2, &["binary.toml", "cannot read"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_topology_is_refused_by_name() {
    let world = World::new().await;
    let host = "[hosts.local]\nrouter = \"tcp/127.0.0.1:7447\"\n";
    refused(&world, &["up", "no/such.toml"], &["no/such.toml", "cannot read the topology"]).await;
    for (text, words) in [
        ("services = [", &["line 1"][..]),
        ("services = []\n", &["hosts"]),
        ("services = []\n[hosts]\n", &["[hosts.local]"]),
        (&format!("{host}[[services]]\nkind = \"parrot\"\n"), &["services[0]", "parrot", "known: pilot"]),
        (&format!("{host}[[services]]\nkind = \"pilot\"\n"), &["services[0]", "robot = \"r1\""]),
        (&format!("{host}[[services]]\nkind = \"pilot\"\nrobot = \"a/b\"\n"), &["line 5", "a/b"]),
        (&format!("{host}[[services]]\nkind = \"pathfinder\"\nhost = \"moon\"\n"), &["moon"]),
        (&format!("{host}[[servces]]\nkind = \"pilot\"\n"), &["servces"]),
        (&format!("{host}[robots.r1]\ntrack = -1\n"), &["track"]),
    ] {
        let file = world.file("wrong.toml", text);
        refused(&world, &["up", &file, "--listen", &world.endpoint], words).await;
        refused(&world, &["up", &file, "--listen", &world.endpoint], &["wrong.toml"]).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_service_with_wrong_parameters_ends_the_start_of_a_topology_by_name() {
    let world = World::new().await;
    let text = format!(
        "[hosts.local]\nrouter = {:?}\n[[services]]\nkind = \"pathfinder\"\n[[services]]\nkind = \"pathdriver\"\n\
         params = {{ effort = 7 }}\n",
        world.endpoint
    );
    let file = world.file("topology.toml", &text);
    let ended = world.axle(&["up", &file]).ended().await;
    ended.is(1, &["pathdriver", "effort", "0.05 to 1", "could not start"]);
    assert!(ended.took < Duration::from_secs(8), "it took {:?}", ended.took);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tap_refuses_what_is_no_key_and_says_when_nothing_is_said() {
    let world = World::new().await;
    let _router = world.router();
    drop(world.join().await);
    for keys in ["/axle/r1", "axle/r1/", "axle//pose", "axle/r1/#", ""] {
        world.done(&["tap", keys]).await.is(2, &[&format!("{keys:?} is not a key expression"), "axle/r1/**"]);
    }
    let mut tap = world.tool(&["tap", "axle/r1/nothing/here"]);
    tap.says("nothing was said on axle/r1/nothing/here for 2 s; no service is alive").await;
    assert!(tap.is_running(), "it goes on listening");
    tap.tell(Signal::SIGINT);
    tap.ended().await.is(0, &[]);
    world.done(&["ps"]).await.is(0, &["no service is alive", "axle up"]);
    world.done(&["ls", "--for", "0.1"]).await.is(0, &["nothing is said"]);
    let stop = world.done(&["stop"]).await;
    stop.is(1, &["r1 did not acknowledge the stop", "may still move"]);
    world.done(&["enable"]).await.is(1, &["the gate of r1 says nothing"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn planners_answer_what_is_odd_but_right() {
    let world = World::new().await;
    let _router = world.router();
    let _services = ["pathfinder", "pathdriver"].map(|name| world.run(name));
    all_alive(&world.join().await, &["pathfinder", "pathdriver"]).await;
    let plan = world.done(&["plan", "1,0", "--drive", "--json"]).await;
    let json = plan.is(0, &[]).json();
    assert_eq!(json["legs"].as_array().map(Vec::len), Some(1), "{json}");
    assert!(json["drive"]["dwms"].as_array().is_some_and(|dwms| dwms.len() >= 2), "{json}");
    let again = world.done(&["plan", "1,0 1,0 1,0 2,0"]).await;
    again.is(0, &["way point 2", "repeats"]);
    world.done(&["plan", "0,0"]).await.is(0, &["nothing to drive"]);
    let negative = world.done(&["plan", "-1,-0.5", "--from", "-1,-1,0"]).await;
    assert!(negative.is(0, &[]).out.contains("length 0.500 m"), "{}", negative.out);
    let most = "0,0 1,0 ".repeat(2048);
    let json = world.done(&["plan", most.trim(), "--json"]).await.is(0, &[]).json();
    assert!(json["legs"].as_array().is_some_and(|legs| legs.len() > 4000), "4096 points are allowed");
    let nowhere = world.done(&["plan", "1,0", "--svg", "no/such/plan.svg"]).await;
    nowhere.is(1, &["no/such/plan.svg"]);
    let elsewhere = world.axle(&["plan", "1,0", "--connect", &free_endpoint()]).ended().await;
    elsewhere.is(1, &["no router answers"]);
}
