//! Every corrector of the catalogue drives a robot through the real mesh.

use crate::harness::{Robot, all_alive, driven};

/// Those that a robot of these tests does not have anyway; each follows the plans of its own kind.
const OTHERS: [&str; 5] =
    ["g-corrector", "w-corrector", "arc-corrector", "pursuit-corrector", "ltv-corrector"];
/// How far from its goal the robot may truly stand, m.
const NEAR: f64 = 0.05;

#[tokio::test(flavor = "multi_thread")]
async fn every_corrector_reaches_a_point_around_the_corner() {
    let robot = Robot::new().await;
    let _processes = OTHERS.map(|name| robot.world.run(name));
    all_alive(&robot.mesh, &OTHERS).await;
    let eyes = robot.eyes().await;
    // To and fro, so that odometry does not go astray.
    let corners = [[0.4, 0.0], [0.4, 0.3], [0.0, 0.3], [0.0, 0.0]];
    let mut next = 0;
    for name in ["d-corrector"].into_iter().chain(OTHERS) {
        let [a, b] = [corners[next % 4], corners[(next + 1) % 4]];
        next += 2;
        let way = format!("{},{} {},{}", a[0], a[1], b[0], b[1]);
        let words = &["reached: 2 of 2 way points"];
        driven(|| robot.world.tool(&["go", &way, "--corrector", name])).await.is(0, words);
        let pose = eyes.sees_rest().await.pose;
        let far = (pose.x.0 - b[0]).hypot(pose.y.0 - b[1]);
        assert!(far < NEAR, "{name} ended {far} m from {b:?}, at {pose:?}");
    }
}
