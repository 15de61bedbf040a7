//! Every board drives, through a real serial line, and is found again after it was unplugged.

use super::line::{Line, board};
use crate::harness::{PATIENCE, World, declared, driven, r1, within};
use axle_schema::board::{LinkState, ServoAngle};
use axle_schema::{Metres, Radians, Sides, key};
use nix::sys::signal::Signal;

/// The main job, through the line of every board that measures.
#[tokio::test(flavor = "multi_thread")]
async fn the_demo_reaches_its_goal_through_a_serial_line() {
    for kind in ["roomba", "arduino", "eddie", "dwm-text"] {
        let world = World::new().await;
        let args = ["demo", "--json", "--board", kind, "--way", "0.3,0 0.3,0.2", "--out", "shown"];
        let demo = driven(|| world.axle(&args)).await;
        let json = demo.is(0, &["11 processes on tcp/127.0.0.1:"]).json();
        assert_eq!(json["reached"], true, "{kind}: {json}");
        let missed = json["final_error_m"].as_f64().expect("a number");
        assert!((0.0..0.03).contains(&missed), "{kind}: {missed} m");
        let refused = |service: &str| json["messages"][service]["refused"].clone();
        assert_eq!((refused("robot"), refused("emulator")), (0.into(), 0.into()), "{json}");
        assert!(!world.path().join("shown/board").exists(), "the link goes with its terminal");
    }
}

/// Drives, is unplugged while it drives, is plugged in again, and drives again.
async fn plays(kind: &'static str) {
    let mut line = Line::new(kind).await;
    let up = line.is_up().await;
    assert_eq!((up.board.as_str(), up.opened, up.restarts), (kind, 1, 0));
    assert!(up.version.is_some() && up.why.is_none(), "{up:?}");
    line.gate_says("it starts disabled", |state| !state.enabled).await;
    line.enable().await;
    line.drives("0.15").await;
    let at = line.stands_at().await;
    assert!((at - 0.15).abs() < 0.02, "{kind}: {at} m");
    // Encoders are stamped when their bytes came: each later than the one before, by the robot's clock.
    let stamps: Vec<f64> =
        std::iter::from_fn(|| line.encoders.take()).map(|heard| heard.message.stamp.0).collect();
    assert!(stamps.len() > 10 && stamps.windows(2).all(|two| two[0] < two[1]), "{kind}: {}", stamps.len());

    let mut going = line.world.tool(&["drive", "distance", "5", "--power", "0.3"]);
    let start = line.stands_at().await;
    let moved = async { while line.truth.next().await.message.pose.x.0 < start + 0.05 {} };
    within(PATIENCE, &format!("{kind} drives"), moved).await;
    line.board.tell(Signal::SIGKILL);
    let gone = line.board_says("it is unplugged", |state| state.link == LinkState::Absent).await;
    assert!(gone.why.is_some(), "{gone:?}");
    line.gate_says("it is disabled", |state| !state.enabled).await;
    going.ended().await.is(1, &[]);
    assert!(line.robot.is_running());

    // Plugged in again: a link to a new terminal, and a board that has begun anew.
    let port = line.port.display().to_string();
    line.board = board(&line.world, kind, &port, &[]);
    let back = line.is_up().await;
    assert!(back.opened > 1, "{back:?}");
    line.gate_says("it stays disabled", |state| !state.enabled).await;
    let before = line.stands_at().await;
    line.enable().await;
    line.drives("0.15").await;
    let moved = line.stands_at().await - before;
    assert!((moved - 0.15).abs() < 0.02, "{kind}: {moved} m after it was plugged in again");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_arduino_drives_and_is_found_again() {
    plays("arduino").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_roomba_drives_and_is_found_again() {
    plays("roomba").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_eddie_drives_and_is_found_again() {
    plays("eddie").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_board_of_text_drives_and_is_found_again() {
    plays("dwm-text").await;
}

/// It measures nothing: what it does is seen by its powers, and by the truth of the emulator.
#[tokio::test(flavor = "multi_thread")]
async fn a_board_without_encoders_is_driven_by_powers_and_found_again() {
    let mut line = Line::new("orfa").await;
    line.is_up().await;
    let signals = line.mesh.inbox(&key::SIGNALS.of(&r1()), 4).expect("powers");
    within(PATIENCE, "powers are told", signals.next()).await;
    assert!(line.encoders.take().is_none(), "what was not measured is not said");
    line.board.tell(Signal::SIGKILL);
    line.board_says("it is unplugged", |state| state.link == LinkState::Absent).await;
    let port = line.port.display().to_string();
    line.board = board(&line.world, "orfa", &port, &[]);
    assert!(line.is_up().await.opened > 1);
}

/// What is said on the key of a servo turns the one of that number, in radians from its middle, and never beyond its limits.
#[tokio::test(flavor = "multi_thread")]
async fn servos_turn_through_the_line_and_stay_within_their_limits() {
    let servos = "[[servos]]\npin = 3\nmin = -1.0\nmax = 1.0\n[[servos]]\npin = 5\nmin = 0.0\nmax = 0.5\n";
    for kind in ["arduino", "dwm-text"] {
        let line = Line::with(kind, "", servos).await;
        line.is_up().await;
        let keys = [0, 1].map(|number: usize| key::SERVOS[number].of(&r1()));
        let servos = keys.map(|key| line.mesh.publisher(&key).expect("a publisher"));
        declared(&line.mesh).await;
        let says = |number: usize, angle: f64| {
            servos[number].put(&ServoAngle { angle: Radians(angle) }, None).expect("said");
        };
        says(0, -std::f64::consts::FRAC_PI_4);
        line.board.says("the servo at pin 3 turns to -0.785 rad").await;
        says(1, 0.6);
        line.robot.says("angle of servo 1 in rad").await;
        says(1, 0.5);
        line.board
            .says(if kind == "arduino" { "pin 5 turns to 0.506" } else { "pin 5 turns to 0.500" })
            .await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn counters_wrap_and_wires_that_are_crossed_are_put_right() {
    // Both motors and both encoders are crossed, and all run backward: what the body of the emulator cannot show, the
    // parameters undo, so that the robot turns the other way round.
    let mount = "[mount]\nswapped_motors = true\nswapped_encoders = true\n";
    let line = Line::with("roomba", "[board]\nfirst_count = 65500\n", mount).await;
    line.is_up().await;
    line.enable().await;
    line.drives("0.15").await;
    let at = line.stands_at().await;
    assert!((at - 0.15).abs() < 0.02, "{at} m over the end of the counters");
    let last = std::iter::from_fn(|| line.encoders.take()).last().expect("distances").message;
    let missed = Sides::new(last.left, last.right).map(|told| (told - Metres(at)).abs().0);
    assert!(missed.left < 0.01 && missed.right < 0.01, "{last:?} of {at}");
    assert_eq!(line.is_up().await.restarts, 0, "a wrap is no restart");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_line_that_loses_and_spoils_bytes_drives_all_the_same_and_counts_them() {
    let line = Line::with("roomba", "[board]\nloss = 0.001\nnoise = 0.001\n", "").await;
    line.is_up().await;
    line.enable().await;
    line.drives("0.2").await;
    let at = line.stands_at().await;
    assert!((at - 0.2).abs() < 0.03, "{at} m");
    let counted = |state: &axle_schema::board::BoardState| state.faults.checksum + state.faults.garbage > 0;
    line.board_says("faults are counted", counted).await;
}
