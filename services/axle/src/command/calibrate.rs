//! `axle calibrate`: what a robot really does, measured through the mesh and its gate.
//!
//! The procedure is the value of `axle-calibrator`. This file leases the wheels as everybody does, asks their owner to
//! take its speeds raw, sends one movement a beat, and gives the owner what was found. Whoever stops the robot, or takes
//! the wheels, ends it.

mod person;
mod recorded;
mod report;
mod watch;

use crate::cli::Calibrate as Args;
use crate::command::go::Bar;
use crate::out::{note, usage};
use crate::settings::Settings;
use axle_calibrator::{Action, Procedure, Report, Subject};
use axle_correctors::tenure::lost;
use axle_mesh::{Inbox, Mesh, Publisher, Retry};
use axle_schema::calibration::{Calibrate, Calibrated, GetCalibration, Raw};
use axle_schema::command::{Class, Command, Done, GateState, Lease, LeaseAsk, Release};
use axle_schema::{Calibration, Dwm, InertialData, Refusal, RobotId, Seconds, Sides, SignalsData, Tick, key};
use person::Person;
use std::future::Future;
use std::time::Duration;

/// From beat to beat.
const PERIOD: Seconds = Seconds(0.05);
/// The owner of the wheels has this long to answer.
const PATIENCE: Duration = Duration::from_secs(3);

/// Does what the command line says.
pub(super) async fn calibrate(settings: &Settings, args: &Args) -> anyhow::Result<()> {
    if let Some(recording) = &args.recording {
        return recorded::fit(recording, settings, args);
    }
    let robot = settings.one_robot()?;
    let room = match (args.room, args.watch) {
        (Some(room), _) => Some(room),
        (None, true) => None,
        (None, false) => {
            return Err(usage(
                "the robot will drive about: put it into the middle of free floor, and say how much there is with --room 2x2",
            ));
        }
    };
    let mesh = settings.join("calibrate").await?;
    let facts =
        mesh.ask(&key::CALIBRATION, Some(&robot), &GetCalibration {}, PATIENCE, Retry::Idempotent).await;
    let facts = facts.map_err(|refusal| {
        anyhow::Error::new(refusal)
            .context(format!("{robot} says nothing of a calibration; is its owner up?"))
    })?;
    let Some(room) = room else {
        let watched = watch::watch(&mesh, &robot, facts, args).await;
        mesh.leave().await;
        return watched;
    };
    let subject = Subject {
        track: facts.track,
        wheel_speed: facts.wheel_speed,
        wheel_acceleration: facts.wheel_acceleration,
        full_speed: facts.full_speed,
        room,
        passes: args.passes,
        period: PERIOD,
        version: facts.calibration.version,
        by_hand: args.by_hand,
        keeps_speeds: facts.keeps_speeds,
    };
    // Refused before anything moves.
    let procedure = Procedure::new(subject).map_err(|refusal| usage(refusal.to_string()))?;
    let mut driver = Driver::new(&mesh, &robot).await?;
    let measured = driver.measure(procedure, args.by_hand).await;
    let (mut calibration, report) = match measured {
        Ok(outcome) => outcome,
        Err(fault) => {
            driver.release().await;
            mesh.leave().await;
            return Err(fault);
        }
    };
    let made = format!("by {}, {} passes in {room}", mesh.name(), args.passes);
    calibration.made = made.chars().take(120).collect();
    let applied = if args.dry_run { Ok(()) } else { driver.apply(&calibration).await };
    driver.release().await;
    mesh.leave().await;
    report::write(&args.out, &robot, &calibration, &report)?;
    report::print(&calibration, &report, args.json, !args.dry_run && applied.is_ok())?;
    note(&format!("the calibration and its pictures are in {}", args.out.display()));
    applied
}

/// Who holds the wheels while they are measured.
struct Driver {
    mesh: Mesh,
    robot: RobotId,
    lease: Lease,
    seq: u32,
    tick: Tick,
    commands: Publisher<Command>,
    motors: Inbox<SignalsData>,
    inertial: Inbox<InertialData>,
    states: Inbox<GateState>,
}

impl Driver {
    /// Asks the gate for the wheels.
    async fn new(mesh: &Mesh, robot: &RobotId) -> anyhow::Result<Self> {
        let motors = mesh.inbox(&key::MOTORS.of(robot), 512)?;
        let inertial = mesh.inbox(&key::INERTIAL.of(robot), 512)?;
        let states = mesh.inbox(&key::GATE_STATE.of(robot), 16)?;
        let commands = mesh.publisher(&key::COMMAND.of(robot))?;
        let lease = lease(mesh, robot, Class::Corrector).await?;
        Ok(Self {
            mesh: mesh.clone(),
            robot: robot.clone(),
            tick: lease.tick,
            lease,
            seq: 0,
            commands,
            motors,
            inertial,
            states,
        })
    }

    /// Runs the procedure to its end.
    async fn measure(
        &mut self,
        mut procedure: Procedure,
        by_hand: bool,
    ) -> anyhow::Result<(Calibration, Report)> {
        let raw = Raw { boot: self.lease.boot, epoch: self.lease.epoch };
        let (mesh, robot) = (self.mesh.clone(), self.robot.clone());
        let asked = async move { mesh.ask(&key::RAW, Some(&robot), &raw, PATIENCE, Retry::Idempotent).await };
        let Done {} = self.hold(asked).await?;
        let bar = Bar::new();
        let mut person = if by_hand { Some(Person::new()?) } else { None };
        let mut stop = crate::signal::stop()?;
        let mut beat = self.mesh.beat(PERIOD);
        loop {
            let now = tokio::select! {
                now = beat.next() => now,
                () = stop.wait() => {
                    bar.clear();
                    anyhow::bail!("the calibration was cancelled; the robot is as it was");
                }
            };
            while let Some(heard) = self.inertial.take() {
                procedure.hear_inertial(&heard.message);
            }
            while let Some(heard) = self.motors.take() {
                self.tick = Tick::of(heard.message.stamp);
                procedure.hear_signals(&heard.message);
            }
            self.still_ours()?;
            let (share, words) = procedure.progress();
            bar.set(share, words.to_owned());
            let action = procedure.beat(now);
            if let Some(person) = &mut person {
                person.attend(&mut procedure, &bar).inspect_err(|_| bar.clear())?;
            }
            match action {
                Action::Drive(dwm) => self.command(dwm)?,
                Action::Done(outcome) => {
                    bar.clear();
                    return Ok(*outcome);
                }
                Action::Fail(refusal) => {
                    bar.clear();
                    return Err(refusal.into());
                }
            }
        }
    }

    fn still_ours(&mut self) -> Result<(), Refusal> {
        while let Some(heard) = self.states.take() {
            if let Some(refusal) = lost(&heard.message, &self.lease, self.seq) {
                return Err(refusal);
            }
        }
        Ok(())
    }

    fn command(&mut self, dwm: Dwm) -> Result<(), Refusal> {
        self.seq += 1;
        // A speed that shall stay is held over a late beat; one that changes is not guessed.
        let dwm =
            if dwm.start() == dwm.end() { Dwm::new(dwm.start(), dwm.end(), PERIOD * 4.0)? } else { dwm };
        let (boot, epoch) = (self.lease.boot, self.lease.epoch);
        let command = Command { boot, epoch, seq: self.seq, echo: self.tick, ttl_ms: 200, dwm };
        self.commands.put(&command, None).map(drop)
    }

    /// Keeps the lease alive, at rest, until an answer has come.
    async fn hold<T>(&mut self, answer: impl Future<Output = Result<T, Refusal>>) -> Result<T, Refusal> {
        let mut beat = self.mesh.beat(PERIOD);
        let mut answer = std::pin::pin!(answer);
        let rest = Dwm::new(Sides::default(), Sides::default(), PERIOD)?;
        loop {
            tokio::select! {
                answer = &mut answer => return answer,
                _ = beat.next() => {
                    while let Some(heard) = self.motors.take() {
                        self.tick = Tick::of(heard.message.stamp);
                    }
                    self.command(rest)?;
                }
            }
        }
    }

    /// Has the owner of the wheels apply and keep what was found.
    async fn apply(&mut self, calibration: &Calibration) -> anyhow::Result<()> {
        let question =
            Calibrate { boot: self.lease.boot, epoch: self.lease.epoch, calibration: calibration.clone() };
        let (mesh, robot) = (self.mesh.clone(), self.robot.clone());
        let asked =
            async move { mesh.ask(&key::CALIBRATE, Some(&robot), &question, PATIENCE, Retry::Never).await };
        let Done {} = self.hold(asked).await?;
        Ok(())
    }

    /// Gives the wheels back. A gate that does not hear it brakes all the same, by silence.
    async fn release(&self) {
        release(&self.mesh, &self.robot, self.lease).await;
    }
}

/// Asks the gate for the wheels.
async fn lease(mesh: &Mesh, robot: &RobotId, class: Class) -> Result<Lease, Refusal> {
    let ask = LeaseAsk { holder: mesh.name(), class, period: Seconds(0.1) };
    mesh.ask(&key::LEASE, Some(robot), &ask, PATIENCE, Retry::Idempotent).await
}

async fn release(mesh: &Mesh, robot: &RobotId, lease: Lease) {
    let release = Release { boot: lease.boot, epoch: lease.epoch };
    let patience = Duration::from_millis(300);
    let given: Result<Done, _> =
        mesh.ask(&key::RELEASE, Some(robot), &release, patience, Retry::Idempotent).await;
    if let Err(refusal) = given {
        tracing::debug!("the lease was not given back: {refusal}");
    }
}

/// What the owner of the wheels says of itself.
type Facts = Calibrated;
