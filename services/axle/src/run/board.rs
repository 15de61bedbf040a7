//! The process that owns wheels: their gate, and all its lines.
//!
//! The gate and the wheels live on a thread of their own, so that nothing else in the process can keep the gate from
//! braking. Zenoh's callbacks fill bounded queues; the beat empties them. What the wheels are is behind [`Wheels`]: an
//! emulated robot, or motors that are services of their own.

use super::Context;
use super::latch::Latch;
use axle_gate::{COMMANDS_PER_BEAT, Gate, Headline};
use axle_mesh::{Alarm, Counters, Inbox, Mesh, Publisher, Server};
use axle_schema::codec::decode_as;
use axle_schema::command::{AllStop, Command, Done, Enable, GateState, Lease, LeaseAsk, Motion, Release};
use axle_schema::meta::Cause;
use axle_schema::{MetresPerSecond, Refusal, RobotId, Seconds, Sides, key};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The gate's state is said at least this often.
const STATE_PERIOD: Seconds = Seconds(1.0);

/// Wheels behind a gate.
pub(crate) trait Wheels: Send + 'static {
    /// Hears how the wheels are, before anything is decided.
    ///
    /// # Errors
    /// Why they cannot be driven: the gate is disabled until somebody enables it again.
    fn hear(&mut self, _now: Seconds) -> Result<(), Refusal> {
        Ok(())
    }
    /// Hears what is asked about the wheels themselves; the gate says whose they are.
    fn tune(&mut self, _now: Seconds, _gate: &Gate) {}
    /// Takes the setpoint of the gate for this instant.
    fn advance(&mut self, now: Seconds, speeds: Sides<MetresPerSecond>);
    /// Says what is measured, naming the command that caused it.
    fn say(&mut self, now: Seconds, cause: Option<Cause>);
}

/// Owns the wheels until it is told to stop, and does not leave them turning.
pub(crate) async fn own<W: Wheels>(
    mut context: Context,
    robot: &RobotId,
    (gate, latch): (Gate, Latch),
    wheels: W,
    beat: Seconds,
) -> anyhow::Result<()> {
    let mesh = context.mesh.clone();
    let mut board = Board::new(&mesh, robot, gate, latch, wheels)?;
    let stopping = Arc::new(AtomicBool::new(false));
    let is_stopping = Arc::clone(&stopping);
    let alarm = Alarm::default();
    board.stops.rings(alarm.clone());
    let thread = mesh.beat_on_own_thread("gate", beat, alarm, move |now| {
        let is_stopping = is_stopping.load(Relaxed);
        if is_stopping {
            board.gate.disable(now);
        }
        board.beat(now);
        // Who owns the wheels does not leave them turning.
        !(is_stopping && board.gate.motion() == Motion::Standing)
    })?;
    let _visible = context.ready()?;
    context.stop.wait().await;
    stopping.store(true, Relaxed);
    tokio::task::spawn_blocking(move || drop(thread.join())).await?;
    Ok(())
}

/// A stream that is said at a rate of its own, which beats need not divide.
pub(crate) struct Paced<M> {
    publisher: Publisher<M>,
    period: Seconds,
    due: Seconds,
}

impl<M: axle_schema::Message> Paced<M> {
    pub(crate) fn new(publisher: Publisher<M>, hz: f64) -> Self {
        Self { publisher, period: Seconds(1.0 / hz), due: Seconds::ZERO }
    }
    pub(crate) fn put(&mut self, now: Seconds, cause: Option<Cause>, message: impl FnOnce() -> M) {
        if now >= self.due {
            // What was missed is not made up for.
            self.due = (self.due + self.period).max(now);
            say(self.publisher.put(&message(), cause).map(drop));
        }
    }
}

fn say(said: Result<(), Refusal>) {
    if let Err(refusal) = said {
        tracing::warn!("a measurement could not be said: {refusal}");
    }
}

/// The wheels, their gate, and all its lines.
struct Board<W> {
    gate: Gate,
    latch: Latch,
    wheels: W,
    leases: Server<LeaseAsk, Lease>,
    releases: Server<Release, Done>,
    enables: Server<Enable, Done>,
    commands: Inbox<Command>,
    stops: Inbox<AllStop>,
    state: Publisher<GateState>,
    said: Option<(Headline, bool, Seconds)>,
    /// Commands that were forgotten, and that were too large, as far as the gate has counted them; stops likewise.
    unread: (u64, u64),
    unread_stops: u64,
    counters: Arc<Counters>,
    obeyed: Option<Cause>,
    /// The wheels cannot be driven.
    lost: bool,
}

impl<W: Wheels> Board<W> {
    fn new(mesh: &Mesh, robot: &RobotId, gate: Gate, latch: Latch, wheels: W) -> anyhow::Result<Self> {
        Ok(Self {
            gate,
            latch,
            wheels,
            leases: mesh.server(&key::LEASE.of(Some(robot)))?,
            releases: mesh.server(&key::RELEASE.of(Some(robot)))?,
            enables: mesh.server(&key::ENABLE.of(Some(robot)))?,
            commands: mesh.inbox(&key::COMMAND.of(robot), COMMANDS_PER_BEAT as usize)?,
            stops: mesh.inbox(&key::STOP.of(robot), 8)?,
            state: mesh.publisher(&key::GATE_STATE.of(robot))?,
            said: None,
            unread: (0, 0),
            unread_stops: 0,
            counters: mesh.shared_counters(),
            obeyed: None,
            lost: false,
        })
    }

    fn beat(&mut self, now: Seconds) {
        // Stops come first: nothing that arrived with them may move a wheel.
        self.hear_stops(now);
        self.hear_wheels(now);
        while let Some(asked) = self.leases.try_next() {
            let answer = asked.question().and_then(|ask| self.gate.lease(now, &ask));
            asked.reply(answer);
        }
        while let Some(asked) = self.releases.try_next() {
            let answer = asked.question().and_then(|release| self.gate.release(now, &release));
            asked.reply(answer.map(|()| Done {}));
        }
        while let Some(asked) = self.enables.try_next() {
            let answer = asked.question().and_then(|enable| self.gate.enable(now, &enable));
            asked.reply(answer.map(|()| Done {}));
        }
        self.wheels.tune(now, &self.gate);
        self.hear_commands(now);
        let speeds = self.gate.beat(now);
        self.wheels.advance(now, speeds);
        self.latch.keep(self.gate.latch());
        self.say_state(now);
        self.wheels.say(now, self.obeyed);
    }

    /// Wheels that cannot be driven disable the gate, which says so once.
    fn hear_wheels(&mut self, now: Seconds) {
        let heard = self.wheels.hear(now);
        if let Err(refusal) = &heard
            && !self.lost
        {
            tracing::warn!("the drive is disabled: {refusal}");
        }
        self.lost = heard.is_err();
        if self.lost {
            self.gate.disable(now);
        }
    }

    fn hear_stops(&mut self, now: Seconds) {
        let unread = self.stops.oversized();
        if unread > self.unread_stops {
            self.unread_stops = unread;
            self.gate.disable(now);
            tracing::warn!("an AllStop that is too large to be read disables the drive");
        }
        while let Some(raw) = self.stops.take_raw() {
            match decode_as::<AllStop>(&raw.encoding, &raw.payload) {
                Ok(stop) => {
                    self.gate.stop(now, stop.id);
                    tracing::warn!(stop = %stop.id, "AllStop by {}", stop.by);
                }
                // Whoever speaks on this key wants the wheels to stand, even if the words are wrong.
                Err(refusal) => {
                    self.gate.disable(now);
                    tracing::warn!("an AllStop that cannot be read disables the drive: {refusal}");
                }
            }
        }
    }

    fn hear_commands(&mut self, now: Seconds) {
        let unread = (self.commands.dropped(), self.commands.oversized());
        self.gate.overflowed(unread.0 - self.unread.0);
        self.gate.oversized(unread.1 - self.unread.1);
        self.unread = unread;
        for _ in 0..COMMANDS_PER_BEAT {
            let Some(raw) = self.commands.take_raw() else { break };
            match self.gate.command(now, &raw.encoding, &raw.payload) {
                Ok(()) => self.obeyed = raw.meta().map(|meta| Cause { source: meta.source, seq: meta.seq }),
                Err(reject) => {
                    self.counters.count_refused();
                    tracing::debug!("command refused: {reject:?}");
                }
            }
        }
    }

    /// Says the gate's state on change and once a second.
    fn say_state(&mut self, now: Seconds) {
        let (headline, stored) = (self.gate.headline(), self.latch.is_stored());
        let is_news = self
            .said
            .is_none_or(|(said, was, at)| (said, was) != (headline, stored) || now - at >= STATE_PERIOD);
        if is_news {
            self.said = Some((headline, stored, now));
            let state = GateState { stored, ..self.gate.state(now) };
            say(self.state.put(&state, None).map(drop));
        }
    }
}
