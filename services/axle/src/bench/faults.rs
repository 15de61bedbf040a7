//! `axle bench faults`: every fault that a robot on two computers meets, one after the other, while it drives.
//!
//! Processes are killed, frozen and restarted; the link between the computers is cut, slowed down and spoilt; commands are
//! said again; watchers get stuck; disks are full, clocks step, strangers knock. Everything that is said is heard meanwhile,
//! and a judge who knows nothing of the fault looks at that history. Each fault has a seed, from which its moment and its
//! chances come.

mod bed;
mod cable;
mod disk;
mod ears;
mod history;
mod keys;
mod load;
mod report;
mod run;
mod scenario;

use crate::out::{data, note, usage};
use crate::settings::Settings;
use crate::signal;
use crate::topology::Place;
use axle_mesh::clock::STEP;
use bed::{Bed, Making};
use cable::Cable;
use disk::Disk;
pub(super) use report::quantile;
use report::{Outcome, say, sum_up};
use scenario::{Fault, SCENARIOS, Scenario, chosen};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

/// What the command line says.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Faults {
    /// Only these faults, by name or by the first word of their names; may be given several times
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(crate) only: Vec<String>,
    /// What moments and chances come from
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) seed: u64,
    /// Print the names of all faults, and do nothing
    #[arg(long)]
    pub(crate) list: bool,
    /// Print one JSON object a fault
    #[arg(long)]
    pub(crate) json: bool,
}

/// Injects them.
///
/// # Errors
/// How many of them were not borne.
pub(crate) async fn faults(settings: &Settings, args: &Faults) -> anyhow::Result<()> {
    if args.list {
        return SCENARIOS.iter().try_for_each(|scenario| Ok(data(scenario.name)?));
    }
    let chosen = chosen(&args.only);
    if chosen.is_empty() {
        return Err(usage(format!("--only {}: no such fault; --list names them", args.only.join(","))));
    }
    let mut stop = signal::stop()?;
    let mut suite = Suite { settings: settings.alone(), bed: None };
    let mut outcomes = Vec::new();
    for scenario in &chosen {
        let outcome = tokio::select! {
            outcome = suite.play(scenario, args.seed) => outcome,
            () = stop.wait() => break,
        };
        say(&outcome, args.json)?;
        outcomes.push(outcome);
    }
    suite.end().await;
    let result = sum_up(&outcomes, args.json);
    anyhow::ensure!(outcomes.len() == chosen.len(), "ended before all faults were there");
    result
}

/// So long after a bed was made its clocks step, and so long before a task begins that is then under way.
const STEP_AFTER: Duration = Duration::from_secs(8);
const STEP_BEFORE: Duration = Duration::from_millis(1200);

/// The bed that most faults share.
struct Suite {
    settings: Settings,
    bed: Option<Bed>,
}

impl Suite {
    async fn play(&mut self, scenario: &Scenario, seed: u64) -> Outcome {
        let outcome = match scenario.fault {
            Fault::Process(..) | Fault::Link(..) | Fault::Replay | Fault::Taps(_) => {
                self.share(scenario, seed).await
            }
            _ => alone(&self.settings, scenario, seed).await,
        };
        outcome.unwrap_or_else(|fault| Outcome::broken(scenario, seed, &fault))
    }

    async fn share(&mut self, scenario: &Scenario, seed: u64) -> anyhow::Result<Outcome> {
        if self.bed.is_none() {
            self.bed = Some(Bed::make(&self.settings, &Making::default(), seed).await?);
        }
        let Some(bed) = &mut self.bed else { anyhow::bail!("there is no bed") };
        let outcome = run::play(bed, scenario, seed).await;
        // What one fault has left in pieces is no ground for the next.
        if outcome.as_ref().map_or(true, |outcome| !outcome.violations.is_empty()) {
            keep_log(bed, scenario);
            self.end().await;
        }
        outcome
    }

    async fn end(&mut self) {
        if let Some(bed) = self.bed.take() {
            bed.end().await;
        }
    }
}

/// Keeps the log of a bed on which a fault was not borne.
fn keep_log(bed: &Bed, scenario: &Scenario) {
    let kept = std::env::temp_dir().join(format!("axle-fault-{}.log", scenario.name));
    if std::fs::copy(bed.scratch.join("faults.log"), &kept).is_ok() {
        note(&format!("    its processes' words are in {}", kept.display()));
    }
}

/// Plays a fault that needs a bed of its own.
async fn alone(settings: &Settings, scenario: &Scenario, seed: u64) -> anyhow::Result<Outcome> {
    let skipped = |why: anyhow::Error| Ok(Outcome::skipped(scenario, seed, &why));
    let (mut cable, mut disk) = (None, None);
    let mut making = Making::default();
    match scenario.fault {
        Fault::Cable(_) => match Cable::lay().await {
            Ok((laid, made)) => (cable, making) = (Some(laid), made),
            Err(why) => return skipped(why),
        },
        Fault::Disk => match Disk::mount().await {
            Ok(mounted) => {
                making.disk = Some(mounted.path().to_owned());
                disk = Some(mounted);
            }
            Err(why) => return skipped(why),
        },
        Fault::Clocks => making.places = clocks(),
        Fault::Stranger(_) => making.keys = Some(keys_directory(scenario)?),
        _ => {}
    }
    let mut bed = Bed::make(settings, &making, seed).await?;
    let outcome = run::play(&mut bed, scenario, seed).await;
    if outcome.as_ref().map_or(true, |outcome| !outcome.violations.is_empty()) {
        keep_log(&bed, scenario);
    }
    bed.end().await;
    drop((cable, disk));
    if let Some(keys) = &making.keys {
        keys::remove(keys);
    }
    outcome
}

/// The robot's clock goes ahead by an hour, the workstation's back by ten years, both while the robot drives.
fn clocks() -> BTreeMap<&'static str, Place> {
    let step = |step: &str| Place {
        within: Vec::new(),
        variables: vec![(STEP.to_owned(), format!("{step}@{}", STEP_AFTER.as_secs()))],
    };
    BTreeMap::from([("onboard", step("3600")), ("workstation", step("-315360000"))])
}

fn keys_directory(scenario: &Scenario) -> anyhow::Result<PathBuf> {
    let directory = std::env::temp_dir().join(format!("axle-keys-{}-{}", std::process::id(), scenario.name));
    drop(std::fs::remove_dir_all(&directory));
    Ok(directory)
}
