//! Being seen: a liveliness token and a status for each process, and who is there.

use crate::{Fault, Mesh};
use axle_schema::Seconds;
use axle_schema::codec::{decode_as, encode, schema_of};
use axle_schema::key::Presence;
use axle_schema::presence::{Shown, Status};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::sync::mpsc;
use zenoh::Wait as _;
use zenoh::bytes::Encoding;
use zenoh::query::{ConsolidationMode, QueryTarget};

/// Keeps a process visible as long as it lives.
pub struct Visible {
    _token: zenoh::liveliness::LivelinessToken,
    _status: zenoh::query::Queryable<()>,
    answering: tokio::task::JoinHandle<()>,
}

impl Drop for Visible {
    fn drop(&mut self) {
        self.answering.abort();
    }
}

impl Mesh {
    /// Becomes visible to `axle ps`. Zenoh takes the token away when the process dies, however it dies.
    ///
    /// # Errors
    /// [`Fault::Declare`].
    pub fn become_visible(&self) -> Result<Visible, Fault> {
        let key = self.presence.status();
        let fault = |key: &str| {
            let key = key.to_owned();
            move |source| Fault::Declare { key, source }
        };
        let (sender, mut queries) = mpsc::channel::<zenoh::query::Query>(16);
        let status = self
            .session
            .declare_queryable(key.clone())
            .callback(move |query| drop(sender.try_send(query)))
            .wait()
            .map_err(fault(&key))?;
        let mesh = self.clone();
        let reply_key = key;
        let answering = tokio::spawn(async move {
            while let Some(query) = queries.recv().await {
                let payload = encode(&mesh.status()).unwrap_or_default();
                let encoding = Encoding::APPLICATION_CBOR.with_schema(schema_of::<Status>());
                if let Err(fault) = query.reply(reply_key.clone(), payload).encoding(encoding).wait() {
                    tracing::debug!("the status could not be sent: {fault}");
                }
            }
        });
        let token = self.presence.alive();
        // The token comes last: whoever sees it may ask for the status at once.
        let token = self.session.liveliness().declare_token(token.clone()).wait().map_err(fault(&token))?;
        Ok(Visible { _token: token, _status: status, answering })
    }

    /// What this process says of itself.
    #[must_use]
    pub fn status(&self) -> Status {
        let Presence { robot, service, host, pid, boot } = (*self.presence).clone();
        let counters = &self.counters;
        Status {
            service,
            robot,
            host,
            pid,
            boot,
            version: self.version.to_owned(),
            uptime: self.clock().now(),
            beats: counters.beats(),
            late: counters.late(),
            late_p99: counters.lateness(0.99),
            sent: counters.sent.load(Relaxed),
            received: counters.received.load(Relaxed),
            refused: counters.refused.load(Relaxed),
            says: counters.says(),
            hears: counters.hears(),
            said: counters.said(),
            heard: counters.heard(),
            wall: Some(Seconds(crate::clock::wall())),
            certificate: self.identity().map(|identity| Shown {
                name: identity.name().to_owned(),
                expires: Seconds(identity.certificate.expires),
            }),
        }
    }

    /// Every process that is alive, and the status of those that answered in time; in the order of their keys.
    ///
    /// A process with a token but without a status is frozen, or was until a moment ago. One that answers is alive, whether
    /// its token was seen or not: an answer of the router may lack some while it is busy.
    ///
    /// # Errors
    /// [`Fault::Ask`].
    pub async fn everybody(&self, patience: Duration) -> Result<Vec<(Presence, Option<Status>)>, Fault> {
        self.look(Presence::every_token(), Presence::every_status(), patience).await
    }

    /// The same for the processes of one service; `robot` is `all` for planners.
    ///
    /// # Errors
    /// [`Fault::Ask`].
    pub async fn processes_of(
        &self,
        robot: &str,
        service: &str,
        patience: Duration,
    ) -> Result<Vec<(Presence, Option<Status>)>, Fault> {
        let (tokens, statuses) = (Presence::tokens_of(robot, service), Presence::statuses_of(robot, service));
        self.look(tokens, statuses, patience).await
    }

    async fn look(
        &self,
        wanted_tokens: String,
        wanted_statuses: String,
        patience: Duration,
    ) -> Result<Vec<(Presence, Option<Status>)>, Fault> {
        let fault = |key: &str| {
            let key = key.to_owned();
            move |source| Fault::Ask { key, source }
        };
        let (sender, mut tokens) = mpsc::channel(MAX_PROCESSES);
        self.session
            .liveliness()
            .get(wanted_tokens.clone())
            .timeout(patience)
            .callback(move |reply| drop(sender.try_send(reply)))
            .wait()
            .map_err(fault(&wanted_tokens))?;
        let (sender, mut statuses) = mpsc::channel(MAX_PROCESSES);
        self.session
            .get(wanted_statuses.clone())
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .timeout(patience)
            .callback(move |reply| drop(sender.try_send(reply)))
            .wait()
            .map_err(fault(&wanted_statuses))?;
        let mut known = BTreeMap::new();
        while let Some(reply) = tokens.recv().await {
            if let Ok(sample) = reply.result()
                && let Some(presence) = Presence::read(sample.key_expr().as_str())
            {
                known.insert(presence.alive(), (presence, None));
            }
        }
        while let Some(reply) = statuses.recv().await {
            let Ok(sample) = reply.result() else { continue };
            let read = decode_as::<Status>(&sample.encoding().to_string(), &sample.payload().to_bytes());
            // Whoever answers is alive, also where its token is missing in the answer of the router. It speaks for itself only.
            if let Ok(status) = read {
                let Status { robot, service, host, pid, boot, .. } = status.clone();
                let presence = Presence { robot, service, host, pid, boot };
                if sample.key_expr().as_str() == presence.status() {
                    known.entry(presence.alive()).or_insert((presence, None)).1 = Some(status);
                }
            }
        }
        Ok(known.into_values().collect())
    }

    /// Watches processes come and go.
    ///
    /// # Errors
    /// [`Fault::Declare`].
    pub fn watch_presence(&self) -> Result<Comings, Fault> {
        let (sender, changes) = mpsc::channel(MAX_PROCESSES);
        let key = Presence::every_token();
        let subscriber = self
            .session
            .liveliness()
            .declare_subscriber(key.clone())
            .history(true)
            .callback(move |sample| {
                let alive = sample.kind() == zenoh::sample::SampleKind::Put;
                if let Some(presence) = Presence::read(sample.key_expr().as_str()) {
                    drop(sender.try_send((presence, alive)));
                }
            })
            .wait()
            .map_err(|source| Fault::Declare { key, source })?;
        Ok(Comings { changes, _subscriber: Arc::new(subscriber) })
    }
}

/// The most processes that one look counts.
const MAX_PROCESSES: usize = 1024;

/// Processes that come and go.
pub struct Comings {
    changes: mpsc::Receiver<(Presence, bool)>,
    _subscriber: Arc<zenoh::pubsub::Subscriber<()>>,
}

impl Comings {
    /// The next process that came (`true`) or went (`false`); at first all that are there already.
    pub async fn next(&mut self) -> (Presence, bool) {
        match self.changes.recv().await {
            Some(change) => change,
            // The subscriber holds the sender as long as this value lives.
            None => std::future::pending().await,
        }
    }
}
