//! The sticks: for each robot one task that gives the drive the newest order, and waits for no older one.
//!
//! Powers come faster than a slow drive answers. Of several that wait only the newest is given, and a rest is an order like
//! any other: what was meant before it is never given after it.

use super::lock;
use axle_mesh::{Mesh, Retry};
use axle_schema::command::Done;
use axle_schema::differential_drive::{SetDrivePower, SetDriveSpeed};
use axle_schema::{Refusal, RobotId, Seconds, key};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::{Notify, oneshot};

/// The drive has this long to answer; it may wait for the gate.
const PATIENCE: Duration = Duration::from_millis(1500);
/// The most robots that can have a stick.
const MOST: usize = 64;

/// What the drive shall do.
#[derive(Clone, Copy, Debug)]
pub(super) enum Order {
    /// Powers of the wheels.
    Power(SetDrivePower),
    /// Speeds of the wheels.
    Speed(SetDriveSpeed),
}

/// An order, and who waits for the answer.
struct Given {
    order: Order,
    answer: oneshot::Sender<Result<(), Refusal>>,
}

/// What the drive says to an order.
pub(super) type Answer = oneshot::Receiver<Result<(), Refusal>>;

/// The stick of one robot: the order that waits.
#[derive(Default)]
struct Stick {
    next: Mutex<Option<Given>>,
    news: Notify,
}

/// The sticks of all robots.
pub(super) struct Sticks {
    mesh: Mesh,
    hold: Seconds,
    sticks: Mutex<BTreeMap<RobotId, Arc<Stick>>>,
}

impl Sticks {
    pub(super) fn new(mesh: &Mesh, hold: Seconds) -> Self {
        Self { mesh: mesh.clone(), hold, sticks: Mutex::default() }
    }
    /// Gives an order, at once; what comes back tells what the drive says to it. Where a newer order takes its place
    /// before it is given, nothing comes.
    pub(super) fn give(&self, robot: &RobotId, order: Order) -> Result<Answer, Refusal> {
        let hold = Some(self.hold);
        let order = match order {
            Order::Power(set) => Order::Power(SetDrivePower { hold, ..set }),
            Order::Speed(set) => Order::Speed(SetDriveSpeed { hold, ..set }),
        };
        let (answer, answered) = oneshot::channel();
        self.put(robot, Given { order, answer })?;
        Ok(answered)
    }
    /// Powers of zero.
    pub(super) async fn rest(&self, robot: &RobotId) {
        let (answer, answered) = oneshot::channel();
        let order = Order::Power(SetDrivePower::default());
        if self.put(robot, Given { order, answer }).is_ok()
            && let Ok(Err(refusal)) = answered.await
        {
            // It brakes by itself, since nothing renews its powers.
            tracing::debug!("{robot} was not told to rest: {refusal}");
        }
    }

    fn put(&self, robot: &RobotId, given: Given) -> Result<(), Refusal> {
        let mut sticks = lock(&self.sticks);
        if !sticks.contains_key(robot) && sticks.len() >= MOST {
            return Err(Refusal::Busy {
                holder: format!("{MOST} other robots are driven by hand: every stick"),
            });
        }
        let stick = sticks.entry(robot.clone()).or_insert_with(|| {
            let stick = Arc::<Stick>::default();
            tokio::spawn(follow(self.mesh.clone(), robot.clone(), Arc::clone(&stick)));
            stick
        });
        *lock(&stick.next) = Some(given);
        stick.news.notify_one();
        Ok(())
    }
}

/// Gives one order after the other to the drive of a robot. Never ends.
async fn follow(mesh: Mesh, robot: RobotId, stick: Arc<Stick>) {
    loop {
        stick.news.notified().await;
        let Some(Given { order, answer }) = lock(&stick.next).take() else { continue };
        let robot = Some(&robot);
        let done: Result<Done, Refusal> = match order {
            Order::Power(set) => mesh.ask(&key::DRIVE_POWER, robot, &set, PATIENCE, Retry::Never).await,
            Order::Speed(set) => mesh.ask(&key::DRIVE_SPEED, robot, &set, PATIENCE, Retry::Never).await,
        };
        // Nobody waits any more where the page has gone.
        drop(answer.send(done.map(|Done {}| ())));
    }
}
