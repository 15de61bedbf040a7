//! The recorder as a process: everything that is said about a robot goes into an MCAP file.
//!
//! Samples wait in a bounded queue for the beat of a thread that may block on the disk; what does not fit is recorded
//! as a gap. A full disk ends the recording, loudly, and nothing else.

use super::Context;
use crate::params::load;
use anyhow::Context as _;
use axle_mesh::Tap;
use axle_mesh::clock::wall_nanoseconds;
use axle_recorder::{RecordError, Recorder, RecorderParams, Sample, Totals};
use axle_schema::{Seconds, key};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use tokio::sync::oneshot;

/// Samples that may wait for the disk.
const WAITING: usize = 16_384;
/// How often the waiting samples are written: seldom, since waking up for each would cost more than writing it.
const PACE: Seconds = Seconds(0.05);

/// Records until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: RecorderParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let path = file(&params, robot.as_str());
    if let Some(directory) = path.parent() {
        std::fs::create_dir_all(directory)?;
    }
    let about = BTreeMap::from([
        ("axle".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("robot".to_owned(), robot.to_string()),
        ("process".to_owned(), context.mesh.name()),
    ]);
    let recorder = Recorder::create(&path, &about, &params, wall_nanoseconds())?;
    let tap = context.mesh.tap(&key::everything(Some(&robot)), WAITING)?;
    let (ended, mut outcome) = oneshot::channel();
    let stopping = Arc::new(AtomicBool::new(false));
    let mut desk =
        Desk { recorder: Some(recorder), tap, lost: 0, ended: Some(ended), stopping: Arc::clone(&stopping) };
    // A thread of its own may wait for the disk.
    let writing = context.mesh.beat_on_own_thread("recorder", PACE, move |_| desk.beat())?;
    let _visible = context.ready()?;
    tracing::info!("recording to {}", path.display());
    let early = tokio::select! {
        outcome = &mut outcome => Some(outcome),
        () = context.stop.wait() => None,
    };
    stopping.store(true, Relaxed);
    let outcome = match early {
        Some(outcome) => outcome,
        None => outcome.await,
    };
    tokio::task::spawn_blocking(move || drop(writing.join())).await?;
    let totals = outcome.context("the writer of the recording broke down")??;
    tracing::info!("recorded {} samples, {} lost", totals.samples, totals.lost);
    Ok(())
}

/// Where samples become a file.
struct Desk {
    recorder: Option<Recorder>,
    tap: Tap,
    /// Losses that are in the recording already.
    lost: u64,
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
        let Some(recorder) = self.recorder.take() else { return false };
        // What was written before a full disk is closed as well as can be; the reason is told all the same.
        let finished = recorder.finish();
        let outcome = written.and(finished);
        if let Some(ended) = self.ended.take() {
            // Nobody waits any more when the process is ending in a hurry.
            drop(ended.send(outcome));
        }
        false
    }

    fn write(&mut self) -> Result<(), RecordError> {
        let Some(recorder) = &mut self.recorder else { return Err(RecordError::Ended) };
        let now = wall_nanoseconds();
        let dropped = self.tap.dropped();
        if dropped > self.lost {
            recorder.gap("**", dropped - self.lost, now)?;
            self.lost = dropped;
        }
        // What arrives meanwhile waits for the next beat, so that a flood cannot hold the flush up.
        for _ in 0..WAITING {
            let Some(raw) = self.tap.take() else { break };
            let sample = Sample {
                key: &raw.key,
                encoding: &raw.encoding,
                payload: &raw.payload,
                attachment: (!raw.attachment.is_empty()).then_some(&raw.attachment[..]),
                received: raw.received,
            };
            match recorder.write(sample) {
                Err(fault) if !fault.is_final() => tracing::warn!("{fault}"),
                other => other?,
            }
        }
        recorder.flush_if_due(now).map(drop)
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
