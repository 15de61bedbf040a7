//! A plain Zenoh client that knows nothing of Axle: it can say anything on any key.

use super::{PATIENCE, within};
use axle_mesh::Link;
use axle_mesh::config::LINK;
use axle_schema::codec::encoding_of;
use axle_schema::{Refusal, decode};
use zenoh::bytes::Encoding;
use zenoh::query::ConsolidationMode;
use zenoh::{Config, Session, Wait as _};

pub(crate) struct Stranger {
    session: Session,
}

impl Stranger {
    pub(crate) async fn join(endpoint: &str) -> Self {
        Self::join_as(endpoint, Link::default()).await
    }

    /// The same, with a certificate to show.
    pub(crate) async fn join_as(endpoint: &str, link: Link) -> Self {
        let mut config = Config::default();
        let own = [
            ("mode", "\"client\"".to_owned()),
            ("connect/endpoints", format!("[{endpoint:?}]")),
            ("connect/timeout_ms", PATIENCE.as_millis().to_string()),
        ];
        let shared = LINK.iter().map(|(key, value)| (*key, (*value).to_owned()));
        for (key, value) in own.into_iter().chain(shared).chain(link.settings()) {
            config.insert_json5(key, &value).expect("a setting of Zenoh");
        }
        let opening = tokio::task::spawn_blocking(|| zenoh::open(config).wait());
        Self { session: opening.await.expect("a thread").expect("a router") }
    }

    /// Publishes bytes; an empty encoding is none.
    pub(crate) fn say(&self, key: &str, encoding: &str, bytes: impl Into<Vec<u8>>) {
        let put = self.session.put(key.to_owned(), bytes.into());
        let put = if encoding.is_empty() { put } else { put.encoding(Encoding::from(encoding)) };
        // Block, so that a test knows that its bytes arrive: a hostile sender has all the time of the world.
        put.congestion_control(zenoh::qos::CongestionControl::Block).wait().expect("said");
    }

    /// Waits until the router has taken everything that was said so far: links keep their order, and a question that
    /// nobody may answer comes back at once.
    pub(crate) async fn is_heard_by_router(&self) {
        let nothing = self.session.get("nothing/at/all").timeout(PATIENCE).await.expect("asked");
        while within(PATIENCE * 2, "the end of no replies", nothing.recv_async()).await.is_ok() {}
    }

    /// Asks with these bytes, or without any, and is refused with words that hold all of these.
    pub(crate) async fn is_refused(&self, key: &str, encoding: &str, bytes: Option<Vec<u8>>, words: &[&str]) {
        let get = self.session.get(key.to_owned()).consolidation(ConsolidationMode::None).timeout(PATIENCE);
        let get = if let Some(bytes) = bytes { get.payload(bytes) } else { get };
        let get = if encoding.is_empty() { get } else { get.encoding(Encoding::from(encoding)) };
        let replies = get.await.expect("asked");
        let what = format!("a reply of {key}, which should be: {words:?}");
        let reply = within(PATIENCE * 2, &what, replies.recv_async()).await;
        let reply = reply.unwrap_or_else(|_| panic!("nobody gave {what}"));
        let Err(error) = reply.into_result() else { panic!("an answer instead of {what}") };
        let bytes = error.payload().to_bytes();
        assert_eq!(error.encoding().to_string(), encoding_of::<Refusal>(), "{what}");
        let refusal: Refusal = decode(&bytes).expect("a refusal is well formed");
        let text = refusal.to_string();
        for word in words {
            assert!(text.contains(word), "{key}: {text:?} does not say {word:?}");
        }
    }
}
