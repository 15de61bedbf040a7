//! Boards in software: the other end of the line, byte for byte, with the timing, the watchdogs and the quirks of the
//! real ones. Written from the same documents as the bridge, but from none of its code: what both got wrong alike would
//! show nowhere else.
//!
//! A firmware is a value in virtual time: it is told what came over the line and what the body of the robot does, and
//! says what it answers and what it asks of the motors.

mod arduino;
mod dwm_text;
mod eddie;
mod orfa;
mod roomba;

#[cfg(test)]
pub(crate) use eddie::heading;
pub use eddie::{EddieCommand, read_eddie};

use crate::params::{BoardKind, RobotParams};
use axle_schema::{Metres, MetresPerSecond, Radians, RadiansPerSecond, Seconds, Sides};
use std::fmt::Debug;

/// What the board can feel of the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Body {
    /// What the wheels have covered since the robot was switched on, forward positive.
    pub distances: Sides<Metres>,
    /// Turn rate, counter-clockwise positive.
    pub gyro: RadiansPerSecond,
    /// Voltage of the battery, V.
    pub voltage: f64,
    /// The bumper is pressed.
    pub bump: Sides<bool>,
    /// There is no ground before a wheel.
    pub cliff: Sides<bool>,
}

/// What is odd about a board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Quirks {
    /// Its firmware is an old one: a Roomba says angles in a wrong scale, an Eddie takes speeds in another unit.
    pub old_scale: bool,
    /// What its counters show when it is switched on: close to their end, they soon wrap.
    pub first_count: i64,
    /// A number that differs from run to run.
    pub run: u32,
}

/// One kind of board, as its maker has it.
pub trait Firmware: Debug + Send {
    /// Takes bytes from the line, and says the answers.
    fn hear(&mut self, now: Seconds, bytes: &[u8], out: &mut Vec<u8>);

    /// Goes on to `now`: says what it says by itself, and what it asks of the motors.
    fn beat(&mut self, now: Seconds, body: &Body, out: &mut Vec<u8>) -> Sides<MetresPerSecond>;

    /// The servo that was last turned, if it has not been told yet: its pin, and its angle from its middle.
    fn turned(&mut self) -> Option<(u8, Radians)> {
        None
    }
}

/// A board that has just been switched on. Its wheels and baud rate are those of `params`.
#[must_use]
pub fn firmware(kind: BoardKind, params: &RobotParams, quirks: Quirks) -> Box<dyn Firmware> {
    match kind {
        BoardKind::Arduino => Box::new(arduino::Arduino::new(params.arduino, quirks)),
        BoardKind::Roomba => Box::new(roomba::Roomba::new(params.roomba, params.robot.track, quirks)),
        BoardKind::Eddie => Box::new(eddie::Eddie::new(params.eddie, quirks)),
        BoardKind::Orfa => Box::new(orfa::Orfa::new(params.orfa)),
        BoardKind::DwmText => Box::new(dwm_text::DwmText::new(params.dwm_text, quirks)),
    }
}

/// The board's own speed controller: wheels that are behind what they should have covered are asked for a bit more.
#[derive(Clone, Copy, Debug, Default)]
struct Regulator {
    due: Sides<f64>,
    now: Seconds,
}

impl Regulator {
    /// What is asked of the motors, so that the wheels run at `speeds`.
    fn ask(&mut self, now: Seconds, speeds: Sides<MetresPerSecond>, body: &Body) -> Sides<MetresPerSecond> {
        let span = (now - self.now).0.clamp(0.0, 0.1);
        self.now = now;
        let real = body.distances.map(|distance| distance.0);
        let side = |due: &mut f64, real: f64, speed: MetresPerSecond| {
            if speed == MetresPerSecond::ZERO {
                *due = real;
                return speed;
            }
            *due += speed.0 * span;
            // A wheel that is held fast winds nothing up.
            *due = due.clamp(real - 0.05, real + 0.05);
            MetresPerSecond(speed.0 + 4.0 * (*due - real))
        };
        let left = side(&mut self.due.left, real.left, speeds.left);
        let right = side(&mut self.due.right, real.right, speeds.right);
        Sides::new(left, right)
    }
}

/// What the counters of a body show.
fn counts(body: &Body, tick: Sides<Metres>, first: i64) -> Sides<i64> {
    #[allow(clippy::cast_possible_truncation, reason = "a cast of floats saturates")]
    // A reading that is a whole number of ticks, but for the last bit, is that number.
    body.distances.zip(tick, |distance, tick| ((distance / tick) + 1e-6).floor() as i64 + first)
}
