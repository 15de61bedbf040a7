//! The recorder as a process: everything that is said about a robot goes into an MCAP file.
//!
//! Samples wait in a bounded queue for the beat of a thread that may block on the disk; what does not fit is recorded
//! as a gap. A full disk ends the recording, loudly, and nothing else.

use super::Context;
use crate::params::load;
use crate::signal::Stop;
use anyhow::Context as _;
use axle_mesh::clock::wall_nanoseconds;
use axle_mesh::{Alarm, Mesh, Raw, Tap};
use axle_recorder::{RecordError, RecorderParams, Sample, Series, Totals};
use axle_schema::{Seconds, key};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::oneshot;

/// Samples that may wait for the disk.
const WAITING: usize = 16_384;
/// How often the waiting samples are written: seldom, since waking up for each would cost more than writing it.
const PACE: Seconds = Seconds(0.05);

/// Records until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: RecorderParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let recording =
        Recording::begin(&context.mesh, &[key::everything(Some(&robot))], robot.as_str(), params)?;
    let _visible = context.ready()?;
    tracing::info!("recording to {}", recording.path.display());
    let totals = recording.end(&mut context.stop).await?;
    tracing::info!("recorded {} samples, {} lost", totals.samples, totals.lost);
    Ok(())
}

/// A recording of some keys that is being made.
pub(crate) struct Recording {
    /// Its first file.
    pub(crate) path: PathBuf,
    outcome: oneshot::Receiver<Result<Totals, RecordError>>,
    stopping: Arc<AtomicBool>,
    writing: std::thread::JoinHandle<()>,
}

impl Recording {
    /// Begins a recording of these keys, named after `who`.
    ///
    /// # Errors
    /// When the file cannot be made, or a key expression is none.
    pub(crate) fn begin(
        mesh: &Mesh,
        keys: &[String],
        who: &str,
        params: RecorderParams,
    ) -> anyhow::Result<Self> {
        // Where files may not grow beyond a limit, the system would end the process; so a write fails instead, as on a
        // full disk.
        let limit = SignalKind::from_raw(nix::sys::signal::Signal::SIGXFSZ as i32);
        drop(signal(limit).context("hear of the limit of a file's size")?);
        let path = file(&params, who);
        if let Some(directory) = path.parent() {
            std::fs::create_dir_all(directory)?;
        }
        let about = BTreeMap::from([
            ("axle".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("robot".to_owned(), who.to_owned()),
            ("process".to_owned(), mesh.name()),
        ]);
        let taps = keys
            .iter()
            .map(|key| Ok(Ear { key: key.clone(), tap: mesh.tap(key, WAITING)?, lost: 0 }))
            .collect::<Result<_, axle_mesh::Fault>>()?;
        let series = Series::create(&path, about, params, wall_nanoseconds())?;
        let (ended, outcome) = oneshot::channel();
        let stopping = Arc::new(AtomicBool::new(false));
        let mut desk =
            Desk { series: Some(series), taps, ended: Some(ended), stopping: Arc::clone(&stopping) };
        // A thread of its own may wait for the disk.
        let writing = mesh.beat_on_own_thread("recorder", PACE, Alarm::default(), move |_| desk.beat())?;
        Ok(Self { path, outcome, stopping, writing })
    }

    /// Goes on until it is told to stop, or fails; closes the file.
    ///
    /// # Errors
    /// Why the recording ended early: a full disk, its limit.
    pub(crate) async fn end(mut self, stop: &mut Stop) -> anyhow::Result<Totals> {
        let early = tokio::select! {
            outcome = &mut self.outcome => Some(outcome),
            () = stop.wait() => None,
        };
        self.stopping.store(true, Relaxed);
        let outcome = match early {
            Some(outcome) => outcome,
            None => self.outcome.await,
        };
        tokio::task::spawn_blocking(move || drop(self.writing.join())).await?;
        Ok(outcome.context("the writer of the recording broke down")??)
    }
}

/// A key expression that is heard.
struct Ear {
    key: String,
    tap: Tap,
    /// Losses that are in the recording already.
    lost: u64,
}

/// Where samples become a file.
struct Desk {
    series: Option<Series>,
    taps: Vec<Ear>,
    ended: Option<oneshot::Sender<Result<Totals, RecordError>>>,
    stopping: Arc<AtomicBool>,
}

impl Desk {
    /// Writes what waits; `false` when the recording has ended.
    fn beat(&mut self) -> bool {
        let is_last = self.stopping.load(Relaxed);
        let written = self.write();
        if written.is_ok() && !is_last {
            return true;
        }
        let Some(series) = self.series.take() else { return false };
        // What was written before a full disk is closed as well as can be; the reason is told all the same.
        let finished = series.finish();
        let outcome = written.and(finished);
        if let Some(ended) = self.ended.take() {
            // Nobody waits any more when the process is ending in a hurry.
            drop(ended.send(outcome));
        }
        false
    }

    fn write(&mut self) -> Result<(), RecordError> {
        let Some(series) = &mut self.series else { return Err(RecordError::Ended) };
        let now = wall_nanoseconds();
        for Ear { key, tap, lost } in &mut self.taps {
            let dropped = tap.dropped();
            if dropped > *lost {
                series.gap(key, dropped - *lost, now)?;
                *lost = dropped;
            }
        }
        // What arrives meanwhile waits for the next beat, so that a flood cannot hold the flush up.
        let mut waiting: Vec<Raw> =
            self.taps.iter().flat_map(|ear| (0..WAITING).map_while(|_| ear.tap.take())).collect();
        if self.taps.len() > 1 {
            waiting.sort_by_key(|raw| raw.received);
        }
        for raw in waiting {
            let sample = Sample {
                key: &raw.key,
                encoding: &raw.encoding,
                payload: &raw.payload,
                attachment: (!raw.attachment.is_empty()).then_some(&raw.attachment[..]),
                received: raw.received,
            };
            match series.write(sample) {
                Err(fault) if !fault.is_final() => tracing::warn!("{fault}"),
                other => other?,
            }
        }
        series.flush_if_due(now).map(drop)
    }
}

/// Where to record: the file of the parameters, or one named after the robot and the time.
///
/// A recorder that is restarted after a crash must not stumble over what it wrote before: a name that is taken gets a
/// number.
fn file(params: &RecorderParams, robot: &str) -> PathBuf {
    let Some(file) = &params.file else {
        return params.directory.join(format!("{robot}-{}.mcap", wall_nanoseconds() / 1_000_000));
    };
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    (2..=999)
        .map(|number| file.with_file_name(format!("{stem}-{number}.mcap")))
        .find(|numbered| !file.exists() || !numbered.exists())
        .filter(|_| file.exists())
        .unwrap_or_else(|| file.clone())
}
