//! The method "point-and-shoot": first the whole turn, then straight on (Lucas, equation 6).
//!
//! It misses by about half the turn of every span (model.md 5), and is there to be compared with.

use crate::reckoning::Step;
use axle_schema::motion;

/// The displacement as if the robot had turned on the spot first.
pub(crate) const STEP: Step = motion::point_and_shoot;
