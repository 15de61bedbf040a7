//! A board that takes movements as text, as the firmware of the paper does: docs/boards/dwm-text.md is its protocol.
//!
//! *Says* `D` a movement or `P` powers, `S` stop, `W` arm the watchdog, `V` what are you, `A` turn a servo; *hears* `M` measurements,
//! which come by themselves, `V` a version, `K` and `E` answers. Every line has a number and a checksum.
//! *When it fails*: without a movement for as long as the watchdog was armed for, the board stops by itself.

use crate::board::{Board, Event, Every, Fault, given, powers, whole_power};
use crate::line::{Lines, excerpt};
use crate::params::{DwmTextParams, ServoParams};
use axle_schema::board::{Amperes, BatteryData, ContactsData};
use axle_schema::{MetresPerSecond, Radians, RadiansPerSecond, Seconds, Sides};

/// The version of the protocol.
const VERSION: &str = "1";
/// Time from movement to movement.
const PERIOD: Seconds = Seconds(0.02);
/// Time from greeting to greeting.
const GREETING: Seconds = Seconds(0.25);
/// Time from arming the watchdog to arming it again: a board that restarts has forgotten it.
const ARMING: Seconds = Seconds(1.0);
/// The number of full power.
const FULL: f64 = 10_000.0;
/// The longest line.
const LONGEST: usize = 120;

/// The conversation with the board.
#[derive(Debug)]
pub(crate) struct DwmText {
    params: DwmTextParams,
    servos: Vec<u8>,
    lines: Lines,
    /// The run of the board, by its own number.
    boot: Option<u32>,
    greeting: Every,
    ordering: Every,
    arming: Every,
    seq: u16,
    /// The number of the measurement that is due.
    due: Option<u16>,
    said: Sides<i64>,
    turning: Vec<Option<i64>>,
}

/// The checksum of a line: the CRC of 8 bits with the polynomial x⁸ + x² + x + 1, from 0.
#[must_use]
pub fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc: u8, _| if crc & 0x80 == 0 { crc << 1 } else { (crc << 1) ^ 0x07 })
    })
}

/// A line with its checksum and its end.
#[must_use]
pub fn sealed(body: &str) -> String {
    format!("{body}*{:02X}\n", crc8(body.as_bytes()))
}

/// What a line says, if its checksum is right.
///
/// # Errors
/// Garbage, or a wrong checksum.
pub(crate) fn opened(line: &str) -> Result<&str, Fault> {
    let (body, sum) = line.rsplit_once('*').ok_or(Fault::Garbage)?;
    let sum = (sum.len() == 2).then(|| u8::from_str_radix(sum, 16).ok()).flatten().ok_or(Fault::Garbage)?;
    if sum == crc8(body.as_bytes()) { Ok(body) } else { Err(Fault::Checksum) }
}

impl DwmText {
    pub(crate) fn new(params: DwmTextParams, servos: &[ServoParams]) -> Self {
        Self {
            params,
            servos: servos.iter().map(|servo| servo.pin).collect(),
            lines: Lines::new(b'\n', LONGEST),
            boot: None,
            greeting: Every::new(GREETING),
            ordering: Every::new(PERIOD),
            arming: Every::new(ARMING),
            seq: 0,
            due: None,
            said: Sides::default(),
            turning: vec![None; servos.len()],
        }
    }

    fn say(&mut self, letter: char, rest: &str, out: &mut Vec<u8>) {
        self.seq = self.seq.wrapping_add(1);
        out.extend_from_slice(sealed(&format!("{letter} {}{rest}", self.seq)).as_bytes());
    }

    fn read(&mut self, line: &str, events: &mut Vec<Event>) {
        if line.is_empty() {
            return;
        }
        let body = match opened(line) {
            Ok(body) => body,
            // Before the greeting it may be another board; afterwards it is a fault of the line.
            Err(Fault::Garbage) if self.boot.is_none() => return events.push(Event::Foreign(excerpt(line))),
            Err(fault) => return events.push(Event::Fault(fault)),
        };
        let words: Vec<&str> = body.split(' ').take(12).collect();
        match words.as_slice() {
            ["V", VERSION, boot, name] => match u32::from_str_radix(boot, 16) {
                Ok(boot) => self.greet(boot, name, events),
                Err(_) => events.push(Event::Fault(Fault::Garbage)),
            },
            ["V", version, ..] => events.push(Event::Foreign(format!("version {}", excerpt(version)))),
            ["M", numbers @ ..] if self.boot.is_some() => self.measure(numbers, events),
            ["M", ..] => {}
            ["K", _] => events.push(Event::Alive),
            ["E", ..] => events.push(Event::Fault(Fault::Refused)),
            _ => events.push(Event::Fault(Fault::Garbage)),
        }
    }

    fn greet(&mut self, boot: u32, name: &str, events: &mut Vec<Event>) {
        match self.boot.replace(boot) {
            None => events.push(Event::Hello(format!("{}, run {boot:X}", excerpt(name)))),
            Some(before) if before != boot => {
                self.due = None;
                self.arming.hurry();
                events.push(Event::Restarted);
            }
            Some(_) => {}
        }
    }

    /// `M number ms left right gyro mV mA touch`.
    fn measure(&mut self, words: &[&str], events: &mut Vec<Event>) {
        let numbers: Option<Vec<i64>> = words.iter().map(|word| word.parse().ok()).collect();
        let Some([number, _clock, left, right, gyro, volts, amperes, touch]) = numbers.as_deref() else {
            return events.push(Event::Fault(Fault::Garbage));
        };
        let (Ok(number), true) = (u16::try_from(*number), is_credible(*gyro, *volts, *amperes, *touch))
        else {
            return events.push(Event::Fault(Fault::Absurd));
        };
        if let Some(missed) = self.due.map(|due| number.wrapping_sub(due))
            && missed != 0
        {
            events.push(Event::Fault(Fault::Missed(u32::from(missed.min(1000)))));
        }
        self.due = Some(number.wrapping_add(1));
        events.push(Event::Counts(Sides::new(*left, *right)));
        #[allow(clippy::cast_precision_loss, reason = "a few digits")]
        let small = |number: i64, unit: f64| number as f64 * unit;
        events.push(Event::Gyro(RadiansPerSecond(small(*gyro, 1e-6))));
        let bit = |number: u8| touch & (1 << number) != 0;
        events.push(Event::Contacts(ContactsData {
            stamp: Seconds::ZERO,
            bump: Sides::new(bit(0), bit(1)),
            drop: Sides::new(bit(2), bit(3)),
            cliff: Sides::new(bit(4), bit(5)),
        }));
        events.push(Event::Battery(BatteryData {
            stamp: Seconds::ZERO,
            voltage: small(*volts, 1e-3),
            current: Some(Amperes(small(*amperes, 1e-3))),
            left: None,
        }));
    }
}

/// At most 100 rad/s, 100 V and 100 A, and six bits.
fn is_credible(gyro: i64, volts: i64, amperes: i64, touch: i64) -> bool {
    gyro.unsigned_abs() <= 100_000_000
        && (0..=100_000).contains(&volts)
        && amperes.unsigned_abs() <= 100_000
        && (0..64).contains(&touch)
}

impl Board for DwmText {
    fn open(&mut self, now: Seconds, out: &mut Vec<u8>) {
        *self = Self { servos: std::mem::take(&mut self.servos), ..Self::new(self.params, &[]) };
        self.turning = vec![None; self.servos.len()];
        // The end of a line that somebody else began, and the stop.
        out.push(b'\n');
        self.say('S', "", out);
        self.greeting.is_due(now);
        self.say('V', "", out);
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
        if self.boot.is_none() {
            if self.greeting.is_due(now) {
                self.say('V', "", out);
            }
            return;
        }
        if self.arming.is_due(now) {
            self.say('W', &format!(" {:.0}", self.params.watchdog.0 * 1000.0), out);
        }
        // Micrometres in a second: whole numbers, and finer than any wheel.
        #[allow(clippy::cast_possible_truncation, reason = "at most 20 m/s")]
        let micro = |speed: MetresPerSecond| {
            if speed.is_finite() { (speed.0 * 1e6).round().clamp(-2e7, 2e7) as i64 } else { 0 }
        };
        let asked = speeds;
        let speeds = speeds.map(micro);
        let rest = Sides::default();
        if speeds == rest && self.said != rest {
            self.said = rest;
            self.ordering.hurry();
            self.say('S', "", out);
            if self.params.powers {
                events.push(Event::Signals(Sides::default()));
            }
        } else if self.ordering.is_due(now) {
            let (from, to) = (self.said, speeds);
            self.said = to;
            if self.params.powers {
                let whole = powers(asked, self.params.full_speed).map(|power| whole_power(power, FULL));
                self.say('P', &format!(" {} {}", whole.left, whole.right), out);
                events.push(Event::Signals(given(whole, FULL)));
            } else {
                let time = PERIOD.0 * 1000.0;
                let movement = format!(" {} {} {} {} {time:.0}", from.left, from.right, to.left, to.right);
                self.say('D', &movement, out);
            }
        }
        for index in 0..self.servos.len() {
            if let (Some(pin), Some(angle)) =
                (self.servos.get(index).copied(), self.turning.get_mut(index).and_then(Option::take))
            {
                self.say('A', &format!(" {pin} {angle}"), out);
            }
        }
    }

    fn servo(&mut self, number: usize, angle: Radians) -> bool {
        let Some(turning) = self.turning.get_mut(number) else { return false };
        #[allow(clippy::cast_possible_truncation, reason = "at most half a turn, in mrad")]
        let angle = (angle.0 * 1000.0).clamp(-3200.0, 3200.0).round() as i64;
        *turning = Some(angle);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hear(board: &mut DwmText, body: &str) -> Vec<Event> {
        let mut events = Vec::new();
        board.hear(Seconds(1.0), sealed(body).as_bytes(), &mut events);
        events
    }
    fn beat(board: &mut DwmText, now: f64, left: f64, right: f64) -> String {
        let (mut out, mut events) = (Vec::new(), Vec::new());
        let speeds = Sides::new(MetresPerSecond(left), MetresPerSecond(right));
        board.beat(Seconds(now), speeds, &mut out, &mut events);
        String::from_utf8(out).expect("text")
    }
    fn ready() -> DwmText {
        let servo = ServoParams { pin: 5, ..ServoParams::default() };
        let mut board = DwmText::new(DwmTextParams::default(), &[servo]);
        let mut out = Vec::new();
        board.open(Seconds(0.0), &mut out);
        assert_eq!(out, format!("\n{}{}", sealed("S 1"), sealed("V 2")).into_bytes(), "the stop comes first");
        assert_eq!(beat(&mut board, 0.01, 0.5, 0.5), "", "no movement before the greeting");
        assert_eq!(hear(&mut board, "V 1 7A dwm-avr"), [Event::Hello("dwm-avr, run 7A".into())]);
        board
    }

    #[test]
    fn checksums_are_those_of_the_standard() {
        // The check value of CRC-8/SMBUS.
        assert_eq!(crc8(b"123456789"), 0xF4);
        assert_eq!(sealed("V 1"), "V 1*60\n");
        assert_eq!(opened("V 1*60"), Ok("V 1"));
        assert_eq!(opened("V 2*60"), Err(Fault::Checksum));
        for garbage in ["", "*", "V 1", "V 1*", "V 1*+3", "V 1*600"] {
            assert!(opened(garbage).is_err(), "{garbage:?}");
        }
    }

    #[test]
    fn the_page_shows_lines_with_their_right_sums() {
        let page = include_str!("../../../docs/boards/dwm-text.md");
        let lines = page.lines().filter_map(|line| line.strip_prefix("> ").or(line.strip_prefix("< ")));
        let wrong: Vec<&str> = lines.clone().filter(|line| opened(line).is_err()).collect();
        assert_eq!((lines.count(), wrong), (7, Vec::new()));
    }

    #[test]
    fn movements_follow_each_other_and_a_stop_does_not_wait() {
        let mut board = ready();
        let first = beat(&mut board, 0.02, 0.25, -0.1);
        assert_eq!(first, sealed("W 3 200") + &sealed("D 4 0 0 250000 -100000 20"));
        assert_eq!(beat(&mut board, 0.03, 0.3, 0.3), "");
        assert_eq!(beat(&mut board, 0.04, 0.3, 0.3), sealed("D 5 250000 -100000 300000 300000 20"));
        assert_eq!(beat(&mut board, 0.045, 0.0, 0.0), sealed("S 6"));
        assert!(board.servo(0, Radians(-0.5)) && !board.servo(1, Radians(0.0)));
        assert_eq!(beat(&mut board, 0.05, 0.0, 0.0), sealed("D 7 0 0 0 0 20") + &sealed("A 8 5 -500"));
    }

    #[test]
    fn measurements_are_read_and_lost_ones_counted() {
        let mut board = ready();
        let events = hear(&mut board, "M 65535 1200 -5 7 -250000 12500 -300 17");
        assert_eq!(events[0], Event::Counts(Sides::new(-5, 7)));
        assert_eq!(events[1], Event::Gyro(RadiansPerSecond(-0.25)));
        let [Event::Contacts(touch), Event::Battery(battery)] = &events[2..] else { panic!("{events:?}") };
        assert_eq!((touch.bump, touch.cliff), (Sides::new(true, false), Sides::new(true, false)));
        assert!((battery.voltage - 12.5).abs() < 1e-9);
        assert_eq!(hear(&mut board, "M 0 1220 0 0 0 0 0 0").len(), 4, "the number wraps");
        assert_eq!(hear(&mut board, "M 3 1280 0 0 0 0 0 0")[0], Event::Fault(Fault::Missed(2)));
        assert_eq!(hear(&mut board, "M 4 0 0 0 0 -1 0 0"), [Event::Fault(Fault::Absurd)]);
        assert_eq!(hear(&mut board, "M 4 0 x 0 0 0 0 0"), [Event::Fault(Fault::Garbage)]);
        assert_eq!(hear(&mut board, "E 4 2"), [Event::Fault(Fault::Refused)]);
        assert_eq!(hear(&mut board, "V 1 7B dwm-avr"), [Event::Restarted]);
        assert_eq!(hear(&mut board, "V 2 7B dwm-avr"), [Event::Foreign("version 2".into())]);
    }
}
