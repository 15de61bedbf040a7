//! A holder of the lease that sends what it should not, among what it should (fault matrix, rows 22 to 27).

use crate::harness::{Eyes, PATIENCE, Process, Stranger, World, all_alive, declared, eventually, r1, stands};
use axle_mesh::{Mesh, Retry};
use axle_schema::command::{
    BrakeCause, Class, Command, Done, Enable, GateState, Lease, LeaseAsk, Motion, Reject,
};
use axle_schema::{Dwm, MetresPerSecond, Refusal, Seconds, Sides, Tick, encode, key};
use std::collections::BTreeMap;

const KEY: &str = "axle/r1/gate/command";

/// An emulated robot behind its gate, and the test as the holder of its lease.
struct Held {
    mesh: Mesh,
    eyes: Eyes,
    stranger: Stranger,
    lease: Lease,
    seq: u32,
    _processes: [Process; 2],
    world: World,
}

impl Held {
    async fn new() -> Self {
        let world = World::new().await;
        let processes = [world.router(), world.run("emulator")];
        let mesh = world.join().await;
        all_alive(&mesh, &["emulator"]).await;
        let eyes = Eyes::of(&mesh).await;
        let stranger = Stranger::join(&world.endpoint).await;
        let lease = lease(&mesh, Class::Corrector).await.expect("a lease");
        Self { mesh, eyes, stranger, lease, seq: 0, _processes: processes, world }
    }
    /// The next command, by what the robot says now: straight on from `v0` to `v1`, for a while that is long enough.
    async fn next(&mut self, v0: f64, v1: f64) -> Command {
        self.seq += 1;
        while self.eyes.encoders.take().is_some() {}
        let echo = Tick::of(self.eyes.encoders.next().await.message.stamp);
        let both = |v| Sides::new(MetresPerSecond(v), MetresPerSecond(v));
        let dwm = Dwm::new(both(v0), both(v1), Seconds(0.5)).expect("a movement");
        let Lease { boot, epoch, .. } = self.lease;
        Command { boot, epoch, seq: self.seq, echo, ttl_ms: 500, dwm }
    }
    fn say(&self, command: &Command) {
        self.stranger.say(KEY, "", encode(command).expect("a command"));
    }
    /// Waits until the gate has refused so many, and says what for.
    async fn refused(&self, count: u64) -> GateState {
        let what = format!("the gate has refused {count}");
        self.eyes.hears(&what, |state| state.rejected.values().sum::<u64>() >= count).await
    }
    /// Takes the wheels again after a silence.
    async fn again(&mut self) {
        self.eyes.hears("the wheels are free", |state| state.holder.is_none()).await;
        self.lease = lease(&self.mesh, Class::Corrector).await.expect("a lease");
        self.seq = 0;
    }
}

async fn lease(mesh: &Mesh, class: Class) -> Result<Lease, Refusal> {
    let ask = LeaseAsk { holder: mesh.name(), class, period: Seconds(0.2) };
    mesh.ask(&key::LEASE, Some(&r1()), &ask, PATIENCE, Retry::Idempotent).await
}

/// CBOR in which the 64-bit float `old` is replaced by `new`.
fn patched(bytes: &[u8], old: f64, new: f64) -> Vec<u8> {
    let old = old.to_be_bytes();
    let at = bytes.windows(8).position(|window| window == old).expect("the number is there");
    let mut bytes = bytes.to_vec();
    bytes[at..at + 8].copy_from_slice(&new.to_be_bytes());
    bytes
}

#[tokio::test(flavor = "multi_thread")]
async fn of_a_holder_each_wrong_command_is_refused_by_its_reason_and_moves_nothing() {
    let mut held = Held::new().await;
    let mut expected = BTreeMap::new();
    let mut count = 0;
    // 1/3 is written with all its digits: the place to put other numbers.
    let fine = held.next(0.0, 1.0 / 3.0).await;
    let bytes = encode(&fine).expect("a command");
    for speed in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300] {
        held.stranger.say(KEY, "", patched(&bytes, 1.0 / 3.0, speed));
        *expected.entry(Reject::Limit).or_insert(0) += 1;
    }
    for duration in [0.0, -1.0, f64::NAN] {
        let odd = Command { dwm: Dwm::rest(Seconds(0.123_456_789)), ..fine };
        held.stranger.say(KEY, "", patched(&encode(&odd).expect("a command"), 0.123_456_789, duration));
        *expected.entry(Reject::Limit).or_insert(0) += 1;
    }
    held.say(&Command { echo: Tick(fine.echo.0.wrapping_add(5000)), ..fine });
    held.say(&Command { echo: Tick(fine.echo.0.wrapping_sub(5000)), ..fine });
    held.say(&Command { epoch: fine.epoch + 1, ..fine });
    for reject in [Reject::Future, Reject::Stale, Reject::Fenced] {
        expected.insert(reject, 1);
    }
    count += expected.values().sum::<u64>();
    let state = held.refused(count).await;
    assert_eq!((state.accepted, state.rejected, state.motion), (0, expected, Motion::Standing));
    assert!(held.eyes.truths().iter().all(stands), "nothing moves");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_command_that_is_said_again_is_obeyed_once() {
    let mut held = Held::new().await;
    let command = held.next(0.0, 0.3).await;
    held.say(&command);
    held.eyes.sees("the robot drives", |truth| !stands(truth)).await;
    for _ in 0..5 {
        held.say(&command);
    }
    let state = held.refused(5).await;
    assert_eq!(state.accepted, 1, "{state:?}");
    held.eyes.sees_rest().await;
    // Long after, with a new lease: what was recorded moves nothing.
    held.again().await;
    held.say(&command);
    let state = held.refused(6).await;
    assert_eq!((state.accepted, state.motion), (1, Motion::Standing), "{state:?}");
    assert_eq!(state.rejected.get(&Reject::Fenced), Some(&1), "{state:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flood_of_garbage_holds_up_neither_the_gate_nor_who_holds_it() {
    let mut held = Held::new().await;
    let flood = Stranger::join(&held.world.endpoint).await;
    let flooding = tokio::task::spawn_blocking(move || {
        for _ in 0..10_000 {
            flood.say(KEY, "", &b"garbage"[..]);
        }
    });
    let mut said = 0;
    while !flooding.is_finished() {
        let command = held.next(0.05, 0.05).await;
        held.say(&command);
        said += 1;
    }
    flooding.await.expect("the flood");
    let state = held.refused(10_000).await;
    let count = |reject| state.rejected.get(&reject).copied().unwrap_or_default();
    // Of the commands some may be among those that are too many for a beat.
    let refused = count(Reject::Malformed) + count(Reject::Flood);
    assert!((10_000..=10_000 + said).contains(&refused), "{said} were said in the flood: {state:?}");
    assert!(state.accepted >= 1 && said >= 1, "{said} were said in the flood: {state:?}");
    // The gate beats on: its next account is a fresh one, and a stop is obeyed.
    held.world.done(&["stop"]).await.is(0, &["r1 is stopped"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_log_that_nobody_reads_does_not_hold_up_the_gate() {
    let world = World::new().await;
    let _router = world.router();
    let args = ["run", "emulator", "--host", "lab", "--log", "debug", "--connect", &world.endpoint];
    let (_emulator, _held) = Process::unread(&args, world.path());
    let mesh = world.join().await;
    all_alive(&mesh, &["emulator"]).await;
    let eyes = Eyes::of(&mesh).await;
    // Each of them is a line of the log; all together are more than the pipe takes.
    let stranger = Stranger::join(&world.endpoint).await;
    for _ in 0..4000 {
        stranger.say(KEY, "", &b"garbage"[..]);
    }
    let count = |state: &GateState| state.rejected.values().sum::<u64>();
    eyes.hears("the gate has refused all of it", |state| count(state) >= 4000).await;
    world.done(&["stop"]).await.is(0, &["r1 is stopped"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_during_braking_keeps_braking_and_only_one_of_two_enables_is_needed() {
    let mut held = Held::new().await;
    let command = held.next(0.0, 0.5).await;
    held.say(&command);
    // Nothing follows: silence makes the gate brake, and the stop comes into that.
    held.eyes.hears("the gate brakes", |state| state.motion == Motion::Braking).await;
    let stop = held.world.done(&["stop", "--json"]).await;
    stop.is(0, &[]);
    let speeds: Vec<f64> =
        held.eyes.truths().iter().filter_map(|truth| truth.twist.map(|twist| twist.v.0)).collect();
    let fastest = speeds.iter().copied().fold(0.0, f64::max);
    assert!(fastest <= 0.52, "it never speeds up beyond what it was told: {fastest}");
    let stopped =
        held.eyes.hears("the stop is in force", |state| state.stop.is_some() && !state.enabled).await;
    assert_eq!(stopped.cause, Some(BrakeCause::AllStop));
    held.eyes.sees_rest().await;

    let other = held.world.join().await;
    declared(&other).await;
    while held.eyes.states.take().is_some() {}
    let state = held.eyes.hears("the gate's account", |_| true).await;
    let enable = |by: &str| Enable {
        stop: state.stop,
        boot: state.boot,
        echo: state.tick,
        by: by.into(),
        class: Class::Manual,
    };
    let (robot, first, second) = (r1(), enable("one"), enable("two"));
    let ask = |mesh: Mesh, enable: Enable| {
        let robot = robot.clone();
        async move { mesh.ask::<_, Done>(&key::ENABLE, Some(&robot), &enable, PATIENCE, Retry::Never).await }
    };
    let answers = tokio::join!(ask(held.mesh.clone(), first), ask(other, second));
    assert!(answers.0.is_ok() || answers.1.is_ok(), "{answers:?}");
    let free = held.eyes.hears("it is enabled", |state| state.enabled).await;
    assert_eq!((free.motion, free.holder), (Motion::Standing, None), "an enable moves nothing");
    let late = Enable { stop: None, ..enable("late") };
    let refused = ask(held.mesh.clone(), late).await.expect_err("it quotes no stop");
    assert!(matches!(refused, Refusal::Fenced { .. }), "{refused}");
    eventually("the file of the stop is gone", || {
        (!held.world.path().join("state/r1.stop").exists()).then_some(())
    })
    .await;
}
