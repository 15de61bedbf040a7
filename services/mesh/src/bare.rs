//! Bare Zenoh, without anything of Axle: the yardstick of `axle bench mesh`.
//!
//! The same keys of transport (client, router, client), the same sizes, the same quality of service; written as the
//! documentation of Zenoh suggests.

use crate::Mesh;
use zenoh::Session;
use zenoh::handlers::{FifoChannel, RingChannel};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{ConsolidationMode, QueryTarget};

const QUERY: &str = "bench/bare/query";
const THERE: &str = "bench/bare/there";
const BACK: &str = "bench/bare/back";

/// One end of the yardstick.
pub struct Bare {
    session: Session,
}

/// Publishes there and hears back.
pub struct Echo {
    there: zenoh::pubsub::Publisher<'static>,
    back: zenoh::pubsub::Subscriber<zenoh::handlers::RingChannelHandler<zenoh::sample::Sample>>,
}

impl Mesh {
    /// The same session without Axle's layers.
    #[must_use]
    pub fn bare(&self) -> Bare {
        Bare { session: self.session.clone() }
    }
}

impl Bare {
    /// Answers queries with as many bytes as their first four bytes say, at most 1 MiB. Never ends.
    ///
    /// # Errors
    /// What Zenoh says.
    pub async fn answer(&self) -> Result<(), zenoh::Error> {
        let queries = self.session.declare_queryable(QUERY).complete(true).with(FifoChannel::new(32)).await?;
        loop {
            let query = queries.recv_async().await?;
            let bytes = query.payload().map(|payload| payload.to_bytes().into_owned()).unwrap_or_default();
            let size = bytes.first_chunk().map_or(0, |size| u32::from_le_bytes(*size)).min(1 << 20);
            query.reply(QUERY, vec![0_u8; size as usize]).await?;
        }
    }
    /// Sends back what it hears. Never ends.
    ///
    /// # Errors
    /// What Zenoh says.
    pub async fn echo(&self) -> Result<(), zenoh::Error> {
        let there = self.session.declare_subscriber(THERE).with(RingChannel::new(1)).await?;
        let back = publisher(&self.session, BACK).await?;
        loop {
            let sample = there.recv_async().await?;
            back.put(sample.payload().clone()).await?;
        }
    }
    /// One query of `ask` bytes that is answered by `answer` bytes; says how many came.
    ///
    /// # Errors
    /// What Zenoh says.
    pub async fn query(&self, ask: usize, answer: usize) -> Result<usize, zenoh::Error> {
        let mut payload = vec![0_u8; ask.max(4)];
        payload[..4].copy_from_slice(&u32::try_from(answer).unwrap_or(u32::MAX).to_le_bytes());
        let replies = self
            .session
            .get(QUERY)
            .payload(payload)
            .target(QueryTarget::BestMatching)
            .consolidation(ConsolidationMode::None)
            .await?;
        let reply = replies.recv_async().await?;
        Ok(reply.result().map_or(0, |sample| sample.payload().len()))
    }
    /// The near end of the echo.
    ///
    /// # Errors
    /// What Zenoh says.
    pub async fn caller(&self) -> Result<Echo, zenoh::Error> {
        let back = self.session.declare_subscriber(BACK).with(RingChannel::new(1)).await?;
        Ok(Echo { there: publisher(&self.session, THERE).await?, back })
    }
}

impl Echo {
    /// One round of `bytes` bytes there and back.
    ///
    /// # Errors
    /// What Zenoh says.
    pub async fn round(&self, bytes: usize) -> Result<(), zenoh::Error> {
        self.there.put(vec![0_u8; bytes]).await?;
        self.back.recv_async().await?;
        Ok(())
    }
}

async fn publisher(
    session: &Session,
    key: &'static str,
) -> Result<zenoh::pubsub::Publisher<'static>, zenoh::Error> {
    session
        .declare_publisher(key)
        .priority(Priority::InteractiveHigh)
        .congestion_control(CongestionControl::Drop)
        .express(true)
        .await
}
