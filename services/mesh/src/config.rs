//! The Zenoh configuration of every process of Axle: client mode, static endpoints, short leases.
//!
//! Clients of one router lose nothing at start-up and are always relayed; peers are neither. Multicast and gossip are
//! off, since they find what was not meant. The lease is short, so that a frozen process is known within a second; it
//! serves presence only, never the safety of motion. Client and router must agree on the link settings: both come
//! from [`LINK`].

use crate::Fault;
use crate::identity::{Identity, SECURE};
use std::ops::RangeInclusive;
use zenoh::Config;

/// Link settings that clients and routers share, as JSON5 values by their configuration key.
///
/// The receiver of a lease is the other side, hence the same on both. `max_message_size` is above the largest message
/// of Axle, so that an oversized one arrives and is refused by name, and below what would hurt. With the usual two places
/// of a queue a link whose sender waits for a processor for a few milliseconds drops measurements, which a recording then
/// lacks. What waits is written together, and with a `time_limit` of 0 never waits for more of it. Of `buffer_size` a link
/// has four buffers to receive into; with the usual one it makes, and clears, a new buffer of 64 KiB for every message that
/// comes while one is still held.
pub const LINK: &[(&str, &str)] = &[
    ("scouting/multicast/enabled", "false"),
    ("scouting/gossip/enabled", "false"),
    ("transport/link/tx/lease", "1000"),
    ("transport/link/tx/keep_alive", "4"),
    ("transport/link/tx/queue/congestion_control/block/wait_before_close", "500000"),
    ("transport/link/tx/queue/batching/time_limit", "0"),
    ("transport/link/tx/queue/size/interactive_high", "16"),
    ("transport/link/tx/queue/size/data", "16"),
    ("transport/link/rx/buffer_size", "262144"),
    ("transport/link/rx/max_message_size", "16777216"),
    ("transport/unicast/open_timeout", "1000"),
    ("transport/unicast/accept_timeout", "1000"),
];

/// The leases that may be chosen, in milliseconds: below, a busy machine is taken for a dead one.
pub const LEASES: RangeInclusive<u32> = 200..=60_000;

/// How a process holds its links.
#[derive(Clone, Debug)]
pub struct Link {
    /// After how many milliseconds without a word the other side takes this one for dead; one of [`LEASES`].
    pub lease_ms: u32,
    /// With an identity every link is TLS.
    pub identity: Option<Identity>,
}

impl Default for Link {
    fn default() -> Self {
        Self { lease_ms: 1000, identity: None }
    }
}

impl Link {
    /// The settings of Zenoh that follow, as JSON5 values by their configuration key: to be set after [`LINK`].
    #[must_use]
    pub fn settings(&self) -> Vec<(&'static str, String)> {
        let lease = self.lease_ms.clamp(*LEASES.start(), *LEASES.end());
        let mut settings = vec![("transport/link/tx/lease", lease.to_string())];
        settings.extend(self.identity.iter().flat_map(Identity::settings));
        settings
    }
    /// Refuses an endpoint that does not fit: TLS needs an identity, and with one nothing is said in plain.
    ///
    /// # Errors
    /// [`Fault::Endpoint`] and [`Fault::NoIdentity`].
    pub fn check(&self, endpoint: &str) -> Result<(), Fault> {
        check_endpoint(endpoint)?;
        match (&self.identity, endpoint.starts_with(SECURE)) {
            (None, true) => Err(Fault::NoIdentity { endpoint: endpoint.to_owned() }),
            (Some(identity), false) => {
                Err(Fault::NotSecure { endpoint: endpoint.to_owned(), name: identity.name().to_owned() })
            }
            _ => Ok(()),
        }
    }
}

/// The configuration of a client of the routers at `endpoints`; `patience_ms` of -1 waits for ever.
///
/// # Errors
/// Names an endpoint that is not of the form `tcp/host:port`, or does not fit the identity.
pub(crate) fn client(endpoints: &[String], patience_ms: i64, link: &Link) -> Result<Config, Fault> {
    let mut config = Config::default();
    let endpoints_json =
        serde_json::to_string(endpoints).map_err(|_| Fault::Endpoint(endpoints.join(" ")))?;
    let set = |config: &mut Config, key: &str, value: &str| {
        config.insert_json5(key, value).map_err(|source| Fault::Config { key: key.to_owned(), source })
    };
    set(&mut config, "mode", "\"client\"")?;
    for endpoint in endpoints {
        link.check(endpoint)?;
    }
    config
        .insert_json5("connect/endpoints", &endpoints_json)
        .map_err(|_| Fault::Endpoint(endpoints.join(" ")))?;
    set(&mut config, "connect/timeout_ms", &patience_ms.to_string())?;
    set(
        &mut config,
        "connect/retry",
        "{ period_init_ms: 50, period_max_ms: 200, period_increase_factor: 2 }",
    )?;
    set(&mut config, "listen/endpoints", "[]")?;
    set(&mut config, "queries_default_timeout", "5000")?;
    for (key, value) in LINK {
        set(&mut config, key, value)?;
    }
    for (key, value) in link.settings() {
        set(&mut config, key, &value)?;
    }
    Ok(config)
}

/// Refuses what is neither `tcp/host:port` nor `tls/host:port`.
///
/// # Errors
/// [`Fault::Endpoint`] with the text.
pub fn check_endpoint(endpoint: &str) -> Result<(), Fault> {
    let wrong = || Fault::Endpoint(endpoint.to_owned());
    let address =
        endpoint.strip_prefix("tcp/").or_else(|| endpoint.strip_prefix(SECURE)).ok_or_else(wrong)?;
    let (host, port) = address.rsplit_once(':').ok_or_else(wrong)?;
    let port_is_right = port.parse::<u16>().is_ok_and(|port| port > 0);
    if host.is_empty() || !port_is_right { Err(wrong()) } else { Ok(()) }
}
