//! A board in software on the emulated robot: its line has a baud rate, and may lose and spoil bytes.
//!
//! *Hears* the bytes that somebody wrote to the line, *says* those that the board answers. The firmware is that of
//! `axle_robot::firmware`; the wheels that it turns are those of the emulator, with all their faults, and its encoders
//! count whole ticks of its own.

use crate::params::EmulatorParams;
use crate::random::Random;
use crate::{EncodersParams, emulator::Emulator};
use axle_robot::firmware::{Body, Firmware, Quirks, firmware};
use axle_robot::{BoardKind, Dialect, RobotParams, RoombaParams};
use axle_schema::contract::Bounds;
use axle_schema::refusal::within;
use axle_schema::{MapData, MetresPerSecond, NavigatorData, Radians, Refusal, Seconds};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Bits of a byte on the line, with its start and its stop.
const BITS: f64 = 10.0;
/// Bytes that a beat which came late may catch up with: what a serial port keeps for its reader.
const MOST_AT_ONCE: f64 = 256.0;
/// Answers that wait for the line; a board that says more loses it.
const MOST_WAITING: usize = 1024;

/// What is odd about an emulated board, and about its line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoardParams {
    /// The share of bytes that get lost, each way, 0 to 0.1.
    pub loss: f64,
    /// The share of bytes of which a bit is turned round, each way, 0 to 0.1.
    pub noise: f64,
    /// What its counters show at first, 0 to 4294967295: close to their end, they soon wrap.
    pub first_count: u32,
    /// Whether its firmware is an old one: a `roomba` says angles in a wrong scale, an `eddie` takes speeds for positions in
    /// a second and not in half of one.
    pub old_scale: bool,
    /// Which Open Interface a `roomba` has.
    pub dialect: Dialect,
    /// Voltage of its battery when it is full and nobody drives, 0 to 50 V.
    pub voltage: f64,
    /// Speed of a wheel at full power, 0.001 to 20 m/s, before `motors.gain`; left out, what is usual for its kind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub full_speed: Option<MetresPerSecond>,
}

impl Default for BoardParams {
    fn default() -> Self {
        let dialect = Dialect::default();
        Self {
            loss: 0.0,
            noise: 0.0,
            first_count: 0,
            old_scale: false,
            dialect,
            voltage: 12.6,
            full_speed: None,
        }
    }
}

impl Bounds for BoardParams {
    fn check(&self) -> Result<(), Refusal> {
        within("board.loss", self.loss, 0.0, 0.1)?;
        within("board.noise", self.noise, 0.0, 0.1)?;
        within("board.voltage in V", self.voltage, 0.0, 50.0)?;
        self.full_speed.map_or(Ok(()), |speed| within("board.full_speed in m/s", speed.0, 1e-3, 20.0))
    }
}

/// An emulated robot whose wheels are driven by a board on a serial line.
#[derive(Debug)]
pub struct EmulatedBoard {
    emulator: Emulator,
    firmware: Box<dyn Firmware>,
    params: BoardParams,
    /// Bytes in a second that the line carries.
    rate: f64,
    /// How many bytes the line has room for now, to the board and from it.
    room: (f64, f64),
    waiting: VecDeque<u8>,
    chance: Random,
}

impl EmulatedBoard {
    /// A board of this kind that has just been switched on; `run` differs from run to run.
    ///
    /// # Errors
    /// Refuses parameters out of range.
    pub fn new(params: &EmulatorParams, kind: BoardKind, run: u32) -> Result<Self, Refusal> {
        let board = params.board;
        let roomba = RoombaParams { dialect: board.dialect, ..RoombaParams::default() };
        let mut robot = RobotParams { robot: params.robot, roomba, ..RobotParams::default() };
        if let Some(full) = board.full_speed {
            (robot.arduino.full_speed, robot.roomba.full_speed, robot.eddie.full_speed) = (full, full, full);
            (robot.orfa.full_speed, robot.dwm_text.full_speed) = (full, full);
        }
        let tick = robot.tick(kind).left;
        let encoders = EncodersParams { tick, ..params.encoders };
        let quirks = Quirks { old_scale: board.old_scale, first_count: i64::from(board.first_count), run };
        Ok(Self {
            emulator: Emulator::new(EmulatorParams { encoders, ..*params })?,
            firmware: firmware(kind, &robot, quirks),
            params: board,
            rate: f64::from(robot.baud(kind)) / BITS,
            room: (0.0, 0.0),
            waiting: VecDeque::new(),
            chance: Random::new(params.seed, 8),
        })
    }

    /// The same robot among the walls of a map, which its bumpers feel.
    ///
    /// # Errors
    /// Refuses what is no map.
    pub fn among(self, map: &MapData) -> Result<Self, Refusal> {
        Ok(Self { emulator: self.emulator.among(map)?, ..self })
    }

    /// How many bytes may be given to the next [`Self::advance`], which is at `to`: more is not on the line yet, and
    /// waits with its writer.
    #[must_use]
    pub fn room(&self, to: Seconds) -> usize {
        let room = (self.room.0 + self.gains(to)).clamp(0.0, MOST_AT_ONCE);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 256")]
        let whole = room as usize;
        whole
    }

    fn gains(&self, to: Seconds) -> f64 {
        (to - self.emulator.now()).0.max(0.0) * self.rate
    }

    /// Goes on to `to`: takes what came over the line, and gives what goes over it. What is more than there was room
    /// for is lost, as a board loses what comes faster than its baud rate.
    pub fn advance(&mut self, to: Seconds, heard: &[u8], said: &mut Vec<u8>) {
        let (room, gains) = (self.room(to), self.gains(to));
        let taken = &heard[..heard.len().min(room)];
        #[allow(clippy::cast_precision_loss, reason = "at most 256")]
        let used = taken.len() as f64;
        self.room.0 = (self.room.0 + gains).min(MOST_AT_ONCE) - used;
        let taken: Vec<u8> = taken.iter().filter_map(|byte| self.carry(*byte)).collect();
        let mut answers = Vec::new();
        self.firmware.hear(to, &taken, &mut answers);
        let body = self.body();
        let asked = self.firmware.beat(to, &body, &mut answers);
        self.emulator.advance(to, asked);
        let free = MOST_WAITING.saturating_sub(self.waiting.len());
        self.waiting.extend(answers.into_iter().take(free));
        self.room.1 = (self.room.1 + gains).min(MOST_AT_ONCE);
        while self.room.1 >= 1.0
            && let Some(byte) = self.waiting.pop_front()
        {
            self.room.1 -= 1.0;
            said.extend(self.carry(byte));
        }
    }

    /// The servo that the board was last told to turn, once: its pin, and its angle from its middle.
    pub fn turned(&mut self) -> Option<(u8, Radians)> {
        self.firmware.turned()
    }

    /// What becomes of a byte on the line.
    fn carry(&mut self, byte: u8) -> Option<u8> {
        let BoardParams { loss, noise, .. } = self.params;
        if loss > 0.0 && self.chance.uniform() <= loss {
            return None;
        }
        let is_spoilt = noise > 0.0 && self.chance.uniform() <= noise;
        Some(if is_spoilt { byte ^ (1 << (self.chance.bits() % 8)) } else { byte })
    }

    fn body(&mut self) -> Body {
        let distances = self.emulator.encoders().sides();
        let gyro = self.emulator.inertial().gyro;
        let voltage = self.params.voltage * self.emulator.battery();
        Body { distances, gyro, voltage, bump: self.emulator.bump(), ..Body::default() }
    }

    /// Where the robot really is.
    #[must_use]
    pub fn truth(&self) -> NavigatorData {
        self.emulator.truth()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_robot::Bridge;
    use axle_schema::{Metres, MetresPerSecond, Pose, Sides};

    /// Drives 2 s at 0.2 m/s over a line with these faults: the faults that were counted, the distance that was told,
    /// and the true one.
    fn drive(kind: BoardKind, board: BoardParams) -> (axle_schema::board::BoardState, f64, f64) {
        let params = EmulatorParams { board, ..EmulatorParams::default() };
        let mut emulated = EmulatedBoard::new(&params, kind, 1).expect("a board");
        let mut bridge = Bridge::new(&RobotParams::default(), kind, "line").expect("a bridge");
        let (mut out, mut said) = (Vec::new(), Vec::new());
        let mut told = 0.0;
        bridge.opened(Seconds(0.0), &mut out);
        for beat in 1..=700_u32 {
            let now = Seconds(f64::from(beat) * 0.005);
            let room = emulated.room(now).min(out.len());
            let heard: Vec<u8> = out.drain(..room).collect();
            emulated.advance(now, &heard, &mut said);
            bridge.hear(now, &std::mem::take(&mut said));
            let speed = MetresPerSecond(if (200..600).contains(&beat) { 0.2 } else { 0.0 });
            bridge.beat(now, Sides::new(speed, speed), &mut out);
            told = bridge.news().encoders.map_or(told, |encoders| encoders.left.0);
        }
        (bridge.state(Seconds(3.5)), told, emulated.truth().pose.x.0)
    }

    #[test]
    fn a_board_on_a_good_line_tells_what_the_robot_does() {
        for kind in [BoardKind::Arduino, BoardKind::Roomba, BoardKind::Eddie, BoardKind::DwmText] {
            let (state, told, truth) =
                drive(kind, BoardParams { first_count: 65_500, ..BoardParams::default() });
            assert_eq!(state.faults, Default::default(), "{kind:?}");
            assert!((truth - 0.4).abs() < 0.02, "{kind:?}: {truth}");
            assert!((told - truth).abs() < 0.01, "{kind:?}: {told} of {truth}");
        }
    }

    #[test]
    fn a_bad_line_is_counted_and_the_robot_drives_all_the_same() {
        for kind in [BoardKind::Arduino, BoardKind::Roomba, BoardKind::Eddie, BoardKind::DwmText] {
            let board = BoardParams { loss: 0.003, noise: 0.003, ..BoardParams::default() };
            let (state, told, truth) = drive(kind, board);
            let faults = state.faults;
            let counted = faults.garbage
                + faults.checksum
                + faults.half
                + faults.unanswered
                + faults.absurd
                + faults.refused
                + faults.missed;
            assert!(counted > 0, "{kind:?}: {faults:?}");
            assert!((0.2..0.5).contains(&truth), "{kind:?}: {truth}");
            assert!((told - truth).abs() < 0.05, "{kind:?}: {told} of {truth}");
        }
    }

    #[test]
    fn walls_press_the_bumpers_and_driving_loads_the_battery() {
        // A wall half a metre ahead that is nearer on the left: the robot stands askew before it.
        let grid = axle_maps::Grid::new("wall", Metres(0.05), Pose::new(-1.0, -1.0, 0.0), 40, vec![0; 1600]);
        let map = grid.and_then(|grid| grid.to_data()).expect("a map");
        let start = Pose::new(0.4, 0.0, -0.5);
        let mut params = EmulatorParams { start, ..EmulatorParams::default() };
        params.battery.sag = 0.2;
        let emulated = EmulatedBoard::new(&params, BoardKind::Roomba, 1).expect("a board");
        let mut emulated = emulated.among(&map).expect("a map");
        let mut bridge = Bridge::new(&RobotParams::default(), BoardKind::Roomba, "line").expect("a bridge");
        let (mut out, mut said) = (Vec::new(), Vec::new());
        let (mut felt, mut least) = (Vec::new(), f64::INFINITY);
        bridge.opened(Seconds(0.0), &mut out);
        for beat in 1..=800_u32 {
            let now = Seconds(f64::from(beat) * 0.005);
            let room = emulated.room(now).min(out.len());
            let heard: Vec<u8> = out.drain(..room).collect();
            emulated.advance(now, &heard, &mut said);
            bridge.hear(now, &std::mem::take(&mut said));
            let speed = MetresPerSecond(if beat > 200 { 0.3 } else { 0.0 });
            bridge.beat(now, Sides::new(speed, speed), &mut out);
            let news = bridge.news();
            felt.extend(news.contacts.map(|contacts| contacts.bump));
            least = news.battery.map_or(least, |battery| least.min(battery.voltage));
        }
        assert_eq!(felt.first(), Some(&Sides::default()));
        assert_eq!(felt.last(), Some(&Sides::new(true, false)), "the wall is on the left of its nose");
        assert!((11.0..12.2).contains(&least), "{least} V");
    }

    #[test]
    fn an_old_firmware_says_angles_in_a_wrong_scale_and_a_parameter_puts_them_right() {
        for (angle_scale, is_right) in [(0.324_056, true), (1.0, false)] {
            let board = BoardParams { old_scale: true, dialect: Dialect::Create1, ..BoardParams::default() };
            let params = EmulatorParams { board, ..EmulatorParams::default() };
            let mut emulated = EmulatedBoard::new(&params, BoardKind::Roomba, 1).expect("a board");
            let roomba = RoombaParams { dialect: Dialect::Create1, angle_scale, ..RoombaParams::default() };
            let params = RobotParams { roomba, ..RobotParams::default() };
            let mut bridge = Bridge::new(&params, BoardKind::Roomba, "line").expect("a bridge");
            let (mut out, mut said, mut turned) = (Vec::new(), Vec::new(), 0.0);
            bridge.opened(Seconds(0.0), &mut out);
            for beat in 1..=1000_u32 {
                let now = Seconds(f64::from(beat) * 0.005);
                let room = emulated.room(now).min(out.len());
                let heard: Vec<u8> = out.drain(..room).collect();
                emulated.advance(now, &heard, &mut said);
                bridge.hear(now, &std::mem::take(&mut said));
                let speed = if beat > 200 { 0.1 } else { 0.0 };
                let speeds = Sides::new(MetresPerSecond(-speed), MetresPerSecond(speed));
                bridge.beat(now, speeds, &mut out);
                if let Some(encoders) = bridge.news().encoders {
                    turned = (encoders.right - encoders.left).0 / params.robot.track.get();
                }
            }
            let truth = emulated.truth().pose.heading.0;
            assert!(truth > 2.0, "{truth}");
            assert_eq!((turned - truth).abs() < 0.1, is_right, "{turned} of {truth}");
        }
    }

    #[test]
    fn an_old_eddie_is_half_as_fast_until_a_parameter_puts_it_right() {
        for (speed_time, way) in [(0.5, 0.2), (1.0, 0.4)] {
            let board = BoardParams { old_scale: true, ..BoardParams::default() };
            let params = EmulatorParams { board, ..EmulatorParams::default() };
            let mut emulated = EmulatedBoard::new(&params, BoardKind::Eddie, 1).expect("a board");
            let mut robot = RobotParams::default();
            robot.eddie.speed_time = Seconds(speed_time);
            let mut bridge = Bridge::new(&robot, BoardKind::Eddie, "line").expect("a bridge");
            let (mut out, mut said) = (Vec::new(), Vec::new());
            bridge.opened(Seconds(0.0), &mut out);
            for beat in 1..=700_u32 {
                let now = Seconds(f64::from(beat) * 0.005);
                let room = emulated.room(now).min(out.len());
                let heard: Vec<u8> = out.drain(..room).collect();
                emulated.advance(now, &heard, &mut said);
                bridge.hear(now, &std::mem::take(&mut said));
                let speed = MetresPerSecond(if (200..600).contains(&beat) { 0.2 } else { 0.0 });
                bridge.beat(now, Sides::new(speed, speed), &mut out);
            }
            let driven = emulated.truth().pose.x.0;
            assert!((driven - way).abs() < 0.02, "{speed_time}: {driven} m");
        }
    }

    #[test]
    fn what_is_faster_than_the_line_is_lost() {
        let mut emulated =
            EmulatedBoard::new(&EmulatorParams::default(), BoardKind::Arduino, 1).expect("a board");
        assert_eq!(emulated.room(Seconds(0.01)), 57);
        let mut said = Vec::new();
        // Fifty greetings in 10 ms are cut off after 57 bytes, and the answers take their time.
        emulated.advance(Seconds(0.01), &b"b\r".repeat(50), &mut said);
        assert_eq!(said.len(), 57);
        emulated.advance(Seconds(1.0), b"", &mut said);
        assert_eq!(said, b" 57600\r\n".repeat(28));
    }
}
