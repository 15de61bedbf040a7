//! The threads of a process, by what it is for: those who look on stand back, and Zenoh gets as many as suit.

use std::os::unix::process::CommandExt as _;
use std::process::Command;
use thread_priority::{
    NormalThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy, set_thread_priority_and_policy,
    thread_native_id,
};

/// The variable by which Zenoh learns of its threads, and the only way to tell it.
const VARIABLE: &str = "ZENOH_RUNTIME";

/// How a process divides the work of Zenoh among threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Threads {
    /// Many that read links. Zenoh 1.10 closes a link whose other end has frozen on one of them, which takes seconds; with
    /// its usual two, two frozen taps hold up everybody (measured: a pause of 5 s).
    Router,
    /// One that waits for messages and reads them too. Usually one thread waits and wakes another one that reads, for
    /// every message, which costs a reader who does little with it more than the reading.
    Reader,
}

impl Threads {
    const fn words(self) -> &'static str {
        match self {
            Self::Router => "(rx: (worker_threads: 64))",
            Self::Reader => "(rx: (handover: app), acc: (handover: app))",
        }
    }
    /// Begins this process anew with these threads, unless it has them or somebody has chosen others. What stands in memory
    /// is lost, so it comes first in a process.
    ///
    /// # Errors
    /// What the system says when it cannot begin anew; the process goes on.
    pub(crate) fn give(self) -> std::io::Result<()> {
        if std::env::var_os(VARIABLE).is_some() {
            return Ok(());
        }
        let program = std::env::current_exe()?;
        Err(Command::new(program).args(std::env::args_os().skip(1)).env(VARIABLE, self.words()).exec())
    }
}

/// Leaves the processor to whoever drives: who only looks on takes what nobody else wants, and stands back at once when
/// somebody does. A lower priority alone would let each of fifty taps finish its slice before a command is passed on.
///
/// All threads that are started later inherit it, so it comes before them.
pub(crate) fn give_way() {
    let idle = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Idle);
    // A system that refuses takes nothing but these courtesies.
    if let Err(fault) = set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Min, idle) {
        tracing::debug!("cannot leave the processor to others: {fault}");
    }
    if let Err(fault) = Threads::Reader.give() {
        tracing::debug!("cannot do with fewer threads: {fault}");
    }
}
