//! A robot that is composed of motor and encoder services: it drives as any other, and whatever part of it dies, its wheels stop.

use crate::harness::{PATIENCE, Process, World, all_alive, declared, driven, r1, within};
use axle_mesh::{Inbox, Mesh};
use axle_schema::command::GateState;
use axle_schema::differential_drive::MotorReading;
use axle_schema::key::{self, Presence};
use axle_schema::{Duty, Seconds, Sides};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::collections::BTreeMap;

const SERVICES: [&str; 12] = [
    "pathfinder",
    "pathdriver",
    "motor-left",
    "motor-right",
    "encoder-left",
    "encoder-right",
    "composed",
    "source",
    "navigator",
    "d-corrector",
    "pilot",
    "drive",
];

/// The shipped topology, all alive.
struct Composed {
    world: World,
    mesh: Mesh,
    motors: Sides<Inbox<MotorReading>>,
    encoders: Sides<Inbox<MotorReading>>,
    states: Inbox<GateState>,
    alive: BTreeMap<String, Presence>,
    _up: Process,
}

impl Composed {
    async fn new() -> Self {
        let world = World::new().await;
        let topology = concat!(env!("CARGO_MANIFEST_DIR"), "/../../deploy/topologies/composed.toml");
        let up = world.axle(&["up", topology, "--listen", &world.endpoint]);
        let mesh = world.join().await;
        let readings = |name| mesh.inbox(&key::motor_reading(name).of(&r1()), 4096).expect("readings");
        let motors = Sides::new(readings("motor-left"), readings("motor-right"));
        let encoders = Sides::new(readings("encoder-left"), readings("encoder-right"));
        let states = mesh.inbox(&key::GATE_STATE.of(&r1()), 256).expect("states");
        let alive = all_alive(&mesh, &SERVICES).await;
        declared(&mesh).await;
        let composed = Self { world, mesh, motors, encoders, states, alive, _up: up };
        let poses = composed.mesh.inbox(&key::POSE.of(&r1()), 1).expect("poses");
        within(PATIENCE, "the robot knows where it is", poses.next()).await;
        composed.gate_says("it may move", |state| state.enabled).await;
        composed
    }
    async fn gate_says(&self, what: &str, is_so: impl Fn(&GateState) -> bool) {
        let heard = async { while !is_so(&self.states.next().await.message) {} };
        within(PATIENCE, what, heard).await;
    }
    fn kill(&self, service: &str) {
        let pid = i32::try_from(self.alive[service].pid).expect("a process id");
        kill(Pid::from_raw(pid), Signal::SIGKILL).expect("it was alive");
    }
    /// Starts what turns both wheels for long, and waits until they turn.
    async fn turning(&self, args: &[&str]) -> Process {
        let client = self.world.tool(&[&["drive"], args].concat());
        let fast = |reading: &MotorReading| reading.power.is_some_and(|power| power.get() > 0.2);
        next(&self.motors.left, "the left wheel turns", fast).await;
        next(&self.motors.right, "the right wheel turns", fast).await;
        client
    }
}

async fn next(
    readings: &Inbox<MotorReading>,
    what: &str,
    is_so: impl Fn(&MotorReading) -> bool,
) -> MotorReading {
    let heard = async {
        loop {
            let reading = readings.next().await.message;
            if is_so(&reading) {
                return reading;
            }
        }
    };
    within(PATIENCE, what, heard).await
}

/// From now on a motor has no power after `time` of its own clock, and its wheel comes to rest and stays there.
async fn comes_to_rest(motor: &Inbox<MotorReading>, encoder: &Inbox<MotorReading>, what: &str, time: f64) {
    while motor.take().is_some() {}
    let from = next(motor, "a reading", |_| true).await;
    let is_off = |reading: &MotorReading| reading.power == Some(Duty::default());
    let off = next(motor, &format!("{what} has no power"), is_off).await;
    let took = (off.stamp - from.stamp).0;
    assert!(took < time, "{what} had power for {took:.3} s");
    while encoder.take().is_some() {}
    let counted = next(encoder, "a reading", |_| true).await;
    // The lag of the motor is 0.05 s: twenty times that, and nothing moves.
    let at_rest = next(encoder, "a second", |reading| reading.stamp > counted.stamp + Seconds(1.0)).await;
    let later = next(encoder, "later", |reading| reading.stamp > at_rest.stamp + Seconds(0.3)).await;
    assert!(at_rest.distance.is_some() && later.distance == at_rest.distance, "{what} stays at rest");
}

#[tokio::test(flavor = "multi_thread")]
async fn two_motors_and_two_encoders_drive_as_one_robot() {
    let composed = Composed::new().await;
    let go = driven(|| composed.world.tool(&["go", "0.5,0"])).await;
    go.is(0, &["reached: 1 of 1 way points"]);
    let distances = async || {
        let mut sum = 0.0;
        for side in [&composed.encoders.left, &composed.encoders.right] {
            while side.take().is_some() {}
            sum += next(side, "a distance", |_| true).await.distance.expect("an encoder").0 / 2.0;
        }
        sum
    };
    let mut before = distances().await;
    assert!((before - 0.5).abs() < 0.02, "{before}");
    let mut ended = composed.world.done(&["drive", "distance", "0.3", "--power", "-0.4"]).await;
    for _ in 0..2 {
        if ended.was_late() {
            before = distances().await;
            ended = composed.world.done(&["drive", "distance", "0.3", "--power", "-0.4"]).await;
        }
    }
    ended.is(0, &["completed"]);
    let moved = distances().await - before;
    assert!((moved + 0.3).abs() < 0.01, "{moved}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_motor_that_is_killed_stops_the_other_one_and_disables_the_drive() {
    let composed = Composed::new().await;
    let mut client = composed.turning(&["power", "0.4", "0.4", "--for", "60"]).await;
    composed.kill("motor-left");
    // The other one brakes from 0.32 m/s with 2 m/s², after 0.25 s of silence at the most.
    let (motors, encoders) = (&composed.motors, &composed.encoders);
    comes_to_rest(&motors.right, &encoders.right, "the right wheel", 0.25 + 0.16 + 0.6).await;
    client.ended().await.is(1, &["the drive is disabled"]);
    composed.world.done(&["drive", "power", "0.2", "0.2"]).await.is(1, &["the drive is disabled"]);
    // The supervisor has started the motor again: once somebody says so, everything works.
    all_alive(&composed.mesh, &["motor-left"]).await;
    while composed.states.take().is_some() {}
    composed.gate_says("it stands", |state| !state.enabled).await;
    composed.world.done(&["drive", "enable"]).await.is(0, &["r1 may move"]);
    driven(|| composed.world.tool(&["drive", "distance", "0.1"])).await.is(0, &["completed"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_encoder_that_is_killed_stops_both_wheels_and_disables_the_drive() {
    let composed = Composed::new().await;
    let mut client = composed.turning(&["power", "0.4", "0.4", "--for", "60"]).await;
    composed.kill("encoder-right");
    let (motors, encoders) = (&composed.motors, &composed.encoders);
    comes_to_rest(&motors.left, &encoders.left, "the left wheel", 0.25 + 0.16 + 0.6).await;
    client.ended().await.is(1, &["the drive is disabled"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn motors_stop_by_themselves_when_the_owner_of_the_wheels_is_killed() {
    let composed = Composed::new().await;
    let mut client = composed.turning(&["distance", "20", "--power", "0.4"]).await;
    composed.kill("composed");
    let (motors, encoders) = (&composed.motors, &composed.encoders);
    // 0.2 s of silence, and a machine that does other things too.
    tokio::join!(
        comes_to_rest(&motors.left, &encoders.left, "the left wheel", 0.2 + 0.4),
        comes_to_rest(&motors.right, &encoders.right, "the right wheel", 0.2 + 0.4),
    );
    client.ended().await.is(1, &["cancelled: "]);
}
