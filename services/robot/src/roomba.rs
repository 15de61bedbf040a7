//! iRobot Create and Roomba: the Open Interface, binary and silent.
//!
//! *Says* START, SAFE or FULL, DRIVE DIRECT or DRIVE PWM (right wheel first) or DRIVE, STREAM or SENSORS. *Hears* frames of packets:
//! bumps, cliffs, battery, mode, and encoder counts or distance and angle, by dialect.
//! *Source*: the Create and Create 2 Open Interface documents. The checksum of a stream includes its header on a
//! Create 2 and leaves it out in the document of Create 1: either is taken.
//! *When it fails*: no command is acknowledged, and there is no watchdog. In Safe mode the robot stops at a cliff, when a
//! wheel drops and on the charger; when its line is cut while it drives, it drives on. Keep the computer on the robot.

mod frame;

use crate::board::{Board, Event, Every, Fault, given, powers, whole_power};
use crate::params::{Dialect, RoombaParams};
use axle_schema::{Metres, MetresPerSecond, Seconds, Sides, Track};
use frame::{Frame, Frames};

/// Time from command to command.
const PERIOD: Seconds = Seconds(0.02);
/// Time from greeting to greeting, and between attempts to get out of Passive mode.
const GREETING: Seconds = Seconds(0.5);
/// Time from question to question of the dialect that has no stream.
const POLL: Seconds = Seconds(0.05);
/// Nothing drives faster, mm/s.
const FASTEST: f64 = 500.0;
/// The number of full power.
const FULL_POWER: f64 = 255.0;
/// The largest radius, mm; beyond it, straight on.
const WIDEST: f64 = 2000.0;

const START: u8 = 128;
const SAFE: u8 = 131;
const FULL: u8 = 132;
const DRIVE: u8 = 137;
const SENSORS: u8 = 142;
const DRIVE_DIRECT: u8 = 145;
const DRIVE_PWM: u8 = 146;
const STREAM: u8 = 148;

/// The conversation with the robot.
#[derive(Debug)]
pub(crate) struct Roomba {
    params: RoombaParams,
    track: f64,
    frames: Frames,
    greeted: bool,
    halted: bool,
    greeting: Every,
    ordering: Every,
    polling: Every,
    resting: bool,
}

impl Roomba {
    pub(crate) fn new(params: RoombaParams, track: Track) -> Self {
        Self {
            params,
            track: track.get(),
            frames: Frames::new(params.dialect),
            greeted: false,
            halted: false,
            greeting: Every::new(GREETING),
            ordering: Every::new(PERIOD),
            polling: Every::new(POLL),
            resting: true,
        }
    }

    const fn mode(&self) -> u8 {
        if self.params.full { FULL } else { SAFE }
    }

    fn greet(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(&[START, self.mode()]);
        let packets = self.frames.packets();
        if let Ok(count) = u8::try_from(packets.len())
            && count > 0
        {
            out.extend_from_slice(&[STREAM, count]);
            out.extend_from_slice(packets);
        }
    }

    fn read(&mut self, frame: &Frame, events: &mut Vec<Event>) {
        // 2 Safe, 3 Full; a dialect that does not say its mode is believed.
        let drives = frame.mode.is_none_or(|mode| mode >= 2);
        if !self.greeted {
            if !drives {
                return;
            }
            self.greeted = true;
            let mode = frame.mode.map_or("", |mode| if mode == 3 { ", full mode" } else { ", safe mode" });
            events.push(Event::Hello(format!("Open Interface, {}{mode}", self.frames.name())));
        }
        match (self.halted, drives) {
            (false, false) => {
                self.halted = true;
                events.push(Event::Halted(
                    "it has left its driving mode: a cliff, a lifted wheel, the charger, or a button",
                ));
            }
            (true, true) => {
                self.halted = false;
                events.push(Event::Resumed);
            }
            _ => {}
        }
        if let Some(counts) = frame.counts {
            events.push(Event::Counts(counts));
        }
        if let Some((distance, angle)) = frame.moved {
            events.push(Event::Covered(self.covered(distance, angle)));
        }
        if let Some(contacts) = frame.contacts {
            events.push(Event::Contacts(contacts));
        }
        if let Some(battery) = frame.battery {
            events.push(Event::Battery(battery));
        }
    }

    /// What the wheels have covered when their middle covered `distance` mm, and the robot turned by `angle`, in
    /// degrees, or in mm of the difference of both wheels by half, as the oldest dialect has it.
    fn covered(&self, distance: f64, angle: f64) -> Sides<Metres> {
        let half = match self.params.dialect {
            Dialect::Roomba400 => angle / 1000.0,
            _ => (angle / self.params.angle_scale).to_radians() * self.track / 2.0,
        };
        let middle = distance / 1000.0;
        Sides::new(Metres(middle - half), Metres(middle + half))
    }

    fn powers(&self, speeds: Sides<MetresPerSecond>) -> Sides<i32> {
        powers(speeds, self.params.full_speed).map(|power| whole_power(power, FULL_POWER))
    }

    fn order(&self, speeds: Sides<MetresPerSecond>, out: &mut Vec<u8>) {
        if self.params.powers {
            let powers = self.powers(speeds);
            out.push(DRIVE_PWM);
            for power in [powers.right, powers.left] {
                out.extend_from_slice(&whole(f64::from(power)).to_be_bytes());
            }
            return;
        }
        let limited = |speed: MetresPerSecond| {
            let speed = speed.0 * 1000.0;
            if speed.is_finite() { speed.clamp(-FASTEST, FASTEST) } else { 0.0 }
        };
        let Sides { left, right } = speeds.map(limited);
        if self.params.dialect == Dialect::Roomba400 {
            let (speed, radius) = bend(left, right, self.track * 1000.0);
            out.push(DRIVE);
            out.extend_from_slice(&speed.to_be_bytes());
            out.extend_from_slice(&radius.to_be_bytes());
        } else {
            out.push(DRIVE_DIRECT);
            out.extend_from_slice(&whole(right).to_be_bytes());
            out.extend_from_slice(&whole(left).to_be_bytes());
        }
    }
}

/// The nearest whole number.
fn whole(number: f64) -> i16 {
    #[allow(clippy::cast_possible_truncation, reason = "limited to 16 bits")]
    let whole = number.round().clamp(-32_768.0, 32_767.0) as i16;
    whole
}

/// The speed of the middle, mm/s, and the radius, mm, at which both wheels run as they shall. On the spot, the speed is
/// that of the wheels and the radius 1 to the left, -1 to the right; straight on, it is 0x8000.
fn bend(left: f64, right: f64, track: f64) -> (i16, i16) {
    let (middle, half) = (f64::midpoint(left, right), (right - left) / 2.0);
    if half.abs() < 0.5 {
        return (whole(middle), i16::MIN);
    }
    if middle.abs() < 0.5 {
        return (whole(half.abs()), if half > 0.0 { 1 } else { -1 });
    }
    let radius = track / 2.0 * middle / half;
    if radius.abs() > WIDEST { (whole(middle), i16::MIN) } else { (whole(middle), whole(radius)) }
}

impl Board for Roomba {
    fn open(&mut self, now: Seconds, out: &mut Vec<u8>) {
        let frames = Frames::new(self.params.dialect);
        *self = Self { frames, greeted: false, halted: false, resting: true, ..*self };
        // Zeros end a command that was cut off, as 0 mm/s, and mean nothing by themselves. Then the stop.
        out.extend_from_slice(&[0; 12]);
        self.order(Sides::default(), out);
        self.greeting.hurry();
        self.greeting.is_due(now);
        self.greet(out);
    }

    fn hear(&mut self, at: Seconds, bytes: &[u8], events: &mut Vec<Event>) {
        for byte in bytes {
            match self.frames.push(at, *byte) {
                Some(Ok(frame)) => self.read(&frame, events),
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
        if (!self.greeted || self.halted) && self.greeting.is_due(now) {
            self.greet(out);
        }
        if self.params.dialect == Dialect::Roomba400 && self.polling.is_due(now) {
            if self.frames.expect_group() {
                events.push(Event::Fault(Fault::Half));
            }
            out.extend_from_slice(&[SENSORS, 0]);
        }
        if !self.greeted {
            return;
        }
        let rest = speeds.left.abs().max(speeds.right.abs()) <= MetresPerSecond::ZERO;
        if rest && !self.resting {
            self.ordering.hurry();
        }
        if self.ordering.is_due(now) {
            self.resting = rest;
            self.order(speeds, out);
            if self.params.powers {
                events.push(Event::Signals(given(self.powers(speeds), FULL_POWER)));
            }
        }
    }

    fn counter_bits(&self) -> u32 {
        16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roomba(dialect: Dialect) -> Roomba {
        let track = Track::new(Metres(0.26)).expect("a track");
        Roomba::new(RoombaParams { dialect, ..RoombaParams::default() }, track)
    }
    fn order(dialect: Dialect, left: f64, right: f64) -> Vec<u8> {
        let mut out = Vec::new();
        let speeds = Sides::new(MetresPerSecond(left), MetresPerSecond(right));
        roomba(dialect).order(speeds, &mut out);
        out
    }

    #[test]
    fn the_right_wheel_comes_first_and_nothing_is_too_fast() {
        // The bytes of libcreate (BSD-3-Clause, commit 116be44), cases 2 to 7 of `golden`.
        for (left, right, bytes) in [
            (0.2, 0.2, [145, 0, 200, 0, 200]),
            (0.2, -0.2, [145, 255, 56, 0, 200]),
            (-9.0, 9.0, [145, 1, 244, 254, 12]),
            (f64::NAN, f64::INFINITY, [145, 0, 0, 0, 0]),
        ] {
            assert_eq!(order(Dialect::Create2, left, right), bytes, "{left} {right}");
        }
    }

    #[test]
    fn the_oldest_dialect_gets_a_speed_and_a_radius() {
        for (left, right, speed, radius) in [
            (0.2, 0.2, 200_i16, i16::MIN),
            (-0.1, 0.1, 100, 1),
            (0.1, -0.1, 100, -1),
            (0.1, 0.3, 200, 260),
            (-0.3, -0.1, -200, -260),
            (0.2, 0.2001, 200, i16::MIN),
        ] {
            let [[a, b], [c, d]] = [speed.to_be_bytes(), radius.to_be_bytes()];
            assert_eq!(order(Dialect::Roomba400, left, right), [137, a, b, c, d], "{left} {right}");
        }
    }

    #[test]
    fn a_stop_is_said_before_anything_else_even_into_a_half_command() {
        let mut out = Vec::new();
        roomba(Dialect::Create2).open(Seconds(0.0), &mut out);
        assert_eq!(out[..17], [&[0; 12][..], &[145, 0, 0, 0, 0]].concat());
        assert_eq!(out[17..21], [128, 131, 148, 12]);
    }

    #[test]
    fn what_leaves_its_driving_mode_has_halted_until_it_is_back() {
        let mut roomba = roomba(Dialect::Create2);
        let frame = |mode| Frame { mode: Some(mode), ..Frame::default() };
        let mut read = |mode| {
            let mut events = Vec::new();
            roomba.read(&frame(mode), &mut events);
            events
        };
        assert_eq!(read(1), [], "it has not taken the command yet");
        assert!(matches!(read(2)[..], [Event::Hello(_)]));
        assert!(matches!(read(1)[..], [Event::Halted(_)]));
        assert_eq!(read(1), []);
        assert_eq!(read(2), [Event::Resumed]);
    }
}
