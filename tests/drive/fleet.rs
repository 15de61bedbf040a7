//! Three robots on one floor, every service a process: they pass an aisle in opposite directions and cross it, and one
//! of them waits for a person.

use crate::harness::{PATIENCE, Process, World, eventually, within};
use axle_mesh::{Inbox, Mesh, Retry};
use axle_schema::traffic::{TrafficAsk, TrafficState};
use axle_schema::{NavigatorData, Pose, RobotId, key};
use std::time::Duration;

/// The tours last some 40 s, on a machine that has time for them.
const TOURS: Duration = Duration::from_secs(180);
const NAMES: [&str; 3] = ["r1", "r2", "r3"];

fn robots() -> [RobotId; 3] {
    NAMES.map(|name| RobotId::new(name).expect("a name"))
}

async fn account(mesh: &Mesh) -> TrafficState {
    mesh.ask(&key::TRAFFIC, None, &TrafficAsk {}, PATIENCE, Retry::Idempotent).await.expect("Traffic answers")
}

/// Waits until Traffic's account is so.
async fn traffic_says(mesh: &Mesh, what: &str, is_so: impl Fn(&TrafficState) -> bool) -> TrafficState {
    let asking = async {
        loop {
            let state = account(mesh).await;
            if is_so(&state) {
                return state;
            }
        }
    };
    within(TOURS, what, asking).await
}

/// Where the robots really are, watched as long as they drive.
struct Watch {
    truths: [Inbox<NavigatorData>; 3],
    places: [Option<Pose>; 3],
    nearest: f64,
}

impl Watch {
    fn of(mesh: &Mesh) -> Self {
        let truths = robots().map(|robot| mesh.inbox(&key::TRUTH.of(&robot), 4096).expect("truth"));
        Self { truths, places: [None; 3], nearest: f64::INFINITY }
    }
    /// Takes what has come; the robots say it at the same pace.
    fn look(&mut self) {
        loop {
            let mut news = false;
            for (truth, place) in self.truths.iter().zip(&mut self.places) {
                if let Some(heard) = truth.take() {
                    *place = Some(heard.message.pose);
                    news = true;
                }
            }
            if !news {
                return;
            }
            for (number, place) in self.places.iter().enumerate() {
                for other in &self.places[number + 1..] {
                    if let (Some(place), Some(other)) = (place, other) {
                        self.nearest = self.nearest.min(place.distance(*other).0);
                    }
                }
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn three_robots_pass_an_aisle_cross_it_and_wait_for_a_person() {
    let world = World::new().await;
    let topology = concat!(env!("CARGO_MANIFEST_DIR"), "/../../deploy/topologies/fleet.toml");
    let _up = world.axle(&["up", topology, "--listen", &world.endpoint]);
    let mesh = world.join().await;
    traffic_says(&mesh, "Traffic knows three robots", |state| state.robots.len() == 3).await;
    let mut watch = Watch::of(&mesh);

    let go = |robot: &str, way: &str, more: &[&str]| -> Process {
        world.tool(&[&["go", way, "--robot", robot], more].concat())
    };
    // The third one crosses the aisle, is loaded on the other side, and goes back.
    let mut third = go("r3", "2,1.2 2,-1.5", &["--confirm", "1"]);
    let begun = |name: &'static str| {
        move |state: &TrafficState| {
            state.robots.iter().any(|mover| mover.robot.as_str() == name && mover.pieces > 0)
        }
    };
    traffic_says(&mesh, "r3 has told its way", begun("r3")).await;
    let mut first = go("r1", "3,0 3,1.2", &[]);
    traffic_says(&mesh, "r1 has told its way", begun("r1")).await;
    let mut second = go("r2", "1,0 1,1.2", &[]);
    // Two want through one aisle: one of them waits, and why is told. A Traffic that has just listened gives to whoever
    // asks first, so that it may be either.
    let waiting = |state: &TrafficState| {
        let found = state.robots.iter().find(|mover| {
            mover.robot.as_str() != "r3" && mover.passed == mover.until && !mover.waits.is_empty()
        });
        found.map(|mover| mover.robot.to_string())
    };
    let state = traffic_says(&mesh, "r1 or r2 waits", |state| waiting(state).is_some()).await;
    let who = waiting(&state).expect("it waits");
    world.done(&["traffic", &who]).await.is(0, &[]);
    let why = world.done(&["why", &who, "--for", "1"]).await;
    let lines = &why.is(0, &[]).out;
    let words = [format!("{who} stands still"), format!("{who} waits for r")];
    assert!(words.iter().all(|word| lines.contains(word)), "{lines}");
    let table = world.done(&["traffic"]).await;
    table.is(0, &[]);
    assert!(NAMES.iter().all(|name| table.out.contains(name)), "{}", table.out);

    // Confirmed before it waits, nothing is confirmed; then it is, as soon as it asks.
    let words = mesh.inbox(&key::GO_PROGRESS.of(&robots()[2]), 4096).expect("progress");
    let asks = async {
        loop {
            let progress = words.next().await.message;
            if progress.waiting.is_some_and(|why| why.contains("axle confirm --robot r3")) {
                return;
            }
        }
    };
    within(TOURS, "r3 waits for a person", asks).await;
    watch.look();
    world.done(&["confirm", "--robot", "r3"]).await.is(0, &["r3 may drive on"]);
    world.done(&["confirm", "--robot", "r1"]).await.is(1, &["a question of r1 to a person"]);

    for (name, process, points) in [("r1", &mut first, 2), ("r2", &mut second, 2), ("r3", &mut third, 2)] {
        let ended = process.ended_within(TOURS).await;
        assert_eq!(ended.code, Some(0), "{name}: {}", ended.err);
        assert!(ended.err.contains(&format!("reached: {points} of {points}")), "{name}: {}", ended.err);
        watch.look();
    }
    assert!(watch.nearest >= 0.5, "two robots came as near as {} m", watch.nearest);
    assert!(watch.places.iter().all(Option::is_some), "all of them were seen");
    let at_rest = eventually("all truths", || {
        watch.look();
        watch.places.iter().copied().collect::<Option<Vec<Pose>>>()
    })
    .await;
    for (place, (x, y)) in at_rest.iter().zip([(3.0, 1.2), (1.0, 1.2), (2.0, -1.5)]) {
        let left = (place.x.0 - x).hypot(place.y.0 - y);
        assert!(left < 0.1, "{left} m from its goal");
    }
}
