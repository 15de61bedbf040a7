//! `axle up [TOPOLOGY]`: the router and all services of one computer.

use crate::cli::Up;
use crate::out::note;
use crate::settings::{Settings, join};
use crate::supervisor::{Log, Supervisor};
use crate::topology::{self, Topology};
use axle_mesh::Patience;
use std::collections::BTreeSet;
use std::net::TcpListener;
use std::time::Duration;
use tokio::time::Instant;

pub(super) async fn up(settings: &Settings, args: Up) -> anyhow::Result<()> {
    let topology = match &args.topology {
        Some(path) => Topology::read(path)?,
        None => Topology::parse(topology::DEFAULT)?,
    };
    let (host, described) = topology.host(settings.host.as_deref())?;
    let endpoint = args.listen.clone().unwrap_or_else(|| described.router.clone());
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

/// Finds out before anything is started that the port is taken.
fn check_free(endpoint: &str) -> anyhow::Result<()> {
    axle_mesh::config::check_endpoint(endpoint)
        .map_err(|fault| crate::out::usage(format!("--listen: {fault}")))?;
    let address = endpoint.trim_start_matches("tcp/");
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
    let mut missing: BTreeSet<(String, String)> = supervisor
        .processes()
        .into_iter()
        .filter(|(job, _)| job.name != "router")
        .map(|(job, _)| (job.name, job.robot.unwrap_or_else(|| axle_schema::id::ALL.to_owned())))
        .collect();
    let mut own = settings.mesh("up", None);
    own.connect = vec![endpoint.to_owned()];
    let deadline = Instant::now() + Duration::from_secs(20);
    let mesh = join(own, Patience::AtMost(Duration::from_secs(10))).await?;
    let mut comings = mesh.watch_presence()?;
    while !missing.is_empty() {
        let given_up = supervisor.given_up();
        anyhow::ensure!(given_up.is_empty(), "{} could not start; its log says why", given_up.join(", "));
        anyhow::ensure!(Instant::now() < deadline, "not alive after 20 s: {missing:?}; their logs say why");
        if let Ok((presence, true)) = tokio::time::timeout(Duration::from_millis(100), comings.next()).await {
            missing.remove(&(presence.service, presence.robot));
        }
    }
    mesh.leave().await;
    Ok(())
}
