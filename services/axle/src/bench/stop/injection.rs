//! One injection: a robot drives, its commander is lost, the wheels brake and stand.

use super::history::History;
use crate::bench::proxy::{Bytes, Proxy};
use anyhow::Context as _;
use axle_mesh::{Heard, Mesh, Retry, clock, random_bits};
use axle_schema::command::{AllStop, Class, Done, Enable, GateState, Motion};
use axle_schema::{RobotId, StopId, key};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::process::Stdio;
use std::time::Duration;
use tokio::process::{Child, Command};
use tokio::time::{Instant, sleep};

/// How the commander is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fault {
    /// SIGKILL.
    Kill,
    /// SIGSTOP for so long, then SIGCONT.
    Freeze(Duration),
    /// Its wire is cut for so long, then mended.
    Cut(Duration),
}

/// What came of an injection.
#[derive(Clone, Debug)]
pub(super) struct Injected {
    pub(super) fault: Fault,
    /// From the fault to the word that the wheels brake; none where none came.
    pub(super) brake: Option<Duration>,
    /// From braking to standstill, by the robot's clock.
    pub(super) standstill: Option<Duration>,
    /// Whether the outage was so short that commands may have gone on as if there had been none.
    pub(super) may_go_on: bool,
    /// Ages of the commands that were obeyed, in ms, by the robot's clock.
    pub(super) ages: Vec<f64>,
    /// How many commands that were obeyed could not be judged, since nobody heard them here.
    pub(super) unjudged: usize,
    /// What an AllStop of this process took.
    pub(super) all_stop: Option<Stopped>,
}

/// From an AllStop of another process to the first setpoint that brakes, and until the word of it was back.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stopped {
    pub(super) braking: Duration,
    pub(super) heard: Duration,
}

/// Waits for what must come at all; no figure is judged by it.
const PATIENCE: Duration = Duration::from_secs(10);
/// A gate that has not braked by now has missed the fault.
const MISSED: Duration = Duration::from_secs(1);
/// An outage that is shorter may be over before the robot notices: silence stops it after 150 ms.
const NOTICED: Duration = Duration::from_millis(300);

/// A robot, the wire to its commander, and ears.
pub(super) struct Site {
    mesh: Mesh,
    robot: RobotId,
    wire: Proxy,
    history: History,
}

impl Site {
    pub(super) async fn new(mesh: &Mesh, robot: RobotId, endpoint: &str) -> anyhow::Result<Self> {
        let wire = Proxy::to(endpoint, Bytes::Messages, 0).await?;
        let history = History::of(mesh, &robot)?;
        Ok(Self { mesh: mesh.clone(), robot, wire, history })
    }

    /// Lets the robot drive, loses its commander, and sees what happens.
    pub(super) async fn inject(&mut self, fault: Fault) -> anyhow::Result<Injected> {
        let mut commander = self.under_way().await?;
        let outage = match fault {
            Fault::Kill => MISSED,
            Fault::Freeze(outage) | Fault::Cut(outage) => outage,
        };
        self.history.forget_states();
        match fault {
            Fault::Kill => tell(&commander, Signal::SIGKILL)?,
            Fault::Freeze(_) => tell(&commander, Signal::SIGSTOP)?,
            Fault::Cut(_) => self.wire.cut(),
        }
        let lost = Instant::now();
        let brakes = |state: &GateState| state.motion != Motion::Driving;
        let braking = self.history.state(outage.min(MISSED), brakes).await.map(|heard| heard.message);
        let brake = braking.as_ref().map(|_| lost.elapsed());
        let standstill = match &braking {
            Some(braking) => {
                let stands = |state: &GateState| state.motion == Motion::Standing;
                let patience = outage.max(MISSED);
                let standing = match braking.motion {
                    Motion::Standing => Some(braking.clone()),
                    _ => self.history.state(patience, stands).await.map(|heard| heard.message),
                };
                standing.map(|standing| {
                    let ms = standing.tick.since(braking.tick).max(0).unsigned_abs();
                    Duration::from_millis(ms.into())
                })
            }
            None => None,
        };
        sleep(outage.saturating_sub(lost.elapsed())).await;
        match fault {
            Fault::Kill => {}
            Fault::Freeze(_) => tell(&commander, Signal::SIGCONT)?,
            Fault::Cut(_) => self.wire.mend(),
        }
        // Whatever waited in the wire has come by the time the gate speaks next; it does so once a second.
        if fault != Fault::Kill {
            sleep(Duration::from_millis(100)).await;
            self.history.forget_states();
            self.history.state(PATIENCE, |_| true).await.context("the gate fell silent")?;
        }
        let all_stop = match fault {
            Fault::Kill => Some(self.all_stop().await?),
            _ => None,
        };
        end(&mut commander).await?;
        self.rest().await?;
        self.history.close();
        let ages = std::mem::take(&mut self.history.ages);
        let unjudged = std::mem::take(&mut self.history.unjudged);
        let may_go_on = outage < NOTICED;
        Ok(Injected { fault, brake, standstill, may_go_on, ages, unjudged, all_stop })
    }

    /// Starts a commander, and waits until its robot drives; at a random moment between two of its commands.
    async fn under_way(&mut self) -> anyhow::Result<Child> {
        self.history.forget_states();
        let commander = Command::new(std::env::current_exe()?)
            .args(["bench-commander", "--connect", &self.wire.endpoint, "--robot", self.robot.as_str()])
            .args(["--log", "error"])
            .stdin(Stdio::null())
            .kill_on_drop(true)
            .spawn()
            .context("start a commander")?;
        let drives = |state: &GateState| state.motion == Motion::Driving;
        self.history.state(PATIENCE, drives).await.context("the robot does not drive")?;
        sleep(Duration::from_millis(250 + random_bits() % 50)).await;
        Ok(commander)
    }

    /// Lets the robot drive once more, and stops it from this process.
    async fn all_stop(&mut self) -> anyhow::Result<Stopped> {
        self.rest().await?;
        let mut commander = self.under_way().await?;
        let order = AllStop { id: StopId::from_random(random_bits()), by: self.mesh.name() };
        let (told, at) = (Instant::now(), clock::wall());
        self.mesh.put_once(&key::STOP.of(&self.robot), &order)?;
        let stopped = |state: &GateState| state.stop == Some(order.id) && state.motion != Motion::Driving;
        let Heard { message: state, meta } =
            self.history.state(PATIENCE, stopped).await.context("the gate does not stop")?;
        let heard = told.elapsed();
        // The gate says what it does after it has given the setpoint to the wheels. Both clocks are those of this computer.
        let braking = meta.map_or(heard, |meta| Duration::from_secs_f64((meta.stamp - at).max(0.0)));
        let enable = Enable {
            stop: state.stop,
            boot: state.boot,
            echo: state.tick,
            by: self.mesh.name(),
            class: Class::Manual,
        };
        let Done {} = self
            .mesh
            .ask(&key::ENABLE, Some(&self.robot), &enable, PATIENCE, Retry::Idempotent)
            .await
            .context("enable the robot again")?;
        end(&mut commander).await?;
        Ok(Stopped { braking, heard })
    }

    /// Waits until the robot stands and nobody holds its wheels.
    async fn rest(&mut self) -> anyhow::Result<()> {
        self.history.forget_states();
        let rests = |state: &GateState| state.motion == Motion::Standing && state.holder.is_none();
        self.history.state(PATIENCE, rests).await.context("the robot does not come to rest")?;
        Ok(())
    }
}

fn tell(commander: &Child, signal: Signal) -> anyhow::Result<()> {
    let pid = commander.id().and_then(|pid| i32::try_from(pid).ok()).context("the commander has ended")?;
    kill(Pid::from_raw(pid), signal).with_context(|| format!("{signal} to the commander"))
}

async fn end(commander: &mut Child) -> anyhow::Result<()> {
    commander.kill().await.context("end the commander")
}
