//! A robot with a real board as a process: the board on its serial line, behind the gate.
//!
//! Between the gate and the board stands the calibration that is kept for the robot: speeds of the gate become signals,
//! which the board takes as powers or as speeds that it keeps by itself, and counts become distances.
//!
//! It begins when the board has answered the greeting. A board that is unplugged, silent, restarted or has taken the
//! wheels away disables the drive, and is greeted again and again until it is back.

use super::Context;
use super::board::{Paced, Wheels, own};
use super::latch::Latch;
use super::serial::{Arrival, Port};
use super::tuning::{Facts, Shelf, Tuning};
use crate::out::usage;
use crate::params::load;
use axle_gate::Gate;
use axle_mesh::{Inbox, Mesh, Publisher};
use axle_robot::{BoardKind, Bridge, News, RobotParams};
use axle_schema::board::{BatteryData, BoardState, ContactsData, LinkState, ServoAngle};
use axle_schema::meta::Cause;
use axle_schema::{
    EncodersData, InertialData, Message, MetresPerSecond, Refusal, RobotId, Seconds, Sides, Signals, key,
};
use std::path::{Path, PathBuf};

/// Where a board usually is.
const USUAL: &str = "/dev/ttyUSB0";
/// The state of the board is said so often at least, and at most.
const STATE: (Seconds, Seconds) = (Seconds(1.0), Seconds(0.1));

/// Owns the wheels until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: RobotParams = load(context.params.as_deref())?;
    let kind = context.board.ok_or_else(|| {
        let known = BoardKind::ALL.map(BoardKind::name).join(", ");
        usage(format!("robot: name its board with --board KIND or AXLE_BOARD; known: {known}"))
    })?;
    let path = context.port.clone().unwrap_or_else(|| PathBuf::from(USUAL));
    let robot = context.one_robot()?;
    let mesh = context.mesh.clone();
    let tuning = tuning(&context, &robot, &params, kind)?;
    let mut wheels = Metal::new(&mesh, &robot, &params, kind, (&path, tuning))?;
    let latch = Latch::open(&context.state, &robot)?;
    let gate = Gate::new(params.gate, &params.robot, mesh.boot(), latch.kept())?;
    let mut look = mesh.beat(Seconds(0.01));
    let mut told: Option<(Refusal, Seconds)> = None;
    loop {
        let now = mesh.clock().now();
        let Err(why) = wheels.hear(now) else { break };
        wheels.tune(now, &gate);
        wheels.advance(now, Sides::default());
        wheels.say(now, None);
        // News are told at once, and the same again after a minute. That a board is being greeted is no news.
        let is_news = wheels.bridge.state(now).link != LinkState::Greeting
            && told.as_ref().is_none_or(|(last, at)| *last != why || now - *at > Seconds(60.0));
        if is_news && now > Seconds(0.5) {
            tracing::warn!("waiting for the board: {why}");
            told = Some((why, now));
        }
        tokio::select! {
            _ = look.next() => {}
            () = context.stop.wait() => return Ok(()),
        }
    }
    let state = wheels.bridge.state(mesh.clock().now());
    tracing::info!("{} at {}: {}", state.board, state.port, state.version.unwrap_or_default());
    own(context, &robot, (gate, latch), wheels, params.beat).await
}

/// The calibration of this robot.
fn tuning(
    context: &Context,
    robot: &RobotId,
    params: &RobotParams,
    kind: BoardKind,
) -> anyhow::Result<Tuning> {
    let facts = Facts {
        full_speed: params.full_speed(kind),
        calibrated: params.calibrated,
        keeps_speeds: !params.powers(kind),
        // With every reading of encoders; of a board that has none, often enough to see what it does.
        hz: if kind.has_encoders() { 1000.0 } else { 50.0 },
    };
    Tuning::new(&context.mesh, Shelf::new(&context.state, robot), params.robot, facts)
}

/// A real board, and the lines of its sensors.
struct Metal {
    port: Port,
    bridge: Bridge,
    tuning: Tuning,
    measures: bool,
    out: Vec<u8>,
    servos: Vec<Inbox<ServoAngle>>,
    encoders: Publisher<EncodersData>,
    inertial: Publisher<InertialData>,
    signals: Paced<Signals>,
    battery: Paced<BatteryData>,
    contacts: Publisher<ContactsData>,
    felt: Option<ContactsData>,
    board: Publisher<BoardState>,
    said: Option<BoardState>,
}

impl Metal {
    fn new(
        mesh: &Mesh,
        robot: &RobotId,
        params: &RobotParams,
        kind: BoardKind,
        (path, tuning): (&Path, Tuning),
    ) -> anyhow::Result<Self> {
        let bridge = Bridge::new(params, kind, &path.display().to_string())?;
        let servos = key::SERVOS.iter().take(params.servos.len());
        Ok(Self {
            port: Port::open(path, params.baud(kind), mesh.clock()),
            bridge,
            tuning,
            measures: kind.has_encoders(),
            out: Vec::new(),
            servos: servos.map(|servo| mesh.inbox(&servo.of(robot), 1)).collect::<Result<_, _>>()?,
            encoders: mesh.publisher(&key::ENCODERS.of(robot))?,
            inertial: mesh.publisher(&key::INERTIAL.of(robot))?,
            signals: Paced::new(mesh.publisher(&key::SIGNALS.of(robot))?, 10.0),
            battery: Paced::new(mesh.publisher(&key::BATTERY.of(robot))?, 1.0),
            contacts: mesh.publisher(&key::CONTACTS.of(robot))?,
            felt: None,
            board: mesh.publisher(&key::BOARD.of(robot))?,
            said: None,
        })
    }

    /// Says the state of the board on change and once a second.
    fn say_state(&mut self, now: Seconds) {
        let state = self.bridge.state(now);
        let is_due = self.said.as_ref().is_none_or(|said| {
            let age = now - said.stamp;
            age >= STATE.0 || (age >= STATE.1 && *said != BoardState { stamp: said.stamp, ..state.clone() })
        });
        if is_due {
            put(&self.board, &state, None);
            self.said = Some(state);
        }
    }
}

fn put<M: Message>(publisher: &Publisher<M>, message: &M, cause: Option<Cause>) {
    if let Err(refusal) = publisher.put(message, cause) {
        tracing::warn!("a measurement could not be said: {refusal}");
    }
}

impl Wheels for Metal {
    fn hear(&mut self, now: Seconds) -> Result<(), Refusal> {
        while let Some(arrival) = self.port.take() {
            match arrival {
                Arrival::Opened => self.bridge.opened(now, &mut self.out),
                Arrival::Bytes(at, bytes) => self.bridge.hear(at, &bytes),
                Arrival::Closed(Some(why)) => self.bridge.closed(why),
                // Why the bridge hung up it knows best.
                Arrival::Closed(None) => {}
            }
        }
        self.bridge.flooded(self.port.flooded());
        for (number, servo) in self.servos.iter().enumerate() {
            if let Some(heard) = servo.take()
                && let Err(refusal) = self.bridge.servo(number, heard.message.angle)
            {
                tracing::warn!("{refusal}");
            }
        }
        self.bridge.health(now)
    }

    fn tune(&mut self, _now: Seconds, gate: &Gate) {
        self.tuning.hear(gate);
    }

    fn advance(&mut self, now: Seconds, speeds: Sides<MetresPerSecond>) {
        let setpoints = self.tuning.setpoints(now, speeds);
        self.bridge.beat(now, setpoints, &mut self.out);
        if !self.out.is_empty()
            && let Err(refusal) = self.port.say(std::mem::take(&mut self.out))
        {
            tracing::warn!("{refusal}");
            self.bridge.closed(refusal);
        }
        if let Some(why) = self.bridge.hangs_up() {
            tracing::debug!("the port is opened anew: {why}");
            self.port.hang_up();
            self.bridge.closed(why);
        }
    }

    fn say(&mut self, now: Seconds, cause: Option<Cause>) {
        let News { encoders, inertial, contacts, battery, signals } = self.bridge.news();
        if let Some(signals) = signals {
            self.tuning.gave(signals);
        }
        if let Some(encoders) = encoders {
            put(&self.encoders, &self.tuning.say(encoders), cause);
        } else if !self.measures {
            self.tuning.say_signals(now);
        }
        if let Some(inertial) = inertial {
            put(&self.inertial, &inertial, cause);
        }
        if let Some(contacts) = contacts {
            let felt = |data: &ContactsData| (data.bump, data.drop, data.cliff);
            let is_due = self
                .felt
                .as_ref()
                .is_none_or(|said| felt(said) != felt(&contacts) || contacts.stamp - said.stamp >= STATE.1);
            if is_due {
                put(&self.contacts, &contacts, None);
                self.felt = Some(contacts);
            }
        }
        if let Some(battery) = battery {
            self.battery.put(now, None, || battery);
        }
        if let Some(signals) = signals {
            self.signals.put(now, cause, || signals);
        }
        self.say_state(now);
    }
}
