//! The method "arc": between two encoder readings each wheel runs at a constant speed, so that the robot drives an arc.
//!
//! The pose is exact under that assumption (model.md 1.3 and 5).

use crate::reckoning::Step;
use axle_schema::motion;

/// The displacement along the arc.
pub(crate) const STEP: Step = motion::arc;
