//! Taps: what they show, what they leave out, and what they say when there is nothing to show.

use crate::harness::{Robot, World};
use serde_json::Value;

#[tokio::test(flavor = "multi_thread")]
async fn a_tap_shows_fields_filters_rates_and_ages_and_ends_when_it_shall() {
    let robot = Robot::new().await;
    let world = &robot.world;
    let pose = "axle/r1/navigator/pose";
    let field = world.done(&["tap", pose, "--field", ".pose.x", "--count", "3"]).await;
    let lines: Vec<_> = field.is(0, &[]).out.lines().collect();
    assert_eq!(lines.len(), 3, "{field:?}");
    assert!(lines.iter().all(|line| line.contains(".pose.x")), "{lines:?}");
    assert!(lines[2].ends_with(|c| "▁▂▃▄▅▆▇█".contains(c)), "{lines:?}");
    let field = world.done(&["tap", pose, "--field", ".pose.x", "--count", "1", "--json"]).await;
    assert!(field.is(0, &[]).json()["value"].is_number());
    let nothing = world.done(&["tap", pose, "--where", ".pose.x > 100", "--for", "700ms"]).await;
    assert_eq!(nothing.is(0, &[]).out, "");
    let all =
        world.done(&["tap", pose, "--where", ".pose.x < 100 and .stamp > 0", "--count", "2", "--json"]).await;
    for line in all.is(0, &[]).out.lines() {
        let line: Value = serde_json::from_str(line).expect("JSON");
        assert!(line["value"]["stamp"].as_f64() > Some(0.0), "{line}");
    }
    let age = world.done(&["tap", pose, "--age", "--for", "1.2s", "--json"]).await;
    let first: Value =
        serde_json::from_str(age.is(0, &[]).out.lines().next().expect("a line")).expect("JSON");
    // One computer has one clock: what is said is heard within a moment, even on a loaded machine.
    assert!((0.0..5.0).contains(&first["age_s"].as_f64().expect("an age")), "{first}");
    assert!(first["uncertainty_s"].as_f64() >= Some(0.0), "{first}");
    let age = world.done(&["tap", pose, "--age", "--for", "1.2s"]).await;
    assert!(age.is(0, &[]).out.contains("ms old ±"), "{age:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_that_nobody_says_is_told_after_two_seconds_with_near_names() {
    let robot = Robot::new().await;
    let near = robot.world.done(&["tap", "axle/r1/navigator/poes", "--for", "4s"]).await;
    near.is(
        0,
        &["nothing was said on axle/r1/navigator/poes for 2 s", "the nearest names: axle/r1/navigator/pose"],
    );
    assert_eq!(near.out, "");
    let silent = robot.world.done(&["tap", "axle/r1/d-corrector/progress", "--for", "4s"]).await;
    silent.is(0, &["the name is right"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_arguments_of_a_tap_are_refused_without_a_mesh() {
    let world = World::new().await;
    for (args, words) in [
        (["tap", "axle/**", "--where", "pose.x > 1"], "is no field"),
        (["tap", "axle/**", "--where", ".pose.x"], "is no condition"),
        (["tap", "axle/**", "--field", "x"], "is no field"),
        (["tap", "axle/**", "--for", "soon"], "write a time"),
    ] {
        world.done(&args).await.is(2, &[words]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_said_now_is_drawn_as_a_picture() {
    let robot = Robot::new().await;
    let file = robot.world.path().join("now.png");
    let name = file.display().to_string();
    let drawn = robot.world.done(&["chart", "axle/r1/**", "--for", "1", "--out", &name]).await;
    drawn.is(0, &["listening to axle/r1/**", "drawn:"]);
    let bytes = std::fs::read(&file).expect("a picture");
    assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n") && bytes.len() > 4000, "{} bytes", bytes.len());
    let svg = robot.world.done(&["chart", "axle/r1/navigator/pose", "--for", "1"]).await;
    assert!(svg.is(0, &[]).out.starts_with("<svg"), "{}", svg.out);
    let nothing = robot.world.done(&["chart", "axle/r7/**", "--for", "0.5"]).await;
    nothing.is(1, &["nothing was said on axle/r7/**"]);
    robot.world.done(&["chart", "axle//x"]).await.is(2, &["axle//x"]);
}
