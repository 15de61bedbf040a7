//! `axle install`: a computer's share as files, and a service that tells its manager how it is.

use super::Keys;
use crate::harness::{PATIENCE, Process, World, within};
use std::collections::BTreeSet;
use tokio::net::UnixDatagram;

fn read(path: &std::path::Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_computer_gets_its_own_services_and_identities_and_no_others() {
    let world = World::new().await;
    let two = include_str!("../../deploy/topologies/two-computers.toml");
    let keys = Keys::new(&world, "keys", two).await;
    let install = async |topology: &str| {
        let args =
            ["install", "--host", "onboard", "--topology", topology, "--prefix", "root", "--keys", "keys"];
        world.axle(&args).ended().await
    };
    install(&keys.topology).await.is(0, &["wrote the router and 5 services of onboard below root"]);
    let root = world.path().join("root");
    let units = root.join("etc/systemd/system");
    let wanted = || -> BTreeSet<String> {
        let entries = std::fs::read_dir(units.join("axle.target.wants")).expect("a directory").flatten();
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
    };
    let services = ["emulator-r1", "source-r1", "navigator-r1", "d-corrector-r1", "drive-r1"];
    let mut expected: BTreeSet<String> = services.iter().map(|name| format!("axle@{name}.service")).collect();
    expected.insert("axle-router.service".into());
    assert_eq!(wanted(), expected);
    for name in &expected {
        assert!(units.join("axle.target.wants").join(name).exists(), "{name} leads to its unit");
    }
    let router = read(&root.join("etc/axle/router.env"));
    assert!(
        router.contains("AXLE_LISTEN=\"tls/127.0.0.1:7448\"")
            && router.contains("AXLE_LINK=\"tls/127.0.0.1:7447\""),
        "{router}"
    );
    let corrector = read(&root.join("etc/axle/d-corrector-r1.env"));
    assert!(
        corrector.contains("AXLE_SERVICE=\"d-corrector\"")
            && corrector.contains("AXLE_PARAMS=\"/etc/axle/d-corrector-r1.toml\""),
        "{corrector}"
    );
    let own = root.join("etc/axle/identity/d-corrector-r1");
    assert_eq!(read(&own.join("key.pem")), read(&keys.directory().join("d-corrector@r1/key.pem")));
    assert!(root.join("etc/axle/identity/router/access.json").exists());
    assert!(!root.join("etc/axle/identity/pathfinder").exists(), "planners run elsewhere");
    // What a later topology has no more is not started any more.
    let fewer = two.replace("[[services]]\nkind = \"drive\"\nrobot = \"r1\"\nhost = \"onboard\"\n", "");
    let fewer = world.file("fewer.toml", &fewer);
    install(&fewer).await.is(0, &["4 services"]);
    assert!(!wanted().contains("axle@drive-r1.service"));
    let none = world.axle(&["install", "--topology", &fewer, "--prefix", "root"]).ended().await;
    none.is(2, &["choose one with --host: onboard, workstation"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_service_says_when_it_is_ready_and_feeds_the_watchdog_while_its_beat_goes_on() {
    let world = World::new().await;
    let path = world.path().join("notify");
    let manager = UnixDatagram::bind(&path).expect("a socket");
    let heard = async || {
        let mut bytes = [0; 64];
        let count = within(PATIENCE, "a word", manager.recv(&mut bytes)).await.expect("a datagram");
        String::from_utf8_lossy(&bytes[..count]).into_owned()
    };
    let path = path.display().to_string();
    let variables = [("NOTIFY_SOCKET", &*path), ("WATCHDOG_USEC", "400000")];
    let start = |args: &[&str]| Process::with_env(args, &variables, world.path());
    let mut router = start(&["router", "--listen", &world.endpoint]);
    assert_eq!(heard().await, "READY=1");
    assert_eq!(heard().await, "WATCHDOG=1");
    router.tell(nix::sys::signal::Signal::SIGTERM);
    router.ended().await.is(0, &[]);
    while heard().await != "STOPPING=1" {}

    // Without a router it is not ready, however long it lives.
    let mut pilot = start(&["run", "pilot", "--connect", &world.endpoint, "--host", "lab"]);
    pilot.says("waiting for a router").await;
    let mut bytes = [0; 64];
    assert!(manager.try_recv(&mut bytes).is_err(), "nothing was said yet");
    let _router = world.router();
    assert_eq!(heard().await, "READY=1");
    for _ in 0..5 {
        assert_eq!(heard().await, "WATCHDOG=1");
    }
    pilot.tell(nix::sys::signal::Signal::SIGTERM);
    pilot.ended().await.is(0, &[]);
    while heard().await != "STOPPING=1" {}
}
