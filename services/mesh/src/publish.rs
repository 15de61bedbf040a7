//! Saying something on a key.

use crate::counters::Count;
use crate::{Fault, Mesh, clock};
use axle_schema::codec::{Message, encode, encoding_of, schema_of};
use axle_schema::key::{Key, Urgency};
use axle_schema::meta::{Cause, Meta};
use axle_schema::{Boot, Refusal};
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use zenoh::Wait as _;
use zenoh::bytes::Encoding;
use zenoh::qos::{CongestionControl, Priority};

/// The right to publish `M` on one key. Publishing never waits: a sample that a full link cannot take is dropped, and
/// the gap in the sequence numbers says so.
pub struct Publisher<M> {
    publisher: zenoh::pubsub::Publisher<'static>,
    source: Boot,
    seq: AtomicU64,
    counters: Arc<crate::Counters>,
    count: Arc<Count>,
    carries: PhantomData<fn(M)>,
}

/// Each class of traffic has a priority, and so a queue, of its own.
const fn priority(urgency: Urgency) -> Priority {
    match urgency {
        Urgency::Command => Priority::RealTime,
        Urgency::Control => Priority::InteractiveHigh,
        Urgency::Task => Priority::InteractiveLow,
        Urgency::Report => Priority::Data,
    }
}

impl Mesh {
    /// Declares a publisher.
    ///
    /// # Errors
    /// [`Fault::Declare`].
    pub fn publisher<M: Message>(&self, key: &Key<M>) -> Result<Publisher<M>, Fault> {
        let publisher = self
            .session
            .declare_publisher(key.as_str().to_owned())
            .encoding(Encoding::APPLICATION_CBOR.with_schema(schema_of::<M>()))
            .priority(priority(key.urgency()))
            .congestion_control(CongestionControl::Drop)
            // What is said at one beat may travel together; a command goes alone.
            .express(matches!(key.urgency(), Urgency::Command))
            .wait()
            .map_err(|source| Fault::Declare { key: key.to_string(), source })?;
        self.counters.note_says(key.as_str());
        Ok(Publisher {
            publisher,
            source: self.boot(),
            seq: AtomicU64::new(0),
            counters: Arc::clone(&self.counters),
            count: self.counters.count_said(key.as_str()),
            carries: PhantomData,
        })
    }

    /// Publishes once, without a declared publisher: for an AllStop, which gaps in access rules must not silence.
    ///
    /// # Errors
    /// A [`Refusal`] when the message cannot be encoded or sent.
    pub fn put_once<M: Message>(&self, key: &Key<M>, message: &M) -> Result<(), Refusal> {
        let meta = Meta { seq: 0, source: self.boot(), stamp: clock::wall(), cause: None };
        self.session
            .put(key.as_str().to_owned(), encode(message)?)
            .encoding(Encoding::from(encoding_of::<M>()))
            .priority(priority(key.urgency()))
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .attachment(encode(&meta)?)
            .wait()
            .map_err(Refusal::internal)?;
        self.counters.sent.fetch_add(1, Relaxed);
        Ok(())
    }
}

impl Mesh {
    /// Publishes bytes as they are: for playing a recording.
    ///
    /// # Errors
    /// A [`Refusal`] when the key is none or the bytes cannot be sent.
    pub fn put_bytes(
        &self,
        key: &str,
        encoding: &str,
        payload: &[u8],
        attachment: Option<&[u8]>,
    ) -> Result<(), Refusal> {
        let key = zenoh::key_expr::KeyExpr::new(key.to_owned())
            .map_err(|fault| Refusal::malformed("key", fault))?;
        let put = self
            .session
            .put(key, payload)
            .encoding(Encoding::from(encoding))
            .priority(Priority::Data)
            .congestion_control(CongestionControl::Drop);
        let put = match attachment {
            Some(bytes) => put.attachment(bytes),
            None => put,
        };
        put.wait().map_err(Refusal::internal)?;
        self.counters.sent.fetch_add(1, Relaxed);
        Ok(())
    }
}

impl<M: Message> Publisher<M> {
    /// Publishes, naming the sample that caused this one; the answer names this one.
    ///
    /// # Errors
    /// A [`Refusal`] when the message cannot be encoded or sent. A sample that nobody hears is no error.
    pub fn put(&self, message: &M, cause: Option<Cause>) -> Result<Cause, Refusal> {
        let payload = encode(message)?;
        let seq = self.seq.fetch_add(1, Relaxed);
        let meta = Meta { seq, source: self.source, stamp: clock::wall(), cause };
        self.publisher.put(payload).attachment(encode(&meta)?).wait().map_err(Refusal::internal)?;
        self.counters.sent.fetch_add(1, Relaxed);
        self.count.one();
        Ok(Cause { source: self.source, seq })
    }
}
