//! What other tools are shown, recordings in several files, copies, and numbers about them.

use super::*;
use axle_schema::codec::encoding_of;
use axle_schema::{NavigatorData, Pose, Task, TaskId, WayPoint, WayTask};
use std::fs;

const POSE: &str = "axle/r1/navigator/pose";
const WAY: &str = "axle/r1/pilot/way";

/// What a plain MCAP reader finds: topic, schema, and message.
fn messages(path: &Path) -> Vec<(String, String, serde_json::Value)> {
    let bytes = fs::read(path).expect("the file");
    mcap::MessageStream::new(&bytes)
        .expect("an MCAP file")
        .map(|message| message.expect("a message"))
        .map(|message| {
            let schema =
                message.channel.schema.as_ref().map(|schema| schema.name.clone()).unwrap_or_default();
            let json = serde_json::from_slice(&message.data).unwrap_or_default();
            (message.channel.topic.clone(), schema, json)
        })
        .collect()
}

fn pose(x: f64) -> Vec<u8> {
    encode(&NavigatorData { pose: Pose::new(x, 2.0, 0.5), ..NavigatorData::default() }).expect("bytes")
}

fn way() -> Vec<u8> {
    let plan = WayTask { points: vec![WayPoint::at(1.0, 0.0), WayPoint::at(1.0, 1.0)] };
    encode(&Task { id: TaskId(7), plan }).expect("bytes")
}

fn said<'a, M: Message>(key: &'a str, payload: &'a [u8], received: u64, encoding: &'a str) -> Sample<'a> {
    assert_eq!(encoding, encoding_of::<M>());
    Sample { key, encoding, payload, attachment: None, received }
}

#[test]
fn a_pose_is_shown_as_foxglove_wants_it_and_read_back_once() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    let mut recorder = recorder(&path);
    let encoding = encoding_of::<NavigatorData>();
    // The second one comes too soon to be seen.
    for (x, at) in [(1.0, 0), (1.5, 1_000_000), (2.0, 30_000_000)] {
        recorder.write(said::<NavigatorData>(POSE, &pose(x), NOON + at, &encoding)).expect("room");
    }
    let encoding = encoding_of::<Task<WayTask>>();
    recorder.write(said::<Task<WayTask>>(WAY, &way(), NOON + SECOND, &encoding)).expect("room");
    recorder.finish().expect("room");

    let all = messages(&path);
    let of = |topic: &str| all.iter().filter(|(own, ..)| own == topic).collect::<Vec<_>>();
    let poses = of("/r1/pose");
    assert_eq!(poses.len(), 2, "50 Hz are enough for an eye");
    let (_, schema, json) = poses[1];
    assert_eq!(schema, "foxglove.PoseInFrame");
    assert_eq!(json["pose"]["position"], serde_json::json!({ "x": 2.0, "y": 2.0, "z": 0.0 }));
    assert!((json["pose"]["orientation"]["z"].as_f64().expect("a number") - 0.25_f64.sin()).abs() < 1e-15);
    assert_eq!(json["timestamp"], serde_json::json!({ "sec": 1_700_000_000, "nsec": 30_000_000 }));
    let (_, schema, json) = of("/tf")[0];
    assert_eq!(schema, "foxglove.FrameTransform");
    assert_eq!((&json["parent_frame_id"], &json["child_frame_id"]), (&"map".into(), &"r1".into()));
    let (_, schema, json) = of("/r1/scene")[0];
    assert_eq!(schema, "foxglove.SceneUpdate");
    assert_eq!(json["entities"][0]["spheres"].as_array().map(Vec::len), Some(2));
    let (read, account) = samples(&path);
    assert_eq!((read.len(), account.samples), (4, 4), "what is derived is not read back");
}

#[test]
fn every_derived_message_has_the_fields_of_its_schema() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    let mut recorder = recorder(&path);
    let encoding = encoding_of::<NavigatorData>();
    recorder.write(said::<NavigatorData>(POSE, &pose(1.0), NOON, &encoding)).expect("room");
    recorder.write(said::<Task<WayTask>>(WAY, &way(), NOON, &encoding_of::<Task<WayTask>>())).expect("room");
    recorder.finish().expect("room");
    let bytes = fs::read(&path).expect("the file");
    let mut seen = 0;
    for message in mcap::MessageStream::new(&bytes).expect("an MCAP file") {
        let message = message.expect("a message");
        let Some(schema) = message.channel.schema.as_ref().filter(|schema| schema.encoding == "jsonschema")
        else {
            continue;
        };
        seen += 1;
        let schema: serde_json::Value = serde_json::from_slice(&schema.data).expect("a schema");
        let json: serde_json::Value = serde_json::from_slice(&message.data).expect("JSON");
        fits_schema(&schema, &json, &message.channel.topic);
    }
    assert_eq!(seen, 4, "a pose, a transform, a body and a scene");
}

/// Both have the same fields of the same types.
fn fits_schema(schema: &serde_json::Value, json: &serde_json::Value, at: &str) {
    let is_right = match schema["type"].as_str() {
        Some("object") => json.is_object(),
        Some("array") => json.is_array(),
        Some("string") => json.is_string(),
        Some("integer") => json.is_u64(),
        Some("number") => json.is_number(),
        Some("boolean") => json.is_boolean(),
        other => panic!("{at}: type {other:?}"),
    };
    assert!(is_right, "{at}: {json} is no {}", schema["type"]);
    if let (Some(fields), Some(object)) = (schema["properties"].as_object(), json.as_object()) {
        for (name, field) in fields {
            // What nobody draws is left empty, and may be missing in what is drawn.
            let Some(value) = object.get(name) else { panic!("{at}.{name} is missing") };
            fits_schema(field, value, &format!("{at}.{name}"));
        }
        assert!(object.keys().all(|name| fields.contains_key(name)), "{at}: {json} has more than its schema");
    }
    for (index, item) in json.as_array().into_iter().flatten().enumerate() {
        fits_schema(&schema["items"], item, &format!("{at}[{index}]"));
    }
}

#[test]
fn a_series_turns_over_keeps_so_many_files_and_what_holds() {
    let folder = Folder::new();
    let params = RecorderParams { file_gb: 0.001, files: 2, ..RecorderParams::default() };
    let about = BTreeMap::from([("robot".to_owned(), "r1".to_owned())]);
    let mut series = Series::create(&folder.file("s.mcap"), about, params, NOON).expect("a file");
    let encoding = encoding_of::<Task<WayTask>>();
    series.write(said::<Task<WayTask>>(WAY, &way(), NOON, &encoding)).expect("room");
    let payload = [7; 10_000];
    for number in 0..350 {
        series.write(sample(&payload, None, NOON + number * SECOND / 100)).expect("room in the next file");
    }
    let files: Vec<_> = series.files().map(Path::to_owned).collect();
    assert_eq!(files, [folder.file("s.003.mcap"), folder.file("s.004.mcap")]);
    let totals = series.finish().expect("room");
    assert!(totals.samples >= 351, "{totals:?}");
    let mut left: Vec<_> =
        fs::read_dir(&folder.0).expect("the folder").map(|entry| entry.expect("an entry").path()).collect();
    left.sort();
    assert_eq!(left, files, "the oldest are removed");
    for file in &files {
        let (samples, account) = samples(file);
        assert!(account.finished);
        assert_eq!(
            (&*samples[0].key, samples[0].received),
            (WAY, NOON),
            "the way holds in {}",
            file.display()
        );
    }
}

#[test]
fn a_copy_is_whole_and_a_part_has_what_holds_at_its_beginning() {
    let folder = Folder::new();
    let (from, whole, part) = (folder.file("a.mcap"), folder.file("b.mcap"), folder.file("c.mcap"));
    let mut recorder = recorder(&from);
    recorder.write(said::<Task<WayTask>>(WAY, &way(), NOON, &encoding_of::<Task<WayTask>>())).expect("room");
    for number in 1..=10 {
        let attachment = meta(if number > 5 { number + 3 } else { number });
        recorder.write(sample(b"x", Some(&attachment), NOON + number * SECOND)).expect("room");
    }
    recorder.gap(KEY, 3, NOON + 6 * SECOND).expect("room");
    recorder.flush(NOON + 11 * SECOND).expect("room");
    // As a crash leaves it.
    let bytes = fs::read(&from).expect("the file");
    fs::write(folder.file("crash.mcap"), &bytes).expect("a file");
    drop(recorder);
    let (account, totals) = copy(&folder.file("crash.mcap"), &whole, &Part::default()).expect("a copy");
    assert!(!account.finished && totals.samples == 11 && totals.lost == 3);
    assert_eq!(samples(&whole).0, samples(&from).0);
    let info = Info::read(&whole).expect("a recording");
    assert!(info.account.finished && info.about["version"] == "0.1.0");
    let stream = &info.streams[KEY];
    assert_eq!((stream.samples, stream.lost, stream.missing), (10, 3, 3), "three numbers are missing");
    assert_eq!(info.span, (NOON, NOON + 10 * SECOND));

    let wanted = Part { from: 3 * SECOND, to: Some(5 * SECOND), only: Vec::new() };
    copy(&from, &part, &wanted).expect("a part");
    let received: Vec<_> = samples(&part).0.iter().map(|sample| (sample.received - NOON) / SECOND).collect();
    assert_eq!(received, [0, 3, 4, 5], "the way still holds");
    assert!(matches!(copy(&from, &part, &wanted), Err(CopyError::Write(RecordError::Create { .. }))));
    assert!(matches!(copy(&folder.file("no"), &part, &wanted), Err(CopyError::Read(_))));
}

#[test]
fn a_hundred_kills_at_any_byte_leave_a_recording_that_opens() {
    // A kill leaves a file that ends anywhere: each of these is one.
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    let mut recorder = recorder(&path);
    let encoding = encoding_of::<NavigatorData>();
    for number in 0..200_u64 {
        let at = NOON + number * SECOND / 50;
        recorder.write(said::<NavigatorData>(POSE, &pose(1.0), at, &encoding)).expect("room");
        recorder.flush_if_due(at).expect("room");
    }
    recorder.flush(NOON + 5 * SECOND).expect("room");
    let bytes = fs::read(&path).expect("the file");
    let mut before = 0;
    for kill in 1..=100 {
        let end = bytes.len() * kill / 100;
        let cut = folder.file("cut.mcap");
        fs::write(&cut, &bytes[..end]).expect("a file");
        let (read, account) = samples(&cut);
        assert!(account.damaged == 0 && read.len() >= before, "byte {end}: {account:?}");
        before = read.len();
    }
    assert_eq!(before, 200);
}
