//! The method "half-turn": half of the turn, straight on, and the other half (Brown, as Lucas reports it).
//!
//! Its direction is that of the arc; its length is too long by about `1 + θ²/24` for a turn of θ in a span
//! (model.md 5). For small turns nothing is wrong with it.

use crate::reckoning::Step;
use axle_schema::motion;

/// The displacement as if the robot had gone straight in the middle of its turn.
pub(crate) const STEP: Step = motion::half_turn;
