//! The wheels in a corrector's hands: from the gate's grant until they are given back or lost.
//!
//! The process of a corrector and its twin in the simulator share this part, so that a task lives the same life in
//! both. It knows neither queues nor clocks: what the gate says and the time of the beat are arguments.
//!
//! *Losing and regaining.* Two lost commands in a row are silence to the gate: it brakes and ends the lease, rightly.
//! The plan is still good, though, and a task that ends for it would leave a robot in the aisle for a hiccup of the
//! network. So the wheels are asked for again, a few times in a task, if nobody else wants them, nobody has stopped the
//! robot, and this corrector itself has never been late: one that has been frozen knows too little of the world to go
//! on. A longer outage never comes that far, since measurements are silent then too, and the task fails by that.

use axle_schema::command::{BrakeCause, Command, GateState, Lease};
use axle_schema::contract::Seen;
use axle_schema::{Dwm, Refusal, Seconds, Tick};

/// How often the wheels are regained in one task.
const REGAINS: u8 = 5;
/// Who has been away from their own beats for this long does not go on by themselves.
const AWAY: Seconds = Seconds(0.3);
/// How long the gate has to give them back: a robot that stands for longer is not brought to move by itself.
pub const REGAIN_PATIENCE: Seconds = Seconds(1.0);
/// A command lives for so many periods, within bounds: the gate brakes sooner, by silence.
const LIFE: (f64, f64, f64) = (3.0, 0.15, 1.5);

/// What the gate's account means for whoever holds the wheels.
#[derive(Clone, Debug, PartialEq)]
pub enum Hold {
    /// They are held.
    Held,
    /// They were taken back because commands had been lost, and may be asked for again.
    Slipped,
    /// They are lost, with the reason.
    Lost(Refusal),
}

/// A lease in use.
#[derive(Clone, Debug)]
pub struct Tenure {
    lease: Lease,
    period: Seconds,
    seq: u32,
    /// How often the wheels have been regained.
    regained: u8,
    /// The latest beat, and the longest time between two of them.
    beat: Seconds,
    away: Seconds,
    /// Since when the wheels are not held.
    slipped: Option<Seconds>,
}

impl Tenure {
    /// Begins at the beat `at`; `period` is the time from beat to beat.
    #[must_use]
    pub const fn new(lease: Lease, period: Seconds, at: Seconds) -> Self {
        Self { lease, period, seq: 0, regained: 0, beat: at, away: Seconds::ZERO, slipped: None }
    }

    /// The lease that is used.
    #[must_use]
    pub const fn lease(&self) -> &Lease {
        &self.lease
    }

    /// Whether nothing has been commanded yet, under this lease or an earlier one.
    #[must_use]
    pub const fn is_fresh(&self) -> bool {
        self.seq == 0 && self.regained == 0
    }

    /// Looks at the gate's newest account, at the beat `at`.
    pub fn look(&mut self, state: Option<&GateState>, at: Seconds) -> Hold {
        self.away = self.away.max(at - self.beat);
        self.beat = at;
        let Some(refusal) = state.and_then(|state| self.lost(state)) else { return Hold::Held };
        let by_loss = state.is_some_and(|state| {
            let silent = matches!(state.cause, Some(BrakeCause::Silence | BrakeCause::Expired));
            state.boot == self.lease.boot && state.epoch == self.lease.epoch && state.enabled && silent
        });
        if !by_loss || self.regained == REGAINS || self.away >= AWAY {
            return Hold::Lost(refusal);
        }
        self.slipped = Some(at);
        Hold::Slipped
    }

    /// Whether the gate may still be waited for, at the beat `at`.
    ///
    /// # Errors
    /// It has had its time; the task is over.
    pub fn wait(&self, at: Seconds) -> Result<(), Refusal> {
        if self.slipped.is_none_or(|since| at - since <= REGAIN_PATIENCE) {
            return Ok(());
        }
        let why = format!(
            "the gate took the wheels back, since commands came too late or not at all, and could not be asked for \
             them within {REGAIN_PATIENCE}; look with `axle doctor` whether the robot is reached"
        );
        Err(Refusal::Fenced { why })
    }

    /// Goes on with another lease, granted at the beat `at`; says for how long nobody was obeyed.
    pub fn regain(&mut self, lease: Lease, at: Seconds) -> Seconds {
        self.regained += 1;
        (self.lease, self.seq, self.beat) = (lease, 0, at);
        self.slipped.take().map_or(Seconds::ZERO, |since| at - since)
    }

    /// The next command: a movement, and by what its sender saw.
    pub fn command(&mut self, seen: &Seen, dwm: Dwm) -> Command {
        self.seq += 1;
        command(&self.lease, self.seq, self.period, seen, dwm)
    }

    fn lost(&self, state: &GateState) -> Option<Refusal> {
        lost(state, &self.lease, self.seq)
    }
}

/// Why the gate no longer obeys a lease under which `seq` commands have been sent, if so.
#[must_use]
pub fn lost(state: &GateState, lease: &Lease, seq: u32) -> Option<Refusal> {
    if state.boot != lease.boot {
        return Some(Refusal::Fenced { why: "the robot process has restarted; give the task again".into() });
    }
    if state.epoch > lease.epoch {
        let holder = state.holder.clone().unwrap_or_else(|| "nobody".into());
        return Some(Refusal::Fenced { why: format!("{holder} has taken the wheels") });
    }
    if !state.enabled {
        let why = match state.stop {
            Some(stop) => format!("stopped by AllStop {stop}; `axle enable` allows it to move again"),
            None => "it has not been enabled since boot; `axle enable` allows it to move".into(),
        };
        return Some(Refusal::Disabled { why });
    }
    // The state of before the first command may still be on its way.
    (seq > 1 && state.epoch == lease.epoch && state.holder.is_none()).then(|| Refusal::Fenced {
        why: format!(
            "the gate took the wheels back{}: commands came too late or not at all; `axle doctor` looks at the link",
            state.cause.map_or_else(String::new, |cause| format!(" ({cause:?})"))
        ),
    })
}

/// The command of a beat. Of the lease only its names and the tick of its grant are used.
#[must_use]
pub fn command(lease: &Lease, seq: u32, period: Seconds, seen: &Seen, dwm: Dwm) -> Command {
    let &Lease { boot, epoch, tick, .. } = lease;
    let echo = seen.encoders.map_or(tick, |encoders| Tick::of(encoders.stamp));
    let (periods, least, most) = LIFE;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "150 to 1500")]
    let ttl_ms = ((period.0 * periods).clamp(least, most) * 1000.0).round() as u16;
    Command { boot, epoch, seq, echo, ttl_ms, dwm }
}

#[cfg(test)]
mod tests;
