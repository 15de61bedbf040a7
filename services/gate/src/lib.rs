//! Gate: the one door to the wheels.
//!
//! *Hears* leases asked and given back, commands, AllStop, enable, and the beat of the process that owns the board.
//! *Says* at every beat which speeds the wheels shall have, and on change and once a second its [`GateState`].
//! *Paper*: the Generic Differential Drive of section II, with what a network between corrector and wheels demands.
//! *When it fails*: it lives in the process that owns the board, so its death is that process's death, and the watchdog
//! of the board stops the wheels.
//!
//! The gate is a value: it does no I/O, owns no thread and reads no clock. `now` is the robot's monotonic clock in
//! seconds since its boot, and the only clock that counts. What holds whatever happens outside:
//!
//! * one holder at a time: every grant has a new epoch, and commands of older epochs are fenced;
//! * a command proves by its echo of the robot's own clock that it is younger than `max_age`;
//! * a grant moves nothing: until its first command the wheels brake or rest, for as long as that may take;
//! * silence, the end of a movement, a lost lease and AllStop all end in the same bounded braking to standstill;
//! * no setpoint differs from the one before by more than the acceleration limit allows, and, where it is set, the
//!   jerk limit;
//! * AllStop latches, and only an [`Enable`] that quotes it lets wheels move again; nothing restarts by itself then.
//!
//! AllStop is an operational stop, not a certified emergency stop.
//!
//! [`GateState`]: axle_schema::command::GateState
//! [`Enable`]: axle_schema::command::Enable

mod account;
mod authority;
mod check;
mod event;
mod gate;
mod jerk;
mod params;
mod wheels;

#[cfg(test)]
mod interleavings;
#[cfg(test)]
mod laws;
#[cfg(test)]
mod rig;

pub use account::Headline;
pub use event::{Event, Outcome};
pub use gate::{COMMANDS_PER_BEAT, Gate, MAX_BEAT};
pub use params::GateParams;
