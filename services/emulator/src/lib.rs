//! Emulator: a robot in software.
//!
//! *Hears* the speeds that the gate asks of the wheels. *Says* what encoders and a gyroscope measure, and, as no real
//! robot can, where it truly is.
//! *Paper*: part II, where correctors are tried on a simulated robot before a real one.
//! *When it fails*: as a real robot does: its sensors fall silent, and everybody brakes.
//!
//! What it shows honestly: wheels that drive a constant share faster or slower than asked and jitter a little,
//! encoders that count whole ticks, a gyroscope with bias and noise. So a movement driven blindly misses its goal, and
//! one corrected by encoders reaches it. What it does not show: motors with lag and dead band, wheels that slip or
//! differ in size, so encoders tell the truth up to a tick.
//!
//! It is a value in virtual time: it moves when told to, and the same seed and calls give the same bits.

mod emulator;
mod motor;
mod params;
mod random;

#[cfg(test)]
mod courses;

pub use emulator::Emulator;
pub use motor::{Motor, MotorParams, RIGHT_MOTOR};
pub use params::{EmulatorParams, EncodersParams, GyroParams, MotorsParams, Rates};
