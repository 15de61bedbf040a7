//! Parallax Eddie, as its command set and the firmware that can be read have it.

use super::{Body, Firmware, Quirks, Regulator, counts};
use crate::params::EddieParams;
use axle_schema::{Metres, MetresPerSecond, Seconds, Sides};

/// Without a line that can be read for so long, the motors are switched off.
const WATCHDOG: Seconds = Seconds(1.0);
/// Speeds are positions in this time by the document.
const BY_DOCUMENT: Seconds = Seconds(1.0);
/// Letters of a line with its end.
const LONGEST: usize = 254;
/// Positions of a full turn about one wheel.
const ROTATION: i64 = 748;

/// What a line asks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EddieCommand {
    /// Powers, -127 to 127.
    Go(Sides<i64>),
    /// Speeds in positions in the time of a speed.
    GoSpeed(Sides<i64>),
    /// Stop within so many positions; 0 at once.
    Stop(i64),
    /// Travel so many positions at a speed.
    Travel(i64, i64),
    /// Turn by degrees, clockwise positive, at a speed.
    Turn(i64, i64),
    /// Acceleration, positions in s².
    Acceleration(i64),
    /// Blink a pin at a rate in tenths of Hz.
    Blink(i64, i64),
    /// The watchdog.
    Watch(bool),
    /// Errors in words.
    Verbose(bool),
    /// Distances to zero.
    Reset,
    /// A question, by its word.
    Ask(&'static str),
}

/// Reads a line.
///
/// # Errors
/// What the board says of it, after `ERROR - `.
pub fn read_eddie(line: &str) -> Result<EddieCommand, &'static str> {
    let mut words = line.split([' ', '\t']).filter(|word| !word.is_empty());
    let word = words.next().unwrap_or_default().to_ascii_uppercase();
    let numbers: Vec<u32> = words
        .map(|word| {
            let is_hex = word.len() <= 8 && word.bytes().all(|byte| byte.is_ascii_hexdigit());
            is_hex.then(|| u32::from_str_radix(word, 16).ok()).flatten().ok_or("Invalid parameter")
        })
        .collect::<Result<_, _>>()?;
    let number = |at: usize| numbers.get(at).copied().ok_or("Too few parameters");
    let at_most = |count: usize| if numbers.len() > count { Err("Too many parameters") } else { Ok(()) };
    let in_range = |number: u32, low: u32, high: u32| {
        if (low..=high).contains(&number) { Ok(i64::from(number)) } else { Err("Invalid parameter") }
    };
    // Two's complement of 16 bits, and of 8, in which -128 is taken for -127.
    let word16 = |at: usize| {
        let number = u16::try_from(number(at)?).map_err(|_| "Invalid parameter")?;
        Ok::<i64, &'static str>(i64::from(number.cast_signed()))
    };
    let byte = |at: usize| {
        let number = u8::try_from(number(at)?).map_err(|_| "Invalid parameter")?;
        Ok::<i64, &'static str>(i64::from(number.cast_signed()).max(-127))
    };
    let (command, count) = match word.as_str() {
        "GO" => (EddieCommand::Go(Sides::new(byte(0)?, byte(1)?)), 2),
        "GOSPD" => (EddieCommand::GoSpeed(Sides::new(word16(0)?, word16(1)?)), 2),
        "STOP" => (EddieCommand::Stop(in_range(number(0)?, 0, 0xFFFF)?), 1),
        "TRVL" => (EddieCommand::Travel(word16(0)?, in_range(number(1)?, 1, 0xFF)?), 2),
        "TURN" => (EddieCommand::Turn(word16(0)?, in_range(number(1)?, 1, 0xFF)?), 2),
        "ACC" => (EddieCommand::Acceleration(in_range(number(0)?, 1, 0x7FF)?), 1),
        "BLINK" | "BLNK" => (EddieCommand::Blink(i64::from(number(0)?), i64::from(number(1)?)), 2),
        "WATCH" => (EddieCommand::Watch(in_range(number(0)?, 0, 1)? == 1), 1),
        "VERB" => (EddieCommand::Verbose(in_range(number(0)?, 0, 1)? == 1), 1),
        "RST" => (EddieCommand::Reset, 0),
        "VER" => (EddieCommand::Ask("VER"), 0),
        "HWVER" => (EddieCommand::Ask("HWVER"), 0),
        "DIST" => (EddieCommand::Ask("DIST"), 0),
        "SPD" => (EddieCommand::Ask("SPD"), 0),
        "HEAD" => (EddieCommand::Ask("HEAD"), 0),
        "ADC" => (EddieCommand::Ask("ADC"), 0),
        "PING" => (EddieCommand::Ask("PING"), 0),
        _ => return Err("Invalid command"),
    };
    at_most(count)?;
    Ok(command)
}

/// The heading that the board tells for two distances: clockwise, toward zero, in 12 bits.
pub(crate) fn heading(left: i64, right: i64) -> i64 {
    ((left - right) % ROTATION) * 360 / ROTATION
}

/// What drives the wheels.
#[derive(Clone, Copy, Debug)]
enum Motion {
    Off,
    Power(Sides<i64>),
    Speed(Sides<i64>),
    /// To these counts, at this speed.
    To(Sides<i64>, i64),
}

/// The board.
#[derive(Debug)]
pub(super) struct Eddie {
    params: EddieParams,
    tick: Sides<Metres>,
    line: Vec<u8>,
    motion: Motion,
    verbose: bool,
    watches: bool,
    acceleration: i64,
    /// Speeds of the ramps, m/s.
    speeds: Sides<f64>,
    counted: Sides<i64>,
    zero: Sides<i64>,
    first: i64,
    voltage: f64,
    heard: Seconds,
    now: Seconds,
    regulator: Regulator,
}

impl Eddie {
    pub(super) fn new(params: EddieParams, quirks: Quirks) -> Self {
        // As its document has it, and not as the firmware that can be read.
        let speed_time = if quirks.old_scale { BY_DOCUMENT } else { params.speed_time };
        let params = EddieParams { speed_time, ..params };
        Self {
            params,
            tick: params.gauge.tick(),
            line: Vec::new(),
            motion: Motion::Off,
            verbose: false,
            watches: true,
            acceleration: i64::from(params.acceleration),
            speeds: Sides::default(),
            counted: Sides::default(),
            zero: Sides::default(),
            first: quirks.first_count,
            voltage: 0.0,
            heard: Seconds::ZERO,
            now: Seconds::ZERO,
            regulator: Regulator::default(),
        }
    }

    fn run(&mut self, command: &EddieCommand) -> String {
        match command {
            EddieCommand::Go(powers) => self.motion = Motion::Power(*powers),
            EddieCommand::GoSpeed(speeds) => self.motion = Motion::Speed(*speeds),
            EddieCommand::Stop(0) => (self.motion, self.speeds) = (Motion::Off, Sides::default()),
            EddieCommand::Stop(_) => self.motion = Motion::Speed(Sides::default()),
            EddieCommand::Travel(far, speed) => {
                self.motion = Motion::To(self.counted.map(|count| count + far), *speed);
            }
            EddieCommand::Turn(degrees, speed) => {
                let each = degrees * ROTATION / 720;
                self.motion =
                    Motion::To(Sides::new(self.counted.left + each, self.counted.right - each), *speed);
            }
            EddieCommand::Acceleration(rate) => self.acceleration = *rate,
            EddieCommand::Watch(watches) => self.watches = *watches,
            EddieCommand::Verbose(verbose) => self.verbose = *verbose,
            EddieCommand::Reset => self.zero = self.counted,
            EddieCommand::Blink(..) => {}
            EddieCommand::Ask(word) => return self.answer(word),
        }
        String::new()
    }

    fn answer(&self, word: &str) -> String {
        let Sides { left, right } = self.counted.zip(self.zero, |count, zero| count - zero);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "two's complement, and a reading of 12 bits"
        )]
        match word {
            "VER" => "000A".into(),
            "HWVER" => "0002".into(),
            "DIST" => format!("{:08X} {:08X}", left as u32, right as u32),
            "SPD" => {
                let speeds =
                    self.speeds.zip(self.tick, |speed, tick| speed / tick.0 * self.params.speed_time.0);
                format!("{:04X} {:04X}", speeds.left as i16, speeds.right as i16)
            }
            "HEAD" => format!("{:03X}", heading(left, right) & 0xFFF),
            "ADC" => {
                let reading = (self.voltage / self.params.battery_scale * 4095.0).clamp(0.0, 4095.0) as u16;
                format!("000 000 000 000 000 000 000 {reading:03X}")
            }
            _ => "000".into(),
        }
    }

    /// The speeds that the wheels shall run at when the ramps are over.
    fn target(&mut self) -> Sides<f64> {
        #[allow(clippy::cast_precision_loss, reason = "16 bits")]
        let speed = |number: i64, tick: Metres| number as f64 * tick.0 / self.params.speed_time.0;
        match self.motion {
            Motion::Off | Motion::Power(_) => Sides::default(),
            Motion::Speed(speeds) => speeds.zip(self.tick, speed),
            Motion::To(end, at) => {
                let left = end.zip(self.counted, |end, count| end - count);
                if left.left == 0 && left.right == 0 {
                    self.motion = Motion::Off;
                }
                left.map(|left| at.min(left.abs()) * left.signum()).zip(self.tick, speed)
            }
        }
    }
}

impl Firmware for Eddie {
    fn hear(&mut self, now: Seconds, bytes: &[u8], out: &mut Vec<u8>) {
        for byte in bytes {
            match byte {
                b'\r' => {}
                8 => drop(self.line.pop()),
                b'\t' | b' '..=b'~' => {
                    if self.line.len() < LONGEST {
                        self.line.push(*byte);
                    }
                    continue;
                }
                _ => continue,
            }
            if *byte != b'\r' {
                continue;
            }
            let bytes = std::mem::take(&mut self.line);
            if bytes.iter().all(|letter| *letter == b' ') {
                continue;
            }
            let read = if bytes.len() < LONGEST {
                read_eddie(&String::from_utf8_lossy(&bytes))
            } else {
                Err("Overflow")
            };
            let answer = match read {
                Ok(command) => {
                    self.heard = now;
                    self.run(&command)
                }
                Err(why) if self.verbose => format!("ERROR - {why}"),
                Err(_) => "ERROR".into(),
            };
            out.extend_from_slice(answer.as_bytes());
            out.push(b'\r');
        }
    }

    fn beat(&mut self, now: Seconds, body: &Body, _out: &mut Vec<u8>) -> Sides<MetresPerSecond> {
        let span = (now - self.now).0.clamp(0.0, 0.1);
        self.now = now;
        self.voltage = body.voltage;
        self.counted = counts(body, self.tick, self.first);
        if self.watches && now - self.heard >= WATCHDOG {
            (self.motion, self.speeds) = (Motion::Off, Sides::default());
        }
        if let Motion::Power(powers) = self.motion {
            // No speed is controlled here: power is power.
            let full = self.params.full_speed;
            #[allow(clippy::cast_precision_loss, reason = "8 bits")]
            return powers.map(|power| full * (power as f64 / 127.0));
        }
        let target = self.target();
        #[allow(clippy::cast_precision_loss, reason = "11 bits")]
        let ramp = self.tick.map(|tick| self.acceleration as f64 * tick.0 * span);
        let change = target.zip(self.speeds, |target, speed| target - speed);
        let change = change.zip(ramp, |change, ramp| change.clamp(-ramp, ramp));
        self.speeds = self.speeds.zip(change, |speed, change| speed + change);
        self.regulator.ask(now, self.speeds.map(MetresPerSecond), body)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_refused_as_the_board_refuses_them() {
        for (line, why) in [
            ("FLY 1", "Invalid command"),
            ("GO 1", "Too few parameters"),
            ("GO 1 2 3", "Too many parameters"),
            ("GO 100 1", "Invalid parameter"),
            ("GOSPD xyz 1", "Invalid parameter"),
            ("TRVL 10 -5", "Invalid parameter"),
            ("ACC 0", "Invalid parameter"),
        ] {
            assert_eq!(read_eddie(line), Err(why), "{line:?}");
        }
        assert_eq!(read_eddie("go 80\t 7f"), Ok(EddieCommand::Go(Sides::new(-127, 127))));
    }

    #[test]
    fn it_turns_by_positions_and_stops_when_nobody_speaks() {
        let mut board = Eddie::new(EddieParams::default(), Quirks::default());
        let mut out = Vec::new();
        board.hear(Seconds(0.0), b"turn 5A 20\rGOO\rverb 1\rGOO\r", &mut out);
        assert_eq!(out, b"\rERROR\r\rERROR - Invalid command\r");
        let mut body = Body::default();
        let mut now = 0.0;
        while now < 3.0 {
            now += 0.01;
            let asked = board.beat(Seconds(now), &body, &mut out);
            body.distances = body.distances.zip(asked, |sum, speed| sum + speed * Seconds(0.01));
        }
        // 90 degrees clockwise would be 93 positions of 3.3 mm; after 1 s of silence it is over.
        assert!(body.distances.left.0 > 0.1 && body.distances.right.0 < -0.1, "{body:?}");
        assert!(body.distances.left.0 < 0.25, "{body:?}");
        assert_eq!(board.beat(Seconds(3.1), &body, &mut out), Sides::default());
    }
}
