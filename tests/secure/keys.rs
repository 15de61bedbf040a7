//! `axle keys`: what it writes, and what it refuses.

use super::{Keys, demo};
use crate::harness::World;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

fn mode(path: &Path) -> u32 {
    std::fs::metadata(path).expect("a file").permissions().mode() & 0o777
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_are_secret_everybody_has_one_and_a_second_authority_is_refused() {
    let world = World::new().await;
    let keys = Keys::new(&world, "keys", &demo(&world)).await;
    for secret in ["ca.key.pem", "d-corrector@r1/key.pem", "router@local/key.pem", "pathfinder@all/key.pem"] {
        assert_eq!(mode(&keys.directory().join(secret)), 0o600, "{secret}");
    }
    assert_eq!(mode(&keys.directory()), 0o700);
    assert_eq!(mode(&keys.directory().join("d-corrector@r1")), 0o700);
    let again = world.axle(&["keys", "init", "--keys", "keys"]).ended().await;
    again.is(2, &["holds an authority already"]);
    let shown = world.axle(&["keys", "show", "--keys", "keys", "--json"]).ended().await;
    let shown = shown.is(0, &[]).json();
    let rows = shown.as_array().expect("a list");
    assert_eq!(rows.len(), 10, "nine services and a router: {rows:?}");
    assert!(rows.iter().all(|row| row["state"] == "valid"), "{rows:?}");
    // Whoever has a certificate that lasts gets no second one.
    keys.issue(&[]).await;
    keys.issue(&["d-corrector@r1"]).await;
    let shown = world.axle(&["keys", "show", "--keys", "keys", "--json"]).ended().await.json();
    let names = shown.as_array().expect("a list").iter().map(|row| row["common_name"].to_string());
    assert!(names.clone().any(|name| name.contains("d-corrector@r1~2")), "{names:?}");
    assert_eq!(names.count(), 11);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_issued_is_refused_by_name() {
    let world = World::new().await;
    let none = world.axle(&["keys", "issue", "--keys", "nowhere"]).ended().await;
    none.is(2, &["holds no keys", "axle keys init"]);
    world.axle(&["keys", "init"]).ended().await.is(0, &["axle-keys/ca.key.pem"]);
    for (args, words) in [
        (&["ann"][..], "--role viewer, operator or commander"),
        (&["parrot@r1"], "unknown service"),
        (&["d-corrector@all"], "works for one robot"),
        (&["../x", "--role", "viewer"], "is no name"),
        (&["router@local", "--address", "a b"], "--address"),
    ] {
        let ended = world.axle(&[&["keys", "issue"], args].concat()).ended().await;
        ended.is(2, &[words]);
    }
    world.axle(&["keys", "revoke", "ann"]).ended().await.is(1, &["ann has no certificate"]);
    // A key that others can read is no secret: it is not used.
    world.axle(&["keys", "issue", "ann", "--role", "viewer"]).ended().await.is(0, &[]);
    let key = world.path().join("axle-keys/ann/key.pem");
    std::fs::set_permissions(&key, std::fs::Permissions::from_mode(0o644)).expect("a mode");
    let ps = world.done(&["ps", "--identity", "axle-keys/ann"]).await;
    ps.is(2, &["can be read by others", "chmod 600"]);
    let nobody = world.done(&["ps", "--identity", "axle-keys/bob"]).await;
    nobody.is(2, &["cannot read", "axle keys issue"]);
}
