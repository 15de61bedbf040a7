//! The Zenoh router of Axle: one process per computer, to which the services of that computer connect.
//!
//! Plain zenohd can take its place. This one adds what the mesh relies on: link settings that agree with those of the
//! clients, no discovery by multicast, loopback by default, and an error that says which port is taken.
//!
//! With an identity it listens in TLS, asks everybody for a certificate, and lets each owner do what its access rules
//! say and nothing else. Without one, listening beyond loopback must be asked for by name.

use axle_mesh::Link;
use axle_mesh::config::LINK;
use axle_mesh::identity::SECURE;
use std::net::{TcpListener, ToSocketAddrs as _};
use zenoh::{Config, Session, Wait as _};

/// Where a router listens when nothing else is said: this computer only.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Why a router did not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RouterFault {
    /// An endpoint of a wrong form.
    #[error(transparent)]
    Endpoint(axle_mesh::Fault),
    /// The host name of an endpoint means nothing here.
    #[error("{endpoint} cannot be resolved to an address of this computer")]
    Unresolved {
        /// The endpoint.
        endpoint: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// Somebody else has the port.
    #[error(
        "cannot listen on {endpoint}; if another router has it (`axle ps` shows its services), use that one, or choose \
         another port with --listen tcp/127.0.0.1:PORT"
    )]
    Busy {
        /// The endpoint.
        endpoint: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// Listening beyond this computer without encryption.
    #[error(
        "{endpoint} can be reached from other computers, and nothing on it is encrypted or authenticated; give the \
         router an identity (`axle keys`), or, to listen there all the same, add --insecure-lan"
    )]
    Exposed {
        /// The endpoint.
        endpoint: String,
    },
    /// Certificates without rules would let everybody who has one do everything.
    #[error(
        "a router with an identity needs access rules; write them with `axle keys issue --topology FILE`"
    )]
    NoRules,
    /// A setting that Zenoh refuses.
    #[error("configure the router: {key}")]
    Config {
        /// The configuration key.
        key: &'static str,
        /// What Zenoh says.
        source: zenoh::Error,
    },
    /// Zenoh did not start.
    #[error("start the router on {endpoints}")]
    Open {
        /// Where it should listen.
        endpoints: String,
        /// What Zenoh says.
        source: zenoh::Error,
    },
}

/// Where a router listens, and which routers it links to.
#[derive(Clone, Debug, Default)]
pub struct RouterSettings {
    /// Endpoints to listen on, `tcp/host:port` or `tls/host:port`.
    pub listen: Vec<String>,
    /// Endpoints of routers on other computers; they are tried for ever.
    pub connect: Vec<String>,
    /// Allows to listen beyond loopback without encryption.
    pub insecure_lan: bool,
    /// How it holds its links.
    pub link: Link,
    /// With an identity, who may do what: the `access_control` of Zenoh, as JSON5.
    pub access: Option<String>,
}

/// A running router; dropping it stops it.
pub struct Router {
    session: Session,
}

impl Router {
    /// Starts a router. Blocks until it listens.
    ///
    /// # Errors
    /// A [`RouterFault`] that names the endpoint.
    pub fn start(settings: &RouterSettings) -> Result<Self, RouterFault> {
        for endpoint in settings.listen.iter().chain(&settings.connect) {
            settings.link.check(endpoint).map_err(RouterFault::Endpoint)?;
        }
        for endpoint in &settings.listen {
            probe(endpoint, settings.insecure_lan)?;
        }
        if settings.link.identity.is_some() && settings.access.is_none() {
            return Err(RouterFault::NoRules);
        }
        let mut config = Config::default();
        let list = |endpoints: &[String]| {
            let quoted: Vec<String> = endpoints.iter().map(|endpoint| format!("{endpoint:?}")).collect();
            format!("[{}]", quoted.join(", "))
        };
        let own = [
            ("mode", "\"router\"".to_owned()),
            ("listen/endpoints", list(&settings.listen)),
            ("connect/endpoints", list(&settings.connect)),
            // A link that is healed shall be found at once; a try costs a packet.
            (
                "connect/retry",
                "{ period_init_ms: 50, period_max_ms: 200, period_increase_factor: 2 }".to_owned(),
            ),
            // Nobody is looked for by scouting, so nothing has to be waited for.
            ("scouting/delay", "0".to_owned()),
        ];
        let shared = LINK.iter().map(|(key, value)| (*key, (*value).to_owned()));
        let access = settings.access.iter().map(|rules| ("access_control", rules.clone()));
        for (key, value) in own.into_iter().chain(shared).chain(settings.link.settings()).chain(access) {
            config.insert_json5(key, &value).map_err(|source| RouterFault::Config { key, source })?;
        }
        let endpoints = settings.listen.join(", ");
        let session = zenoh::open(config).wait().map_err(|source| RouterFault::Open { endpoints, source })?;
        Ok(Self { session })
    }

    /// Stops the router.
    pub fn stop(self) {
        // A link that does not close ends with the process; there is nobody to tell.
        drop(self.session.close().wait());
    }
}

/// Finds out before Zenoh does, and says more clearly, what is wrong with an endpoint.
fn probe(endpoint: &str, insecure_lan: bool) -> Result<(), RouterFault> {
    let address = endpoint.trim_start_matches("tcp/").trim_start_matches(SECURE);
    let addresses: Vec<_> = address
        .to_socket_addrs()
        .map_err(|source| RouterFault::Unresolved { endpoint: endpoint.to_owned(), source })?
        .collect();
    let is_plain = !endpoint.starts_with(SECURE);
    if is_plain && !insecure_lan && addresses.iter().any(|address| !address.ip().is_loopback()) {
        return Err(RouterFault::Exposed { endpoint: endpoint.to_owned() });
    }
    TcpListener::bind(&addresses[..])
        .map(drop)
        .map_err(|source| RouterFault::Busy { endpoint: endpoint.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_endpoint_is_refused_by_name() {
        let check = |endpoint: &str, words: &str| {
            let settings = RouterSettings { listen: vec![endpoint.to_owned()], ..RouterSettings::default() };
            let Err(fault) = Router::start(&settings) else { panic!("{endpoint} is accepted") };
            assert!(fault.to_string().contains(words), "{endpoint}: {fault}");
        };
        check("127.0.0.1:7447", "is not an endpoint");
        check("tcp/127.0.0.1:99999", "is not an endpoint");
        check("tcp/0.0.0.0:7447", "--insecure-lan");
        check("tls/0.0.0.0:7447", "--identity");
        let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let port = taken.local_addr().expect("an address").port();
        check(&format!("tcp/127.0.0.1:{port}"), "choose another port");
    }
}
