//! Every corrector of the catalogue drives a robot through the real mesh.

use crate::harness::{Robot, all_alive, driven, stands};
use axle_pathdriver::PathdriverParams;
use axle_schema::{Sides, WayTask};
use axle_sim::{Brief, METRICS, World, seats};

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

/// A square for a robot whose wheels run 5 % too fast and 5 % too slow. Correctors that follow wheels keep the heading and
/// those that steer by the pose do not; a corrector that follows a drive in time is done before those that follow a path.
const SQUARE: &str = "0.8,0 0.8,0.8 0,0.8 0,0";
const GAIN: Sides<f64> = Sides { left: 1.05, right: 0.95 };
const RIVALS: [&str; 4] = ["d-corrector", "g-corrector", "w-corrector", "arc-corrector"];
/// What is compared, and by how much two must differ in virtual time to be told apart in the mesh too.
const MEASURES: [(&str, f64); 2] = [("heading_error_rad", 0.03), ("time_s", 2.0)];

#[tokio::test(flavor = "multi_thread")]
async fn the_mesh_ranks_the_correctors_as_virtual_time_does() {
    let mut world = World::clean(3);
    world.robot.motors.gain = GAIN;
    let way = WayTask::parse(SQUARE).expect("a way");
    let brief = Brief::along(way, &PathdriverParams::default()).expect("a plan");
    let goal = brief.goal();
    let in_virtual_time = RIVALS.map(|name| {
        let seat = seats().into_iter().find(|seat| seat.name == name).expect("a corrector");
        let run = axle_sim::run(&seat, &brief, &world).expect("a run");
        MEASURES.map(|(measure, _)| {
            let index = METRICS.iter().position(|metric| metric.name == measure);
            run.values[index.expect("a measure")]
        })
    });

    let params = toml::to_string(&world.robot).expect("parameters");
    let mut in_the_mesh = Vec::new();
    for name in RIVALS {
        // Each begins where the others have begun.
        let robot = Robot::with_params(&[("emulator", &params)]).await;
        let _process = (name != "d-corrector").then(|| robot.world.run(name));
        all_alive(&robot.mesh, &[name]).await;
        let eyes = robot.eyes().await;
        let words = &["reached: 4 of 4 way points"];
        driven(|| robot.world.tool(&["go", SQUARE, "--corrector", name])).await.is(0, words);
        let truths = eyes.truths();
        let end = eyes.sees_rest().await.pose;
        let moving: Vec<f64> = truths.iter().filter(|at| !stands(at)).map(|at| at.stamp.0).collect();
        let time = moving.last().expect("it has moved") - moving[0];
        in_the_mesh.push([(end.heading - goal.heading).wrapped().0.abs(), time]);
    }

    for (measure, (name, apart)) in MEASURES.into_iter().enumerate() {
        let mut compared = 0;
        for a in 0..RIVALS.len() {
            for b in 0..RIVALS.len() {
                if in_virtual_time[b][measure] > in_virtual_time[a][measure] + apart {
                    compared += 1;
                    assert!(
                        in_the_mesh[a][measure] < in_the_mesh[b][measure],
                        "{name}: {} beats {} in virtual time, {in_virtual_time:?}, and not in the mesh, {in_the_mesh:?}",
                        RIVALS[a],
                        RIVALS[b]
                    );
                }
            }
        }
        assert!(compared >= 3, "{name}: nothing to compare: {in_virtual_time:?}");
    }
}
