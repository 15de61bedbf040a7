//! A recording in several files: a new one when the newest is full or old, the oldest removed.
//!
//! Each file can be read alone. What was said once and still holds (the way, the plan, the movements, a task, the gate's
//! state) is written again at the beginning of the next file, with its own time.

use crate::{RecordError, Recorder, RecorderParams, Sample, Totals};
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

/// The last chunks of keys that hold until they are said again.
const HOLDING: [&str; 5] = ["way", "plan", "drive", "task", "state"];
/// The most samples, and the most bytes, that are kept for the next file.
const KEPT: (usize, usize) = (256, 16 * 1024 * 1024);

/// A sample of its own.
#[derive(Clone, Debug)]
struct Kept {
    encoding: String,
    payload: Vec<u8>,
    attachment: Option<Vec<u8>>,
    received: u64,
}

/// Samples that hold until they are said again, by key.
#[derive(Clone, Debug, Default)]
pub(crate) struct Holding {
    kept: BTreeMap<String, Kept>,
    bytes: usize,
}

impl Holding {
    /// Keeps a sample if it is of that kind.
    pub(crate) fn keep(&mut self, sample: &Sample<'_>) {
        let holds = sample.key.rsplit_once('/').is_some_and(|(_, name)| HOLDING.contains(&name));
        if !holds {
            return;
        }
        let old = self.kept.get(sample.key).map_or(0, |kept| kept.payload.len());
        let is_new = !self.kept.contains_key(sample.key);
        let bytes = self.bytes - old + sample.payload.len();
        if bytes > KEPT.1 || (is_new && self.kept.len() >= KEPT.0) {
            return;
        }
        self.bytes = bytes;
        let kept = Kept {
            encoding: sample.encoding.to_owned(),
            payload: sample.payload.to_vec(),
            attachment: sample.attachment.map(<[u8]>::to_vec),
            received: sample.received,
        };
        self.kept.insert(sample.key.to_owned(), kept);
    }
    /// Writes them.
    ///
    /// # Errors
    /// As [`Recorder::write`].
    pub(crate) fn write(&self, recorder: &mut Recorder) -> Result<(), RecordError> {
        let mut kept: Vec<_> = self.kept.iter().collect();
        kept.sort_by_key(|(_, kept)| kept.received);
        for (key, Kept { encoding, payload, attachment, received }) in kept {
            let attachment = attachment.as_deref();
            match recorder.write(Sample { key, encoding, payload, attachment, received: *received }) {
                Err(fault) if fault.is_final() => return Err(fault),
                _ => {}
            }
        }
        Ok(())
    }
}

/// A recording that may go on in further files.
pub struct Series {
    recorder: Option<Recorder>,
    about: BTreeMap<String, String>,
    params: RecorderParams,
    /// The first file, and the number of the newest.
    path: PathBuf,
    number: u32,
    files: VecDeque<PathBuf>,
    /// When the newest file was begun, in nanoseconds since 1970.
    begun: u64,
    holding: Holding,
    before: Totals,
}

impl Series {
    /// Makes the first file at `path`, as [`Recorder::create`] does.
    ///
    /// # Errors
    /// As [`Recorder::create`].
    pub fn create(
        path: &Path,
        about: BTreeMap<String, String>,
        params: RecorderParams,
        now: u64,
    ) -> Result<Self, RecordError> {
        let recorder = Recorder::create(path, &about, &params, now)?;
        Ok(Self {
            recorder: Some(recorder),
            about,
            params,
            path: path.to_owned(),
            number: 1,
            files: VecDeque::from([path.to_owned()]),
            begun: now,
            holding: Holding::default(),
            before: Totals::default(),
        })
    }

    /// The files that are there, oldest first.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(PathBuf::as_path)
    }

    /// Records a sample, in a new file if the newest is full or old.
    ///
    /// # Errors
    /// As [`Recorder::write`].
    pub fn write(&mut self, sample: Sample<'_>) -> Result<(), RecordError> {
        if self.is_old(sample.received) {
            self.rotate(sample.received)?;
        }
        let written = match self.open()?.write(sample) {
            Err(RecordError::Full { .. }) if self.params.files > 1 => {
                self.rotate(sample.received)?;
                self.open()?.write(sample)
            }
            other => other,
        };
        self.holding.keep(&sample);
        written
    }

    /// As [`Recorder::gap`].
    ///
    /// # Errors
    /// As [`Recorder::gap`].
    pub fn gap(&mut self, key: &str, lost: u64, now: u64) -> Result<(), RecordError> {
        match self.open()?.gap(key, lost, now) {
            Err(RecordError::Full { .. }) if self.params.files > 1 => {
                self.rotate(now)?;
                self.open()?.gap(key, lost, now)
            }
            other => other,
        }
    }

    /// As [`Recorder::flush_if_due`].
    ///
    /// # Errors
    /// As [`Recorder::flush_if_due`].
    pub fn flush_if_due(&mut self, now: u64) -> Result<bool, RecordError> {
        self.open()?.flush_if_due(now)
    }

    /// As [`Recorder::finish`]; the totals are those of all files, also of those that were removed.
    ///
    /// # Errors
    /// As [`Recorder::finish`].
    pub fn finish(mut self) -> Result<Totals, RecordError> {
        let recorder = self.recorder.take().ok_or(RecordError::Ended)?;
        Ok(sum(self.before, recorder.finish()?))
    }

    fn open(&mut self) -> Result<&mut Recorder, RecordError> {
        self.recorder.as_mut().ok_or(RecordError::Ended)
    }

    fn is_old(&self, now: u64) -> bool {
        let Some(minutes) = self.params.file_minutes.filter(|_| self.params.files > 1) else { return false };
        // Wall time may step back: then the file is as young as it can be.
        std::time::Duration::from_nanos(now.saturating_sub(self.begun)).as_secs_f64() >= minutes * 60.0
    }

    /// Closes the file, opens the next one, and removes the oldest.
    fn rotate(&mut self, now: u64) -> Result<(), RecordError> {
        let Some(recorder) = self.recorder.take() else { return Err(RecordError::Ended) };
        self.before = sum(self.before, recorder.finish()?);
        let path = self.next_path();
        let mut recorder = Recorder::create(&path, &self.about, &self.params, now)?;
        self.holding.write(&mut recorder)?;
        self.recorder = Some(recorder);
        self.begun = now;
        self.files.push_back(path);
        while self.files.len() > self.params.files as usize {
            if let Some(oldest) = self.files.pop_front() {
                // A file that somebody else has moved away takes no room here.
                drop(std::fs::remove_file(oldest));
            }
        }
        Ok(())
    }

    fn next_path(&mut self) -> PathBuf {
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        loop {
            self.number += 1;
            let path = self.path.with_file_name(format!("{stem}.{:03}.mcap", self.number));
            if !path.exists() {
                return path;
            }
        }
    }
}

const fn sum(a: Totals, b: Totals) -> Totals {
    Totals {
        samples: a.samples + b.samples,
        lost: a.lost.saturating_add(b.lost),
        refused: a.refused + b.refused,
        bytes: a.bytes + b.bytes,
    }
}
