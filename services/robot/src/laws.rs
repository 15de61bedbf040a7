//! What holds of every board: with its firmware at the other end of the line, a bridge drives, stops first, and finds
//! its board again, whatever happens to the line. What any bytes do is in `tests/fuzz.rs`.

use crate::bridge::Bridge;
use crate::firmware::{Body, Firmware, Quirks, firmware};
use crate::params::{BoardKind, Dialect, RobotParams, RoombaParams};
use axle_schema::board::LinkState;
use axle_schema::{MetresPerSecond, Refusal, Seconds, Sides};
use proptest::prelude::*;

const BEAT: f64 = 0.005;

/// A bridge, its board, and a body whose wheels do what the board asks.
struct Pair {
    bridge: Bridge,
    board: Box<dyn Firmware>,
    body: Body,
    now: f64,
    /// What is on the way to the bridge.
    answer: Vec<u8>,
    /// What the board asked of the motors last.
    asked: Sides<MetresPerSecond>,
}

impl Pair {
    fn new(kind: BoardKind, params: &RobotParams, quirks: Quirks) -> Self {
        let mut pair = Self {
            bridge: Bridge::new(params, kind, "port").expect("parameters"),
            board: firmware(kind, params, quirks),
            body: Body { voltage: 12.5, ..Body::default() },
            now: 0.0,
            answer: Vec::new(),
            asked: Sides::default(),
        };
        pair.open();
        pair
    }
    fn open(&mut self) {
        let mut out = Vec::new();
        self.bridge.opened(Seconds(self.now), &mut out);
        self.board.hear(Seconds(self.now), &out, &mut self.answer);
    }
    /// Goes on for `seconds` with wheels that shall run at these speeds; `plugged` is whether the line holds.
    fn run(&mut self, seconds: f64, left: f64, right: f64, plugged: bool) {
        let end = self.now + seconds;
        while self.now < end - 1e-9 {
            self.now += BEAT;
            let now = Seconds(self.now);
            let mut out = Vec::new();
            if plugged {
                self.bridge.hear(now, &std::mem::take(&mut self.answer));
                let speeds = Sides::new(MetresPerSecond(left), MetresPerSecond(right));
                self.bridge.beat(now, speeds, &mut out);
                self.board.hear(now, &out, &mut self.answer);
            }
            self.asked = self.board.beat(now, &self.body, &mut self.answer);
            self.body.distances =
                self.body.distances.zip(self.asked, |sum, speed| sum + speed * Seconds(BEAT));
        }
    }
    fn distances(&mut self) -> Sides<f64> {
        self.bridge.news().encoders.expect("a reading").sides().map(|distance| distance.0)
    }
    fn is_up(&mut self) -> bool {
        self.bridge.health(Seconds(self.now)).is_ok()
    }
}

/// Every board, by speeds and by powers, and the dialects of the Open Interface.
fn all() -> Vec<(BoardKind, RobotParams)> {
    let dialect = |dialect| RobotParams {
        roomba: RoombaParams { dialect, ..Default::default() },
        ..Default::default()
    };
    let mut all: Vec<_> = BoardKind::ALL.map(|kind| (kind, RobotParams::default())).to_vec();
    all.push((BoardKind::Roomba, dialect(Dialect::Create1)));
    all.push((BoardKind::Roomba, dialect(Dialect::Roomba400)));
    all.extend(BoardKind::ALL.map(|kind| (kind, told_powers())));
    all
}

/// Boards that are told powers, and whose motors give the speeds that they shall.
fn told_powers() -> RobotParams {
    let mut params = RobotParams::default();
    params.arduino.powers = true;
    params.roomba.powers = true;
    params.eddie.powers = true;
    params.dwm_text.powers = true;
    params.robot.wheel_speed = MetresPerSecond(0.5);
    params
}

#[test]
fn every_board_drives_at_the_speeds_that_are_asked_and_tells_what_its_wheels_did() {
    for (kind, params) in all() {
        let mut pair = Pair::new(kind, &params, Quirks::default());
        pair.run(1.5, 0.3, 0.2, true);
        assert!(pair.is_up(), "{kind:?}: {:?}", pair.bridge.state(Seconds(pair.now)));
        let begun = pair.body.distances;
        pair.run(2.0, 0.3, 0.2, true);
        let driven = pair.body.distances.zip(begun, |now, begun| (now - begun).0);
        assert!(
            (driven.left - 0.6).abs() < 0.02 && (driven.right - 0.4).abs() < 0.02,
            "{kind:?}: {driven:?}"
        );
        if kind.has_encoders() {
            let due = pair.body.distances;
            let told = pair.distances();
            // A degree of the older dialects is 2.6 mm; 50 ms at 0.3 m/s are 15.
            assert!((told.left - due.left.0).abs() < 0.03, "{kind:?}: {told:?} of {due:?}");
            assert!((told.right - due.right.0).abs() < 0.03, "{kind:?}: {told:?} of {due:?}");
        }
        pair.run(1.5, 0.0, 0.0, true);
        assert_eq!(pair.asked, Sides::default(), "{kind:?} stands");
        let faults = pair.bridge.state(Seconds(pair.now)).faults;
        assert_eq!(faults, Default::default(), "{kind:?}: a line without faults");
    }
}

#[test]
fn a_board_stops_by_itself_when_its_line_is_cut_if_it_has_a_watchdog() {
    for (kind, params) in all() {
        let mut pair = Pair::new(kind, &params, Quirks::default());
        pair.run(2.0, 0.3, 0.3, true);
        assert!(pair.asked.left.0 > 0.2, "{kind:?} drives: {:?}", pair.asked);
        pair.run(2.2, 0.0, 0.0, false);
        let stops = !matches!(kind, BoardKind::Roomba | BoardKind::Orfa);
        assert_eq!(pair.asked == Sides::default(), stops, "{kind:?}: {:?}", pair.asked);
        assert!(!pair.is_up(), "{kind:?} is silent");
        // After it was plugged in again it is stopped before it has been asked anything.
        pair.answer.clear();
        pair.bridge.closed(Refusal::unavailable("port", "unplugged"));
        pair.open();
        pair.run(0.01, 0.3, 0.3, false);
        assert_eq!(pair.asked, Sides::default(), "{kind:?} is stopped first");
        pair.run(1.5, 0.3, 0.3, true);
        assert!(pair.is_up() && pair.asked.left.0 > 0.2, "{kind:?} drives again: {:?}", pair.asked);
    }
}

#[test]
fn counters_that_wrap_and_boards_that_restart_bend_no_distance() {
    let first = [
        (BoardKind::Arduino, i64::from(i32::MAX) - 500),
        (BoardKind::Roomba, 65_536 - 300),
        (BoardKind::Eddie, i64::from(i32::MAX) - 50),
        (BoardKind::DwmText, i64::from(i32::MAX) - 500),
    ];
    for (kind, first_count) in first {
        let quirks = Quirks { first_count, run: 7, ..Quirks::default() };
        let params = RobotParams::default();
        let mut pair = Pair::new(kind, &params, quirks);
        pair.run(4.0, 0.3, 0.3, true);
        let (due, told) = (pair.body.distances.left.0, pair.distances().left);
        assert!((told - due).abs() < 0.03, "{kind:?} over its end: {told} of {due}");
        assert_eq!(pair.bridge.state(Seconds(pair.now)).restarts, 0, "{kind:?}: a wrap is no restart");
        // A board that loses its power for a moment begins anew, also with what it counts.
        pair.board = firmware(kind, &params, Quirks { run: 8, ..Quirks::default() });
        pair.body.distances = Sides::default();
        pair.answer.clear();
        pair.run(0.6, 0.0, 0.0, true);
        // A Roomba forgets its stream, and is silent until it is greeted anew.
        let restarts = pair.bridge.state(Seconds(pair.now)).restarts;
        assert_eq!(restarts > 0, kind != BoardKind::Roomba, "{kind:?} has restarted: {restarts}");
        assert!(!pair.is_up() || kind != BoardKind::Roomba);
    }
}

#[test]
fn a_board_of_another_kind_is_never_taken_for_the_right_one() {
    let params = RobotParams::default();
    for wanted in BoardKind::ALL {
        for real in BoardKind::ALL.into_iter().filter(|real| *real != wanted) {
            let mut pair = Pair::new(wanted, &params, Quirks { run: 0xA0, ..Quirks::default() });
            pair.board = firmware(real, &params, Quirks::default());
            pair.answer.clear();
            pair.open();
            pair.run(params.greeting.0 + 0.1, 0.3, 0.3, true);
            assert_ne!(pair.bridge.state(Seconds(pair.now)).link, LinkState::Up, "{real:?} as {wanted:?}");
            assert_eq!(pair.body.distances, Sides::default(), "{real:?} as {wanted:?} does not move");
            assert!(pair.bridge.hangs_up().is_some(), "{real:?} as {wanted:?}");
        }
    }
}

#[test]
fn a_cliff_takes_the_wheels_away_and_solid_ground_gives_them_back() {
    let mut pair = Pair::new(BoardKind::Roomba, &RobotParams::default(), Quirks::default());
    pair.run(1.0, 0.3, 0.3, true);
    pair.body.cliff.right = true;
    pair.run(0.1, 0.3, 0.3, true);
    assert_eq!(pair.asked, Sides::default());
    assert!(pair.bridge.news().contacts.expect("contacts").cliff.right);
    let why = pair.bridge.health(Seconds(pair.now)).expect_err("it has stopped").to_string();
    assert!(why.contains("cliff"), "{why}");
    pair.body.cliff.right = false;
    pair.run(1.0, 0.0, 0.0, true);
    assert!(pair.is_up());
}

proptest! {
    #[test]
    fn lost_and_broken_bytes_are_counted_and_the_wheels_stay_true(
        hurt in prop::collection::vec((0_usize..4000, 0_u8..=255), 1..40), which in 0_usize..4,
    ) {
        // All that measure, and whose frames a single wrong byte does not turn into other frames: text without a
        // checksum may say another number, and then the odometer is what doubts it.
        let kind = [BoardKind::Roomba, BoardKind::DwmText, BoardKind::Arduino, BoardKind::Eddie][which];
        let mut pair = Pair::new(kind, &RobotParams::default(), Quirks { first_count: 100, ..Quirks::default() });
        pair.run(1.0, 0.0, 0.0, true);
        let mut sent = 0;
        for _ in 0..400 {
            let mut at = 0;
            pair.answer.retain_mut(|byte| {
                let wound = hurt.iter().find(|(place, _)| *place == sent + at);
                at += 1;
                match wound {
                    Some((_, 0)) => false,
                    Some((_, mask)) => { *byte ^= mask; true }
                    None => true,
                }
            });
            sent += at;
            pair.run(BEAT, 0.2, 0.2, true);
        }
        pair.run(0.5, 0.0, 0.0, true);
        let far = pair.body.distances.left.0;
        // A number that was changed may be one that a wheel could have; the next one puts it right.
        if let Some(encoders) = pair.bridge.news().encoders {
            prop_assert!((encoders.left.0 - far).abs() < 0.1, "{kind:?}: {} of {far}", encoders.left.0);
        }
        prop_assert!(far < 0.5, "{far}");
    }
}
