//! A plain Zenoh client that knows nothing of Axle: it can say anything on any key.

use super::{PATIENCE, within};
use axle_mesh::config::LINK;
use axle_schema::codec::{decode_as, encoding_of};
use axle_schema::{Message, Refusal};
use zenoh::bytes::Encoding;
use zenoh::query::ConsolidationMode;
use zenoh::{Config, Session, Wait as _};

pub(crate) struct Stranger {
    session: Session,
}

/// What a stranger is answered.
#[derive(Debug)]
pub(crate) enum Reply {
    /// The bytes of an answer, and their encoding.
    Answer(String, Vec<u8>),
    /// A typed refusal.
    Refused(Refusal),
    /// Nothing, or nothing of Axle.
    Nothing(String),
}

impl Stranger {
    pub(crate) async fn join(endpoint: &str) -> Self {
        let mut config = Config::default();
        let own = [
            ("mode", "\"client\"".to_owned()),
            ("connect/endpoints", format!("[{endpoint:?}]")),
            ("connect/timeout_ms", PATIENCE.as_millis().to_string()),
        ];
        let shared = LINK.iter().map(|(key, value)| (*key, (*value).to_owned()));
        for (key, value) in own.into_iter().chain(shared) {
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

    /// Asks with these bytes, or without any.
    pub(crate) async fn ask(&self, key: &str, encoding: &str, bytes: Option<Vec<u8>>) -> Reply {
        let get = self.session.get(key.to_owned()).consolidation(ConsolidationMode::None).timeout(PATIENCE);
        let get = if let Some(bytes) = bytes { get.payload(bytes) } else { get };
        let get = if encoding.is_empty() { get } else { get.encoding(Encoding::from(encoding)) };
        let replies = get.await.expect("asked");
        let Ok(reply) = within(PATIENCE * 2, "a query ends", replies.recv_async()).await else {
            return Reply::Nothing("no reply".into());
        };
        match reply.into_result() {
            Ok(sample) => {
                Reply::Answer(sample.encoding().to_string(), sample.payload().to_bytes().into_owned())
            }
            Err(error) => {
                let (encoding, bytes) = (error.encoding().to_string(), error.payload().to_bytes());
                if encoding == encoding_of::<Refusal>() {
                    Reply::Refused(decode_as(&encoding, &bytes).expect("a refusal is well formed"))
                } else {
                    Reply::Nothing(String::from_utf8_lossy(&bytes).into_owned())
                }
            }
        }
    }

    /// Asks, and is refused with words that hold all of these.
    pub(crate) async fn is_refused(&self, key: &str, encoding: &str, bytes: Option<Vec<u8>>, words: &[&str]) {
        match self.ask(key, encoding, bytes).await {
            Reply::Refused(refusal) => {
                let text = refusal.to_string();
                for word in words {
                    assert!(text.contains(word), "{key}: {text:?} does not say {word:?}");
                }
            }
            other => panic!("{key} should refuse ({words:?}), but: {other:?}"),
        }
    }
}

/// What well-formed bytes say they are.
pub(crate) fn encoding<M: Message>() -> String {
    encoding_of::<M>()
}
