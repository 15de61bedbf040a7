//! Joining and leaving the mesh.

use crate::clock::Clock;
use crate::counters::Counters;
use crate::{Fault, Link, Reach, config, probe};
use axle_schema::Boot;
use axle_schema::key::Presence;
use std::sync::Arc;
use std::time::Duration;
use zenoh::{Session, Wait as _};

/// Who joins, and where.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The routers to connect to, for example `tcp/127.0.0.1:7447`; the first that answers is used.
    pub connect: Vec<String>,
    /// The name of this computer.
    pub host: String,
    /// The catalogue name of the service; tools use their command's name.
    pub service: String,
    /// The robot it serves, or `all`.
    pub robot: String,
    /// Streams that it hears from elsewhere: the last two chunks of the usual key, and those of the other one.
    pub inputs: Vec<(String, String)>,
    /// How it holds its link.
    pub link: Link,
}

/// How long to wait for a router.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patience {
    /// Services wait for their router, whatever the order in which things are started.
    Forever,
    /// People at a terminal are told soon.
    AtMost(Duration),
}

/// A process on the mesh. Cloning shares it.
#[derive(Clone)]
pub struct Mesh {
    pub(crate) session: Session,
    pub(crate) presence: Arc<Presence>,
    pub(crate) counters: Arc<Counters>,
    pub(crate) version: &'static str,
    inputs: Arc<[(String, String)]>,
    identity: Option<Arc<crate::Identity>>,
    clock: Clock,
}

impl Mesh {
    /// Joins the mesh. While the router is absent, `waiting` is called once a second with the time waited so far, and
    /// with what is wrong if somebody is there all the same.
    ///
    /// # Errors
    /// [`Fault::Endpoint`] for an endpoint of a wrong form, [`Fault::NoRouter`] and [`Fault::NotJoined`] when patience
    /// ran out.
    pub async fn join(
        settings: Settings,
        patience: Patience,
        mut waiting: impl FnMut(Duration, Option<Reach>),
    ) -> Result<Self, Fault> {
        let timeout_ms = match patience {
            Patience::Forever => -1,
            Patience::AtMost(time) => i64::try_from(time.as_millis()).unwrap_or(i64::MAX),
        };
        let config = config::client(&settings.connect, timeout_ms, &settings.link)?;
        // Opening blocks its thread until the router answers: it gets a thread that may block.
        let mut opening = tokio::task::spawn_blocking(move || zenoh::open(config).wait());
        let started = Clock::start();
        let session = loop {
            match tokio::time::timeout(Duration::from_secs(1), &mut opening).await {
                Ok(Ok(Ok(session))) => break session,
                Ok(_) => {
                    let endpoints = settings.connect.join(", ");
                    let obstacle = obstacle(&settings).await;
                    return Err(obstacle
                        .map_or(Fault::NoRouter { endpoints }, |reach| Fault::NotJoined(Box::new(reach))));
                }
                Err(_) => {
                    let waited = started.elapsed();
                    waiting(waited, obstacle(&settings).await);
                }
            }
        };
        let inputs = settings.inputs.into();
        let presence = Presence {
            robot: settings.robot,
            service: settings.service,
            host: settings.host,
            pid: std::process::id(),
            boot: Boot::from_random(random_bits()),
        };
        Ok(Self {
            session,
            presence: Arc::new(presence),
            counters: Arc::new(Counters::new()),
            inputs,
            identity: settings.link.identity.map(Arc::new),
            version: env!("CARGO_PKG_VERSION"),
            clock: Clock::start(),
        })
    }

    /// This run of the process.
    #[must_use]
    pub fn boot(&self) -> Boot {
        self.presence.boot
    }
    /// Who this process is on the mesh.
    #[must_use]
    pub fn presence(&self) -> &Presence {
        &self.presence
    }
    /// `service@host/pid`: how the process is called in messages for people.
    #[must_use]
    pub fn name(&self) -> String {
        let Presence { service, host, pid, .. } = &*self.presence;
        format!("{service}@{host}/{pid}")
    }
    /// Who the process is to the access rules of its router.
    #[must_use]
    pub fn identity(&self) -> Option<&crate::Identity> {
        self.identity.as_deref()
    }
    /// What to add where nothing came back: a router says nothing of what its access rules drop.
    #[must_use]
    pub fn unless_denied(&self) -> String {
        let Some(identity) = self.identity() else { return String::new() };
        let role = &identity.certificate.role;
        format!("; or the access rules of the router do not let {} ({role}) do this", identity.name())
    }
    /// Time since the process joined.
    #[must_use]
    pub const fn clock(&self) -> Clock {
        self.clock
    }
    /// The key that is heard for `key`: its own, or where this process was told to hear it from.
    pub(crate) fn rewired(&self, key: &str) -> String {
        // The root, the robot, and the rest.
        let own = key.splitn(3, '/').nth(2).unwrap_or_default();
        match self.inputs.iter().find(|(input, _)| input == own) {
            Some((_, from)) => format!("{}{from}", &key[..key.len() - own.len()]),
            None => key.to_owned(),
        }
    }
    /// What the process counts of itself.
    #[must_use]
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// The same, for a thread of its own.
    #[must_use]
    pub fn shared_counters(&self) -> Arc<Counters> {
        Arc::clone(&self.counters)
    }

    /// Leaves the mesh, within a second.
    ///
    /// Zenoh's own close may take ten seconds when a link is stuck; the process does not wait for that, since the
    /// router forgets it as soon as its connection ends.
    pub async fn leave(self) {
        let session = self.session;
        let close = tokio::task::spawn_blocking(move || session.close().wait());
        if tokio::time::timeout(Duration::from_secs(1), close).await.is_err() {
            tracing::warn!("the session did not close within 1 s and is dropped");
        }
    }
}

/// What is wrong at the first endpoint where somebody listens; a router that only hangs is nothing to explain.
async fn obstacle(settings: &Settings) -> Option<Reach> {
    let Settings { connect, link, .. } = settings.clone();
    let look =
        move || connect.iter().map(|endpoint| probe(endpoint, link.identity.as_ref())).collect::<Vec<_>>();
    let found = tokio::task::spawn_blocking(look).await.ok()?;
    found.into_iter().find(|reach| !matches!(reach, Reach::Nobody { .. } | Reach::Open { .. }))
}

/// 64 bits that nobody can guess, from the standard library's own source of randomness.
#[must_use]
pub fn random_bits() -> u64 {
    use std::hash::{BuildHasher as _, Hasher as _};
    let mut hasher = std::collections::hash_map::RandomState::new().build_hasher();
    hasher.write_u32(std::process::id());
    hasher.write_u128(crate::clock::wall().to_bits().into());
    hasher.finish()
}
