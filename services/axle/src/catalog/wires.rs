//! What each service hears, says, asks and answers: what a topology is checked and drawn by.
//!
//! A test starts the services and compares this with what they declare on the mesh.

use super::Takes;
use axle_schema::key::{self, Port};
use axle_schema::{Drive, Plan};

/// The wires of one service.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wires {
    /// Streams without which it can do nothing.
    pub(crate) needs: Vec<Port>,
    /// Streams that it hears where there are any.
    pub(crate) hears: Vec<Port>,
    /// Streams that it says.
    pub(crate) says: Vec<Port>,
    /// Calls that it makes.
    pub(crate) asks: Vec<Port>,
    /// Calls that it answers.
    pub(crate) answers: Vec<Port>,
}

/// Whether several services of a robot may say this: whoever commands needs the lease, and everybody may stop.
pub(crate) fn is_shared(port: Port) -> bool {
    port == key::COMMAND.port() || port == key::STOP.port()
}

/// The gate, in the process that owns the wheels.
fn gate() -> Wires {
    Wires {
        hears: vec![key::COMMAND.port(), key::STOP.port()],
        says: vec![key::GATE_STATE.port()],
        answers: vec![key::LEASE.port(), key::RELEASE.port(), key::ENABLE.port()],
        ..Wires::default()
    }
}

fn asks_the_gate() -> Vec<Port> {
    vec![key::LEASE.port(), key::RELEASE.port()]
}

pub(super) fn pathfinder(_: &'static str) -> Wires {
    Wires { answers: vec![key::PLAN.port()], ..Wires::default() }
}

pub(super) fn pathdriver(_: &'static str) -> Wires {
    Wires { answers: vec![key::DRIVE.port()], ..Wires::default() }
}

pub(super) fn pilot(_: &'static str) -> Wires {
    let correctors = || super::CATALOG.iter().filter_map(|entry| Some((entry.name, entry.takes?)));
    let orders = correctors().map(|(name, takes)| order(name, takes));
    let cancels = correctors().map(|(name, _)| key::corrector_cancel(name).port());
    let progress =
        [&key::GO_PROGRESS.port(), &key::GO_WAY.port(), &key::GO_PLAN.port(), &key::GO_DRIVE.port()];
    Wires {
        needs: vec![key::POSE.port()],
        hears: correctors().map(|(name, _)| key::corrector_progress(name).port()).collect(),
        says: progress.into_iter().copied().chain(orders).chain(cancels).collect(),
        asks: vec![key::PLAN.port(), key::DRIVE.port()],
        answers: vec![key::GO.port(), key::GO_CANCEL.port()],
    }
}

const fn order(name: &'static str, takes: Takes) -> Port {
    match takes {
        Takes::Drive => key::corrector_task::<Drive>(name).port(),
        Takes::Plan => key::corrector_task::<Plan>(name).port(),
    }
}

/// A corrector needs the measurements, the pose, the gate, and somebody who gives it tasks.
pub(super) fn corrector(name: &'static str) -> Wires {
    let takes = super::find(name).and_then(|entry| entry.takes).unwrap_or(Takes::Drive);
    Wires {
        needs: vec![order(name, takes), key::RECENT.port(), key::POSE.port(), key::GATE_STATE.port()],
        hears: vec![key::corrector_cancel(name).port()],
        says: vec![key::COMMAND.port(), key::corrector_progress(name).port()],
        asks: asks_the_gate(),
        ..Wires::default()
    }
}

pub(super) fn drive(_: &'static str) -> Wires {
    Wires {
        needs: vec![key::GATE_STATE.port(), key::ENCODERS.port()],
        says: vec![
            key::COMMAND.port(),
            key::STOP.port(),
            key::DRIVE_UPDATE.port(),
            key::DRIVE_DISTANCE_STAGE.port(),
            key::DRIVE_ROTATE_STAGE.port(),
        ],
        asks: [asks_the_gate(), vec![key::ENABLE.port()]].concat(),
        answers: vec![
            key::DRIVE_ALL_STOP.port(),
            key::DRIVE_ENABLE.port(),
            key::DRIVE_POWER.port(),
            key::DRIVE_SPEED.port(),
            key::DRIVE_DISTANCE.port(),
            key::DRIVE_ROTATE.port(),
            key::DRIVE_RESET.port(),
            key::DRIVE_GET.port(),
        ],
        ..Wires::default()
    }
}

pub(super) fn emulator(_: &'static str) -> Wires {
    let mut wires = gate();
    wires.says.extend([key::ENCODERS.port(), key::INERTIAL.port(), key::TRUTH.port()]);
    wires
}

/// The partners are those of the shipped parameters; others are named in its own.
pub(super) fn composed(_: &'static str) -> Wires {
    let motors = ["motor-left", "motor-right"];
    let mut wires = gate();
    wires.needs.extend(motors.map(|name| key::motor_reading(name).port()));
    wires.says.extend(motors.map(|name| key::motor_power(name).port()));
    wires.says.extend([key::ENCODERS.port(), key::SIGNALS.port()]);
    wires
}

pub(super) fn motor(name: &'static str) -> Wires {
    Wires {
        needs: vec![key::motor_power(name).port()],
        says: vec![key::motor_reading(name).port()],
        ..Wires::default()
    }
}

pub(super) fn source(_: &'static str) -> Wires {
    Wires {
        needs: vec![key::ENCODERS.port()],
        hears: vec![key::INERTIAL.port(), key::FIX.port()],
        says: vec![key::RECENT.port()],
        answers: vec![key::WINDOW.port()],
        ..Wires::default()
    }
}

pub(super) fn navigator(_: &'static str) -> Wires {
    Wires { needs: vec![key::RECENT.port()], says: vec![key::POSE.port()], ..Wires::default() }
}

/// It hears everything there is, and needs nothing of it.
pub(super) fn recorder(_: &'static str) -> Wires {
    Wires::default()
}
