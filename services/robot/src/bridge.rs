//! What every board has around its protocol: the greeting, the stop that is said first, distances, wheels that are
//! wired otherwise, and what happens when it falls silent.

use crate::board::{Board, Event};
use crate::odometer::{Odometer, Reading};
use crate::params::{BoardKind, Mount, RobotParams, ServoParams};
use axle_schema::board::{BatteryData, BoardState, ContactsData, LinkState};
use axle_schema::refusal::within;
use axle_schema::{
    Duty, EncodersData, InertialData, MetresPerSecond, Radians, Refusal, Seconds, Sides, Signals,
};

/// A board that says nothing for so many times `silence` is hung up on, and greeted anew.
const PATIENCE: f64 = 4.0;

/// What was measured since it was asked last: the newest of each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct News {
    /// Distances of the wheels since the process began.
    pub encoders: Option<EncodersData>,
    /// The turn rate.
    pub inertial: Option<InertialData>,
    /// What the robot touches.
    pub contacts: Option<ContactsData>,
    /// The battery.
    pub battery: Option<BatteryData>,
    /// The duty cycles of the motors.
    pub signals: Option<Signals>,
}

/// One end of the line: a board of one kind, and how the conversation with it is.
#[derive(Debug)]
pub struct Bridge {
    board: Box<dyn Board>,
    odometer: Odometer,
    mount: Mount,
    servos: Vec<ServoParams>,
    silence: Seconds,
    greeting: Seconds,
    state: BoardState,
    /// When the port was opened, and when the board said something that counts last.
    begun: Seconds,
    heard: Seconds,
    covered: Option<Seconds>,
    foreign: Option<String>,
    has_restarted: bool,
    hang_up: Option<Refusal>,
    news: News,
    /// What it measures keeps the wheels; where it measures nothing, that it takes its orders.
    measures: bool,
}

impl Bridge {
    /// The bridge to a board of `kind` at `port`, which is not open yet.
    ///
    /// # Errors
    /// Refuses parameters out of range.
    pub fn new(params: &RobotParams, kind: BoardKind, port: &str) -> Result<Self, Refusal> {
        axle_schema::contract::Bounds::check(params)?;
        params.fits(kind)?;
        let board = params.board(kind);
        let odometer = Odometer::new(params.tick(kind), board.counter_bits(), params.robot.wheel_speed.0);
        let why = Refusal::unavailable(format!("{} at {port}", kind.name()), "the port is not open yet");
        let state = BoardState {
            board: kind.name().to_owned(),
            port: port.chars().take(256).collect(),
            why: Some(why),
            ..BoardState::default()
        };
        Ok(Self {
            board,
            odometer,
            mount: params.mount,
            servos: params.servos.clone(),
            silence: params.silence,
            greeting: params.greeting,
            state,
            begun: Seconds::ZERO,
            heard: Seconds::ZERO,
            covered: None,
            foreign: None,
            has_restarted: false,
            hang_up: None,
            news: News::default(),
            measures: kind.has_encoders(),
        })
    }

    /// The port is open: says what stops the wheels, and greets the board.
    pub fn opened(&mut self, now: Seconds, out: &mut Vec<u8>) {
        self.state.opened = self.state.opened.saturating_add(1);
        self.state.link = LinkState::Greeting;
        self.state.version = None;
        self.state.why = Some(self.unavailable("it has not answered the greeting yet"));
        (self.begun, self.heard) = (now, now);
        (self.covered, self.foreign, self.hang_up) = (None, None, None);
        self.board.open(now, out);
    }

    /// The port is not open, or not any more.
    pub fn closed(&mut self, why: Refusal) {
        self.state.link = LinkState::Absent;
        self.state.why = Some(why);
        self.hang_up = None;
    }

    /// Takes bytes that came at `at`.
    pub fn hear(&mut self, at: Seconds, bytes: &[u8]) {
        if self.state.link == LinkState::Absent {
            return;
        }
        let mut events = Vec::new();
        self.board.hear(at, bytes, &mut events);
        for event in events {
            self.take(at, event);
        }
    }

    /// So many pieces of the stream were left out, since they came faster than they could be taken in.
    pub const fn flooded(&mut self, pieces: u32) {
        self.state.faults.flooded = self.state.faults.flooded.saturating_add(pieces);
    }

    /// Says what is due, for wheels that shall run at `speeds`.
    pub fn beat(&mut self, now: Seconds, speeds: Sides<MetresPerSecond>, out: &mut Vec<u8>) {
        match self.state.link {
            LinkState::Absent => return,
            LinkState::Greeting if now - self.begun > self.greeting => {
                let why = self.foreign.take().map_or_else(
                    || self.unavailable("it does not answer: is it switched on, and is the baud rate right?"),
                    |said| Refusal::Unknown {
                        what: format!("answer of the board at {}", self.state.port),
                        got: said,
                        known: format!("those of the kind {}; is it another one?", self.state.board),
                    },
                );
                self.state.why = Some(why.clone());
                self.hang_up = Some(why);
            }
            LinkState::Up | LinkState::Halted if now - self.heard > self.silence * PATIENCE => {
                self.hang_up = Some(self.unavailable("it has fallen silent"));
            }
            _ => {}
        }
        let speeds = match self.state.link {
            LinkState::Up => self.to_motors(speeds),
            _ => Sides::default(),
        };
        let mut events = Vec::new();
        self.board.beat(now, speeds, out, &mut events);
        for event in events {
            self.take(now, event);
        }
    }

    /// Why the port is to be closed and opened anew, once.
    pub const fn hangs_up(&mut self) -> Option<Refusal> {
        self.hang_up.take()
    }

    /// Whether the wheels can be driven.
    ///
    /// # Errors
    /// Why they cannot. A restart of the board is told once: what it did meanwhile nobody knows.
    pub fn health(&mut self, now: Seconds) -> Result<(), Refusal> {
        if std::mem::take(&mut self.has_restarted) {
            return Err(Refusal::Failed { why: format!("the board ({}) has restarted", self.state.board) });
        }
        match self.state.link {
            LinkState::Up if now - self.heard <= self.silence => Ok(()),
            LinkState::Up => Err(self.unavailable("it says nothing")),
            _ => Err(self.state.why.clone().unwrap_or_else(|| self.unavailable("it does not answer"))),
        }
    }

    /// What was measured since this was asked last.
    pub fn news(&mut self) -> News {
        std::mem::take(&mut self.news)
    }

    /// How the conversation is.
    #[must_use]
    pub fn state(&self, now: Seconds) -> BoardState {
        BoardState { stamp: now, ..self.state.clone() }
    }

    /// Turns the servo of that number.
    ///
    /// # Errors
    /// Refuses a servo that is not there, and an angle beyond its limits.
    pub fn servo(&mut self, number: usize, angle: Radians) -> Result<(), Refusal> {
        let absent =
            || Refusal::missing(format!("servo {number}"), "name it under `servos` of the parameters");
        let servo = self.servos.get(number).ok_or_else(absent)?;
        within(&format!("angle of servo {number} in rad"), angle.0, servo.min.0, servo.max.0)?;
        if self.board.servo(number, angle) {
            return Ok(());
        }
        Err(Refusal::missing(format!("servo {number}"), format!("{} drives no servos", self.state.board)))
    }

    fn unavailable(&self, why: &str) -> Refusal {
        Refusal::unavailable(format!("{} at {}", self.state.board, self.state.port), why)
    }

    fn take(&mut self, at: Seconds, event: Event) {
        match event {
            Event::Hello(version) => {
                self.state.link = LinkState::Up;
                self.state.version = Some(version.chars().take(96).collect());
                self.state.why = None;
                self.heard = at;
            }
            Event::Counts(counts) => self.count(at, self.of_encoders(counts)),
            Event::Covered(covered) => {
                let span = self.covered.replace(at).map_or(Seconds::ZERO, |last| at - last);
                let covered = self.of_encoders(covered);
                match self.odometer.cover(span, covered) {
                    Ok(()) => self.measured(at),
                    Err(fault) => fault.count(&mut self.state.faults),
                }
            }
            Event::Gyro(gyro) => {
                self.news.inertial = Some(InertialData { stamp: at, gyro, ax: None, ay: None });
            }
            Event::Contacts(contacts) => {
                self.news.contacts = Some(ContactsData { stamp: at, ..contacts });
            }
            Event::Battery(battery) => self.news.battery = Some(BatteryData { stamp: at, ..battery }),
            Event::Signals(signals) => {
                if !self.measures {
                    self.heard = at;
                }
                let Sides { left, right } = self.of_motors(signals);
                self.news.signals = Some(Signals { left, right });
            }
            // That it answers is not enough, where it should measure: only what is measured keeps the wheels.
            Event::Alive => {}
            Event::Restarted => self.restart(),
            Event::Halted(why) => {
                self.state.link = LinkState::Halted;
                let why = format!("the board ({}) does not drive: {why}", self.state.board);
                self.state.why = Some(Refusal::Failed { why });
            }
            Event::Resumed => {
                self.state.link = LinkState::Up;
                self.state.why = None;
            }
            Event::Foreign(said) => {
                if self.state.link == LinkState::Greeting {
                    self.foreign.get_or_insert(said);
                }
                self.state.faults.garbage = self.state.faults.garbage.saturating_add(1);
            }
            Event::Fault(fault) => fault.count(&mut self.state.faults),
        }
    }

    fn count(&mut self, at: Seconds, counts: Sides<i64>) {
        match self.odometer.count(at, counts) {
            Ok(reading) => {
                if reading == Reading::Anew {
                    self.board.restarted();
                    self.restart();
                }
                self.measured(at);
            }
            Err(fault) => fault.count(&mut self.state.faults),
        }
    }

    fn restart(&mut self) {
        self.state.restarts = self.state.restarts.saturating_add(1);
        self.has_restarted = true;
    }

    fn measured(&mut self, at: Seconds) {
        self.heard = at;
        let Sides { left, right } = self.odometer.distances();
        self.news.encoders = Some(EncodersData { stamp: at, left, right });
    }

    /// From the wheels to the motors that turn them.
    fn to_motors(&self, speeds: Sides<MetresPerSecond>) -> Sides<MetresPerSecond> {
        let turned = speeds.zip(self.mount.inverted_motors, |speed, is| if is { -speed } else { speed });
        if self.mount.swapped_motors { swapped(turned) } else { turned }
    }
    fn of_motors(&self, powers: Sides<Duty>) -> Sides<Duty> {
        let powers = if self.mount.swapped_motors { swapped(powers) } else { powers };
        let inverse = |power: Duty| Duty::new(-power.get()).unwrap_or_default();
        powers.zip(self.mount.inverted_motors, |power, is| if is { inverse(power) } else { power })
    }
    /// From the encoders to the wheels that they count.
    fn of_encoders<T: Invertible>(&self, read: Sides<T>) -> Sides<T> {
        let read = if self.mount.swapped_encoders { swapped(read) } else { read };
        read.zip(self.mount.inverted_encoders, |read, is| if is { read.inverse() } else { read })
    }
}

fn swapped<T>(sides: Sides<T>) -> Sides<T> {
    Sides::new(sides.right, sides.left)
}

/// What has an opposite, even where a number has none.
trait Invertible {
    fn inverse(self) -> Self;
}
impl Invertible for i64 {
    fn inverse(self) -> Self {
        self.wrapping_neg()
    }
}
impl Invertible for axle_schema::Metres {
    fn inverse(self) -> Self {
        -self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::Metres;

    fn arduino(params: &RobotParams) -> Bridge {
        let mut bridge = Bridge::new(params, BoardKind::Arduino, "ttyUSB0").expect("a bridge");
        let mut out = Vec::new();
        bridge.opened(Seconds(0.0), &mut out);
        assert!(out.starts_with(b"\rm 0 0\r"));
        bridge
    }
    fn said(bridge: &mut Bridge, now: f64, left: f64, right: f64) -> String {
        let mut out = Vec::new();
        bridge.beat(Seconds(now), Sides::new(MetresPerSecond(left), MetresPerSecond(right)), &mut out);
        String::from_utf8(out).expect("text")
    }

    #[test]
    fn a_board_drives_after_its_greeting_and_is_given_up_when_it_is_silent() {
        let mut bridge = arduino(&RobotParams::default());
        assert!(bridge.health(Seconds(0.1)).is_err(), "not greeted");
        bridge.hear(Seconds(0.2), b"57600\r\n");
        assert_eq!(bridge.health(Seconds(0.2)), Ok(()));
        assert_eq!(said(&mut bridge, 0.2, 0.502_65, 0.0), "m 100 0\re\r");
        bridge.hear(Seconds(0.21), b"OK\r\n1000 0\r\n");
        said(&mut bridge, 0.23, 0.5, 0.0);
        bridge.hear(Seconds(0.24), b"OK\r\n1100 0\r\n");
        let encoders = bridge.news().encoders.expect("a reading");
        assert!((encoders.left.0 - 100.0 * 0.064 * std::f64::consts::PI / 1200.0).abs() < 1e-12);
        assert_eq!(encoders.stamp, Seconds(0.24));
        assert_eq!(bridge.news(), News::default(), "told once");
        let silent = bridge.health(Seconds(0.5)).expect_err("silent").to_string();
        assert!(silent.contains("arduino at ttyUSB0") && silent.contains("says nothing"), "{silent}");
        said(&mut bridge, 1.3, 0.5, 0.0);
        assert!(bridge.hangs_up().is_some_and(|why| why.to_string().contains("silent")));
        bridge.closed(Refusal::unavailable("port", "gone"));
        assert_eq!(said(&mut bridge, 1.4, 0.5, 0.5), "", "nothing is said to no port");
        bridge.hear(Seconds(1.4), b"57600\r\n");
        assert_eq!(bridge.state(Seconds(1.4)).link, LinkState::Absent);
    }

    #[test]
    fn who_does_not_answer_and_who_is_somebody_else_are_told_apart() {
        let mut bridge = arduino(&RobotParams::default());
        said(&mut bridge, 5.1, 0.0, 0.0);
        let why = bridge.hangs_up().expect("no answer").to_string();
        assert!(why.contains("baud rate"), "{why}");
        let mut bridge = arduino(&RobotParams::default());
        bridge.hear(Seconds(0.2), b"V1.2\n");
        said(&mut bridge, 5.1, 0.0, 0.0);
        let why = bridge.hangs_up().expect("a stranger").to_string();
        assert!(why.contains("kind arduino") && why.contains("V1.2"), "{why}");
    }

    #[test]
    fn a_restart_is_told_once_and_changes_no_distance() {
        let mut bridge = arduino(&RobotParams::default());
        bridge.hear(Seconds(0.2), b"57600\r\n");
        let mut read = |now: f64, counts: &str| {
            said(&mut bridge, now, 0.0, 0.0);
            bridge.hear(Seconds(now), format!("OK\r\n{counts}\r\n").as_bytes());
            (bridge.news().encoders.map(|encoders| encoders.left), bridge.health(Seconds(now)).is_ok())
        };
        assert_eq!(read(0.2, "90000 0"), (Some(Metres(0.0)), true));
        assert_eq!(read(0.25, "0 0"), (Some(Metres(0.0)), false));
        assert_eq!(read(0.3, "0 0"), (Some(Metres(0.0)), true));
    }

    #[test]
    fn swapped_and_inverted_wheels_are_put_right_at_the_edge() {
        let mount = Mount {
            swapped_motors: true,
            inverted_motors: Sides::new(true, false),
            swapped_encoders: true,
            inverted_encoders: Sides::new(true, false),
        };
        let mut bridge = arduino(&RobotParams { mount, ..RobotParams::default() });
        bridge.hear(Seconds(0.2), b"57600\r\n");
        // The right wheel is at the left motor; the motor of the left wheel runs backward.
        assert_eq!(said(&mut bridge, 0.2, 0.1, 0.2), "m 40 -20\re\r");
        bridge.hear(Seconds(0.2), b"OK\r\n0 0\r\n");
        said(&mut bridge, 0.22, 0.1, 0.2);
        bridge.hear(Seconds(0.22), b"OK\r\n40 -20\r\n");
        let encoders = bridge.news().encoders.expect("a reading");
        assert!(
            encoders.left.0 > 0.0 && (encoders.right.0 - 2.0 * encoders.left.0).abs() < 1e-12,
            "{encoders:?}"
        );
    }

    #[test]
    fn servos_have_limits_and_must_be_there() {
        let params = RobotParams {
            servos: vec![ServoParams { pin: 2, ..ServoParams::default() }],
            ..RobotParams::default()
        };
        let mut bridge = arduino(&params);
        assert_eq!(bridge.servo(0, Radians(1.0)), Ok(()));
        for (number, angle) in [(0, 1.6), (0, f64::NAN), (1, 0.0)] {
            assert!(bridge.servo(number, Radians(angle)).is_err(), "{number} {angle}");
        }
        let mut roomba = Bridge::new(&params, BoardKind::Roomba, "p").expect("a bridge");
        assert!(roomba.servo(0, Radians(1.0)).expect_err("none").to_string().contains("drives no servos"));
    }
}
