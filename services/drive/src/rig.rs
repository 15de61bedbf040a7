//! A drive with its gate and an emulated robot in virtual time, for tests: time moves by hand.

use crate::{DriveParams, Facade, Out, Reply, Request, Ticket};
use axle_correctors::{DCorrector, DParams};
use axle_emulator::{Emulator, EmulatorParams};
use axle_gate::{Gate, Headline};
use axle_schema::command::{Class, Command, Lease, LeaseAsk, Motion};
use axle_schema::differential_drive::{
    DriveDistance, DriveStage, EnableDrive, RotateDegrees, SetDrivePower, SetDriveSpeed, StopDrive,
};
use axle_schema::{
    Boot, Duty, Dwm, Metres, MetresPerSecond, NavigatorData, Refusal, Seconds, Sides, StopId, TaskId, Tick,
};

/// Beats of the gate; encoders speak at every fourth, the drive beats at every tenth.
const BEAT: f64 = 0.005;

pub(crate) struct Rig {
    pub(crate) facade: Facade<DCorrector>,
    pub(crate) gate: Gate,
    pub(crate) emulator: Emulator,
    pub(crate) beats: u32,
    /// Everything that the drive said, and when.
    pub(crate) said: Vec<(Seconds, Out)>,
    /// The wheel that is blocked, if any.
    pub(crate) blocks_left: bool,
    /// Whether the robot says anything.
    pub(crate) is_silent: bool,
    /// Whether the gate hears stops.
    pub(crate) is_deaf: bool,
    heard: Option<(Headline, Seconds)>,
    /// What goes to the gate at its next beat.
    post: Vec<Out>,
    tickets: Ticket,
}

impl Rig {
    pub(crate) fn new(seed: u64) -> Self {
        let emulated = EmulatorParams { seed, ..EmulatorParams::default() };
        let params = DriveParams::default();
        let corrector = DParams {
            tolerance: params.tolerance,
            lost: params.lost,
            robot: params.robot,
            ..DParams::default()
        };
        let gate = Gate::new(emulated.gate, &emulated.robot, Boot(42), None).expect("a gate");
        let mut rig = Self {
            facade: Facade::new(params, corrector, "drive".into()).expect("a drive"),
            gate,
            emulator: Emulator::new(emulated).expect("a robot"),
            beats: 0,
            said: Vec::new(),
            blocks_left: false,
            is_silent: false,
            is_deaf: false,
            heard: None,
            post: Vec::new(),
            tickets: 0,
        };
        rig.run(0.1);
        rig
    }
    pub(crate) fn now(&self) -> Seconds {
        Seconds(f64::from(self.beats) * BEAT)
    }
    /// Goes on for so many seconds.
    pub(crate) fn run(&mut self, seconds: f64) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few thousand beats")]
        for _ in 0..(seconds / BEAT).round() as u32 {
            self.step();
        }
    }
    /// Goes on until this holds, 60 s at most.
    #[track_caller]
    pub(crate) fn run_until(&mut self, what: &str, mut holds: impl FnMut(&Self) -> bool) {
        for _ in 0..12_000 {
            if holds(self) {
                return;
            }
            self.step();
        }
        panic!("not within 60 s: {what}");
    }
    fn step(&mut self) {
        self.beats += 1;
        let now = self.now();
        self.deliver(now);
        let mut speeds = self.gate.beat(now);
        if self.blocks_left {
            speeds.left = MetresPerSecond::ZERO;
        }
        self.emulator.advance(now, speeds);
        let headline = self.gate.headline();
        let is_news = self.heard.is_none_or(|(said, at)| said != headline || now - at >= Seconds(1.0));
        if is_news && !self.is_silent {
            self.heard = Some((headline, now));
            self.facade.hear_gate(now, self.gate.state(now));
        }
        if self.beats.is_multiple_of(4) && !self.is_silent {
            self.facade.hear_encoders(now, self.emulator.encoders());
        }
        if self.beats.is_multiple_of(10) {
            self.facade.beat(now);
        }
        self.collect(now);
    }
    /// What was said goes on its way; it arrives with the next beat of the gate.
    fn collect(&mut self, now: Seconds) {
        for out in self.facade.outs() {
            self.said.push((now, out.clone()));
            self.post.push(out);
        }
    }
    fn deliver(&mut self, now: Seconds) {
        for out in std::mem::take(&mut self.post) {
            match out {
                Out::AskLease(ask) => {
                    let granted = self.gate.lease(now, &ask);
                    self.facade.leased(now, granted);
                }
                // A lease that has ended already is no fault.
                Out::Release(release) => drop(self.gate.release(now, &release)),
                Out::Command(command) => drop(self.gate.obey(now, &command)),
                Out::Stop(stop) if !self.is_deaf => self.gate.stop(now, stop.id),
                Out::Enable(ticket, enable) => {
                    let enabled = self.gate.enable(now, &enable);
                    self.facade.enabled(now, ticket, enabled);
                }
                _ => {}
            }
        }
        self.collect(now);
    }
    /// Asks, without waiting for the answer.
    pub(crate) fn ask(&mut self, request: Request) -> Ticket {
        self.tickets += 1;
        let (now, bits) = (self.now(), self.tickets << 11);
        self.facade.ask(now, self.tickets, bits, request);
        self.collect(now);
        self.tickets
    }
    /// The answer to a request, if it was given.
    pub(crate) fn answer(&self, ticket: Ticket) -> Option<Result<Reply, Refusal>> {
        self.said.iter().find_map(|(_, out)| match out {
            Out::Answer(of, answer) if *of == ticket => Some(answer.clone()),
            _ => None,
        })
    }
    /// Asks, and waits for the answer.
    #[track_caller]
    pub(crate) fn asked(&mut self, request: Request) -> Result<Reply, Refusal> {
        let ticket = self.ask(request);
        self.run_until("an answer", |rig| rig.answer(ticket).is_some());
        self.answer(ticket).expect("it was found")
    }
    /// Asks for an operation, which must begin.
    #[track_caller]
    pub(crate) fn begins(&mut self, request: Request) -> TaskId {
        match self.asked(request) {
            Ok(Reply::Begun(id)) => id,
            other => panic!("no operation: {other:?}"),
        }
    }
    /// Asks for an operation and runs until it is over; the stage and the reason of its end.
    #[track_caller]
    pub(crate) fn ends(&mut self, request: Request) -> (DriveStage, Option<Refusal>) {
        let id = self.begins(request);
        self.run_until("the end of the operation", |rig| rig.end_of(id).is_some());
        self.end_of(id).expect("it was found")
    }
    /// Every stage that was said.
    pub(crate) fn stages(&self) -> Vec<(TaskId, DriveStage, Option<Refusal>)> {
        let stage = |(_, out): &(Seconds, Out)| match out {
            Out::Distance(DriveDistance { operation, stage, why, .. })
            | Out::Rotate(RotateDegrees { operation, stage, why, .. }) => {
                Some((operation.expect("a notification names its operation"), *stage, why.clone()))
            }
            _ => None,
        };
        self.said.iter().filter_map(stage).collect()
    }
    pub(crate) fn end_of(&self, id: TaskId) -> Option<(DriveStage, Option<Refusal>)> {
        let over = |stage| matches!(stage, DriveStage::Completed | DriveStage::Canceled);
        self.stages()
            .into_iter()
            .find(|(of, stage, _)| *of == id && over(*stage))
            .map(|(_, stage, why)| (stage, why))
    }
    /// Every command that was sent, and when.
    pub(crate) fn commands(&self) -> Vec<(Seconds, Command)> {
        let command = |(at, out): &(Seconds, Out)| match out {
            Out::Command(command) => Some((*at, *command)),
            _ => None,
        };
        self.said.iter().filter_map(command).collect()
    }
    pub(crate) fn is_at_rest(&self) -> bool {
        self.gate.motion() == Motion::Standing
    }
    pub(crate) fn has_given_back(&self) -> bool {
        self.gate.state(self.now()).holder.is_none()
    }
    pub(crate) fn truth(&self) -> NavigatorData {
        self.emulator.truth()
    }
    /// Somebody else takes the wheels and turns them, once.
    pub(crate) fn takes(&mut self, holder: &str, class: Class, speed: f64) -> Result<Lease, Refusal> {
        let ask = LeaseAsk { holder: holder.into(), class, period: Seconds(0.2) };
        let lease = self.gate.lease(self.now(), &ask)?;
        let speeds = Sides::new(MetresPerSecond(speed), MetresPerSecond(speed));
        let Lease { boot, epoch, .. } = lease;
        let dwm = Dwm::steady(speeds, Seconds(5.0)).expect("a movement");
        let command = Command { boot, epoch, seq: 1, echo: Tick::of(self.now()), ttl_ms: 60_000, dwm };
        self.gate.obey(self.now(), &command).expect("obeyed");
        Ok(lease)
    }
}

fn duty(power: f64) -> Duty {
    Duty::new(power).expect("within full power")
}
pub(crate) fn power(left: f64, right: f64) -> Request {
    Request::Power(SetDrivePower { left: duty(left), right: duty(right), hold: None })
}
pub(crate) fn holding(left: f64, right: f64, hold: f64) -> Request {
    Request::Power(SetDrivePower { left: duty(left), right: duty(right), hold: Some(Seconds(hold)) })
}
pub(crate) fn speed(left: f64, right: f64) -> Request {
    Request::Speed(SetDriveSpeed { left: MetresPerSecond(left), right: MetresPerSecond(right), hold: None })
}
pub(crate) fn distance(distance: f64, power: f64) -> Request {
    let (distance, power, stage) = (Metres(distance), duty(power), DriveStage::InitialRequest);
    Request::Distance(DriveDistance { distance, power, stage, operation: None, why: None })
}
pub(crate) fn rotate(degrees: f64, power: f64) -> Request {
    let (power, stage) = (duty(power), DriveStage::InitialRequest);
    Request::Rotate(RotateDegrees { degrees, power, stage, operation: None, why: None })
}
pub(crate) fn stop() -> Request {
    Request::Stop(StopDrive { by: "a test".into() })
}
pub(crate) fn enable(enable: bool, stop: Option<StopId>) -> Request {
    Request::Enable(EnableDrive { enable, stop })
}
