//! Ports that cannot be used, and boards that are not what was asked for.

use super::line::{Line, board, robot};
use crate::harness::{World, r1};
use axle_schema::board::LinkState;
use axle_schema::{Refusal, key};
use nix::sys::signal::Signal;

#[tokio::test(flavor = "multi_thread")]
async fn a_command_line_without_a_board_or_with_a_wrong_one_is_refused() {
    let world = World::new().await;
    let _router = world.router();
    world.done(&["run", "robot"]).await.is(2, &["--board KIND", "roomba", "dwm-text"]);
    world.done(&["run", "robot", "--board", "hoover"]).await.is(2, &["unknown board \"hoover\"", "eddie"]);
    world.done(&["run", "source", "--board", "roomba"]).await.is(2, &["source has no board"]);
    world.done(&["demo", "--board", "orfa"]).await.is(2, &["measures nothing"]);
    let file = world.file("there", "no link");
    board(&world, "roomba", &file, &[]).ended().await.is(2, &["that is no link"]);
    let wrong = world.file("wrong.toml", "[roomba]\nangle_scale = 0\n");
    robot(&world, "roomba", "board", &["--params", &wrong]).ended().await.is(2, &["roomba.angle_scale"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_port_that_is_not_there_or_no_port_is_named_and_tried_again() {
    let world = World::new().await;
    let _router = world.router();
    let mesh = world.join().await;
    let boards = mesh.inbox(&key::BOARD.of(&r1()), 256).expect("states");
    let path = world.path().join("board").display().to_string();
    let mut bridge = robot(&world, "roomba", &path, &[]);
    bridge.says("is the board plugged in").await;
    let state = boards.next().await.message;
    assert_eq!(
        (state.link, state.board.as_str(), state.port.as_str()),
        (LinkState::Absent, "roomba", path.as_str())
    );
    // The board comes, and the bridge finds it by itself.
    let _board = board(&world, "roomba", &path, &[]);
    bridge.says("Open Interface, create2").await;
    assert!(bridge.is_running());

    let plain = world.file("plain", "a file");
    robot(&world, "arduino", &plain, &["--robot", "r2"]).says("cannot be opened as a serial port").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_port_that_somebody_else_has_is_busy_until_they_end() {
    let line = Line::new("arduino").await;
    line.is_up().await;
    let port = line.port.display().to_string();
    let other = robot(&line.world, "arduino", &port, &["--robot", "r2"]);
    other.says("busy: another program").await;
    line.is_up().await;
    line.robot.tell(Signal::SIGTERM);
    other.says("ROSArduinoBridge").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_board_of_another_kind_is_told_by_what_it_says() {
    let world = World::new().await;
    let _router = world.router();
    let path = world.path().join("board").display().to_string();
    let mesh = world.join().await;
    let boards = mesh.inbox(&key::BOARD.of(&r1()), 256).expect("states");
    let _board = board(&world, "dwm-text", &path, &[]);
    let params = world.file("quick.toml", "greeting = 1.0\n");
    let mut bridge = robot(&world, "arduino", &path, &["--params", &params]);
    bridge.says("those of the kind arduino").await;
    let is_told = async {
        loop {
            let state = boards.next().await.message;
            if let Some(Refusal::Unknown { got, .. }) = state.why {
                return got;
            }
        }
    };
    let got = crate::harness::within(crate::harness::PATIENCE, "the kind is told", is_told).await;
    assert!(got.chars().any(|c| c.is_ascii_digit()), "what it says is quoted, a line of dwm-text: {got}");
    assert!(bridge.is_running());
}
