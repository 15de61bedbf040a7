//! Bytes from strangers over a real mesh: the process stays, counts them, and answers the next good question.

use crate::harness::{
    Meeting, PATIENCE, Process, Robot, Stranger, World, all_alive, eventually, r1, stands, within,
};
use axle_mesh::{Mesh, Retry};
use axle_schema::codec::{Message, encoding_of};
use axle_schema::command::{Command, Reject};
use axle_schema::task::{GoAsk, Task};
use axle_schema::{Boot, Drive, Dwm, Plan, PlanAsk, Refusal, Seconds, TaskId, Tick, WayTask, encode, key};

/// Bytes that are no message of any kind, each with what a refusal says of them.
fn hostile(fine: &[u8], limit: usize) -> Vec<(Vec<u8>, &'static str)> {
    vec![
        (Vec::new(), "malformed"),
        (fine[..fine.len() - 1].to_vec(), "end too early"),
        ([fine, &[0]].concat(), "follow the message"),
        (vec![0x81; 60], "malformed"),
        ([&b"\xa1\x61?"[..], &[0x81; 60]].concat(), "malformed"),
        (vec![0xa1; 60], "malformed"),
        (vec![0xff; 60], "malformed"),
        // Lists and texts that say they are longer than all memory.
        ([&[0x9b], &u64::MAX.to_be_bytes()[..]].concat(), "malformed"),
        ([&[0x7b], &u64::MAX.to_be_bytes()[..]].concat(), "malformed"),
        (vec![0; limit + 1], "too large"),
        (vec![0x80; limit.max(1_000_000) + 1], "too large"),
    ]
}

/// The refusals that a process counts.
///
/// A link that megabytes go through may be cut for a moment on a busy machine, since its lease is short: whoever is not
/// seen at once is looked for again.
async fn refused(mesh: &Mesh, service: &str) -> u64 {
    let seen = async {
        loop {
            let everybody = mesh.everybody(PATIENCE).await.expect("an answer");
            let mut statuses = everybody.into_iter().filter_map(|(_, status)| status);
            if let Some(status) = statuses.find(|status| status.service == service) {
                return status.refused;
            }
        }
    };
    within(PATIENCE, &format!("{service} says how it is"), seen).await
}

/// Asks the same bytes in every wrong way; how many questions that were.
async fn asks_badly<Q: Message>(stranger: &Stranger, key: &str, fine: &[u8]) -> u64 {
    stranger.is_refused(key, "", None, &["is missing", Q::NAME]).await;
    let other = encoding_of::<Dwm>();
    stranger.is_refused(key, &other, Some(fine.to_vec()), &["wrong type", "axle.Dwm.v1"]).await;
    let mut asked = 2;
    for (bytes, words) in hostile(fine, Q::LIMIT) {
        stranger.is_refused(key, "", Some(bytes), &[words]).await;
        asked += 1;
    }
    asked
}

/// Says the same bytes in every wrong way; how many samples that were.
fn says_badly<M: Message>(stranger: &Stranger, key: &str, fine: &[u8]) -> u64 {
    stranger.say(key, &encoding_of::<axle_schema::Fix>(), fine);
    let hostile = hostile(fine, M::LIMIT);
    let said = hostile.len() as u64 + 1;
    for (bytes, _) in hostile {
        stranger.say(key, "", bytes);
    }
    said
}

#[tokio::test(flavor = "multi_thread")]
async fn pathfinder_answers_hostile_questions_with_refusals() {
    let world = World::new().await;
    let _router = world.router();
    let mut pathfinder: Process = world.run("pathfinder");
    let mesh = world.join().await;
    all_alive(&mesh, &["pathfinder"]).await;
    let stranger = Stranger::join(&world.endpoint).await;
    let key = "axle/r1/pathfinder/plan";
    let ask = PlanAsk { way: WayTask::parse("1,0").expect("a way"), ..PlanAsk::default() };
    let mut asked = asks_badly::<PlanAsk>(&stranger, key, &encode(&ask).expect("a question")).await;

    // A million points of seven bytes each, well formed; then a few too many; then one that is nowhere.
    let points = |count: u32, point: &[u8]| {
        let list = [&[0x9a], &count.to_be_bytes()[..]].concat();
        [b"\xa1\x63way\xa1\x66points", &list[..], &point.repeat(count as usize)].concat()
    };
    let origin = b"\xa2\x61x\x00\x61y\x00";
    let nowhere = [b"\xa2\x61x\xfb", &f64::NAN.to_be_bytes()[..], b"\x61y\x00"].concat();
    let far = [b"\xa2\x61x\xfb", &1e9_f64.to_be_bytes()[..], b"\x61y\x00"].concat();
    for (bytes, words) in [
        ([&b"\xa1\x61?"[..], &[0x81; 100_000]].concat(), &["nested deeper"][..]),
        (points(1_000_000, origin), &["PlanAsk in bytes is too large", "1310720"]),
        (points(5000, origin), &["way points is too large: 5000, at most 4096"]),
        (points(1, &nowhere), &["points[0].x", "NaN is not a finite number"]),
        (points(1, &far), &["x of way point 1 is out of range"]),
        (points(0, origin), &["at least one point"]),
    ] {
        stranger.is_refused(key, "", Some(bytes), words).await;
        asked += 1;
    }
    let plan: Result<Plan, Refusal> = mesh.ask(&key::PLAN, Some(&r1()), &ask, PATIENCE, Retry::Never).await;
    assert_eq!(plan.expect("a good question is answered").legs.len(), 1);
    assert_eq!(refused(&mesh, "pathfinder").await, asked, "each is counted, and nothing else");
    assert!(pathfinder.is_running() && !pathfinder.err().contains("panicked"), "{}", pathfinder.err());
}

fn command(boot: Boot, epoch: u32, seq: u32) -> Command {
    let dwm = Dwm::rest(Seconds(0.05));
    Command { boot, epoch, seq, echo: Tick(0), ttl_ms: 150, dwm }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_gate_obeys_no_stranger_and_counts_each() {
    let robot = Robot::new().await;
    let eyes = robot.eyes().await;
    let stranger = Stranger::join(&robot.world.endpoint).await;
    let key = "axle/r1/gate/command";
    let boot = eyes.hears("the gate's account", |_| true).await.boot;
    let fine = encode(&command(boot, 0, 1)).expect("a command");
    let said = says_badly::<Command>(&stranger, key, &fine);
    // Well formed, and yet nobody's: of long ago, of another boot, of a lease that never was.
    for (boot, epoch) in [(boot, 0), (Boot(boot.0 ^ 1), 0), (boot, 7)] {
        stranger.say(key, "", encode(&command(boot, epoch, 1)).expect("a command"));
    }
    let state = eyes
        .hears("the gate has counted all", |state| {
            let count = |reject| state.rejected.get(&reject).copied().unwrap_or_default();
            [Reject::Stale, Reject::Boot, Reject::Fenced].into_iter().all(|reject| count(reject) >= 1)
        })
        .await;
    assert_eq!(state.accepted, 0, "{state:?}");
    let count = |reject| state.rejected.get(&reject).copied().unwrap_or_default();
    assert_eq!((count(Reject::Oversize), count(Reject::Malformed)), (2, said - 2), "{state:?}");
    assert_eq!(state.rejected.values().sum::<u64>(), said + 3, "each has one reason: {state:?}");
    assert_eq!(refused(&robot.mesh, "emulator").await, said + 3, "the process counts what its gate counts");
    assert!(eyes.truths().iter().all(stands), "no wheel moves");
    robot.reaches("0.2,0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_that_cannot_be_read_stops_all_the_same() {
    let robot = Robot::new().await;
    let eyes = robot.eyes().await;
    let stranger = Stranger::join(&robot.world.endpoint).await;
    let mut go = eyes.under_way(|| robot.go("4,0")).await;
    stranger.say("axle/r1/gate/stop", "text/plain", b"stop!".to_vec());
    let state = eyes.hears("the drive is disabled", |state| !state.enabled).await;
    assert_eq!(
        (state.stop, &state.holder),
        (None, &None),
        "it has no name that an enable could quote: {state:?}"
    );
    eyes.sees_rest().await;
    go.ended().await.is(1, &["the drive is disabled", "axle enable"]);
    robot.world.done(&["enable"]).await.is(0, &["r1 may move"]);
    robot.reaches("0,0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn leases_and_enables_of_strangers_are_refused_by_name() {
    let robot = Robot::new().await;
    let stranger = Stranger::join(&robot.world.endpoint).await;
    let mut asked = 0;
    for (name, fine) in [
        ("lease", &b"\xa3\x66holder\x61x\x65class\x66manual\x66period\x00"[..]),
        ("release", b"\xa2\x64boot\x01\x65epoch\x01"),
        ("enable", b"\xa3\x64boot\x01\x64echo\x01\x62by\x61x"),
    ] {
        let key = format!("axle/r1/gate/{name}");
        asked += match name {
            "lease" => asks_badly::<axle_schema::command::LeaseAsk>(&stranger, &key, fine).await,
            "release" => asks_badly::<axle_schema::command::Release>(&stranger, &key, fine).await,
            _ => asks_badly::<axle_schema::command::Enable>(&stranger, &key, fine).await,
        };
        stranger.is_refused(&key, "", Some(fine.to_vec()), &[]).await;
        asked += 1;
    }
    assert_eq!(refused(&robot.mesh, "emulator").await, asked);
    robot.reaches("0.2,0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn pilot_and_corrector_refuse_hostile_tasks_and_drive_the_next_good_one() {
    let robot = Robot::new().await;
    let stranger = Stranger::join(&robot.world.endpoint).await;
    let ask = GoAsk { way: WayTask::parse("0.2,0").expect("a way"), corrector: None, confirm: Vec::new() };
    let fine = encode(&ask).expect("a question");
    let asked = asks_badly::<GoAsk>(&stranger, "axle/r1/pilot/go", &fine).await;
    let parrot = encode(&GoAsk { corrector: Some("parrot".into()), ..ask.clone() }).expect("a question");
    let words = ["unknown corrector \"parrot\"", "known: d-corrector"];
    stranger.is_refused("axle/r1/pilot/go", "", Some(parrot), &words).await;
    assert_eq!(refused(&robot.mesh, "pilot").await, asked + 1);
    robot.world.done(&["go", "1,0", "--corrector", "parrot"]).await.is(1, &words);

    let task = encode(&Task { id: TaskId(1), plan: Drive::default() }).expect("a task");
    // The corrector takes the newest task at each of its beats: one at a time, each of them is looked at.
    let key = "axle/r1/d-corrector/task";
    let mut counted = 0;
    stranger.say(key, &encoding_of::<Dwm>(), task.clone());
    for (bytes, _) in hostile(&task, Task::<Drive>::LIMIT) {
        counted += 1;
        counts(&robot.mesh, counted).await;
        stranger.say(key, "", bytes);
    }
    counts(&robot.mesh, counted + 1).await;

    robot.reaches("0.2,0").await;
    for (name, service) in &robot.services {
        assert!(!service.err().contains("panicked"), "{name}: {}", service.err());
    }
}

/// Waits until the corrector has refused so many.
async fn counts(mesh: &Mesh, refusals: u64) {
    let counting = async { while refused(mesh, "d-corrector").await < refusals {} };
    within(PATIENCE, &format!("the corrector counts {refusals} refusals"), counting).await;
    assert_eq!(refused(mesh, "d-corrector").await, refusals);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flood_of_questions_is_bounded_and_the_next_one_is_answered() {
    let meeting = Meeting::new().await;
    let mesh = meeting.join("test").await;
    let other = meeting.join("pathfinder").await;
    let server = other.server::<PlanAsk, Plan>(&key::PLAN.of_every_robot()).expect("a server");
    let visible = other.become_visible().expect("visible");
    all_alive(&mesh, &["pathfinder"]).await;
    let ask = PlanAsk { way: WayTask::parse("1,0").expect("a way"), ..PlanAsk::default() };
    // Nobody answers yet: so many may wait, and whoever comes after them is told at once that nobody is free.
    let asking: Vec<_> = (0..400)
        .map(|_| {
            let (mesh, ask) = (mesh.clone(), ask.clone());
            tokio::spawn(async move { mesh.ask(&key::PLAN, Some(&r1()), &ask, PATIENCE, Retry::Never).await })
        })
        .collect();
    let turned_away = || asking.iter().filter(|one| one.is_finished()).count();
    eventually("144 of 400 are turned away", || (turned_away() == 144).then_some(())).await;
    for _ in 0..256 {
        within(PATIENCE, "a question waits", server.next()).await.reply(Ok(Plan::default()));
    }
    let mut answers = 0;
    for one in asking {
        match one.await.expect("an answer") {
            Ok(_) => answers += 1,
            Err(refusal) => assert!(matches!(refusal, Refusal::Unavailable { .. }), "{refusal}"),
        }
    }
    assert_eq!(answers, 256);
    drop(visible);
}
