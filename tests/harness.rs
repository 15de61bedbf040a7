//! Starts processes of the built program and looks at what they do, so that a test says only what matters to it.
//!
//! Nothing sleeps here to let something happen: what a test waits for is a condition with a deadline, and what it
//! judges is what the robot says of itself, with the robot's own clock. Whatever a test starts is killed when it
//! ends, however it ends; a test that fails prints what its processes said.

mod process;
mod robot;
mod stranger;

pub(crate) use process::{Ended, Process, children, driven, is_alive};
pub(crate) use robot::{Eyes, Robot, SERVICES, r1, stands, velocity};
pub(crate) use stranger::Stranger;

use axle_mesh::{Mesh, Patience, Settings};
use axle_router::{Router, RouterSettings};
use axle_schema::key::Presence;
use std::collections::BTreeMap;
use std::net::TcpListener;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU16, AtomicU32, Ordering::Relaxed};
use std::time::{Duration, Instant};
use tokio::sync::{Semaphore, SemaphorePermit};
use tokio::time::timeout;

/// How often a condition is looked at that cannot be awaited.
const LOOK: Duration = Duration::from_millis(15);
/// Long enough for everything that shall happen at all, also on a loaded machine; no bound of Axle is judged by it.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// Looks until `look` finds something.
pub(crate) async fn eventually<T>(what: &str, look: impl FnMut() -> Option<T>) -> T {
    at_last(PATIENCE, what, look).await
}

/// The same for what takes its time.
pub(crate) async fn at_last<T>(patience: Duration, what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + patience;
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(Instant::now() < end, "not within {patience:?}: {what}");
        tokio::time::sleep(LOOK).await;
    }
}

/// Awaits what must come within `time`.
pub(crate) async fn within<T>(time: Duration, what: &str, future: impl Future<Output = T>) -> T {
    timeout(time, future).await.unwrap_or_else(|_| panic!("not within {time:?}: {what}"))
}

/// An endpoint of this computer that nobody listens on.
///
/// The port lies below those that the system gives to outgoing connections: a port that was found free is still free
/// when a router asks for it, also for the second time.
pub(crate) fn free_endpoint() -> String {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let begin = u16::try_from(std::process::id() % 800).expect("small") * 12;
    for _ in 0..2000 {
        let port = 20_000 + (begin + NEXT.fetch_add(1, Relaxed)) % 10_000;
        if TcpListener::bind(("127.0.0.1", port)).is_ok() {
            return format!("tcp/127.0.0.1:{port}");
        }
    }
    panic!("no free port from 20000 to 29999")
}

/// A directory of one test, removed with it.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let name = format!("axle-whole-{}-{}", std::process::id(), NEXT.fetch_add(1, Relaxed));
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&path).expect("a directory for a test");
        Self(path)
    }
}
impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed is left to the system's own cleaning.
        drop(std::fs::remove_dir_all(&self.0));
    }
}

/// Two worlds of processes at a time for each core, since they wait for robots half of their time: beyond that, tests would
/// measure the machine and not Axle.
static TURNS: LazyLock<Semaphore> =
    LazyLock::new(|| Semaphore::new(2 * std::thread::available_parallelism().map_or(1, NonZero::get)));

/// A place for processes: a directory, an endpoint, and nothing else yet.
pub(crate) struct World {
    pub(crate) endpoint: String,
    scratch: Scratch,
    _turn: SemaphorePermit<'static>,
}

impl World {
    pub(crate) async fn new() -> Self {
        let turn = TURNS.acquire().await.expect("the semaphore is never closed");
        Self { endpoint: free_endpoint(), scratch: Scratch::new(), _turn: turn }
    }
    /// The directory in which the processes of this world run and write.
    pub(crate) fn path(&self) -> &Path {
        &self.scratch.0
    }
    /// A file of this world.
    pub(crate) fn file(&self, name: &str, text: &str) -> String {
        let path = self.path().join(name);
        std::fs::write(&path, text).expect("a file of a test");
        path.display().to_string()
    }
    /// Starts `axle` with exactly these arguments.
    pub(crate) fn axle(&self, args: &[&str]) -> Process {
        Process::start(args, self.path())
    }
    /// Runs `axle` with exactly these arguments and this text as its stdin to its end.
    pub(crate) async fn fed(&self, args: &[&str], input: &str) -> Ended {
        Process::fed(args, input, self.path()).ended().await
    }
    /// Starts `axle` with these arguments, connected to the router of this world.
    pub(crate) fn tool(&self, args: &[&str]) -> Process {
        self.axle(&[args, &["--connect", &self.endpoint]].concat())
    }
    /// Runs a tool to its end.
    pub(crate) async fn done(&self, args: &[&str]) -> Ended {
        self.tool(args).ended().await
    }
    /// Starts the router as a process.
    pub(crate) fn router(&self) -> Process {
        self.axle(&["router", "--listen", &self.endpoint])
    }
    /// Starts a service.
    pub(crate) fn run(&self, service: &str) -> Process {
        self.tool(&["run", service, "--host", "lab"])
    }
    /// A session of the test itself.
    pub(crate) async fn join(&self) -> Mesh {
        join(&self.endpoint, "test").await
    }
}

/// A session of the test at a router that may still be starting.
pub(crate) async fn join(endpoint: &str, service: &str) -> Mesh {
    let settings = Settings {
        connect: vec![endpoint.to_owned()],
        host: "lab".into(),
        service: service.into(),
        robot: "r1".into(),
        inputs: Vec::new(),
        link: axle_mesh::Link::default(),
    };
    Mesh::join(settings, Patience::AtMost(PATIENCE), |_, _| {}).await.expect("a router")
}

/// A router in the process of the test.
pub(crate) struct Meeting {
    pub(crate) endpoint: String,
    router: Option<Router>,
}

impl Meeting {
    pub(crate) async fn new() -> Self {
        let endpoint = free_endpoint();
        let settings = RouterSettings { listen: vec![endpoint.clone()], ..RouterSettings::default() };
        let router = tokio::task::spawn_blocking(move || Router::start(&settings)).await.expect("a thread");
        Self { endpoint, router: Some(router.expect("a router")) }
    }
    pub(crate) async fn join(&self, service: &str) -> Mesh {
        join(&self.endpoint, service).await
    }
}
impl Drop for Meeting {
    fn drop(&mut self) {
        // Stopping a router blocks, which a thread of the runtime may not do.
        if let Some(router) = self.router.take() {
            drop(std::thread::spawn(move || router.stop()).join());
        }
    }
}

/// Waits until the router knows everything that this session has declared: links keep their order, so an answer of the
/// router comes after what it was told before the question.
pub(crate) async fn declared(mesh: &Mesh) {
    mesh.everybody(PATIENCE).await.expect("an answer of the router");
}

/// Waits until a process of each of these services is alive; returns their presences by name.
pub(crate) async fn all_alive(mesh: &Mesh, services: &[&str]) -> BTreeMap<String, Presence> {
    let mut comings = mesh.watch_presence().expect("presence");
    let mut alive: BTreeMap<String, Presence> = BTreeMap::new();
    let all = async {
        while !services.iter().all(|service| alive.values().any(|presence| presence.service == *service)) {
            let (presence, came) = comings.next().await;
            if came {
                alive.insert(presence.alive(), presence)
            } else {
                alive.remove(&presence.alive())
            };
        }
    };
    within(PATIENCE, &format!("{services:?} are alive"), all).await;
    alive.into_values().map(|presence| (presence.service.clone(), presence)).collect()
}
