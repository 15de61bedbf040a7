//! Correctors on whole courses, in virtual time, with a small robot: delays, ticks, wrong gains, noise.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by a panic")]
#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "small numbers")]

mod d;
mod every;
mod hostile;
mod plant;
