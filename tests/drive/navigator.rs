//! The navigator among the others: what it is asked and told, what it notices, and what a new one knows of the old one.

use super::FAR;
use crate::harness::{PATIENCE, Robot, all_alive, declared, driven, r1, within};
use axle_mesh::{Inbox, Mesh, Retry};
use axle_schema::event::{Event, NavigatorEvent};
use axle_schema::{
    Fix, GetPosition, Metres, NavigatorData, Numbers, Pose, Position, Radians, Range, Refusal, Seconds,
    SetPosition, key,
};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

async fn asked(mesh: &Mesh) -> Position {
    let answer =
        mesh.ask(&key::GET_POSITION, Some(&r1()), &GetPosition {}, PATIENCE, Retry::Idempotent).await;
    answer.expect("a position")
}

/// The next message of which this holds.
async fn hears<M: axle_schema::Message>(inbox: &Inbox<M>, what: &str, is_so: impl Fn(&M) -> bool) -> M {
    let next = async {
        loop {
            let heard = inbox.next().await.message;
            if is_so(&heard) {
                return heard;
            }
        }
    };
    within(PATIENCE, what, next).await
}

fn fix(stamp: Seconds, x: f64, y: f64) -> Fix {
    let covariance = Numbers([1e-4, 0.0, 0.0, 1e-4]);
    Fix { stamp, x: Metres(x), y: Metres(y), covariance, heading: None }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_position_that_is_set_moves_map_and_a_new_navigator_still_knows_it() {
    let robot = Robot::new().await;
    let mesh = &robot.mesh;
    let positions = mesh.inbox(&key::POSITION.of(&r1()), 256).expect("positions");
    declared(mesh).await;
    robot.reaches("0.3,0").await;
    let before = asked(mesh).await;
    assert!(before.odom.pose.x.0 > 0.2 && before.map.distance(before.odom.pose).0 < 1e-9, "{before:?}");
    let there = Pose::new(10.0, -4.0, 1.0);
    let set = SetPosition { pose: there, covariance: None, stamp: None };
    let answer: Result<Position, Refusal> =
        mesh.ask(&key::SET_POSITION, Some(&r1()), &set, PATIENCE, Retry::Idempotent).await;
    let after = answer.expect("set");
    assert!(after.map.distance(there).0 < 1e-3, "{after:?}");
    assert!(after.odom.pose.distance(before.odom.pose).0 < 1e-3, "odom goes on: {after:?}");
    assert!((after.map_covariance.0[8].sqrt() - 1_f64.to_radians()).abs() < 1e-3, "{after:?}");
    // It is said to everybody as well, and Source hears it.
    let moved = |said: &Position| said.map.distance(there).0 < 0.01;
    hears(&positions, "the position is said", moved).await;
    let wrong = SetPosition { stamp: Some(Seconds(-1000.0)), ..set };
    let refused: Result<Position, Refusal> =
        mesh.ask(&key::SET_POSITION, Some(&r1()), &wrong, PATIENCE, Retry::Idempotent).await;
    assert!(refused.expect_err("nobody remembers that").to_string().contains("stamp of the position"));

    let pid = all_alive(mesh, &["navigator"]).await["navigator"].pid;
    kill(Pid::from_raw(i32::try_from(pid).expect("a pid")), Signal::SIGKILL).expect("killed");
    let again = robot.world.run("navigator");
    again.says("goes on from the position of").await;
    let later =
        hears(&positions, "the new one says where it is", |said| said.wheels.stamp > after.wheels.stamp);
    let later = later.await;
    assert!(
        later.map.distance(there).0 < 0.01 && later.odom.pose.distance(after.odom.pose).0 < 0.01,
        "{later:?}"
    );
    // It drives in `odom` from where it is.
    robot.drives_again().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_kidnapped_robot_stops_and_says_why() {
    let robot = Robot::navigated("method = \"ekf\"\n").await;
    let mesh = &robot.mesh;
    let events = mesh.inbox(&key::NAVIGATOR_EVENT.of(&r1()), 16).expect("events");
    let positions = mesh.inbox(&key::POSITION.of(&r1()), 256).expect("positions");
    let says = mesh.publisher(&key::FIX.of(&r1())).expect("a publisher");
    let eyes = robot.eyes().await;
    let mut go = eyes.under_way(|| robot.go(FAR)).await;
    // A fix that is right, and then what a hand does that carries the robot 3 m to the left.
    let truth = eyes.sees("the robot drives on", |_| true).await;
    says.put(&fix(truth.stamp, truth.pose.x.0, truth.pose.y.0), None).expect("said");
    while events.take().is_some() {}
    let noticed = loop {
        let truth = eyes.sees("the robot drives on", |_| true).await;
        says.put(&fix(truth.stamp, truth.pose.x.0, truth.pose.y.0 + 3.0), None).expect("said");
        if let Some(heard) = events.take() {
            break heard.message;
        }
    };
    let NavigatorEvent { event: Event::Kidnapped { distance, fixes, .. }, stop: true, why } = noticed else {
        panic!("{noticed:?}")
    };
    assert!((2.5..3.5).contains(&distance.0) && fixes >= 3, "{why}");
    go.ended().await.is(1, &["not reached", "fixes in a row put the robot"]);
    eyes.sees_rest().await;
    // `map` has moved by what the fixes said.
    let moved =
        hears(&positions, "odom lies elsewhere in map", |said: &Position| said.map_to_odom.y.0.abs() > 1.0);
    let moved = moved.await;
    assert!(moved.odom.pose.y.0.abs() < 0.5, "odom goes on: {moved:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_slipping_wheel_and_a_stuck_encoder_stop_the_robot_and_are_named() {
    // Wheels that lose their grip once in a metre or two, and an encoder whose cable comes off after a metre and a half.
    // A gyro is believed when the robot has turned, which it does first.
    let slip = "[slip]\nrate = 0.5\nlength = 0.3\nshare = 0.9\n";
    let stuck = "[encoders.stuck]\nleft = 1.5\nright = 0.0\n";
    for (params, name, words) in
        [(slip, "slip", "a wheel slips"), (stuck, "stuck-encoder", "the Left encoder stays")]
    {
        let robot = Robot::with_params(&[("emulator", params)]).await;
        let events = robot.mesh.inbox(&key::NAVIGATOR_EVENT.of(&r1()), 16).expect("events");
        let eyes = robot.eyes().await;
        // An encoder that has just stopped counting looks like a wheel that slips; moments later it is known better.
        driven(|| robot.go("0,0.5 8,0.5")).await.is(1, &["not reached", "the wheels turned by"]);
        let far = eyes.sees_rest().await.pose.x.0;
        assert!(far < 6.0, "{name}: it went on for {far} m");
        let said = hears(&events, "the event is said", |event| event.event.name() == name).await;
        assert!(said.stop && said.why.contains(words), "{said:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_whose_encoders_fall_silent_is_missed() {
    let robot = Robot::new().await;
    let events = robot.mesh.inbox(&key::NAVIGATOR_EVENT.of(&r1()), 16).expect("events");
    declared(&robot.mesh).await;
    robot.service("emulator").freeze().await;
    let missed = hears(&events, "the encoders are missed", |_| true).await;
    assert!(missed.stop && missed.why.contains("Encoders said nothing since"), "{missed:?}");
    robot.service("emulator").tell(Signal::SIGCONT);
    robot.knows_where_it_is().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_range_moves_the_map_of_a_filter() {
    let robot = Robot::navigated("method = \"ekf\"\n[ekf]\nstart_sd = 0.5\n").await;
    let mesh = &robot.mesh;
    let poses = mesh.inbox(&key::POSE.of(&r1()), 1).expect("poses");
    let says = mesh.publisher(&key::RANGE.of(&r1())).expect("a publisher");
    declared(mesh).await;
    // The robot stands 2 m from a point ahead, and is told that it is 2.2 m.
    let shifted = async {
        loop {
            let NavigatorData { stamp, .. } = poses.next().await.message;
            let (x, y, distance, sd) = (Metres(2.0), Metres(0.0), Metres(2.2), Metres(0.05));
            says.put(&Range { stamp, x, y, distance, sd }, None).expect("said");
            let position = asked(mesh).await;
            if position.map.x.0 < -0.1 {
                return position;
            }
        }
    };
    let position = within(PATIENCE, "the ranges are believed", shifted).await;
    assert!(position.odom.pose.x.0.abs() < 1e-6 && position.map.heading.abs() < Radians(0.1), "{position:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tap_that_comes_late_hears_the_past_first() {
    let robot = Robot::new().await;
    let eyes = robot.eyes().await;
    let now = eyes.sees_time(Seconds(2.0)).await.stamp;
    let tap =
        robot.world.done(&["tap", "axle/*/robot/encoders", "--since", "1s", "--count", "80", "--json"]).await;
    tap.is(0, &[]);
    let lines: Vec<serde_json::Value> =
        tap.out.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let stamps: Vec<f64> = lines.iter().filter_map(|line| line["value"]["stamp"].as_f64()).collect();
    assert_eq!(stamps.len(), 80, "50 of the past second, and then what comes: {}", tap.out);
    assert!(stamps.windows(2).all(|two| two[0] < two[1]), "in their order, and none twice: {stamps:?}");
    assert!(stamps.windows(2).all(|two| two[1] - two[0] < 0.5), "without a gap: {stamps:?}");
    assert!(stamps[0] > now.0 - 1.1, "not all that Source has: {stamps:?}");
    let live = lines.iter().filter(|line| line["meta"].is_object()).count();
    assert!((1..60).contains(&live), "{live} of them were heard live");
    robot.world.done(&["tap", "axle/**", "--since", "long"]).await.is(2, &["10s, 500ms, 2min"]);
}
