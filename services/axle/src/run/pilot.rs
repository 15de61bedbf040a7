//! Pilot as a process: takes a task, asks the planners, hands the plan to a corrector, says how far it is.
//!
//! A robot of a fleet, and a task with loading points, is driven stage by stage: that is in `trip`.

mod trip;

use super::Context;
use crate::catalog::{self, Takes};
use crate::params::load;
use axle_mesh::{Asked, Mesh, Publisher, Retry, random_bits};
use axle_pilot::{Journey, PilotParams};
use axle_schema::command::Done;
use axle_schema::key;
use axle_schema::meta::Cause;
use axle_schema::task::{Accepted, Cancel, CorrectorProgress, GoAsk, Phase, PilotProgress, Task};
use axle_schema::traffic::{Clearance, Confirm};
use axle_schema::{
    Drive, DriveAsk, NavigatorData, NavigatorEvent, Plan, PlanAsk, Pose, Refusal, RobotId, Seconds, TaskId,
    WayTask,
};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use trip::Trip;

/// Poses that may wait for the next beat.
const POSES: usize = 64;
/// How often progress is said while nothing changes, and an unheard order is repeated.
const PACE: Seconds = Seconds(0.1);
/// Slower than this, in m/s and rad/s, the robot stands, and a plan may begin where it is.
const REST: f64 = 1e-3;
/// A robot whose task was taken away stands within this time, if nobody else drives it.
const BRAKING: Seconds = Seconds(2.0);

/// Pilots until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params = load_params(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = &context.mesh;
    let goes = mesh.server::<GoAsk, Accepted>(&key::GO.of(Some(&robot)))?;
    let cancels = mesh.server::<Cancel, Done>(&key::GO_CANCEL.of(Some(&robot)))?;
    let confirms = mesh.server::<Confirm, Done>(&key::CONFIRM.of(Some(&robot)))?;
    let poses = mesh.inbox(&key::POSE.of(&robot), POSES)?;
    let events = mesh.inbox(&key::NAVIGATOR_EVENT.of(&robot), 16)?;
    let (mut pilot, mut words, mut answers) = Pilot::new(mesh.clone(), robot, params)?;
    let _visible = context.ready()?;
    let mut beat = mesh.beat(PACE);
    loop {
        let event = tokio::select! {
            asked = goes.next() => Event::Go(asked),
            asked = cancels.next() => Event::Cancel(asked),
            heard = events.next() => Event::Noticed(heard.message),
            Some(said) = words.recv() => Event::Said(said),
            asked = confirms.next() => Event::Confirm(asked),
            Some(event) = answers.recv() => event,
            _ = beat.next() => Event::Beat,
            () = context.stop.wait() => Event::Stop,
        };
        // Poses wait for whatever happens next: nothing is decided on an old one, and none wakes the process up.
        while let Some(heard) = poses.take() {
            pilot.see(heard.message);
        }
        if !pilot.handle(event, mesh.clock().now()) {
            return Ok(());
        }
    }
}

/// What can happen to the pilot.
enum Event {
    Go(Asked<GoAsk, Accepted>),
    Cancel(Asked<Cancel, Done>),
    Noticed(NavigatorEvent),
    Said(CorrectorProgress),
    Confirm(Asked<Confirm, Done>),
    Planned(TaskId, Result<Planned, Refusal>),
    /// The stage of a trip is planned.
    Staged(TaskId, Result<Planned, Refusal>),
    /// Traffic has answered.
    Cleared(TaskId, Result<Clearance, Refusal>),
    Beat,
    Stop,
}

/// Reads the parameters; the corrector that they name must be one of the catalogue.
fn load_params(file: Option<&Path>) -> anyhow::Result<PilotParams> {
    let params: PilotParams = load(file)?;
    if catalog::find(&params.corrector).is_none_or(|entry| entry.takes.is_none()) {
        let file = file.unwrap_or_else(|| Path::new("parameters"));
        let refusal = unknown_corrector(&params.corrector);
        return Err(crate::out::usage(format!("{}: {refusal}", file.display())));
    }
    Ok(params)
}

/// Whether the pilot can begin with this file.
pub(crate) fn check(file: Option<&Path>) -> anyhow::Result<()> {
    load_params(file).map(drop)
}

fn unknown_corrector(name: &str) -> Refusal {
    let got = name.chars().take(64).collect();
    Refusal::Unknown { what: "corrector".into(), got, known: catalog::corrector_names() }
}

fn stands(seen: &NavigatorData) -> bool {
    seen.twist.is_none_or(|twist| twist.v.0.abs() <= REST && twist.omega.0.abs() <= REST)
}

/// The lines to one corrector.
struct Line {
    orders: Orders,
    cancels: Publisher<Cancel>,
}

/// Where a corrector hears its tasks, by the kind of plan that it follows.
enum Orders {
    Drive(Publisher<Task<Drive>>),
    Plan(Publisher<Task<Plan>>),
}

impl Orders {
    fn of(mesh: &Mesh, robot: &RobotId, corrector: &'static str, takes: Takes) -> anyhow::Result<Self> {
        Ok(match takes {
            Takes::Drive => Self::Drive(mesh.publisher(&key::corrector_task(corrector).of(robot))?),
            Takes::Plan => Self::Plan(mesh.publisher(&key::corrector_task(corrector).of(robot))?),
        })
    }
    fn put(&self, order: &Order, cause: Option<Cause>) -> Result<Cause, Refusal> {
        match self {
            Self::Drive(orders) => orders.put(&order.drive, cause),
            Self::Plan(orders) => orders.put(&order.plan, cause),
        }
    }
}

/// A task in the words of every corrector.
struct Order {
    plan: Task<Plan>,
    drive: Task<Drive>,
}

/// The plans of a task.
struct Planned {
    plan: Plan,
    drive: Drive,
}

struct Pilot {
    mesh: Mesh,
    robot: RobotId,
    params: PilotParams,
    lines: BTreeMap<&'static str, Line>,
    progress: Publisher<PilotProgress>,
    ways: Publisher<Task<WayTask>>,
    plans: Publisher<Task<Plan>>,
    drives: Publisher<Task<Drive>>,
    pose: Option<NavigatorData>,
    journey: Option<Journey>,
    /// A way that waits for the robot to stand, and since when: a plan begins at rest, where the robot really is.
    resting: Option<(WayTask, Seconds)>,
    /// The task that ended last, and its corrector.
    dismissed: Option<(String, TaskId)>,
    planning: Option<JoinHandle<()>>,
    /// Where planners and Traffic answer.
    answers: mpsc::Sender<Event>,
    /// The loading points of the task.
    confirm: Vec<u32>,
    /// The task in stages, if it is driven so.
    trip: Option<Trip>,
    /// Where Traffic was told that the robot stands without a task.
    parked: Option<(TaskId, Pose)>,
    /// When Traffic is asked again.
    claim_due: Seconds,
    /// The order that the corrector has not answered yet.
    order: Option<Order>,
    /// The latest of way, plan and movements of the task.
    cause: Option<Cause>,
}

/// What correctors say, and what planners and Traffic answer.
type Words = mpsc::Receiver<CorrectorProgress>;
type Answers = mpsc::Receiver<Event>;

impl Pilot {
    fn new(mesh: Mesh, robot: RobotId, params: PilotParams) -> anyhow::Result<(Self, Words, Answers)> {
        let mut lines = BTreeMap::new();
        let (word, words) = mpsc::channel(32);
        let (answer, answers) = mpsc::channel(4);
        for entry in catalog::CATALOG {
            let Some(takes) = entry.takes else { continue };
            let line = Line {
                orders: Orders::of(&mesh, &robot, entry.name, takes)?,
                cancels: mesh.publisher(&key::corrector_cancel(entry.name).of(&robot))?,
            };
            let progress = mesh.inbox(&key::corrector_progress(entry.name).of(&robot), 32)?;
            let word = word.clone();
            tokio::spawn(async move { while word.send(progress.next().await.message).await.is_ok() {} });
            lines.insert(entry.name, line);
        }
        let pilot = Self {
            progress: mesh.publisher(&key::GO_PROGRESS.of(&robot))?,
            ways: mesh.publisher(&key::GO_WAY.of(&robot))?,
            plans: mesh.publisher(&key::GO_PLAN.of(&robot))?,
            drives: mesh.publisher(&key::GO_DRIVE.of(&robot))?,
            mesh,
            robot,
            params,
            lines,
            pose: None,
            journey: None,
            resting: None,
            dismissed: None,
            planning: None,
            answers: answer,
            confirm: Vec::new(),
            trip: None,
            parked: None,
            claim_due: Seconds::ZERO,
            order: None,
            cause: None,
        };
        Ok((pilot, words, answers))
    }

    /// Does what an event asks for; `false` when the pilot is to stop.
    fn handle(&mut self, event: Event, now: Seconds) -> bool {
        match event {
            Event::Go(asked) => {
                let answer = asked.question().and_then(|ask| self.go(ask, now));
                asked.reply(answer);
            }
            Event::Cancel(asked) => {
                let answer = asked.question().and_then(|cancel| self.cancel(cancel.id, now));
                asked.reply(answer);
            }
            Event::Confirm(asked) => {
                let answer = asked.question().and_then(|confirm| self.confirm(&confirm));
                asked.reply(answer);
            }
            // Nobody knows any more where the robot is on its way, or whether its wheels do what they are told.
            Event::Noticed(noticed) if noticed.stop => {
                self.end(Phase::Failed(Refusal::Failed { why: noticed.why }), now);
            }
            Event::Noticed(_) => {}
            Event::Said(said) => self.hear(said, now),
            Event::Planned(task, planned) => self.drive(task, planned, now),
            Event::Staged(stage, planned) => self.drive_stage(stage, planned, now),
            Event::Cleared(task, said) => self.hear_traffic(task, &said),
            Event::Beat => self.beat(now),
            Event::Stop => {
                self.end(Phase::Failed(Refusal::Failed { why: "the pilot was stopped".into() }), now);
                return false;
            }
        }
        true
    }

    /// Takes a task. A running one is replaced.
    fn go(&mut self, ask: GoAsk, now: Seconds) -> Result<Accepted, Refusal> {
        let corrector = ask.corrector.unwrap_or_else(|| self.params.corrector.clone());
        if !self.lines.contains_key(corrector.as_str()) {
            return Err(unknown_corrector(&corrector));
        }
        let Some(seen) = self.pose else {
            let hint =
                "no pose has been heard; are `axle run navigator`, `source` and the robot or `emulator` up?";
            return Err(Refusal::unavailable("navigator", hint));
        };
        self.end(Phase::Replaced, now);
        self.confirm = ask.confirm;
        let id = TaskId::from_random(random_bits());
        let way = Task { id, plan: ask.way.clone() };
        self.cause = self.say("the task", self.ways.put(&way, None));
        self.journey = Some(Journey::begin(id, ask.way.clone(), corrector, seen.pose, now));
        self.resting = Some((ask.way, now));
        self.plan_at_rest(now);
        self.say_progress(now);
        tracing::info!(task = %id, "task accepted");
        Ok(Accepted { task: id })
    }

    /// Has the task planned as soon as the robot stands.
    fn plan_at_rest(&mut self, now: Seconds) {
        let (Some((way, since)), Some(seen), Some(journey)) = (&self.resting, self.pose, &self.journey)
        else {
            return;
        };
        if stands(&seen) {
            self.planning = Some(self.ask_planners(journey.task(), way.clone(), seen.pose));
            self.resting = None;
        } else if now - *since > BRAKING {
            let why = format!("the robot did not come to rest within {BRAKING}: somebody else drives it");
            self.end(Phase::Failed(Refusal::Failed { why }), now);
        } else if let Some((corrector, task)) = &self.dismissed
            && let Some(line) = self.lines.get(corrector.as_str())
        {
            // A cancellation may be lost like every sample; it is repeated until the robot stands.
            self.say("the cancellation", line.cancels.put(&Cancel { id: *task }, None));
        }
    }

    /// Asks Pathfinder and Pathdriver beside the loop, which stays able to hear and to cancel.
    fn ask_planners(&self, task: TaskId, way: WayTask, start: Pose) -> JoinHandle<()> {
        let (mesh, robot, params) = (self.mesh.clone(), self.robot.clone(), self.params.clone());
        let answers = self.answers.clone();
        let deadline = Duration::from_secs_f64(params.deadline.0);
        tokio::spawn(async move {
            let plans = async {
                let (drivetrain, body) = (Some(params.robot), Some(params.radius));
                let ask = PlanAsk { way, start: Some(start), robot: drivetrain, body, ..PlanAsk::default() };
                let plan = mesh.ask(&key::PLAN, Some(&robot), &ask, deadline, Retry::Idempotent).await?;
                let ask = DriveAsk {
                    legs: plan.legs.clone(),
                    speeds: None,
                    robot: Some(params.robot),
                    manner: None,
                };
                let drive = mesh.ask(&key::DRIVE, Some(&robot), &ask, deadline, Retry::Idempotent).await?;
                Ok(Planned { plan, drive })
            };
            // The pilot that no longer listens has stopped.
            drop(answers.send(Event::Planned(task, plans.await)).await);
        })
    }

    fn cancel(&mut self, task: TaskId, now: Seconds) -> Result<Done, Refusal> {
        if self.journey.as_ref().is_some_and(|journey| journey.task() == task) {
            self.end(Phase::Canceled, now);
            Ok(Done {})
        } else {
            let known =
                self.journey.as_ref().map_or_else(|| "none".to_owned(), |journey| journey.task().to_string());
            Err(Refusal::Unknown { what: "task".into(), got: task.to_string(), known })
        }
    }

    fn see(&mut self, data: NavigatorData) {
        self.pose = Some(data);
        if let Some(journey) = &mut self.journey {
            journey.see(&self.params, data.pose);
        }
    }

    fn hear(&mut self, said: CorrectorProgress, now: Seconds) {
        if self.order.as_ref().is_some_and(|order| order.drive.id == said.task) {
            self.order = None;
        }
        let Some(said) = self.of_task(said, now) else { return };
        let Some(journey) = &mut self.journey else { return };
        let before = journey.phase().clone();
        journey.hear(&self.params, &said, now);
        if journey.phase().is_over() {
            self.trip = None;
        }
        if *journey.phase() != before {
            self.say_progress(now);
        }
    }

    fn drive(&mut self, id: TaskId, planned: Result<Planned, Refusal>, now: Seconds) {
        let Some(journey) = self.journey.as_mut().filter(|journey| journey.task() == id) else { return };
        self.planning = None;
        match planned {
            Ok(Planned { plan, drive }) => {
                journey.drive(now);
                if self.params.traffic || !self.confirm.is_empty() {
                    return self.set_out(id, plan, now);
                }
                // Each names the one before it: the way caused the plan, the plan the movements, these the order.
                let order = Order { plan: Task { id, plan }, drive: Task { id, plan: drive } };
                self.cause = self.say("the plan", self.plans.put(&order.plan, self.cause));
                self.cause = self.say("the movements", self.drives.put(&order.drive, self.cause));
                self.order = Some(order);
                self.repeat_order();
                self.say_progress(now);
            }
            Err(refusal) => self.end(Phase::Failed(refusal), now),
        }
    }

    /// Gives the order to the corrector; again at every beat until it answers, since a sample may be lost.
    fn repeat_order(&self) {
        let (Some(journey), Some(order)) = (&self.journey, &self.order) else { return };
        if let Some(line) = self.lines.get(journey.corrector()) {
            self.say("the order", line.orders.put(order, self.cause));
        }
    }

    fn beat(&mut self, now: Seconds) {
        self.plan_at_rest(now);
        self.repeat_order();
        self.see_to_trip(now);
        let Some(journey) = &mut self.journey else { return };
        if journey.phase().is_over() {
            return;
        }
        journey.wait(&self.params, now);
        if journey.phase().is_over() {
            self.dismiss();
        }
        self.say_progress(now);
    }

    /// Ends the running task, if there is one, and tells the corrector.
    fn end(&mut self, phase: Phase, now: Seconds) {
        let Some(journey) = &mut self.journey else { return };
        if journey.phase().is_over() {
            return;
        }
        journey.end(phase, now);
        self.dismiss();
        self.say_progress(now);
    }

    fn dismiss(&mut self) {
        self.order = None;
        self.resting = None;
        if let Some(planning) = self.planning.take() {
            planning.abort();
        }
        let Some(journey) = &self.journey else { return };
        let driven = self.trip.take().and_then(|trip| trip.stage).unwrap_or(journey.task());
        self.dismissed = Some((journey.corrector().to_owned(), driven));
        if let Some(line) = self.lines.get(journey.corrector()) {
            self.say("the cancellation", line.cancels.put(&Cancel { id: driven }, None));
        }
    }

    fn say_progress(&self, now: Seconds) {
        let Some(journey) = &self.journey else { return };
        self.say("progress", self.progress.put(&journey.progress(now), None));
    }

    fn say(&self, what: &str, said: Result<Cause, Refusal>) -> Option<Cause> {
        said.inspect_err(|refusal| tracing::warn!(robot = %self.robot, "{what} could not be said: {refusal}"))
            .ok()
    }
}
