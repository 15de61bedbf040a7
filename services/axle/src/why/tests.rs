//! A chain of a few samples is told from its end to its beginning.

use super::*;
use crate::replay::Item;
use axle_schema::codec::encoding_of;
use axle_schema::command::Command;
use axle_schema::meta::{Cause, Meta};
use axle_schema::task::{CorrectorProgress, Phase, PilotProgress};
use axle_schema::traffic::{Mover, TrafficState, Wait};
use axle_schema::{
    Boot, Drive, Dwm, EncodersData, Message, Metres, MetresPerSecond, RobotId, Sides, Task, TaskId, Tick,
    encode,
};

fn say<M: Message>(log: &mut Log, port: &str, at: u64, seq: u64, cause: Option<u64>, message: &M) {
    let cause = cause.map(|seq| Cause { source: Boot(7), seq });
    let item = Item {
        encoding: encoding_of::<M>().into(),
        meta: Some(Meta { seq, source: Boot(7), stamp: 0.0, cause }),
        payload: encode(message).expect("bytes"),
        received: at * 1_000_000,
    };
    log.push(port, item);
}

fn speeds(left: f64, right: f64) -> Sides<MetresPerSecond> {
    Sides::new(MetresPerSecond(left), MetresPerSecond(right))
}

fn log() -> Log {
    let mut log = Log::of("r1");
    let dwm = Dwm::new(speeds(0.1, 0.2), speeds(0.1, 0.2), Seconds(1.0)).expect("finite");
    let plan = Drive { dwms: vec![dwm; 3], counts: vec![1, 2], duration: Seconds(3.0), ..Drive::default() };
    say(&mut log, "d-corrector/task", 1000, 1, None, &Task { id: TaskId(5), plan });
    let progress = CorrectorProgress {
        task: TaskId(5),
        phase: Phase::Running,
        stamp: Seconds(12.2),
        elapsed: Seconds(1.25),
        fraction: 0.4,
        due: Some(Sides::new(Metres(0.5), Metres(0.5))),
        real: Some(Sides::new(Metres(0.45), Metres(0.5))),
    };
    say(&mut log, "d-corrector/progress", 1300, 2, None, &progress);
    let command = Command { boot: Boot(1), epoch: 3, seq: 9, echo: Tick(12_200), ttl_ms: 150, dwm };
    say(&mut log, "gate/command", 1301, 3, Some(2), &command);
    for (at, stamp, seq) in [(1310, 12.3, 4), (1320, 12.4, 5)] {
        let data = EncodersData { stamp: Seconds(stamp), left: Metres(1.0), right: Metres(2.0) };
        say(&mut log, "robot/encoders", at, seq, Some(3), &data);
    }
    log
}

fn facts(explanation: &Explanation) -> String {
    let links = explanation.links.iter();
    let lines = links.map(|link| format!("{} {} {:?}", link.stream, link.what, link.facts));
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn the_chain_goes_from_the_order_to_the_wheels() {
    let explained = explain(&log(), Some(Seconds(12.3)));
    let [explanation] = &explained[..] else { panic!("one explanation, not {explained:?}") };
    assert_eq!(explanation.about, "r1 at 12.300 s of its own clock");
    let streams: Vec<_> = explanation.links.iter().map(|link| link.stream.as_str()).collect();
    assert_eq!(streams, ["d-corrector/task", "d-corrector/progress", "gate/command", "robot/encoders"]);
    let text = facts(explanation);
    for words in
        ["movement 2 of 3, 0.250 s into it", "left 0.0500 m, right 0.0000 m", "100.0 ms before", "40.0 %"]
    {
        assert!(text.contains(words), "{words:?} is missing in {text}");
    }
    let before: Vec<_> = explanation.links.iter().filter_map(|link| link.before).collect();
    assert_eq!(before, [0.31, 0.01, 0.009, 0.0]);
}

#[test]
fn a_time_before_the_recording_has_no_explanation_and_a_gap_is_said() {
    assert_eq!(explain(&log(), Some(Seconds(1.0))), []);
    let mut log = Log::of("r1");
    let data = EncodersData { stamp: Seconds(1.0), left: Metres(0.0), right: Metres(0.0) };
    say(&mut log, "robot/encoders", 5, 4, Some(3), &data);
    let text = facts(&explain(&log, None)[0]);
    assert!(text.contains("a command that was not recorded"), "{text}");
}

fn progress(waiting: Option<&str>) -> PilotProgress {
    PilotProgress {
        task: TaskId(5),
        phase: Phase::Running,
        corrector: "d-corrector".into(),
        reached: 1,
        points: 3,
        distance_left: Metres(2.0),
        fraction: 0.3,
        elapsed: Seconds(9.0),
        waiting: waiting.map(str::to_owned),
    }
}

fn mover(name: &str, waits: &[(&str, &str)]) -> Mover {
    let robot = |name: &str| RobotId::new(name).expect("a name");
    let waits = waits.iter().map(|(name, why)| Wait { robot: robot(name), why: (*why).into() });
    Mover {
        robot: robot(name),
        task: TaskId(5),
        place: axle_schema::Pose::new(1.0, -0.0, 0.0),
        passed: 3,
        until: if name == "r3" { 7 } else { 3 },
        pieces: 12,
        turn: Some(1),
        waits: waits.collect(),
    }
}

#[test]
fn a_robot_that_waits_is_explained_by_whom_it_waits_for_to_the_end_of_the_chain() {
    let held = "it holds the way at (2.0, 0.0)";
    let mut log = Log::of("r2");
    say(&mut log, "pilot/progress", 900, 1, None, &progress(None));
    assert_eq!(explain(&log, None), [], "a robot that drives waits for nobody");
    say(&mut log, "pilot/progress", 1000, 2, None, &progress(Some(&format!("for r1: {held}"))));
    let alone = explain(&log, None);
    assert_eq!(alone[0].links.len(), 1, "{alone:?}");
    assert!(facts(&alone[0]).contains("r2 waits for r1: it holds"), "{}", facts(&alone[0]));
    let robots = vec![mover("r3", &[]), mover("r1", &[("r3", held)]), mover("r2", &[("r1", held)])];
    log.traffic = Some(TrafficState { robots });
    let explained = explain(&log, None);
    let words: Vec<_> = explained[0].links.iter().map(|link| link.what.as_str()).collect();
    let expected = [
        "r3 drives: 3 of 12 pieces are behind it".to_owned(),
        format!("r1 waits for r3: {held}"),
        format!("r2 waits for r1: {held}"),
    ];
    assert_eq!(words, expected);
    let text = facts(&explained[0]);
    assert!(text.contains("r3, r1, r2") && text.contains("1 of 3 reached"), "{text}");
    // A person is no robot, whatever Traffic says.
    let person = "for a person at a loading point: axle confirm --robot r2";
    say(&mut log, "pilot/progress", 1100, 3, None, &progress(Some(person)));
    let text = facts(&explain(&log, None)[0]);
    assert!(text.contains(&format!("r2 waits {person}")), "{text}");
    let done = PilotProgress { phase: Phase::Done, ..progress(None) };
    say(&mut log, "pilot/progress", 1200, 4, None, &done);
    assert_eq!(explain(&log, None), []);
}
