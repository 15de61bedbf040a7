//! A recording of a drive gives the same bits again, service by service, and tells why the robot did what it did.

use crate::harness::{World, driven};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Every corrector of the catalogue.
const CORRECTORS: [&str; 6] =
    ["d-corrector", "g-corrector", "w-corrector", "arc-corrector", "pursuit-corrector", "ltv-corrector"];

/// A way that shows a turn and a line, and is soon driven.
const WAY: &str = "0.15,0 0.15,0.1";

async fn drive(world: &World, corrector: &str, out: &str) {
    let args = ["demo", "--json", "--way", WAY, "--out", out, "--seed", "3", "--corrector", corrector];
    driven(|| world.axle(&args)).await.is(0, &[]);
}

/// The reports of `axle replay --json` by service.
fn reports(lines: &str) -> BTreeMap<String, Value> {
    let line = |line: &str| serde_json::from_str::<Value>(line).expect("JSON");
    lines
        .lines()
        .map(line)
        .map(|report| (report["service"].as_str().expect("a name").to_owned(), report))
        .collect()
}

/// Replays a recording: everything that is judged must be the same bits. A machine that is too busy drops a sample on
/// its way to the recorder now and then; then there are some that are not judged, and `false` is returned.
async fn replays_whole(world: &World, corrector: &str) -> bool {
    let file = format!("{corrector}/demo.mcap");
    let replayed = world.axle(&["replay", &file, "--json"]).ended().await;
    let reports = reports(&replayed.is(0, &[]).out);
    let services: Vec<_> = reports.keys().map(String::as_str).collect();
    let mut wanted = ["navigator", "pathdriver", "pathfinder", "source", corrector];
    wanted.sort_unstable();
    assert_eq!(services, wanted, "every service that is a value was judged");
    for (service, report) in &reports {
        assert_eq!(report["is_identical"], true, "{service}: {report}");
    }
    let is_whole = reports.values().all(|report| report["unjudged"] == serde_json::json!({}));
    for (service, report) in &reports {
        let least = if service.starts_with("path") { 1 } else { 40 };
        assert!(!is_whole || report["outputs"].as_u64() >= Some(least), "{service}: {report}");
    }
    is_whole
}

#[tokio::test(flavor = "multi_thread")]
async fn the_recording_of_a_drive_replays_to_the_same_bits_for_every_service_and_corrector() {
    let world = World::new().await;
    for corrector in CORRECTORS {
        let mut is_whole = false;
        for _ in 0..4 {
            drive(&world, corrector, corrector).await;
            is_whole = replays_whole(&world, corrector).await;
            if is_whole {
                break;
            }
        }
        assert!(is_whole, "four recordings of {corrector} lack samples");
    }
}

/// Copies a recording with changed samples.
fn forge(from: &Path, to: &Path, mut change: impl FnMut(&mut axle_recorder::Recorded)) {
    let params = axle_recorder::RecorderParams::default();
    let mut recorder = axle_recorder::Recorder::create(to, &BTreeMap::new(), &params, 1).expect("a file");
    for entry in axle_recorder::Recording::open(from).expect("a recording") {
        let axle_recorder::Entry::Sample(mut sample) = entry else { continue };
        change(&mut sample);
        recorder
            .write(axle_recorder::Sample {
                key: &sample.key,
                encoding: &sample.encoding,
                payload: &sample.payload,
                attachment: sample.attachment.as_deref(),
                received: sample.received,
            })
            .expect("room");
    }
    recorder.finish().expect("room");
}

#[tokio::test(flavor = "multi_thread")]
async fn other_parameters_and_changed_bytes_show_as_differences() {
    let world = World::new().await;
    drive(&world, "d-corrector", "shown").await;
    let file = "shown/demo.mcap";
    // The same parameters from a file change nothing.
    let same = world.file("same.toml", &world.axle(&["params", "source"]).ended().await.out);
    let against = ["replay", file, "--service", "source", "--against", &same];
    world.axle(&against).ended().await.is(0, &[]);
    let other = world.file("other.toml", "[limits]\nno_such = 1\n");
    let refused =
        world.axle(&["replay", file, "--service", "d-corrector", "--against", &other]).ended().await;
    refused.is(2, &["other.toml"]);
    let other = world.file("slow.toml", "recent = 0.05\n");
    let against = ["replay", file, "--service", "source", "--against", &other];
    let differs = world.axle(&against).ended().await;
    differs.is(1, &["source/recent", "recorded", "now", "not the same bits: source"]);

    // One bit of one pose, behind the back of the checksum.
    let mut poses = 0;
    forge(&world.path().join(file), &world.path().join("forged.mcap"), |sample| {
        if sample.key.ends_with("navigator/pose") {
            poses += 1;
            if poses == 30 {
                let mut data: axle_schema::NavigatorData =
                    axle_schema::decode(&sample.payload).expect("a pose");
                data.pose.x.0 = data.pose.x.0.next_up();
                sample.payload = axle_schema::encode(&data).expect("bytes");
            }
        }
    });
    let forged = world.axle(&["replay", "forged.mcap", "--service", "navigator", "--json"]).ended().await;
    let report = &reports(&forged.is(1, &["not the same bits: navigator"]).out)["navigator"];
    let (outputs, identical) = (report["outputs"].as_u64(), report["identical"].as_u64());
    assert_eq!(outputs.zip(identical).map(|(outputs, identical)| outputs - identical), Some(1), "{report}");
    assert_eq!(report["differences"][0]["field"], "pose.x", "{report}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_of_an_older_schema_is_read_as_far_as_it_can_be() {
    let world = World::new().await;
    drive(&world, "d-corrector", "shown").await;
    let file = world.path().join("shown/demo.mcap");
    // A writer that did not know the covariance yet, and said something that nobody reads any more.
    forge(&file, &world.path().join("lean.mcap"), |sample| {
        if sample.key.ends_with("emulator/truth") {
            let mut data: BTreeMap<String, ciborium::Value> =
                ciborium::from_reader(&sample.payload[..]).expect("a map");
            data.remove("twist");
            data.insert("mood".into(), ciborium::Value::Bool(true));
            sample.payload.clear();
            ciborium::into_writer(&data, &mut sample.payload).expect("bytes");
        }
    });
    let chart = world.axle(&["chart", "lean.mcap"]).ended().await;
    assert!(!chart.is(0, &[]).err.contains("could not be read"), "{chart:?}");
    // One of another version: what is of it is left out and named, and everything else is read.
    forge(&file, &world.path().join("old.mcap"), |sample| {
        if sample.key.ends_with("emulator/truth") {
            sample.encoding = "application/cbor;axle.NavigatorData.v0".into();
        }
    });
    let old = "this key carries axle.NavigatorData.v1, the sample says it is axle.NavigatorData.v0";
    let info = world.axle(&["record", "info", "old.mcap"]).ended().await;
    info.is(0, &[]);
    assert!(info.out.contains("axle.NavigatorData.v0 (here axle.NavigatorData.v1)"), "{info:?}");
    let hint = "recorded by another version of Axle";
    world.axle(&["chart", "old.mcap"]).ended().await.is(0, &[old, hint]);
    world.axle(&["estimate", "old.mcap", "--report"]).ended().await.is(1, &[old]);
    world.axle(&["why", "r1", "old.mcap"]).ended().await.is(0, &[old]);
    // No service takes the truth, so that all of them are judged.
    world.axle(&["replay", "old.mcap"]).ended().await.is(0, &[old]);
    forge(&file, &world.path().join("older.mcap"), |sample| {
        if sample.key.ends_with("robot/encoders") {
            sample.encoding = "application/cbor;axle.EncodersData.v0".into();
        }
    });
    let replayed = world.axle(&["replay", "older.mcap", "--service", "source"]).ended().await;
    replayed.is(1, &["axle.EncodersData.v0", "nothing could be judged of: source"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_missing_is_not_judged_and_said() {
    let world = World::new().await;
    drive(&world, "d-corrector", "shown").await;
    let file = world.path().join("shown/demo.mcap");
    let bytes = std::fs::read(&file).expect("the recording");
    std::fs::write(world.path().join("cut.mcap"), &bytes[..bytes.len() * 2 / 3]).expect("a file");
    let cut = world.axle(&["replay", "cut.mcap"]).ended().await;
    assert!(cut.err.contains("the recording is cut off") && cut.out.contains("navigator"), "{cut:?}");
    cut.is(0, &[]);
    let late = world.axle(&["record", "cut", "shown/demo.mcap", "late.mcap", "--from", "2"]).ended().await;
    late.is(0, &["samples are in late.mcap"]);
    let late = world.axle(&["replay", "late.mcap", "--service", "navigator"]).ended().await;
    late.is(1, &["the recording begins after the service", "nothing could be judged of: navigator"]);
    for (args, words) in [
        (vec!["replay", "no.mcap"], "cannot read the recording no.mcap"),
        (vec!["replay", "shown/demo.svg"], "is not an MCAP file"),
        (vec!["replay", "shown/demo.mcap", "--robot", "r9"], "nothing of r9 was recorded, but of"),
        (vec!["replay", "shown/demo.mcap", "--service", "pilot"], "pilot cannot be replayed; these can:"),
        (vec!["replay", "shown/demo.mcap", "--service", "nobody"], "unknown service"),
    ] {
        world.axle(&args).ended().await.is(2, &[words]);
    }
}

/// The longest stretch of one movement of the drive, in the robot's clock: where it surely drives.
fn a_time_under_way(file: &Path) -> f64 {
    let recording = axle_recorder::Recording::open(file).expect("a recording");
    let stamps: Vec<f64> = recording
        .filter_map(|entry| match entry {
            axle_recorder::Entry::Sample(sample) if sample.key.ends_with("d-corrector/progress") => {
                axle_schema::decode::<axle_schema::task::CorrectorProgress>(&sample.payload).ok()
            }
            _ => None,
        })
        .filter(|progress| progress.phase == axle_schema::task::Phase::Running && progress.elapsed.0 > 0.0)
        .map(|progress| progress.stamp.0)
        .collect();
    stamps[stamps.len() / 2]
}

#[tokio::test(flavor = "multi_thread")]
async fn why_leads_from_the_wheels_back_to_the_way() {
    let world = World::new().await;
    drive(&world, "d-corrector", "shown").await;
    let file = "shown/demo.mcap";
    let at = a_time_under_way(&world.path().join(file)).to_string();
    let why = world.axle(&["why", "r1", "--at", &at, file, "--json"]).ended().await;
    let explained = why.is(0, &[]).json();
    let links = explained["links"].as_array().expect("links");
    let streams: Vec<_> = links.iter().map(|link| link["stream"].as_str().expect("a stream")).collect();
    let chain = [
        "pilot/way",
        "pilot/plan",
        "pilot/drive",
        "d-corrector/task",
        "d-corrector/progress",
        "gate/command",
        "robot/encoders",
    ];
    assert_eq!(streams, chain);
    let before: Vec<_> = links.iter().map(|link| link["before"].as_f64().expect("an age")).collect();
    // Commands overtake reports on their way to the recorder.
    let is_older = |pair: &[f64]| pair[0] + 0.1 >= pair[1];
    assert!(before.windows(2).all(is_older), "each is older than what it caused: {before:?}");
    let words = world.axle(&["why", "r1", "--at", &at, file]).ended().await;
    for part in
        ["due: left", "error: left", "movement ", "source/recent: sample", "navigator/pose: sample", "leg "]
    {
        assert!(words.out.contains(part), "{part:?} is missing in {}", words.out);
    }
    world.axle(&["why", "r1", "--at", "-5", file]).ended().await.is(2, &[]);
    world.axle(&["why", "r1", "--at", "0", file]).ended().await.is(1, &["nothing is known of r1 at 0 s"]);
    world.axle(&["why", "r5", file]).ended().await.is(2, &["nothing of r5 was recorded"]);
}
