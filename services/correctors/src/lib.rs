//! Correctors: the services that keep a robot on its plan.
//!
//! A corrector is a continuous service (paper, sections II and III): it takes a task, and at every beat looks at what
//! the robot has measured and says the movement of the wheels until the next beat. One file each:
//!
//! * [`d`]: the D-corrector follows the distances of both wheels that a drive asks for (paper, III.A).
//!
//! What they share is the contract, [`axle_schema::contract::Corrector`], and its rules: `seen.at` is the only clock
//! of the beats, the stamps of the measurements are the only clock of the robot; the wheels are commanded within the
//! limits of the robot; a task ends with a command to rest, or fails with a reason.

pub mod d;
mod due;

pub use d::{DCorrector, DParams};
