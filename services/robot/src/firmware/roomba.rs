//! A Create or Roomba, as the Open Interface documents have it.

use super::{Body, Firmware, Quirks, Regulator, counts};
use crate::params::{Dialect, RoombaParams};
use axle_schema::{Metres, MetresPerSecond, Seconds, Sides, Track};

/// Time from frame to frame of the stream.
const STREAM: Seconds = Seconds(0.015);
/// The scale of angles in old firmware of Create 2.
const OLD_SCALE: f64 = 0.324_056;
/// Packets of a list at most: more would not fit between two frames.
const MOST_PACKETS: usize = 43;

/// The robot.
#[derive(Debug)]
pub(super) struct Roomba {
    dialect: Dialect,
    track: f64,
    tick: Sides<Metres>,
    quirks: Quirks,
    /// 0 off, 1 passive, 2 safe, 3 full.
    mode: u8,
    /// The bytes of a command that has not ended.
    command: Vec<u8>,
    speeds: Sides<MetresPerSecond>,
    /// Powers of the motors, of 255, while they are told and not speeds; and the speed at full power.
    powers: Option<Sides<i16>>,
    full_speed: MetresPerSecond,
    stream: Vec<u8>,
    streams: bool,
    due: Seconds,
    regulator: Regulator,
    body: Body,
    /// Distances when distance and angle were last told, which clears them.
    told: Sides<Metres>,
}

impl Roomba {
    pub(super) fn new(params: RoombaParams, track: Track, quirks: Quirks) -> Self {
        Self {
            dialect: params.dialect,
            track: track.get(),
            tick: params.gauge.tick(),
            quirks,
            mode: 0,
            command: Vec::new(),
            speeds: Sides::default(),
            powers: None,
            full_speed: params.full_speed,
            stream: Vec::new(),
            streams: false,
            due: Seconds::ZERO,
            regulator: Regulator::default(),
            body: Body::default(),
            told: Sides::default(),
        }
    }

    /// The data bytes of a command, as far as they are known; `None` for a byte that is no command.
    fn data_of(&self) -> Option<usize> {
        Some(match self.command.first()? {
            128 | 130..=136 | 143 | 173 | 7 => 0,
            129 | 138 | 141 | 142 | 150 | 165 => 1,
            162 => 2,
            139 | 144 | 168 => 3,
            137 | 145 | 146 | 163 | 164 => 4,
            167 => 15,
            148 | 149 => 1 + self.command.get(1).map_or(0, |count| usize::from(*count)),
            140 => 2 + 2 * self.command.get(2).map_or(0, |count| usize::from(*count)),
            _ => return None,
        })
    }

    fn run(&mut self, out: &mut Vec<u8>) {
        let command = std::mem::take(&mut self.command);
        let [operation, data @ ..] = command.as_slice() else { return };
        let two = |at: usize| i16::from_be_bytes([data[at], data[at + 1]]);
        // Nothing but START wakes a robot that is off, and only Safe and Full drive.
        match (*operation, self.mode) {
            (128, _) => self.passive(1),
            (_, 0) => {}
            (7 | 173, _) => {
                self.streams = false;
                self.passive(0);
            }
            (130 | 131, _) => self.mode = 2,
            (132, _) => self.mode = 3,
            (133..=136 | 143, _) => self.passive(1),
            (137, 2..) => (self.speeds, self.powers) = (bend(two(0), two(2), self.track), None),
            // The right wheel comes first.
            (145, 2..) if self.dialect != Dialect::Roomba400 => {
                (self.speeds, self.powers) = (Sides::new(two(2), two(0)).map(millimetres), None);
            }
            (146, 2..) if self.dialect != Dialect::Roomba400 => {
                self.powers = Some(Sides::new(two(2), two(0)).map(|power| power.clamp(-255, 255)));
            }
            (142, _) => self.tell(&[data[0]], false, out),
            (148, _) if self.dialect != Dialect::Roomba400 && data.len() <= MOST_PACKETS => {
                (self.stream, self.streams) = (data[1..].to_vec(), true);
            }
            (149, _) if self.dialect != Dialect::Roomba400 => self.tell(&data[1..], false, out),
            (150, _) => self.streams = data[0] == 1,
            _ => {}
        }
    }

    fn passive(&mut self, mode: u8) {
        self.mode = mode;
        (self.speeds, self.powers) = (Sides::default(), None);
    }

    /// The packets of a list, with their names or without.
    fn tell(&mut self, list: &[u8], named: bool, out: &mut Vec<u8>) {
        for id in list {
            if *id == 0 {
                let group: Vec<u8> = (7..=26).collect();
                self.tell(&group, false, out);
                continue;
            }
            if named {
                out.push(*id);
            }
            self.packet(*id, out);
        }
    }

    fn packet(&mut self, id: u8, out: &mut Vec<u8>) {
        let bits = |sides: Sides<bool>| u8::from(sides.right) | u8::from(sides.left) << 1;
        let Body { bump, cliff, voltage, .. } = self.body;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within 16 bits")]
        let millivolts = (voltage * 1000.0) as u16;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counters of 16 bits")]
        let counts = counts(&self.body, self.tick, self.quirks.first_count).map(|count| count as u16);
        match id {
            7 => out.push(bits(bump)),
            9 | 10 => out.push(u8::from(cliff.left)),
            11 | 12 => out.push(u8::from(cliff.right)),
            19 => out.extend_from_slice(&self.distance().to_be_bytes()),
            20 => out.extend_from_slice(&self.angle().to_be_bytes()),
            22 => out.extend_from_slice(&millivolts.to_be_bytes()),
            23 => out.extend_from_slice(&(-250_i16).to_be_bytes()),
            25 => out.extend_from_slice(&1800_u16.to_be_bytes()),
            26 => out.extend_from_slice(&2696_u16.to_be_bytes()),
            35 => out.push(self.mode),
            43 => out.extend_from_slice(&counts.left.to_be_bytes()),
            44 => out.extend_from_slice(&counts.right.to_be_bytes()),
            27..=31 | 33 | 39..=42 | 46..=51 | 54..=57 => out.extend_from_slice(&[0, 0]),
            _ => out.push(0),
        }
    }

    /// Whole mm since it was told last. What is less than one is told the next time.
    fn distance(&mut self) -> i16 {
        let moved = self.body.distances.zip(self.told, |now, told| (now - told).0);
        let whole = (f64::midpoint(moved.left, moved.right) * 1000.0).trunc();
        self.told = self.told.map(|told| told + Metres(whole / 1000.0));
        narrow(whole)
    }

    /// Whole degrees, or mm of half the difference of both wheels, since it was told last.
    fn angle(&mut self) -> i16 {
        let moved = self.body.distances.zip(self.told, |now, told| (now - told).0);
        let half = (moved.right - moved.left) / 2.0;
        let scale = if self.quirks.old_scale { OLD_SCALE } else { 1.0 };
        // A degree in metres of half the difference.
        let unit = match self.dialect {
            Dialect::Roomba400 => 0.001,
            _ => 1.0_f64.to_radians() * self.track / 2.0 / scale,
        };
        let whole = (half / unit).trunc();
        self.told = self.told.zip(Sides::new(-1.0, 1.0), |told, side| told + Metres(side * whole * unit));
        narrow(whole)
    }
}

fn narrow(whole: f64) -> i16 {
    #[allow(clippy::cast_possible_truncation, reason = "a cast of floats saturates, as the robot does")]
    let narrow = whole as i16;
    narrow
}

fn millimetres(speed: i16) -> MetresPerSecond {
    MetresPerSecond(f64::from(speed.clamp(-500, 500)) / 1000.0)
}

/// The speeds of both wheels on a bend: a positive radius turns left, 1 and -1 turn on the spot.
fn bend(speed: i16, radius: i16, track: f64) -> Sides<MetresPerSecond> {
    let v = millimetres(speed);
    match radius {
        i16::MIN | i16::MAX => Sides::new(v, v),
        1 => Sides::new(-v, v),
        -1 => Sides::new(v, -v),
        0 => Sides::default(),
        radius => {
            let ratio = track / 2.0 / (f64::from(radius) / 1000.0);
            Sides::new(v * (1.0 - ratio), v * (1.0 + ratio))
        }
    }
}

impl Firmware for Roomba {
    fn hear(&mut self, _now: Seconds, bytes: &[u8], out: &mut Vec<u8>) {
        for byte in bytes {
            self.command.push(*byte);
            match self.data_of() {
                None => self.command.clear(),
                Some(data) if self.command.len() > data => {
                    // The length of a list or a song is known only when its byte is there.
                    let is_whole = !matches!(self.command[0], 148 | 149 if self.command.len() < 2)
                        && !matches!(self.command[0], 140 if self.command.len() < 3);
                    if is_whole {
                        self.run(out);
                    }
                }
                Some(_) => {}
            }
        }
    }

    fn beat(&mut self, now: Seconds, body: &Body, out: &mut Vec<u8>) -> Sides<MetresPerSecond> {
        self.body = *body;
        // In Safe mode it stops by itself where there is no ground.
        if self.mode == 2 && (body.cliff.left || body.cliff.right) {
            self.passive(1);
        }
        if self.streams && now >= self.due {
            self.due = (self.due + STREAM).max(now);
            let mut frame = Vec::new();
            let list = std::mem::take(&mut self.stream);
            self.tell(&list, true, &mut frame);
            self.stream = list;
            if let Ok(length) = u8::try_from(frame.len()) {
                let header = if self.dialect == Dialect::Create2 { 19 } else { 0 };
                let sum = frame.iter().fold(length.wrapping_add(header), |sum, byte| sum.wrapping_add(*byte));
                out.extend_from_slice(&[19, length]);
                out.extend_from_slice(&frame);
                out.push(0_u8.wrapping_sub(sum));
            }
        }
        if let Some(powers) = self.powers {
            // No speed is controlled here: power is power.
            return powers.map(|power| self.full_speed * (f64::from(power) / 255.0));
        }
        let speeds = if self.mode >= 2 { self.speeds } else { Sides::default() };
        self.regulator.ask(now, speeds, body)
    }
}
