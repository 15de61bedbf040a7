//! Navigator: where the robot is.
//!
//! Hears `EncodersData` in the order of its stamps, says `NavigatorData` in the frame `odom` (REP-105): the pose,
//! the twist and the covariance at each reading (paper, section II: "simple integration or Kalman's filter"). The method
//! "ekf" hears a gyro, fixes and ranges too, in any order ([`Navigator::measure`]); [`Position`] has the pose in `map`.
//!
//! When something fails, the pose stays and is never made up: a reading that is old or not finite is dropped, and
//! after a restart of the robot or a reading that no wheel can have made the next motion counts from the new reading.
//! All are counted. Each method is one file; a new one is that file, a variant of [`Method`] and a line in `dead.rs`.

mod accelerated;
mod arc;
mod dead;
mod ekf;
mod half_turn;
mod measurement;
mod navigator;
mod params;
mod point_and_shoot;
mod reckoning;
mod silence;
mod ticks;

pub use axle_schema::event::{Event, Sensor, Side};
pub use axle_schema::{Position, Range};
pub use measurement::{Counts, Measurement};
pub use navigator::{Innovation, Navigator};
pub use params::{EkfParams, Method, NavigatorParams};
