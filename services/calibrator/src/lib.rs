//! Calibrator: what a robot really does when it is told to drive, and what it must be told so that it does as described.
//!
//! *Hears*, as a functional service, speeds or signals. *Says* the signals that the motors need for those speeds, or the
//! speeds that those signals give. *Paper*: section II, where a calibrator stands between the gate and the board.
//! *When it fails*: it answers with a refusal; nothing that moves waits for it, since the owner of the wheels has a
//! [`Map`] of its own.
//!
//! How a calibration is measured is [`Procedure`]: a state machine in virtual time that asks for movements, hears what
//! the robot measures, and ends with a [`Calibration`](axle_schema::Calibration) and a [`Report`] with an interval of
//! 95 % for each of its numbers; where nothing on the robot can tell, it has a [`Question`] for a person. [`Watch`]
//! compares the same things while the robot does its work. [`response`] fits motors that accelerate otherwise, from
//! recordings.
//!
//! Nothing here talks to a robot: the gate is the only door to the wheels, and whoever runs the procedure commands it
//! as everybody does.

mod band;
mod by_hand;
mod geometry;
mod log;
mod map;
mod motion;
mod motor;
mod params;
mod procedure;
mod report;
pub mod response;

mod room;
mod service;
pub mod statistics;
mod watch;
mod wiring;

#[cfg(test)]
mod courses;
#[cfg(test)]
mod rig;

pub use by_hand::Question;
pub use map::Map;
pub use params::CalibratorParams;
pub use procedure::{Action, Procedure, Subject};
pub use report::{Plot, Quantity, Report, Square};
pub use room::Room;
pub use service::{ToSignals, ToSpeeds};
pub use watch::{Proposal, Watch};
