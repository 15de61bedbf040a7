//! ROSArduinoBridge, as its firmware has it.

use super::{Body, Firmware, Quirks, Regulator, counts};
use crate::params::ArduinoParams;
use axle_schema::{Metres, MetresPerSecond, Radians, Seconds, Sides};

/// A frame of the speed controller is a whole number of milliseconds: 1000/30 is 33.
const FRAME: Seconds = Seconds(0.033);
/// So long after the last `m` the motors stop.
const WATCHDOG: Seconds = Seconds(2.0);
/// The firmware has room for so many letters of a line, and does not look whether there are more.
const LONGEST: usize = 31;

/// The board.
#[derive(Debug)]
pub(super) struct Arduino {
    baud: u32,
    tick: Sides<Metres>,
    line: Vec<u8>,
    /// Counts a frame that are asked of each wheel, or powers, and when.
    target: Sides<i64>,
    powers: bool,
    full_speed: MetresPerSecond,
    moved: Option<Seconds>,
    regulator: Regulator,
    /// What the counters show, and what they showed when they were set to zero.
    counted: Sides<i64>,
    zero: Sides<i64>,
    first: i64,
    turned: Option<(u8, Radians)>,
}

impl Arduino {
    pub(super) fn new(params: ArduinoParams, quirks: Quirks) -> Self {
        Self {
            baud: params.baud,
            tick: params.gauge.tick(),
            line: Vec::new(),
            target: Sides::default(),
            powers: false,
            full_speed: params.full_speed,
            moved: None,
            regulator: Regulator::default(),
            counted: Sides::default(),
            zero: Sides::default(),
            first: quirks.first_count,
            turned: None,
        }
    }

    fn run(&mut self, now: Seconds, line: &str) -> String {
        let mut words = line.split(' ');
        let letter = words.next().unwrap_or_default();
        let mut number = || words.next().map_or(0, atoi);
        match letter {
            // Powers are a command of the forks of this firmware.
            "m" | "o" => {
                self.powers = letter == "o";
                self.target = Sides::new(number(), number());
                self.moved = Some(now);
                "OK".into()
            }
            "e" => {
                // 32 bits, which wrap.
                #[allow(clippy::cast_possible_truncation, reason = "as the counters do")]
                let Sides { left, right } = self.counted.zip(self.zero, |count, zero| (count - zero) as i32);
                format!("{left} {right}")
            }
            "r" => {
                self.zero = self.counted;
                "OK".into()
            }
            "b" => format!(" {}", self.baud),
            "s" => {
                // The firmware looks at neither; what the library of servos makes of them is 0 to 180 degrees.
                let (pin, degrees) = (number(), number().clamp(0, 180));
                #[allow(clippy::cast_precision_loss, reason = "at most 180")]
                let angle = Radians((degrees as f64 - 90.0).to_radians());
                self.turned = u8::try_from(pin).ok().map(|pin| (pin, angle));
                "OK".into()
            }
            "u" | "w" | "x" | "c" => "OK".into(),
            "a" | "d" | "p" => "0".into(),
            _ => "Invalid Command".into(),
        }
    }
}

/// As that of C: the digits at the beginning, and 0 where there are none.
fn atoi(word: &str) -> i64 {
    let (sign, digits) = word.strip_prefix('-').map_or((1, word), |digits| (-1, digits));
    let end = digits.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(digits.len());
    sign * digits[..end].parse::<i32>().map_or(0, i64::from)
}

impl Firmware for Arduino {
    fn hear(&mut self, now: Seconds, bytes: &[u8], out: &mut Vec<u8>) {
        for byte in bytes {
            if *byte != b'\r' {
                // A line feed is not the end of a line, but the beginning of the next one.
                if self.line.len() < LONGEST {
                    self.line.push(*byte);
                }
                continue;
            }
            let line = String::from_utf8_lossy(&std::mem::take(&mut self.line)).into_owned();
            let answer = self.run(now, &line);
            out.extend_from_slice(format!("{answer}\r\n").as_bytes());
        }
    }

    fn beat(&mut self, now: Seconds, body: &Body, _out: &mut Vec<u8>) -> Sides<MetresPerSecond> {
        self.counted = counts(body, self.tick, self.first);
        if self.moved.is_some_and(|moved| now - moved > WATCHDOG) {
            self.moved = None;
            self.target = Sides::default();
        }
        #[allow(clippy::cast_precision_loss, reason = "8 bits")]
        if self.powers {
            let full = self.full_speed;
            return self.target.map(|power| full * (power.clamp(-255, 255) as f64 / 255.0));
        }
        #[allow(clippy::cast_precision_loss, reason = "32 bits")]
        let speeds =
            self.target.zip(self.tick, |target, tick| MetresPerSecond(target as f64 * tick.0 / FRAME.0));
        self.regulator.ask(now, speeds, body)
    }

    fn turned(&mut self) -> Option<(u8, Radians)> {
        self.turned.take()
    }
}
