//! The conformance kit passes Axle's own drive, and fails one that is broken on purpose.

use crate::harness::{Robot, all_alive, r1};
use axle_mesh::Mesh;
use axle_schema::command::{Done, Motion};
use axle_schema::differential_drive::{
    DriveDistance, DriveOperation, DriveStage, DriveState, DriveStopped, EnableDrive, GetDrive,
    OperationBegun, SetDrivePower, StopDrive, WheelState,
};
use axle_schema::{Metres, MetresPerSecond, Refusal, Seconds, Sides, StopId, TaskId, key};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::Duration;

/// The kit waits for whatever a drive may do late, and a broken one does nothing.
const LONG: Duration = Duration::from_secs(120);

/// The verdicts of a report in JSON lines.
fn verdicts(out: &str) -> BTreeMap<String, String> {
    let text = |value: &serde_json::Value| value.as_str().expect("a text").to_owned();
    out.lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON"))
        .map(|line| (text(&line["clause"]), text(&line["verdict"])))
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_drive_of_axle_keeps_every_clause() {
    let robot = Robot::new().await;
    let _drive = robot.world.run("drive");
    all_alive(&robot.mesh, &["drive"]).await;
    let report = robot.world.path().join("report.md");
    let file = report.display().to_string();
    let kit = robot.world.tool(&["conform", "--json", "--markdown", &file]).ended_within(LONG).await;
    kit.is(0, &[]);
    let verdicts = verdicts(&kit.out);
    assert!(verdicts.len() >= 28, "{verdicts:?}");
    let other: Vec<_> = verdicts.iter().filter(|(_, verdict)| *verdict != "pass").collect();
    assert!(other.is_empty(), "{other:?}");
    let report = std::fs::read_to_string(report).expect("the report");
    assert_eq!(report.lines().filter(|line| line.contains("| pass |")).count(), verdicts.len());
}

/// A drive that says what its clients want to hear. Its wheels turn with any power, forward only; it takes requests while it is
/// disabled, never stops, starts distances without an end, and knows no angles and no speeds.
struct Braggart {
    enabled: AtomicBool,
    wheels: AtomicU64,
    moving: AtomicBool,
}

impl Braggart {
    fn state(&self) -> DriveState {
        if self.moving.load(Relaxed) {
            self.wheels.fetch_add(1, Relaxed);
        }
        #[allow(clippy::cast_precision_loss, reason = "a few thousand looks")]
        let distance = Metres(self.wheels.load(Relaxed) as f64 * 0.01);
        let wheel = WheelState { distance, ..WheelState::default() };
        DriveState {
            stamp: Seconds(distance.0),
            enabled: self.enabled.load(Relaxed),
            stop: None,
            operation: DriveOperation::Idle,
            motion: Motion::Standing,
            cause: None,
            wheels: Sides::new(wheel, wheel),
            track: Metres(0.3),
            full_speed: MetresPerSecond(1.0),
        }
    }

    async fn serve(self: Arc<Self>, mesh: &Mesh) {
        let robot = Some(&r1());
        let get_key = key::DRIVE_GET.of(robot);
        let power_key = key::DRIVE_POWER.of(robot);
        let enable_key = key::DRIVE_ENABLE.of(robot);
        let stop_key = key::DRIVE_ALL_STOP.of(robot);
        let distance_key = key::DRIVE_DISTANCE.of(robot);
        let one = Arc::clone(&self);
        let (get, power, enable, stop) = (Arc::clone(&one), Arc::clone(&one), Arc::clone(&one), one);
        let get = mesh.serve(&get_key, move |GetDrive {}, _| Ok(get.state()));
        let power = mesh.serve(&power_key, move |ask: SetDrivePower, _| {
            power.moving.store(ask.left.get() != 0.0 || ask.right.get() != 0.0, Relaxed);
            Ok(Done {})
        });
        let enable = mesh.serve(&enable_key, move |ask: EnableDrive, _| {
            enable.enabled.store(ask.enable, Relaxed);
            Ok(Done {})
        });
        let stop = mesh.serve(&stop_key, move |_: StopDrive, _| {
            stop.enabled.store(false, Relaxed);
            Ok(DriveStopped { stop: StopId(1) })
        });
        let said = mesh.publisher(&key::DRIVE_DISTANCE_STAGE.of(&r1())).expect("a publisher");
        let distance = mesh.serve(&distance_key, move |ask: DriveDistance, _| {
            let operation = TaskId(7);
            let notice = DriveDistance { stage: DriveStage::Started, operation: Some(operation), ..ask };
            said.put(&notice, None).map_err(Refusal::internal)?;
            Ok(OperationBegun { operation })
        });
        let (..) = tokio::join!(get, power, enable, stop, distance);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drive_that_is_broken_on_purpose_fails() {
    let world = crate::harness::World::new().await;
    let _router = world.router();
    let mesh = world.join().await;
    let (enabled, wheels, moving) = (AtomicBool::new(true), AtomicU64::new(0), AtomicBool::new(false));
    let braggart = Arc::new(Braggart { enabled, wheels, moving });
    let serving = tokio::spawn(async move { braggart.serve(&mesh).await });
    let kit = world.tool(&["conform", "--json"]).ended_within(LONG).await;
    kit.is(1, &["of the contract's clauses do not hold"]);
    let verdicts = verdicts(&kit.out);
    let wrong = [
        "all-stop",
        "disabled-faults",
        "enable-quotes",
        "power-forward",
        "power-turn",
        "update",
        "distance",
        "distance-zero",
        "cancel-distance",
        "cancel-power",
        "disable-running",
    ];
    for clause in wrong {
        assert_eq!(verdicts[clause], "fail", "{clause}: {}", kit.out);
    }
    for clause in ["speed", "rotate-left", "rotate-right", "reset-encoders"] {
        assert_eq!(verdicts[clause], "not offered", "{clause}: {}", kit.out);
    }
    for clause in ["get", "initially-enabled", "power-range"] {
        assert_eq!(verdicts[clause], "pass", "{clause}: {}", kit.out);
    }
    serving.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drive_that_is_not_there_is_named() {
    let world = crate::harness::World::new().await;
    let _router = world.router();
    world.done(&["conform"]).await.is(1, &["the drive of r1 does not answer", "axle run drive"]);
}
