//! One process of the program.

use super::{PATIENCE, at_last, eventually};
use nix::sys::signal::{Signal, kill, killpg};
use nix::unistd::Pid;
use std::fs::File;
use std::io::{PipeReader, PipeWriter};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// A process in a group of its own, with its words in files; it and its children are killed on drop.
pub(crate) struct Process {
    // Its stdin is a pipe, at whose end it ends too: so nothing is left even when the test binary itself is killed. One
    // that is fed a text ends with it.
    child: Child,
    what: String,
    out: PathBuf,
    err: PathBuf,
    begun: Instant,
}

/// How a process ended.
#[derive(Debug)]
pub(crate) struct Ended {
    /// Its exit code; none when a signal ended it.
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
    pub(crate) took: Duration,
    what: String,
}

impl Ended {
    /// It ended with this code, and its words for people hold all of these; it never broke down.
    #[track_caller]
    pub(crate) fn is(&self, code: i32, words: &[&str]) -> &Self {
        assert_eq!(self.code, Some(code), "exit code of {}: {}", self.what, self.err);
        for word in words {
            assert!(self.err.contains(word), "{} does not say {word:?} but: {}", self.what, self.err);
        }
        assert!(!self.err.contains("panicked"), "{} broke down: {}", self.what, self.err);
        self
    }
    /// Whether the gate took the wheels away because this machine was too busy for a corrector's beats: what a gate
    /// is for, and no fault of what is tested.
    pub(crate) fn was_late(&self) -> bool {
        let words =
            ["commands came too late", "does not follow", "no measurement for", "it said nothing for"];
        self.code == Some(1) && words.iter().any(|word| self.err.contains(word))
    }
    /// The one JSON value that it printed.
    #[track_caller]
    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.out).unwrap_or_else(|why| panic!("{}: {why}: {:?}", self.what, self.out))
    }
}

impl Process {
    pub(super) fn start(args: &[&str], directory: &Path) -> Self {
        Self::with_env(args, &[], directory)
    }
    /// Starts the program with this text as its stdin.
    pub(super) fn fed(args: &[&str], input: &str, directory: &Path) -> Self {
        Self::spawn(args, &[], Some(input), directory)
    }
    /// Starts the program in a directory with these variables, and without any other of Axle's own.
    pub(crate) fn with_env(args: &[&str], variables: &[(&str, &str)], directory: &Path) -> Self {
        Self::spawn(args, variables, None, directory)
    }
    /// Starts the program with a stderr that nobody reads as long as the pipe is held: it takes 64 kB and no more.
    pub(crate) fn unread(args: &[&str], directory: &Path) -> (Self, PipeReader) {
        let (held, err) = std::io::pipe().expect("a pipe");
        (Self::spawn_with(args, &[], None, directory, Some(err)), held)
    }
    fn spawn(args: &[&str], variables: &[(&str, &str)], input: Option<&str>, directory: &Path) -> Self {
        Self::spawn_with(args, variables, input, directory, None)
    }
    fn spawn_with(
        args: &[&str],
        variables: &[(&str, &str)],
        input: Option<&str>,
        directory: &Path,
        stderr: Option<PipeWriter>,
    ) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Relaxed);
        let file = |kind: &str| directory.join(format!("{number}.{kind}"));
        let (out, err) = (file("out"), file("err"));
        let stdin = input.map_or_else(Stdio::piped, |text| {
            std::fs::write(file("in"), text).expect("a file");
            File::open(file("in")).expect("a file").into()
        });
        let mut command = Command::new(env!("CARGO_BIN_EXE_axle"));
        for (name, _) in std::env::vars_os() {
            if name.to_string_lossy().starts_with("AXLE_") {
                command.env_remove(name);
            }
        }
        let child = command
            .args(args)
            .envs(variables.iter().copied())
            .current_dir(directory)
            .env("TMPDIR", directory)
            .env("AXLE_STATE", directory.join("state"))
            .env("NO_COLOR", "1")
            .env("AXLE_PARENT", "stdin")
            .stdin(stdin)
            .stdout(File::create(&out).expect("a file"))
            .stderr(stderr.map_or_else(|| Stdio::from(File::create(&err).expect("a file")), Stdio::from))
            .process_group(0)
            .spawn()
            .expect("the program");
        let what =
            args.iter().map(|arg| arg.chars().take(40).collect::<String>()).collect::<Vec<_>>().join(" ");
        Self { child, what: format!("axle {what}"), out, err, begun: Instant::now() }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }
    pub(crate) fn tell(&self, signal: Signal) {
        kill(raw(self.pid()), signal).unwrap_or_else(|why| panic!("{signal} to {}: {why}", self.what));
    }
    /// Stops the process, and waits until no thread of it runs any more.
    pub(crate) async fn freeze(&self) {
        self.tell(Signal::SIGSTOP);
        eventually("the process is frozen", || (state_of(self.pid()) == Some('T')).then_some(())).await;
    }
    /// What it has said so far for people.
    pub(crate) fn err(&self) -> String {
        std::fs::read_to_string(&self.err).unwrap_or_default()
    }
    /// What it has said so far for machines.
    pub(crate) fn out(&self) -> String {
        std::fs::read_to_string(&self.out).unwrap_or_default()
    }
    /// Waits until its words for people hold this.
    pub(crate) async fn says(&self, words: &str) {
        eventually(&format!("{} says {words:?}", self.what), || self.err().contains(words).then_some(()))
            .await;
    }
    pub(crate) fn is_running(&mut self) -> bool {
        self.child.try_wait().expect("a child").is_none()
    }
    /// Waits until it has ended.
    pub(crate) async fn ended(&mut self) -> Ended {
        self.ended_within(PATIENCE).await
    }
    /// The same for what takes its time.
    pub(crate) async fn ended_within(&mut self, patience: Duration) -> Ended {
        let what = format!("{} ends", self.what);
        let status = at_last(patience, &what, || self.child.try_wait().expect("a child")).await;
        let (out, err, took) = (self.out(), self.err(), self.begun.elapsed());
        Ended { code: status.code(), out, err, took, what: self.what.clone() }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let pid = self.pid();
        let below = children(pid);
        // What has ended already is what is wanted.
        let _ = killpg(raw(pid), Signal::SIGKILL);
        drop(self.child.wait());
        // The children of `axle up` stand in groups of their own; they end by themselves, but not while frozen.
        for child in below.into_iter().filter(|child| is_alive(*child)) {
            let _ = kill(raw(child), Signal::SIGKILL);
        }
        if std::thread::panicking() {
            eprintln!("--- {} ({pid})\n{}{}", self.what, self.out(), self.err());
        }
    }
}

/// Runs what drives to its end, once more or twice if the machine was too busy for it.
pub(crate) async fn driven(start: impl Fn() -> Process) -> Ended {
    let mut ended = start().ended().await;
    for _ in 0..2 {
        if !ended.was_late() {
            break;
        }
        ended = start().ended().await;
    }
    ended
}

fn raw(pid: u32) -> Pid {
    Pid::from_raw(i32::try_from(pid).expect("a process id"))
}

/// The fields of `/proc/PID/stat` after the name, which may hold blanks.
fn stat(pid: u32) -> Option<Vec<String>> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    Some(text.rsplit_once(')')?.1.split_whitespace().map(str::to_owned).collect())
}

fn state_of(pid: u32) -> Option<char> {
    stat(pid)?.first()?.chars().next()
}

/// Whether a process of the program has this id; one that has ended and waits to be collected is not alive.
pub(crate) fn is_alive(pid: u32) -> bool {
    let is_axle = std::fs::read(format!("/proc/{pid}/cmdline"))
        .is_ok_and(|line| line.starts_with(env!("CARGO_BIN_EXE_axle").as_bytes()));
    is_axle && state_of(pid).is_some_and(|state| state != 'Z')
}

/// The processes that this one has started and that still run.
pub(crate) fn children(of: u32) -> Vec<u32> {
    let of = of.to_string();
    let Ok(processes) = std::fs::read_dir("/proc") else { return Vec::new() };
    processes
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok())
        .filter(|pid| stat(*pid).is_some_and(|fields| fields.get(1) == Some(&of)))
        .collect()
}
