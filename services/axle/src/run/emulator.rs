//! The emulator as a process: a robot in software behind its gate.

use super::Context;
use super::board::{Paced, Wheels, own};
use super::latch::Latch;
use super::tuning::{Facts, Shelf, Tuning};
use crate::params::load;
use axle_emulator::{Emulator, EmulatorParams};
use axle_gate::Gate;
use axle_mesh::{Mesh, Retry};
use axle_schema::meta::Cause;
use axle_schema::{
    EncodersData, InertialData, MapAsk, MapData, MetresPerSecond, NavigatorData, Refusal, RobotId, Seconds,
    Sides, key,
};
use std::time::Duration;

/// The map service, where it is needed, may still be starting.
const PATIENCE: Duration = Duration::from_secs(10);

/// Emulates until it is told to stop.
pub(crate) async fn run(context: Context) -> anyhow::Result<()> {
    if let Some(kind) = context.board {
        return super::emulated_board::run(context, kind).await;
    }
    let params: EmulatorParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let latch = Latch::open(&context.state, &robot)?;
    let gate = Gate::new(params.gate, &params.robot, context.mesh.boot(), latch.kept())?;
    let mut emulator = Emulator::new(params)?;
    if params.walls.solid {
        emulator = emulator.among(&map(&context.mesh, &robot).await?)?;
    }
    let emulated = Emulated::new(&context, &robot, &params, emulator)?;
    own(context, &robot, (gate, latch), emulated, params.rates.beat).await
}

/// The walls that stand around the robot.
pub(super) async fn map(mesh: &Mesh, robot: &RobotId) -> Result<MapData, Refusal> {
    mesh.ask(&key::MAP, Some(robot), &MapAsk::default(), PATIENCE, Retry::Idempotent).await
}

/// The emulated robot, and the lines of its sensors.
struct Emulated {
    emulator: Emulator,
    tuning: Tuning,
    encoders: Paced<EncodersData>,
    inertial: Paced<InertialData>,
    truth: Paced<NavigatorData>,
}

impl Emulated {
    fn new(
        context: &Context,
        robot: &RobotId,
        params: &EmulatorParams,
        emulator: Emulator,
    ) -> anyhow::Result<Self> {
        let mesh = &context.mesh;
        // Counts are said with every reading of the encoders: there the pace is.
        let (full_speed, calibrated) = (emulator.full_speed(), params.calibrated);
        let facts = Facts { full_speed, calibrated, keeps_speeds: false, hz: 1000.0 };
        let tuning = Tuning::new(mesh, Shelf::new(&context.state, robot), params.robot, facts)?;
        Ok(Self {
            emulator,
            tuning,
            encoders: Paced::new(mesh.publisher(&key::ENCODERS.of(robot))?, params.rates.encoders_hz),
            inertial: Paced::new(mesh.publisher(&key::INERTIAL.of(robot))?, params.rates.inertial_hz),
            truth: Paced::new(mesh.publisher(&key::TRUTH.of(robot))?, params.rates.truth_hz),
        })
    }
}

impl Wheels for Emulated {
    fn tune(&mut self, _now: Seconds, gate: &Gate) {
        self.tuning.hear(gate);
    }
    fn advance(&mut self, now: Seconds, speeds: Sides<MetresPerSecond>) {
        let setpoints = self.tuning.setpoints(now, speeds);
        self.emulator.advance(now, setpoints);
    }
    fn say(&mut self, now: Seconds, cause: Option<Cause>) {
        let Self { emulator, tuning, encoders, inertial, truth } = self;
        encoders.put(now, cause, || tuning.say(emulator.encoders()));
        inertial.put(now, cause, || emulator.inertial());
        truth.put(now, cause, || emulator.truth());
    }
}
