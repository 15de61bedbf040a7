//! One value and more of every message: what the golden files hold.

mod board;
mod calibration;
mod differential_drive;
mod fleet;
mod log;
mod navigator;
mod trace;

use super::golden::Golden;
use axle_schema::command::{
    AllStop, BrakeCause, Class, Command, Done, Enable, GateState, Lease, LeaseAsk, Motion, Reject, Release,
};
use axle_schema::meta::{Cause, Meta};
use axle_schema::presence::{Flow, Shown, Status, StatusAsk};
use axle_schema::task::{Accepted, Cancel, CorrectorProgress, GoAsk, Phase, PilotProgress};
use axle_schema::window::{Window, WindowAsk};
use axle_schema::{
    Boot, Drive, DriveAsk, Drivetrain, Duty, Dwm, EncodersData, EncodersSpan, Fix, Geometry, HeadingFix,
    InertialData, Leg, MapAsk, MapData, Metres, MetresPerSecond, MetresPerSecondSquared, NavigatorData,
    NavigatorSpan, Numbers, Plan, PlanAsk, PlanProgress, PlanStrategy, Pose, Radians, RadiansPerSecond,
    Refusal, Seconds, Sides, Signals, StopId, Task, TaskId, Tick, Twist, WayPoint, WayTask,
};
pub(super) use navigator::position;

/// Every example of every type.
pub(super) fn all() -> Vec<Golden> {
    let mut all = Vec::new();
    tasks(&mut all);
    plans(&mut all);
    correctors(&mut all);
    gate(&mut all);
    differential_drive::examples(&mut all);
    fleet::examples(&mut all);
    board::examples(&mut all);
    calibration::examples(&mut all);
    measurements(&mut all);
    trace::examples(&mut all);
    navigator::examples(&mut all);
    processes(&mut all);
    log::examples(&mut all);
    refusals(&mut all);
    all
}

pub(super) fn dwm() -> Dwm {
    Dwm::new(
        Sides::new(MetresPerSecond(0.0), MetresPerSecond(0.1)),
        Sides::new(MetresPerSecond(0.25), MetresPerSecond(-0.5)),
        Seconds(0.05),
    )
    .expect("finite numbers")
}

pub(super) fn command() -> Command {
    Command { boot: Boot(7), epoch: 3, seq: 41, echo: Tick(123_456), ttl_ms: 150, dwm: dwm() }
}

pub(super) fn way() -> WayTask {
    let full =
        WayPoint { heading: Some(Radians(1.5)), speed: Some(MetresPerSecond(0.3)), ..WayPoint::at(1.0, 0.1) };
    WayTask { points: vec![WayPoint::at(1.0, 0.0), full] }
}

pub(super) fn plan() -> Plan {
    let leg = |geometry, point, speed| Leg { geometry, point, speed };
    Plan {
        start: Pose::new(0.0, 0.0, 0.0),
        legs: vec![
            leg(Geometry::Line { length: Metres(1.0) }, 0, None),
            leg(Geometry::Turn { angle: Radians(-0.75) }, 1, None),
            leg(Geometry::Arc { radius: Metres(-0.5), angle: Radians(0.2) }, 1, Some(MetresPerSecond(0.3))),
        ],
        length: Metres(1.1),
        notes: vec!["way point 3 repeats way point 2".into()],
        ..Plan::default()
    }
}

pub(super) fn drive() -> Drive {
    Drive {
        dwms: vec![dwm(), Dwm::rest(Seconds(0.1))],
        counts: vec![2],
        jump: MetresPerSecond(0.5),
        offset: None,
        duration: Seconds(0.15),
    }
}

fn tasks(all: &mut Vec<Golden>) {
    all.push(Golden::new("", way()));
    all.push(Golden::new(
        "",
        GoAsk { way: way(), corrector: Some("d-corrector".into()), confirm: Vec::new() },
    ));
    all.push(Golden::new(
        "short",
        GoAsk { way: WayTask { points: vec![WayPoint::at(1.0, 0.0)] }, corrector: None, confirm: Vec::new() },
    ));
    all.push(Golden::new("", Accepted { task: TaskId(77) }));
    all.push(Golden::new("", Cancel { id: TaskId((1 << 53) - 1) }));
    let progress = PilotProgress {
        task: TaskId(77),
        phase: Phase::Running,
        corrector: "d-corrector".into(),
        reached: 1,
        points: 2,
        distance_left: Metres(0.4),
        fraction: 0.5,
        elapsed: Seconds(2.25),
        waiting: None,
    };
    all.push(Golden::new("", progress.clone()));
    let failed = Phase::Failed(Refusal::Unreachable { why: "a wall".into() });
    all.push(Golden::new("failed", PilotProgress { phase: failed, ..progress }));
}

fn maps(all: &mut Vec<Golden>) {
    let map = MapData {
        name: "warehouse".into(),
        resolution: Metres(0.05),
        origin: Pose::new(-1.0, -2.5, 0.25),
        width: 4,
        height: 2,
        content: (1 << 53) - 1,
        runs: vec![0, 5, 100, 2, 255, 1],
    };
    all.push(Golden::new(
        "whole",
        PlanAsk {
            way: way(),
            start: None,
            strategy: Some(PlanStrategy::Map),
            reorder: true,
            map: Some(map.clone()),
            robot: Some(Drivetrain::default()),
            body: Some(Metres(0.25)),
            deadline: Some(Seconds(1.5)),
            id: Some(TaskId(77)),
        },
    ));
    all.push(Golden::new(
        "whole",
        Plan {
            strategy: Some(PlanStrategy::TurnAndGo),
            time: Some(Seconds(4.5)),
            clearance: Some(Metres(0.125)),
            order: vec![1, 0],
            ..plan()
        },
    ));
    all.push(Golden::new("", MapAsk { have: Some(7) }));
    all.push(Golden::new("short", MapAsk { have: None }));
    all.push(Golden::new("", map.clone()));
    all.push(Golden::new("known", MapData { runs: vec![], ..map }));
    let elapsed = Seconds(0.75);
    all.push(Golden::new("", PlanProgress { id: TaskId(77), fraction: 0.5, elapsed }));
}

fn plans(all: &mut Vec<Golden>) {
    all.push(Golden::new(
        "",
        PlanAsk { way: way(), start: Some(Pose::new(0.5, -0.25, 3.0)), ..PlanAsk::default() },
    ));
    maps(all);
    all.push(Golden::new("", plan()));
    all.push(Golden::new("empty", Plan::default()));
    all.push(Golden::new(
        "",
        DriveAsk {
            legs: plan().legs,
            speeds: Some(Sides::new(MetresPerSecond(0.1), MetresPerSecond(0.2))),
            robot: Some(Drivetrain::default()),
            manner: None,
        },
    ));
    all.push(Golden::new("short", DriveAsk { legs: plan().legs, speeds: None, robot: None, manner: None }));
    all.push(Golden::new("", drive()));
    all.push(Golden::new("", dwm()));
}

fn correctors(all: &mut Vec<Golden>) {
    all.push(Golden::new("", Task { id: TaskId(1), plan: way() }));
    all.push(Golden::new("", Task { id: TaskId(2), plan: plan() }));
    all.push(Golden::new("", Task { id: TaskId(3), plan: drive() }));
    let progress = CorrectorProgress {
        task: TaskId(3),
        phase: Phase::Running,
        stamp: Seconds(12.5),
        elapsed: Seconds(0.75),
        fraction: 0.25,
        due: Some(Sides::new(Metres(0.25), Metres(0.5))),
        real: Some(Sides::new(Metres(0.24), Metres(0.51))),
    };
    all.push(Golden::new("", progress.clone()));
    for (name, phase) in [
        ("planning", Phase::Planning),
        ("done", Phase::Done),
        ("canceled", Phase::Canceled),
        ("replaced", Phase::Replaced),
        ("failed", Phase::Failed(Refusal::Busy { holder: "teleop@laptop/12".into() })),
    ] {
        all.push(Golden::new(name, CorrectorProgress { phase, due: None, real: None, ..progress.clone() }));
    }
}

fn gate(all: &mut Vec<Golden>) {
    for class in [Class::Background, Class::Corrector, Class::Manual, Class::StopOnly] {
        let holder = "d-corrector@workstation/1234".into();
        let variant =
            if class == Class::Corrector { String::new() } else { format!("{class:?}").to_lowercase() };
        all.push(Golden::new(&variant, LeaseAsk { holder, class, period: Seconds(0.05) }));
    }
    all.push(Golden::new(
        "",
        Lease { boot: Boot(7), epoch: 3, tick: Tick(123_400), silence_stop: Seconds(0.15) },
    ));
    all.push(Golden::new("", Release { boot: Boot(7), epoch: 3 }));
    all.push(Golden::new("", command()));
    all.push(Golden::new("", AllStop { id: StopId(9), by: "a person at the laptop".into() }));
    let enable = Enable {
        stop: Some(StopId(9)),
        boot: Boot(7),
        echo: Tick(123_456),
        by: "axle enable".into(),
        class: Class::Manual,
    };
    all.push(Golden::new("", enable.clone()));
    all.push(Golden::new("program", Enable { class: Class::Corrector, ..enable.clone() }));
    all.push(Golden::new("boot", Enable { stop: None, ..enable }));
    all.push(Golden::new("", Done {}));
    gate_states(all);
}

fn gate_states(all: &mut Vec<Golden>) {
    let rejects = [
        Reject::Oversize,
        Reject::Malformed,
        Reject::Limit,
        Reject::Boot,
        Reject::Fenced,
        Reject::Sequence,
        Reject::Stale,
        Reject::Future,
        Reject::Disabled,
        Reject::Flood,
    ];
    let state = GateState {
        boot: Boot(7),
        tick: Tick(u32::MAX),
        epoch: 3,
        holder: Some("d-corrector@workstation/1234".into()),
        enabled: true,
        stop: Some(StopId(9)),
        stored: false,
        motion: Motion::Driving,
        cause: Some(BrakeCause::Silence),
        wheels: Sides::new(MetresPerSecond(0.3), MetresPerSecond(0.31)),
        accepted: 100_000,
        rejected: rejects.into_iter().zip(1..).collect(),
    };
    all.push(Golden::new("", state.clone()));
    for (name, motion, cause) in [
        ("standing", Motion::Standing, None),
        ("expired", Motion::Braking, Some(BrakeCause::Expired)),
        ("released", Motion::Braking, Some(BrakeCause::Released)),
        ("preempted", Motion::Braking, Some(BrakeCause::Preempted)),
        ("all-stop", Motion::Braking, Some(BrakeCause::AllStop)),
        ("disabled", Motion::Braking, Some(BrakeCause::Disabled)),
    ] {
        let rejected = std::collections::BTreeMap::new();
        let stored = cause == Some(BrakeCause::AllStop);
        all.push(Golden::new(
            name,
            GateState { holder: None, stop: None, stored, motion, cause, rejected, ..state.clone() },
        ));
    }
}

fn measurements(all: &mut Vec<Golden>) {
    let encoders = EncodersData { stamp: Seconds(12.34), left: Metres(1.5), right: Metres(-0.001) };
    let inertial = InertialData {
        stamp: Seconds(12.34),
        gyro: RadiansPerSecond(-0.1),
        ax: Some(MetresPerSecondSquared(0.2)),
        ay: Some(MetresPerSecondSquared(0.0)),
    };
    let fix = Fix {
        stamp: Seconds(12.0),
        x: Metres(3.5),
        y: Metres(-2.0),
        covariance: Numbers([1e-4, 0.0, 0.0, 1e-4]),
        heading: Some(HeadingFix { angle: Radians(0.5), variance: 0.01 }),
    };
    all.push(Golden::new("", encoders));
    all.push(Golden::new(
        "",
        EncodersSpan { duration: Seconds(0.05), left: Metres(0.01), right: Metres(0.02) },
    ));
    all.push(Golden::new("", inertial));
    all.push(Golden::new("short", InertialData { ax: None, ay: None, ..inertial }));
    all.push(Golden::new("", fix));
    all.push(Golden::new("short", Fix { heading: None, ..fix }));
    let duty = |value| Duty::new(value).expect("within full power");
    all.push(Golden::new("", Signals { left: duty(-1.0), right: duty(0.35) }));
    all.push(Golden::new("", WindowAsk { since: Some(Seconds(2.0)) }));
    all.push(Golden::new("all", WindowAsk::default()));
    all.push(Golden::new(
        "",
        Window {
            boot: Boot(7),
            encoders: vec![encoders],
            inertial: vec![inertial],
            fixes: vec![fix],
            ranges: vec![navigator::range()],
            dropped: 2,
            position: Some(position()),
        },
    ));
    all.push(Golden::new("empty", Window { boot: Boot(7), ..Window::default() }));
    let pose = NavigatorData {
        stamp: Seconds(12.34),
        pose: Pose::new(1.0, -0.5, 7.0),
        twist: Some(Twist { v: MetresPerSecond(0.3), omega: RadiansPerSecond(-0.1) }),
        covariance: Some(Numbers([1e-4, 0.0, 1e-5, 0.0, 1e-4, 0.0, 1e-5, 0.0, 0.01])),
    };
    all.push(Golden::new("", pose));
    all.push(Golden::new("short", NavigatorData { twist: None, covariance: None, ..pose }));
    let (x, y) = (Metres(0.1), Metres(-0.01));
    all.push(Golden::new("", NavigatorSpan { duration: Seconds(0.5), x, y, heading: Radians(0.2) }));
}

fn processes(all: &mut Vec<Golden>) {
    let status = Status {
        service: "d-corrector".into(),
        robot: "r1".into(),
        host: "workstation".into(),
        pid: 1234,
        boot: Boot(11),
        version: "0.1.0".into(),
        uptime: Seconds(60.5),
        beats: 1210,
        late: 1,
        late_p99: Seconds(0.001),
        sent: 1210,
        received: 2400,
        refused: 2,
        says: vec!["a key".into()],
        hears: vec!["another key".into(), "a third key".into()],
        said: vec![],
        heard: vec![],
        wall: None,
        certificate: None,
    };
    let flow = Flow { key: "another key".into(), count: 12, refused: 1, why: Some("a reason".into()) };
    let flows = Status {
        said: vec![Flow { refused: 0, why: None, ..flow.clone() }],
        heard: vec![flow],
        wall: Some(Seconds(1.75e9)),
        certificate: Some(Shown { name: "d-corrector@r1".into(), expires: Seconds(1.8e9) }),
        ..status.clone()
    };
    all.push(Golden::new("flows", flows));
    all.push(Golden::new("", status.clone()));
    all.push(Golden::new("short", Status { says: vec![], hears: vec![], ..status }));
    all.push(Golden::new("", StatusAsk {}));
    let meta = Meta { seq: 5, source: Boot(11), stamp: 1.75e9, cause: None };
    all.push(Golden::new("", Meta { cause: Some(Cause { source: Boot(7), seq: 4 }), ..meta }));
    all.push(Golden::new("short", meta));
}

fn refusals(all: &mut Vec<Golden>) {
    let (what, why, got) = ("speed".to_owned(), "a reason".to_owned(), "2 m/s".to_owned());
    for (name, refusal) in [
        ("", Refusal::OutOfRange { what: what.clone(), got: got.clone(), limit: "0 to 1".into() }),
        ("malformed", Refusal::Malformed { what: what.clone(), why: why.clone() }),
        ("too-large", Refusal::TooLarge { what: what.clone(), got: 5000, limit: 4096 }),
        ("wrong-type", Refusal::WrongType { expected: "axle.Dwm.v1".into(), got: "axle.Pose.v1".into() }),
        ("missing", Refusal::Missing { what: what.clone(), hint: "give one".into() }),
        ("unknown", Refusal::Unknown { what: what.clone(), got, known: "d-corrector".into() }),
        ("unreachable", Refusal::Unreachable { why: why.clone() }),
        ("unavailable", Refusal::Unavailable { what: "pathfinder".into(), hint: "start it".into() }),
        ("timed-out", Refusal::TimedOut { what: "pathfinder".into(), seconds: 1.5 }),
        ("busy", Refusal::Busy { holder: "teleop@laptop/12".into() }),
        ("disabled", Refusal::Disabled { why: why.clone() }),
        ("fenced", Refusal::Fenced { why: why.clone() }),
        ("failed", Refusal::Failed { why: why.clone() }),
        ("internal", Refusal::Internal { why }),
    ] {
        all.push(Golden::new(name, refusal));
    }
}
