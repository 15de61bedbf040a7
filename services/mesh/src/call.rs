//! Asking and answering: the functional services on the mesh.
//!
//! Zenoh ends a query without replies and without an error when nobody answers, when the router is down, or when the
//! server dies in the middle. Here that is a failure with a name, after retries until the deadline: every call of
//! Axle that is retried is idempotent.

use crate::{Fault, Mesh};
use axle_schema::codec::{Message, decode_as, encode, schema_of};
use axle_schema::key::{Call, Key};
use axle_schema::meta::{Cause, Meta};
use axle_schema::{Refusal, RobotId};
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::Instant;
use zenoh::Wait as _;
use zenoh::bytes::Encoding;
use zenoh::query::{ConsolidationMode, Query, QueryTarget, Reply};

/// How many queries may wait for a server; one more is not taken, and its asker tries again.
const WAITING: usize = 256;
/// The first and the longest pause between two tries.
const PAUSES: (Duration, Duration) = (Duration::from_millis(20), Duration::from_millis(200));
/// The longest time one try may take, within the deadline of the caller.
const TRY: Duration = Duration::from_secs(2);
/// A try of less than this says nothing of a server that did not answer.
const FAIR: Duration = Duration::from_millis(500);

/// Whether a question may be asked again when nobody answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retry {
    /// The answer is the same however often it is asked.
    Idempotent,
    /// Asked once only.
    Never,
}

impl Mesh {
    /// Asks `question` of the service of `robot`, or of any instance that serves all robots.
    ///
    /// # Errors
    /// What the service refuses; [`Refusal::Unavailable`] when nobody answered until the deadline;
    /// [`Refusal::TimedOut`] when somebody is there but does not answer.
    pub async fn ask<Q: Message, A: Message>(
        &self,
        call: &Call<Q, A>,
        robot: Option<&RobotId>,
        question: &Q,
        deadline: Duration,
        retry: Retry,
    ) -> Result<A, Refusal> {
        let payload = encode(question)?;
        let key = call.of(robot);
        let end = Instant::now() + deadline;
        let mut pause = PAUSES.0;
        // Whether the latest try that shows anything found somebody, who was too late.
        let mut late = None;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let patience = if retry == Retry::Idempotent { left.min(TRY) } else { left };
            match self.ask_once::<Q, A>(&key, &payload, patience).await? {
                Answer::Given(answer) => return Ok(answer),
                Answer::None => late = Some(false),
                // A last try just before the deadline gets no time even for the news that nobody is there.
                Answer::Late if patience >= FAIR || late.is_none() => late = Some(true),
                Answer::Late => {}
            }
            if retry == Retry::Never || Instant::now() + pause >= end {
                let service = call.service();
                return Err(if late == Some(true) {
                    Refusal::TimedOut { what: service.to_owned(), seconds: deadline.as_secs_f64() }
                } else {
                    let denied = self.unless_denied();
                    let hint = format!("nobody answers at {key}; is `axle run {service}` up?{denied}");
                    Refusal::unavailable(service, hint)
                });
            }
            tokio::time::sleep(pause).await;
            pause = (pause * 2).min(PAUSES.1);
        }
    }

    /// Asks with bytes that are no message which this process would send: to find out what is refused.
    ///
    /// # Errors
    /// The [`Refusal`] of whoever answers, or [`Refusal::Unavailable`].
    pub async fn ask_bytes<Q: Message, A: Message>(
        &self,
        call: &Call<Q, A>,
        robot: Option<&RobotId>,
        bytes: &[u8],
        deadline: Duration,
    ) -> Result<A, Refusal> {
        match self.ask_once::<Q, A>(&call.of(robot), bytes, deadline).await? {
            Answer::Given(answer) => Ok(answer),
            Answer::None | Answer::Late => {
                Err(Refusal::unavailable(call.service(), "nobody answers at this key"))
            }
        }
    }

    /// Asks one process at a key of its own, once.
    ///
    /// # Errors
    /// As [`Mesh::ask`].
    pub async fn ask_at<Q: Message, A: Message>(
        &self,
        key: &Key<Q>,
        question: &Q,
        deadline: Duration,
    ) -> Result<A, Refusal> {
        match self.ask_once::<Q, A>(key, &encode(question)?, deadline).await? {
            Answer::Given(answer) => Ok(answer),
            Answer::None => Err(Refusal::unavailable("the process", format!("nobody answers at {key}"))),
            Answer::Late => {
                Err(Refusal::TimedOut { what: "the process".into(), seconds: deadline.as_secs_f64() })
            }
        }
    }

    async fn ask_once<Q: Message, A: Message>(
        &self,
        key: &Key<Q>,
        payload: &[u8],
        patience: Duration,
    ) -> Result<Answer<A>, Refusal> {
        let (sender, mut replies) = mpsc::channel::<Reply>(4);
        let meta = Meta { seq: 0, source: self.boot(), stamp: crate::clock::wall(), cause: None };
        self.session
            .get(key.as_str().to_owned())
            .payload(payload)
            .encoding(Encoding::APPLICATION_CBOR.with_schema(schema_of::<Q>()))
            .attachment(encode(&meta)?)
            .target(QueryTarget::BestMatching)
            .consolidation(ConsolidationMode::None)
            .timeout(patience)
            // A second reply has nowhere to go: the first answers.
            .callback(move |reply| drop(sender.try_send(reply)))
            .wait()
            .map_err(Refusal::internal)?;
        self.counters.sent.fetch_add(1, Relaxed);
        let reply = tokio::time::timeout(patience + Duration::from_millis(100), replies.recv()).await;
        match reply {
            Err(_) => Ok(Answer::Late),
            Ok(None) => Ok(Answer::None),
            Ok(Some(reply)) => {
                self.counters.received.fetch_add(1, Relaxed);
                read_reply(reply)
            }
        }
    }

    /// Answers every question of a key, one after the other, until the process leaves.
    ///
    /// # Errors
    /// [`Fault::Declare`]; afterwards it runs for ever.
    pub async fn serve<Q: Message, A: Message>(
        &self,
        key: &Key<Q>,
        mut answer: impl FnMut(Q, Option<Cause>) -> Result<A, Refusal>,
    ) -> Result<(), Fault> {
        let server: Server<Q, A> = self.server(key)?;
        loop {
            let asked = server.next().await;
            let _span = tracing::info_span!("query", key = asked.key()).entered();
            match asked.question() {
                Ok(question) => {
                    let cause = asked.cause();
                    asked.reply(answer(question, cause));
                }
                Err(refusal) => asked.reply(Err(refusal)),
            }
        }
    }

    /// Declares that this process answers the questions of a key.
    ///
    /// # Errors
    /// [`Fault::Declare`].
    pub fn server<Q: Message, A: Message>(&self, key: &Key<Q>) -> Result<Server<Q, A>, Fault> {
        let (sender, queries) = mpsc::channel(WAITING);
        let queryable = self
            .session
            .declare_queryable(key.as_str().to_owned())
            .complete(true)
            .callback(move |query| drop(sender.try_send(query)))
            .wait()
            .map_err(|source| Fault::Declare { key: key.to_string(), source })?;
        self.counters.note_says(key.as_str());
        Ok(Server {
            queries: tokio::sync::Mutex::new(queries),
            mesh: self.clone(),
            _queryable: queryable,
            kinds: std::marker::PhantomData,
        })
    }
}

/// Questions that wait for an answer.
pub struct Server<Q, A> {
    queries: tokio::sync::Mutex<mpsc::Receiver<Query>>,
    mesh: Mesh,
    _queryable: zenoh::query::Queryable<()>,
    kinds: std::marker::PhantomData<fn(Q) -> A>,
}

/// One question that waits for its answer. Dropping it without a reply tells the asker that nobody is there.
pub struct Asked<Q, A> {
    query: Query,
    mesh: Mesh,
    kinds: std::marker::PhantomData<fn(Q) -> A>,
}

impl<Q: Message, A: Message> Server<Q, A> {
    /// The next question.
    pub async fn next(&self) -> Asked<Q, A> {
        let Some(query) = self.queries.lock().await.recv().await else {
            // The queryable holds the sender as long as this value lives: there is nothing to wait for but more.
            return std::future::pending().await;
        };
        Asked { query, mesh: self.mesh.clone(), kinds: std::marker::PhantomData }
    }
    /// The next question, if one waits already: for beats, which never wait.
    pub fn try_next(&self) -> Option<Asked<Q, A>> {
        let query = self.queries.try_lock().ok()?.try_recv().ok()?;
        Some(Asked { query, mesh: self.mesh.clone(), kinds: std::marker::PhantomData })
    }
}

impl<Q: Message, A: Message> Asked<Q, A> {
    /// What is asked.
    ///
    /// # Errors
    /// A [`Refusal`] for a question that cannot be read; reply it.
    pub fn question(&self) -> Result<Q, Refusal> {
        self.mesh.counters.received.fetch_add(1, Relaxed);
        let Some(payload) = self.query.payload() else {
            let why = format!("{} as CBOR in the payload of the query", Q::NAME);
            return Err(Refusal::missing(format!("the question of {}", self.query.key_expr()), why));
        };
        let encoding = self.query.encoding().map(ToString::to_string).unwrap_or_default();
        // The size is looked at before the payload is made one piece of memory.
        if payload.len() > Q::LIMIT {
            let what = format!("{} in bytes", Q::NAME);
            return Err(Refusal::TooLarge { what, got: payload.len() as u64, limit: Q::LIMIT as u64 });
        }
        decode_as(&encoding, &payload.to_bytes())
    }
    /// The key that was asked, with the robot's name.
    #[must_use]
    pub fn key(&self) -> &str {
        self.query.key_expr().as_str()
    }
    /// The robot that the question is about, where its key names one.
    #[must_use]
    pub fn robot(&self) -> Option<RobotId> {
        let place = axle_schema::key::place(self.query.key_expr().as_str())?;
        RobotId::new(place.robot).ok()
    }
    /// The sample that caused the question, if the asker says so.
    #[must_use]
    pub fn cause(&self) -> Option<Cause> {
        let meta: Meta = axle_schema::decode(&self.query.attachment()?.to_bytes()).ok()?;
        meta.cause.or(Some(Cause { source: meta.source, seq: meta.seq }))
    }
    /// Answers.
    pub fn reply(self, answer: Result<A, Refusal>) {
        let counters = &self.mesh.counters;
        let sent = match answer.and_then(|answer| encode(&answer)) {
            Ok(payload) => self
                .query
                .reply(self.query.key_expr().clone(), payload)
                .encoding(Encoding::APPLICATION_CBOR.with_schema(schema_of::<A>()))
                .wait(),
            Err(refusal) => {
                counters.refused.fetch_add(1, Relaxed);
                tracing::debug!(key = %self.query.key_expr(), "{refusal}");
                let payload = encode(&refusal).unwrap_or_default();
                let encoding = Encoding::APPLICATION_CBOR.with_schema(schema_of::<Refusal>());
                self.query.reply_err(payload).encoding(encoding).wait()
            }
        };
        match sent {
            Ok(()) => drop(counters.sent.fetch_add(1, Relaxed)),
            Err(fault) => {
                tracing::debug!(key = %self.query.key_expr(), "the reply could not be sent: {fault}")
            }
        }
    }
}

enum Answer<A> {
    Given(A),
    None,
    Late,
}

fn read_reply<A: Message>(reply: Reply) -> Result<Answer<A>, Refusal> {
    match reply.into_result() {
        Ok(sample) => {
            decode_as(&sample.encoding().to_string(), &sample.payload().to_bytes()).map(Answer::Given)
        }
        Err(error) => {
            let encoding = error.encoding().to_string();
            let bytes = error.payload().to_bytes();
            if encoding.ends_with(&schema_of::<Refusal>()) {
                Err(decode_as::<Refusal>(&encoding, &bytes)?)
            } else if &*bytes == b"Timeout" {
                // Zenoh's own words for a query that somebody took and did not answer.
                Ok(Answer::Late)
            } else {
                let words: String = String::from_utf8_lossy(&bytes).chars().take(200).collect();
                Err(Refusal::internal(format_args!("the service answered: {words}")))
            }
        }
    }
}
