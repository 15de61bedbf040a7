//! Everything that can happen to a gate as one type, for histories, simulators and exhaustive tests.

use crate::Gate;
use axle_schema::command::{Command, Enable, Lease, LeaseAsk, Reject, Release};
use axle_schema::{MetresPerSecond, Refusal, Seconds, Sides, StopId};

/// Something that happens to the gate.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Somebody asks for the wheels.
    Lease(LeaseAsk),
    /// Somebody gives them back.
    Release(Release),
    /// Bytes arrive at the key of commands.
    Bytes(Vec<u8>),
    /// A command arrives that is decoded already.
    Command(Command),
    /// An AllStop arrives.
    Stop(StopId),
    /// An enable arrives.
    Enable(Enable),
    /// The process that owns the board disables the drive.
    Disable,
    /// The board wants its next setpoint.
    Beat,
}

/// What the gate answers to an [`Event`].
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The wheels are leased.
    Granted(Lease),
    /// It is done, or obeyed.
    Done,
    /// A command is not obeyed.
    Rejected(Reject),
    /// A lease, release or enable is refused.
    Refused(Refusal),
    /// The setpoint of the wheels.
    Wheels(Sides<MetresPerSecond>),
}

impl Gate {
    /// One step of the state machine: the methods of [`Gate`] behind one door.
    pub fn step(&mut self, now: Seconds, event: &Event) -> Outcome {
        match event {
            Event::Lease(ask) => self.lease(now, ask).map_or_else(Outcome::Refused, Outcome::Granted),
            Event::Release(release) => done(self.release(now, release)),
            Event::Bytes(bytes) => obeyed(self.command(now, "", bytes)),
            Event::Command(command) => obeyed(self.obey(now, command)),
            Event::Stop(id) => {
                self.stop(now, *id);
                Outcome::Done
            }
            Event::Enable(enable) => done(self.enable(now, enable)),
            Event::Disable => {
                self.disable(now);
                Outcome::Done
            }
            Event::Beat => Outcome::Wheels(self.beat(now)),
        }
    }
}

fn done(result: Result<(), Refusal>) -> Outcome {
    result.map_or_else(Outcome::Refused, |()| Outcome::Done)
}

fn obeyed(result: Result<(), Reject>) -> Outcome {
    result.map_or_else(Outcome::Rejected, |()| Outcome::Done)
}
