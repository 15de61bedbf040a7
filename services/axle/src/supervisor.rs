//! One child process per service: started, watched, restarted with growing pauses, and ended together.
//!
//! The children stand in process groups of their own, so that Ctrl-C reaches the supervisor alone and it can end
//! them in order: the correctors first, which give the wheels back, then the rest, with the process that owns the wheels
//! braking before it ends, then the recorder, which has heard all that, and the router last. A child whose supervisor is killed sees the end of its stdin and ends too.

use crate::catalog;
use crate::keys::Owner;
use crate::log::lane;
use crate::signal::PARENT;
use crate::topology::{Place, Topology};
use anyhow::Context as _;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::io::{AsyncBufReadExt as _, AsyncRead, BufReader};
use tokio::process::{Child, Command};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::{Instant, timeout};

/// The first and the longest pause before a restart; a child that lived for `STEADY` begins anew.
const PAUSES: (Duration, Duration) = (Duration::from_millis(200), Duration::from_secs(5));
const STEADY: Duration = Duration::from_secs(10);
/// How long correctors may take to give the wheels back, and everybody to end, before what is next is ended too.
const GIVING_BACK: Duration = Duration::from_millis(600);
const ENDING: Duration = Duration::from_millis(1200);
/// Whoever has not ended so long after the last was told to is killed.
const LAST: Duration = Duration::from_millis(500);

/// Who owns wheels and measures them; they begin when the recorder is there.
const OWNERS: [&str; 3] = ["emulator", "composed", "robot"];

/// Where the children's words go.
#[derive(Clone)]
pub(crate) enum Log {
    /// To stderr, each line with the name of its service.
    Prefixed,
    /// To a file.
    File(Arc<Mutex<std::fs::File>>),
}

impl Log {
    fn line(&self, name: &str, line: &str) {
        match self {
            // A line of JSON names its service itself.
            Self::Prefixed if line.starts_with('{') => lane::line(line),
            Self::Prefixed => lane::line(&format!("{name:>12} | {line}")),
            Self::File(file) => {
                let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
                // A log that cannot be written must not stop a robot.
                drop(writeln!(file, "{name:>12} | {line}"));
            }
        }
    }
}

/// Who is told to end together, by name, and how long they may take.
type Stage = (fn(&Job) -> bool, Duration);

/// What to run.
#[derive(Clone, Debug)]
pub(crate) struct Job {
    /// The service, or `router`.
    pub(crate) name: String,
    /// The robot, where one is named.
    pub(crate) robot: Option<String>,
    args: Vec<String>,
    place: Place,
}

impl Job {
    /// Whether it turns or counts wheels that another service owns: it must be there until they stand.
    fn is_motor(&self) -> bool {
        let plays_board = self.name == "emulator" && self.args.iter().any(|arg| arg == "--board");
        plays_board || self.name.starts_with("motor-") || self.name.starts_with("encoder-")
    }
}

/// The children of one computer.
pub(crate) struct Supervisor {
    children: Vec<Watched>,
    /// Whether those who own wheels wait for the recorder.
    held: watch::Sender<bool>,
    /// Written parameters; removed with the supervisor.
    _params: ParamsDirectory,
}

struct Watched {
    job: Job,
    pid: Arc<Mutex<Option<u32>>>,
    ending: watch::Sender<bool>,
    watching: JoinHandle<()>,
}

/// A directory of parameter files that goes with the supervisor.
struct ParamsDirectory(PathBuf);

impl Drop for ParamsDirectory {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.0));
    }
}

impl Supervisor {
    /// Starts the router and the services of one computer, each with its identity of `keys`. Stops are kept in `state`,
    /// or no longer than the supervisor lives.
    ///
    /// # Errors
    /// When a parameter file cannot be written; children that cannot start are restarted and logged.
    pub(crate) fn start(
        topology: &Topology,
        host: &str,
        endpoint: &str,
        keys: Option<&Path>,
        level: &str,
        state: Option<&Path>,
        log: &Log,
    ) -> anyhow::Result<Self> {
        // Whoever starts several computers has a supervisor for each.
        let directory = std::env::temp_dir().join(format!("axle-{}-{host}", std::process::id()));
        std::fs::create_dir_all(&directory).context("make a directory for parameters")?;
        let params = ParamsDirectory(directory);
        let lease = topology.lease_ms.map(|ms| ["--lease".to_owned(), ms.to_string()]);
        let links = |owner: &Owner| {
            let identity = keys.map(|keys| keys.join(owner.to_string()).display().to_string());
            let identity = identity.map(|directory| ["--identity".to_owned(), directory]);
            lease.clone().into_iter().chain(identity).flatten()
        };
        let mut args = ["router", "--listen", endpoint, "--log", level].map(String::from).to_vec();
        args.extend(links(&Owner::Router { host: host.to_owned() }));
        let described = topology.hosts.get(host);
        let place = described.map(|host| host.place.clone()).unwrap_or_default();
        let mut jobs = vec![Job { name: "router".into(), robot: None, args, place: place.clone() }];
        for link in described.iter().flat_map(|host| &host.links) {
            jobs[0].args.extend(["--link".into(), link.clone()]);
        }
        if described.is_some_and(|host| host.insecure_lan) {
            jobs[0].args.push("--insecure-lan".into());
        }
        for (index, service) in topology.services_of(host).enumerate() {
            let mut args = ["run", &service.kind, "--connect", endpoint, "--host", host, "--log", level]
                .map(String::from)
                .to_vec();
            if let Some(entry) = catalog::find(&service.kind) {
                args.extend(links(&Owner::Service { kind: entry.name, robot: service.robot.clone() }));
            }
            if let Some(robot) = &service.robot {
                args.extend(["--robot".into(), robot.to_string()]);
            }
            for (flag, value) in [("--board", &service.board), ("--port", &service.port)] {
                if let Some(value) = value {
                    args.extend([flag.into(), value.clone()]);
                }
            }
            for (input, from) in &service.inputs {
                args.extend(["--input".into(), format!("{input}={from}")]);
            }
            let state = state.unwrap_or(&params.0);
            args.extend(["--state".into(), state.display().to_string()]);
            let table = topology.params_of(service)?;
            if !table.is_empty() {
                let file = params.0.join(format!("{index}-{}.toml", service.kind));
                std::fs::write(&file, toml::to_string(&table)?).context("write parameters")?;
                args.extend(["--params".into(), file.display().to_string()]);
            }
            let robot = service.robot.as_ref().map(ToString::to_string);
            jobs.push(Job { name: service.kind.clone(), robot, args, place: place.clone() });
        }
        let program = std::env::current_exe().context("find the axle program")?;
        // A recording that holds all that was ever measured can be replayed from the beginning of every service.
        let (held, is_held) = watch::channel(jobs.iter().any(|job| job.name == "recorder"));
        let children = jobs
            .into_iter()
            .map(|job| {
                let waits = OWNERS.contains(&&*job.name).then(|| is_held.clone());
                Watched::start(job, &program, log, waits)
            })
            .collect();
        Ok(Self { children, held, _params: params })
    }

    /// The recorder is there, or is not waited for any longer: what measures begins.
    pub(crate) fn begin(&self) {
        // Nobody listens where nobody owns wheels.
        let _ = self.held.send(false);
    }

    /// The jobs, in the order of their start, with the processes that do them now.
    pub(crate) fn processes(&self) -> Vec<(Job, Option<u32>)> {
        self.children.iter().map(|child| (child.job.clone(), child.pid())).collect()
    }

    /// The names of the children that gave up: a wrong command line or file is not mended by a restart.
    pub(crate) fn given_up(&self) -> Vec<String> {
        self.children
            .iter()
            .filter(|child| child.watching.is_finished())
            .map(|child| child.job.name.clone())
            .collect()
    }

    /// Ends all children in their order; within three seconds nothing is left.
    pub(crate) async fn stop(self) {
        let stages: [Stage; 4] = [
            (|job| job.name.ends_with("-corrector") || job.name == "drive", GIVING_BACK),
            (|job| job.name != "recorder" && job.name != "router" && !job.is_motor(), ENDING),
            (|job| job.name == "recorder" || job.is_motor(), LAST),
            (|_| true, LAST),
        ];
        for (is_due, patience) in stages {
            let due: Vec<_> = self.children.iter().filter(|child| is_due(&child.job)).collect();
            for child in &due {
                child.tell(Signal::SIGTERM);
            }
            let deadline = Instant::now() + patience;
            while due.iter().any(|child| child.pid().is_some()) && Instant::now() < deadline {
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        }
        for Watched { watching, pid, .. } in self.children {
            if timeout(Duration::from_millis(100), watching).await.is_err() {
                send(&pid, Signal::SIGKILL);
            }
        }
    }
}

impl Watched {
    fn start(job: Job, program: &Path, log: &Log, held: Option<watch::Receiver<bool>>) -> Self {
        let pid = Arc::new(Mutex::new(None));
        let (ending, is_ending) = watch::channel(false);
        let watch =
            watch_over(job.clone(), program.to_owned(), log.clone(), Arc::clone(&pid), is_ending.clone());
        let watching = tokio::spawn(async move {
            if let Some(mut held) = held
                && !released(&mut held, is_ending).await
            {
                return;
            }
            watch.await;
        });
        Self { job, pid, ending, watching }
    }
    fn pid(&self) -> Option<u32> {
        *self.pid.lock().unwrap_or_else(PoisonError::into_inner)
    }
    fn tell(&self, signal: Signal) {
        let _ = self.ending.send(true);
        send(&self.pid, signal);
    }
}

fn send(pid: &Mutex<Option<u32>>, signal: Signal) {
    let pid = *pid.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(pid) = pid.and_then(|pid| i32::try_from(pid).ok()) {
        // A child that has just ended by itself is what was wanted.
        let _ = kill(Pid::from_raw(pid), signal);
    }
}

/// Waits until a child may begin; `false` when it is told to end before.
async fn released(held: &mut watch::Receiver<bool>, mut ending: watch::Receiver<bool>) -> bool {
    tokio::select! {
        _ = held.wait_for(|held| !held) => true,
        _ = ending.wait_for(|ending| *ending) => false,
    }
}

/// Runs a child again and again until it is told to end.
async fn watch_over(
    job: Job,
    program: PathBuf,
    log: Log,
    pid: Arc<Mutex<Option<u32>>>,
    mut ending: watch::Receiver<bool>,
) {
    let set_pid = |value| *pid.lock().unwrap_or_else(PoisonError::into_inner) = value;
    let mut pause = PAUSES.0;
    loop {
        let born = Instant::now();
        let outcome = match spawn(&job, &program) {
            Ok(mut child) => {
                set_pid(child.id());
                // The pipe to its stdin must outlive the child's wait: its end is the child's sign to end.
                let stdin = child.stdin.take();
                let words = listen(&mut child, &job.name, &log);
                let status = child.wait().await;
                set_pid(None);
                drop(stdin);
                for word in words {
                    drop(word.await);
                }
                status.map_or_else(
                    |fault| (fault.to_string(), None),
                    |status| (status.to_string(), status.code()),
                )
            }
            Err(fault) => (fault.to_string(), None),
        };
        if *ending.borrow() {
            return;
        }
        if outcome.1 == Some(2) {
            log.line(&job.name, "is not restarted: its command line or its parameters are wrong");
            return;
        }
        if born.elapsed() >= STEADY {
            pause = PAUSES.0;
        }
        log.line(&job.name, &format!("ended ({}); starts again in {:.1} s", outcome.0, pause.as_secs_f64()));
        let told = timeout(pause, ending.wait_for(|ending| *ending)).await;
        if told.is_ok() {
            return;
        }
        pause = (pause * 2).min(PAUSES.1);
    }
}

fn spawn(job: &Job, program: &Path) -> std::io::Result<Child> {
    let mut command = match job.place.within.split_first() {
        Some((within, args)) => {
            let mut command = Command::new(within);
            command.args(args).arg(program);
            command
        }
        None => Command::new(program),
    };
    command
        .args(&job.args)
        .envs(job.place.variables.iter().map(|(name, value)| (name, value)))
        .env(PARENT, "stdin")
        .env("AXLE_LOG_FORMAT", crate::log::format().name())
        .env_remove("AXLE_ROBOT")
        .env_remove("AXLE_SERVICE")
        .env_remove("AXLE_PARAMS")
        .env_remove("AXLE_LISTEN")
        .env_remove("AXLE_IDENTITY")
        .env_remove("AXLE_LEASE")
        .env_remove("AXLE_BOARD")
        .env_remove("AXLE_PORT")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0)
        .kill_on_drop(true)
        .spawn()
}

/// Passes the child's lines on to the log.
fn listen(child: &mut Child, name: &str, log: &Log) -> Vec<JoinHandle<()>> {
    let mut words = Vec::new();
    if let Some(stdout) = child.stdout.take() {
        words.push(tokio::spawn(pass_on(stdout, name.to_owned(), log.clone())));
    }
    if let Some(stderr) = child.stderr.take() {
        words.push(tokio::spawn(pass_on(stderr, name.to_owned(), log.clone())));
    }
    words
}

async fn pass_on(from: impl AsyncRead + Unpin, name: String, log: Log) {
    let mut lines = BufReader::new(from).lines();
    while let Ok(Some(line)) = lines.next_line().await {
        log.line(&name, &line);
    }
}
