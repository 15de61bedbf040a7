//! Emulator: a robot in software.
//!
//! *Hears* the speeds that the gate asks of the wheels. *Says* what encoders and a gyroscope measure, and, as no real
//! robot can, where it truly is.
//! *Paper*: part II, where correctors are tried on a simulated robot before a real one.
//! *When it fails*: as a real robot does: its sensors fall silent, and everybody brakes.
//!
//! What it shows honestly: wheels that drive a constant share faster or slower than asked and jitter a little, motors
//! with friction, lag and a largest speed, a battery that tires, wheels that slip, encoders that count whole ticks, a
//! gyroscope and accelerometers with bias, noise and drift. So a movement driven blindly misses its goal, and one
//! corrected by encoders reaches it, unless the wheels slip. Much of this is switched off in the shipped parameters,
//! and each has its unit and range there. On a map it cannot drive through walls. [`EmulatedBoard`] puts a board on a
//! serial line before it.
//!
//! It is a value in virtual time: it moves when told to, and the same seed and calls give the same bits.

mod board;
mod emulator;
mod encoder;
mod ground;
mod motor;
mod motors;
mod params;
mod random;
mod response;
mod sensors;
mod walls;

#[cfg(test)]
mod courses;

pub use board::{BoardParams, EmulatedBoard};
pub use emulator::Emulator;
pub use encoder::{Encoder, EncoderParams, RIGHT_ENCODER};
pub use motor::{Motor, MotorParams, RIGHT_MOTOR};
pub use params::{
    AccelerometersParams, BatteryParams, EmulatorParams, EncodersParams, GyroParams, MotorsParams, Rates,
    ResponseParams, SlipParams, WallsParams, WheelsParams,
};
pub use random::Random;
