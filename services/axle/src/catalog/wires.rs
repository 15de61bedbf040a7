//! What each service hears, says, asks and answers: what a topology is checked and drawn by.
//!
//! A test starts the services and compares this with what they declare on the mesh.

use super::Takes;
use crate::run::composed::ComposedParams;
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
    /// Calls that it makes only for some tasks, and can do without.
    pub(crate) may_ask: Vec<Port>,
    /// Calls that it answers.
    pub(crate) answers: Vec<Port>,
    /// Whether it hears whatever is said about its robot.
    pub(crate) hears_everything: bool,
    /// Whether it does what people ask of it: with certificates it may what an operator may.
    pub(crate) acts_for_people: bool,
}

/// Whether several services of a robot may say this: whoever commands needs the lease, everybody may stop, and of
/// several planners each speaks of its own searches.
pub(crate) fn is_shared(port: Port) -> bool {
    [key::COMMAND.port(), key::STOP.port(), key::PLAN_PROGRESS.port()].contains(&port)
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
    Wires {
        hears: vec![key::PLAN_CANCEL.port()],
        says: vec![key::PLAN_PROGRESS.port(), key::PLAN_ANSWERED.port()],
        may_ask: vec![key::MAP.port()],
        answers: vec![key::PLAN.port()],
        ..Wires::default()
    }
}

pub(super) fn map(_: &'static str) -> Wires {
    Wires { answers: vec![key::MAP.port()], ..Wires::default() }
}

pub(super) fn pathdriver(_: &'static str) -> Wires {
    let says = vec![key::DRIVE_ANSWERED.port()];
    Wires { says, answers: vec![key::DRIVE.port()], ..Wires::default() }
}

/// Only pilots of a fleet ask it, so that they do not need it.
pub(super) fn traffic(_: &'static str) -> Wires {
    Wires { answers: vec![key::CLAIM.port(), key::TRAFFIC.port()], ..Wires::default() }
}

pub(super) fn pilot(_: &'static str) -> Wires {
    let correctors = || super::CATALOG.iter().filter_map(|entry| Some((entry.name, entry.takes?)));
    let orders = correctors().map(|(name, takes)| order(name, takes));
    let cancels = correctors().map(|(name, _)| key::corrector_cancel(name).port());
    let progress =
        [&key::GO_PROGRESS.port(), &key::GO_WAY.port(), &key::GO_PLAN.port(), &key::GO_DRIVE.port()];
    Wires {
        needs: vec![key::POSE.port()],
        hears: correctors()
            .map(|(name, _)| key::corrector_progress(name).port())
            .chain([key::NAVIGATOR_EVENT.port()])
            .collect(),
        says: progress.into_iter().copied().chain(orders).chain(cancels).collect(),
        asks: vec![key::PLAN.port(), key::DRIVE.port()],
        answers: vec![key::GO.port(), key::GO_CANCEL.port(), key::CONFIRM.port()],
        ..Wires::default()
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
        hears: vec![key::corrector_cancel(name).port(), key::NAVIGATOR_EVENT.port()],
        says: vec![key::COMMAND.port(), key::corrector_progress(name).port(), key::trace(name).port()],
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

/// An owner of wheels that may be calibrated.
fn tuning(wires: &mut Wires) {
    wires.says.push(key::MOTORS.port());
    wires.answers.extend([key::CALIBRATION.port(), key::CALIBRATE.port(), key::RAW.port()]);
}

pub(super) fn calibrator(_: &'static str) -> Wires {
    Wires { answers: vec![key::TO_SIGNALS.port(), key::TO_SPEEDS.port()], ..Wires::default() }
}

pub(super) fn emulator(_: &'static str) -> Wires {
    let mut wires = gate();
    wires.says.extend([key::ENCODERS.port(), key::INERTIAL.port(), key::TRUTH.port()]);
    wires.may_ask.push(key::MAP.port());
    tuning(&mut wires);
    wires
}

/// An emulator that plays a board: the gate is with whoever opens its line.
pub(crate) fn emulated_board() -> Wires {
    Wires { says: vec![key::TRUTH.port()], may_ask: vec![key::MAP.port()], ..Wires::default() }
}

/// Servos are heard as many as its parameters name.
pub(super) fn robot(_: &'static str) -> Wires {
    let mut wires = gate();
    let measured = [&key::ENCODERS.port(), &key::INERTIAL.port(), &key::SIGNALS.port()];
    wires.says.extend(measured);
    wires.says.extend([key::BATTERY.port(), key::CONTACTS.port(), key::BOARD.port()]);
    tuning(&mut wires);
    wires
}

/// The partners of the shipped parameters.
pub(super) fn composed(_: &'static str) -> Wires {
    composed_of(&ComposedParams::default())
}

/// The partners that are services of the catalogue; what is foreign declares its own wires.
pub(crate) fn composed_of(params: &ComposedParams) -> Wires {
    let known = |name: &String| super::find(name).map(|entry| entry.name);
    let motors: Vec<_> = params.motors.as_ref().both().into_iter().filter_map(known).collect();
    let mut partners = motors.clone();
    partners.extend(
        params.encoders.as_ref().both().into_iter().filter_map(known).filter(|name| !motors.contains(name)),
    );
    let mut wires = gate();
    wires.needs.extend(partners.into_iter().map(|name| key::motor_reading(name).port()));
    wires.says.extend(motors.into_iter().map(|name| key::motor_power(name).port()));
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

/// The encoder `encoder-left` hears `motor-left`.
pub(super) fn encoder(name: &'static str) -> Wires {
    let motor = super::CATALOG.iter().find(|entry| {
        entry.name.strip_prefix("motor-").is_some_and(|side| name.strip_prefix("encoder-") == Some(side))
    });
    Wires {
        needs: motor.map(|entry| key::motor_reading(entry.name).port()).into_iter().collect(),
        says: vec![key::motor_reading(name).port()],
        ..Wires::default()
    }
}

pub(super) fn source(name: &'static str) -> Wires {
    Wires {
        needs: vec![key::ENCODERS.port()],
        hears: vec![key::INERTIAL.port(), key::FIX.port(), key::RANGE.port(), key::POSITION.port()],
        says: vec![key::RECENT.port(), key::trace(name).port()],
        answers: vec![key::WINDOW.port()],
        ..Wires::default()
    }
}

pub(super) fn navigator(name: &'static str) -> Wires {
    Wires {
        needs: vec![key::RECENT.port()],
        says: vec![
            key::POSE.port(),
            key::POSITION.port(),
            key::NAVIGATOR_EVENT.port(),
            key::trace(name).port(),
        ],
        asks: vec![key::WINDOW.port()],
        answers: vec![key::GET_POSITION.port(), key::SET_POSITION.port()],
        ..Wires::default()
    }
}

/// It hears everything there is, and needs nothing of it.
pub(super) fn recorder(_: &'static str) -> Wires {
    Wires { hears_everything: true, ..Wires::default() }
}

/// It listens through taps to whatever there is, asks whoever is there, and needs nothing of it.
pub(super) fn gateway(_: &'static str) -> Wires {
    Wires { acts_for_people: true, ..Wires::default() }
}
