//! `axle router`: the Zenoh router of this computer.

use crate::cli::Router;
use crate::out::usage;
use axle_router::{Router as Process, RouterFault, RouterSettings};

pub(super) async fn router(args: Router) -> anyhow::Result<()> {
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
