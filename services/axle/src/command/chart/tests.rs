//! What lines become: paths that go on where they ended, readings of wheels over time, and refusals in words.

use super::*;
use crate::command::convert::converted;
use std::f64::consts::{FRAC_PI_2, PI};

const CIRCLE: &str = r#"{"v0l":0.25,"v0r":0.5,"v1l":0.25,"v1r":0.5,"T":2}"#;

/// A run of these lines with a track of 0.5 m, and the complaints about them.
fn run(lines: &str) -> (Run, Vec<String>) {
    let complaints = std::cell::RefCell::new(Vec::new());
    let source =
        collect(lines.as_bytes(), Some(0.5), &|words| complaints.borrow_mut().push(words.to_owned()));
    let Ok(Source::Run(run, _, bad)) = source else { panic!("lines are a run") };
    let complaints = complaints.into_inner();
    assert_eq!(bad, complaints.len() as u64);
    (run, complaints)
}

fn good(lines: &str) -> Run {
    let (run, complaints) = run(lines);
    assert_eq!(complaints, Vec::<String>::new(), "{lines}");
    run
}

#[track_caller]
fn ends_at(lines: &str, (x, y): (f64, f64)) {
    let run = good(lines);
    let last = run.path().last().copied().expect("a point");
    assert!((last.0 - x).hypot(last.1 - y) < 1e-12, "{lines} ends at {last:?}");
    assert_eq!(run.path().first(), Some(&(0.0, 0.0)), "{lines}");
}

#[test]
fn each_line_goes_on_where_the_last_ended() {
    let quarter = format!(r#"{{"arc":{{"radius":1,"angle":{FRAC_PI_2}}}}}"#);
    ends_at(&quarter, (1.0, 1.0));
    ends_at(&[quarter.as_str(); 2].join("\n"), (0.0, 2.0));
    ends_at(&[quarter.as_str(); 4].join("\n"), (0.0, 0.0));
    ends_at(
        "{\"line\":{\"length\":1}}\n{\"turn\":{\"angle\":3.141592653589793}}\n{\"line\":{\"length\":0.25}}",
        (0.75, 0.0),
    );
    let half = format!(
        r#"{{"v0l":{},"v0r":{},"v1l":{},"v1r":{},"T":1}}"#,
        PI * 0.75,
        PI * 1.25,
        PI * 0.75,
        PI * 1.25
    );
    ends_at(&half, (0.0, 2.0));
    ends_at(&[half.as_str(); 2].join("\n"), (0.0, 0.0));
    // Half of its time is a quarter of the circle.
    ends_at(&half.replace('}', r#","t":0.5}"#), (1.0, 1.0));
    let span = format!(r#"{{"duration":1,"left":{},"right":{}}}"#, PI * 0.75, PI * 1.25);
    ends_at(&[span.as_str(); 2].join("\n"), (0.0, 0.0));
    ends_at(&[half, span, quarter].join("\n"), (1.0, 1.0));
    let side = r#"{"duration":1,"x":1,"y":0,"heading":1.5707963267948966}"#;
    ends_at(&[side; 3].join("\n"), (0.0, 1.0));
    ends_at(r#"{"spiral":{"start_radius":1,"end_radius":1,"angle":3.141592653589793}}"#, (0.0, 2.0));
}

#[test]
fn poses_and_readings_are_taken_as_they_are() {
    let pose = |stamp: f64, x: f64| format!(r#"{{"stamp":{stamp},"pose":{{"x":{x},"y":-1,"heading":0.1}}}}"#);
    let poses = good(&[pose(7.0, 3.0), pose(7.5, 3.1), pose(8.0, 0.3)].join("\n"));
    assert_eq!(poses.path(), [(3.0, -1.0), (3.1, -1.0), (0.3, -1.0)]);
    assert!(poses.distances().is_empty() && poses.speeds().is_empty());
    let readings = good(
        "{\"stamp\":5,\"left\":10,\"right\":20}\n{\"stamp\":6,\"left\":11,\"right\":21}\n{\"stamp\":8,\"left\":11,\"right\":21}",
    );
    assert_eq!(readings.path().last(), Some(&(1.0, 0.0)));
    let times: Vec<_> = readings.distances().iter().map(|point| (point.time, point.left)).collect();
    assert_eq!((times.first(), times.last()), (Some(&(0.0, 0.0)), Some(&(3.0, 1.0))));
    let states = "{\"x\":1,\"y\":2,\"theta\":0,\"v\":0,\"omega\":0,\"path\":9,\"shape\":\"line\"}";
    assert_eq!(good(states).path(), [(1.0, 2.0)]);
}

#[test]
fn speeds_are_those_of_the_movements_and_jump_where_they_jump() {
    let run = good(
        "{\"v0l\":0,\"v0r\":0,\"v1l\":1,\"v1r\":0.5,\"T\":2}\n{\"v0l\":0.5,\"v0r\":0.5,\"v1l\":0,\"v1r\":0,\"T\":1}",
    );
    let speeds: Vec<_> = run.speeds().iter().map(|point| (point.time, point.left, point.right)).collect();
    assert_eq!(speeds, [(0.0, 0.0, 0.0), (2.0, 1.0, 0.5), (2.0, 0.5, 0.5), (3.0, 0.0, 0.0)]);
    // Halfway through a constant acceleration a quarter of its distance is covered.
    let quarter =
        run.distances().iter().find(|point| (point.time - 1.0).abs() < 1e-12).expect("a point at 1 s");
    assert!((quarter.left - 0.25).abs() < 1e-12 && (quarter.right - 0.125).abs() < 1e-12);
    let last = run.distances().last().expect("an end");
    assert!((last.left - 1.25).abs() < 1e-12 && (last.right - 0.75).abs() < 1e-12);
    let twists = r#"{"stamp":1,"pose":{"x":0,"y":0,"heading":0},"twist":{"v":0.5,"omega":1}}"#;
    let speed = good(twists).speeds()[0];
    assert_eq!((speed.time, speed.left, speed.right), (0.0, 0.25, 0.75));
}

#[test]
fn what_a_movement_becomes_has_its_path() {
    let movements = format!("{CIRCLE}\n{}", CIRCLE.replace("0.25", "-0.25"));
    let end = *good(&movements).path().last().expect("an end");
    for arrow in ["encoders-span", "navigator-span", "navigator-data", "geometry", "halves"] {
        // A movement that is no curve within a tolerance has no geometry; these have.
        let lines = converted(&format!("dwm {arrow} --track 0.5"), &movements).join("\n");
        let run = good(&lines);
        let last = *run.path().last().expect("an end");
        assert!((last.0 - end.0).hypot(last.1 - end.1) < 1e-9, "dwm as {arrow}: {last:?}, not {end:?}");
    }
    let spans = converted("dwm encoders-span", &movements).join("\n");
    let readings = converted("encoders-span encoders-data", &spans).join("\n");
    let last = *good(&readings).path().last().expect("an end");
    assert!((last.0 - end.0).hypot(last.1 - end.1) < 1e-12);
}

#[test]
fn lines_that_cannot_be_drawn_are_told_by_their_number_and_the_others_drawn() {
    let lines = format!(
        "{CIRCLE}\nnonsense\n\n{{\"v0l\":1}}\n{{\"T\":1}}\n[1]\n{CIRCLE}\n{{\"v0l\":0,\"v0r\":0,\"v1l\":0,\"v1r\":0,\"T\":-1}}\n{{\"line\":{{\"length\":1e300}}}}\n{{\"duration\":1,\"x\":1e308,\"y\":1e308,\"heading\":0}}\n{{\"duration\":1,\"x\":1e308,\"y\":1e308,\"heading\":0}}"
    );
    let (found, complaints) = run(&lines);
    for (complaint, words) in complaints.iter().zip([
        ["line 2: ", "expected"],
        ["line 4: ", "missing field `v0r`"],
        ["line 5: ", "axle convert --map"],
        ["line 6: ", "axle convert --map"],
        ["line 8: ", "duration T"],
        ["line 9: ", "length of a line"],
        ["line 11: ", "beyond the range"],
    ]) {
        assert!(words.iter().all(|word| complaint.contains(word)), "{complaint}");
    }
    assert_eq!(complaints.len(), 7, "{complaints:?}");
    assert!(found.path().len() > 2 * 16);
    let Ok(Source::Run(none, ..)) =
        collect(CIRCLE.as_bytes(), None, &|words| assert!(words.contains("--track")))
    else {
        panic!("lines are a run")
    };
    assert!(none.path().is_empty());
}

#[test]
fn a_long_run_stays_bounded() {
    let run = good(&format!("{CIRCLE}\n").repeat(60_000));
    assert!(run.path().len() <= 400_000 && run.path().len() > 100_000, "{}", run.path().len());
    let last = run.distances().last().expect("an end");
    assert!((last.left - 30_000.0).abs() < 1e-6 && (last.time - 120_000.0).abs() < 1e-6);
}

#[test]
fn a_chart_of_runs_says_what_it_shows() {
    let source = |lines: &str| Source::Run(good(lines), 1, 0);
    let one = svg(&[("way.jsonl".into(), source(CIRCLE))], &[]).expect("a chart");
    for word in [
        "way.jsonl",
        "start",
        "end of a path",
        "left wheel",
        "wheel distance (m)",
        "wheel speed (m/s)",
        "time (s)",
    ] {
        assert!(one.contains(word), "no {word:?}");
    }
    let geometry = svg(&[("way.jsonl".into(), source(r#"{"line":{"length":1}}"#))], &[]).expect("a chart");
    let wall = (axle_maps::Ink::Occupied, [(2.0, 0.0), (3.0, 0.0), (3.0, 1.0), (2.0, 1.0)]);
    let walled = svg(&[("way.jsonl".into(), source(CIRCLE))], &[wall]).expect("a chart");
    assert!(walled.matches("<polygon").count() > one.matches("<polygon").count(), "the wall is drawn");
    assert!(!geometry.contains("time (s)"), "a geometry has no time");
    let two = svg(&[("a".into(), source(CIRCLE)), ("b".into(), source(r#"{"line":{"length":1}}"#))], &[])
        .expect("a chart");
    assert!(two.contains("\na, b\n") && two.contains("wheel speed (m/s)"));
    assert!(svg(&[("none".into(), source(""))], &[]).unwrap_err().to_string().contains("nothing to draw"));
}

#[test]
fn files_are_called_by_their_last_parts_unless_these_are_the_same() {
    let files = |files: [&str; 2]| names(&files.map(str::to_owned));
    assert_eq!(files(["runs/a.jsonl", "-"]), ["a.jsonl", "stdin"]);
    assert_eq!(files(["a/run.mcap", "b/run.mcap"]), ["a/run.mcap", "b/run.mcap"]);
}

/// A recording of one robot and a stranger, on the keys that they really use.
fn recording(file: &Path) {
    use axle_recorder::{Recorder, RecorderParams, Sample};
    use axle_schema::task::{CorrectorProgress, Phase, Task};
    use axle_schema::{
        Geometry, Leg, NavigatorData, Plan, Pose, RobotId, Seconds, Sides, TaskId, WayTask, encode,
    };
    let mut recorder =
        Recorder::create(file, &std::collections::BTreeMap::new(), &RecorderParams::default(), 0)
            .expect("a recorder");
    let mut write = |key: &str, payload: Vec<u8>| {
        let sample = Sample { key, encoding: "", payload: &payload, attachment: None, received: 0 };
        recorder.write(sample).expect("room");
    };
    let (r1, r2) = (RobotId::new("r1").expect("an id"), RobotId::new("r2").expect("an id"));
    let pose = |x: f64| {
        encode(&NavigatorData { pose: Pose::new(x, 0.0, 0.0), ..NavigatorData::default() }).expect("a pose")
    };
    let plan = Plan {
        legs: vec![Leg { geometry: Geometry::Line { length: Metres(1.0) }, point: 0, speed: None }],
        ..Plan::default()
    };
    let task = TaskId(7);
    write(
        key::GO_WAY.of(&r1).as_str(),
        encode(&Task { id: task, plan: WayTask::parse("0,0 1,0").expect("a way") }).expect("a task"),
    );
    write(key::GO_PLAN.of(&r1).as_str(), encode(&Task { id: task, plan }).expect("a task"));
    for step in 0..4 {
        let x = f64::from(step) * 0.25;
        write(key::TRUTH.of(&r1).as_str(), pose(x));
        write(key::POSE.of(&r1).as_str(), pose(x + 0.125));
        write(key::TRUTH.of(&r2).as_str(), pose(100.0));
        let beat = CorrectorProgress {
            task,
            phase: Phase::Running,
            stamp: Seconds(9.0 + x),
            elapsed: Seconds(x),
            fraction: x,
            due: Some(Sides::new(Metres(x), Metres(x))),
            real: Some(Sides::new(Metres(x), Metres(x / 2.0))),
        };
        write(key::corrector_progress("d-corrector").of(&r1).as_str(), encode(&beat).expect("a beat"));
    }
    write(key::TRUTH.of(&r1).as_str(), vec![0xff]);
    recorder.finish().expect("an end");
}

#[test]
fn a_recording_is_drawn_as_the_demo_draws_it() {
    let file = std::env::temp_dir().join(format!("axle-chart-{}.mcap", std::process::id()));
    recording(&file);
    let complaints = std::cell::RefCell::new(Vec::new());
    let source =
        open(&file.display().to_string(), None, &|words| complaints.borrow_mut().push(words.to_owned()));
    std::fs::remove_file(&file).expect("the file was there");
    let Ok(Source::Recording(heard)) = source else { panic!("an MCAP file is a recording") };
    let complaints = complaints.into_inner();
    assert!(
        complaints.len() == 1 && complaints[0].starts_with("1 samples could not be read"),
        "{complaints:?}"
    );
    let paths = heard.paths();
    let lasts: Vec<_> = paths
        .iter()
        .map(|path| (path.name.as_str(), path.points.len(), path.points.last().copied()))
        .collect();
    assert_eq!(
        lasts,
        [
            ("planned", 2, Some((1.0, 0.0))),
            ("true", 4, Some((0.75, 0.0))),
            ("estimated", 4, Some((0.875, 0.0)))
        ]
    );
    assert_eq!(heard.way_points, [(0.0, 0.0), (1.0, 0.0)]);
    let real = heard.wheels.real.last().expect("a beat");
    assert_eq!((real.time, real.left, real.right, heard.wheels.due.len()), (0.75, 0.75, 0.375, 4));
    let alone = svg(&[("run.mcap".into(), Source::Recording(heard))], &[]).expect("a chart");
    for word in ["planned", "true", "estimated", "way point", "left wheel, due", "right wheel, real"] {
        assert!(alone.contains(word), "no {word:?}");
    }
}
