//! What golden files hold of fleets, and of how a plan shall be driven.

use super::{Golden, drive, plan, way};
use axle_schema::task::{GoAsk, Phase, PilotProgress};
use axle_schema::traffic::{Claim, ClaimedWay, Clearance, Confirm, Mover, TrafficAsk, TrafficState, Wait};
use axle_schema::{
    Drive, DriveAsk, Joints, Manner, Metres, MetresPerSecond, Pose, RobotId, Seconds, Strategy, TaskId,
};

fn robot(name: &str) -> RobotId {
    RobotId::new(name).expect("a name")
}

pub(super) fn examples(all: &mut Vec<Golden>) {
    let claim = Claim { robot: robot("r2"), task: TaskId(77), passed: 3, until: 5, way: None };
    let way_of_legs = ClaimedWay { start: Pose::new(1.0, 2.0, 0.5), legs: plan().legs, radius: Metres(0.25) };
    all.push(Golden::new("short", claim.clone()));
    all.push(Golden::new("", Claim { passed: 0, until: 0, way: Some(way_of_legs), ..claim }));
    let wait = Wait { robot: robot("r5"), why: "it drives over (3.0, 1.2)".into() };
    let clearance = Clearance { task: TaskId(77), until: 5, pieces: 9, waits: Vec::new() };
    all.push(Golden::new("short", clearance.clone()));
    all.push(Golden::new("", Clearance { waits: vec![wait.clone()], ..clearance }));
    all.push(Golden::new("", TrafficAsk {}));
    let mover = Mover {
        robot: robot("r2"),
        task: TaskId(77),
        place: Pose::new(1.0, 2.0, 0.5),
        passed: 3,
        until: 5,
        pieces: 9,
        turn: Some(1),
        waits: vec![wait],
    };
    let parked = Mover { turn: None, waits: Vec::new(), pieces: 0, passed: 0, until: 0, ..mover.clone() };
    all.push(Golden::new("", TrafficState { robots: vec![mover, parked] }));
    all.push(Golden::new("", Confirm { by: "a person at the shelf".into() }));
    let go = GoAsk { way: way(), corrector: None, confirm: vec![1, 2] };
    all.push(Golden::new("confirm", go));
    let waiting = PilotProgress {
        task: TaskId(77),
        phase: Phase::Running,
        corrector: "d-corrector".into(),
        reached: 1,
        points: 2,
        distance_left: Metres(0.4),
        fraction: 0.5,
        elapsed: Seconds(2.25),
        waiting: Some("for r5: it drives over (3.0, 1.2)".into()),
    };
    all.push(Golden::new("waiting", waiting));
    let manner = Manner {
        strategy: Some(Strategy::Continuous),
        joints: Some(Joints::Blend),
        jump: Some(MetresPerSecond(0.06)),
        offset: Some(Metres(0.001)),
    };
    all.push(Golden::new(
        "manner",
        DriveAsk { legs: plan().legs, manner: Some(manner), ..DriveAsk::default() },
    ));
    all.push(Golden::new("blend", Drive { offset: Some(Metres(0.0005)), ..drive() }));
}
