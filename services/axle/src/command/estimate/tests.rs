//! Logs, read and estimated.

use super::*;

fn opened(text: &str) -> (Log, NavigatorParams) {
    let mut params = NavigatorParams::default();
    let log = Log::lines(text.as_bytes(), &mut params).expect("readable");
    (log, params)
}

#[test]
fn a_log_tells_start_track_measurements_and_truth() {
    let (log, params) = opened(
        "{\"start\":{\"x\":1,\"y\":2,\"heading\":0.5},\"track\":0.2}\n\
         {\"stamp\":0,\"encoders\":{\"left\":0,\"right\":0},\"gyro\":0.1}\n\
         {\"stamp\":0.1,\"range\":{\"x\":0,\"y\":0,\"distance\":1,\"sd\":0.1},\"truth\":{\"x\":1,\"y\":2}}\n\
         {\"stamp\":0.2,\"fix\":{\"x\":1,\"y\":2,\"sd\":0.01}}\n\
         {\"stamp\":0.3}\n{\"stamp\":0.3,\"fix\":{\"x\":1,\"y\":2,\"sd\":0}}\nnonsense\n",
    );
    assert_eq!((log.lines, log.bad, log.items.len()), (7, 3, 5));
    assert!((params.robot.track.get() - 0.2).abs() < 1e-15 && (params.start.y.0 - 2.0).abs() < 1e-15);
}

#[test]
fn the_labyrinth_is_estimated_by_every_method_and_drawn() {
    let text = include_str!("../../../../navigator/tests/data/labyrinth/labyrinth.jsonl");
    let (log, mut params) = opened(text);
    params.robot.wheel_speed = axle_schema::MetresPerSecond(2.0);
    params.robot.turn_rate = axle_schema::RadiansPerSecond(10.0);
    params.ekf.range_bias = axle_schema::Metres(0.1);
    let runs: Vec<_> = Method::ALL
        .into_iter()
        .map(|method| run(&log, NavigatorParams { method, ..params.clone() }, true).expect("estimated"))
        .collect();
    for run in &runs {
        let report = run.report.json(run.method.name());
        assert_eq!((run.poses.len(), report["truths"].as_u64()), (233, Some(233)));
        let rmse = report["rmse"].as_f64().expect("an error");
        // Point and shoot turns first, and pays for it.
        let allowed = if run.method == Method::PointAndShoot { 0.2 } else { 0.07 };
        assert!(rmse < allowed, "{}: {rmse} m", run.method.name());
        assert_eq!(run.report.row(run.method.name()).len(), Report::HEADER.len());
    }
    let drawn = svg("labyrinth", &log, &runs).expect("a chart");
    for word in ["truth", "ekf", "position error (m)"] {
        assert!(drawn.contains(word), "{word} is not in the chart");
    }
}

/// A recording of an emulated robot that drives a bend for ten seconds, and the end of its way. Its file is gone at the end.
struct Recorded {
    path: std::path::PathBuf,
    end: Pose,
}

impl Drop for Recorded {
    fn drop(&mut self) {
        std::fs::remove_file(&self.path).ok();
    }
}

fn recorded() -> Recorded {
    use axle_emulator::{Emulator, EmulatorParams};
    use axle_recorder::{Recorder, RecorderParams, Sample};
    use axle_schema::codec::{encode, encoding_of};
    use axle_schema::{Message, MetresPerSecond, RobotId, Sides, key};

    let path = std::env::temp_dir().join(format!("axle-estimate-{}.mcap", std::process::id()));
    std::fs::remove_file(&path).ok();
    let params = EmulatorParams { start: Pose::new(1.0, 2.0, 0.5), ..EmulatorParams::default() };
    let mut robot = Emulator::new(params).expect("a robot");
    let mut recorder =
        Recorder::create(&path, &Default::default(), &RecorderParams::default(), 0).expect("a file");
    let (r1, r2) = (RobotId::new("r1").expect("a robot"), RobotId::new("r2").expect("a robot"));
    fn put<M: Message>(recorder: &mut Recorder, key: key::Key<M>, message: &M, now: u64) {
        let (encoding, payload) = (encoding_of::<M>(), encode(message).expect("a message"));
        let sample = Sample {
            key: key.as_str(),
            encoding: &encoding,
            payload: &payload,
            attachment: None,
            received: now,
        };
        recorder.write(sample).expect("written");
    }
    for beat in 1..=2000_u32 {
        robot.advance(
            Seconds(f64::from(beat) * 0.005),
            Sides::new(MetresPerSecond(0.3), MetresPerSecond(0.36)),
        );
        if !beat.is_multiple_of(4) {
            continue;
        }
        let now = u64::from(beat) * 5_000_000;
        put(&mut recorder, key::INERTIAL.of(&r1), &robot.inertial(), now);
        put(&mut recorder, key::ENCODERS.of(&r1), &robot.encoders(), now);
        put(&mut recorder, key::TRUTH.of(&r1), &robot.truth(), now);
        // Another robot's wheels are no business of this one, nor is what is not measured.
        put(&mut recorder, key::ENCODERS.of(&r2), &axle_schema::EncodersData::default(), now);
        put(&mut recorder, key::POSE.of(&r1), &robot.truth(), now);
    }
    recorder.finish().expect("closed");
    Recorded { path, end: robot.truth().pose }
}

#[test]
fn a_recording_is_estimated_as_a_log_is() {
    let recorded = recorded();
    let mut params = NavigatorParams::default();
    let log = Log::open(recorded.path.to_str().expect("a path"), &mut params).expect("readable");
    assert_eq!((log.bad, log.items.len()), (0, 3 * 500));
    assert!(params.start.distance(Pose::new(1.0, 2.0, 0.0)).0 < 0.01, "it begins where the truth does");
    for method in Method::ALL {
        let run = run(&log, NavigatorParams { method, ..params.clone() }, true).expect("estimated");
        let report = run.report.json(method.name());
        assert_eq!((run.poses.len(), report["truths"].as_u64()), (500, Some(500)));
        let end = run.poses.last().expect("a pose").map;
        assert!(end.distance(recorded.end).0 < 0.05, "{}: {end:?}, not {:?}", method.name(), recorded.end);
        let rmse = report["rmse"].as_f64().expect("an error");
        assert!(rmse < 0.04, "{}: {rmse} m", method.name());
    }
}
