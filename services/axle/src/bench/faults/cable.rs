//! A cable between two networks of the system, which can be pulled: for this a person must be root.
//!
//! The robot's computer gets a network of its own, as a container has one. Both ends have addresses on their loopback, so
//! that a pulled cable takes the way and not the addresses.

use super::bed::Making;
use crate::topology::Place;
use anyhow::Context as _;
use std::collections::BTreeMap;
use tokio::process::Command;

/// The ends of the cable, and the addresses of the computers.
const NEAR: (&str, &str, &str) = ("axle-near", "10.213.77.1", "10.213.78.1");
const FAR: (&str, &str, &str) = ("axle-far", "10.213.77.2", "10.213.78.2");
/// The network of the robot's computer.
const NETWORK: &str = "axle-onboard";

/// The cable; it goes when it is dropped.
pub(super) struct Cable;

async fn ip(args: &str) -> anyhow::Result<()> {
    let done = Command::new("ip").args(args.split(' ')).output().await.context("run ip")?;
    let words = String::from_utf8_lossy(&done.stderr);
    anyhow::ensure!(done.status.success(), "`ip {args}`: {}", words.trim());
    Ok(())
}

impl Cable {
    /// Lays it, and says where the computers are.
    ///
    /// # Errors
    /// When this person or this system may not.
    pub(super) async fn lay() -> anyhow::Result<(Self, Making)> {
        ip(&format!("netns add {NETWORK}")).await?;
        let cable = Self;
        let within = format!("netns exec {NETWORK} ip");
        for line in [
            format!("link add {} type veth peer name {}", NEAR.0, FAR.0),
            format!("link set {} netns {NETWORK}", FAR.0),
            format!("addr add {}/30 dev {}", NEAR.1, NEAR.0),
            format!("addr add {}/32 dev lo", NEAR.2),
            format!("{within} addr add {}/30 dev {}", FAR.1, FAR.0),
            format!("{within} addr add {}/32 dev lo", FAR.2),
            format!("{within} link set lo up"),
            format!("{within} link set {} up", FAR.0),
            format!("{within} route add {}/32 via {}", NEAR.2, NEAR.1),
        ] {
            ip(&line).await?;
        }
        set(true).await?;
        let within = ["ip", "netns", "exec", NETWORK].map(str::to_owned).to_vec();
        let place = Place { within, variables: Vec::new() };
        let making = Making {
            places: BTreeMap::from([("onboard", place)]),
            addresses: BTreeMap::from([("workstation", NEAR.2), ("onboard", FAR.2)]),
            ..Making::default()
        };
        Ok((cable, making))
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        // The cable goes with the network of its other end.
        for args in [vec!["netns", "del", NETWORK], vec!["addr", "del", NEAR.2, "dev", "lo"]] {
            drop(std::process::Command::new("ip").args(args).output());
        }
    }
}

/// Plugs the cable in, or pulls it.
pub(super) async fn set(plugged: bool) -> anyhow::Result<()> {
    if !plugged {
        return ip(&format!("link set {} down", NEAR.0)).await;
    }
    ip(&format!("link set {} up", NEAR.0)).await?;
    // A way goes with its cable.
    ip(&format!("route replace {}/32 via {}", FAR.2, FAR.1)).await
}
