//! What a demonstration hears while the robot drives.

use axle_mesh::{Inbox, Mesh};
use axle_schema::task::{CorrectorProgress, Task};
use axle_schema::{Message, NavigatorData, Plan, RobotId, key};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;
use tokio::task::JoinHandle;

/// The most samples of one stream that are kept: an hour at 50 Hz.
const MOST: usize = 200_000;
/// Slower than this, in m/s and rad/s, a robot stands.
const REST: f64 = 1e-3;

/// Everything that was heard.
#[derive(Default)]
pub(crate) struct Seen {
    /// Where the robot was.
    pub(crate) truth: Vec<NavigatorData>,
    /// Where it believed to be.
    pub(crate) poses: Vec<NavigatorData>,
    /// What the corrector did at each beat.
    pub(crate) beats: Vec<CorrectorProgress>,
    /// The plan it followed.
    pub(crate) plan: Option<Plan>,
}

/// Listens until it is dropped.
pub(crate) struct Watch {
    seen: Arc<Mutex<Seen>>,
    news: Arc<Notify>,
    listening: Vec<JoinHandle<()>>,
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.listening.iter().for_each(JoinHandle::abort);
    }
}

impl Watch {
    /// Begins to listen.
    pub(crate) fn start(mesh: &Mesh, robot: &RobotId, corrector: &'static str) -> anyhow::Result<Self> {
        let mut watch = Self { seen: Arc::default(), news: Arc::default(), listening: Vec::new() };
        watch.listen(mesh.inbox(&key::TRUTH.of(robot), 256)?, |seen, data| keep(&mut seen.truth, data));
        watch.listen(mesh.inbox(&key::POSE.of(robot), 256)?, |seen, data| keep(&mut seen.poses, data));
        let beats = mesh.inbox(&key::corrector_progress(corrector).of(robot), 256)?;
        watch.listen(beats, |seen, beat| keep(&mut seen.beats, beat));
        let plans = mesh.inbox(&key::GO_PLAN.of(robot), 4)?;
        watch.listen(plans, |seen, Task { plan, .. }: Task<Plan>| seen.plan = Some(plan));
        Ok(watch)
    }

    fn listen<M: Message>(&mut self, inbox: Inbox<M>, store: impl Fn(&mut Seen, M) + Send + 'static) {
        let (seen, news) = (Arc::clone(&self.seen), Arc::clone(&self.news));
        self.listening.push(tokio::spawn(async move {
            loop {
                let heard = inbox.next().await;
                store(&mut seen.lock().unwrap_or_else(PoisonError::into_inner), heard.message);
                news.notify_one();
            }
        }));
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until truth and estimate were heard.
    pub(crate) async fn sees_the_robot(&self) {
        self.wait_for(|seen| !seen.truth.is_empty() && !seen.poses.is_empty()).await;
    }

    /// Waits until the robot really stands.
    pub(crate) async fn sees_rest(&self) {
        let stands = |data: &NavigatorData| {
            data.twist.is_some_and(|twist| twist.v.0.abs() < REST && twist.omega.0.abs() < REST)
        };
        // What was heard before this moment may be from before the robot braked.
        let before = self.seen().truth.len();
        self.wait_for(|seen| seen.truth.len() > before && seen.truth.last().is_some_and(stands)).await;
    }

    async fn wait_for(&self, is_so: impl Fn(&Seen) -> bool) {
        while !is_so(&self.seen()) {
            self.news.notified().await;
        }
    }

    /// Everything that was heard.
    pub(crate) fn end(self) -> Seen {
        std::mem::take(&mut self.seen())
    }
}

fn keep<M>(list: &mut Vec<M>, item: M) {
    if list.len() < MOST {
        list.push(item);
    }
}
