//! `axle play FILE`: says again what was recorded, at its own pace, for whoever listens.
//!
//! What may move or stop a robot is left out, unless it is asked for. A gate refuses recorded commands all the same:
//! they are for another run of the robot, and too old.

use crate::cli::Play;
use crate::out::{is_watched, note, usage};
use crate::settings::Settings;
use anyhow::Context as _;
use axle_mesh::Mesh;
use axle_recorder::{Entry, Recorded, Recording};
use axle_schema::{RobotId, key};
use crossterm::event::{Event, KeyCode, KeyEventKind, KeyModifiers, poll, read};
use crossterm::terminal;
use std::collections::BTreeMap;
use std::io::IsTerminal as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until};

/// A pause in the recording is played no longer than this, in s.
const LONGEST: f64 = 3600.0;
/// What may move or stop a robot: the last chunk of the key, and for the gate's the last two.
const ACTS: [&str; 4] = ["task", "cancel", "power", "command"];

pub(super) async fn play(settings: &Settings, args: &Play) -> anyhow::Result<()> {
    if !(0.01..=1000.0).contains(&args.rate) {
        return Err(usage(format!("--rate {}: write 0.01 to 1000", args.rate)));
    }
    let robots = args.remap.iter().map(|text| pair(text)).collect::<anyhow::Result<BTreeMap<_, _>>>()?;
    // A file that is none is said before the mesh is joined.
    Recording::open(&args.file).map_err(super::record::unreadable)?;
    let mut stop = crate::signal::stop()?;
    let mesh = settings.join("play").await?;
    let mut player = Player {
        mesh: mesh.clone(),
        only: settings.robot.clone(),
        robots,
        rate: args.rate,
        commands: args.commands,
        said: 0,
        left_out: 0,
    };
    let mut keys = Keys::listen(args.paused)?;
    let outcome = tokio::select! {
        outcome = player.play(args, &mut keys) => outcome,
        () = stop.wait() => Ok(()),
    };
    drop(keys);
    note(&format!("said {} samples", player.said));
    if player.left_out > 0 {
        note(&format!(
            "{} commands, stops and orders were left out; --commands says them too",
            player.left_out
        ));
    }
    mesh.leave().await;
    outcome
}

/// `r1=r2`.
fn pair(text: &str) -> anyhow::Result<(String, RobotId)> {
    let wrong = |why: &dyn std::fmt::Display| usage(format!("--remap {text:?}: {why}; write r1=r2"));
    let (from, to) = text.split_once('=').ok_or_else(|| wrong(&"no ="))?;
    let from = RobotId::new(from).map_err(|refusal| wrong(&refusal))?;
    Ok((from.to_string(), RobotId::new(to).map_err(|refusal| wrong(&refusal))?))
}

struct Player {
    mesh: Mesh,
    only: Option<RobotId>,
    robots: BTreeMap<String, RobotId>,
    rate: f64,
    commands: bool,
    said: u64,
    left_out: u64,
}

impl Player {
    async fn play(&mut self, args: &Play, keys: &mut Keys) -> anyhow::Result<()> {
        loop {
            let mut recording = Recording::open(&args.file)?;
            let before = self.said;
            // When the sample of before was due, and when it was recorded.
            let mut last: Option<(Instant, u64)> = None;
            for entry in recording.by_ref() {
                let Entry::Sample(sample) = entry else { continue };
                let Some(key) = self.key(&sample) else { continue };
                let mut due = Instant::now();
                if let Some((at, recorded)) = last {
                    due = at + self.pause(recorded, sample.received);
                    sleep_until(due).await;
                }
                // What a pause took is not made up for.
                due += keys.pass().await;
                last = Some((due, sample.received));
                self.mesh
                    .put_bytes(&key, &sample.encoding, &sample.payload, sample.attachment.as_deref())
                    .with_context(|| format!("say {key}"))?;
                self.said += 1;
            }
            if let Some(cut) = &recording.account().cut {
                note(&format!("the recording is cut off: {cut}"));
            }
            anyhow::ensure!(self.said > before, "the recording holds nothing that could be said");
            if !args.again {
                return Ok(());
            }
        }
    }

    /// The time between two samples. Wall time may have stepped back: then there is none.
    #[allow(clippy::cast_precision_loss, reason = "a pause")]
    fn pause(&self, before: u64, now: u64) -> Duration {
        let seconds = now.saturating_sub(before) as f64 / 1e9 / self.rate;
        Duration::from_secs_f64(seconds.min(LONGEST))
    }

    /// Under which key a sample is said; `None` for one that is left out.
    fn key(&mut self, sample: &Recorded) -> Option<String> {
        let Some(place) = key::place(&sample.key) else { return Some(sample.key.to_string()) };
        if self.only.as_ref().is_some_and(|only| only.as_str() != place.robot) {
            return None;
        }
        let is_stop = (place.service, place.name) == ("gate", "stop");
        if (is_stop || ACTS.contains(&place.name)) && !self.commands {
            self.left_out += 1;
            return None;
        }
        let Some(robot) = self.robots.get(place.robot) else { return Some(sample.key.to_string()) };
        Some(key::moved(&sample.key, robot))
    }
}

/// The space bar of a terminal; without one, nothing pauses.
struct Keys {
    paused: mpsc::Receiver<()>,
    is_paused: bool,
    raw: bool,
    ending: Arc<AtomicBool>,
}

impl Keys {
    fn listen(paused: bool) -> anyhow::Result<Self> {
        let (sender, receiver) = mpsc::channel(16);
        let ending = Arc::new(AtomicBool::new(false));
        let raw = std::io::stdin().is_terminal() && is_watched();
        if paused && !raw {
            return Err(usage("--paused needs a terminal with a space bar"));
        }
        if raw {
            note("the space bar pauses and goes on; q ends");
            terminal::enable_raw_mode()?;
            let ending = Arc::clone(&ending);
            std::thread::spawn(move || hear(&sender, &ending));
        }
        Ok(Self { paused: receiver, is_paused: paused, raw, ending })
    }
    /// Goes on at once, or when the space bar says so; says how long that took.
    async fn pass(&mut self) -> Duration {
        while self.paused.try_recv().is_ok() {
            self.is_paused = !self.is_paused;
        }
        let began = Instant::now();
        while self.is_paused {
            if self.paused.recv().await.is_none() {
                break;
            }
            self.is_paused = false;
        }
        began.elapsed()
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        self.ending.store(true, Relaxed);
        if self.raw {
            // A terminal that is gone needs nothing put back.
            drop(terminal::disable_raw_mode());
        }
    }
}

/// Reads keys until the end; `q` and Ctrl-C end the program as Ctrl-C does elsewhere.
fn hear(paused: &mpsc::Sender<()>, ending: &AtomicBool) {
    while !ending.load(Relaxed) {
        if !matches!(poll(Duration::from_millis(100)), Ok(true)) {
            continue;
        }
        let Ok(Event::Key(key)) = read() else { continue };
        let is_control = key.modifiers.contains(KeyModifiers::CONTROL);
        match key.code {
            _ if key.kind == KeyEventKind::Release => {}
            KeyCode::Char(' ') => drop(paused.try_send(())),
            KeyCode::Char('q') | KeyCode::Esc => return interrupt(),
            KeyCode::Char('c') if is_control => return interrupt(),
            _ => {}
        }
    }
}

fn interrupt() {
    // This process exists as long as it runs.
    let _ = nix::sys::signal::kill(nix::unistd::Pid::this(), nix::sys::signal::Signal::SIGINT);
}
