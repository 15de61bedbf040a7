//! An Arduino with ROSArduinoBridge: letters and decimal numbers, a line of answer to a line of question.
//!
//! *Says* `m left right` (counts in a frame of the board's speed controller) or `o left right` (powers of 255), `e` (what
//! do the encoders count), `b` (which baud rate), `s pin degrees`. *Hears* `OK`, two numbers, a number.
//! *Source*: the firmware `ROSArduinoBridge.ino` of hbrobotics/ros_arduino_bridge (commit 2b4567e). It takes the first
//! argument of `m` as the left wheel; its Python driver sends the right one first. `o` is a command of its forks, which
//! many boards have: a board that does not know it is told to have halted.
//! *When it fails*: 2 s after the last `m` or `o` the board stops by itself.

use crate::board::{Board, Event, Every, Fault, Rounding, given, powers, whole_power};
use crate::line::{Lines, excerpt};
use crate::params::{ArduinoParams, ServoParams};
use axle_schema::{MetresPerSecond, Radians, Seconds, Sides};
use std::collections::VecDeque;

/// Time from question to question, and from command to command.
const PERIOD: Seconds = Seconds(0.02);
/// Time from greeting to greeting.
const GREETING: Seconds = Seconds(0.25);
/// An answer that takes longer will not come.
const LATE: Seconds = Seconds(0.1);
/// Questions that may wait for their answers: a command, the encoders, a servo.
const MOST_WAITING: usize = 3;
/// The most counts in a frame: what the firmware's integers hold.
const MOST_COUNTS: i32 = 32_767;

/// The number of full power.
const FULL: f64 = 255.0;
/// So many powers in a row are refused by a board that does not know the command, and not by chance.
const MOST_REFUSED: u32 = 5;

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ask {
    /// `m`, `o` or `s`: the answer is OK.
    Order,
    /// `e`: two numbers.
    Encoders,
}

/// The conversation with the board.
#[derive(Debug)]
pub(crate) struct Arduino {
    params: ArduinoParams,
    /// Speed of one count in a frame, m/s.
    unit: Sides<f64>,
    servos: Vec<u8>,
    lines: Lines,
    greeted: bool,
    greeting: Every,
    polling: Every,
    ordering: Every,
    rounding: Rounding,
    resting: bool,
    /// Orders in a row that the board did not understand.
    refused: u32,
    waiting: VecDeque<(Ask, Seconds)>,
    turning: Vec<Option<i32>>,
}

impl Arduino {
    pub(crate) fn new(params: ArduinoParams, servos: &[ServoParams]) -> Self {
        Self {
            params,
            unit: params.gauge.tick().map(|tick| tick.0 * params.frames),
            servos: servos.iter().map(|servo| servo.pin).collect(),
            lines: Lines::new(b'\n', 96),
            greeted: false,
            greeting: Every::new(GREETING),
            polling: Every::new(PERIOD),
            ordering: Every::new(PERIOD),
            rounding: Rounding::default(),
            resting: true,
            refused: 0,
            waiting: VecDeque::new(),
            turning: vec![None; servos.len()],
        }
    }

    fn read(&mut self, line: &str, events: &mut Vec<Event>) {
        let line = line.trim();
        if line.is_empty() {
            return;
        }
        if !self.greeted {
            return self.greet(line, events);
        }
        // Answers come in the order of the questions; one that was lost must not shift all others.
        let kind = match (line, numbers(line)) {
            ("OK", _) => Some((Ask::Order, None)),
            (_, Some(counts)) => Some((Ask::Encoders, Some(counts))),
            ("Invalid Command", _) => {
                self.waiting.pop_front();
                events.push(Event::Fault(Fault::Refused));
                self.refused = self.refused.saturating_add(1);
                if self.params.powers && self.refused == MOST_REFUSED {
                    let why = "its firmware does not know the command `o`: leave arduino.powers false";
                    events.push(Event::Halted(why));
                }
                return;
            }
            _ => None,
        };
        let Some((kind, counts)) = kind else {
            events.push(Event::Fault(if line.parse::<u32>().is_ok() {
                Fault::Absurd
            } else {
                Fault::Garbage
            }));
            return;
        };
        let Some(at) = self.waiting.iter().position(|(ask, _)| *ask == kind) else {
            events.push(Event::Fault(Fault::Garbage));
            return;
        };
        for _ in 0..at {
            events.push(Event::Fault(Fault::Unanswered));
        }
        self.waiting.drain(..=at);
        if kind == Ask::Order && std::mem::take(&mut self.refused) >= MOST_REFUSED && self.params.powers {
            events.push(Event::Resumed);
        }
        events.push(counts.map_or(Event::Alive, Event::Counts));
    }

    /// Before the greeting is answered, what else comes is from an older conversation, or from another board.
    fn greet(&mut self, line: &str, events: &mut Vec<Event>) {
        match line.parse::<u32>() {
            Ok(baud) if baud == self.params.baud => {
                self.greeted = true;
                self.waiting.clear();
                events.push(Event::Hello(format!("ROSArduinoBridge at {baud} baud")));
            }
            Ok(_) => events.push(Event::Foreign(excerpt(line))),
            _ if line == "OK" || line == "Invalid Command" || numbers(line).is_some() => {}
            _ => events.push(Event::Foreign(excerpt(line))),
        }
    }
}

/// Two counters of 32 bits.
fn numbers(line: &str) -> Option<Sides<i64>> {
    let mut words = line.split_ascii_whitespace();
    let (left, right, end) = (words.next()?, words.next()?, words.next());
    let read = |word: &str| word.parse::<i32>().ok().map(i64::from);
    end.is_none().then_some(())?;
    Some(Sides::new(read(left)?, read(right)?))
}

impl Board for Arduino {
    fn open(&mut self, now: Seconds, out: &mut Vec<u8>) {
        *self = Self { servos: std::mem::take(&mut self.servos), ..Self::new(self.params, &[]) };
        self.turning = vec![None; self.servos.len()];
        // The end of a line that somebody else began, and the stop.
        out.extend_from_slice(b"\rm 0 0\r");
        // The first greeting waits for that to be read.
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
                out.extend_from_slice(b"b\r");
            }
            return;
        }
        while self.waiting.front().is_some_and(|(_, since)| now - *since > LATE) {
            self.waiting.pop_front();
            events.push(Event::Fault(Fault::Unanswered));
        }
        let rest = speeds.left.abs().max(speeds.right.abs()) <= MetresPerSecond::ZERO;
        // A stop does not wait for its turn.
        if rest && !self.resting {
            self.ordering.hurry();
        }
        if self.ordering.is_due(now) && (self.waiting.len() < MOST_WAITING || rest) {
            self.resting = rest;
            if self.params.powers {
                let whole = powers(speeds, self.params.full_speed).map(|power| whole_power(power, FULL));
                out.extend_from_slice(format!("o {} {}\r", whole.left, whole.right).as_bytes());
                events.push(Event::Signals(given(whole, FULL)));
            } else {
                let Sides { left, right } = self.rounding.round(speeds, self.unit, MOST_COUNTS);
                out.extend_from_slice(format!("m {left} {right}\r").as_bytes());
            }
            self.waiting.push_back((Ask::Order, now));
        }
        for (pin, degrees) in self.servos.iter().zip(&mut self.turning) {
            if self.waiting.len() < MOST_WAITING
                && let Some(degrees) = degrees.take()
            {
                out.extend_from_slice(format!("s {pin} {degrees}\r").as_bytes());
                self.waiting.push_back((Ask::Order, now));
            }
        }
        if self.waiting.len() < MOST_WAITING && self.polling.is_due(now) {
            out.extend_from_slice(b"e\r");
            self.waiting.push_back((Ask::Encoders, now));
        }
    }

    fn servo(&mut self, number: usize, angle: Radians) -> bool {
        let Some(turning) = self.turning.get_mut(number) else { return false };
        // A hobby servo goes from 0 to 180 degrees, and its middle is at 90.
        #[allow(clippy::cast_possible_truncation, reason = "0 to 180")]
        let degrees = (90.0 + angle.0.to_degrees()).clamp(0.0, 180.0).round() as i32;
        *turning = Some(degrees);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open() -> Arduino {
        let servo = ServoParams { pin: 3, ..ServoParams::default() };
        let mut board = Arduino::new(ArduinoParams::default(), &[servo]);
        let mut out = Vec::new();
        board.open(Seconds(0.0), &mut out);
        assert_eq!(out, b"\rm 0 0\r", "the stop comes first");
        board
    }
    fn hear(board: &mut Arduino, bytes: &[u8]) -> Vec<Event> {
        let mut events = Vec::new();
        board.hear(Seconds(1.0), bytes, &mut events);
        events
    }
    fn beat(board: &mut Arduino, now: f64, left: f64, right: f64) -> String {
        let (mut out, mut events) = (Vec::new(), Vec::new());
        let speeds = Sides::new(MetresPerSecond(left), MetresPerSecond(right));
        board.beat(Seconds(now), speeds, &mut out, &mut events);
        String::from_utf8(out).expect("text")
    }

    #[test]
    fn it_greets_commands_asks_and_understands() {
        let mut board = open();
        assert_eq!(beat(&mut board, 0.3, 0.5, 0.5), "b\r", "no speed before the greeting");
        assert_eq!(hear(&mut board, b"Invalid Command\r\nOK\r\n 576"), []);
        let hello = Event::Hello("ROSArduinoBridge at 57600 baud".into());
        assert_eq!(hear(&mut board, b"00\r\n"), [hello]);
        // 64 mm and 1200 counts a turn: 0.16755 mm a count, 5.0265 mm/s for a count in a frame.
        assert_eq!(beat(&mut board, 0.4, 0.502_65, -0.251_33), "m 100 -50\re\r");
        let counts = Event::Counts(Sides::new(12, -7));
        assert_eq!(hear(&mut board, b"OK\r\n12 -7\r\n"), [Event::Alive, counts]);
        assert_eq!(beat(&mut board, 0.405, 0.5, 0.5), "", "20 ms have not passed");
        assert_eq!(beat(&mut board, 0.41, 0.0, 0.0), "m 0 0\r", "but a stop does not wait");
        assert!(board.servo(0, Radians(0.5)) && !board.servo(1, Radians(0.5)));
        assert_eq!(beat(&mut board, 0.43, 0.0, 0.0), "m 0 0\rs 3 119\r");
    }

    #[test]
    fn powers_are_told_and_a_board_that_does_not_know_them_has_halted() {
        let mut board = Arduino::new(ArduinoParams { powers: true, ..ArduinoParams::default() }, &[]);
        board.open(Seconds(0.0), &mut Vec::new());
        hear(&mut board, b"57600\r\n");
        assert_eq!(beat(&mut board, 0.4, 0.6, -1.2), "o 128 -255\re\r");
        assert_eq!(hear(&mut board, b"OK\r\n0 0\r\n")[0], Event::Alive);
        let mut halted = 0;
        for step in 0..8_u32 {
            beat(&mut board, 0.5 + 0.03 * f64::from(step), 0.1, 0.1);
            let heard = hear(&mut board, b"Invalid Command\r\n0 0\r\n");
            halted += heard.iter().filter(|event| matches!(event, Event::Halted(_))).count();
        }
        assert_eq!(halted, 1, "told once");
        beat(&mut board, 0.9, 0.0, 0.0);
        assert!(hear(&mut board, b"OK\r\n").contains(&Event::Resumed), "another firmware was loaded");
    }

    #[test]
    fn another_baud_rate_and_other_boards_are_foreign() {
        for (bytes, said) in [(&b"9600\r\n"[..], "9600"), (b"V1.2\n", "V1.2"), (b"ERROR\r\n", "ERROR")] {
            assert_eq!(hear(&mut open(), bytes), [Event::Foreign(said.into())]);
        }
    }

    #[test]
    fn lost_and_wrong_answers_are_counted_and_shift_nothing() {
        let mut board = open();
        hear(&mut board, b"57600\r\n");
        beat(&mut board, 0.4, 0.1, 0.1);
        // The OK was lost.
        let unanswered = Event::Fault(Fault::Unanswered);
        assert_eq!(hear(&mut board, b"1 2\r\n"), [unanswered.clone(), Event::Counts(Sides::new(1, 2))]);
        beat(&mut board, 0.43, 0.1, 0.1);
        assert_eq!(hear(&mut board, b"Invalid Command\r\n"), [Event::Fault(Fault::Refused)]);
        assert_eq!(hear(&mut board, b"1 2 3\r\n"), [Event::Fault(Fault::Garbage)]);
        assert_eq!(hear(&mut board, b"99999999999 2\r\n"), [Event::Fault(Fault::Garbage)]);
        let (mut out, mut events) = (Vec::new(), Vec::new());
        board.beat(Seconds(0.6), Sides::default(), &mut out, &mut events);
        assert_eq!(events, [unanswered], "the encoders never came");
    }
}
