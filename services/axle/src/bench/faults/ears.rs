//! Everything that is heard of a robot while a fault is there, each with the moment at which it came.
//!
//! Three sessions listen: at the eyes' router, which no fault reaches, at the robot's and at the workstation's.

use super::history::{Event, What};
use axle_mesh::clock::wall_nanoseconds;
use axle_mesh::{Comings, Inbox, Mesh, Raw};
use axle_schema::command::{Command, GateState};
use axle_schema::task::{CorrectorProgress, PilotProgress};
use axle_schema::{EncodersData, Message, NavigatorData, RobotId, decode, key};
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep};

/// What may wait to be taken: minutes of it.
const WAITING: usize = 32_768;
/// How often it is taken while something is waited for.
const LOOK: Duration = Duration::from_millis(4);
/// The corrector of the bench.
const CORRECTOR: &str = "d-corrector";

/// Ears at three places.
pub(super) struct Ears {
    truth: Inbox<NavigatorData>,
    states: Inbox<GateState>,
    encoders: Inbox<EncodersData>,
    commands: Inbox<Command>,
    pilot: Inbox<PilotProgress>,
    corrector: Inbox<CorrectorProgress>,
    poses: Inbox<NavigatorData>,
    comings: mpsc::Receiver<Event>,
    watching: Vec<JoinHandle<()>>,
    /// What was heard since it was taken last.
    pub(super) events: Vec<Event>,
    pub(super) state: Option<GateState>,
    pub(super) truly: Option<NavigatorData>,
    pub(super) pose: Option<NavigatorData>,
    /// Who is there, as the robot's and the workstation's router say.
    pub(super) present: BTreeMap<(&'static str, String), bool>,
}

/// Now, as events are stamped.
pub(super) fn now() -> f64 {
    seconds(wall_nanoseconds())
}

#[allow(clippy::cast_precision_loss, reason = "to a tenth of a microsecond")]
fn seconds(nanoseconds: u64) -> f64 {
    nanoseconds as f64 / 1e9
}

fn take<M: Message>(inbox: &Inbox<M>, events: &mut Vec<Event>, what: impl Fn(M, &Raw) -> What) {
    while let Some(raw) = inbox.take_raw() {
        // What cannot be read is counted by whoever it was for.
        if let Ok(message) = decode::<M>(&raw.payload) {
            let what = what(message, &raw);
            events.push(Event { at: seconds(raw.received), what });
        }
    }
}

impl Ears {
    pub(super) fn of(meshes: &BTreeMap<&'static str, Mesh>, robot: &RobotId) -> anyhow::Result<Self> {
        let (eyes, near, far) = (&meshes["eyes"], &meshes["onboard"], &meshes["workstation"]);
        let (sender, comings) = mpsc::channel(1024);
        let mut watching = Vec::new();
        for (place, mesh) in [("onboard", near), ("workstation", far)] {
            let watched = mesh.watch_presence()?;
            watching.push(tokio::spawn(watch(place, watched, sender.clone())));
        }
        Ok(Self {
            truth: eyes.inbox(&key::TRUTH.of(robot), WAITING)?,
            states: near.inbox(&key::GATE_STATE.of(robot), WAITING)?,
            encoders: near.inbox(&key::ENCODERS.of(robot), WAITING)?,
            commands: near.inbox(&key::COMMAND.of(robot), WAITING)?,
            pilot: far.inbox(&key::GO_PROGRESS.of(robot), WAITING)?,
            corrector: far.inbox(&key::corrector_progress(CORRECTOR).of(robot), WAITING)?,
            poses: far.inbox(&key::POSE.of(robot), WAITING)?,
            comings,
            watching,
            events: Vec::new(),
            state: None,
            truly: None,
            pose: None,
            present: BTreeMap::new(),
        })
    }

    /// Takes what came.
    pub(super) fn look(&mut self) {
        let from = self.events.len();
        let events = &mut self.events;
        take(&self.truth, events, |data, _| What::Truth(data));
        take(&self.states, events, |state, _| What::State(Box::new(state)));
        take(&self.encoders, events, |data, raw| What::Reading { data, meta: raw.meta() });
        take(&self.commands, events, |command, raw| What::Command { command, meta: raw.meta() });
        take(&self.pilot, events, |said, _| What::Pilot(Box::new(said)));
        take(&self.corrector, events, |said, _| What::Corrector(Box::new(said)));
        take(&self.poses, events, |data, _| What::Pose(data));
        while let Ok(event) = self.comings.try_recv() {
            events.push(event);
        }
        for event in &self.events[from..] {
            match &event.what {
                What::Truth(data) => self.truly = Some(*data),
                What::State(state) => self.state = Some((**state).clone()),
                What::Pose(data) => self.pose = Some(*data),
                What::Came { place, service, came } => {
                    self.present.insert((place, service.clone()), *came);
                }
                _ => {}
            }
        }
    }

    /// Forgets how things stood: what is known from now on was said from now on.
    pub(super) fn forget(&mut self) {
        self.look();
        (self.state, self.truly, self.pose) = (None, None, None);
    }

    /// Waits until `look` finds something in what was heard.
    ///
    /// # Errors
    /// Names what did not come in time.
    pub(super) async fn until<T>(
        &mut self,
        patience: Duration,
        what: &str,
        mut look: impl FnMut(&Self) -> Option<T>,
    ) -> anyhow::Result<T> {
        let end = Instant::now() + patience;
        loop {
            self.look();
            if let Some(found) = look(self) {
                return Ok(found);
            }
            if Instant::now() >= end {
                anyhow::bail!("not within {:.1} s: {what}", patience.as_secs_f64());
            }
            sleep(LOOK).await;
        }
    }
}

impl Drop for Ears {
    fn drop(&mut self) {
        for watching in &self.watching {
            watching.abort();
        }
    }
}

/// Stamps comings and goings as they are told.
async fn watch(place: &'static str, mut comings: Comings, sender: mpsc::Sender<Event>) {
    loop {
        let (presence, came) = comings.next().await;
        let event = Event { at: now(), what: What::Came { place, service: presence.service, came } };
        if sender.send(event).await.is_err() {
            return;
        }
    }
}
