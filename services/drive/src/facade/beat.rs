//! The beat of the façade: what the wheels are told, whether they are still ours, and the Update notification.

use super::{Activity, Facade, GATE_SILENCE, Grip, STOP_PATIENCE};
use crate::plan::toward;
use crate::say::Out;
use axle_schema::command::{BrakeCause, Command, GateState, Lease, Motion, Release};
use axle_schema::contract::{Corrector, Seen, Step};
use axle_schema::differential_drive::{DriveOperation, DriveStage, DriveState, WheelState};
use axle_schema::{
    Drive, Duty, Dwm, Metres, MetresPerSecond, Refusal, Seconds, Sides, StopId, Task, TaskId, Tick,
};

/// The state is said at least this often, and so often at most while only the wheels change.
const UPDATES: (Seconds, Seconds) = (Seconds(1.0), Seconds(0.1));

/// Changes that follow each other faster are said with the next beat, so that a flood of requests is none of updates.
const FASTEST: Seconds = Seconds(0.01);

/// What is news in the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Headline {
    enabled: bool,
    stop: Option<StopId>,
    operation: DriveOperation,
    motion: Motion,
    cause: Option<BrakeCause>,
    target: Sides<MetresPerSecond>,
}

impl<C: Corrector<Plan = Drive>> Facade<C> {
    /// One beat: says the next command while somebody wants the robot to move, and what has become news.
    pub fn beat(&mut self, now: Seconds) {
        if !self.is_young(now) {
            self.ask_early(now);
        }
        self.repeat_stop(now);
        self.let_go_if_lost(now);
        self.drive(now);
        self.say_state(now);
    }

    /// Ends what is going on, and gives the wheels back: the process around it ends.
    pub fn leave(&mut self, why: Refusal) {
        self.refuse_waiting(&why);
        self.cancel(Some(why));
        if let Grip::Held { lease, .. } = self.grip {
            self.outs.push(Out::Release(Release { boot: lease.boot, epoch: lease.epoch }));
            self.lose_grip();
        }
    }

    /// Repeats a stop until the gate acknowledges it, or patience is over.
    fn repeat_stop(&mut self, now: Seconds) {
        let Some(stopping) = &self.stopping else { return };
        if now - stopping.since <= STOP_PATIENCE {
            self.outs.push(Out::Stop(stopping.order.clone()));
            return;
        }
        let hint = "the gate did not acknowledge the stop within 2 s; the robot may still move";
        for (ticket, _) in self.stopping.take().map(|stopping| stopping.tickets).unwrap_or_default() {
            self.outs.push(Out::Answer(ticket, Err(Refusal::unavailable("the drive's gate", hint))));
        }
    }

    /// Ends what is going on when the wheels are not ours any more, or when nobody knows what they do.
    pub(super) fn let_go_if_lost(&mut self, now: Seconds) {
        let Grip::Held { lease, since, .. } = self.grip else { return };
        let silent = self.odometer.age(now).unwrap_or(now).min(now - since);
        let why = match &self.gate {
            Some((state, _)) if lost(state, &lease).is_some() => lost(state, &lease),
            Some((_, at)) if now - at.max(since) <= GATE_SILENCE => None,
            _ => Some(Refusal::Failed { why: "the gate says nothing any more".into() }),
        };
        let why = why.or_else(|| {
            let why = format!("no measurement for {silent:.2}, the robot or the link is silent");
            (silent > self.params.silence).then_some(Refusal::Failed { why })
        });
        if why.is_some() {
            self.outs.push(Out::Release(Release { boot: lease.boot, epoch: lease.epoch }));
            self.cancel(why);
            self.lose_grip();
        }
    }

    /// The next command, as long as we hold the wheels; the lease goes back when they are at rest and nobody wants more.
    fn drive(&mut self, now: Seconds) {
        let Grip::Held { lease, .. } = self.grip else { return };
        let (rest, robot) = (Sides::default(), self.params.robot);
        if let Activity::Speeds { until, .. } = self.activity
            && now >= until
        {
            self.activity = Activity::Idle;
        }
        let (target, rate) = match &self.activity {
            Activity::Speeds { target, .. } => (*target, robot.wheel_acceleration),
            Activity::Idle if self.commanded == rest => {
                self.outs.push(Out::Release(Release { boot: lease.boot, epoch: lease.epoch }));
                self.lose_grip();
                return;
            }
            Activity::Operation { .. } if self.commanded == rest || self.is_corrected() => {
                return self.correct(now);
            }
            // An operation begins from rest, so that it counts from where the robot stands.
            Activity::Idle | Activity::Operation { .. } => (rest, self.params.braking),
        };
        let next = toward(self.commanded, target, rate * self.params.period);
        match Dwm::new(self.commanded, next, self.params.period) {
            Ok(dwm) => self.command(dwm),
            Err(refusal) => self.cancel(Some(refusal)),
        }
    }

    fn is_corrected(&self) -> bool {
        matches!(&self.activity, Activity::Operation { corrector: Some(_), .. })
    }

    /// One step of the operation.
    fn correct(&mut self, now: Seconds) {
        let Activity::Operation { stages, drive, corrector } = &mut self.activity else { return };
        let seen = Seen { at: now, encoders: self.odometer.newest(), ..Seen::default() };
        let step = match corrector {
            Some(corrector) => corrector.step(&seen),
            None => {
                let task = Task { id: TaskId::default(), plan: std::mem::take(drive) };
                match C::begin(&self.corrector, self.params.period, task, &seen) {
                    Ok(begun) => corrector.insert(Box::new(begun)).step(&seen),
                    Err(refusal) => Step::Fail(refusal),
                }
            }
        };
        match step {
            Step::Drive(dwm) => self.command(dwm),
            Step::Done => {
                self.outs.push(stages.reach(DriveStage::Completed, None));
                self.activity = Activity::Idle;
            }
            Step::Fail(refusal) => self.cancel(Some(refusal)),
        }
    }

    fn command(&mut self, dwm: Dwm) {
        let Grip::Held { lease, seq, .. } = &mut self.grip else { return };
        *seq += 1;
        let newest = self.odometer.newest().map(|reading| Tick::of(reading.stamp));
        let echo = newest.filter(|tick| tick.since(lease.tick) > 0).unwrap_or(lease.tick);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 0.6 s")]
        let ttl_ms = (self.params.period.0 * 3000.0).clamp(150.0, 1500.0) as u16;
        let Lease { boot, epoch, .. } = *lease;
        self.outs.push(Out::Command(Command { boot, epoch, seq: *seq, echo, ttl_ms, dwm }));
        self.commanded = dwm.end();
    }

    /// The state of the contract.
    ///
    /// # Errors
    /// [`Refusal::Unavailable`] while the gate says nothing.
    pub(super) fn state(&self, now: Seconds) -> Result<DriveState, Refusal> {
        let gate = self.heard_gate(now)?;
        let full = self.params.full_speed();
        let power = |speed: MetresPerSecond| Duty::new((speed / full).clamp(-1.0, 1.0)).unwrap_or_default();
        let distances = self.odometer.distances();
        let measured = self.odometer.speeds().zip(distances, |speed, distance| (speed, distance));
        let Headline { enabled, stop, operation, motion, cause, .. } = self.headline(gate);
        Ok(DriveState {
            stamp: self
                .odometer
                .newest()
                .map_or(Seconds(f64::from(gate.tick.0) / 1000.0), |reading| reading.stamp),
            enabled,
            stop,
            operation,
            motion,
            cause,
            wheels: self.commanded.zip(measured, |commanded, (speed, distance)| WheelState {
                power: power(commanded),
                speed,
                distance,
            }),
            track: Metres(self.params.robot.track.get()),
            full_speed: full,
        })
    }

    fn headline(&self, gate: &GateState) -> Headline {
        let (operation, target) = match &self.activity {
            Activity::Idle => (DriveOperation::Idle, Sides::default()),
            Activity::Speeds { operation, target, .. } => (*operation, *target),
            Activity::Operation { stages, .. } => (stages.operation(), Sides::default()),
        };
        Headline {
            enabled: gate.enabled && self.stopping.is_none(),
            stop: gate.stop,
            operation,
            motion: gate.motion,
            cause: gate.cause,
            target,
        }
    }

    /// Update: on change and once a second, and while the robot moves ten times a second.
    pub(super) fn say_state(&mut self, now: Seconds) {
        let Some((gate, _)) = &self.gate else { return };
        let headline = self.headline(gate);
        let is_moving = headline.motion != Motion::Standing || matches!(self.grip, Grip::Held { .. });
        let pause = if is_moving { UPDATES.1 } else { UPDATES.0 };
        let is_news =
            self.said.is_none_or(|(said, at)| (said != headline && now - at >= FASTEST) || now - at >= pause);
        if is_news && let Ok(state) = self.state(now) {
            self.said = Some((headline, now));
            self.outs.push(Out::Update(Box::new(state)));
        }
    }
}

/// Why the gate does not obey this lease any more, if so. What it said before the grant is not about this lease.
fn lost(state: &GateState, lease: &Lease) -> Option<Refusal> {
    if state.boot != lease.boot {
        return Some(Refusal::Fenced { why: "the robot process has restarted".into() });
    }
    if state.tick.since(lease.tick) < 0 {
        return None;
    }
    if !state.enabled {
        let why = match state.stop {
            Some(stop) => format!("it was stopped by AllStop {stop}"),
            None => "the robot process disabled it".to_owned(),
        };
        return Some(Refusal::Disabled { why });
    }
    if state.epoch > lease.epoch {
        let holder = state.holder.clone().unwrap_or_else(|| "nobody".into());
        return Some(Refusal::Fenced { why: format!("{holder} has taken the wheels") });
    }
    let ended = state.epoch == lease.epoch && state.holder.is_none();
    ended.then(|| Refusal::Fenced {
        why: format!(
            "the gate took the wheels back ({:?}): commands came too late or not at all",
            state.cause
        ),
    })
}
