//! The emulator as a process: a robot in software behind its gate.

use super::Context;
use super::board::{Paced, Wheels, own};
use super::latch::Latch;
use crate::params::load;
use axle_emulator::{Emulator, EmulatorParams};
use axle_gate::Gate;
use axle_mesh::Mesh;
use axle_schema::meta::Cause;
use axle_schema::{EncodersData, InertialData, MetresPerSecond, NavigatorData, RobotId, Seconds, Sides, key};

/// Emulates until it is told to stop.
pub(crate) async fn run(context: Context) -> anyhow::Result<()> {
    let params: EmulatorParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let latch = Latch::open(&context.state, &robot)?;
    let gate = Gate::new(params.gate, &params.robot, context.mesh.boot(), latch.kept())?;
    let emulated = Emulated::new(&context.mesh, &robot, &params)?;
    own(context, &robot, (gate, latch), emulated, params.rates.beat).await
}

/// The emulated robot, and the lines of its sensors.
struct Emulated {
    emulator: Emulator,
    encoders: Paced<EncodersData>,
    inertial: Paced<InertialData>,
    truth: Paced<NavigatorData>,
}

impl Emulated {
    fn new(mesh: &Mesh, robot: &RobotId, params: &EmulatorParams) -> anyhow::Result<Self> {
        Ok(Self {
            emulator: Emulator::new(*params)?,
            encoders: Paced::new(mesh.publisher(&key::ENCODERS.of(robot))?, params.rates.encoders_hz),
            inertial: Paced::new(mesh.publisher(&key::INERTIAL.of(robot))?, params.rates.inertial_hz),
            truth: Paced::new(mesh.publisher(&key::TRUTH.of(robot))?, params.rates.truth_hz),
        })
    }
}

impl Wheels for Emulated {
    fn advance(&mut self, now: Seconds, speeds: Sides<MetresPerSecond>) {
        self.emulator.advance(now, speeds);
    }
    fn say(&mut self, now: Seconds, cause: Option<Cause>) {
        let Self { emulator, encoders, inertial, truth } = self;
        encoders.put(now, cause, || emulator.encoders());
        inertial.put(now, cause, || emulator.inertial());
        truth.put(now, cause, || emulator.truth());
    }
}
