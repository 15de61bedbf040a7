//! `axle check [TOPOLOGY]`: what is wrong with a topology, before anything is started.

use crate::out::{data, note};
use crate::topology::{self, Topology};
use std::path::Path;

pub(super) fn check(path: Option<&Path>) -> anyhow::Result<()> {
    let topology = read(path)?;
    let faults = topology.faults();
    for fault in &faults {
        data(fault)?;
    }
    anyhow::ensure!(faults.is_empty(), "{} of its wires are wrong or missing", faults.len());
    let (services, wires) = (topology.services.len(), topology.wires().len());
    note(&format!("{services} services on {} computers, {wires} wires: all is there", topology.hosts.len()));
    Ok(())
}

/// The topology of a file, or the shipped one.
pub(super) fn read(path: Option<&Path>) -> anyhow::Result<Topology> {
    path.map_or_else(|| Topology::parse(topology::DEFAULT), Topology::read)
}
