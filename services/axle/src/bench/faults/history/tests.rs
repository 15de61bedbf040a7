//! The judge must notice: each law is shown a history that breaks it.

use super::*;
use axle_schema::command::Motion;
use axle_schema::{Dwm, Metres, MetresPerSecond, Pose, RadiansPerSecond, Refusal, Seconds, Sides, Twist};

const ROBOT: Boot = Boot(1);
const DRIVER: Boot = Boot(2);

fn event(at: f64, what: What) -> Event {
    Event { at, what }
}
fn meta(source: Boot, seq: u64, stamp: f64, cause: Option<Cause>) -> Meta {
    Meta { seq, source, stamp, cause }
}
fn state(epoch: u32, holder: &str) -> What {
    What::State(Box::new(GateState {
        boot: ROBOT,
        tick: Tick(0),
        epoch,
        holder: Some(holder.into()),
        enabled: true,
        stop: None,
        stored: false,
        motion: Motion::Driving,
        cause: None,
        wheels: Sides::default(),
        accepted: 0,
        rejected: BTreeMap::new(),
    }))
}
/// A command that echoes the robot's clock at `echo` s.
fn command(source: Boot, sample: u64, (epoch, seq): (u32, u32), echo: f64) -> What {
    let command = Command {
        boot: ROBOT,
        epoch,
        seq,
        echo: Tick::of(Seconds(echo)),
        ttl_ms: 150,
        dwm: Dwm::rest(Seconds(0.05)),
    };
    What::Command { command, meta: Some(meta(source, sample, echo, None)) }
}
/// A reading of wheels that obey this sample, at `stamp` s of the robot's clock.
fn reading(source: Boot, sample: u64, stamp: f64) -> What {
    let data = EncodersData { stamp: Seconds(stamp), left: Metres(0.0), right: Metres(0.0) };
    let cause = Some(Cause { source, seq: sample });
    What::Reading { data, meta: Some(meta(ROBOT, 0, stamp, cause)) }
}
fn pilot(task: u64, phase: Phase) -> What {
    What::Pilot(Box::new(PilotProgress {
        task: TaskId::from_random(task << 11),
        phase,
        corrector: "d-corrector".into(),
        reached: 0,
        points: 1,
        distance_left: Metres(0.0),
        fraction: 0.0,
        elapsed: Seconds(0.0),
        waiting: None,
    }))
}
fn truth(at: f64, speed: f64) -> Event {
    let twist = Twist { v: MetresPerSecond(speed), omega: RadiansPerSecond(0.0) };
    let data = NavigatorData {
        stamp: Seconds(at),
        pose: Pose::default(),
        twist: Some(twist),
        ..NavigatorData::default()
    };
    event(at, What::Truth(data))
}

/// A drive without a fault.
fn good() -> Vec<Event> {
    vec![
        event(0.0, state(1, "d-corrector@a/1")),
        event(0.1, command(DRIVER, 0, (1, 1), 0.08)),
        event(0.12, reading(DRIVER, 0, 0.12)),
        event(0.15, command(DRIVER, 1, (1, 2), 0.13)),
        event(0.17, reading(DRIVER, 1, 0.17)),
        event(0.18, pilot(1, Phase::Running)),
        event(0.20, pilot(1, Phase::Done)),
        event(0.30, pilot(1, Phase::Done)),
    ]
}

#[test]
fn a_drive_without_a_fault_is_right_and_its_commands_have_ages_and_delays() {
    let verdict = judge(&good());
    assert_eq!(verdict.violations, Vec::<String>::new());
    assert_eq!((verdict.ages, verdict.delays.len()), (vec![40.0, 40.0], 2));
    assert_eq!(end_of(&good()), Some(Phase::Done));
}

#[test]
fn how_old_a_command_was_is_not_known_where_readings_are_missing() {
    let late = |number| {
        let mut events = good();
        events.push(event(0.4, command(DRIVER, 2, (1, 3), 0.39)));
        let What::Reading { data, meta: Some(meta) } = reading(DRIVER, 2, 3.0) else {
            unreachable!("a reading")
        };
        events.push(event(3.0, What::Reading { data, meta: Some(Meta { seq: number, ..meta }) }));
        judge(&events)
    };
    assert_eq!(late(1).violations.len(), 1, "the reading before named another command");
    let missed = late(40);
    assert_eq!((missed.violations.len(), missed.ages.len()), (0, 2));
}

#[test]
fn a_frozen_robot_may_have_obeyed_before_it_froze_but_not_what_came_later() {
    let thawed = |said: f64| {
        let mut events = good();
        // The last reading, then a command, and a reading when it has thawed.
        events.push(event(0.4, reading(DRIVER, 1, 0.4)));
        events.push(event(0.4 + said, command(DRIVER, 2, (1, 3), 0.39)));
        events.push(event(2.5, reading(DRIVER, 2, 2.5)));
        judge(&events)
    };
    let before = thawed(0.02);
    assert_eq!((before.violations.len(), before.ages.len()), (0, 2), "{:?}", before.violations);
    let after = thawed(0.2);
    assert!(after.violations.len() == 1 && after.violations[0].contains("ms old"), "{:?}", after.violations);
}

#[test]
fn every_law_is_broken_by_its_own_history_and_by_nothing_else() {
    let broken = |what: Vec<What>, words: &str| {
        let mut events = good();
        events.extend(what.into_iter().map(|what| event(0.4, what)));
        let found = judge(&events).violations;
        assert!(found.len() == 1 && found[0].contains(words), "{words}: {found:?}");
    };
    broken(vec![state(1, "d-corrector@b/9")], "two holders of grant 1: d-corrector@a/1 and d-corrector@b/9");
    let obeyed = |said: What, stamp| match &said {
        What::Command { meta: Some(meta), .. } => {
            let (source, seq) = (meta.source, meta.seq);
            vec![said, reading(source, seq, stamp)]
        }
        _ => unreachable!("a command"),
    };
    broken(obeyed(command(DRIVER, 2, (1, 3), 0.1), 0.4), "it was 300 ms old");
    broken(obeyed(command(Boot(3), 0, (1, 3), 0.39), 0.4), "another process had driven by this grant");
    broken(obeyed(command(DRIVER, 7, (1, 2), 0.39), 0.4), "after command 2 of grant 1");
    broken(vec![reading(DRIVER, 0, 0.2)], "after command 2 of grant 1");
    broken(vec![pilot(1, Phase::Running)], "after it had ended: Done");
    let failed = Phase::Failed(Refusal::Failed { why: "late".into() });
    broken(vec![pilot(1, failed)], "after it had ended: Done");
    let mut other = command(DRIVER, 2, (2, 1), 0.39);
    if let What::Command { command, .. } = &mut other {
        command.boot = Boot(9);
    }
    broken(obeyed(other, 0.4), "an earlier run of the robot");
}

#[test]
fn what_is_allowed_is_no_violation() {
    let mut events = good();
    let allowed = [
        state(2, "drive@a/3"),
        command(Boot(3), 0, (2, 1), 0.39),
        reading(Boot(3), 0, 0.4),
        // A command that was not heard, and one that was not obeyed however old it is.
        reading(Boot(3), 9, 0.42),
        command(DRIVER, 3, (1, 4), 0.0),
        pilot(2, Phase::Planning),
        pilot(2, Phase::Canceled),
    ];
    events.extend(allowed.into_iter().map(|what| event(0.4, what)));
    assert_eq!(judge(&events).violations, Vec::<String>::new());
}

#[test]
fn braking_is_found_from_what_the_wheels_did() {
    // Driven at 0.6 m/s, the fault at 1 s, braked with 2 m/s² from 1.12 s on.
    let drive: Vec<_> = (0..400)
        .map(|step| {
            let at = 0.8 + f64::from(step) * 0.005;
            truth(at, (0.6 - 2.0 * (at - 1.12).max(0.0)).clamp(0.0, 0.6))
        })
        .collect();
    let found = brake(&drive, 1.0).expect("it brakes");
    assert!((found - 120.0).abs() < 5.0, "{found}");
    assert!(stands(&drive) && !stands(&drive[..40]));
    assert_eq!(brake(&drive[..60], 1.0), None, "no rest, no brake");
}
