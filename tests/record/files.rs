//! Recordings as files: made, looked at, cut, mended, said again; and what a crash and a full disk leave of them.

use crate::harness::{PATIENCE, Process, Robot, World, all_alive, eventually, r1, within};
use axle_recorder::{Entry, Recording};
use axle_schema::key;
use nix::sys::signal::Signal;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, SystemTime};

/// The keys of a recording, and how many samples it holds.
fn keys(path: &Path) -> (BTreeSet<String>, usize) {
    let recording = Recording::open(path).expect("a recording");
    let (mut keys, mut count) = (BTreeSet::new(), 0);
    for entry in recording {
        if let Entry::Sample(sample) = entry {
            keys.insert(sample.key.to_string());
            count += 1;
        }
    }
    (keys, count)
}

/// Waits until a recording holds something.
async fn holds_something(path: &Path) {
    eventually("the recording grows", || (path.exists() && keys(path).1 > 0).then_some(())).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn some_keys_are_recorded_looked_at_cut_and_said_again_for_another_robot() {
    let robot = Robot::new().await;
    let world = &robot.world;
    let pose = key::POSE.of(&r1()).to_string();
    let encoders = key::ENCODERS.of(&r1()).to_string();
    let mut recording = world.tool(&["record", &pose, &encoders, "--out", "part.mcap"]);
    recording.says("recording ").await;
    let path = world.path().join("part.mcap");
    holds_something(&path).await;
    recording.tell(Signal::SIGINT);
    let ended = recording.ended().await;
    let line = ended.is(0, &["Ctrl-C ends"]).json();
    assert_eq!(line["lost"], 0, "{line}");
    let (recorded, count) = keys(&path);
    assert_eq!(recorded, [pose.clone(), encoders.clone()].into());
    assert_eq!(line["samples"].as_u64(), u64::try_from(count).ok());

    let info = world.axle(&["record", "info", "part.mcap", "--json"]).ended().await.json();
    assert_eq!((&info["finished"], &info["damaged"]), (&Value::from(true), &Value::from(0)), "{info}");
    assert_eq!(info["samples"].as_u64(), u64::try_from(count).ok());
    assert_eq!(info["streams"].as_array().map(Vec::len), Some(2));
    assert!(info["streams"][0]["missing"] == 0 && info["about"]["robot"] == "all", "{info}");
    world.axle(&["record", "info", "part.mcap"]).ended().await.is(0, &["whole: closed with its index"]);

    let cut = world.axle(&["record", "cut", "part.mcap", "poses.mcap", "--only", "navigator"]).ended().await;
    cut.is(0, &["samples are in poses.mcap"]);
    let (cut_keys, cut_count) = keys(&world.path().join("poses.mcap"));
    assert!(cut_keys == [pose].into() && cut_count > 0 && cut_count < count);
    let again = world.axle(&["record", "cut", "part.mcap", "poses.mcap"]).ended().await;
    again.is(1, &["poses.mcap", "exists"]);

    // Another robot lives what r1 has lived.
    let r2 = axle_schema::RobotId::new("r2").expect("a robot");
    let poses = robot.mesh.inbox(&key::POSE.of(&r2), 4096).expect("poses");
    crate::harness::declared(&robot.mesh).await;
    let play = world.done(&["play", "poses.mcap", "--rate", "50", "--remap", "r1=r2"]).await;
    play.is(0, &[&format!("said {cut_count} samples")]);
    let first = within(PATIENCE, "a pose of r2", poses.next()).await;
    assert!(first.meta.is_some(), "its attachment came with it");
    for (args, words) in [
        (vec!["play", "poses.mcap", "--remap", "r1"], "write r1=r2"),
        (vec!["play", "poses.mcap", "--remap", "r1=R 2"], "write r1=r2"),
        (vec!["play", "poses.mcap", "--rate", "0"], "0.01 to 1000"),
        (vec!["play", "nothing.mcap"], "cannot read the recording"),
        (vec!["play", "poses.mcap", "--paused"], "needs a terminal"),
        (vec!["record", "a//b", "--out", "x.mcap"], "a//b"),
    ] {
        world.done(&args).await.is(2, &[words]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_would_move_a_robot_is_played_only_when_asked_for() {
    let robot = Robot::new().await;
    let world = &robot.world;
    let mut recording = world.tool(&["record", "--robot", "r1", "--out", "all.mcap"]);
    recording.says("recording ").await;
    holds_something(&world.path().join("all.mcap")).await;
    robot.reaches("0.1,0").await;
    recording.tell(Signal::SIGINT);
    recording.ended().await.is(0, &[]);
    let commands =
        robot.mesh.inbox(&key::COMMAND.of(&axle_schema::RobotId::new("r2").expect("a robot")), 4096);
    let commands = commands.expect("commands");
    crate::harness::declared(&robot.mesh).await;
    let play = ["play", "all.mcap", "--rate", "1000", "--remap", "r1=r2"];
    world.done(&play).await.is(0, &["commands, stops and orders were left out; --commands says them too"]);
    assert!(commands.take().is_none(), "no command was said");
    let with = world.done(&[&play[..], &["--commands"]].concat()).await;
    assert!(!with.is(0, &["said "]).err.contains("left out"));
    within(PATIENCE, "a command is said", commands.next()).await;
}

/// Starts the recorder service, and waits until it writes.
async fn recorder(robot: &Robot, name: &str) -> Process {
    let params = robot.world.file("recorder.toml", &format!("file = {name:?}\n"));
    let recorder = robot.world.tool(&["run", "recorder", "--params", &params]);
    all_alive(&robot.mesh, &["recorder"]).await;
    recorder
}

fn now() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("a time");
    u64::try_from(since.as_nanos()).expect("a time")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_recording_opens_misses_a_second_at_most_and_is_mended() {
    let robot = Robot::new().await;
    let directory = robot.world.path();
    for round in 0..5_u64 {
        let name = format!("killed-{round}.mcap");
        let mut killed = recorder(&robot, &name).await;
        let path = directory.join(&name);
        holds_something(&path).await;
        // The instants of the kills lie everywhere in the period of the flush: so many readings after one.
        let size = std::fs::metadata(&path).expect("the file").len();
        let grows = || (std::fs::metadata(&path).ok()?.len() > size).then_some(());
        eventually("the recording grows again", grows).await;
        let readings = robot.mesh.inbox(&key::ENCODERS.of(&r1()), 64).expect("readings");
        for _ in 0..=9 * round {
            within(PATIENCE, "a reading", readings.next()).await;
        }
        let at = now();
        killed.tell(Signal::SIGKILL);
        killed.ended().await;
        let mut recording = Recording::open(&path).expect("it opens");
        let last = recording.by_ref().filter_map(|entry| match entry {
            Entry::Sample(sample) => Some(sample.received),
            _ => None,
        });
        let last = last.max().expect("samples");
        assert_eq!(recording.account().damaged, 0);
        let lost = Duration::from_nanos(at.saturating_sub(last));
        // The flush is due after a second, and the beat that does it comes 20 times a second.
        assert!(lost < Duration::from_millis(1150), "{lost:?} are lost");
        let whole = format!("whole-{round}.mcap");
        let mended = robot.world.axle(&["record", "recover", &name, &whole]).ended().await;
        mended.is(0, &["samples are in"]);
        let info = robot.world.axle(&["record", "info", &whole, "--json"]).ended().await.json();
        assert_eq!(info["finished"], true, "{info}");
        assert_eq!(keys(&path), keys(&directory.join(&whole)));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_ends_the_recording_and_not_the_robot() {
    let robot = Robot::new().await;
    // A limit of the file's size is a disk that is full for this process alone.
    let params = robot.world.file("full.toml", "file = \"full.mcap\"\nfile_gb = 0.001\n");
    let limited = ["run", "recorder", "--params", &params];
    let mut recorder = robot.world.tool(&limited);
    all_alive(&robot.mesh, &["recorder"]).await;
    let pid = nix::unistd::Pid::from_raw(i32::try_from(recorder.pid()).expect("a pid"));
    limit_files(pid, 60_000);
    let ended = recorder.ended().await;
    ended.is(1, &["cannot write the recording"]);
    let (_, count) = keys(&robot.world.path().join("full.mcap"));
    assert!(count > 0, "what was flushed before is there");
    robot.reaches("0.1,0").await;
}

/// Lets files of a process grow no further than this.
fn limit_files(pid: nix::unistd::Pid, bytes: u64) {
    let done = std::process::Command::new("prlimit")
        .args(["--pid", &pid.to_string(), &format!("--fsize={bytes}")])
        .status()
        .expect("prlimit of util-linux");
    assert!(done.success());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_goes_on_in_further_files_that_can_be_read_alone() {
    let robot = Robot::new().await;
    let params = robot
        .world
        .file("turn.toml", "directory = \"turns\"\nfile_gb = 0.001\nfiles = 3\nfile_minutes = 0.02\n");
    let mut recorder = robot.world.tool(&["run", "recorder", "--params", &params]);
    all_alive(&robot.mesh, &["recorder"]).await;
    robot.reaches("0.1,0").await;
    let directory = robot.world.path().join("turns");
    let files = || -> Vec<_> {
        let mut files: Vec<_> =
            std::fs::read_dir(&directory).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
        files.sort();
        files
    };
    // The fifth file: then the first ones are gone.
    eventually("the recording goes on", || {
        files().iter().any(|file| file.to_string_lossy().contains(".005.")).then_some(())
    })
    .await;
    recorder.tell(Signal::SIGTERM);
    recorder.ended().await.is(0, &["recorded "]);
    let files = files();
    assert!(files.len() <= 3, "{files:?}");
    for file in &files {
        let (keys, _) = keys(file);
        assert!(keys.contains(key::GO_PLAN.of(&r1()).as_str()), "the plan stands in each: {keys:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn foreign_and_broken_files_are_told_as_what_they_are() {
    let world = World::new().await;
    for (name, bytes) in
        [("empty", &b""[..]), ("text", b"no recording"), ("magic", b"\x89MCAP0\r\n"), ("zeros", &[0; 100])]
    {
        let file = world.path().join(name);
        std::fs::write(&file, bytes).expect("a file");
        let info = world.axle(&["record", "info", name]).ended().await;
        match name {
            "magic" | "empty" => drop(info.is(0, &["not closed"])),
            _ => drop(info.is(2, &["is not an MCAP file"])),
        }
    }
    world
        .axle(&["record", "cut", "magic", "out.mcap", "--from", "3", "--to", "1"])
        .ended()
        .await
        .is(2, &["--to"]);
    world.axle(&["record", "recover", "magic", "out.mcap"]).ended().await.is(0, &["0 samples"]);
}
