//! An Open Robotics board by the serial gate of its ORFA firmware: registers behind I2C, written as hexadecimal text.
//!
//! *Says* `V`, `L`, and `S address data … P` to read and write registers. *Hears* `V1.2`, `Lhh`, `SWAAA…P`, `SR…P`.
//! *Source*: the serial gate V1.2 of the ORFA firmware (`sgparsers.c`) and its motor driver: registers PWM1, PWM2, DIR1,
//! DIR2, found by the introspection of register 0.
//! *When it fails*: a register that nobody acknowledges is only seen by what is missing in the answer. The board has no
//! watchdog: when its line is cut while it drives, it drives on. And it measures nothing.

use crate::board::{Board, Event, Every, Fault};
use crate::line::{Lines, excerpt};
use crate::params::OrfaParams;
use axle_schema::{Duty, MetresPerSecond, Seconds, Sides};

/// Time from command to command.
const PERIOD: Seconds = Seconds(0.02);
/// Time from greeting to greeting.
const GREETING: Seconds = Seconds(0.25);
/// An answer that takes longer will not come.
const LATE: Seconds = Seconds(0.1);
/// The driver of the motors, by its unique number.
const MOTOR_DRIVER: u16 = 0x0060;
/// The first register of the motors in the older revision, which is where a stop is said to before anything is known.
const OLD_REGISTER: u8 = 0x60;
/// Drivers that a board may have.
const MOST_DRIVERS: u8 = 32;

/// What is to be found out next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Whether it is a serial gate.
    Version,
    /// The address of the gate itself, behind which its own registers are.
    Address,
    /// How many drivers it has.
    Drivers,
    /// A driver; so many are left.
    Driver(u8),
    /// Everything is known.
    Drive,
}

/// The conversation with the board.
#[derive(Debug)]
pub(crate) struct Orfa {
    params: OrfaParams,
    lines: Lines,
    step: Step,
    /// The address of the board for writing; bit 0 reads.
    address: u8,
    /// The first register of the motors.
    register: u8,
    greeting: Every,
    ordering: Every,
    resting: bool,
    signals: Sides<Duty>,
    /// Bytes whose acknowledgement is awaited.
    waiting: Option<(usize, Seconds)>,
}

impl Orfa {
    pub(crate) fn new(params: OrfaParams) -> Self {
        Self {
            params,
            lines: Lines::new(b'\n', 160),
            step: Step::Version,
            address: 0,
            register: OLD_REGISTER,
            greeting: Every::new(GREETING),
            ordering: Every::new(PERIOD),
            resting: true,
            signals: Sides::default(),
            waiting: None,
        }
    }

    /// The power of a wheel for a speed: what is above the dead band is shared out evenly.
    fn power(&self, speed: MetresPerSecond) -> Duty {
        let share = speed.0 / self.params.full_speed.0;
        if !share.is_finite() || share.abs() < 1e-9 {
            return Duty::default();
        }
        let power = self.params.dead_band + (1.0 - self.params.dead_band) * share.abs().min(1.0);
        Duty::new(power.copysign(share)).unwrap_or_default()
    }

    /// All four registers of the motors in one write.
    fn order(&mut self, now: Seconds, speeds: Sides<MetresPerSecond>, out: &mut Vec<u8>) {
        self.signals = speeds.map(|speed| self.power(speed));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of 255")]
        let pwm = self.signals.map(|power| (power.get().abs() * 255.0).round() as u8);
        let backward = self.signals.map(|power| u8::from(power.get() < 0.0));
        self.write(now, &[pwm.left, pwm.right, backward.left, backward.right], out);
    }

    fn write(&mut self, now: Seconds, data: &[u8], out: &mut Vec<u8>) {
        let mut line = format!("S {:02X} {:02X}", self.address, self.register);
        for byte in data {
            line.push_str(&format!(" {byte:02X}"));
        }
        line.push_str(" P\n");
        out.extend_from_slice(line.as_bytes());
        self.waiting = Some((data.len() + 1, now));
    }

    fn read(&mut self, line: &str, events: &mut Vec<Event>) {
        let line = line.trim();
        if line.is_empty() {
            return;
        }
        match self.step {
            Step::Drive => return self.acknowledged(line, events),
            Step::Version if line == "V1.2" => self.step = Step::Address,
            Step::Address => match line.strip_prefix('L').and_then(bytes_of).as_deref() {
                Some([address]) => (self.address, self.step) = (address & 0xFE, Step::Drivers),
                _ => return,
            },
            // Both parts of the answer: that register 0 was chosen, and what it holds.
            Step::Drivers => match after_read(line).as_deref() {
                Some([count]) if (1..=MOST_DRIVERS).contains(count) => self.step = Step::Driver(*count),
                Some(_) => events.push(Event::Fault(Fault::Absurd)),
                None => return,
            },
            Step::Driver(left) => match after_read(line).as_deref() {
                Some([high, low, major, minor, first, count]) => {
                    if u16::from_be_bytes([*high, *low]) == MOTOR_DRIVER && *count >= 4 {
                        (self.register, self.step) = (first & 0x7F, Step::Drive);
                        let said = format!("ORFA gate V1.2, motor driver {major}.{minor} at {first:02X}");
                        events.push(Event::Hello(said));
                        return;
                    }
                    if left <= 1 {
                        events.push(Event::Foreign("an ORFA board without a motor driver".into()));
                        self.step = Step::Version;
                        return;
                    }
                    self.step = Step::Driver(left - 1);
                }
                _ => return,
            },
            // What was said to the stop, whose register may not be there.
            Step::Version if line.starts_with('S') => return,
            Step::Version => return events.push(Event::Foreign(excerpt(line))),
        }
        self.greeting.hurry();
    }

    /// A board that does not acknowledge every byte has not taken the powers.
    fn acknowledged(&mut self, line: &str, events: &mut Vec<Event>) {
        let Some((bytes, _)) = self.waiting.take() else {
            return events.push(Event::Fault(Fault::Garbage));
        };
        let acknowledged = line.strip_prefix("SW").map(|rest| rest.trim_end_matches('P'));
        match acknowledged {
            Some(all) if all.bytes().all(|letter| letter == b'A') => {
                if all.len() >= bytes {
                    events.push(Event::Signals(self.signals));
                } else {
                    events.push(Event::Fault(Fault::Refused));
                }
            }
            _ => events.push(Event::Fault(Fault::Garbage)),
        }
    }
}

/// The bytes of hexadecimal pairs.
fn bytes_of(text: &str) -> Option<Vec<u8>> {
    let letters: Vec<u8> = text.bytes().filter(|letter| *letter != b' ').collect();
    if letters.is_empty() || !letters.len().is_multiple_of(2) {
        return None;
    }
    let pairs = letters.chunks_exact(2).map(|pair| {
        let digit = |letter: u8| char::from(letter).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
        Some(digit(pair[0])? * 16 + digit(pair[1])?)
    });
    pairs.collect()
}

/// What was read, in an answer like `SWAASR04P` or `SR04P`.
fn after_read(line: &str) -> Option<Vec<u8>> {
    let (_, read) = line.split_once("SR")?;
    bytes_of(read.strip_suffix('P').unwrap_or(read))
}

impl Board for Orfa {
    fn open(&mut self, now: Seconds, out: &mut Vec<u8>) {
        let motors = (self.step == Step::Drive).then_some((self.address, self.register));
        *self = Self::new(self.params);
        // The end of a line that somebody else began. At first nobody knows where the motors are, so that no stop can be
        // said before the board has been asked; it is then the first thing that the motors are told.
        out.extend_from_slice(b"\n");
        if let Some((address, register)) = motors {
            (self.address, self.register) = (address, register);
            self.order(now, Sides::default(), out);
            self.waiting = None;
        }
        self.greeting.is_due(now);
    }

    fn hear(&mut self, _at: Seconds, bytes: &[u8], events: &mut Vec<Event>) {
        for byte in bytes {
            match self.lines.push(*byte) {
                Some(Ok(line)) => self.read(&line, events),
                Some(Err(fault)) => events.push(Event::Fault(fault)),
                None => {}
            }
        }
    }

    fn beat(
        &mut self,
        now: Seconds,
        speeds: Sides<MetresPerSecond>,
        out: &mut Vec<u8>,
        events: &mut Vec<Event>,
    ) {
        let (to, from) = (self.address, self.address | 1);
        let question = match self.step {
            Step::Version => "V\n".to_owned(),
            Step::Address => "L\n".to_owned(),
            Step::Drivers => format!("S {to:02X} 00 S {from:02X} 01 P\n"),
            Step::Driver(_) => format!("S {from:02X} 06 P\n"),
            Step::Drive => String::new(),
        };
        if self.step != Step::Drive {
            if self.greeting.is_due(now) {
                out.extend_from_slice(question.as_bytes());
            }
            return;
        }
        if self.waiting.is_some_and(|(_, since)| now - since > LATE) {
            self.waiting = None;
            self.lines.clear();
            events.push(Event::Fault(Fault::Unanswered));
        }
        let rest = speeds.left.abs().max(speeds.right.abs()) <= MetresPerSecond::ZERO;
        let stops = rest && !self.resting;
        if stops || (self.waiting.is_none() && self.ordering.is_due(now)) {
            self.resting = rest;
            self.order(now, speeds, out);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hear(board: &mut Orfa, bytes: &[u8]) -> Vec<Event> {
        let mut events = Vec::new();
        board.hear(Seconds(1.0), bytes, &mut events);
        events
    }
    fn beat(board: &mut Orfa, now: f64, left: f64, right: f64) -> String {
        let (mut out, mut events) = (Vec::new(), Vec::new());
        let speeds = Sides::new(MetresPerSecond(left), MetresPerSecond(right));
        board.beat(Seconds(now), speeds, &mut out, &mut events);
        String::from_utf8(out).expect("text")
    }

    #[test]
    fn it_finds_the_motors_stops_them_and_drives_them() {
        let mut board = Orfa::new(OrfaParams { dead_band: 0.25, ..OrfaParams::default() });
        board.open(Seconds(0.0), &mut Vec::new());
        assert_eq!(beat(&mut board, 0.3, 0.5, 0.5), "V\n");
        assert_eq!(hear(&mut board, b"V1.2\n"), []);
        assert_eq!(beat(&mut board, 0.31, 0.5, 0.5), "L\n");
        assert_eq!(hear(&mut board, b"L40\n"), []);
        assert_eq!(beat(&mut board, 0.32, 0.5, 0.5), "S 40 00 S 41 01 P\n");
        assert_eq!(hear(&mut board, b"SWAASR02P\n"), []);
        assert_eq!(beat(&mut board, 0.33, 0.5, 0.5), "S 41 06 P\n");
        assert_eq!(hear(&mut board, b"SR001001000104P\n"), [], "another driver");
        assert_eq!(beat(&mut board, 0.34, 0.5, 0.5), "S 41 06 P\n");
        let hello = Event::Hello("ORFA gate V1.2, motor driver 1.2 at 62".into());
        assert_eq!(hear(&mut board, b"SR006001026204P\n"), [hello]);
        // Half of the speed is 0.25 + 0.75/2 of the power, 159 of 255.
        assert_eq!(beat(&mut board, 0.35, 0.5, -1.0), "S 40 62 9F FF 00 01 P\n");
        let signals = Sides::new(Duty::new(0.625).expect("a power"), Duty::new(-1.0).expect("a power"));
        assert_eq!(hear(&mut board, b"SWAAAAAAP\n"), [Event::Signals(signals)]);
        assert_eq!(beat(&mut board, 0.351, 0.0, 0.0), "S 40 62 00 00 00 00 P\n", "at once");
        assert_eq!(hear(&mut board, b"SWAAP\n"), [Event::Fault(Fault::Refused)], "not acknowledged");
        let mut out = Vec::new();
        board.open(Seconds(1.0), &mut out);
        assert_eq!(out, b"\nS 40 62 00 00 00 00 P\n", "where the motors were, they are stopped first");
    }

    #[test]
    fn other_boards_and_boards_without_motors_are_foreign() {
        let mut board = Orfa::new(OrfaParams::default());
        assert_eq!(hear(&mut board, b"Invalid Command\n"), [Event::Foreign("Invalid Command".into())]);
        hear(&mut board, b"V1.2\nL40\nSR01P\n");
        assert!(matches!(hear(&mut board, b"SR001001000104P\n")[..], [Event::Foreign(_)]));
    }
}
