//! A corrector as a process: a subscriber with a beat.
//!
//! A task goes through three stages. Leasing: the gate is asked for the wheels, beside the beat and not in it. Driving:
//! each beat takes what was measured last, makes one step and sends one command. Over: the lease is given back, and
//! the end is said. Whatever goes wrong ends the task with a reason; the gate brakes by itself when commands stop.

use super::Context;
use crate::params::load;
use axle_correctors::{ArcCorrector, DCorrector, GCorrector, LtvCorrector, PursuitCorrector, WCorrector};
use axle_mesh::{Inbox, Mesh, Publisher, Retry};
use axle_schema::codec::Message;
use axle_schema::command::{Class, Command, GateState, Lease, LeaseAsk, Release};
use axle_schema::contract::{Account, Corrector, Seen, Step};
use axle_schema::key;
use axle_schema::meta::Cause;
use axle_schema::task::{Cancel, CorrectorProgress, Phase, Task};
use axle_schema::window::Window;
use axle_schema::{Drive, NavigatorData, Plan, Refusal, RobotId, Seconds, TaskId, Tick};
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
        seen: Seen::default(),
        cause: None,
        state: None,
    };
    let voice = Voice {
        mesh: mesh.clone(),
        robot: robot.clone(),
        commands: mesh.publisher(&key::COMMAND.of(&robot))?,
        progress: mesh.publisher(&key::corrector_progress(context.service).of(&robot))?,
    };
    let period = C::period(&params);
    let mut post = Post::<C> { params, period, senses, voice, stage: Stage::Idle, last: None };
    let _visible = context.ready()?;
    let mut beat = mesh.beat(period);
    loop {
        tokio::select! {
            at = beat.next() => post.beat(at, orders.latest().map(|heard| heard.message.into()), &cancels),
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
    seen: Seen,
    cause: Option<Cause>,
    state: Option<GateState>,
}

impl Senses {
    fn refresh(&mut self, at: Seconds) {
        self.seen.at = at;
        if let Some(heard) = self.recent.latest() {
            self.seen.encoders = heard.message.encoders.last().copied().or(self.seen.encoders);
            self.seen.inertial = heard.message.inertial.last().copied().or(self.seen.inertial);
            self.cause = heard.meta.map(|meta| Cause { source: meta.source, seq: meta.seq });
        }
        if let Some(heard) = self.pose.latest() {
            self.seen.pose = Some(heard.message);
        }
        if let Some(heard) = self.gate.latest() {
            self.state = Some(heard.message);
        }
    }
}

/// What a corrector says.
struct Voice {
    mesh: Mesh,
    robot: RobotId,
    commands: Publisher<Command>,
    progress: Publisher<CorrectorProgress>,
}

impl Voice {
    /// Says how the task is; names itself as the cause of the command that follows.
    fn account(&self, task: TaskId, phase: Phase, account: Account, cause: Option<Cause>) -> Option<Cause> {
        let Account { stamp, elapsed, fraction, due, real } = account;
        let fraction = fraction.clamp(0.0, 1.0);
        let progress = CorrectorProgress { task, phase, stamp, elapsed, fraction, due, real };
        let said = self.progress.put(&progress, cause);
        said.inspect_err(|refusal| tracing::warn!("progress could not be said: {refusal}")).ok()
    }
    /// Asks the gate for the wheels, beside the beat.
    fn ask_for_lease(&self, period: Seconds) -> oneshot::Receiver<Result<Lease, Refusal>> {
        let (mesh, robot) = (self.mesh.clone(), self.robot.clone());
        let (answer, lease) = oneshot::channel();
        tokio::spawn(async move {
            let ask = LeaseAsk { holder: mesh.name(), class: Class::Corrector, period };
            let granted = mesh.ask(&key::LEASE, Some(&robot), &ask, LEASE_PATIENCE, Retry::Idempotent).await;
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

enum Stage<C: Corrector> {
    Idle,
    Leasing { task: Task<C::Plan>, lease: oneshot::Receiver<Result<Lease, Refusal>> },
    Driving { task: TaskId, corrector: Box<C>, lease: Lease, seq: u32 },
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
}

impl<C: Driven> Post<C> {
    fn beat(&mut self, at: Seconds, order: Option<Task<C::Plan>>, cancels: &Inbox<Cancel>) {
        self.senses.refresh(at);
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
            Stage::Leasing { task, lease } => match lease.try_recv() {
                Ok(answer) => self.begin(answer),
                Err(TryRecvError::Empty) => {
                    self.voice.account(task.id, Phase::Running, Account::default(), None);
                }
                Err(TryRecvError::Closed) => {
                    self.begin(Err(Refusal::internal("asking for the wheels ended early")))
                }
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
        self.stage = Stage::Leasing { task: order, lease: self.voice.ask_for_lease(self.period) };
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
                self.stage = Stage::Driving { task: id, corrector: Box::new(corrector), lease, seq: 0 };
                // At this very beat: over a slow link the silence since the grant may leave no time for another one.
                self.step();
            }
            Err(refusal) => self.say_end(id, Phase::Failed(refusal), Account::default()),
        }
    }

    /// One step of the corrector, one command.
    fn step(&mut self) {
        let Stage::Driving { task, corrector, lease, seq } = &mut self.stage else { return };
        if let Some(lost) = self.senses.state.as_ref().and_then(|state| lost(state, lease, *seq)) {
            self.finish(Phase::Failed(lost));
            return;
        }
        match corrector.step(&self.senses.seen) {
            Step::Drive(dwm) => {
                *seq += 1;
                let echo = self.senses.seen.encoders.map_or(lease.tick, |encoders| Tick::of(encoders.stamp));
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 0.5 s")]
                let ttl_ms = (self.period.0 * 3000.0).clamp(150.0, 1500.0) as u16;
                let command = Command { boot: lease.boot, epoch: lease.epoch, seq: *seq, echo, ttl_ms, dwm };
                let (task, account) = (*task, corrector.account());
                let cause = self.voice.account(task, Phase::Running, account, self.senses.cause);
                if let Err(refusal) = self.voice.commands.put(&command, cause) {
                    self.finish(Phase::Failed(refusal));
                }
            }
            Step::Done => drop(self.finish(Phase::Done)),
            Step::Fail(refusal) => drop(self.finish(Phase::Failed(refusal))),
        }
    }

    /// Ends the task, if there is one; what is returned ends when the wheels are given back.
    fn finish(&mut self, phase: Phase) -> Option<JoinHandle<()>> {
        match std::mem::replace(&mut self.stage, Stage::Idle) {
            Stage::Idle => None,
            Stage::Leasing { task, .. } => {
                self.say_end(task.id, phase, Account::default());
                None
            }
            Stage::Driving { task, corrector, lease, .. } => {
                // The end is said first: whoever waits for it need not wait for the gate.
                self.say_end(task, phase, corrector.account());
                Some(self.voice.give_back(lease))
            }
        }
    }

    fn say_end(&mut self, task: TaskId, phase: Phase, account: Account) {
        match &phase {
            Phase::Failed(refusal) => tracing::warn!(%task, "task failed: {refusal}"),
            over => tracing::info!(%task, "task over: {over:?}"),
        }
        self.voice.account(task, phase.clone(), account, self.senses.cause);
        self.last = Some((task, phase));
    }
}

/// Why the gate no longer obeys this lease, if so.
fn lost(state: &GateState, lease: &Lease, seq: u32) -> Option<Refusal> {
    if state.boot != lease.boot {
        return Some(Refusal::Fenced { why: "the robot process has restarted; give the task again".into() });
    }
    if state.epoch > lease.epoch {
        let holder = state.holder.clone().unwrap_or_else(|| "nobody".into());
        return Some(Refusal::Fenced { why: format!("{holder} has taken the wheels") });
    }
    if !state.enabled {
        let why = match state.stop {
            Some(stop) => format!("stopped by AllStop {stop}; `axle enable` allows it to move again"),
            None => "it has not been enabled since boot; `axle enable` allows it to move".into(),
        };
        return Some(Refusal::Disabled { why });
    }
    // The state of before the first command may still be on its way.
    (seq > 1 && state.epoch == lease.epoch && state.holder.is_none()).then(|| Refusal::Fenced {
        why: format!(
            "the gate took the wheels back ({:?}): commands came too late or not at all",
            state.cause
        ),
    })
}
