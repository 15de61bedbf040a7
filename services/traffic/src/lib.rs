//! Traffic: robots of a fleet neither meet nor wait for each other for ever.
//!
//! Hears [`Claim`](axle_schema::traffic::Claim) (where a robot is and what it wants to drive), says
//! [`Clearance`](axle_schema::traffic::Clearance) (how far it may drive, or whom it waits for) and, to whoever asks,
//! [`TrafficState`](axle_schema::traffic::TrafficState) (who waits for whom, and the order). Beyond the paper: its
//! services drive one robot.
//!
//! *No collision.* A way is cut into pieces, and each takes the squares of the floor that the robot can touch on it.
//! A robot holds the piece that it has last passed and all that it may drive; no square is held by two.
//!
//! *No deadlock.* A piece is given only if afterwards every robot that could end its task before still can, one robot
//! after the other, all others standing where they then hold their pieces: the banker's algorithm, with places where a
//! robot is in nobody's way as intermediate ends. The order that proves it (`order.rs`) is stated.
//!
//! *No starving.* Tasks have numbers as they come; a piece that an older, waiting robot wants next goes to no younger
//! one, unless the older one waits for just this younger one.
//!
//! *When it fails:* a robot that falls silent holds what it holds; nobody drives into it. Traffic keeps nothing on
//! disk: after a restart it knows no robot, refuses their claims as unknown, and they tell their ways anew, each with
//! what it was given. It trusts what robots say of themselves, and it is no safety device: a robot that is pushed from
//! its way, or that does not ask, is not seen.

mod escort;
mod fleet;
mod order;
mod params;
mod piece;

#[cfg(test)]
mod laws;

pub use escort::Escort;
pub use fleet::Fleet;
pub use params::TrafficParams;
pub use piece::{aim, cut, join, pieces};
