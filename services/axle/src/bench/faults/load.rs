//! Faults that somebody makes: who watches and is stuck, who says everything again, who has no business here.

use super::bed::Bed;
use super::disk;
use super::history::judge;
use super::keys::Knock;
use super::report::{Outcome, quantile};
use super::run::Told;
use anyhow::Context as _;
use axle_schema::key;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;
use tokio::process::{Child, Command};
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep};

/// What a command may come later for everybody who is stuck, in ms.
const SLOWER: f64 = 5.0;
/// The flood: so many bytes, so often.
const FLOOD: (usize, Duration) = (1024, Duration::from_millis(2));
/// How long is listened before everything is said again.
const LISTENING: Duration = Duration::from_millis(800);
/// How often it is said again.
const TIMES: usize = 5;
/// What must come at all.
const PATIENCE: Duration = Duration::from_secs(30);
/// How far a robot drives to have its commands timed, in m.
const FAR: f64 = 1.8;

/// Taps that are stuck and a flood, as long as this is kept.
pub(super) struct Load {
    _taps: Vec<Child>,
    flood: JoinHandle<()>,
    /// What 99 of 100 commands took without it, in ms.
    before: f64,
}

impl Drop for Load {
    fn drop(&mut self) {
        self.flood.abort();
    }
}

/// Drives once and times the commands; then so many taps get stuck in a flood, and it drives again.
pub(super) async fn stuck_taps(bed: &mut Bed, count: u32) -> anyhow::Result<(Child, Load)> {
    bed.ears.look();
    bed.ears.events.clear();
    let told = Told::of(bed.go(FAR)?).await?;
    anyhow::ensure!(told.is_good(), "the drive to compare with: {}", told.words);
    bed.ears.look();
    let before = quantile(&judge(&bed.ears.events).delays, 0.99);
    let mut taps = Vec::new();
    for number in 0..count {
        taps.push(tap(bed, number)?);
    }
    let end = Instant::now() + PATIENCE;
    for (number, tap) in (0..count).zip(&taps) {
        let said = bed.scratch.join(format!("tap-{number}"));
        while std::fs::metadata(&said).map_or(0, |file| file.len()) == 0 {
            anyhow::ensure!(Instant::now() < end, "a tap hears nothing");
            sleep(Duration::from_millis(20)).await;
        }
        let pid = tap.id().and_then(|pid| i32::try_from(pid).ok()).context("a tap has ended")?;
        kill(Pid::from_raw(pid), Signal::SIGSTOP).context("freeze a tap")?;
    }
    let mesh = bed.meshes["workstation"].clone();
    let flooded = key::BENCH.0.of(&bed.robot);
    let flood = tokio::spawn(async move {
        let bytes = vec![0; FLOOD.0];
        loop {
            // A link that is full loses it, as it should.
            drop(mesh.put_bytes(flooded.as_str(), "", &bytes, None));
            sleep(FLOOD.1).await;
        }
    });
    bed.is_ready().await.context("with stuck taps")?;
    bed.ears.events.clear();
    Ok((bed.go(FAR)?, Load { _taps: taps, flood, before }))
}

/// A tap of everything, which writes what it hears into a file.
fn tap(bed: &Bed, number: u32) -> anyhow::Result<Child> {
    let said = std::fs::File::create(bed.scratch.join(format!("tap-{number}")))?;
    let everything = key::everything(Some(&bed.robot));
    Command::new(std::env::current_exe()?)
        .args(["tap", &everything, "--json", "--connect", &bed.endpoints["workstation"], "--log", "error"])
        .stdin(Stdio::null())
        .stdout(said)
        .stderr(Stdio::null())
        .kill_on_drop(true)
        .spawn()
        .context("start a tap")
}

impl Load {
    /// Compares the commands of the drive with those of before.
    pub(super) fn judge(&self, delays: &[f64], outcome: &mut Outcome) {
        let (before, now) = (self.before, quantile(delays, 0.99));
        outcome.figure = Some(format!("99 % of commands within {now:.1} ms, {before:.1} ms without"));
        outcome.slower = Some(now - before);
        if now - before > SLOWER {
            outcome.violations.push(format!("commands came {:.1} ms later", now - before));
        }
    }
}

/// Says everything that is commanded again, newest first, in the robot's own network.
pub(super) async fn replay(bed: &mut Bed, outcome: &mut Outcome) -> anyhow::Result<()> {
    let mesh = bed.meshes["onboard"].clone();
    let tap = mesh.tap(key::COMMAND.of(&bed.robot).as_str(), 4096)?;
    sleep(LISTENING).await;
    let heard: Vec<_> = std::iter::from_fn(|| tap.take()).collect();
    let refused = |bed: &Bed| bed.ears.state.as_ref().map_or(0, |state| state.rejected.values().sum::<u64>());
    bed.ears.look();
    let before = refused(bed);
    for _ in 0..TIMES {
        for raw in heard.iter().rev() {
            mesh.put_bytes(&raw.key, &raw.encoding, &raw.payload, Some(&raw.attachment))?;
        }
        sleep(Duration::from_millis(50)).await;
    }
    let said = heard.len() * TIMES;
    let all = u64::try_from(said)? + before;
    let is_counted =
        bed.ears.until(Duration::from_secs(5), "the gate to refuse what was said again", |ears| {
            let state = ears.state.as_ref()?;
            (state.rejected.values().sum::<u64>() >= all).then_some(())
        });
    if is_counted.await.is_err() {
        let counted = refused(bed) - before;
        outcome.violations.push(format!("of {said} that were said again {counted} were refused"));
    }
    outcome.figure = Some(format!("{said} commands said again, {} refused", refused(bed) - before));
    Ok(())
}

/// A stop on a full disk works all the same, and says that it could not be stored.
pub(super) async fn stop_on_full_disk(
    bed: &mut Bed,
    disk: &Path,
    outcome: &mut Outcome,
) -> anyhow::Result<()> {
    let stop = Told::of(bed.tool(&["stop"])?).await?;
    if !stop.is_good() || !stop.words.contains("could not store") {
        outcome.violations.push(format!("a stop on a full disk: {}", stop.words));
    }
    outcome.figure = Some(stop.words);
    disk::empty(disk)
}

/// Tries to stop the robot and to send it elsewhere.
pub(super) async fn stranger(bed: &Bed, knock: Knock, outcome: &mut Outcome) -> anyhow::Result<()> {
    let keys = bed.making.keys.as_deref().context("a bed without keys")?;
    let identity = knock.identity(keys);
    let mut words = String::new();
    for deed in [&["stop"][..], &["go", "0,0"]] {
        let told = Told::of(bed.tool_as(identity.as_deref(), knock.variables(), deed)?).await?;
        if told.is_good() {
            outcome.violations.push(format!("a stranger could {}", deed.join(" ")));
        }
        words = told.words;
    }
    if !words.contains(knock.words()) {
        outcome
            .violations
            .push(format!("a stranger was told {words:?}, which does not say {:?}", knock.words()));
    }
    outcome.figure = Some(words);
    Ok(())
}
