//! The computer of the corrector: source, navigator and corrector, and the life of a task as their processes live it.

use crate::course::Brief;
use crate::link::Link;
use crate::robot::{BOOT, ToRobot};
use crate::seat::{Running, Seat};
use axle_navigator::{Navigator, NavigatorParams};
use axle_schema::codec::encode;
use axle_schema::command::{Class, Command, GateState, Lease, LeaseAsk, Release};
use axle_schema::contract::{Seen, Step};
use axle_schema::meta::Meta;
use axle_schema::{EncodersData, InertialData, Refusal, Seconds, Tick};
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
    /// The corrector drives.
    Driving { corrector: Box<dyn Running>, lease: Lease, seq: u32 },
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
                let (holder, class) = (self.seat.name.to_owned(), Class::Corrector);
                let ask = LeaseAsk { holder, class, period: self.seat.period };
                down.send_surely(now, ToRobot::Lease(ask));
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
                        self.stage = Stage::Driving { corrector, lease, seq: 0 };
                        self.step(now, down);
                    }
                    Err(refusal) => self.stage = Stage::Over(Err(refusal)),
                }
            }
            Stage::Driving { .. } => self.step(now, down),
        }
    }

    /// One step of the corrector, one command.
    fn step(&mut self, now: Seconds, down: &mut Link<ToRobot>) {
        let Stage::Driving { corrector, lease, seq } = &mut self.stage else { return };
        let lost = |state: &GateState| {
            let fenced = *seq > 1 && state.epoch == lease.epoch && state.holder.is_none();
            let why = "the gate took the wheels back: commands came too late or not at all";
            fenced.then(|| Refusal::Fenced { why: why.into() })
        };
        let end = if let Some(lost) = self.state.as_ref().and_then(lost) {
            Err(lost)
        } else {
            match corrector.step(&self.seen) {
                Step::Done => Ok(()),
                Step::Fail(refusal) => Err(refusal),
                Step::Drive(dwm) => {
                    *seq += 1;
                    let echo = self.seen.encoders.map_or(lease.tick, |encoders| Tick::of(encoders.stamp));
                    #[allow(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "at most 1500"
                    )]
                    let ttl_ms = (self.seat.period.0 * 3000.0).clamp(150.0, 1500.0) as u16;
                    let Lease { boot, epoch, .. } = *lease;
                    let command = Command { boot, epoch, seq: *seq, echo, ttl_ms, dwm };
                    match encode(&command) {
                        Ok(bytes) => {
                            down.send(now, ToRobot::Command(bytes));
                            return;
                        }
                        Err(refusal) => Err(refusal),
                    }
                }
            }
        };
        let release = Release { boot: lease.boot, epoch: lease.epoch };
        down.send_surely(now, ToRobot::Release(release));
        self.stage = Stage::Over(end);
    }
}

/// Every measurement has a number, as it has on the mesh.
const fn meta(seq: u64) -> Meta {
    Meta { seq, source: BOOT, stamp: 0.0, cause: None }
}
