//! The computer of the corrector: source, navigator and corrector, and the life of a task as their processes live it.

use crate::course::Brief;
use crate::link::Link;
use crate::robot::{BOOT, ToRobot};
use crate::seat::{Running, Seat};
use axle_correctors::tenure::{Hold, Tenure};
use axle_navigator::{Navigator, NavigatorParams};
use axle_schema::codec::encode;
use axle_schema::command::{Class, GateState, Lease, LeaseAsk, Release};
use axle_schema::contract::{Seen, Step};
use axle_schema::meta::Meta;
use axle_schema::{EncodersData, InertialData, Refusal, Seconds};
use axle_source::{Source, SourceParams};

/// What is said to the host.
#[derive(Clone, Debug)]
pub(crate) enum ToHost {
    /// The answer to the question for the wheels.
    Lease(Result<Lease, Refusal>),
    /// The gate's account.
    State(Box<GateState>),
    /// Wheel distances.
    Encoders(EncodersData),
    /// Turn rate and accelerations.
    Inertial(InertialData),
}

/// How a task stands.
pub(crate) enum Stage {
    /// Waits for the first measurement.
    Idle,
    /// The gate is asked for the wheels.
    Asking,
    /// The corrector drives; or the wheels have slipped, and the gate is asked for them again.
    Driving { corrector: Box<dyn Running>, tenure: Tenure, asked: bool },
    /// It is over.
    Over(Result<(), Refusal>),
}

/// The host.
pub(crate) struct Host<'a> {
    seat: &'a Seat,
    brief: &'a Brief,
    source: Source,
    recent: Seconds,
    navigator: Navigator,
    seen: Seen,
    state: Option<GateState>,
    counts: (u64, u64),
    granted: Option<Result<Lease, Refusal>>,
    pub(crate) stage: Stage,
}

impl<'a> Host<'a> {
    pub(crate) fn new(seat: &'a Seat, brief: &'a Brief) -> Result<Self, Refusal> {
        let source = SourceParams::default();
        Ok(Self {
            seat,
            brief,
            source: Source::new(&source)?,
            recent: source.recent,
            navigator: Navigator::new(NavigatorParams {
                start: brief.plan.start,
                ..NavigatorParams::default()
            })?,
            seen: Seen::default(),
            state: None,
            counts: (0, 0),
            granted: None,
            stage: Stage::Idle,
        })
    }

    /// Gives the host another task; the robot stands, and is known to be where it is.
    #[cfg(test)]
    pub(crate) fn again(&mut self, brief: &'a Brief) {
        (self.brief, self.granted, self.stage) = (brief, None, Stage::Idle);
    }

    /// What the corrector is shown.
    pub(crate) const fn seen(&self) -> &Seen {
        &self.seen
    }

    /// Where the robot is believed to be.
    #[cfg(test)]
    pub(crate) fn pose(&self) -> Option<axle_schema::NavigatorData> {
        self.seen.pose
    }

    /// Hears what has arrived: source and navigator act at once, the corrector at its beat.
    pub(crate) fn hear(&mut self, now: Seconds, up: &mut Link<ToHost>) {
        while let Some(heard) = up.receive(now) {
            match heard {
                ToHost::Lease(answer) => self.granted = Some(answer),
                ToHost::State(state) => self.state = Some(*state),
                ToHost::Inertial(datum) => {
                    self.counts.0 += 1;
                    self.source.take_inertial(Some(meta(self.counts.0)), datum);
                }
                ToHost::Encoders(datum) => {
                    self.counts.1 += 1;
                    self.source.take_encoders(Some(meta(self.counts.1)), datum);
                    let window = self.source.recent(self.recent);
                    self.seen.encoders = window.encoders.last().copied().or(self.seen.encoders);
                    self.seen.inertial = window.inertial.last().copied().or(self.seen.inertial);
                    let poses = window.encoders.into_iter().filter_map(|datum| self.navigator.take(datum));
                    self.seen.pose = poses.last().or(self.seen.pose);
                }
            }
        }
    }

    /// One beat of the corrector; `at` is the clock of the host.
    pub(crate) fn beat(&mut self, now: Seconds, at: Seconds, down: &mut Link<ToRobot>) {
        self.seen.at = at;
        match &mut self.stage {
            Stage::Idle if self.seen.pose.is_some() => {
                self.ask_for_lease(now, down);
                self.stage = Stage::Asking;
            }
            Stage::Idle | Stage::Over(_) => {}
            Stage::Asking => {
                let Some(granted) = self.granted.take() else { return };
                // What the gate said before the grant is not about this lease.
                self.state = None;
                let begun = granted.and_then(|lease| Ok((lease, self.seat.begin(self.brief, &self.seen)?)));
                match begun {
                    Ok((lease, corrector)) => {
                        let tenure = Tenure::new(lease, self.seat.period, at);
                        self.stage = Stage::Driving { corrector, tenure, asked: false };
                        self.step(now, down);
                    }
                    Err(refusal) => self.stage = Stage::Over(Err(refusal)),
                }
            }
            Stage::Driving { .. } => self.step(now, down),
        }
    }

    fn ask_for_lease(&self, now: Seconds, down: &mut Link<ToRobot>) {
        let (holder, class) = (self.seat.name.to_owned(), Class::Corrector);
        down.send_surely(now, ToRobot::Lease(LeaseAsk { holder, class, period: self.seat.period }));
    }

    /// One step of the corrector, one command.
    fn step(&mut self, now: Seconds, down: &mut Link<ToRobot>) {
        let Stage::Driving { corrector, tenure, asked } = &mut self.stage else { return };
        let at = self.seen.at;
        if *asked {
            match self.granted.take() {
                None => match tenure.wait(at) {
                    Ok(()) => return,
                    Err(refusal) => return self.end(now, Err(refusal), down),
                },
                Some(Ok(lease)) => {
                    (*asked, self.state) = (false, None);
                    let pause = tenure.regain(lease, at);
                    corrector.resume(&self.seen, pause);
                }
                Some(Err(refusal)) => return self.end(now, Err(refusal), down),
            }
        }
        match tenure.look(self.state.as_ref(), at) {
            Hold::Held => {}
            Hold::Slipped => {
                *asked = true;
                return self.ask_for_lease(now, down);
            }
            Hold::Lost(refusal) => return self.end(now, Err(refusal), down),
        }
        match corrector.step(&self.seen) {
            Step::Done => self.end(now, Ok(()), down),
            Step::Fail(refusal) => self.end(now, Err(refusal), down),
            Step::Drive(dwm) => match encode(&tenure.command(&self.seen, dwm)) {
                Ok(bytes) => down.send(now, ToRobot::Command(bytes)),
                Err(refusal) => self.end(now, Err(refusal), down),
            },
        }
    }

    /// Ends the task, and gives the wheels back.
    fn end(&mut self, now: Seconds, how: Result<(), Refusal>, down: &mut Link<ToRobot>) {
        if let Stage::Driving { tenure, .. } = std::mem::replace(&mut self.stage, Stage::Over(how)) {
            let &Lease { boot, epoch, .. } = tenure.lease();
            down.send_surely(now, ToRobot::Release(Release { boot, epoch }));
        }
    }
}

/// Every measurement has a number, as it has on the mesh.
const fn meta(seq: u64) -> Meta {
    Meta { seq, source: BOOT, stamp: 0.0, cause: None }
}
