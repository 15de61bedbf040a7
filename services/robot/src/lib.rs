//! Robot: where Axle meets metal.
//!
//! *Hears* the speeds that the gate asks of the wheels, and the bytes of a board on a serial line. *Says* the bytes
//! that make the board do it, and what its encoders and other sensors measured.
//! *Paper*: part I, the Robot service, which drives a board by commands over a serial line.
//! *When it fails*: a board that is silent, foreign, unplugged or has taken the wheels away disables the gate; what is
//! wrong with its bytes is counted and moves nothing. When this side fails, the board's own watchdog stops the wheels,
//! on those boards that have one.
//!
//! A protocol is a file here: it turns bytes into [`Event`]s and setpoints into bytes, and knows nothing of ports,
//! clocks or Zenoh ([`Board`]). What all of them need is around it once ([`Bridge`]): the greeting, the stop that is
//! always said first, distances over counters that wrap or begin anew, wheels that are swapped or turned round, and
//! what is too long silent.
//!
//! [`firmware`] is the other end of the line: every board again, in software, for tests and for the emulator.

mod arduino;
mod board;
mod bridge;
mod dwm_text;
mod eddie;
pub mod firmware;
mod line;
mod odometer;
mod orfa;
mod params;
mod roomba;

#[cfg(test)]
mod golden;
#[cfg(test)]
mod laws;

pub use board::{Board, Event, Fault};
pub use bridge::{Bridge, News};
pub use dwm_text::{crc8, sealed};
pub use eddie::hex;
pub use line::Lines;
pub use odometer::Odometer;
pub use params::{
    ArduinoParams, BoardKind, Dialect, DwmTextParams, EddieParams, Gauge, Mount, OrfaParams, RobotParams,
    RoombaParams, ServoParams,
};
