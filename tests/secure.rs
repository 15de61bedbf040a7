//! Certificates, access rules, and what is said when something is wrong with them.

mod doctor;
mod install;
mod keys;
mod page;
mod roles;

use crate::harness::{Process, World};
use std::path::PathBuf;

/// A directory of keys in a world, for the topology in `topology.toml` there.
struct Keys<'a> {
    world: &'a World,
    name: &'static str,
    topology: String,
}

impl<'a> Keys<'a> {
    /// Makes an authority, and issues everything that a topology names.
    async fn new(world: &'a World, name: &'static str, topology: &str) -> Self {
        let topology = world.file("topology.toml", topology);
        let keys = Self { world, name, topology };
        world.axle(&["keys", "init", "--keys", name]).ended().await.is(0, &["an authority is made"]);
        keys.issue(&[]).await;
        keys
    }
    async fn issue(&self, args: &[&str]) {
        let own = ["keys", "issue", "--keys", self.name, "--topology", &self.topology];
        self.world.axle(&[&own, args].concat()).ended().await.is(0, &["wrote the access rules"]);
    }
    /// Issues certificates for people.
    async fn people(&self) {
        for (name, role) in [("ann", "viewer"), ("bob", "operator"), ("carl", "commander")] {
            self.issue(&[name, "--role", role]).await;
        }
    }
    fn directory(&self) -> PathBuf {
        self.world.path().join(self.name)
    }
    /// The directory of one identity.
    fn of(&self, owner: &str) -> String {
        self.directory().join(owner).display().to_string()
    }
    /// Starts a tool of this world with somebody's identity.
    fn tool(&self, owner: &str, args: &[&str]) -> Process {
        self.world.tool(&[args, &["--identity", &self.of(owner)]].concat())
    }
}

/// The shipped topology of one computer, with the endpoint of a world.
fn demo(world: &World) -> String {
    include_str!("../deploy/topologies/demo.toml").replace("tcp/127.0.0.1:7447", &world.endpoint)
}
