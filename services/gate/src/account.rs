//! What the gate says of itself: its state, what of it is news, and how many commands it refused for which reason.

use crate::Gate;
use crate::gate::Permit;
use crate::wheels::at_rest;
use axle_schema::command::{BrakeCause, GateState, Motion, Reject};
use axle_schema::{Seconds, StopId, Tick};

/// What is news in the state of a gate: two headlines differ when the state should be published at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Headline {
    epoch: u32,
    held: bool,
    enabled: bool,
    stop: Option<StopId>,
    motion: Motion,
    cause: Option<BrakeCause>,
}

impl Gate {
    /// The gate's own account, as of its latest event.
    #[must_use]
    pub fn state(&self, now: Seconds) -> GateState {
        GateState {
            boot: self.boot,
            tick: Tick::of(now),
            epoch: self.epoch,
            holder: self.held.as_ref().map(|held| held.holder.clone()),
            enabled: self.permit == Permit::Enabled,
            stop: self.stop,
            stored: false,
            motion: self.motion(),
            cause: self.cause,
            wheels: self.wheels,
            accepted: self.accepted,
            rejected: self.rejected.clone(),
        }
    }

    /// What is news in the state, cheap enough for every beat.
    #[must_use]
    pub fn headline(&self) -> Headline {
        Headline {
            epoch: self.epoch,
            held: self.held.is_some(),
            enabled: self.permit == Permit::Enabled,
            stop: self.stop,
            motion: self.motion(),
            cause: self.cause,
        }
    }

    /// The number of the lease in force.
    #[must_use]
    pub fn leased(&self) -> Option<u32> {
        self.held.as_ref().map(|_| self.epoch)
    }

    /// What the wheels are doing.
    #[must_use]
    pub fn motion(&self) -> Motion {
        match &self.course {
            Some(_) => Motion::Driving,
            None if at_rest(self.wheels) => Motion::Standing,
            None => Motion::Braking,
        }
    }

    /// Counts commands that were larger than a command may be, and were not even read.
    pub fn oversized(&mut self, commands: u64) {
        if commands > 0 {
            self.count(Reject::Oversize, commands);
        }
    }

    /// Counts commands that were lost before they came to the gate, because a bounded queue was full.
    pub fn overflowed(&mut self, commands: u64) {
        if commands > 0 {
            self.count(Reject::Flood, commands);
        }
    }

    /// Counts a command that was obeyed or not.
    pub(crate) fn account(&mut self, verdict: Result<(), Reject>) -> Result<(), Reject> {
        match verdict {
            Ok(()) => self.accepted += 1,
            Err(reject) => self.count(reject, 1),
        }
        verdict
    }

    fn count(&mut self, reject: Reject, commands: u64) {
        let count = self.rejected.entry(reject).or_default();
        *count = count.saturating_add(commands);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::COMMANDS_PER_BEAT;
    use crate::rig::{Rig, drive};
    use axle_schema::command::Class;

    #[test]
    fn the_headline_changes_with_what_is_news_and_not_with_every_setpoint() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.0, 0.2, 0.1)).expect("obeyed");
        rig.beats(0.02);
        let before = rig.gate.headline();
        rig.beats(0.02);
        assert_eq!(rig.gate.headline(), before);
        rig.beats(0.2);
        assert_ne!(rig.gate.headline(), before, "the movement is over");
    }

    #[test]
    fn a_flood_is_counted_unread_until_the_next_beat() {
        let mut rig = Rig::enabled();
        for _ in 0..COMMANDS_PER_BEAT + 3 {
            rig.gate.command(rig.now, "", b"garbage").expect_err("garbage");
        }
        rig.gate.overflowed(4);
        let rejected = rig.gate.state(rig.now).rejected;
        assert_eq!(
            (rejected[&Reject::Malformed], rejected[&Reject::Flood]),
            (u64::from(COMMANDS_PER_BEAT), 7)
        );
        let lease = rig.lease("a", Class::Corrector);
        assert_eq!(rig.command(&lease, drive(0.0, 0.1, 0.1)), Err(Reject::Flood));
        rig.beats(0.005);
        assert_eq!(rig.command(&lease, drive(0.0, 0.1, 0.1)), Ok(()));
    }
}
