//! A corrector as a process: a subscriber with a beat.
//!
//! A task goes through three stages. Leasing: the gate is asked for the wheels, beside the beat and not in it. Driving:
//! each beat takes what was measured last, makes one step and sends one command; wheels that the gate has taken back
//! because commands were lost are asked for again, as [`Tenure`] allows. Over: the lease is given back, and the end is
//! said. Whatever else goes wrong ends the task with a reason; the gate brakes by itself when commands stop.

use super::Context;
use super::tracer::{Tracer, setting};
use crate::params::load;
use axle_correctors::tenure::{Hold, REGAIN_PATIENCE, Tenure};
use axle_correctors::{ArcCorrector, DCorrector, GCorrector, LtvCorrector, PursuitCorrector, WCorrector};
use axle_mesh::{Inbox, Mesh, Publisher, Retry};
use axle_schema::codec::Message;
use axle_schema::command::{Class, Command, GateState, Lease, LeaseAsk, Release};
use axle_schema::contract::{Account, Corrector, Seen, Step};
use axle_schema::key;
use axle_schema::meta::{Cause, Meta};
use axle_schema::task::{Cancel, CorrectorProgress, Phase, Task};
use axle_schema::trace::{Named, Trace};
use axle_schema::window::Window;
use axle_schema::{Drive, NavigatorData, NavigatorEvent, Plan, Refusal, RobotId, Seconds, TaskId};
use std::time::Duration;
use tokio::sync::oneshot::{self, error::TryRecvError};
use tokio::task::JoinHandle;

/// A corrector whose tasks can travel.
pub(crate) trait Driven: Corrector<Plan: Clone + Sync> {
    /// The task as a message.
    type Order: Message + Clone + Sync + Into<Task<Self::Plan>>;
    /// The stream of tasks of the service `service`.
    fn orders(service: &'static str) -> key::Stream<Self::Order>;
}

/// The kinds of plans, and who follows them.
macro_rules! driven {
    ($($plan:ty: $($corrector:ty),+;)+) => {$($(
        impl Driven for $corrector {
            type Order = Task<$plan>;
            fn orders(service: &'static str) -> key::Stream<Self::Order> {
                key::corrector_task(service)
            }
        }
    )+)+};
}
driven! {
    Drive: DCorrector, LtvCorrector;
    Plan: GCorrector, WCorrector, ArcCorrector, PursuitCorrector;
}

/// How long the gate has to answer.
const LEASE_PATIENCE: Duration = Duration::from_secs(2);

/// Corrects until it is told to stop.
pub(crate) async fn run<C: Driven>(mut context: Context) -> anyhow::Result<()> {
    let params: C::Params = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = &context.mesh;
    let orders = mesh.inbox(&C::orders(context.service).of(&robot), 4)?;
    let cancels: Inbox<Cancel> = mesh.inbox(&key::corrector_cancel(context.service).of(&robot), 4)?;
    let senses = Senses {
        recent: mesh.inbox(&key::RECENT.of(&robot), 1)?,
        pose: mesh.inbox(&key::POSE.of(&robot), 1)?,
        gate: mesh.inbox(&key::GATE_STATE.of(&robot), 1)?,
        events: mesh.inbox(&key::NAVIGATOR_EVENT.of(&robot), 16)?,
        seen: Seen::default(),
        cause: None,
        held: Held::default(),
        state: None,
    };
    let period = C::period(&params);
    let voice = Voice {
        mesh: mesh.clone(),
        robot: robot.clone(),
        commands: mesh.publisher(&key::COMMAND.of(&robot))?,
        progress: mesh.publisher(&key::corrector_progress(context.service).of(&robot))?,
        service: context.service,
        tracer: Tracer::new(mesh, &robot, context.service, setting(&params, Some(period)))?,
    };
    let mut post = Post::<C> { params, period, senses, voice, stage: Stage::Idle, last: None, ended: None };
    let _visible = context.ready()?;
    let mut beat = mesh.beat(period);
    loop {
        tokio::select! {
            at = beat.next() => {
                let order = orders.latest().map(|heard| heard.message.into());
                let span = tracing::info_span!("beat", at = at.0, task = tracing::field::Empty);
                if let Some(task) = post.task() {
                    span.record("task", tracing::field::display(task));
                }
                span.in_scope(|| post.beat(at, order, &cancels));
            }
            () = context.stop.wait() => {
                let why = Refusal::Failed { why: "the corrector was stopped".into() };
                if let Some(giving_back) = post.finish(Phase::Failed(why)) {
                    drop(giving_back.await);
                }
                return Ok(());
            }
        }
    }
}

/// What a corrector hears, kept up to date.
struct Senses {
    recent: Inbox<Window>,
    pose: Inbox<NavigatorData>,
    gate: Inbox<GateState>,
    events: Inbox<NavigatorEvent>,
    seen: Seen,
    cause: Option<Cause>,
    held: Held,
    state: Option<GateState>,
}

/// The samples that hold what is seen.
#[derive(Clone, Copy, Default)]
struct Held {
    encoders: Option<Cause>,
    inertial: Option<Cause>,
    pose: Option<Cause>,
    /// The newest window had no encoders.
    inertial_is_newer: bool,
}

impl Held {
    fn window(&mut self, window: &Window, cause: Option<Cause>) {
        if !window.inertial.is_empty() {
            (self.inertial, self.inertial_is_newer) = (cause, true);
        }
        if !window.encoders.is_empty() {
            (self.encoders, self.inertial_is_newer) = (cause, false);
        }
    }
    /// The names in the order of arrival, in which a replay puts them together; and how many have none.
    fn named(self, seen: &Seen) -> (Vec<Named>, u32) {
        let mut windows =
            [(seen.inertial.is_some(), self.inertial), (seen.encoders.is_some(), self.encoders)];
        if self.inertial_is_newer {
            windows.reverse();
        }
        let windows = windows.map(|(seen, cause)| (seen, cause, key::RECENT.port()));
        let all = windows.into_iter().chain([(seen.pose.is_some(), self.pose, key::POSE.port())]);
        let (mut named, mut nameless) = (Vec::new(), 0);
        for (_, cause, port) in all.filter(|(seen, ..)| *seen) {
            match cause {
                Some(cause) => named.push(Named::new(port, cause)),
                None => nameless += 1,
            }
        }
        named.dedup();
        (named, nameless)
    }
}

impl Senses {
    fn refresh(&mut self, at: Seconds) {
        self.seen.at = at;
        if let Some(heard) = self.recent.latest() {
            self.seen.encoders = heard.message.encoders.last().copied().or(self.seen.encoders);
            self.seen.inertial = heard.message.inertial.last().copied().or(self.seen.inertial);
            self.cause = name(heard.meta);
            self.held.window(&heard.message, self.cause);
        }
        if let Some(heard) = self.pose.latest() {
            self.seen.pose = Some(heard.message);
            self.held.pose = name(heard.meta);
        }
        if let Some(heard) = self.gate.latest() {
            self.state = Some(heard.message);
        }
    }
}

fn name(meta: Option<Meta>) -> Option<Cause> {
    meta.map(|meta| Cause { source: meta.source, seq: meta.seq })
}

/// What a corrector says.
struct Voice {
    mesh: Mesh,
    robot: RobotId,
    commands: Publisher<Command>,
    progress: Publisher<CorrectorProgress>,
    service: &'static str,
    tracer: Tracer,
}

impl Voice {
    /// Says how the task is; names itself as the cause of the command that follows.
    fn account(&self, task: TaskId, phase: Phase, account: Account, cause: Option<Cause>) -> Option<Cause> {
        let said = self.progress.put(&progress(task, phase, account), cause);
        said.inspect_err(|refusal| tracing::warn!("progress could not be said: {refusal}")).ok()
    }
    /// Says what the beat worked from, for a replay.
    fn trace(
        &mut self,
        senses: &Senses,
        task: TaskId,
        (first, resumed): (bool, Option<Seconds>),
        said: [Option<Cause>; 2],
    ) {
        let [progress, command] = said;
        let progress = progress.map(|cause| Named::new(key::corrector_progress(self.service).port(), cause));
        let command = command.map(|cause| Named::new(key::COMMAND.port(), cause));
        let said = progress.into_iter().chain(command).collect();
        let (took, nameless) = senses.held.named(&senses.seen);
        let (at, task) = (Some(senses.seen.at), Some(task));
        self.tracer.say(Trace { first, resumed, at, task, took, nameless, said, setting: None });
    }
    /// Asks the gate for the wheels, beside the beat.
    fn ask_for_lease(&self, period: Seconds, patience: Duration) -> Answer {
        let (mesh, robot) = (self.mesh.clone(), self.robot.clone());
        let (answer, lease) = oneshot::channel();
        tokio::spawn(async move {
            let ask = LeaseAsk { holder: mesh.name(), class: Class::Corrector, period };
            let granted = mesh.ask(&key::LEASE, Some(&robot), &ask, patience, Retry::Idempotent).await;
            // Nobody waits any more when the task was cancelled meanwhile; the lease ends by silence.
            drop(answer.send(granted));
        });
        lease
    }
    /// Gives the wheels back, beside the beat. A gate that does not hear it brakes all the same, by silence.
    fn give_back(&self, lease: Lease) -> JoinHandle<()> {
        let (mesh, robot) = (self.mesh.clone(), self.robot.clone());
        tokio::spawn(async move {
            let release = Release { boot: lease.boot, epoch: lease.epoch };
            let patience = Duration::from_millis(300);
            if let Err(refusal) =
                mesh.ask(&key::RELEASE, Some(&robot), &release, patience, Retry::Idempotent).await
            {
                tracing::debug!("the lease was not given back: {refusal}");
            }
        })
    }
}

/// The gate's answer to the question for the wheels, when it is there.
type Answer = oneshot::Receiver<Result<Lease, Refusal>>;

enum Stage<C: Corrector> {
    Idle,
    Leasing {
        task: Task<C::Plan>,
        lease: Answer,
    },
    /// Where `regaining` is there, the gate has taken the wheels back and is asked for them again.
    Driving {
        task: TaskId,
        corrector: Box<C>,
        tenure: Tenure,
        regaining: Option<Answer>,
    },
}

/// The answer, if it is there.
fn answered(lease: &mut Answer) -> Option<Result<Lease, Refusal>> {
    match lease.try_recv() {
        Ok(answer) => Some(answer),
        Err(TryRecvError::Empty) => None,
        Err(TryRecvError::Closed) => Some(Err(Refusal::internal("asking for the wheels ended early"))),
    }
}

/// A corrector at its post: with or without a task.
struct Post<C: Corrector> {
    params: C::Params,
    period: Seconds,
    senses: Senses,
    voice: Voice,
    stage: Stage<C>,
    /// The last task and how it ended: said again when the same task is ordered again.
    last: Option<(TaskId, Phase)>,
    /// The sample that said so.
    ended: Option<Cause>,
}

impl<C: Driven> Post<C> {
    fn beat(&mut self, at: Seconds, order: Option<Task<C::Plan>>, cancels: &Inbox<Cancel>) {
        self.senses.refresh(at);
        // What the navigator noticed before a task is not about it.
        while let Some(heard) = self.senses.events.take() {
            if let (true, Stage::Driving { .. }) = (heard.message.stop, &self.stage) {
                self.finish(Phase::Failed(Refusal::Failed { why: heard.message.why }));
            }
        }
        while let Some(cancel) = cancels.take() {
            if self.task() == Some(cancel.message.id) {
                self.finish(Phase::Canceled);
            }
        }
        if let Some(order) = order {
            self.accept(order);
        }
        match &mut self.stage {
            Stage::Idle => {}
            Stage::Leasing { task, lease } => match answered(lease) {
                Some(answer) => self.begin(answer),
                None => drop(self.voice.account(task.id, Phase::Running, Account::default(), None)),
            },
            Stage::Driving { .. } => self.step(),
        }
    }

    fn task(&self) -> Option<TaskId> {
        match &self.stage {
            Stage::Idle => None,
            Stage::Leasing { task, .. } => Some(task.id),
            Stage::Driving { task, .. } => Some(*task),
        }
    }

    fn accept(&mut self, order: Task<C::Plan>) {
        if self.task() == Some(order.id) {
            return;
        }
        // The pilot repeats an order until it hears of it; a task that is over is not driven twice.
        if let Some((task, phase)) = &self.last
            && *task == order.id
        {
            self.voice.account(*task, phase.clone(), Account::default(), None);
            return;
        }
        self.finish(Phase::Replaced);
        tracing::info!(task = %order.id, "task taken");
        self.stage =
            Stage::Leasing { task: order, lease: self.voice.ask_for_lease(self.period, LEASE_PATIENCE) };
    }

    /// The gate has answered: begin, or end with its reason.
    fn begin(&mut self, granted: Result<Lease, Refusal>) {
        let Stage::Leasing { task, .. } = std::mem::replace(&mut self.stage, Stage::Idle) else { return };
        let id = task.id;
        let begun = match granted {
            Ok(lease) => match C::begin(&self.params, self.period, task, &self.senses.seen) {
                Ok(corrector) => Ok((lease, corrector)),
                Err(refusal) => {
                    self.voice.give_back(lease);
                    Err(refusal)
                }
            },
            Err(refusal) => Err(refusal),
        };
        match begun {
            Ok((lease, corrector)) => {
                // What the gate said before the grant is not about this lease.
                self.senses.state = None;
                let tenure = Tenure::new(lease, self.period, self.senses.seen.at);
                self.stage =
                    Stage::Driving { task: id, corrector: Box::new(corrector), tenure, regaining: None };
                // At this very beat: over a slow link the silence since the grant may leave no time for another one.
                self.step();
            }
            Err(refusal) => self.say_end(id, Phase::Failed(refusal), Account::default()),
        }
    }

    /// One step of the corrector, one command.
    fn step(&mut self) {
        let Stage::Driving { task, corrector, tenure, regaining } = &mut self.stage else { return };
        let (seen, task) = (&self.senses.seen, *task);
        let (first, mut resumed) = (tenure.is_fresh(), None);
        if let Some(answer) = regaining {
            match answered(answer) {
                None => match tenure.wait(seen.at) {
                    Ok(()) => {
                        self.voice.account(task, Phase::Running, corrector.account(), self.senses.cause);
                        return;
                    }
                    Err(refusal) => return drop(self.finish(Phase::Failed(refusal))),
                },
                Some(Ok(lease)) => {
                    (*regaining, self.senses.state) = (None, None);
                    let pause = tenure.regain(lease, seen.at);
                    tracing::info!(%task, "the task goes on after {pause}");
                    corrector.resume(seen, pause);
                    resumed = Some(pause);
                }
                Some(Err(refusal)) => return drop(self.finish(Phase::Failed(refusal))),
            }
        }
        match tenure.look(self.senses.state.as_ref(), seen.at) {
            Hold::Held => {}
            Hold::Slipped => {
                tracing::warn!(%task, "commands were lost and the gate brakes: asking for the wheels again");
                *regaining =
                    Some(self.voice.ask_for_lease(self.period, Duration::from_secs_f64(REGAIN_PATIENCE.0)));
                self.voice.account(task, Phase::Running, corrector.account(), self.senses.cause);
                return;
            }
            Hold::Lost(refusal) => return drop(self.finish(Phase::Failed(refusal))),
        }
        match corrector.step(seen) {
            Step::Drive(dwm) => {
                let command = tenure.command(seen, dwm);
                let account = corrector.account();
                let cause = self.voice.account(task, Phase::Running, account, self.senses.cause);
                match self.voice.commands.put(&command, cause) {
                    Ok(said) => self.voice.trace(&self.senses, task, (first, resumed), [cause, Some(said)]),
                    Err(refusal) => drop(self.finish(Phase::Failed(refusal))),
                }
            }
            Step::Done => self.end_by_itself(Phase::Done, resumed),
            Step::Fail(refusal) => self.end_by_itself(Phase::Failed(refusal), resumed),
        }
    }

    /// The corrector itself has ended its task; a replay ends it at the same beat.
    fn end_by_itself(&mut self, phase: Phase, resumed: Option<Seconds>) {
        let Stage::Driving { task, tenure, .. } = &self.stage else { return };
        let (task, first) = (*task, tenure.is_fresh());
        self.finish(phase);
        self.voice.trace(&self.senses, task, (first, resumed), [self.ended, None]);
    }

    /// Ends the task, if there is one; what is returned ends when the wheels are given back.
    fn finish(&mut self, phase: Phase) -> Option<JoinHandle<()>> {
        match std::mem::replace(&mut self.stage, Stage::Idle) {
            Stage::Idle => None,
            Stage::Leasing { task, .. } => {
                self.say_end(task.id, phase, Account::default());
                None
            }
            Stage::Driving { task, corrector, tenure, .. } => {
                // The end is said first: whoever waits for it need not wait for the gate.
                self.say_end(task, phase, corrector.account());
                Some(self.voice.give_back(*tenure.lease()))
            }
        }
    }

    fn say_end(&mut self, task: TaskId, phase: Phase, account: Account) {
        match &phase {
            Phase::Failed(refusal) => tracing::warn!(%task, "task failed: {refusal}"),
            over => tracing::info!(%task, "task over: {over:?}"),
        }
        self.ended = self.voice.account(task, phase.clone(), account, self.senses.cause);
        self.last = Some((task, phase));
    }
}

/// What a corrector says of a task.
pub(crate) fn progress(task: TaskId, phase: Phase, account: Account) -> CorrectorProgress {
    let Account { stamp, elapsed, fraction, due, real } = account;
    CorrectorProgress { task, phase, stamp, elapsed, fraction: fraction.clamp(0.0, 1.0), due, real }
}
