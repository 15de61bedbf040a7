//! A mesh of certificates: who gets in, who may do what, and what everybody else is told.

use super::{Keys, demo};
use crate::harness::{
    Eyes, PATIENCE, Process, Stranger, World, all_alive, driven, free_endpoint, r1, within,
};
use axle_mesh::{Identity, Link, Mesh, Patience, Settings};
use axle_schema::command::{GateState, Reject};
use axle_schema::key;
use rcgen::{CertificateParams, DnType, Issuer, KeyPair};
use std::path::Path;
use std::time::Duration;
use time::OffsetDateTime;

fn identity(directory: &str) -> Identity {
    Identity::read(Path::new(directory), axle_mesh::clock::wall()).expect("an identity")
}

/// A session of the test with somebody's identity.
pub(super) async fn join(endpoint: &str, directory: &str) -> Mesh {
    let settings = Settings {
        connect: vec![axle_mesh::identity::secured(endpoint)],
        host: "lab".into(),
        service: "test".into(),
        robot: "r1".into(),
        inputs: Vec::new(),
        link: Link { identity: Some(identity(directory)), ..Link::default() },
    };
    Mesh::join(settings, Patience::AtMost(PATIENCE), |_, _| {}).await.expect("a router")
}

/// A plain client with somebody's identity.
async fn stranger(endpoint: &str, directory: &str) -> Stranger {
    let link = Link { identity: Some(identity(directory)), ..Link::default() };
    Stranger::join_as(&axle_mesh::identity::secured(endpoint), link).await
}

async fn up(world: &World, keys: &Keys<'_>) -> Process {
    let up = world.axle(&["up", &keys.topology, "--keys", keys.name]);
    up.says("processes are alive").await;
    up
}

/// How many commands the gate could not read.
async fn unread(eyes: &Eyes) -> u64 {
    let of = |state: &GateState| state.rejected.get(&Reject::Malformed).copied().unwrap_or(0);
    while eyes.states.take().is_some() {}
    of(&eyes.hears("the gate's account", |_| true).await)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_secured_mesh_drives_and_everybody_does_what_the_role_says_and_no_more() {
    let world = World::new().await;
    let keys = Keys::new(&world, "keys", &demo(&world)).await;
    keys.people().await;
    keys.issue(&["d-corrector@r2"]).await;
    let _up = up(&world, &keys).await;

    // An operator drives, stops and enables; a viewer sees it all.
    let mut tap = keys.tool("ann", &["tap", "axle/r1/navigator/pose", "--count", "3"]);
    tap.ended().await.is(0, &[]);
    driven(|| keys.tool("bob", &["go", "0.3,0"])).await.is(0, &["reached: 1 of 1 way points"]);
    let ps = keys.tool("ann", &["ps", "--json"]).ended().await.json();
    assert_eq!(ps.as_array().expect("a list").len(), 9, "{ps}");
    keys.tool("bob", &["stop"]).ended().await.is(0, &["r1 is stopped"]);
    keys.tool("bob", &["enable"]).ended().await.is(0, &["r1 may move"]);

    // A viewer who tries is told that it may be the role.
    let rules = "the access rules of the router do not let ann (viewer) do this";
    keys.tool("ann", &["go", "1,0"]).ended().await.is(1, &[rules]);
    keys.tool("ann", &["stop"]).ended().await.is(1, &["r1 did not acknowledge the stop", rules]);

    // The same with bare hands: what is no command at all reaches the gate from whoever may command, and from nobody
    // else.
    let watching = join(&world.endpoint, &keys.of("ann")).await;
    let eyes = Eyes::of(&watching).await;
    let before = unread(&eyes).await;
    let key = key::COMMAND.of(&r1());
    for owner in ["ann", "bob", "d-corrector@r2", "pilot@r1", "emulator@r1"] {
        let nobody = stranger(&world.endpoint, &keys.of(owner)).await;
        nobody.say(key.as_str(), "", "no command");
        // What is said next on the same link arrives after it, if anything of it arrives.
        nobody.is_heard_by_router().await;
    }
    let carl = stranger(&world.endpoint, &keys.of("carl")).await;
    carl.say(key.as_str(), "", "no command");
    let after = within(PATIENCE, "the gate refuses the one of carl", async {
        loop {
            let now = unread(&eyes).await;
            if now > before {
                return now;
            }
        }
    });
    assert_eq!(after.await, before + 1, "one of six could say it");
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_has_the_wrong_certificate_is_told_what_is_wrong_with_it() {
    let world = World::new().await;
    let keys = Keys::new(&world, "keys", &demo(&world)).await;
    keys.people().await;
    keys.issue(&["d-corrector@r2", "navigator@r1"]).await;
    let _router =
        world.axle(&["router", "--listen", &world.endpoint, "--identity", &keys.of("router@local")]);
    keys.tool("ann", &["ps"]).ended().await.is(0, &["no service is alive"]);

    // Without a certificate.
    world.done(&["ps"]).await.is(1, &["refuses the certificate of nobody", "it wants TLS"]);
    let tls = axle_mesh::identity::secured(&world.endpoint);
    world.axle(&["ps", "--connect", &tls]).ended().await.is(2, &["name an identity with --identity DIR"]);
    // Of another authority.
    let other = Keys::new(&world, "other", &demo(&world)).await;
    other.people().await;
    other.tool("ann", &["ps"]).ended().await.is(1, &["of another authority than ca.pem in"]);
    // Of another authority, by somebody who has the right ca.pem: the router itself refuses it.
    let mixed = world.path().join("mixed");
    std::fs::create_dir(&mixed).expect("a directory");
    for (from, file) in [(&other, "cert.pem"), (&other, "key.pem"), (&keys, "ca.pem")] {
        std::fs::copy(Path::new(&from.of("ann")).join(file), mixed.join(file)).expect("a copy");
    }
    let mixed = mixed.display().to_string();
    world.done(&["ps", "--identity", &mixed]).await.is(2, &["is not signed by the authority beside it"]);
    // Run out.
    let old = expired(&keys, "ann");
    world
        .done(&["ps", "--identity", &old])
        .await
        .is(2, &["the certificate of ann", "expired", "axle keys issue ann"]);
    // For another robot, and for another service.
    for (owner, words) in [("d-corrector@r2", "of d-corrector@r2"), ("navigator@r1", "of navigator@r1")] {
        let mut run = keys.tool(owner, &["run", "d-corrector", "--robot", "r1"]);
        run.ended().await.is(2, &[words, "the service is d-corrector@r1"]);
    }
    // A service's certificate makes no router, and a router needs its rules.
    let free = free_endpoint();
    let mut router = world.axle(&["router", "--listen", &free, "--identity", &keys.of("ann")]);
    router.ended().await.is(2, &["the certificate of ann is a viewer's"]);
    std::fs::remove_file(Path::new(&keys.of("router@local")).join("access.json")).expect("a file");
    let mut router = world.axle(&["router", "--listen", &free, "--identity", &keys.of("router@local")]);
    router.ended().await.is(2, &["cannot read the access rules"]);
    // By a name that the router's certificate does not hold.
    let elsewhere = free.replace("127.0.0.1", "127.0.0.2");
    keys.issue(&[]).await;
    let router = world.axle(&["router", "--listen", &elsewhere, "--identity", &keys.of("router@local")]);
    router.says("the router listens on").await;
    let mut ps = world.axle(&["ps", "--connect", &elsewhere, "--identity", &keys.of("ann")]);
    ps.ended().await.is(1, &["certificate name mismatch", "for 127.0.0.1, localhost", "--address 127.0.0.2"]);
}

/// A copy of an identity whose certificate ran out yesterday.
fn expired(keys: &Keys<'_>, owner: &str) -> String {
    let read = |file: &str| std::fs::read_to_string(keys.directory().join(file)).expect("a file");
    let authority = KeyPair::from_pem(&read("ca.key.pem")).expect("a key");
    let issuer = Issuer::from_ca_cert_pem(&read("ca.pem"), authority).expect("an authority");
    let mut params = CertificateParams::new(Vec::new()).expect("no names");
    params.distinguished_name.push(DnType::CommonName, owner);
    #[allow(clippy::cast_possible_truncation, reason = "seconds since 1970")]
    let now = OffsetDateTime::from_unix_timestamp(axle_mesh::clock::wall() as i64).expect("now");
    (params.not_before, params.not_after) =
        (now - Duration::from_secs(172_800), now - Duration::from_secs(86_400));
    let key = KeyPair::generate().expect("a key");
    let certificate = params.signed_by(&key, &issuer).expect("a certificate");
    let place = keys.directory().join("expired");
    std::fs::create_dir(&place).expect("a directory");
    std::fs::write(place.join("ca.pem"), read("ca.pem")).expect("a file");
    std::fs::write(place.join("cert.pem"), certificate.pem()).expect("a file");
    let path = place.join("key.pem");
    std::fs::write(&path, key.serialize_pem()).expect("a file");
    std::fs::set_permissions(&path, std::os::unix::fs::PermissionsExt::from_mode(0o600)).expect("a mode");
    place.display().to_string()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_revoked_certificate_does_nothing_once_the_router_has_begun_anew() {
    let world = World::new().await;
    let keys = Keys::new(&world, "keys", &demo(&world)).await;
    keys.people().await;
    let router =
        || world.axle(&["router", "--listen", &world.endpoint, "--identity", &keys.of("router@local")]);
    let mut first = router();
    let run = keys.tool("pathfinder@all", &["run", "pathfinder", "--host", "lab"]);
    all_alive(&join(&world.endpoint, &keys.of("ann")).await, &["pathfinder"]).await;
    let plan = async || keys.tool("bob", &["plan", "1,0"]).ended().await;
    plan().await.is(0, &[]);
    let revoked = world.axle(&["keys", "revoke", "bob", "--keys", "keys", "--topology", &keys.topology]);
    { revoked }.ended().await.is(0, &["revoked 1 of bob", "wrote the access rules of local"]);
    first.tell(nix::sys::signal::Signal::SIGTERM);
    first.ended().await.is(0, &[]);
    let _second = router();
    all_alive(&join(&world.endpoint, &keys.of("ann")).await, &["pathfinder"]).await;
    plan().await.is(1, &["the access rules of the router do not let bob (operator) do this"]);
    // A new one works at once where the rules are read, under another common name.
    keys.issue(&["bob", "--role", "operator"]).await;
    drop(run);
}

#[tokio::test(flavor = "multi_thread")]
async fn two_computers_drive_over_a_link_of_certificates() {
    let world = World::new().await;
    let onboard = free_endpoint();
    let two = include_str!("../../deploy/topologies/two-computers.toml");
    let two = two.replace("tcp/127.0.0.1:7447", &world.endpoint).replace("tcp/127.0.0.1:7448", &onboard);
    let keys = Keys::new(&world, "keys", &two).await;
    keys.people().await;
    let start = |host| world.axle(&["up", &keys.topology, "--keys", "keys", "--host", host]);
    let (robot, workstation) = (start("onboard"), start("workstation"));
    robot.says("processes are alive").await;
    workstation.says("processes are alive").await;
    let mesh = join(&world.endpoint, &keys.of("ann")).await;
    all_alive(&mesh, &["pilot", "pathfinder", "d-corrector", "emulator"]).await;
    let poses = mesh.inbox(&key::POSE.of(&r1()), 1).expect("poses");
    within(PATIENCE, "a pose from the other computer", poses.next()).await;
    driven(|| keys.tool("bob", &["go", "0.3,0"])).await.is(0, &["reached: 1 of 1 way points"]);
    // On a busy machine a process may be too slow for the doctor's patience; then it looks again.
    let well = async {
        while keys.tool("ann", &["doctor", "--topology", &keys.topology]).ended().await.code != Some(0) {}
    };
    within(PATIENCE, "all are well", well).await;

    // Whoever has taken the workstation over cannot pass for the wheels, nor command them.
    let near = join(&onboard, &keys.of("ann")).await;
    let eyes = Eyes::of(&near).await;
    let wrong = || near.counters().refused.load(std::sync::atomic::Ordering::Relaxed);
    for (owner, count) in [("router@workstation", 0), ("emulator@r1", 1)] {
        let somebody = stranger(&onboard, &keys.of(owner)).await;
        somebody.say(key::ENCODERS.of(&r1()).as_str(), "", "no encoders");
        somebody.is_heard_by_router().await;
        // What the emulator says after it is behind it in every queue.
        for _ in 0..20 {
            eyes.encoders.next().await;
        }
        assert_eq!(wrong(), count, "{owner}");
    }
}
