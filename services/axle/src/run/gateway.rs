//! The gateway as a process: the page, its live connections, `/metrics` and `/healthz`.
//!
//! It hears what robots say through taps, which cost a robot nothing, and puts it on a board; each page is told from there
//! at its own pace. What pages ask it asks of the services, as any client would: the drive and the pilot take the lease
//! and obey the gate. When a page is lost its stick is let go, and what it had begun is ended; when the whole gateway is
//! lost, powers are no longer renewed and the drive brakes.

mod deeds;
mod entrance;
mod feed;
mod floor;
#[cfg(feature = "foxglove")]
mod foxglove;
mod http;
mod live;
mod reports;
mod stick;
mod tls;

use super::Context;
use crate::params::load;
use anyhow::Context as _;
use axle_gateway::GatewayParams;
use axle_gateway::board::{Board, Place};
use axle_gateway::desk::{Desk, Out};
use axle_gateway::door::Site;
use axle_gateway::metrics::Process;
use axle_mesh::Mesh;
use axle_schema::command::GateState;
use axle_schema::contract::Bounds as _;
use axle_schema::{Refusal, RobotId, Seconds};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::watch;
#[cfg(feature = "foxglove")]
use tokio_rustls::TlsAcceptor;

/// After the word to end, what pages held is let go within this time.
const LETTING_GO: Duration = Duration::from_millis(400);

/// Serves the page until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: GatewayParams = load(context.params.as_deref())?;
    let listener = bind(&params).await?;
    let address = listener.local_addr().context("ask for the address of the page")?;
    let (tls, site) = match (&params.certificate, &params.key) {
        (Some(certificate), Some(key)) => {
            let (acceptor, site) = tls::read(certificate, key)?;
            (Some(acceptor), site)
        }
        _ => (None, Site::PLAIN),
    };
    let entrance = entrance::Entrance::new(&params, address.port(), site.is_secured())?;
    let hall = Arc::new(Hall::new(&context.mesh, context.robot.clone(), params, site, entrance));
    let feed = feed::Feed::new(&hall)?;
    let _visible = context.ready()?;
    if hall.params.insecure_lan {
        tracing::warn!("insecure_lan: whoever reaches {address} can drive every robot of this mesh");
    }
    tracing::info!("the page is at {}{address}", hall.site.scheme());
    #[cfg(feature = "foxglove")]
    let viewers = viewers(&hall, address, tls.clone());
    #[cfg(not(feature = "foxglove"))]
    let viewers = std::future::pending::<std::io::Result<()>>();
    tokio::select! {
        served = viewers => served.context("serve Foxglove's viewers")?,
        () = feed.run() => {}
        () = feed::look(&hall) => {}
        () = floor::look(&hall) => {}
        served = http::serve(Arc::clone(&hall), listener, tls) => served.context("serve the page")?,
        () = context.stop.wait() => {}
    }
    let outs = hall.desk().close();
    let letting_go = outs.into_iter().map(|out| hall.end(out));
    // What does not hear it in time brakes by itself.
    drop(tokio::time::timeout(LETTING_GO, futures_util::future::join_all(letting_go)).await);
    Ok(())
}

/// Serves Foxglove's viewers, if anybody wants them.
#[cfg(feature = "foxglove")]
async fn viewers(hall: &Arc<Hall>, page: SocketAddr, tls: Option<TlsAcceptor>) -> std::io::Result<()> {
    if hall.params.foxglove
        && let Some(listener) = foxglove::bind(page, hall.params.foxglove_port).await
    {
        let scheme = if hall.site.is_secured() { "wss" } else { "ws" };
        tracing::info!("Foxglove watches at {scheme}://{}", listener.local_addr()?);
        return foxglove::serve(Arc::clone(hall), listener, tls).await;
    }
    std::future::pending().await
}

/// Takes the address of the parameters, or the next port that is free.
async fn bind(params: &GatewayParams) -> anyhow::Result<TcpListener> {
    params.check()?;
    let first = params.listen.port();
    let last = if first == 0 { 0 } else { first.saturating_add(params.ports) };
    for port in first..=last {
        match TcpListener::bind(SocketAddr::new(params.listen.ip(), port)).await {
            Err(fault) if fault.kind() == std::io::ErrorKind::AddrInUse && port < last => {}
            bound => return bound.with_context(|| format!("listen on {} port {port}", params.listen.ip())),
        }
    }
    anyhow::bail!("no port from {first} to {last} is free; choose another with listen")
}

/// What a gate said last, and when.
#[derive(Clone, Debug)]
struct Gate {
    state: GateState,
    at: Seconds,
}

/// Numbers for `/metrics`.
#[derive(Default)]
struct Counts {
    asked: AtomicU64,
    refused: AtomicU64,
    turned: AtomicU64,
    told: AtomicU64,
    missed: AtomicU64,
    dropped: AtomicU64,
}

/// Everything that the connections of all pages share.
struct Hall {
    params: GatewayParams,
    site: Site,
    entrance: entrance::Entrance,
    mesh: Mesh,
    /// The one robot that it works for, if there is one.
    only: Option<RobotId>,
    board: Mutex<Board>,
    desk: Mutex<Desk>,
    gates: Mutex<BTreeMap<RobotId, Gate>>,
    processes: Mutex<Vec<Process>>,
    /// When the mesh last answered who is there.
    looked: Mutex<Option<Seconds>>,
    /// Tells that the feed has read what was said.
    news: watch::Sender<()>,
    sticks: stick::Sticks,
    counts: Counts,
    #[cfg(feature = "foxglove")]
    show: foxglove::Show,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Hall {
    fn new(
        mesh: &Mesh,
        only: Option<RobotId>,
        params: GatewayParams,
        site: Site,
        entrance: entrance::Entrance,
    ) -> Self {
        Self {
            desk: Mutex::new(Desk::new(params.clone())),
            sticks: stick::Sticks::new(mesh, params.hold),
            params,
            site,
            entrance,
            mesh: mesh.clone(),
            only,
            board: Mutex::default(),
            gates: Mutex::default(),
            processes: Mutex::default(),
            looked: Mutex::default(),
            news: watch::Sender::new(()),
            counts: Counts::default(),
            #[cfg(feature = "foxglove")]
            show: foxglove::Show::default(),
        }
    }
    fn now(&self) -> Seconds {
        self.mesh.clock().now()
    }
    fn board(&self) -> MutexGuard<'_, Board> {
        lock(&self.board)
    }
    fn desk(&self) -> MutexGuard<'_, Desk> {
        lock(&self.desk)
    }
    /// The newest word of a robot's stream, if there is one.
    fn newest(&self, robot: &RobotId, stream: &str) -> Option<serde_json::Value> {
        let place = Place { robot: robot.to_string(), stream: stream.to_owned() };
        let board = self.board();
        let (_, word) = board.newest(self.now(), &place)?;
        serde_json::from_str(word).ok()
    }
    /// Refuses robots that this gateway does not work for.
    fn serves(&self, robot: &RobotId) -> Result<(), Refusal> {
        match &self.only {
            Some(only) if only != robot => Err(Refusal::Unknown {
                what: "robot".into(),
                got: robot.to_string(),
                known: format!("{only}, the one that this gateway was started for"),
            }),
            _ => Ok(()),
        }
    }
    /// Does what the desk wants, beside the caller.
    fn act(self: &Arc<Self>, outs: Vec<Out>) {
        for out in outs {
            let hall = Arc::clone(self);
            tokio::spawn(async move { hall.end(out).await });
        }
    }
    /// Ends what a page held or had begun.
    async fn end(&self, out: Out) {
        match out {
            Out::Rest(robot) => self.sticks.rest(&robot).await,
            Out::End(errand) => deeds::end(self, errand).await,
        }
    }
}
