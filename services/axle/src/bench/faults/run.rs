//! One scenario: the robot drives, the fault comes and goes, the task ends, the robot drives again; then it is judged.

use super::bed::Bed;
use super::ears::{Ears, now};
use super::history::{self, What, brake, end_of, first_after, judge};
use super::report::Outcome;
use super::scenario::{Blow, Fault, Scenario, Task};
use anyhow::Context as _;
use axle_emulator::Random;
use axle_mesh::Retry;
use axle_schema::command::{Class, Done, Enable, Motion};
use axle_schema::task::Phase;
use axle_schema::{Pose, key};
use nix::sys::signal::Signal;
use std::collections::BTreeMap;
use std::net::TcpStream;
use std::time::Duration;
use tokio::process::Child;
use tokio::time::{Instant, sleep, timeout};

/// What must come at all.
const PATIENCE: Duration = Duration::from_secs(20);
/// How far each task goes, in m: some seconds, most of them at full speed.
const FAR: f64 = 1.8;
/// The way that shows afterwards that everything works again.
const AGAIN: f64 = 0.3;
/// At this speed, in m/s, the robot is on its way.
const FAST: f64 = 0.3;
/// A wheel that is slower stands.
const REST: f64 = 1e-3;

/// What a tool came to.
pub(super) struct Told {
    pub(super) code: Option<i32>,
    pub(super) words: String,
}

impl Told {
    /// Waits for the end of a tool.
    pub(super) async fn of(tool: Child) -> anyhow::Result<Self> {
        let output = timeout(PATIENCE, tool.wait_with_output()).await.context("a tool did not end")??;
        let words = String::from_utf8_lossy(&output.stderr);
        let last = words.lines().rev().find(|line| !line.is_empty()).unwrap_or_default();
        Ok(Self { code: output.status.code(), words: last.trim_start_matches("axle: ").to_owned() })
    }
    pub(super) const fn is_good(&self) -> bool {
        matches!(self.code, Some(0))
    }
}

/// A point so far ahead of the robot, as it is given to `axle go`.
fn ahead(pose: Pose, far: f64) -> String {
    let heading = pose.heading.0;
    format!("{:.4},{:.4}", pose.x.0 + far * heading.cos(), pose.y.0 + far * heading.sin())
}

impl Bed {
    /// Waits until every process works and the robot stands ready, and enables its drive if it has to be.
    pub(super) async fn is_ready(&mut self) -> anyhow::Result<()> {
        self.ears.forget();
        let has_word =
            |ears: &Ears| ears.state.clone().filter(|_| ears.pose.is_some() && ears.truly.is_some());
        let state = self.ears.until(PATIENCE, "the words of gate and navigator", has_word).await?;
        if !state.enabled {
            self.enable().await?;
        }
        let rests = |ears: &Ears| {
            let is_free = ears.state.as_ref().is_some_and(|state| {
                state.enabled && state.holder.is_none() && state.motion == Motion::Standing
            });
            let stands = ears
                .truly
                .and_then(|truly| truly.twist)
                .is_some_and(|twist| twist.v.0.abs() < REST && twist.omega.0.abs() < REST);
            (is_free && stands).then_some(())
        };
        self.ears.until(PATIENCE, "the robot to stand ready", rests).await?;
        self.everybody_answers().await
    }

    /// Enables the drive again after its board or its process was lost.
    pub(super) async fn enable(&mut self) -> anyhow::Result<()> {
        let end = Instant::now() + PATIENCE;
        loop {
            self.ears.forget();
            let state = self.ears.until(PATIENCE, "the gate's account", |ears| ears.state.clone()).await?;
            if state.enabled {
                return Ok(());
            }
            let mesh = &self.meshes["onboard"];
            let (by, class) = (mesh.name(), Class::Manual);
            let enable = Enable { stop: state.stop, boot: state.boot, echo: state.tick, by, class };
            let enabled: Result<Done, _> = mesh
                .ask(&key::ENABLE, Some(&self.robot), &enable, Duration::from_secs(2), Retry::Never)
                .await;
            match enabled {
                Ok(Done {}) => return Ok(()),
                // A board that has just been plugged in again is still being greeted.
                Err(refusal) if Instant::now() >= end => return Err(refusal).context("enable the drive"),
                Err(_) => sleep(Duration::from_millis(100)).await,
            }
        }
    }

    /// Waits until each process answers for itself at the workstation's router: the ways between all are there.
    async fn everybody_answers(&self) -> anyhow::Result<()> {
        let end = Instant::now() + PATIENCE;
        let wanted: Vec<_> =
            self.processes().into_keys().filter(|name| !name.starts_with("router-")).collect();
        loop {
            let seen = self.meshes["workstation"].everybody(Duration::from_millis(500)).await?;
            let answers = |name: &String| {
                seen.iter().any(|(presence, status)| presence.service == *name && status.is_some())
            };
            let Some(missing) = wanted.iter().find(|name| !answers(name)) else { return Ok(()) };
            anyhow::ensure!(Instant::now() < end, "{missing} does not answer at the workstation's router");
            sleep(Duration::from_millis(20)).await;
        }
    }

    /// Starts a task to a point ahead of where the robot believes to be.
    pub(super) fn go(&self, far: f64) -> anyhow::Result<Child> {
        let pose = self.ears.pose.context("nobody knows where the robot is")?.pose;
        self.tool(&["go", &ahead(pose, far)])
    }

    /// Until shortly before the clocks of a bed step, which they do some seconds after it was made.
    fn until_clocks_step(&self) -> Duration {
        super::STEP_AFTER.saturating_sub(self.begun.elapsed() + super::STEP_BEFORE)
    }

    /// Starts a task, and waits until the robot is fast, and a bit longer by chance.
    pub(super) async fn under_way(&mut self, random: &mut Random) -> anyhow::Result<Child> {
        let go = self.go(FAR)?;
        let is_fast =
            |ears: &Ears| ears.truly.and_then(|truly| truly.twist).filter(|twist| twist.v.0 > FAST).map(drop);
        self.ears.until(PATIENCE, "the robot to drive", is_fast).await?;
        sleep(Duration::from_secs_f64(0.3 + 0.5 * random.uniform())).await;
        self.ears.look();
        Ok(go)
    }
}

/// Plays a scenario on a bed that is ready.
///
/// # Errors
/// When the bed itself does not work, so that nothing can be judged.
pub(super) async fn play(bed: &mut Bed, scenario: &Scenario, seed: u64) -> anyhow::Result<Outcome> {
    bed.is_ready().await.context("before the fault")?;
    bed.ears.events.clear();
    let mut random = Random::new(seed, u64::from(name_number(scenario.name)));
    let before = bed.processes();
    let mut outcome = Outcome::of(scenario, seed);
    let mut load = None;
    let go = match scenario.fault {
        Fault::Taps(count) => {
            let (go, stuck) = super::load::stuck_taps(bed, count).await?;
            load = Some(stuck);
            go
        }
        Fault::Clocks => {
            sleep(bed.until_clocks_step()).await;
            bed.under_way(&mut random).await?
        }
        _ => bed.under_way(&mut random).await?,
    };
    let fault = now();
    inject(bed, scenario, &mut outcome).await?;
    let told = Told::of(go).await?;
    bed.ears.look();
    let is_reached = told.is_good();
    judge_task(scenario, &told, &bed.ears.events, &mut outcome);
    let delays = judge(&bed.ears.events).delays;
    // Whatever waited somewhere has come when everything works again; all that came is judged.
    if let Err(fault) = recovers(bed, scenario, &before, &mut outcome).await {
        outcome.violations.push(format!("it does not recover: {fault:#}"));
    }
    bed.ears.look();
    let events = std::mem::take(&mut bed.ears.events);
    let verdict = judge(&events);
    outcome.violations.extend(verdict.violations);
    outcome.oldest = verdict.ages.iter().copied().fold(0.0, f64::max);
    outcome.judged = verdict.ages.len();
    if let Some(load) = &load {
        load.judge(&delays, &mut outcome);
    }
    if !is_reached && matches!(scenario.fault, Fault::Process(..) | Fault::Link(..) | Fault::Cable(_)) {
        outcome.brake = brake(&events, fault);
        judge_brake(scenario, &mut outcome);
    }
    known(scenario, &events, fault, &mut outcome);
    Ok(outcome)
}

/// Whether the task ended as it had to, and whether pilot and person agree.
fn judge_task(scenario: &Scenario, told: &Told, events: &[history::Event], outcome: &mut Outcome) {
    outcome.told.clone_from(&told.words);
    let (seen, is_reached) = (end_of(events), told.is_good());
    match (scenario.task, is_reached) {
        (Task::Reached, false) => {
            outcome.violations.push(format!("the task was not reached: {}", told.words));
        }
        (Task::Ended, true) => outcome.violations.push("the task was reached all the same".into()),
        (_, false) if told.words.is_empty() => {
            outcome.violations.push("the task ended without a reason".into());
        }
        _ => {}
    }
    if is_reached && seen != Some(Phase::Done) {
        outcome.violations.push(format!("it was told as reached, and the pilot said {seen:?}"));
    }
}

/// Whether the wheels braked in time.
fn judge_brake(scenario: &Scenario, outcome: &mut Outcome) {
    match (scenario.brakes, outcome.brake) {
        (Some(_), None) => outcome.violations.push("the wheels did not come to rest".into()),
        (Some(most), Some(brake)) if brake > most => {
            outcome.violations.push(format!("the wheels braked after {brake:.0} ms, more than {most:.0}"));
        }
        _ => {}
    }
}

/// A number of a name: the chances of one scenario do not depend on the others.
fn name_number(name: &str) -> u32 {
    name.bytes().fold(0, |number: u32, byte| number.wrapping_mul(31).wrapping_add(byte.into()))
}

async fn inject(bed: &mut Bed, scenario: &Scenario, outcome: &mut Outcome) -> anyhow::Result<()> {
    match scenario.fault {
        Fault::Process(name, blow @ (Blow::Kill | Blow::Restart)) => {
            let before = bed.process(name);
            bed.tell(name, if blow == Blow::Kill { Signal::SIGKILL } else { Signal::SIGTERM })?;
            let Some(host) = name.strip_prefix("router-") else { return Ok(()) };
            let end = Instant::now() + PATIENCE;
            while bed.process(name) == before {
                anyhow::ensure!(Instant::now() < end, "{name} does not end");
                sleep(Duration::from_millis(2)).await;
            }
            listens(&bed.endpoints[host]).await?;
            outcome.healed = Some(now());
            Ok(())
        }
        Fault::Process(name, Blow::Freeze(time)) => {
            bed.tell(name, Signal::SIGSTOP)?;
            sleep(time).await;
            bed.tell(name, Signal::SIGCONT)?;
            outcome.healed = Some(now());
            Ok(())
        }
        Fault::Link(weathers, time) => {
            bed.link.set(weathers);
            sleep(time).await;
            bed.link.mend();
            outcome.healed = Some(now());
            Ok(())
        }
        Fault::Cable(time) => {
            super::cable::set(false).await?;
            sleep(time).await;
            super::cable::set(true).await?;
            outcome.healed = Some(now());
            Ok(())
        }
        Fault::Replay => super::load::replay(bed, outcome).await,
        Fault::Disk => super::disk::fill(bed.making.disk.as_deref().context("a bed without a disk")?),
        Fault::Stranger(knock) => super::load::stranger(bed, knock, outcome).await,
        Fault::Taps(_) | Fault::Clocks => Ok(()),
    }
}

/// Waits until everything works again, shows it by a drive, and looks whether anybody was restarted who had not to be.
async fn recovers(
    bed: &mut Bed,
    scenario: &Scenario,
    before: &BTreeMap<String, Option<u32>>,
    outcome: &mut Outcome,
) -> anyhow::Result<()> {
    if let (Fault::Disk, Some(disk)) = (scenario.fault, bed.making.disk.clone()) {
        super::load::stop_on_full_disk(bed, &disk, outcome).await?;
    }
    bed.is_ready().await?;
    let again = Told::of(bed.go(AGAIN)?).await?;
    if !again.is_good() {
        anyhow::bail!("the next task failed: {}", again.words);
    }
    let struck = match scenario.fault {
        Fault::Process(name, _) => name,
        // A recorder that cannot write ends, says why, and is tried again.
        Fault::Disk => "recorder",
        _ => "",
    };
    let after = bed.processes();
    let is_other = |name: &&String| **name != struck && before.get(*name) != after.get(*name);
    let restarted: Vec<_> = before.keys().filter(is_other).cloned().collect();
    anyhow::ensure!(restarted.is_empty(), "{} had to be restarted", restarted.join(", "));
    Ok(())
}

/// Waits until somebody listens at an endpoint.
async fn listens(endpoint: &str) -> anyhow::Result<()> {
    let address = endpoint.trim_start_matches("tcp/").trim_start_matches("tls/").to_owned();
    let end = Instant::now() + PATIENCE;
    while TcpStream::connect(&address).is_err() {
        anyhow::ensure!(Instant::now() < end, "nobody listens at {address}");
        sleep(Duration::from_millis(2)).await;
    }
    Ok(())
}

/// When the loss was known, and when data flowed again.
fn known(scenario: &Scenario, events: &[history::Event], fault: f64, outcome: &mut Outcome) {
    if let Fault::Process(name, Blow::Kill | Blow::Freeze(_)) = scenario.fault {
        let went = |what: &What| matches!(what, What::Came { service, came: false, .. } if service == name);
        outcome.known = first_after(events, fault, went).map(|at| (at - fault) * 1e3);
    }
    if let Some(healed) = outcome.healed {
        let crosses = |what: &What| matches!(what, What::Pose(_));
        outcome.resumed = first_after(events, healed, crosses).map(|at| (at - healed) * 1e3);
    }
}
