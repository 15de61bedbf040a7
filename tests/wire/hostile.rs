//! Bytes that nobody should send: each is a typed refusal whose text names the field, and nothing panics.

use super::examples;
use axle_schema::codec::{DEPTH, decode_as, encoding_of};
use axle_schema::command::{AllStop, Command, Enable, GateState, LeaseAsk, Release};
use axle_schema::meta::Meta;
use axle_schema::task::{Cancel, CorrectorProgress};
use axle_schema::window::Window;
use axle_schema::{
    Drive, DriveAsk, Dwm, EncodersData, EncodersSpan, Fix, Message, NavigatorData, Plan, Refusal, Signals,
    WayTask, decode,
};
use ciborium::{Value, cbor};
use std::fmt::Debug;

type Made = Result<Value, ciborium::value::Error>;

pub(super) fn bytes(value: Made) -> Vec<u8> {
    let mut bytes = Vec::new();
    ciborium::into_writer(&value.expect("a value"), &mut bytes).expect("memory");
    bytes
}

/// The bytes are refused as malformed, and the text says `words`.
fn check_bytes<M: Message + Debug>(bytes: &[u8], words: &str) {
    let refusal = decode::<M>(bytes).expect_err(words);
    let text = refusal.to_string();
    assert!(matches!(refusal, Refusal::Malformed { .. }), "{refusal:?}");
    assert!(text.starts_with(&format!("malformed {}: ", M::NAME)), "{text:?} names the message");
    assert!(text.contains(words), "{text:?} does not say {words:?}");
    assert!(text.len() < 1000 && !text.contains(char::is_control), "{text:?} is fit for a log");
    for inner in ["Semantic(", "Syntax(", "Io(", "Error {", "RecursionLimit", "Option value"] {
        assert!(!text.contains(inner), "{text:?} is for people");
    }
}

fn check<M: Message + Debug>(value: Made, words: &str) {
    check_bytes::<M>(&bytes(value), words);
}

/// The bytes are a message, but one of its values is refused by name.
fn check_range<M: Message + Debug>(value: Made, words: &str) {
    let refusal = decode::<M>(&bytes(value)).expect_err(words);
    assert!(matches!(refusal, Refusal::OutOfRange { .. } | Refusal::Missing { .. }), "{refusal:?}");
    assert!(refusal.to_string().contains(words), "{refusal} does not say {words:?}");
}

/// A map with text keys, written by hand, so that it can be wrong.
fn map(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let small = |length: usize| u8::try_from(length).ok().filter(|length| *length < 24).expect("small");
    let mut bytes = vec![0xa0 | small(entries.len())];
    for (key, value) in entries {
        bytes.push(0x60 | small(key.len()));
        bytes.extend(key.bytes());
        bytes.extend(*value);
    }
    bytes
}

fn command(key: &str, value: Value, dwm_key: &str, dwm_value: Value) -> Made {
    let mut command = cbor!({ "boot" => 7, "epoch" => 3, "seq" => 1, "echo" => 5, "ttl_ms" => 150 })?;
    let mut dwm = cbor!({ "v0l" => 0, "v0r" => 0, "v1l" => 0.5, "v1r" => 0.5, "T" => 1 })?;
    set(&mut dwm, dwm_key, dwm_value);
    set(&mut command, "dwm", dwm);
    set(&mut command, key, value);
    Ok(command)
}

/// Replaces an entry of a map or adds one; an empty key changes nothing, and `null` takes the entry out.
fn set(map: &mut Value, key: &str, value: Value) {
    let entries = map.as_map_mut().expect("a map");
    if !key.is_empty() {
        entries.retain(|(name, _)| name.as_text() != Some(key));
        if !value.is_null() {
            entries.push((key.into(), value));
        }
    }
}

#[test]
fn a_wrong_type_is_refused_by_the_name_of_its_field() {
    check::<EncodersData>(
        cbor!({ "stamp" => "1", "left" => 0, "right" => 0 }),
        "stamp: invalid type: string \"1\"",
    );
    check::<EncodersData>(cbor!({ "stamp" => null, "left" => 0, "right" => 0 }), "stamp: invalid type: null");
    check::<EncodersData>(
        cbor!({ "stamp" => [1], "left" => 0, "right" => 0 }),
        "stamp: invalid type: sequence",
    );
    check::<EncodersData>(
        cbor!({ "stamp" => 1, "left" => true, "right" => 0 }),
        "left: invalid type: boolean `true`",
    );
    check::<EncodersData>(cbor!([1, 0, 0]), "invalid type: sequence, expected map");
    check::<EncodersData>(cbor!(null), "invalid type: null, expected map");
    check::<EncodersData>(cbor!({ 5 => 6 }), "<key>: invalid type: integer `5`");
    check::<Cancel>(cbor!({ "id" => 1.5 }), "id: invalid type: floating point `1.5`, expected integer");
    check::<Cancel>(cbor!({ "id" => -5 }), "id: unexpected negative integer");
    check::<Meta>(
        cbor!({ "seq" => 1, "source" => 1, "stamp" => "now" }),
        "stamp: invalid type: string \"now\"",
    );
    check::<AllStop>(cbor!({ "id" => 1, "by" => 5 }), "by: invalid type: integer `5`, expected string");
    check::<LeaseAsk>(
        cbor!({ "holder" => "x", "class" => "boss", "period" => 1 }),
        "class: unknown variant `boss`",
    );
    let pose = cbor!({ "x" => 0, "y" => 0, "heading" => [] }).expect("a pose");
    check::<NavigatorData>(cbor!({ "stamp" => 1, "pose" => pose }), "pose.heading: invalid type: sequence");
    let points = cbor!({ "points" => [{ "x" => 1, "y" => 2 }, { "x" => "far", "y" => 2 }] });
    check::<WayTask>(points, "points[1].x: invalid type: string \"far\", expected a finite number");
    let start = cbor!({ "x" => 0, "y" => 0, "heading" => 0 }).expect("a pose");
    let plan = |leg: Made| cbor!({ "start" => start, "legs" => [leg.expect("a leg")], "length" => 1 });
    let shape = cbor!({ "geometry" => { "loop" => { "length" => 1 } }, "point" => 0 });
    check::<Plan>(
        plan(shape),
        "legs[0].geometry: unknown variant `loop`, expected one of `line`, `turn`, `arc`",
    );
    let length = cbor!({ "geometry" => { "line" => { "length" => "a" } }, "point" => 0 });
    check::<Plan>(plan(length), "legs[0].geometry.line.length: invalid type: string \"a\"");
    let phase =
        cbor!({ "task" => 1, "phase" => { "failed" => { "busy" => { "holder" => 1 } } }, "stamp" => 0 });
    check::<CorrectorProgress>(phase, "phase.failed.busy.holder: invalid type: integer `1`");
    let covariance = cbor!({ "stamp" => 1, "x" => 0, "y" => 0, "covariance" => [1, 0, 0] });
    check::<Fix>(covariance, "covariance: invalid length 3, expected a list of 4 finite numbers");
    check::<Refusal>(cbor!({ "nonsense" => { "why" => "x" } }), "unknown variant `nonsense`");
}

#[test]
fn a_missing_key_is_refused_by_its_name() {
    check::<EncodersData>(cbor!({ "stamp" => 1, "left" => 0 }), "missing field `right`");
    check::<Dwm>(cbor!({ "v0l" => 0, "v0r" => 0, "v1l" => 0, "v1r" => 0 }), "missing field `T`");
    check::<WayTask>(
        cbor!({ "points" => [{ "x" => 1, "y" => 2 }, { "y" => 2 }] }),
        "points[1]: missing field `x`",
    );
    check::<WayTask>(cbor!({}), "missing field `points`");
    check::<Release>(cbor!({ "boot" => 1 }), "missing field `epoch`");
    for key in ["boot", "epoch", "seq", "echo", "ttl_ms", "dwm"] {
        check::<Command>(command(key, Value::Null, "", Value::Null), &format!("missing field `{key}`"));
    }
    for key in ["v0l", "v0r", "v1l", "v1r", "T"] {
        check::<Command>(command("", Value::Null, key, Value::Null), &format!("dwm: missing field `{key}`"));
    }
}

#[test]
fn an_unknown_key_is_ignored() {
    let known = decode::<EncodersData>(&bytes(cbor!({ "stamp" => 1, "left" => 2, "right" => 3 })));
    let more = cbor!({ "stamp" => 1, "new" => { "deep" => [1, "x", null] }, "left" => 2, "right" => 3 });
    assert_eq!(decode::<EncodersData>(&bytes(more)), known);
    assert!(known.is_ok());
    let dwm = cbor!({ "v0l" => 0, "v0r" => 0, "v1l" => 0, "v1r" => 0, "T" => 1, "colour" => "red" });
    assert!(decode::<Dwm>(&bytes(dwm)).is_ok(), "a movement that commands nothing is open");
}

#[test]
fn an_unknown_key_to_the_gate_is_refused_by_its_name() {
    assert!(decode::<Command>(&bytes(command("", Value::Null, "", Value::Null))).is_ok(), "the control");
    check::<Command>(command("hurry", 1.into(), "", Value::Null), "hurry: unknown field `hurry`");
    check::<Command>(command("", Value::Null, "vmax", 1.into()), "dwm.vmax: unknown field `vmax`");
    check::<Release>(cbor!({ "boot" => 1, "epoch" => 1, "all" => true }), "all: unknown field `all`");
    let enable = cbor!({ "stop" => 1, "boot" => 1, "echo" => 1, "by" => "x", "force" => true });
    check::<Enable>(enable, "force: unknown field `force`");
    let ask = cbor!({ "holder" => "x", "class" => "manual", "period" => 0.05, "priority" => 9 });
    check::<LeaseAsk>(ask, "priority: unknown field `priority`");
    let robot = cbor!({ "legs" => [], "robot" => { "trakc" => 0.3 } });
    check::<DriveAsk>(robot, "robot.trakc: unknown field `trakc`");
}

#[test]
fn a_number_that_is_not_finite_is_refused_by_the_name_of_its_field() {
    for (number, text) in [(f64::NAN, "NaN"), (f64::INFINITY, "inf"), (f64::NEG_INFINITY, "-inf")] {
        let words = |field: &str| format!("{field}: {text} is not a finite number");
        check::<EncodersData>(cbor!({ "stamp" => 1, "left" => number, "right" => 0 }), &words("left"));
        check::<WayTask>(cbor!({ "points" => [{ "x" => 0, "y" => number }] }), &words("points[0].y"));
        let covariance = cbor!({ "stamp" => 1, "x" => 0, "y" => 0, "covariance" => [1, 0, 0, number] });
        check::<Fix>(covariance, &words("covariance[3]"));
        check::<Signals>(cbor!({ "left" => 0, "right" => number }), &words("right"));
        check::<Meta>(cbor!({ "seq" => 1, "source" => 1, "stamp" => number }), &words("stamp"));
        for key in ["v0l", "v0r", "v1l", "v1r", "T"] {
            check::<Command>(command("", Value::Null, key, number.into()), &words(&format!("dwm.{key}")));
        }
    }
    // The same as 16 and 32 bits, which other encoders write.
    for nan in [&[0xf9, 0x7e, 0x00][..], &[0xfa, 0x7f, 0xc0, 0, 0]] {
        check_bytes::<EncodersData>(&map(&[("stamp", nan), ("left", &[0]), ("right", &[0])]), "stamp: NaN");
    }
}

#[test]
fn an_integer_is_taken_for_a_float() {
    let whole = decode::<EncodersData>(&bytes(cbor!({ "stamp" => 1, "left" => -2, "right" => 0 })));
    let float = decode::<EncodersData>(&bytes(cbor!({ "stamp" => 1.0, "left" => -2.0, "right" => 0.0 })));
    assert_eq!(whole, float);
    assert!(whole.is_ok());
    let most = &[0x1b, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff];
    // The largest integer of CBOR is a float as well where a field has no range.
    assert!(decode::<EncodersSpan>(&map(&[("duration", most), ("left", &[0]), ("right", &[0])])).is_ok());
    let big = &[0xc2, 0x49, 1, 0, 0, 0, 0, 0, 0, 0, 0];
    let words = "stamp: invalid type: integer `18446744073709551616` as u128";
    check_bytes::<EncodersData>(&map(&[("stamp", big), ("left", &[0]), ("right", &[0])]), words);
}

#[test]
fn a_value_out_of_its_range_is_refused_by_its_name() {
    check::<Dwm>(
        cbor!({ "v0l" => 0, "v0r" => 0, "v1l" => 0, "v1r" => 0, "T" => -1 }),
        "duration T of a DWM is out of",
    );
    check::<Command>(
        command("", Value::Null, "T", (-1).into()),
        "dwm: duration T of a DWM is out of range: -1 s",
    );
    check::<Command>(
        command("ttl_ms", 65_536.into(), "", Value::Null),
        "ttl_ms: invalid value: integer `65536`",
    );
    check_range::<Command>(
        command("", Value::Null, "T", 0.into()),
        "duration of a command is out of range: 0 s",
    );
    check_range::<Command>(command("", Value::Null, "v1r", (-21).into()), "wheel speed of a command in m/s");
    check::<Signals>(
        cbor!({ "left" => 2, "right" => 0 }),
        "left: duty cycle is out of range: 2, allowed is -1 to 1",
    );
    check::<DriveAsk>(cbor!({ "legs" => [], "robot" => { "track" => 0 } }), "robot.track: track in metres");
    check_range::<WayTask>(
        cbor!({ "points" => [{ "x" => 0, "y" => 1e9 }] }),
        "y of way point 1 is out of range",
    );
    check_range::<WayTask>(cbor!({ "points" => [] }), "a point to visit is missing");
    for (field, name) in [("stamp", "stamp"), ("left", "left wheel"), ("right", "right wheel")] {
        for far in [1.1e9, -1.1e9, f64::MAX] {
            let value = |of: &str| if of == field { far } else { 0.0 };
            let reading =
                cbor!({ "stamp" => value("stamp"), "left" => value("left"), "right" => value("right") });
            check_range::<EncodersData>(reading, name);
        }
    }
    let lost = cbor!({ "stamp" => 1, "pose" => { "x" => 0, "y" => 0, "heading" => 1.1e9 } });
    check_range::<NavigatorData>(lost, "heading in rad is out of range");
    check_range::<LeaseAsk>(
        cbor!({ "holder" => "x", "class" => "manual", "period" => 0 }),
        "period of a lease",
    );
}

#[test]
fn a_key_that_stands_twice_is_refused_by_its_name() {
    let twice = map(&[("stamp", &[1]), ("left", &[0]), ("right", &[0]), ("left", &[2])]);
    check_bytes::<EncodersData>(&twice, "duplicate field `left`");
}

#[test]
fn bytes_that_follow_are_refused() {
    for golden in examples::all() {
        let mut bytes = golden.bytes.clone();
        bytes.push(0);
        let text = (golden.again)(&bytes).expect_err(&golden.stem).to_string();
        assert!(
            text.contains("1 bytes follow the message") || text.contains("too large"),
            "{}: {text}",
            golden.stem
        );
    }
}

#[test]
fn a_message_cut_anywhere_is_refused() {
    for golden in examples::all() {
        for length in 0..golden.bytes.len() {
            let refusal = (golden.again)(&golden.bytes[..length]).expect_err(&golden.stem);
            assert!(matches!(refusal, Refusal::Malformed { .. }), "{} at {length}: {refusal:?}", golden.stem);
            let text = refusal.to_string();
            assert!(text.ends_with("the bytes end too early"), "{} at {length}: {text:?}", golden.stem);
        }
    }
}

#[test]
fn a_false_length_is_refused() {
    let huge = |major: u8| [major | 27, 0x80, 0, 0, 0, 0, 0, 0, 0];
    for golden in examples::all() {
        for major in [0x40, 0x60, 0x80, 0xa0] {
            let refusal = (golden.again)(&huge(major)).expect_err(&golden.stem);
            assert!(matches!(refusal, Refusal::Malformed { .. }), "{}: {refusal:?}", golden.stem);
        }
    }
    check_bytes::<EncodersData>(&huge(0xa0), "the bytes end too early");
    check_bytes::<WayTask>(&map(&[("points", &huge(0x80))]), "points[0]: the bytes end too early");
    check_bytes::<Drive>(&map(&[("dwms", &huge(0x80))]), "dwms[0]: the bytes end too early");
    check_bytes::<AllStop>(&map(&[("id", &[1]), ("by", &huge(0x60))]), "by: the bytes end too early");
    check_bytes::<EncodersData>(&map(&[("ignored", &huge(0xa0))]), "the bytes end too early");
}

#[test]
fn what_is_nested_too_deep_is_refused_before_the_stack_ends() {
    for opener in [&[0x81][..], &[0xa1, 0x61, b'a'], &[0x9f], &[0xc1]] {
        let deep = opener.repeat(100_000);
        for golden in examples::all() {
            (golden.again)(&deep).expect_err(&golden.stem);
        }
        // Inside a key that is ignored, and within the limit of the largest message.
        let text = decode::<Drive>(&map(&[("ignored", &deep)])).expect_err("too deep").to_string();
        assert!(text.contains(&format!("nested deeper than {DEPTH} levels")), "{text:?}");
        assert!(text.starts_with("malformed Drive: ignored"), "{text:?}");
    }
}

#[test]
fn ten_megabytes_are_refused_before_they_are_read() {
    let large = vec![0x81; 10_000_000];
    let start = std::time::Instant::now();
    for golden in examples::all() {
        let refusal = (golden.again)(&large).expect_err(&golden.stem);
        assert!(matches!(refusal, Refusal::TooLarge { got: 10_000_000, .. }), "{refusal:?}");
        let text = refusal.to_string();
        assert!(
            text.starts_with(&format!("{} in bytes is too large: 10000000, at most ", golden.name)),
            "{text}"
        );
    }
    assert!(start.elapsed() < std::time::Duration::from_millis(200), "{:?} is reading", start.elapsed());
}

#[test]
fn text_that_is_not_utf8_is_refused_by_the_name_of_its_field() {
    check_bytes::<AllStop>(&map(&[("id", &[1]), ("by", &[0x61, 0xff])]), "by: byte 8 is not valid CBOR");
    check_bytes::<EncodersData>(&[0xa1, 0x61, 0xff, 0x00], "<key>: byte 1 is not valid CBOR");
}

#[test]
fn what_a_stranger_writes_cannot_steer_a_terminal() {
    let key = "\u{1b}[31m\n\u{7}";
    let text = bytes(command(key, 1.into(), "", Value::Null));
    check_bytes::<Command>(&text, "\u{fffd}[31m");
    let refusal =
        decode_as::<Command>("application/cbor;axle.\u{1b}[2J.v1", &text).expect_err("another type");
    assert!(!refusal.to_string().contains(char::is_control), "{refusal:?}");
    let long = "x".repeat(1500);
    check::<GateState>(cbor!({ "boot" => 1, "tick" => { long => 1 } }), "tick");
}

#[test]
fn a_sample_that_says_it_is_another_message_is_refused() {
    let dwm = axle_schema::encode(&examples::dwm()).expect("a dwm");
    for encoding in [&encoding_of::<Dwm>(), "", "application/cbor", "application/cbor;", "zenoh/bytes"] {
        assert_eq!(decode_as::<Dwm>(encoding, &dwm), Ok(examples::dwm()), "{encoding:?}");
    }
    for (encoding, got) in [
        ("application/cbor;axle.EncodersData.v1", "axle.EncodersData.v1"),
        ("application/cbor;axle.Dwm.v2", "axle.Dwm.v2"),
        ("application/cbor;axle.Dwm.v01", "axle.Dwm.v01"),
        ("application/cbor;axle.Dwm.v+1", "axle.Dwm.v+1"),
        ("application/cbor;axle.Dwm.v", "axle.Dwm.v"),
        ("application/cbor;axle.Dwm.v1 ", "axle.Dwm.v1 "),
        ("application/cbor;Dwm.v1", "Dwm.v1"),
        ("application/cbor;axle.DwmX.v1", "axle.DwmX.v1"),
        ("application/json;x", "x"),
    ] {
        let refusal = decode_as::<Dwm>(encoding, &dwm).expect_err(encoding);
        let words = format!("wrong type: this key carries axle.Dwm.v1, the sample says it is {got}");
        assert_eq!(refusal.to_string(), words);
    }
}

#[test]
fn a_list_that_is_too_long_is_refused_by_its_name() {
    let reading = cbor!({ "stamp" => 1, "left" => 0, "right" => 0 }).expect("a reading");
    let window = cbor!({ "boot" => 1, "encoders" => vec![reading; 4097] });
    let text = decode::<Window>(&bytes(window)).expect_err("too long").to_string();
    assert_eq!(text, "encoders of a window is too large: 4097, at most 4096");
    let point = cbor!({ "x" => 1, "y" => 0 }).expect("a point");
    let text = decode::<WayTask>(&bytes(cbor!({ "points" => vec![point; 4097] })))
        .expect_err("too long")
        .to_string();
    assert_eq!(text, "way points is too large: 4097, at most 4096");
}
