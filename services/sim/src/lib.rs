//! Simulator: services in virtual time, and their tournament.
//!
//! *Hears* nothing and *says* nothing: it is called. It joins the real gate, source, navigator, planners and correctors
//! with the emulated robot, over links with modelled delay, jitter, loss and outages, and lets time go by as fast as it
//! can be computed. Nothing in it is a copy of a service: what drives here drives in the mesh.
//! *Paper*: the "thorough statistical comparison" of the correctors that it announces.
//! *When it fails*: a run that cannot begin is a `Refusal`; a robot that does not arrive is a result.
//!
//! A run is a value: the same corrector, course, scenario and seed give the same bits, on whichever thread. The seed of
//! a run does not depend on the corrector, so that all correctors meet the same accidents, and are compared pair by pair.
//!
//! Extension: a course is a line in [`COURSES`], a scenario one in [`SCENARIOS`], a corrector one in [`seats()`].

mod course;
mod host;
mod link;
mod metrics;
mod robot;
mod run;
mod scenario;
mod seat;
mod statistics;
mod tournament;
mod tune;

#[cfg(test)]
mod fleet;
#[cfg(test)]
mod laws;
#[cfg(test)]
mod plans;
#[cfg(test)]
mod profiles;

pub use course::{Brief, COURSES, Course};
pub use link::{Link, LinkParams};
pub use metrics::{METRICS, Metric};
pub use run::{Ending, Run, run, sights};
pub use scenario::{SCENARIOS, Scenario, TRIALS, World};
pub use seat::{Knob, Running, Seat, Told, seats};
pub use statistics::Interval;
pub use tournament::{ALL, Estimate, Row, Tournament};
pub use tune::{EVALUATIONS, cost, minimise};
