//! Services that die or freeze while the robot drives (fault matrix, rows 1, 2, 15, 31, 42).

use crate::harness::{
    Eyes, PATIENCE, Robot, all_alive, declared, eventually, free_endpoint, is_alive, r1, stands, within,
};
use axle_schema::command::{BrakeCause, GateState, Motion};
use axle_schema::meta::Cause;
use axle_schema::task::Phase;
use axle_schema::{EncodersData, Message, Seconds, key};
use nix::sys::signal::Signal;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// From the last command to the first deceleration: 150 ms of silence and a beat of at most 20 ms.
const HALT: f64 = 0.17;
/// Readings of the encoders are so far apart.
const READING: f64 = 0.02;
/// So much later than its time a beat may come on a machine that runs other tests too.
const LATE: f64 = 0.1;
/// The deceleration of a gate that brakes, m/s².
const A_STOP: f64 = 2.0;

fn time_of(state: &GateState) -> f64 {
    f64::from(state.tick.0) / 1000.0
}

/// When the gate obeyed its last command, at the latest: the first reading that names it as its cause.
fn last_obeyed(eyes: &Eyes) -> Seconds {
    let readings: Vec<_> = std::iter::from_fn(|| eyes.encoders.take())
        .filter_map(|heard| Some((heard.message, heard.meta?.cause?)))
        .collect();
    let (_, last): (EncodersData, Cause) = *readings.last().expect("readings that a command caused");
    readings.iter().find(|(_, cause)| *cause == last).expect("the last one at least").0.stamp
}

#[tokio::test(flavor = "multi_thread")]
async fn a_corrector_that_is_killed_leaves_a_robot_that_brakes_in_time_and_stands() {
    let robot = Robot::new().await;
    let mut go = robot.on_its_way().await;
    let eyes = robot.eyes().await;
    robot.service("d-corrector").tell(Signal::SIGKILL);
    let braking = eyes.hears("the gate brakes", |state| state.motion == Motion::Braking).await;
    assert!(matches!(braking.cause, Some(BrakeCause::Silence | BrakeCause::Expired)), "{braking:?}");
    let standing = eyes.hears_standing().await;
    let free = eyes.hears("the lease has ended", |state| state.holder.is_none()).await;
    eyes.sees_rest().await;

    let obeyed = last_obeyed(&eyes).0;
    let halt = time_of(&braking) - obeyed;
    assert!((-READING..=HALT + LATE).contains(&halt), "it braked {halt:.3} s after its last command");
    let speed = braking.wheels.left.0.abs().max(braking.wheels.right.0.abs());
    let ramp = time_of(&standing) - time_of(&braking);
    assert!(ramp <= speed / A_STOP + READING + LATE, "{speed} m/s took {ramp:.3} s to rest");
    assert_eq!((free.motion, free.accepted), (Motion::Standing, standing.accepted));

    let words = ["not reached: d-corrector is unavailable", "axle run d-corrector", "0 of 1 way points"];
    go.ended().await.is(1, &words);
    let _again = robot.world.run("d-corrector");
    all_alive(&robot.mesh, &["d-corrector"]).await;
    robot.drives_again().await;
}

/// Freezes the corrector in mid drive for so long, by the robot's clock, and lets it go on.
async fn freezes_for(time: f64) {
    let robot = Robot::new().await;
    let mut go = robot.on_its_way().await;
    let eyes = robot.eyes().await;
    robot.service("d-corrector").freeze().await;
    let frozen = eyes.sees("a moment", |_| true).await.stamp;
    eyes.hears("the gate brakes", |state| state.motion == Motion::Braking).await;
    let standing = eyes.hears_standing().await;
    let rest = eyes.sees("the robot stands", stands).await;
    assert!(
        rest.stamp.0 - frozen.0 <= HALT + 0.6 / A_STOP + 0.1 + LATE,
        "it stood {:.3} s later",
        rest.stamp.0 - frozen.0
    );
    eyes.sees_time(frozen + Seconds(time)).await;

    robot.service("d-corrector").tell(Signal::SIGCONT);
    // It acts again, sees what has become of its task, and is back on the mesh: the gate's next account is about all
    // that came of it.
    robot.service("d-corrector").says("task failed").await;
    all_alive(&robot.mesh, &["d-corrector"]).await;
    let awake = eyes.sees("a moment", |_| true).await.stamp;
    let state = eyes.hears("the gate's account", |state| time_of(state) > awake.0).await;
    assert_eq!(state.accepted, standing.accepted, "nothing of before the freeze was obeyed: {state:?}");
    assert_eq!((state.motion, state.holder), (Motion::Standing, None));
    let moved = eyes.truths().into_iter().find(|truth| !stands(truth));
    assert!(moved.is_none(), "the robot stayed at rest: {moved:?}");
    go.ended().await.is(1, &["not reached"]);
    robot.drives_again().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_corrector_that_freezes_for_two_seconds_moves_nothing_when_it_wakes_up() {
    // The router has taken its link away: it comes back as if it were new.
    freezes_for(2.0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_corrector_that_freezes_within_the_lease_of_its_link_moves_nothing_when_it_wakes_up() {
    // The link is still there: what it commands with what it saw before arrives, and is refused.
    freezes_for(0.6).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_router_that_is_killed_in_mid_drive_stops_the_robot_and_nothing_has_to_be_restarted() {
    let mut robot = Robot::new().await;
    let mut go = robot.on_its_way().await;
    let pids: Vec<u32> = robot.services.values().map(crate::harness::Process::pid).collect();
    robot.router.tell(Signal::SIGKILL);
    robot.router.ended().await;
    go.ended().await.is(1, &["the pilot said nothing for 3 s"]);

    robot.router = robot.world.router();
    robot.mesh = robot.world.join().await;
    all_alive(&robot.mesh, &crate::harness::SERVICES).await;
    let eyes = robot.eyes().await;
    let state = eyes.hears("the gate's account", |_| true).await;
    assert_eq!((state.motion, state.holder), (Motion::Standing, None));
    assert!(stands(&eyes.sees("the robot", |_| true).await));
    robot.drives_again().await;
    assert!(pids.into_iter().all(is_alive), "no service was restarted");
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_owns_the_wheels_brakes_before_it_ends() {
    let mut robot = Robot::new().await;
    let mut go = robot.on_its_way().await;
    let eyes = robot.eyes().await;
    robot.service("emulator").tell(Signal::SIGTERM);
    let ended = robot.services.get_mut("emulator").expect("the emulator").ended().await;
    ended.is(0, &[]);
    declared(&robot.mesh).await;
    let truths = eyes.truths();
    assert!(truths.iter().any(|truth| !stands(truth)), "it was told to end in mid drive");
    let standing = std::iter::from_fn(|| eyes.states.take()).last().expect("a state").message;
    assert_eq!(
        (standing.motion, standing.enabled),
        (Motion::Standing, false),
        "its last words: {standing:?}"
    );
    go.ended().await.is(1, &["not reached"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_process_of_the_wheels_that_freezes_brakes_when_it_wakes_up_and_obeys_nothing_old() {
    let robot = Robot::new().await;
    let mut go = robot.on_its_way().await;
    let eyes = robot.eyes().await;
    robot.service("emulator").freeze().await;
    let before = eyes.states.latest().map(|heard| heard.message.accepted);
    // Commands go on until the corrector misses the measurements; they wait for the process to wake up.
    go.ended().await.is(1, &["not reached"]);
    robot.service("emulator").tell(Signal::SIGCONT);
    // To the robot its clock has jumped: every command that has waited is too old now.
    let state = eyes.hears("it stands", |state| state.motion == Motion::Standing).await;
    assert_eq!(state.holder, None, "{state:?}");
    let rest = eyes.sees_rest().await;
    let later = eyes.hears("the gate's account", |state| time_of(state) > rest.stamp.0 + 0.3).await;
    assert_eq!(
        (later.motion, later.accepted),
        (Motion::Standing, state.accepted),
        "{later:?}, before {before:?}"
    );
    all_alive(&robot.mesh, &["emulator"]).await;
    robot.drives_again().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_planner_that_is_gone_is_named_with_what_to_start() {
    let robot = Robot::new().await;
    robot.service("pathfinder").tell(Signal::SIGKILL);
    let plan = robot.world.done(&["plan", "1,0"]).await;
    plan.is(1, &["pathfinder is unavailable", "axle run pathfinder"]);
    assert!(plan.took < Duration::from_secs(6), "planners have 3 s: {:?}", plan.took);
    let eyes = robot.eyes().await;
    let mut go = robot.go("1,0");
    go.ended().await.is(1, &["not reached: pathfinder is unavailable", "axle run pathfinder"]);
    assert!(eyes.truths().iter().all(stands), "without a plan nothing moves");
    assert_eq!(eyes.states.latest().map_or(0, |heard| heard.message.accepted), 0);
    let _again = robot.world.run("pathfinder");
    robot.drives_again().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_pathfinder_elsewhere_takes_over_without_a_lost_task() {
    let robot = Robot::new().await;
    // Another computer, whose router links to the one of the robot.
    let elsewhere = free_endpoint();
    let _router = robot.world.axle(&["router", "--listen", &elsewhere, "--link", &robot.world.endpoint]);
    let _second = robot.world.axle(&["run", "pathfinder", "--host", "elsewhere", "--connect", &elsewhere]);
    let mut comings = robot.mesh.watch_presence().expect("presence");
    let came = async { while comings.next().await.0.host != "elsewhere" {} };
    within(PATIENCE, "the second pathfinder is there", came).await;
    robot.reaches("0.2,0").await;
    // The first one has the question of a task in its hands, and dies without an answer.
    let words = robot.mesh.inbox(&key::GO_PROGRESS.of(&r1()), 64).expect("progress");
    declared(&robot.mesh).await;
    robot.service("pathfinder").freeze().await;
    let mut go = robot.go("0.4,0");
    let planning = async { while words.next().await.message.phase != Phase::Planning {} };
    within(PATIENCE, "the task is being planned", planning).await;
    robot.service("pathfinder").tell(Signal::SIGKILL);
    let ended = go.ended().await;
    if !ended.was_late() {
        ended.is(0, &["reached: 1 of 1 way points"]);
    }
    robot.drives_again().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frozen_tap_does_not_hold_up_the_robot() {
    let robot = Robot::new().await;
    // Twice as many as Zenoh has threads to close links with, unless the router asks for more: the leases of all end at
    // once, while the robot drives.
    let taps: Vec<_> = (0..5).map(|_| robot.world.tool(&["tap", "axle/**", "--json"])).collect();
    for tap in &taps {
        eventually("the tap prints", || tap.out().contains("axle/r1/robot/encoders").then_some(())).await;
        tap.freeze().await;
    }
    // Were commands held up, the gate would take the wheels back each time.
    robot.reaches("0.6,0").await;
}

/// Wall time, as recordings have it.
fn now() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recorder_that_is_killed_loses_no_more_than_a_second() {
    let robot = Robot::new().await;
    let params = robot.world.file("recorder.toml", "file = \"drive.mcap\"\n");
    let recorder = robot.world.tool(&["run", "recorder", "--params", &params]);
    all_alive(&robot.mesh, &["recorder"]).await;
    let mut go = robot.eyes().await.under_way(|| robot.go("2.4,0")).await;
    let begun = now();
    let eyes = robot.eyes().await;
    let from = eyes.sees("a moment", |_| true).await.stamp;
    eyes.sees_time(from + Seconds(2.5)).await;
    let killed = now();
    recorder.tell(Signal::SIGKILL);
    let ended = go.ended().await;
    if !ended.was_late() {
        ended.is(0, &["reached: 1 of 1 way points"]);
    }

    let mut recording =
        axle_recorder::Recording::open(&robot.world.path().join("drive.mcap")).expect("a recording");
    let encoders: Vec<_> = recording
        .by_ref()
        .filter_map(|entry| match entry {
            axle_recorder::Entry::Sample(sample) if sample.key.ends_with("robot/encoders") => Some(sample),
            _ => None,
        })
        .collect();
    let account = recording.account();
    assert_eq!((account.lost, account.damaged, account.finished), (0, 0, false), "{account:?}");
    let last = encoders.last().expect("readings were recorded");
    let missing = killed.saturating_sub(Duration::from_nanos(last.received));
    // A sync once a second, a look whether it is due every 0.1 s, and a machine that does other things too.
    assert!(missing < Duration::from_millis(1500), "the last {missing:?} are missing");
    let since = |sample: &&axle_recorder::Recorded| Duration::from_nanos(sample.received) >= begun;
    let count = encoders.iter().filter(since).count();
    assert!(count > 30, "{count} readings of the drive are there");
    let read = axle_schema::decode::<EncodersData>(&last.payload).expect("readings can be read");
    assert!(read.check().is_ok() && last.attachment.is_some());
}
