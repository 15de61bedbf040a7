//! The AllStop in force, on disk, so that a crash, a restart or a power cut does not end it.
//!
//! The beat of the gate never waits for a disk: it says what shall be kept, and a thread of its own writes it. The
//! gate's state says when it is stored. A stop that cannot be stored is in force all the same; the thread tries again
//! every second and says so. Ending a stop removes the file after the gate has been enabled: a crash in between leaves the robot
//! stopped.

use anyhow::Context as _;
use axle_schema::{RobotId, StopId};
use std::fs::{self, File};
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

/// A disk that refuses is asked again after this time.
const AGAIN: Duration = Duration::from_secs(1);
/// The stop of a file that cannot be read: somebody stopped the robot, and only the name of the stop is lost.
const UNREADABLE: StopId = StopId(0);

/// Keeps the AllStop of one robot.
pub(crate) struct Latch {
    shared: Arc<Shared>,
    /// What was asked to be kept last, so that a beat without news takes no lock.
    asked: Option<StopId>,
}

struct Shared {
    state: Mutex<State>,
    news: Condvar,
}

struct State {
    wanted: Option<StopId>,
    stored: Option<StopId>,
    is_over: bool,
}

impl Latch {
    /// Reads what was kept for this robot, and finds out whether the directory can be written.
    ///
    /// # Errors
    /// When the directory cannot be made or written: a robot whose stop would not outlive a crash does not start.
    pub(crate) fn open(directory: &Path, robot: &RobotId) -> anyhow::Result<Self> {
        let path = directory.join(format!("{robot}.stop"));
        let advice = "an AllStop is kept there, so that it outlives a restart; choose a directory with --state DIR or AXLE_STATE";
        let described = || format!("cannot write {}: {advice}", path.display());
        fs::create_dir_all(directory).with_context(described)?;
        let kept = read(&path).with_context(described)?;
        // Written once now, so that a directory that cannot be written is found before the robot moves.
        store(&path, kept).with_context(described)?;
        if let Some(stop) = kept {
            tracing::warn!("AllStop {stop} is still in force ({}); `axle enable` ends it", path.display());
        }
        let shared = Arc::new(Shared {
            state: Mutex::new(State { wanted: kept, stored: kept, is_over: false }),
            news: Condvar::new(),
        });
        let writing = Arc::clone(&shared);
        std::thread::Builder::new().name("latch".into()).spawn(move || writing.write(&path))?;
        Ok(Self { shared, asked: kept })
    }

    /// The stop that is in force since before this process.
    pub(crate) const fn kept(&self) -> Option<StopId> {
        self.asked
    }

    /// Has the stop in force stored, or none.
    pub(crate) fn keep(&mut self, stop: Option<StopId>) {
        if self.asked != stop {
            self.asked = stop;
            self.shared.lock().wanted = stop;
            self.shared.news.notify_one();
        }
    }

    /// Whether the stop in force is on disk.
    pub(crate) fn is_stored(&self) -> bool {
        self.asked.is_some() && self.shared.lock().stored == self.asked
    }
}

impl Drop for Latch {
    fn drop(&mut self) {
        self.shared.lock().is_over = true;
        self.shared.news.notify_one();
    }
}

impl Shared {
    fn lock(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes what is wanted until the latch is dropped.
    fn write(&self, path: &Path) {
        let mut state = self.lock();
        loop {
            let wanted = state.wanted;
            if wanted == state.stored {
                if state.is_over {
                    return;
                }
                state = self.news.wait(state).unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            drop(state);
            let written = store(path, wanted);
            state = self.lock();
            match written {
                Ok(()) => state.stored = wanted,
                Err(_) if state.is_over => return,
                Err(fault) => {
                    let what = if wanted.is_some() {
                        "the AllStop is in force, but would not outlive a restart"
                    } else {
                        "the robot may move, but would be stopped after a restart"
                    };
                    tracing::error!("cannot write {}: {fault}; {what}", path.display());
                    state = self.news.wait_timeout(state, AGAIN).unwrap_or_else(PoisonError::into_inner).0;
                }
            }
        }
    }
}

fn read(path: &Path) -> std::io::Result<Option<StopId>> {
    match fs::read_to_string(path) {
        Ok(text) => Ok(Some(u64::from_str_radix(text.trim(), 16).map_or(UNREADABLE, StopId))),
        Err(fault) if fault.kind() == ErrorKind::NotFound => Ok(None),
        Err(fault) if fault.kind() == ErrorKind::InvalidData => Ok(Some(UNREADABLE)),
        Err(fault) => Err(fault),
    }
}

/// Writes the file, or removes it, so that after a power cut it is there as before or as after, and nothing else.
fn store(path: &Path, stop: Option<StopId>) -> std::io::Result<()> {
    let new = path.with_extension("new");
    let mut file = File::create(&new)?;
    if let Some(stop) = stop {
        writeln!(file, "{stop}")?;
        file.sync_all()?;
        fs::rename(&new, path)?;
    } else {
        drop(file);
        fs::remove_file(&new)?;
        match fs::remove_file(path) {
            Err(fault) if fault.kind() != ErrorKind::NotFound => return Err(fault),
            _ => {}
        }
    }
    path.parent().map_or(Ok(()), |directory| File::open(directory)?.sync_all())
}

/// Where the state of this computer's robots is kept, unless it is said: what systemd gives the service, or what the
/// XDG base directories of the person are, or `/var/lib/axle`.
pub(crate) fn default_directory() -> PathBuf {
    let named = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    named("STATE_DIRECTORY")
        .or_else(|| named("XDG_STATE_HOME").map(|home| home.join("axle")))
        .or_else(|| named("HOME").map(|home| home.join(".local/state/axle")))
        .unwrap_or_else(|| PathBuf::from("/var/lib/axle"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scratch(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("axle-latch-{}-{name}", std::process::id()));
        drop(fs::remove_dir_all(&path));
        path
    }

    #[test]
    fn a_stop_is_found_again_until_it_has_ended() {
        let directory = scratch("again");
        let robot = RobotId::new("r1").expect("a robot");
        let open = || Latch::open(&directory, &robot).expect("a latch");
        let stored = |latch: &Latch, stop| {
            let mut state = latch.shared.lock();
            while state.stored != stop {
                drop(state);
                std::thread::yield_now();
                state = latch.shared.lock();
            }
        };
        let mut latch = open();
        assert_eq!((latch.kept(), latch.is_stored()), (None, false));
        latch.keep(Some(StopId(0xabc)));
        stored(&latch, Some(StopId(0xabc)));
        assert!(latch.is_stored());
        assert_eq!(open().kept(), Some(StopId(0xabc)), "another process finds it");
        latch.keep(None);
        stored(&latch, None);
        assert_eq!(open().kept(), None);
        fs::write(directory.join("r1.stop"), b"\xff\x00 no number").expect("a broken file");
        assert_eq!(open().kept(), Some(UNREADABLE), "what cannot be read is a stop");
        fs::remove_dir_all(&directory).expect("removed");
    }

    #[test]
    fn a_directory_that_cannot_be_written_is_refused_with_what_to_do() {
        let directory = scratch("file");
        fs::write(&directory, "a file").expect("a file");
        let Err(fault) = Latch::open(&directory, &RobotId::new("r1").expect("a robot")) else {
            panic!("a file is no directory");
        };
        let fault = format!("{fault:#}");
        assert!(fault.contains("--state") && fault.contains("r1.stop"), "{fault}");
        fs::remove_file(&directory).expect("removed");
    }
}
