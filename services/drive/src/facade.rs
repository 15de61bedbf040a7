//! The façade: what it remembers, what it hears, and how it answers requests. Its beat is in `beat`.

use crate::DriveParams;
use crate::odometer::Odometer;
use crate::plan::plan;
use crate::say::{Out, Reply, Request, Stages, Ticket, Wish};
use axle_schema::command::{AllStop, Class, Enable, GateState, Lease, LeaseAsk, Motion, Release};
use axle_schema::contract::{Bounds as _, Corrector};
use axle_schema::differential_drive::{
    DriveDistance, DriveOperation, DriveStage, EnableDrive, RotateDegrees, SetDrivePower, SetDriveSpeed,
    StopDrive,
};
use axle_schema::refusal::within;
use axle_schema::{
    Drive, EncodersData, Message as _, MetresPerSecond, Refusal, Seconds, Sides, StopId, TaskId, Tick,
};
use std::collections::VecDeque;

mod beat;

/// The most requests that wait for the gate's answer.
const MOST_WAITING: usize = 16;
/// A gate that says nothing for so long is gone; it speaks once a second.
const GATE_SILENCE: Seconds = Seconds(3.0);
/// So long after its own start the façade waits for the first word of the gate before it says that there is none.
const YOUTH: Seconds = Seconds(1.5);
/// The gate has this long to acknowledge a stop, which is repeated at every beat until then.
const STOP_PATIENCE: Seconds = Seconds(2.0);

/// The Generic Differential Drive: a state machine without a clock, a thread or a wire.
///
/// Whoever runs it tells it what was heard, calls [`Facade::beat`] every `period`, and does what [`Facade::outs`] says.
pub struct Facade<C: Corrector<Plan = Drive>> {
    params: DriveParams,
    corrector: C::Params,
    /// Who asks the gate for the wheels.
    name: String,
    /// The gate's newest state, and when it was heard.
    gate: Option<(GateState, Seconds)>,
    odometer: Odometer,
    grip: Grip,
    /// When it first heard or was asked anything.
    born: Option<Seconds>,
    /// Requests that wait for the first word of the gate, with their random bits.
    early: VecDeque<(Ticket, u64, Request)>,
    /// Requests that wait for the wheels.
    waiting: VecDeque<(Ticket, Wish)>,
    activity: Activity<C>,
    /// The wheel speeds at the end of the newest command.
    commanded: Sides<MetresPerSecond>,
    stopping: Option<Stopping>,
    /// Enables that the gate has not answered yet.
    enabling: usize,
    /// What of the state was said last, and when.
    said: Option<(beat::Headline, Seconds)>,
    outs: Vec<Out>,
}

/// Whether the gate gives us the wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Grip {
    Free,
    Asked,
    Held { lease: Lease, seq: u32, since: Seconds },
}

/// What the wheels are to do while we hold them.
enum Activity<C> {
    /// Come to rest, and give the wheels back.
    Idle,
    Speeds {
        operation: DriveOperation,
        target: Sides<MetresPerSecond>,
        until: Seconds,
    },
    /// Moves by a way; the corrector begins when the wheels are at rest.
    Operation {
        stages: Stages,
        drive: Drive,
        corrector: Option<Box<C>>,
    },
}

/// A stop that the gate has not acknowledged yet.
struct Stopping {
    order: AllStop,
    /// The gate's latest stop before it.
    before: Option<StopId>,
    since: Seconds,
    /// Who waits for the acknowledgement; whether with the stop as the answer.
    tickets: Vec<(Ticket, bool)>,
}

impl<C: Corrector<Plan = Drive>> Facade<C> {
    /// A façade that knows nothing yet. `name` is how people know its process.
    ///
    /// # Errors
    /// Refuses parameters out of range.
    pub fn new(params: DriveParams, corrector: C::Params, name: String) -> Result<Self, Refusal> {
        params.check()?;
        corrector.check()?;
        Ok(Self {
            params,
            corrector,
            name,
            gate: None,
            odometer: Odometer::default(),
            grip: Grip::Free,
            born: None,
            early: VecDeque::new(),
            waiting: VecDeque::new(),
            activity: Activity::Idle,
            commanded: Sides::default(),
            stopping: None,
            enabling: 0,
            said: None,
            outs: Vec::new(),
        })
    }

    /// What has to be said and asked since the last call, in this order.
    pub fn outs(&mut self) -> Vec<Out> {
        std::mem::take(&mut self.outs)
    }

    /// Hears the gate.
    pub fn hear_gate(&mut self, now: Seconds, state: GateState) {
        let is_old = self
            .gate
            .as_ref()
            .is_some_and(|(last, _)| last.boot == state.boot && state.tick.since(last.tick) < 0);
        if is_old {
            return;
        }
        let is_stopped = |stopping: &Stopping| {
            let is_ours = state.stop == Some(stopping.order.id);
            // Somebody else's stop that came after ours is as good.
            !state.enabled && state.stop.is_some() && (is_ours || state.stop != stopping.before)
        };
        if self.stopping.as_ref().is_some_and(is_stopped) {
            for (ticket, tells) in self.stopping.take().map(|stopping| stopping.tickets).unwrap_or_default() {
                let reply = state.stop.filter(|_| tells).map_or(Reply::Done, Reply::Stopped);
                self.outs.push(Out::Answer(ticket, Ok(reply)));
            }
        }
        self.gate = Some((state, now));
        self.ask_early(now);
        self.let_go_if_lost(now);
        self.say_state(now);
    }

    /// Hears the encoders.
    pub fn hear_encoders(&mut self, now: Seconds, reading: EncodersData) {
        self.odometer.hear(now, reading);
    }

    /// Hears the gate's answer to [`Out::AskLease`].
    pub fn leased(&mut self, now: Seconds, granted: Result<Lease, Refusal>) {
        let asked = self.grip == Grip::Asked;
        match granted {
            Ok(lease) if asked && !self.waiting.is_empty() => {
                self.grip = Grip::Held { lease, seq: 0, since: now };
                // Whoever had the wheels before us may have left them turning.
                let turning = self.gate.as_ref().filter(|(state, _)| state.motion != Motion::Standing);
                self.commanded = turning.map(|(state, _)| state.wheels).unwrap_or_default();
                while let Some((ticket, wish)) = self.waiting.pop_front() {
                    self.begin(now, ticket, wish);
                }
            }
            // Nobody wants the wheels any more.
            Ok(lease) => {
                self.outs.push(Out::Release(Release { boot: lease.boot, epoch: lease.epoch }));
                if asked {
                    self.grip = Grip::Free;
                }
            }
            Err(refusal) => {
                if asked {
                    self.grip = Grip::Free;
                }
                self.refuse_waiting(&refusal);
            }
        }
        self.say_state(now);
    }

    /// Hears the gate's answer to [`Out::Enable`].
    pub fn enabled(&mut self, now: Seconds, ticket: Ticket, answer: Result<(), Refusal>) {
        self.enabling = self.enabling.saturating_sub(1);
        if answer.is_ok()
            && let Some((state, _)) = &mut self.gate
        {
            // The gate's own words may come after its answer; a request that follows the answer must not be refused.
            state.enabled = true;
        }
        self.outs.push(Out::Answer(ticket, answer.map(|()| Reply::Done)));
        self.say_state(now);
    }

    /// Takes a request; `bits` are random, and name the operation or the stop that comes of it.
    ///
    /// The answer is an [`Out::Answer`], now or when the gate has answered.
    pub fn ask(&mut self, now: Seconds, ticket: Ticket, bits: u64, request: Request) {
        let is_stop =
            matches!(request, Request::Stop(_) | Request::Enable(EnableDrive { enable: false, .. }));
        if self.is_young(now) && !is_stop && self.early.len() < MOST_WAITING {
            self.early.push_back((ticket, bits, request));
            return;
        }
        match self.consider(now, ticket, bits, request) {
            Ok(None) => {}
            Ok(Some(reply)) => self.outs.push(Out::Answer(ticket, Ok(reply))),
            Err(refusal) => self.outs.push(Out::Answer(ticket, Err(refusal))),
        }
        self.say_state(now);
    }

    /// Whether the gate may still say its first word.
    fn is_young(&mut self, now: Seconds) -> bool {
        let born = *self.born.get_or_insert(now);
        self.gate.is_none() && now - born <= YOUTH
    }

    /// Takes the requests that have waited for the first word of the gate.
    fn ask_early(&mut self, now: Seconds) {
        for (ticket, bits, request) in std::mem::take(&mut self.early) {
            self.ask(now, ticket, bits, request);
        }
    }

    /// The answer, or none if it comes later or was given already.
    fn consider(
        &mut self,
        now: Seconds,
        ticket: Ticket,
        bits: u64,
        request: Request,
    ) -> Result<Option<Reply>, Refusal> {
        let wish = match request {
            Request::Get => return Ok(Some(Reply::State(Box::new(self.state(now)?)))),
            Request::Reset => {
                self.odometer.reset();
                return Ok(Some(Reply::Done));
            }
            Request::Stop(StopDrive { by }) => {
                let by = if by.is_empty() { "a client of the drive".to_owned() } else { by };
                self.stop(now, (ticket, true), AllStop { id: StopId::from_random(bits), by });
                return Ok(None);
            }
            Request::Enable(EnableDrive { enable: false, .. }) => {
                let by = "the drive was disabled".to_owned();
                self.stop(now, (ticket, false), AllStop { id: StopId::from_random(bits), by });
                return Ok(None);
            }
            Request::Enable(EnableDrive { stop, .. }) => return self.enable(now, ticket, stop),
            Request::Power(SetDrivePower { left, right, hold }) => {
                let full = self.params.full_speed();
                let target = Sides::new(left, right).map(|power| full * power.get());
                Wish::Speeds {
                    operation: DriveOperation::Power,
                    target,
                    hold: hold.unwrap_or(self.params.hold),
                }
            }
            Request::Speed(SetDriveSpeed { left, right, hold }) => {
                let most = self.params.robot.wheel_speed.0;
                within("left speed in m/s (robot.wheel_speed)", left.0, -most, most)?;
                within("right speed in m/s (robot.wheel_speed)", right.0, -most, most)?;
                let hold = hold.unwrap_or(self.params.hold);
                Wish::Speeds { operation: DriveOperation::Speed, target: Sides::new(left, right), hold }
            }
            Request::Distance(distance) => {
                distance.check()?;
                let operation = Some(TaskId::from_random(bits));
                self.operation(distance.stage, Stages::Distance(DriveDistance { operation, ..distance }))?
            }
            Request::Rotate(rotate) => {
                rotate.check()?;
                let operation = Some(TaskId::from_random(bits));
                self.operation(rotate.stage, Stages::Rotate(RotateDegrees { operation, ..rotate }))?
            }
        };
        self.check_enabled(now)?;
        // Wheels that somebody else turns have to be taken from them before they can stop.
        let stands = self.gate.as_ref().is_some_and(|(state, _)| state.motion == Motion::Standing);
        let at_once = self.grip == Grip::Free && stands && wish.needs_no_wheels();
        if at_once || matches!(self.grip, Grip::Held { .. }) {
            self.begin(now, ticket, wish);
            return Ok(None);
        }
        if self.waiting.len() >= MOST_WAITING {
            return Err(too_many("number of requests that wait for the wheels"));
        }
        self.waiting.push_back((ticket, wish));
        if self.grip == Grip::Free {
            self.grip = Grip::Asked;
            let (holder, period) = (self.name.clone(), self.params.period);
            self.outs.push(Out::AskLease(LeaseAsk { holder, class: Class::Manual, period }));
        }
        Ok(None)
    }

    fn operation(&self, stage: DriveStage, stages: Stages) -> Result<Wish, Refusal> {
        if stage != DriveStage::InitialRequest {
            return Err(Refusal::out_of_range("stage of a request", format!("{stage:?}"), "initial_request"));
        }
        let drive = plan(&stages, &self.params)?;
        Ok(Wish::Operation { stages, drive })
    }

    /// Grants a wish: the answer first, then the end of what it cancels, then its own start.
    fn begin(&mut self, now: Seconds, ticket: Ticket, wish: Wish) {
        match wish {
            Wish::Speeds { operation, target, hold } => {
                self.outs.push(Out::Answer(ticket, Ok(Reply::Done)));
                self.cancel(None);
                if target != Sides::default() {
                    self.activity = Activity::Speeds { operation, target, until: now + hold };
                }
            }
            Wish::Operation { stages, drive } => {
                let (Stages::Distance(DriveDistance { operation, .. })
                | Stages::Rotate(RotateDegrees { operation, .. })) = &stages;
                self.outs.push(Out::Answer(ticket, Ok(Reply::Begun(operation.unwrap_or_default()))));
                self.cancel(None);
                self.outs.push(stages.reach(DriveStage::Started, None));
                match drive {
                    None => self.outs.push(stages.reach(DriveStage::Completed, None)),
                    Some(drive) => self.activity = Activity::Operation { stages, drive, corrector: None },
                }
            }
        }
    }

    /// Ends what is going on; the wheels come to rest from now on.
    fn cancel(&mut self, why: Option<Refusal>) {
        if let Activity::Operation { stages, .. } = std::mem::replace(&mut self.activity, Activity::Idle) {
            self.outs.push(stages.reach(DriveStage::Canceled, why));
        }
    }

    fn refuse_waiting(&mut self, refusal: &Refusal) {
        let early = std::mem::take(&mut self.early).into_iter().map(|(ticket, ..)| ticket);
        for ticket in early.chain(std::mem::take(&mut self.waiting).into_iter().map(|(ticket, _)| ticket)) {
            self.outs.push(Out::Answer(ticket, Err(refusal.clone())));
        }
    }

    /// Stops at once: by the gate's own `AllStop`, so that whoever else commands the wheels is stopped too.
    fn stop(&mut self, now: Seconds, ticket: (Ticket, bool), order: AllStop) {
        // The order goes out before anything else is said.
        let order = self.stopping.as_ref().map_or(order, |stopping| stopping.order.clone());
        self.outs.push(Out::Stop(order.clone()));
        let before = self.gate.as_ref().and_then(|(state, _)| state.stop);
        let stopping =
            self.stopping.get_or_insert_with(|| Stopping { order, before, since: now, tickets: Vec::new() });
        if stopping.tickets.len() < MOST_WAITING {
            stopping.tickets.push(ticket);
        } else {
            let refusal = too_many("number of requests that wait for a stop");
            self.outs.push(Out::Answer(ticket.0, Err(refusal)));
        }
        let why = Refusal::Disabled { why: format!("it was stopped by AllStop {}", stopping.order.id) };
        self.refuse_waiting(&why);
        self.cancel(Some(why));
        self.lose_grip();
    }

    /// The wheels are not ours any more, whatever they do.
    fn lose_grip(&mut self) {
        if matches!(self.grip, Grip::Held { .. }) {
            self.grip = Grip::Free;
        }
        self.commanded = Sides::default();
    }

    fn enable(
        &mut self,
        now: Seconds,
        ticket: Ticket,
        stop: Option<StopId>,
    ) -> Result<Option<Reply>, Refusal> {
        let state = self.heard_gate(now)?;
        if let Some(stopping) = &self.stopping {
            let why = format!("AllStop {} is on its way to the gate", stopping.order.id);
            return Err(Refusal::Disabled { why });
        }
        if state.enabled {
            return Ok(Some(Reply::Done));
        }
        if stop != state.stop {
            let quoted = stop.map_or_else(|| "no stop".to_owned(), |id| format!("stop {id}"));
            let why = match state.stop {
                Some(id) => format!(
                    "the request quotes {quoted}, but AllStop {id} is in force; quote it: stop = {}, as the state of \
                     the drive shows it",
                    id.0
                ),
                None => format!("the request quotes {quoted}, but there was none; leave it out"),
            };
            return Err(Refusal::Fenced { why });
        }
        if self.enabling >= MOST_WAITING {
            return Err(too_many("number of requests that wait to enable"));
        }
        let newest = self.odometer.newest().map(|reading| Tick::of(reading.stamp));
        let echo = newest.filter(|tick| tick.since(state.tick) > 0).unwrap_or(state.tick);
        let (boot, by) = (state.boot, self.name.clone());
        self.enabling += 1;
        self.outs.push(Out::Enable(ticket, Enable { stop, boot, echo, by, class: Class::Manual }));
        Ok(None)
    }

    /// The gate's newest state.
    fn heard_gate(&self, now: Seconds) -> Result<&GateState, Refusal> {
        match &self.gate {
            Some((state, at)) if now - *at <= GATE_SILENCE => Ok(state),
            _ => {
                let hint = "the gate says nothing; is the robot or emulator up?";
                Err(Refusal::unavailable("the drive's gate", hint))
            }
        }
    }

    fn check_enabled(&self, now: Seconds) -> Result<(), Refusal> {
        let state = self.heard_gate(now)?;
        let stop = self.stopping.as_ref().map(|stopping| stopping.order.id);
        if state.enabled && stop.is_none() {
            return Ok(());
        }
        let why = match stop.or(state.stop) {
            Some(id) => {
                format!("AllStop {id} is in force; enable the drive with stop = {} to move again", id.0)
            }
            None => "it has not been enabled since boot; enable the drive to move".to_owned(),
        };
        Err(Refusal::Disabled { why })
    }
}

/// A queue of requests is full.
fn too_many(what: &str) -> Refusal {
    Refusal::TooLarge { what: what.into(), got: MOST_WAITING as u64 + 1, limit: MOST_WAITING as u64 }
}
