//! What can go wrong between a process and the mesh.

use crate::Reach;

/// An operation on Zenoh that failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// An endpoint that nobody can connect to.
    #[error(
        "{0:?} is not an endpoint; write tcp/HOST:PORT, for example tcp/127.0.0.1:7447, or tls/HOST:PORT"
    )]
    Endpoint(String),
    /// TLS without a certificate to show.
    #[error(
        "{endpoint} is encrypted, and its router wants to know who you are: name an identity with --identity DIR"
    )]
    NoIdentity {
        /// The endpoint.
        endpoint: String,
    },
    /// Plain text with a certificate that would not be shown.
    #[error("{endpoint} is not encrypted, and {name} has an identity: write tls/HOST:PORT")]
    NotSecure {
        /// The endpoint.
        endpoint: String,
        /// Whose identity it is.
        name: String,
    },
    /// Somebody is there, but the two do not come together.
    #[error("{0}")]
    NotJoined(Box<Reach>),
    /// A configuration value that Zenoh refuses.
    #[error("configure Zenoh: {key}")]
    Config {
        /// The configuration key.
        key: String,
        /// What Zenoh says.
        source: zenoh::Error,
    },
    /// The router did not answer in time.
    #[error(
        "no router answers at {endpoints}; start one with `axle router` or everything with `axle up`, or name another \
         one with --connect"
    )]
    NoRouter {
        /// The endpoints that were tried.
        endpoints: String,
    },
    /// A declaration failed.
    #[error("declare {key}")]
    Declare {
        /// The key.
        key: String,
        /// What Zenoh says.
        source: zenoh::Error,
    },
    /// A query could not be sent.
    #[error("ask {key}")]
    Ask {
        /// The key.
        key: String,
        /// What Zenoh says.
        source: zenoh::Error,
    },
    /// A key expression that Zenoh does not accept.
    #[error(
        "{0:?} is not a key expression: no leading or trailing slash, no empty chunk, no # or ?; for example axle/r1/**"
    )]
    KeyExpression(String),
}
