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
    // Ranges by ultra-wideband have a long tail; the navigator's own tests say what the gate costs and brings.
    params.ekf.gate = 9.0;
    let runs: Vec<_> = Method::ALL
        .into_iter()
        .map(|method| run(&log, NavigatorParams { method, ..params.clone() }).expect("estimated"))
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
