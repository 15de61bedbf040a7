//! Drive: the Generic Differential Drive contract, as a façade before the gate.
//!
//! *Hears* the requests of the contract, the gate's state and the encoders. *Says* the contract's notifications, its
//! state, and commands to the gate while somebody wants the robot to move. *Paper*: the Generic Differential Drive of
//! section II. *When it fails*: commands stop coming, and the gate brakes.
//!
//! [`Facade`] is a value in virtual time, generic over the corrector that closes the loop of a distance or a turn on
//! the encoders. What holds whatever is asked:
//!
//! * one operation at a time: a new motion request cancels the running one, and that is said before the new one starts;
//! * every operation that was started ends once, completed or cancelled;
//! * every request is answered once;
//! * the wheels are held only while somebody wants them to move; whoever falls silent for `hold` lets them brake;
//! * a stopped drive commands nothing until the gate is enabled again.
//!
//! Degrees and powers from -1 to 1 end here; what goes on to the gate is in SI units.

mod facade;
mod odometer;
mod params;
mod plan;
mod say;
mod wheel;

#[cfg(test)]
mod courses;
#[cfg(test)]
mod laws;
#[cfg(test)]
mod rig;

pub use facade::Facade;
pub use params::DriveParams;
pub use say::{Out, Reply, Request, Ticket};
pub use wheel::{Wheel, WheelGains};
