//! `axle up [TOPOLOGY]`: the router and all services of one computer.

use crate::cli::Up;
use crate::keys::{Keys, Owner};
use crate::out::{note, usage};
use crate::settings::{Settings, join};
use crate::supervisor::{Log, Supervisor};
use crate::topology::{self, Topology};
use axle_mesh::Patience;
use axle_mesh::identity::SECURE;
use std::collections::BTreeSet;
use std::net::TcpListener;
use std::path::Path;
use std::time::Duration;
use tokio::time::Instant;

/// All processes are there within this time, or something is wrong.
const STARTING: Duration = Duration::from_secs(20);
/// A recorder that is not there after this time is not waited for: it records, and is not needed.
const RECORDER: Duration = Duration::from_secs(3);

pub(super) async fn up(settings: &Settings, args: Up) -> anyhow::Result<()> {
    let mut topology = match &args.topology {
        Some(path) => Topology::read(path)?,
        None => Topology::parse(topology::DEFAULT)?,
    };
    if let Some(page) = args.page {
        topology.add_page(page, settings.host.as_deref(), args.keys.as_deref())?;
    }
    let (host, described) = topology.host(settings.host.as_deref())?;
    let endpoint = args.listen.clone().unwrap_or_else(|| described.router.clone());
    let settings = &secure(settings, args.keys.as_deref(), &topology, host, &endpoint)?;
    let endpoint = settings.endpoint(&endpoint);
    check_free(&endpoint)?;
    // What is missing here may be started by hand; it is said, and not refused.
    for fault in topology.faults() {
        note(&format!("{fault} (unless it runs elsewhere)"));
    }
    let mut stop = crate::signal::stop()?;
    let started = Instant::now();
    let supervisor = Supervisor::start(
        &topology,
        host,
        &endpoint,
        args.keys.as_deref(),
        &settings.log,
        Some(&settings.state()),
        &Log::Prefixed,
    )?;
    let alive = all_alive(settings, &endpoint, &supervisor);
    let result = tokio::select! {
        alive = alive => alive,
        () = stop.wait() => Ok(()),
    };
    match result {
        Ok(()) if !stop.is_due() => {
            let count = supervisor.processes().len();
            note(&format!(
                "all {count} processes are alive after {:.1} s; try `axle ps`, `axle go \"0,0 1,0 1,1\"`; Ctrl-C ends",
                started.elapsed().as_secs_f64()
            ));
            stop.wait().await;
        }
        Ok(()) => {}
        Err(fault) => {
            supervisor.stop().await;
            return Err(fault);
        }
    }
    note("ending: the robot brakes, then all processes stop");
    supervisor.stop().await;
    Ok(())
}

/// With keys, everything is encrypted, and what this command asks the router it asks with the router's own identity.
fn secure(
    settings: &Settings,
    keys: Option<&Path>,
    topology: &Topology,
    host: &str,
    endpoint: &str,
) -> anyhow::Result<Settings> {
    let Some(directory) = keys else {
        if endpoint.starts_with(SECURE) {
            return Err(usage(format!(
                "{endpoint} is encrypted: name the directory of `axle keys` with --keys DIR"
            )));
        }
        return Ok(settings.alone());
    };
    // Where keys are issued the rules may be older than the topology; elsewhere there is only what was brought.
    if let Ok(keys) = Keys::open(directory) {
        keys.write_rules(topology)?;
    }
    let identity = directory.join(Owner::Router { host: host.to_owned() }.to_string());
    Ok(Settings { identity: Some(identity), ..settings.clone() })
}

/// Finds out before anything is started that the port is taken.
fn check_free(endpoint: &str) -> anyhow::Result<()> {
    axle_mesh::config::check_endpoint(endpoint).map_err(|fault| usage(format!("--listen: {fault}")))?;
    let address = endpoint.trim_start_matches("tcp/").trim_start_matches(SECURE);
    match TcpListener::bind(address) {
        Ok(_) => Ok(()),
        Err(fault) => anyhow::bail!(
            "cannot listen on {endpoint}: {fault}; if another `axle up` or router has it, end that one, or choose \
             another port with --listen tcp/127.0.0.1:PORT"
        ),
    }
}

/// Waits until every service of the supervisor is seen on the mesh.
///
/// # Errors
/// Names the services that gave up or did not come.
pub(crate) async fn all_alive(
    settings: &Settings,
    endpoint: &str,
    supervisor: &Supervisor,
) -> anyhow::Result<()> {
    all_alive_within(settings, endpoint, supervisor, STARTING).await
}

/// The same with another patience: some hundred processes take their time.
pub(crate) async fn all_alive_within(
    settings: &Settings,
    endpoint: &str,
    supervisor: &Supervisor,
    patience: Duration,
) -> anyhow::Result<()> {
    let mut missing: BTreeSet<(String, String)> = supervisor
        .processes()
        .into_iter()
        .filter(|(job, _)| job.name != "router")
        .map(|(job, _)| (job.name, job.robot.unwrap_or_else(|| axle_schema::id::ALL.to_owned())))
        .collect();
    let mut own = settings.mesh("up", None)?;
    own.connect = vec![endpoint.to_owned()];
    let deadline = Instant::now() + patience;
    let mesh = join(own, Patience::AtMost(patience / 2)).await?;
    let mut comings = mesh.watch_presence()?;
    let recording = Instant::now() + RECORDER;
    while !missing.is_empty() {
        if !missing.iter().any(|(name, _)| name == "recorder") || Instant::now() > recording {
            supervisor.begin();
        }
        let given_up = supervisor.given_up();
        anyhow::ensure!(given_up.is_empty(), "{} could not start; its log says why", given_up.join(", "));
        anyhow::ensure!(
            Instant::now() < deadline,
            "not alive after {} s: {missing:?}; their logs say why",
            patience.as_secs()
        );
        if let Ok((presence, true)) = tokio::time::timeout(Duration::from_millis(100), comings.next()).await {
            missing.remove(&(presence.service, presence.robot));
        }
    }
    mesh.leave().await;
    Ok(())
}
