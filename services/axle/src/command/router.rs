//! `axle router`: the Zenoh router of this computer.

use crate::cli::Router;
use crate::out::usage;
use anyhow::Context as _;
use axle_router::{Router as Process, RouterFault, RouterSettings};
use std::os::unix::process::CommandExt as _;

/// Threads that read links. Zenoh 1.10 closes a link whose other end has frozen on one of them, which takes seconds;
/// with its default of two, two frozen taps hold up everybody (measured: a pause of 5 s). It reads the number from the
/// environment only.
const THREADS: (&str, &str) = ("ZENOH_RUNTIME", "(rx: (worker_threads: 64))");

pub(super) async fn router(args: Router) -> anyhow::Result<()> {
    if std::env::var_os(THREADS.0).is_none() {
        // The same process begins anew, with the variable.
        let fault = std::process::Command::new(std::env::current_exe().context("find the axle program")?)
            .args(std::env::args_os().skip(1))
            .env(THREADS.0, THREADS.1)
            .exec();
        return Err(fault).context("begin anew with more threads");
    }
    let mut stop = crate::signal::stop()?;
    let settings =
        RouterSettings { listen: args.listen, connect: args.link, insecure_lan: args.insecure_lan };
    if settings.insecure_lan {
        tracing::warn!(
            "listening without encryption or authentication: whoever reaches this port can drive the robots"
        );
    }
    let listen = settings.listen.join(", ");
    let router =
        tokio::task::spawn_blocking(move || Process::start(&settings)).await?.map_err(
            |fault| match fault {
                RouterFault::Endpoint(_) | RouterFault::Exposed { .. } => usage(fault),
                other => other.into(),
            },
        )?;
    tracing::info!("the router listens on {listen}");
    stop.wait().await;
    tokio::task::spawn_blocking(move || router.stop()).await?;
    Ok(())
}
