//! The bytes that Axle writes, as committed in `tests/golden`, and what CDDL says of them.
//!
//! `AXLE_WRITE_GOLDEN=1 cargo test -p axle --test whole golden` rewrites the files; a changed file is a changed wire.

use super::examples;
use axle_schema::codec::schema_of;
use axle_schema::{CDDL, Message, Refusal, decode, encode};
use std::collections::BTreeSet;
use std::fmt::Debug;
use std::path::{Path, PathBuf};

/// What a decoder of one type makes of bytes: the bytes that it would write itself.
pub(super) type Again = fn(&[u8]) -> Result<Vec<u8>, Refusal>;

type Same = Box<dyn Fn(&[u8]) -> Result<bool, Refusal>>;

/// One example of one message.
pub(super) struct Golden {
    /// The name of the type, and of its CDDL rule.
    pub(super) name: &'static str,
    /// The name of the file, without its ending.
    pub(super) stem: String,
    /// What the codec makes of the example.
    pub(super) bytes: Vec<u8>,
    /// The example for people.
    json: String,
    /// Decodes bytes as this type and encodes the result.
    pub(super) again: Again,
    /// Whether bytes decode to the example itself.
    same: Same,
}

impl Golden {
    pub(super) fn new<M: Message + PartialEq + Debug>(variant: &str, example: M) -> Self {
        let dash = if variant.is_empty() { "" } else { "-" };
        Self {
            name: M::NAME,
            stem: format!("{}{dash}{variant}", M::NAME),
            bytes: encode(&example).unwrap_or_else(|why| panic!("{} {variant}: {why}", M::NAME)),
            json: serde_json::to_string_pretty(&example).expect("examples have text keys") + "\n",
            again: again::<M>,
            same: Box::new(move |bytes| Ok(decode::<M>(bytes)? == example)),
        }
    }
}

/// Decodes, encodes, and decodes again: what was once accepted stays what it is.
fn again<M: Message + PartialEq + Debug>(bytes: &[u8]) -> Result<Vec<u8>, Refusal> {
    let message: M = decode(bytes)?;
    let written = encode(&message).expect("what was read can be written");
    assert_eq!(decode::<M>(&written).expect("what was written can be read"), message);
    Ok(written)
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden")
}

/// Checks bytes against the rule `name` of the shipped CDDL.
pub(super) fn conforms(name: &str, bytes: &[u8]) -> Result<(), String> {
    // The excerpt begins with the rule, which makes it the root; and it is read twenty times faster than the whole.
    let text =
        axle_recorder::cddl::excerpt(CDDL, name).ok_or_else(|| format!("axle.cddl has no rule {name}"))?;
    cddl::validate_cbor_from_slice(&text, bytes, None).map_err(|fault| fault.to_string())
}

#[test]
fn golden_files_hold_the_very_bytes_that_are_written() {
    let write = std::env::var_os("AXLE_WRITE_GOLDEN").is_some_and(|value| value == "1");
    let mut stems = BTreeSet::new();
    for golden in examples::all() {
        assert!(stems.insert(golden.stem.clone()), "{} is there twice", golden.stem);
        let (cbor, json) = (format!("{}.cbor", golden.stem), format!("{}.json", golden.stem));
        if write {
            std::fs::create_dir_all(folder()).expect("the folder can be made");
            std::fs::write(folder().join(&cbor), &golden.bytes).expect("the file can be written");
            std::fs::write(folder().join(&json), &golden.json).expect("the file can be written");
        }
        let advice = "if the change is meant: AXLE_WRITE_GOLDEN=1 cargo test -p axle --test whole golden";
        let bytes =
            std::fs::read(folder().join(&cbor)).unwrap_or_else(|why| panic!("{cbor}: {why}; {advice}"));
        assert_eq!(bytes, golden.bytes, "{cbor} is no longer what is written; {advice}");
        let text = std::fs::read_to_string(folder().join(&json)).unwrap_or_default();
        assert_eq!(text, golden.json, "{json} is no longer what {cbor} says; {advice}");
        assert!((golden.same)(&bytes).expect("a golden file is read"), "{cbor} reads as another value");
    }
}

#[test]
fn golden_files_are_all_known() {
    let known: BTreeSet<String> = examples::all()
        .iter()
        .flat_map(|golden| [format!("{}.cbor", golden.stem), format!("{}.json", golden.stem)])
        .collect();
    for entry in std::fs::read_dir(folder()).expect("the folder is there") {
        let name = entry.expect("an entry").file_name().to_string_lossy().into_owned();
        assert!(known.contains(&name), "golden/{name} belongs to no example: delete it");
    }
}

#[test]
fn golden_bytes_conform_to_the_cddl() {
    for golden in examples::all() {
        if let Err(why) = conforms(golden.name, &golden.bytes) {
            panic!("{}: {why}", golden.stem);
        }
    }
}

#[test]
fn the_cddl_refuses_what_the_codec_refuses() {
    use super::hostile::bytes;
    use ciborium::cbor;
    let check = |name: &str, value: Result<ciborium::Value, ciborium::value::Error>| {
        let bytes = bytes(value);
        assert!(conforms(name, &bytes).is_err(), "the CDDL of {name} takes {value:?}", value = bytes);
        let golden = examples::all().into_iter().find(|golden| golden.name == name).expect("a known name");
        assert!((golden.again)(&bytes).is_err(), "the codec of {name} takes {bytes:?}");
    };
    check("EncodersData", cbor!({ "stamp" => "1", "left" => 0, "right" => 0 }));
    check("EncodersData", cbor!({ "stamp" => 1, "left" => 0 }));
    check("EncodersData", cbor!([1, 0, 0]));
    check("InertialData", cbor!({ "stamp" => 1, "gyro" => 0, "ax" => "fast" }));
    check("WayTask", cbor!({ "points" => [] }));
    check("WayTask", cbor!({ "points" => [{ "x" => 1 }] }));
    check("Signals", cbor!({ "left" => 1.5, "right" => 0 }));
    check("Fix", cbor!({ "stamp" => 1, "x" => 0, "y" => 0, "covariance" => [1, 0, 0] }));
    check(
        "Plan",
        cbor!({ "start" => { "x" => 0, "y" => 0, "heading" => 0 }, "legs" => [{ "geometry" => { "loop" => { "length" => 1 } }, "point" => 0 }], "length" => 1 }),
    );
    check("Release", cbor!({ "boot" => 1, "epoch" => 4_294_967_296_u64 }));
    check("Release", cbor!({ "boot" => 1, "epoch" => 1, "hurry" => true }));
    check(
        "Command",
        cbor!({ "boot" => 7, "epoch" => 3, "seq" => 1, "echo" => 5, "ttl_ms" => 150, "dwm" => { "v0l" => 0, "v0r" => 0, "v1l" => 0, "v1r" => 0, "T" => 1, "vmax" => 1 } }),
    );
    check("Refusal", cbor!({ "malformed" => { "what" => "x" } }));
    check(
        "CorrectorProgress",
        cbor!({ "task" => 1, "phase" => "lost", "stamp" => 1, "elapsed" => 1, "fraction" => 0 }),
    );
}

/// The names of all messages, read from the source text of the schema crate.
fn names_in_the_source() -> BTreeSet<String> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../schema/src");
    let mut names = BTreeSet::new();
    for entry in std::fs::read_dir(source).expect("the schema crate is beside the tests") {
        let text = std::fs::read_to_string(entry.expect("an entry").path()).unwrap_or_default();
        for implementation in text.split("Message for ").skip(1).filter(|rest| !rest.starts_with('\n')) {
            let Some((_, rest)) = implementation.split_once("const NAME: &'static str = \"") else {
                continue;
            };
            names.insert(rest.split('"').next().unwrap_or_default().to_owned());
        }
    }
    names
}

#[test]
fn every_message_has_a_golden_file_and_a_cddl_rule() {
    let names = names_in_the_source();
    assert!(names.len() >= 35, "the scan of the source finds too few messages: {names:?}");
    let goldens: BTreeSet<String> = examples::all().iter().map(|golden| golden.name.to_owned()).collect();
    assert_eq!(names, goldens, "messages of the schema crate (left) and examples (right)");
    for name in names {
        assert!(CDDL.contains(&format!("\n{name} = ")), "axle.cddl has no rule {name}");
    }
}

#[test]
fn every_rule_of_the_cddl_is_used() {
    // A rule begins at the start of a line; whatever no other line names is a leftover.
    let rules = CDDL.lines().filter_map(|line| {
        let (name, _) = line.split_once(" = ")?;
        (!name.starts_with([';', ' '])).then_some(name)
    });
    let words: Vec<&str> = CDDL
        .lines()
        .map(|line| line.split(';').next().unwrap_or_default())
        .flat_map(|line| line.split(|c: char| !(c.is_alphanumeric() || c == '-' || c == '_')))
        .collect();
    for rule in rules.filter(|rule| *rule != "Message") {
        assert!(words.iter().filter(|word| **word == rule).count() > 1, "nothing uses the rule {rule}");
    }
}

#[test]
fn a_schema_name_holds_the_version() {
    assert_eq!(schema_of::<axle_schema::Dwm>(), "axle.Dwm.v1");
}
