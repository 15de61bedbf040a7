//! Recordings out of recordings: what a crash left made whole, and a part cut out.

use crate::series::Holding;
use crate::{Account, Entry, ReadError, RecordError, Recorder, RecorderParams, Recording, Sample, Totals};
use std::path::Path;

/// Which part of a recording is copied.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// From so many nanoseconds after its beginning.
    pub from: u64,
    /// To so many nanoseconds after its beginning; `None` = to its end.
    pub to: Option<u64>,
    /// Only keys that hold one of these texts; none = all.
    pub only: Vec<String>,
}

/// Why a recording was not copied.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CopyError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new one cannot be written.
    #[error(transparent)]
    Write(#[from] RecordError),
}

/// Writes a part of a recording into a new one; says what was found and what was written. Samples that still hold at
/// the beginning of the part (the plan, the task) are in it too.
///
/// # Errors
/// [`CopyError`]; a file that exists is never overwritten.
pub fn copy(from: &Path, to: &Path, part: &Part) -> Result<(Account, Totals), CopyError> {
    let mut recording = Recording::open(from)?;
    // The file's metadata stands before its first sample, and is known when that one is.
    let first = recording.next();
    let began = match &first {
        Some(Entry::Sample(sample)) => sample.received,
        Some(Entry::Gap { at, .. }) => *at,
        None => 0,
    };
    let about = recording.about().clone();
    let params = RecorderParams { file_gb: 1000.0, ..RecorderParams::default() };
    let mut recorder = Recorder::create(to, &about, &params, began)?;
    let mut holding = Some(Holding::default());
    for entry in first.into_iter().chain(recording.by_ref()) {
        let (at, key) = match &entry {
            Entry::Sample(sample) => (sample.received, &*sample.key),
            Entry::Gap { key, at, .. } => (*at, key.as_str()),
        };
        // Samples come in the order of their arrival, but wall time may step.
        let since = at.saturating_sub(began);
        let wanted = part.only.is_empty() || part.only.iter().any(|text| key.contains(text.as_str()));
        if !wanted || part.to.is_some_and(|to| since > to) {
            continue;
        }
        let is_before = since < part.from;
        if !is_before && let Some(holding) = holding.take() {
            holding.write(&mut recorder)?;
        }
        match &entry {
            Entry::Sample(sample) => {
                let sample = Sample {
                    key: &sample.key,
                    encoding: &sample.encoding,
                    payload: &sample.payload,
                    attachment: sample.attachment.as_deref(),
                    received: sample.received,
                };
                if !is_before {
                    write(&mut recorder, sample)?;
                } else if let Some(holding) = &mut holding {
                    holding.keep(&sample);
                }
            }
            Entry::Gap { key, lost, at } if !is_before => recorder.gap(key, *lost, *at)?,
            Entry::Gap { .. } => {}
        }
    }
    let totals = recorder.finish()?;
    Ok((recording.account().clone(), totals))
}

fn write(recorder: &mut Recorder, sample: Sample<'_>) -> Result<(), RecordError> {
    match recorder.write(sample) {
        Err(fault) if fault.is_final() => Err(fault),
        // One that is too large for a recording was not recorded by Axle; it is counted.
        _ => Ok(()),
    }
}
