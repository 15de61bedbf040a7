//! A calibration between the gate and a real serial line: measured, applied, kept.

use super::line::{Line, robot};
use crate::harness::{PATIENCE, r1, within};
use axle_mesh::Retry;
use axle_schema::calibration::{Branch, Calibrate, Calibrated, GetCalibration, WheelMap, Wiring};
use axle_schema::command::{Class, Done, LeaseAsk, Release};
use axle_schema::{Calibration, Seconds, Sides, key};
use nix::sys::signal::Signal;
use std::time::Duration;

/// Crossed encoders, a strong motor and a weak one, friction.
const FAULTY: &str = r#"
seed = 3
[motors]
gain_deviation = 0.0
dead_band = 0.03
lag = 0.05
gain = { left = 1.05, right = 0.93 }
[encoders.wiring]
swapped = true
"#;
/// Two passes of the motors alone, on a machine that does other things as well.
const LONG: Duration = Duration::from_secs(300);

async fn applied(line: &Line) -> Calibrated {
    line.mesh
        .ask(&key::CALIBRATION, Some(&r1()), &GetCalibration {}, PATIENCE, Retry::Idempotent)
        .await
        .expect("an answer")
}

/// What a perfect calibration of this robot is.
fn truth() -> Calibration {
    let wheel = |gain: f64| {
        let kv = 1.0 / (1.2 * gain);
        let branch = Branch { dead_band: 0.025, ks: 0.025, kv, ka: kv * 0.05, ..Branch::default() };
        WheelMap { forward: branch.clone(), backward: branch }
    };
    Calibration {
        version: 5,
        made: "by hand".into(),
        encoders: Wiring { swapped: true, ..Wiring::default() },
        wheels: Sides::new(wheel(1.05), wheel(0.93)),
        ..Calibration::default()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_board_that_is_told_powers_drives_by_a_calibration_which_outlives_its_process() {
    let params = "[dwm_text]\npowers = true\n";
    let mut line = Line::with("dwm-text", FAULTY, params).await;
    line.is_up().await;
    let facts = applied(&line).await;
    assert!(!facts.keeps_speeds && (facts.full_speed.0 - 1.2).abs() < 1e-12, "{facts:?}");
    assert_eq!(facts.calibration, Calibration::default());
    line.enable().await;
    let motors = line.mesh.inbox(&key::MOTORS.of(&r1()), 4).expect("signals");
    let heard = within(PATIENCE, "signals are told", motors.next()).await.message;
    assert!(heard.counted.is_some(), "with what was counted: {heard:?}");

    let ask = LeaseAsk { holder: "test".into(), class: Class::Manual, period: Seconds(0.2) };
    let lease = line.mesh.ask(&key::LEASE, Some(&r1()), &ask, PATIENCE, Retry::Never).await.expect("a lease");
    let give = Calibrate { boot: lease.boot, epoch: lease.epoch, calibration: truth() };
    let given: Result<Done, _> =
        line.mesh.ask(&key::CALIBRATE, Some(&r1()), &give, PATIENCE, Retry::Never).await;
    given.expect("applied and kept");
    let release = Release { boot: lease.boot, epoch: lease.epoch };
    let released: Result<Done, _> =
        line.mesh.ask(&key::RELEASE, Some(&r1()), &release, PATIENCE, Retry::Never).await;
    released.expect("given back");
    line.drives("0.3").await;
    while line.truth.take().is_some() {}
    let truth = within(PATIENCE, "a truth", line.truth.next()).await.message.pose;
    assert!((truth.x.0 - 0.3).abs() < 0.02 && truth.heading.0.abs() < 0.1, "{truth:?}");

    // Another process on the same line knows it.
    line.robot.tell(Signal::SIGTERM);
    line.robot.ended().await.is(0, &[]);
    let port = line.port.display().to_string();
    let params = line.world.path().join("robot.toml").display().to_string();
    line.robot = robot(&line.world, "dwm-text", &port, &["--params", &params]);
    line.robot.says("calibration 5 is applied").await;
    line.is_up().await;
    assert_eq!(applied(&line).await.calibration.version, 5);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_motors_behind_a_serial_line_are_measured_and_what_cannot_be_is_said() {
    let line = Line::with("arduino", FAULTY, "[arduino]\npowers = true\n").await;
    line.is_up().await;
    line.enable().await;
    let args = ["calibrate", "--room", "1.4x1.4", "--passes", "2", "--json", "--out", "found"];
    let ended = line.world.tool(&args).ended_within(LONG).await;
    ended.is(0, &["found: the encoders are swapped", "no gyroscope is heard", "--by-hand"]);
    let said = ended.json();
    assert_eq!(said["applied"], true);
    for (name, gain) in [("left forward kv", 1.05), ("right backward kv", 0.93)] {
        let list = said["quantities"].as_array().expect("a list");
        let one = list.iter().find(|one| one["name"] == name).unwrap_or_else(|| panic!("no {name}"));
        let (value, real) = (one["value"].as_f64().expect("a number"), 1.0 / (gain * 1.2));
        assert!((value / real - 1.0).abs() < 0.06, "{name}: {value} and really {real}");
    }
    let now = applied(&line).await.calibration;
    assert!(now.version == 1 && now.encoders.swapped && now.track.is_none(), "{now:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_board_that_measures_nothing_is_not_calibrated_and_does_not_move() {
    let line = Line::new("orfa").await;
    line.is_up().await;
    line.enable().await;
    assert!(!applied(&line).await.keeps_speeds);
    let args = ["calibrate", "--room", "2x2", "--out", "found"];
    line.world.tool(&args).ended().await.is(1, &["the encoders of the robot", "orfa"]);
    assert!(line.stands_at().await.abs() < 1e-9);
}
