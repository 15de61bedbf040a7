//! Correctors: the services that keep a robot on its plan.
//!
//! A corrector is a continuous service (paper, sections II and III): it takes a task, and at every beat looks at what
//! the robot has measured and says the movement of the wheels until the next beat. One file each:
//!
//! * [`d`]: the D-corrector follows the distances of both wheels that a drive asks for (paper, III.A);
//! * [`g`]: the G-corrector keeps the ratio of the wheels over a distance (paper, III.B);
//! * [`w`]: the W-corrector follows a vector field (paper, III.C);
//! * [`arc`]: the arc-corrector drives arcs to targets, as the warehouse robot did;
//! * [`pursuit`] and [`ltv`]: regulated pure pursuit and a linear time-varying regulator, yardsticks from outside.
//!
//! What they share is the contract, [`axle_schema::contract::Corrector`], and its rules: `seen.at` is the only clock
//! of the beats, the stamps of the measurements are the only clock of the robot; the wheels are commanded within the
//! limits of the robot; a task ends with a command to rest, or fails with a reason. The parts that several of them are
//! made of are modules of their own: `newest.rs` for what is believed of measurements, `wheels.rs` for limits and
//! memory, `friction.rs` and `grain.rs` for what poor motors and encoders cannot do, `finish.rs` and `manners.rs` for endings, `path.rs` and `route.rs` for plans, `follow.rs` for all that steer by the pose.

pub mod arc;
mod body;
pub mod d;
mod due;
mod finish;
mod follow;
mod friction;
pub mod g;
mod grain;
pub mod ltv;
mod manners;
mod newest;
mod path;
pub mod pursuit;
mod route;
mod stall;
pub mod tenure;
pub mod w;
mod wheels;

pub use arc::{ArcCorrector, ArcParams};
pub use d::{DCorrector, DParams};
pub use finish::Finish;
pub use g::{GCorrector, GParams};
pub use ltv::{LtvCorrector, LtvParams};
pub use newest::Watch;
pub use pursuit::{PursuitCorrector, PursuitParams};
pub use w::{WCorrector, WParams};
