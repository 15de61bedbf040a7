//! The bytes that others have published, against both ends of the line.
//!
//! `golden/peer_cases.jsonl` holds them with the repository, commit and licence of each; facts only were taken.

use crate::eddie::hex;
use crate::firmware::{Body, EddieCommand, Quirks, firmware, heading, read_eddie};
use crate::odometer::Odometer;
use crate::params::{BoardKind, Gauge, RobotParams, RoombaParams};
use axle_schema::{Metres, MetresPerSecond, Seconds, Sides};
use serde_json::Value;

const CASES: &str = include_str!("golden/peer_cases.jsonl");

fn integer(value: &Value) -> i64 {
    value.as_i64().unwrap_or_else(|| panic!("{value} is no integer"))
}
fn bytes(value: &Value) -> Vec<u8> {
    let list = value.as_array().expect("a list of bytes");
    list.iter().map(|byte| u8::try_from(integer(byte)).expect("a byte")).collect()
}
fn metres_per_second(value: &Value) -> MetresPerSecond {
    MetresPerSecond(value.as_f64().expect("a number") / 1000.0)
}

/// What a Roomba of this dialect is told for the speeds of its wheels.
fn told(roomba: RoombaParams, speeds: Sides<MetresPerSecond>) -> Vec<u8> {
    let params = RobotParams { roomba, ..Default::default() };
    let mut board = params.board(BoardKind::Roomba);
    let (mut out, mut events) = (Vec::new(), Vec::new());
    board.open(Seconds(0.0), &mut out);
    // It is greeted by a frame in Safe mode.
    let mut robot = firmware(BoardKind::Roomba, &params, Quirks::default());
    let mut answer = Vec::new();
    robot.hear(Seconds(0.0), &out, &mut answer);
    robot.beat(Seconds(0.1), &Body::default(), &mut answer);
    board.hear(Seconds(0.1), &answer, &mut events);
    out.clear();
    board.beat(Seconds(0.1), speeds, &mut out, &mut events);
    out
}

fn open_interface(case: &Value) {
    let (id, input, expected) = (&case["id"], &case["input"], &case["expected"]);
    if input["cmd"] == "DRIVE" {
        // Speed -200 mm/s on a radius of 500 mm: the robot drives it, right wheel outside.
        let mut robot = firmware(BoardKind::Roomba, &RobotParams::default(), Quirks::default());
        let mut out = vec![128, 131];
        out.extend(bytes(&expected["bytes"]));
        robot.hear(Seconds(0.0), &out, &mut Vec::new());
        let asked = robot.beat(Seconds(0.001), &Body::default(), &mut Vec::new());
        let middle = f64::midpoint(asked.left.0, asked.right.0);
        assert!((middle + 0.2).abs() < 0.01 && asked.right.0 < asked.left.0, "{id}: {asked:?}");
    } else if let Some(left) = input.get("left_mm_s") {
        let speeds = Sides::new(metres_per_second(left), metres_per_second(&input["right_mm_s"]));
        assert_eq!(told(RoombaParams::default(), speeds), bytes(&expected["bytes"]), "{id}");
    } else if let Some(left) = input.get("left") {
        // Shares of full power, which are speeds as long as nothing is calibrated.
        let roomba = RoombaParams { powers: true, ..Default::default() };
        let speed = |share: &Value| roomba.full_speed * share.as_f64().expect("a number");
        let speeds = Sides::new(speed(left), speed(&input["right"]));
        assert_eq!(told(roomba, speeds), bytes(&expected["bytes"]), "{id}");
    } else if let (Some(prev), Some(now)) = (input.get("prev"), input.get("now")) {
        // A wheel that is fast enough for the largest of them.
        let mut odometer = Odometer::new(Sides::new(Metres(1.0), Metres(1.0)), 16, 1e6);
        let read = |count: &Value| Sides::new(integer(count), 0);
        odometer.count(Seconds(0.0), read(prev)).expect("a first reading");
        odometer.count(Seconds(0.015), read(now)).expect("a second reading");
        let moved = odometer.distances().left.0;
        assert!((moved - expected["delta_ticks"].as_f64().expect("a number")).abs() < 1e-9, "{id}: {moved}");
    } else if let Some(ticks) = input.get("ticks") {
        let number = |key: &str| input[key].as_f64().expect("a number");
        let diameter = Metres(number("wheel_d_m"));
        let gauge = Gauge { diameter: Sides::new(diameter, diameter), turn: number("ticks_per_rev") };
        let distance = gauge.tick().left.0 * ticks.as_f64().expect("a number");
        let due = expected["distance_m"].as_f64().expect("a number");
        assert!((distance / due - 1.0).abs() < 1e-12, "{id}: {distance}");
    } else if let Some(frame) = input.get("bytes") {
        let frame = bytes(frame);
        let sum = |bytes: &[u8]| bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        let is_new = expected.get("sum_all_mod_256").is_some();
        assert_eq!(sum(if is_new { &frame } else { &frame[1..] }), 0, "{id}");
        assert_eq!(i64::from(frame[3]) * 256 + i64::from(frame[4]), 537, "{id}");
    } else if input.get("packets").is_some() {
        // Requests that Axle does not make; its robot in software must understand their lengths.
        let request = bytes(&expected["bytes"]);
        let mut robot = firmware(BoardKind::Roomba, &RobotParams::default(), Quirks::default());
        let mut answer = Vec::new();
        robot.hear(Seconds(0.0), &[&[128, 131][..], &request, &[142, 35]].concat(), &mut answer);
        assert_eq!(answer.last(), Some(&2), "{id}: the mode is told after it");
    } else {
        panic!("{id} is of no kind that is known");
    }
}

fn eddie(case: &Value) {
    let (id, input, expected) = (&case["id"], &case["input"], &case["expected"]);
    let is = |key: &str| integer(&expected[key]);
    if let Some(line) = input.get("line") {
        let line = line.as_str().expect("a line").trim_end_matches("\\r").to_owned();
        let due = match line.split(' ').next().expect("a word") {
            "GO" => EddieCommand::Go(Sides::new(is("left_power"), is("right_power"))),
            "GOSPD" => EddieCommand::GoSpeed(Sides::new(is("left"), is("right"))),
            "TRVL" => EddieCommand::Travel(is("distance_positions"), is("speed")),
            "TURN" => EddieCommand::Turn(is("angle_deg"), is("speed")),
            "STOP" => EddieCommand::Stop(is("distance_positions")),
            "ACC" => EddieCommand::Acceleration(is("rate")),
            "BLINK" => EddieCommand::Blink(is("pin"), is("rate_0.1Hz")),
            other => panic!("{id}: {other} is no command that is known"),
        };
        assert_eq!(read_eddie(&line), Ok(due), "{id}");
    } else if let Some(answer) = input.get("response") {
        let words: Vec<&str> =
            answer.as_str().expect("an answer").trim_end_matches("\\r").split(' ').collect();
        let (digits, bits) = match input["cmd"].as_str().expect("a command") {
            "DIST" => (8, 32),
            "SPD" | "VER" => (4, 16),
            _ => (3, 63),
        };
        let read: Vec<i64> = words.iter().filter_map(|word| hex(word, digits, bits)).collect();
        let due: Vec<i64> = match expected.as_object().expect("an object").iter().next().expect("a value") {
            (_, Value::Array(list)) => list.iter().map(integer).collect(),
            (key, _) if key == "left" => vec![is("left"), is("right")],
            (_, value) => vec![integer(value)],
        };
        assert_eq!(read, due, "{id}");
    } else if let Some(number) = input.get("hex") {
        assert_eq!(hex(number.as_str().expect("a number"), 8, 32), Some(is("value")), "{id}");
    } else {
        let heading = heading(integer(&input["left"]), integer(&input["right"]));
        assert_eq!(heading, is("heading_deg"), "{id}");
        assert_eq!(format!("{:03X}", heading & 0xFFF), expected["hex3"].as_str().expect("digits"), "{id}");
    }
}

#[test]
fn both_ends_say_and_understand_the_bytes_that_others_have_published() {
    let mut known = 0;
    for line in CASES.lines() {
        let case: Value = serde_json::from_str(line).expect("a case");
        match case["area"].as_str() {
            Some("proto_oi") => open_interface(&case),
            Some("proto_eddie") => eddie(&case),
            other => panic!("{other:?} is no area that is known"),
        }
        known += 1;
    }
    assert_eq!(known, 37);
}
