//! The filter against its golden run, and the slopes of its motion against differences.

use super::*;
use axle_schema::motion::arc;
use axle_schema::{Metres, Radians};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}
fn close(what: &str, ours: f64, golden: f64, tolerance: f64) {
    assert!((ours - golden).abs() <= tolerance, "{what}: {ours}, golden {golden}");
}

/// With 4, 6 and 9 states in use the golden ones are the same, since what is said to be exact adds nothing.
#[test]
fn the_golden_run_is_repeated() {
    let sparse = EkfParams { bias_sd: 0.0, accelerometer_bias_sd: 0.0, ..EkfParams::default() };
    for params in [
        sparse,
        EkfParams { accelerometer_noise: 0.1, ..sparse },
        // So little that it is nothing, and still in use.
        EkfParams { wheel_sd: 1e-150, track_sd: 1e-150, ..sparse },
    ] {
        repeats_the_golden_run(&params);
    }
}

fn repeats_the_golden_run(params: &EkfParams) {
    let golden: Value = serde_json::from_str(include_str!("../../../tests/data/ekf.json")).expect("JSON");
    let param = |name: &str| number(&golden["params"][name]);
    let noise = Noise {
        track: param("track"),
        k: param("k"),
        gyro: param("sigma_g2"),
        bias: param("q_b"),
        ..Noise::default()
    };
    let mut filter = Filter::new(Pose::default(), &Matrix3::zeros(), params);
    for i in 0..4 {
        filter.x[i] = number(&golden["x0"][i]);
        filter.p[(i, i)] = number(&golden["P0_diag"][i]);
    }
    let steps = golden["steps"].as_array().expect("steps");
    assert_eq!(steps.len(), 37);
    for (index, step) in steps.iter().enumerate() {
        let of = |name: &str| number(&step[name]);
        if step["type"] == "predict" {
            let motion = Motion {
                dt: of("dt"),
                left: of("sl"),
                right: of("sr"),
                gyro: step["gyro"].as_f64(),
                ..Motion::default()
            };
            let thought = filter.predict(&motion, &noise);
            assert_eq!(thought.is_some(), step["gyro"].is_number());
            if let Some(Innovation { nu, s }) = thought {
                close("innovation", nu, of("gyro_innovation"), 1e-12);
                close("its variance", s / of("gyro_S"), 1.0, 1e-10);
            }
        } else {
            let variance = param("sigma_z2");
            let r = Numbers([variance, 0.0, 0.0, variance]);
            let squared = filter.fix([of("zx"), of("zy")], &r, [of("ox"), of("oy")], f64::INFINITY);
            close("distance", squared / of("mahalanobis2"), 1.0, 1e-10);
        }
        for i in 0..4 {
            close(&format!("step {index}, x[{i}]"), filter.x[i], number(&step["x"][i]), 1e-12);
            for j in 0..4 {
                let scale = (number(&step["P"][i][i]) * number(&step["P"][j][j])).sqrt();
                let golden = number(&step["P"][i][j]);
                close(&format!("step {index}, P[{i}, {j}]"), filter.p[(i, j)], golden, 1e-12 * scale);
            }
        }
        assert!(
            filter.p[(LEFT, LEFT)] < 1e-290 && filter.x[TRACK].abs() < 1e-290,
            "what is exact stays exact"
        );
    }
}

#[test]
fn wrong_measures_of_the_robot_are_found_by_fixes() {
    // The left wheel is 2 % larger and the track 3 % wider than the filter believes; fixes of 1 mm on a winding way.
    let params = EkfParams { wheel_sd: 0.05, track_sd: 0.05, ..EkfParams::default() };
    let mut filter = Filter::new(Pose::default(), &(Matrix3::identity() * 1e-8), &params);
    let noise = Noise { track: 0.3, k: 1e-6, gyro: 1e-6, bias: 1e-8, ..Noise::default() };
    let mut truth = Pose::default();
    for n in 0..2000_u32 {
        let turn = if (n / 150).is_multiple_of(2) { 0.3 } else { -0.2 };
        let (left, right) = (0.01 * (1.0 - turn), 0.01 * (1.0 + turn));
        let (x, y, theta) = arc(1.02 * left, right, 0.3 * 1.03);
        truth = truth.moved(Metres(x), Metres(y), Radians(theta));
        let motion = Motion { dt: 0.02, left, right, ..Motion::default() };
        let _ = filter.predict(&motion, &noise);
        if n % 10 == 9 {
            let r = Numbers([1e-6, 0.0, 0.0, 1e-6]);
            let _ = filter.fix([truth.x.0, truth.y.0], &r, [0.0, 0.0], f64::INFINITY);
        }
    }
    for (what, ours, real) in
        [("left", filter.x[LEFT], 0.02), ("right", filter.x[RIGHT], 0.0), ("track", filter.x[TRACK], 0.03)]
    {
        assert!((ours - real).abs() < 0.004, "{what}: {ours} instead of {real}");
    }
}

#[test]
fn a_range_pulls_along_its_direction_only() {
    let mut filter =
        Filter::new(Pose::new(1.0, 0.0, 0.3), &(Matrix3::identity() * 0.01), &EkfParams::default());
    let squared = filter.range([0.0, 0.0], 1.1, 0.01, 13.8, 1.345);
    assert!((squared - 0.5).abs() < 1e-12, "{squared}");
    assert!(
        (filter.x[0] - 1.05).abs() < 1e-12 && filter.x[1].abs() < 1e-15 && (filter.x[2] - 0.3).abs() < 1e-15
    );
    assert!((filter.p[(0, 0)] - 0.005).abs() < 1e-12 && (filter.p[(1, 1)] - 0.01).abs() < 1e-15);
    let before = filter.x;
    assert!(filter.range([0.0, 0.0], 9.0, 0.01, 13.8, 1.345) > 1000.0);
    let same = before.iter().zip(filter.x).all(|(before, now)| before.to_bits() == now.to_bits());
    assert!(same, "what is not believed changes nothing");
}

#[test]
fn a_range_beyond_the_elbow_pulls_as_hard_as_one_at_it() {
    let filter = Filter::new(Pose::new(1.0, 0.0, 0.3), &(Matrix3::identity() * 0.01), &EkfParams::default());
    let pulled = |distance: f64, elbow: f64| {
        let mut filter = filter.clone();
        let _ = filter.range([0.0, 0.0], distance, 0.01, f64::INFINITY, elbow);
        (filter.x[0] - 1.0, filter.p[(0, 0)])
    };
    // The innovation has a deviation of √0.02 m; at 2 of them the elbow is passed, and the pull stays that of 1.345.
    let sd = 0.02_f64.sqrt();
    let (at, _) = pulled(1.0 + 1.345 * sd, 1.345);
    for times in [1.5, 2.0, 10.0] {
        let (beyond, variance) = pulled(1.0 + times * sd, 1.345);
        assert!((beyond - at).abs() < 1e-12, "{beyond} m at {times}, {at} m at the elbow");
        assert!((variance - (0.01 - 0.005 * 1.345 / times)).abs() < 1e-12, "it teaches less: {variance} m²");
    }
    assert!(
        (pulled(1.0 + 2.0 * sd, f64::INFINITY).0 - sd).abs() < 1e-12,
        "without an elbow it pulls in full"
    );
}

#[test]
fn the_accelerometer_smooths_the_speed_and_its_bias_is_found() {
    // 0.4 m/s with 1 mm of noise in each reading of 20 ms; the accelerometer reads 0.05 m/s² too much.
    let params = EkfParams { accelerometer_noise: 0.01, accelerometer_bias_sd: 0.1, ..EkfParams::default() };
    let noise = Noise { track: 0.3, k: 1e-4, gyro: 1e-6, push: 1e-4, ..Noise::default() };
    let mut filter = Filter::new(Pose::default(), &Matrix3::zeros(), &params);
    let mut wobble = 0.001;
    for n in 0..5000 {
        wobble = -wobble;
        let (left, right) = (0.008 + wobble, 0.008 - wobble / 2.0);
        let push = (n > 0).then_some(Push { change: 0.05 * 0.02, over: 0.02 });
        let motion =
            Motion { dt: 0.02, left, right, gyro: Some((right - left) / 0.3), push, ..Motion::default() };
        let _ = filter.predict(&motion, &noise);
    }
    assert!((filter.x[PUSH] - 0.05).abs() < 4.0 * filter.p[(PUSH, PUSH)].sqrt(), "{}", filter.x[PUSH]);
    assert!(filter.p[(PUSH, PUSH)].sqrt() < 0.01, "{}", filter.p[(PUSH, PUSH)]);
    assert!(
        (filter.x[SPEED] - 0.4).abs() < 0.01,
        "a reading alone is off by 0.0125 m/s: {}",
        filter.x[SPEED]
    );
}
