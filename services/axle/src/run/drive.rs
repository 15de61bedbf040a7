//! The drive as a process: the Generic Differential Drive contract on the mesh.
//!
//! Requests act as they come, so that a stop waits for no beat; commands go out with the beat. What the gate is asked
//! is asked beside the loop, and its answers come back through a bounded queue.

use super::Context;
use crate::params::load;
use axle_correctors::{DCorrector, DParams};
use axle_drive::{DriveParams, Facade, Out, Reply, Request, Ticket};
use axle_mesh::{Asked, Inbox, Mesh, Publisher, Retry, Server, random_bits};
use axle_schema::codec::Message;
use axle_schema::command::{Command, Done, GateState, Lease};
use axle_schema::differential_drive::{
    DriveDistance, DriveState, DriveStopped, EnableDrive, GetDrive, OperationBegun, ResetEncoders,
    RotateDegrees, SetDrivePower, SetDriveSpeed, StopDrive,
};
use axle_schema::meta::Cause;
use axle_schema::{EncodersData, Refusal, RobotId, key};
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::sync::mpsc;

/// How long the gate has to answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// How many answers of the gate may wait: the façade asks for less at a time.
const ANSWERS: usize = 64;

/// Drives until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: DriveParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = context.mesh.clone();
    let hears = Hears::new(&mesh, &robot)?;
    let (answers, mut answered) = mpsc::channel(ANSWERS);
    let mut post = Post::new(&mesh, robot, &params, answers)?;
    let _visible = context.ready()?;
    let mut beat = mesh.beat(params.period);
    loop {
        // The first lines are looked at first: a flood of powers does not delay a stop.
        tokio::select! {
            biased;
            asked = hears.stop.next() => post.take(asked, Request::Stop, stopped),
            asked = hears.enable.next() => post.take(asked, Request::Enable, done),
            Some(answer) = answered.recv() => post.hear(answer),
            heard = hears.gate.next() => post.facade.hear_gate(mesh.clock().now(), heard.message),
            at = beat.next() => {
                while let Some(heard) = hears.encoders.take() {
                    post.cause = heard.meta.map(|meta| Cause { source: meta.source, seq: meta.seq });
                    post.facade.hear_encoders(at, heard.message);
                }
                post.facade.beat(at);
            }
            asked = hears.power.next() => post.take(asked, Request::Power, done),
            asked = hears.speed.next() => post.take(asked, Request::Speed, done),
            asked = hears.distance.next() => post.take(asked, Request::Distance, begun),
            asked = hears.rotate.next() => post.take(asked, Request::Rotate, begun),
            asked = hears.reset.next() => post.take(asked, |ResetEncoders {}| Request::Reset, done),
            asked = hears.get.next() => post.take(asked, |GetDrive {}| Request::Get, state),
            () = context.stop.wait() => {
                post.facade.leave(Refusal::Failed { why: "the drive was ended".into() });
                post.act();
                if let Some(giving_back) = post.giving_back.take() {
                    drop(giving_back.await);
                }
                return Ok(());
            }
        }
        post.act();
    }
}

/// Everything that the drive hears.
struct Hears {
    stop: Server<StopDrive, DriveStopped>,
    enable: Server<EnableDrive, Done>,
    power: Server<SetDrivePower, Done>,
    speed: Server<SetDriveSpeed, Done>,
    distance: Server<DriveDistance, OperationBegun>,
    rotate: Server<RotateDegrees, OperationBegun>,
    reset: Server<ResetEncoders, Done>,
    get: Server<GetDrive, DriveState>,
    gate: Inbox<GateState>,
    encoders: Inbox<EncodersData>,
}

impl Hears {
    fn new(mesh: &Mesh, robot: &RobotId) -> anyhow::Result<Self> {
        let one = Some(robot);
        Ok(Self {
            stop: mesh.server(&key::DRIVE_ALL_STOP.of(one))?,
            enable: mesh.server(&key::DRIVE_ENABLE.of(one))?,
            power: mesh.server(&key::DRIVE_POWER.of(one))?,
            speed: mesh.server(&key::DRIVE_SPEED.of(one))?,
            distance: mesh.server(&key::DRIVE_DISTANCE.of(one))?,
            rotate: mesh.server(&key::DRIVE_ROTATE.of(one))?,
            reset: mesh.server(&key::DRIVE_RESET.of(one))?,
            get: mesh.server(&key::DRIVE_GET.of(one))?,
            gate: mesh.inbox(&key::GATE_STATE.of(robot), 8)?,
            encoders: mesh.inbox(&key::ENCODERS.of(robot), 16)?,
        })
    }
}

/// What the gate answered.
enum Answered {
    Lease(Result<Lease, Refusal>),
    Enable(Ticket, Result<(), Refusal>),
}

/// Gives a request its answer.
type Answer = Box<dyn FnOnce(Result<Reply, Refusal>) + Send>;

/// The façade, and what it says.
struct Post {
    facade: Facade<DCorrector>,
    mesh: Mesh,
    robot: RobotId,
    commands: Publisher<Command>,
    updates: Publisher<DriveState>,
    distances: Publisher<DriveDistance>,
    turns: Publisher<RotateDegrees>,
    answers: mpsc::Sender<Answered>,
    /// Requests without an answer; the façade bounds how many.
    open: BTreeMap<Ticket, Answer>,
    tickets: Ticket,
    /// The measurement that the next command is made from.
    cause: Option<Cause>,
    giving_back: Option<tokio::task::JoinHandle<()>>,
}

impl Post {
    fn new(
        mesh: &Mesh,
        robot: RobotId,
        params: &DriveParams,
        answers: mpsc::Sender<Answered>,
    ) -> anyhow::Result<Self> {
        let DriveParams { tolerance, lost, silence, robot: body, .. } = *params;
        let corrector = DParams { tolerance, lost, silence, robot: body, ..DParams::default() };
        Ok(Self {
            facade: Facade::new(*params, corrector, mesh.name())?,
            commands: mesh.publisher(&key::COMMAND.of(&robot))?,
            updates: mesh.publisher(&key::DRIVE_UPDATE.of(&robot))?,
            distances: mesh.publisher(&key::DRIVE_DISTANCE_STAGE.of(&robot))?,
            turns: mesh.publisher(&key::DRIVE_ROTATE_STAGE.of(&robot))?,
            mesh: mesh.clone(),
            robot,
            answers,
            open: BTreeMap::new(),
            tickets: 0,
            cause: None,
            giving_back: None,
        })
    }

    /// Takes a request; its answer comes with [`Post::act`], now or later.
    fn take<Q: Message, A: Message>(
        &mut self,
        asked: Asked<Q, A>,
        request: fn(Q) -> Request,
        answer: fn(Reply) -> Option<A>,
    ) {
        let question = match asked.question() {
            Ok(question) => question,
            Err(refusal) => return asked.reply(Err(refusal)),
        };
        self.tickets += 1;
        let reply = move |given: Result<Reply, Refusal>| {
            let fits =
                |reply| answer(reply).ok_or_else(|| Refusal::internal("the drive gave a wrong answer"));
            asked.reply(given.and_then(fits));
        };
        self.open.insert(self.tickets, Box::new(reply));
        self.facade.ask(self.mesh.clock().now(), self.tickets, random_bits(), request(question));
    }

    fn hear(&mut self, answer: Answered) {
        let now = self.mesh.clock().now();
        match answer {
            Answered::Lease(granted) => self.facade.leased(now, granted),
            Answered::Enable(ticket, done) => self.facade.enabled(now, ticket, done),
        }
    }

    /// Does what the façade wants.
    fn act(&mut self) {
        for out in self.facade.outs() {
            let said = match out {
                Out::Answer(ticket, answer) => {
                    if let Some(reply) = self.open.remove(&ticket) {
                        reply(answer);
                    }
                    Ok(())
                }
                Out::Command(command) => self.commands.put(&command, self.cause).map(drop),
                Out::Stop(stop) => self.mesh.put_once(&key::STOP.of(&self.robot), &stop),
                Out::Distance(stage) => self.distances.put(&stage, None).map(drop),
                Out::Rotate(stage) => self.turns.put(&stage, None).map(drop),
                Out::Update(state) => self.updates.put(&state, None).map(drop),
                out @ (Out::AskLease(_) | Out::Release(_) | Out::Enable(..)) => {
                    self.ask_gate(out);
                    Ok(())
                }
            };
            if let Err(refusal) = said {
                tracing::warn!("a word of the drive could not be said: {refusal}");
            }
        }
    }

    /// Asks the gate, beside the loop.
    fn ask_gate(&mut self, out: Out) {
        let (mesh, robot, answers) = (self.mesh.clone(), self.robot.clone(), self.answers.clone());
        let is_release = matches!(out, Out::Release(_));
        let asking = tokio::spawn(async move {
            let robot = Some(&robot);
            let answer = match out {
                Out::AskLease(ask) => {
                    Answered::Lease(mesh.ask(&key::LEASE, robot, &ask, PATIENCE, Retry::Idempotent).await)
                }
                Out::Enable(ticket, enable) => {
                    let done = mesh.ask(&key::ENABLE, robot, &enable, PATIENCE, Retry::Idempotent).await;
                    Answered::Enable(ticket, done.map(|Done {}| ()))
                }
                Out::Release(release) => {
                    // A gate that does not hear it brakes all the same, by silence; a lease that has ended is no fault.
                    let patience = Duration::from_millis(300);
                    drop(mesh.ask(&key::RELEASE, robot, &release, patience, Retry::Idempotent).await);
                    return;
                }
                _ => return,
            };
            // Nobody waits any more when the process ends.
            drop(answers.send(answer).await);
        });
        if is_release {
            self.giving_back = Some(asking);
        }
    }
}

fn done(reply: Reply) -> Option<Done> {
    matches!(reply, Reply::Done).then_some(Done {})
}
fn stopped(reply: Reply) -> Option<DriveStopped> {
    if let Reply::Stopped(stop) = reply { Some(DriveStopped { stop }) } else { None }
}
fn begun(reply: Reply) -> Option<OperationBegun> {
    if let Reply::Begun(operation) = reply { Some(OperationBegun { operation }) } else { None }
}
fn state(reply: Reply) -> Option<DriveState> {
    if let Reply::State(state) = reply { Some(*state) } else { None }
}
