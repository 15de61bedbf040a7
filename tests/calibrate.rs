//! A robot that is not as described is measured through the mesh and its gate, and is as described from then on.

use crate::harness::{Eyes, PATIENCE, Process, World, all_alive, within};
use axle_mesh::{Mesh, Retry};
use axle_schema::calibration::{Calibrate, Calibrated, GetCalibration, Raw, WheelSpeeds};
use axle_schema::command::{Class, LeaseAsk};
use axle_schema::{Calibration, MetresPerSecond, RobotId, Seconds, Signals, key};
use std::time::Duration;

/// Crossed encoders, a weak motor, friction, wheels of other sizes farther apart.
const FAULTY: &str = r#"
seed = 3
[motors]
gain_deviation = 0.0
dead_band = 0.03
lag = 0.05
gain = { left = 1.05, right = 0.93 }
[wheels]
track = 1.05
size = { left = 0.99, right = 1.01 }
[encoders.wiring]
swapped = true
"#;
/// Two passes in a small room, on a machine that does other things as well.
const LONG: Duration = Duration::from_secs(400);

fn r1() -> RobotId {
    RobotId::new("r1").expect("a robot")
}

/// A router and an emulator with these parameters.
async fn robot(world: &World, params: &str) -> (Process, Process, Mesh) {
    let router = world.router();
    let params = world.file("robot.toml", params);
    let emulator = world.tool(&["run", "emulator", "--host", "lab", "--params", &params]);
    let mesh = world.join().await;
    all_alive(&mesh, &["emulator"]).await;
    (router, emulator, mesh)
}

async fn applied(mesh: &Mesh) -> Calibrated {
    mesh.ask(&key::CALIBRATION, Some(&r1()), &GetCalibration {}, PATIENCE, Retry::Idempotent)
        .await
        .expect("an answer")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_is_calibrated_through_its_gate_and_stays_so_after_a_restart() {
    let world = World::new().await;
    let (_router, emulator, mesh) = robot(&world, FAULTY).await;
    assert_eq!(applied(&mesh).await.calibration, Calibration::default());
    let args = ["calibrate", "--room", "1.4x1.4", "--passes", "2", "--json", "--out", "found"];
    let ended = world.tool(&args).ended_within(LONG).await;
    ended.is(0, &["found: the encoders are swapped"]);
    let said = ended.json();
    assert_eq!(said["applied"], true);
    let value = |name: &str| {
        let list = said["quantities"].as_array().expect("a list");
        let one = list.iter().find(|one| one["name"] == name).unwrap_or_else(|| panic!("no {name}"));
        one["value"].as_f64().expect("a number")
    };
    // Two passes have wide intervals; what is found is close all the same.
    assert!((value("track") - 0.315).abs() < 0.002, "{}", value("track"));
    assert!((value("wheel ratio") - 1.01 / 0.99).abs() < 0.006, "{}", value("wheel ratio"));
    let kv = 0.99 / (1.05 * 1.2);
    assert!((value("left forward kv") / kv - 1.0).abs() < 0.06, "{}", value("left forward kv"));
    let (before, after) = (&said["square_before_m"], &said["square_after_m"]);
    assert!(after.as_f64().expect("a number") * 5.0 < before.as_f64().expect("a number"), "{before} {after}");
    for file in ["r1.calibration.toml", "r1.report.json", "r1.residuals.svg"] {
        assert!(world.path().join("found").join(file).exists(), "{file} is written");
    }
    let now = applied(&mesh).await.calibration;
    assert!(now.version == 1 && now.encoders.swapped, "{now:?}");

    // Another process of the same robot knows it, and drives as it is told: half a metre is half a metre.
    drop(emulator);
    let params = world.path().join("robot.toml").display().to_string();
    let emulator = world.tool(&["run", "emulator", "--host", "lab", "--params", &params]);
    emulator.says("calibration 1 is applied").await;
    all_alive(&mesh, &["emulator"]).await;
    assert_eq!(applied(&mesh).await.calibration, now);
}

#[tokio::test(flavor = "multi_thread")]
async fn without_room_nothing_moves_and_a_stop_ends_a_calibration() {
    let world = World::new().await;
    let (_router, _emulator, mesh) = robot(&world, FAULTY).await;
    let eyes = Eyes::of(&mesh).await;
    world.done(&["calibrate"]).await.is(2, &["--room 2x2"]);
    world.done(&["calibrate", "--room", "0.8x3"]).await.is(2, &["1.1x1.1 m at least"]);
    world.done(&["calibrate", "--room", "2"]).await.is(2, &["2x2"]);
    let mut calibrating = world.tool(&["calibrate", "--room", "2x2", "--out", "found"]);
    eyes.sees("the robot moves", |truth| truth.twist.is_some_and(|twist| twist.v.0.abs() > 0.02)).await;
    world.done(&["stop"]).await.is(0, &["is stopped"]);
    calibrating.ended().await.is(1, &["stopped by AllStop"]);
    eyes.sees_rest().await;
    assert_eq!(applied(&mesh).await.calibration, Calibration::default());
    assert!(!world.path().join("found").exists(), "nothing was found");
}

#[tokio::test(flavor = "multi_thread")]
async fn only_who_holds_the_wheels_may_calibrate_them() {
    let world = World::new().await;
    let (_router, _emulator, mesh) = robot(&world, "").await;
    let calibration = Calibration { version: 7, made: "by hand".into(), ..Calibration::default() };
    let give = |boot, epoch| Calibrate { boot, epoch, calibration: calibration.clone() };
    let refused = mesh.ask(&key::CALIBRATE, Some(&r1()), &give(mesh.boot(), 0), PATIENCE, Retry::Never).await;
    assert!(refused.expect_err("no lease").to_string().contains("lease"));
    let ask = LeaseAsk { holder: "test".into(), class: Class::Manual, period: Seconds(0.2) };
    let lease = mesh.ask(&key::LEASE, Some(&r1()), &ask, PATIENCE, Retry::Never).await.expect("a lease");
    let other = Raw { boot: lease.boot, epoch: lease.epoch + 1 };
    assert!(mesh.ask(&key::RAW, Some(&r1()), &other, PATIENCE, Retry::Never).await.is_err());
    let lease = mesh.ask(&key::LEASE, Some(&r1()), &ask, PATIENCE, Retry::Never).await.expect("a lease");
    let given = give(lease.boot, lease.epoch);
    mesh.ask(&key::CALIBRATE, Some(&r1()), &given, PATIENCE, Retry::Never).await.expect("kept");
    assert_eq!(applied(&mesh).await.calibration.version, 7);
    let kept = std::fs::read_to_string(world.path().join("state/r1.calibration.toml")).expect("a file");
    assert!(kept.contains("version = 7"), "{kept}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_calibrator_answers_speeds_with_signals_and_back() {
    let world = World::new().await;
    let _router = world.router();
    let _calibrator = world.run("calibrator");
    let mesh = world.join().await;
    all_alive(&mesh, &["calibrator"]).await;
    let speeds =
        WheelSpeeds { left: MetresPerSecond(0.6), right: MetresPerSecond(-0.3), accelerations: None };
    let robot = r1();
    let asked = mesh.ask(&key::TO_SIGNALS, Some(&robot), &speeds, PATIENCE, Retry::Idempotent);
    let signals: Signals = within(PATIENCE, "signals", asked).await.expect("signals");
    assert!((signals.left.get() - 0.5).abs() < 1e-12 && (signals.right.get() + 0.25).abs() < 1e-12);
    let back = mesh.ask(&key::TO_SPEEDS, Some(&r1()), &signals, PATIENCE, Retry::Idempotent).await;
    assert!((back.expect("speeds").left.0 - 0.6).abs() < 1e-12);
}
