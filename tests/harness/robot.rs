//! An emulated robot with everything that drives it, and eyes to watch it.

use super::{PATIENCE, Process, World, all_alive, declared, driven, within};
use axle_mesh::{Inbox, Mesh};
use axle_schema::command::{GateState, Motion};
use axle_schema::{EncodersData, NavigatorData, Pose, RobotId, Seconds, key};
use std::collections::BTreeMap;
use std::future::Future;

/// The robot of all tests.
pub(crate) fn r1() -> RobotId {
    RobotId::new("r1").expect("a robot")
}

/// What a robot needs to drive a way; each is a process.
pub(crate) const SERVICES: [&str; 7] =
    ["emulator", "source", "navigator", "pathfinder", "pathdriver", "d-corrector", "pilot"];

/// Slower than this, in m/s, a wheel stands.
const REST: f64 = 1e-3;

/// A robot and its services, each a process, on a router of their own.
pub(crate) struct Robot {
    pub(crate) router: Process,
    pub(crate) services: BTreeMap<&'static str, Process>,
    pub(crate) mesh: Mesh,
    pub(crate) world: World,
}

impl Robot {
    /// Starts everything, and waits until it is alive and knows where it is.
    pub(crate) async fn new() -> Self {
        Self::with(|world, name| world.run(name)).await
    }
    /// The same with parameters of its own for the navigator.
    pub(crate) async fn navigated(params: &str) -> Self {
        Self::with_params(&[("navigator", params)]).await
    }
    /// The same, with the texts of the parameter files of some services.
    pub(crate) async fn with_params(params: &[(&str, &str)]) -> Self {
        Self::with(|world, name| match params.iter().find(|(service, _)| *service == name) {
            Some((_, text)) => {
                let file = world.file(&format!("{name}.toml"), text);
                world.tool(&["run", name, "--host", "lab", "--params", &file])
            }
            None => world.run(name),
        })
        .await
    }
    async fn with(start: impl Fn(&World, &'static str) -> Process) -> Self {
        let world = World::new().await;
        let router = world.router();
        let services = SERVICES.map(|name| (name, start(&world, name))).into();
        let mesh = world.join().await;
        all_alive(&mesh, &SERVICES).await;
        let robot = Self { router, services, mesh, world };
        robot.knows_where_it_is().await;
        robot
    }
    /// Waits for a pose, and says it.
    pub(crate) async fn knows_where_it_is(&self) -> Pose {
        let poses = self.mesh.inbox(&key::POSE.of(&r1()), 1).expect("poses");
        within(PATIENCE, "the robot knows where it is", poses.next()).await.message.pose
    }
    pub(crate) fn service(&self, name: &str) -> &Process {
        &self.services[name]
    }
    /// Watches the robot from now on.
    pub(crate) async fn eyes(&self) -> Eyes {
        Eyes::of(&self.mesh).await
    }
    /// Drives to a point, and is told that it was reached.
    pub(crate) async fn reaches(&self, point: &str) {
        driven(|| self.go(point)).await.is(0, &["reached: 1 of 1 way points"]);
    }
    /// Starts `axle go`.
    pub(crate) fn go(&self, way: &str) -> Process {
        self.world.tool(&["go", way])
    }
}

/// Everything that tells what a robot does, in its own words and by its own clock.
pub(crate) struct Eyes {
    pub(crate) truth: Inbox<NavigatorData>,
    pub(crate) encoders: Inbox<EncodersData>,
    pub(crate) states: Inbox<GateState>,
}

impl Eyes {
    pub(crate) async fn of(mesh: &Mesh) -> Self {
        let robot = r1();
        let eyes = Self {
            truth: mesh.inbox(&key::TRUTH.of(&robot), 4096).expect("truth"),
            encoders: mesh.inbox(&key::ENCODERS.of(&robot), 4096).expect("encoders"),
            states: mesh.inbox(&key::GATE_STATE.of(&robot), 4096).expect("states"),
        };
        declared(mesh).await;
        eyes
    }
    /// The next truth of which this holds.
    pub(crate) async fn sees(&self, what: &str, is_so: impl Fn(&NavigatorData) -> bool) -> NavigatorData {
        within(PATIENCE, what, first(|| self.truth.next(), |heard| is_so(&heard.message))).await.message
    }
    /// Waits until the robot goes ahead at this speed or faster.
    pub(crate) async fn sees_speed(&self, speed: f64) -> NavigatorData {
        self.sees(&format!("the robot drives at {speed} m/s"), |truth| velocity(truth) >= speed).await
    }
    /// Starts what drives, and waits until the robot is fast; once more or twice if the machine was too busy for it.
    pub(crate) async fn under_way(&self, start: impl Fn() -> Process) -> Process {
        for _ in 0..3 {
            let mut go = start();
            tokio::select! {
                _ = self.sees_speed(0.3) => return go,
                ended = go.ended() => assert!(ended.was_late(), "{ended:?}"),
            }
        }
        panic!("this machine is too busy for a robot to drive")
    }
    /// Waits until the robot stands, by a truth that comes from now on.
    pub(crate) async fn sees_rest(&self) -> NavigatorData {
        while self.truth.take().is_some() {}
        self.sees("the robot stands", stands).await
    }
    /// Waits until the robot's clock shows `at`.
    pub(crate) async fn sees_time(&self, at: Seconds) -> NavigatorData {
        self.sees("the robot's clock goes on", |truth| truth.stamp >= at).await
    }
    /// The next state of the gate of which this holds.
    pub(crate) async fn hears(&self, what: &str, is_so: impl Fn(&GateState) -> bool) -> GateState {
        within(PATIENCE, what, first(|| self.states.next(), |heard| is_so(&heard.message))).await.message
    }
    /// The next state of a gate whose wheels stand.
    pub(crate) async fn hears_standing(&self) -> GateState {
        self.hears("the gate says that the wheels stand", |state| state.motion == Motion::Standing).await
    }
    /// Every truth that waits to be taken.
    pub(crate) fn truths(&self) -> Vec<NavigatorData> {
        std::iter::from_fn(|| self.truth.take()).map(|heard| heard.message).collect()
    }
}

async fn first<T, F: Future<Output = T>>(mut next: impl FnMut() -> F, is_so: impl Fn(&T) -> bool) -> T {
    loop {
        let item = next().await;
        if is_so(&item) {
            return item;
        }
    }
}

/// The true speed ahead.
pub(crate) fn velocity(truth: &NavigatorData) -> f64 {
    truth.twist.map_or(0.0, |twist| twist.v.0)
}

/// Whether the robot truly stands.
pub(crate) fn stands(truth: &NavigatorData) -> bool {
    truth.twist.is_some_and(|twist| twist.v.0.abs() < REST && twist.omega.0.abs() < REST)
}
