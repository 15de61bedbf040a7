//! The recorder as a process: everything that is said about a robot goes into an MCAP file.
//!
//! Samples wait in a bounded queue for a thread that may block on the disk; what does not fit is recorded as a gap.
//! A full disk ends the recording, loudly, and nothing else.

use super::Context;
use crate::params::load;
use axle_mesh::Raw;
use axle_recorder::{Recorder, RecorderParams, Sample};
use axle_schema::key;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Samples that may wait for the disk.
const WAITING: usize = 8192;
/// How long the writer waits for a sample before it looks whether a sync is due.
const PAUSE: Duration = Duration::from_millis(100);

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
    let recorder = Recorder::create(&path, &about, &params, nanoseconds_now())?;
    let tap = context.mesh.tap(&key::everything(Some(&robot)), WAITING)?;
    let (samples, waiting) = sync_channel(WAITING);
    let writer =
        std::thread::Builder::new().name("recorder".into()).spawn(move || write(recorder, &waiting))?;
    let _visible = context.ready()?;
    tracing::info!("recording to {}", path.display());
    let mut lost = Lost::default();
    loop {
        tokio::select! {
            raw = tap.next() => {
                if !lost.pass_on(&samples, raw, tap.dropped()) {
                    break;
                }
            }
            () = context.stop.wait() => break,
        }
    }
    drop(samples);
    writer.join().map_err(|_| anyhow::anyhow!("the writer of the recording broke down"))?
}

/// Where to record: the file of the parameters, or one named after the robot and the time.
///
/// A recorder that is restarted after a crash must not stumble over what it wrote before: a name that is taken gets a
/// number.
fn file(params: &RecorderParams, robot: &str) -> PathBuf {
    let Some(file) = &params.file else {
        return params.directory.join(format!("{robot}-{}.mcap", nanoseconds_now() / 1_000_000));
    };
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    (2..=999)
        .map(|number| file.with_file_name(format!("{stem}-{number}.mcap")))
        .find(|numbered| !file.exists() || !numbered.exists())
        .filter(|_| file.exists())
        .unwrap_or_else(|| file.clone())
}

fn nanoseconds_now() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
}

/// What goes to the writer.
enum Entry {
    Sample(Raw),
    Gap(u64),
}

/// Counts what the queue could not take, and tells the writer as soon as it can.
#[derive(Default)]
struct Lost {
    waiting: u64,
    told: u64,
}

impl Lost {
    /// Gives a sample to the writer; `false` when the writer has ended.
    fn pass_on(&mut self, samples: &SyncSender<Entry>, raw: Raw, dropped: u64) -> bool {
        self.waiting += dropped - self.told;
        self.told = dropped;
        if self.waiting > 0 && samples.try_send(Entry::Gap(self.waiting)).is_ok() {
            self.waiting = 0;
        }
        match samples.try_send(Entry::Sample(raw)) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                self.waiting += 1;
                true
            }
            Err(TrySendError::Disconnected(_)) => false,
        }
    }
}

fn write(mut recorder: Recorder, entries: &Receiver<Entry>) -> anyhow::Result<()> {
    loop {
        let now = nanoseconds_now();
        let written = match entries.recv_timeout(PAUSE) {
            Ok(Entry::Sample(raw)) => recorder.write(Sample {
                key: &raw.key,
                encoding: &raw.encoding,
                payload: &raw.payload,
                attachment: (!raw.attachment.is_empty()).then_some(&raw.attachment[..]),
                received: now,
            }),
            Ok(Entry::Gap(lost)) => recorder.gap("axle/**", lost, now),
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => break,
        };
        for result in [written, recorder.flush_if_due(now).map(drop)] {
            match result {
                Ok(()) => {}
                Err(fault) if fault.is_final() => return Err(fault.into()),
                Err(fault) => tracing::warn!("{fault}"),
            }
        }
    }
    let totals = recorder.finish()?;
    tracing::info!("recorded {} samples, {} lost", totals.samples, totals.lost);
    Ok(())
}
