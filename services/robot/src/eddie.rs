//! Parallax Eddie: words and hexadecimal numbers, one request in flight, a carriage return as answer.
//!
//! *Says* `GOSPD left right` or `GO left right`, `DIST`, `ADC`, and at first `STOP 0`, `VER`, `VERB 1`, `WATCH 1`, `ACC n`. *Hears* numbers,
//! nothing, or `ERROR - why`.
//! *Source*: Parallax's command set 1.2 (2013), and the firmware of ddegn/EddieFirmware (commit 9690c98), by which speeds
//! are positions in half a second. Two numbers may be parted by any white space and need no zeros before them.
//! *When it fails*: after a second without a line the board stops by itself.

use crate::board::{Board, Event, Every, Fault, Rounding, given, powers, whole_power};
use crate::line::{Lines, excerpt};
use crate::params::EddieParams;
use axle_schema::board::BatteryData;
use axle_schema::{MetresPerSecond, Seconds, Sides};

/// Time from command to command, and from question to question.
const PERIOD: Seconds = Seconds(0.02);
/// Time from greeting to greeting.
const GREETING: Seconds = Seconds(0.25);
/// Time from one look at the battery to the next.
const BATTERY: Seconds = Seconds(1.0);
/// An answer that takes longer will not come.
const LATE: Seconds = Seconds(0.1);
/// The number of full power, in a byte.
const FULL: f64 = 127.0;
/// The numbers of ADC: its channels.
const CHANNELS: usize = 8;

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ask {
    Version,
    /// One of the settings, by its number.
    Set(usize),
    Speed,
    Distances,
    Channels,
}

/// The conversation with the board.
#[derive(Debug)]
pub(crate) struct Eddie {
    params: EddieParams,
    /// Speed 1 of each wheel, m/s.
    unit: Sides<f64>,
    lines: Lines,
    greeted: bool,
    /// Settings that have been made.
    set: usize,
    greeting: Every,
    ordering: Every,
    polling: Every,
    looking: Every,
    rounding: Rounding,
    resting: bool,
    waiting: Option<(Ask, Seconds)>,
}

/// A number as the board writes it: at most `digits` digits, two's complement of `bits` bits.
#[must_use]
pub fn hex(word: &str, digits: usize, bits: u32) -> Option<i64> {
    let is_hex =
        !word.is_empty() && word.len() <= digits && word.bytes().all(|byte| byte.is_ascii_hexdigit());
    let number = is_hex.then(|| i64::from_str_radix(word, 16).ok())??;
    let unused = 64_u32.checked_sub(bits)?;
    Some(number.checked_shl(unused)? >> unused)
}

impl Eddie {
    pub(crate) fn new(params: EddieParams) -> Self {
        Self {
            params,
            unit: params.gauge.tick().map(|tick| tick.0 / params.speed_time.0),
            lines: Lines::new(b'\r', 254),
            greeted: false,
            set: 0,
            greeting: Every::new(GREETING),
            ordering: Every::new(PERIOD),
            polling: Every::new(PERIOD),
            looking: Every::new(BATTERY),
            rounding: Rounding::default(),
            resting: true,
            waiting: None,
        }
    }

    /// Verbose errors, the watchdog, and the acceleration of the board's own ramps.
    fn settings(&self) -> [String; 3] {
        ["VERB 1".to_owned(), "WATCH 1".to_owned(), format!("ACC {:X}", self.params.acceleration)]
    }

    fn read(&mut self, line: &str, events: &mut Vec<Event>) {
        let line = line.trim();
        if !self.greeted {
            return self.greet(line, events);
        }
        let Some((ask, _)) = self.waiting.take() else {
            if !line.is_empty() {
                events.push(Event::Fault(Fault::Garbage));
            }
            return;
        };
        if line.starts_with("ERROR") {
            events.push(Event::Fault(Fault::Refused));
            return;
        }
        let words: Vec<&str> = line.split_ascii_whitespace().take(CHANNELS + 1).collect();
        let event = match (ask, words.as_slice()) {
            (Ask::Set(_) | Ask::Speed, []) => Event::Alive,
            (Ask::Distances, [left, right]) => match (hex(left, 8, 32), hex(right, 8, 32)) {
                (Some(left), Some(right)) => Event::Counts(Sides::new(left, right)),
                _ => Event::Fault(Fault::Garbage),
            },
            (Ask::Channels, words) if words.len() == CHANNELS => match hex(words[CHANNELS - 1], 3, 63) {
                Some(reading) => Event::Battery(self.battery(reading)),
                None => Event::Fault(Fault::Garbage),
            },
            _ => Event::Fault(Fault::Garbage),
        };
        if let (Ask::Set(number), Event::Alive) = (ask, &event) {
            self.set = self.set.max(number + 1);
        }
        events.push(event);
    }

    /// 0xFFF is 5 V at the channel, which is behind a divider.
    fn battery(&self, reading: i64) -> BatteryData {
        #[allow(clippy::cast_precision_loss, reason = "at most 0xFFF")]
        let voltage = reading as f64 / 4095.0 * self.params.battery_scale;
        BatteryData { stamp: Seconds::ZERO, voltage, current: None, left: None }
    }

    fn greet(&mut self, line: &str, events: &mut Vec<Event>) {
        // Answers to the stop and to what somebody else has begun.
        if line.is_empty() || line.starts_with("ERROR") {
            return;
        }
        match hex(line, 4, 16) {
            Some(version) if line.len() == 4 && matches!(self.waiting, Some((Ask::Version, _))) => {
                (self.greeted, self.waiting) = (true, None);
                events.push(Event::Hello(format!("Eddie, firmware {version:04X}")));
            }
            _ => events.push(Event::Foreign(excerpt(line))),
        }
    }

    /// The line that asks for these speeds.
    fn order(&mut self, speeds: Sides<MetresPerSecond>, events: &mut Vec<Event>) -> String {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "two's complement of 8 and of 16 bits"
        )]
        if self.params.powers {
            let whole = powers(speeds, self.params.full_speed).map(|power| whole_power(power, FULL));
            events.push(Event::Signals(given(whole, FULL)));
            let Sides { left, right } = whole.map(|power| power as u8);
            format!("GO {left:X} {right:X}")
        } else {
            let speeds = self.rounding.round(speeds, self.unit, 0x7FFF);
            let Sides { left, right } = speeds.map(|speed| speed as u16);
            format!("GOSPD {left:X} {right:X}")
        }
    }

    fn ask(&mut self, now: Seconds, ask: Ask, line: &str, out: &mut Vec<u8>) {
        out.extend_from_slice(line.as_bytes());
        out.push(b'\r');
        self.waiting = Some((ask, now));
    }
}

impl Board for Eddie {
    fn open(&mut self, now: Seconds, out: &mut Vec<u8>) {
        *self = Self::new(self.params);
        // The ends of lines that somebody else began, and the stop.
        out.extend_from_slice(b"\r\r\rSTOP 0\r");
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
        if !self.greeted {
            if self.greeting.is_due(now) {
                self.ask(now, Ask::Version, "VER", out);
            }
            return;
        }
        if self.waiting.is_some_and(|(_, since)| now - since > LATE) {
            self.waiting = None;
            // Half an answer must not become the beginning of the next one.
            self.lines.clear();
            events.push(Event::Fault(Fault::Unanswered));
        }
        let rest = speeds.left.abs().max(speeds.right.abs()) <= MetresPerSecond::ZERO;
        if rest && !self.resting {
            // A stop does not wait for the answer to anything; what is asked meanwhile is asked again.
            self.resting = true;
            self.rounding = Rounding::default();
            let line = self.order(Sides::default(), events);
            self.ask(now, Ask::Speed, &line, out);
            return;
        }
        if self.waiting.is_some() {
            return;
        }
        if let Some(setting) = self.settings().get(self.set) {
            self.ask(now, Ask::Set(self.set), setting, out);
        } else if self.ordering.is_due(now) {
            self.resting = rest;
            let line = self.order(speeds, events);
            self.ask(now, Ask::Speed, &line, out);
        } else if self.polling.is_due(now) {
            self.ask(now, Ask::Distances, "DIST", out);
        } else if self.looking.is_due(now) {
            self.ask(now, Ask::Channels, "ADC", out);
        }
    }

    fn restarted(&mut self) {
        self.set = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open() -> Eddie {
        let mut board = Eddie::new(EddieParams::default());
        let mut out = Vec::new();
        board.open(Seconds(0.0), &mut out);
        assert_eq!(out, b"\r\r\rSTOP 0\r", "the stop comes first");
        board
    }
    fn hear(board: &mut Eddie, bytes: &[u8]) -> Vec<Event> {
        let mut events = Vec::new();
        board.hear(Seconds(1.0), bytes, &mut events);
        events
    }
    fn beat(board: &mut Eddie, now: f64, left: f64, right: f64) -> String {
        let (mut out, mut events) = (Vec::new(), Vec::new());
        let speeds = Sides::new(MetresPerSecond(left), MetresPerSecond(right));
        board.beat(Seconds(now), speeds, &mut out, &mut events);
        String::from_utf8(out).expect("text")
    }
    fn ready() -> Eddie {
        let mut board = open();
        assert_eq!(beat(&mut board, 0.3, 0.5, 0.5), "VER\r");
        assert_eq!(hear(&mut board, b"\r000A\r"), [Event::Hello("Eddie, firmware 000A".into())]);
        for said in ["VERB 1\r", "WATCH 1\r", "ACC 400\r"] {
            assert_eq!(beat(&mut board, 0.31, 0.0, 0.0), said);
            assert_eq!(hear(&mut board, b"\r"), [Event::Alive]);
        }
        board
    }

    #[test]
    fn one_request_is_in_flight_and_a_stop_does_not_wait() {
        let mut board = ready();
        // 144 positions of 3.325 mm in a turn; speed 1 is 6.65 mm/s.
        assert_eq!(beat(&mut board, 0.4, 0.312_54, -0.066_5), "GOSPD 2F FFF6\r");
        assert_eq!(beat(&mut board, 0.45, 0.3, 0.3), "", "its answer has not come");
        assert_eq!(beat(&mut board, 0.46, 0.0, 0.0), "GOSPD 0 0\r");
        assert_eq!(hear(&mut board, b"\r"), [Event::Alive]);
        assert_eq!(beat(&mut board, 0.47, 0.0, 0.0), "GOSPD 0 0\r");
        assert_eq!(hear(&mut board, b"\r"), [Event::Alive]);
        assert_eq!(beat(&mut board, 0.475, 0.0, 0.0), "DIST\r");
        // The example of the document, case 8 of `golden`.
        let counts = Event::Counts(Sides::new(1_351_014_186, 13_534_095));
        assert_eq!(hear(&mut board, b"5086D72A  00CE838F\r"), [counts]);
        assert_eq!(beat(&mut board, 0.48, 0.0, 0.0), "ADC\r");
        let heard = hear(&mut board, b"9C7 11E E4E 5AB 20F 97B 767 99A\r");
        let [Event::Battery(battery)] = &heard[..] else { panic!("{heard:?}") };
        assert!((battery.voltage - 12.0).abs() < 0.01, "{battery:?}");
    }

    #[test]
    fn powers_are_bytes() {
        let mut board = Eddie::new(EddieParams { powers: true, ..EddieParams::default() });
        let speeds = Sides::new(MetresPerSecond(1.2 * 54.0 / 127.0), MetresPerSecond(-1.2 * 68.0 / 127.0));
        let mut events = Vec::new();
        // The example of the document, case 1 of `golden`.
        assert_eq!(board.order(speeds, &mut events), "GO 36 BC");
        assert!(matches!(events[..], [Event::Signals(_)]));
        let fast = MetresPerSecond(9.0);
        assert_eq!(board.order(Sides::new(fast, -fast), &mut events), "GO 7F 81");
    }

    #[test]
    fn errors_garbage_and_silence_are_counted() {
        let mut board = ready();
        for (answer, fault) in [
            ("ERROR - Invalid parameter\r", Fault::Refused),
            ("XYZ\r", Fault::Garbage),
            ("123456789 0\r", Fault::Garbage),
        ] {
            beat(&mut board, 0.5, 0.1, 0.1);
            assert_eq!(hear(&mut board, answer.as_bytes()), [Event::Fault(fault)], "{answer:?}");
            board.waiting = None;
        }
        board.restarted();
        assert_eq!(beat(&mut board, 0.9, 0.1, 0.1), "VERB 1\r", "a board that has restarted is set again");
        board.waiting = Some((Ask::Distances, Seconds(1.0)));
        let (mut out, mut events) = (Vec::new(), Vec::new());
        board.beat(Seconds(1.2), Sides::default(), &mut out, &mut events);
        assert_eq!(events, [Event::Fault(Fault::Unanswered)]);
    }

    #[test]
    fn other_boards_are_foreign() {
        let mut board = open();
        beat(&mut board, 0.3, 0.0, 0.0);
        assert_eq!(hear(&mut board, b"Invalid Command\r"), [Event::Foreign("Invalid Command".into())]);
    }
}
