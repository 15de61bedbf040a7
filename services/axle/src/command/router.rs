//! `axle router`: the Zenoh router of this computer.

use crate::cli::Router;
use crate::keys::{ACCESS_FILE, Role};
use crate::out::usage;
use crate::settings::Settings;
use crate::threads::Threads;
use anyhow::Context as _;
use axle_router::{DEFAULT_ENDPOINT, Router as Process, RouterFault, RouterSettings};

pub(super) async fn router(settings: &Settings, args: Router) -> anyhow::Result<()> {
    Threads::Router.give().context("begin anew with more threads")?;
    let mut stop = crate::signal::stop()?;
    let link = settings.link()?;
    let access = link.identity.as_ref().map(|identity| rules(&args, identity)).transpose()?;
    let connects = settings.connect != [DEFAULT_ENDPOINT];
    let own = |endpoints: &[String]| endpoints.iter().map(|endpoint| settings.endpoint(endpoint)).collect();
    let settings = RouterSettings {
        listen: own(&args.listen),
        connect: own(&args.link),
        insecure_lan: args.insecure_lan,
        link,
        access,
    };
    if connects {
        tracing::warn!(
            "--connect (AXLE_CONNECT) is for services: a router links to other routers with --link"
        );
    }
    if settings.insecure_lan && settings.link.identity.is_none() {
        tracing::warn!(
            "listening without encryption or authentication: whoever reaches this port can drive the robots"
        );
    }
    let listen = settings.listen.join(", ");
    let router =
        tokio::task::spawn_blocking(move || Process::start(&settings)).await?.map_err(
            |fault| match fault {
                RouterFault::Endpoint(_) | RouterFault::Exposed { .. } | RouterFault::NoRules => usage(fault),
                other => other.into(),
            },
        )?;
    tracing::info!("the router listens on {listen}");
    let _ready = crate::notify::ready(stop.clone());
    stop.wait().await;
    tokio::task::spawn_blocking(move || router.stop()).await?;
    Ok(())
}

/// The access rules that stand in a file of their own, or beside the certificate.
fn rules(args: &Router, identity: &axle_mesh::Identity) -> anyhow::Result<String> {
    if identity.certificate.role != Role::Router.word() {
        return Err(usage(format!(
            "--identity: the certificate of {} is a {}'s; a router needs its own, `axle keys issue router@HOST`",
            identity.name(),
            identity.certificate.role
        )));
    }
    let path = args.access.clone().unwrap_or_else(|| identity.directory().join(ACCESS_FILE));
    std::fs::read_to_string(&path).map_err(|fault| {
        usage(format!(
            "cannot read the access rules {}: {fault}; write them with `axle keys issue --topology FILE`",
            path.display()
        ))
    })
}
