//! What golden files hold of the Generic Differential Drive contract.

use super::Golden;
use axle_schema::command::{BrakeCause, Motion};
use axle_schema::differential_drive::{
    DriveDistance, DriveOperation, DriveStage, DriveState, DriveStopped, EnableDrive, GetDrive, MotorPower,
    MotorReading, OperationBegun, ResetEncoders, RotateDegrees, SetDrivePower, SetDriveSpeed, StopDrive,
    WheelState,
};
use axle_schema::{Boot, Duty, Metres, MetresPerSecond, Refusal, Seconds, Sides, StopId, TaskId, Tick};

fn duty(value: f64) -> Duty {
    Duty::new(value).expect("within full power")
}

pub(super) fn examples(all: &mut Vec<Golden>) {
    all.push(Golden::new("", StopDrive { by: "a person at the laptop".into() }));
    all.push(Golden::new("", DriveStopped { stop: StopId(9) }));
    all.push(Golden::new("", EnableDrive { enable: true, stop: Some(StopId(9)) }));
    all.push(Golden::new("short", EnableDrive { enable: false, stop: None }));
    let powers = SetDrivePower { left: duty(0.25), right: duty(-1.0), hold: Some(Seconds(0.5)) };
    all.push(Golden::new("", powers));
    all.push(Golden::new("short", SetDrivePower { hold: None, ..powers }));
    let speeds =
        SetDriveSpeed { left: MetresPerSecond(0.3), right: MetresPerSecond(-0.1), hold: Some(Seconds(0.5)) };
    all.push(Golden::new("", speeds));
    all.push(Golden::new("short", SetDriveSpeed { hold: None, ..speeds }));
    operations(all);
    all.push(Golden::new("", OperationBegun { operation: TaskId(77) }));
    all.push(Golden::new("", ResetEncoders {}));
    all.push(Golden::new("", GetDrive {}));
    states(all);
    all.push(Golden::new("", MotorPower { boot: Boot(7), seq: 41, echo: Tick(123_456), power: duty(0.35) }));
    let reading = MotorReading {
        boot: Boot(7),
        stamp: Seconds(12.34),
        power: Some(duty(0.35)),
        distance: Some(Metres(-1.5)),
    };
    all.push(Golden::new("", reading));
    all.push(Golden::new("short", MotorReading { power: None, distance: None, ..reading }));
}

fn operations(all: &mut Vec<Golden>) {
    let request = DriveDistance {
        distance: Metres(1.5),
        power: duty(-0.4),
        stage: DriveStage::InitialRequest,
        operation: None,
        why: None,
    };
    all.push(Golden::new("", request.clone()));
    let operation = Some(TaskId(77));
    for (name, stage) in [("started", DriveStage::Started), ("completed", DriveStage::Completed)] {
        all.push(Golden::new(name, DriveDistance { stage, operation, ..request.clone() }));
    }
    let stage = DriveStage::Canceled;
    let why = Some(Refusal::Failed { why: "a wheel does not follow".into() });
    all.push(Golden::new("canceled", DriveDistance { stage, operation, why, ..request }));
    let request = RotateDegrees {
        degrees: -90.0,
        power: duty(0.3),
        stage: DriveStage::InitialRequest,
        operation: None,
        why: None,
    };
    all.push(Golden::new("", request.clone()));
    all.push(Golden::new("canceled", RotateDegrees { stage, operation, ..request }));
}

fn states(all: &mut Vec<Golden>) {
    let wheel = WheelState { power: duty(0.5), speed: MetresPerSecond(0.4), distance: Metres(1.25) };
    let state = DriveState {
        stamp: Seconds(12.34),
        enabled: true,
        stop: Some(StopId(9)),
        operation: DriveOperation::Distance,
        motion: Motion::Driving,
        cause: Some(BrakeCause::Silence),
        wheels: Sides::new(wheel, WheelState { distance: Metres(-0.25), ..wheel }),
        track: Metres(0.3),
        full_speed: MetresPerSecond(0.8),
    };
    for (name, operation) in [
        ("power", DriveOperation::Power),
        ("speed", DriveOperation::Speed),
        ("rotate", DriveOperation::Rotate),
    ] {
        all.push(Golden::new(name, DriveState { operation, ..state.clone() }));
    }
    let wheels = Sides::new(WheelState::default(), WheelState::default());
    let operation = DriveOperation::Idle;
    let motion = Motion::Standing;
    all.push(Golden::new(
        "idle",
        DriveState { enabled: false, stop: None, operation, motion, cause: None, wheels, ..state.clone() },
    ));
    all.push(Golden::new("", state));
}
