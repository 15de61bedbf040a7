//! Why a router cannot be joined: one handshake by hand, looked at step by step.
//!
//! Zenoh only says that it did not connect. So when it did not, somebody knocks once more, without Zenoh, and reads
//! what the other end says: nobody there, no TLS, a certificate of another authority or for another name, or a refusal of
//! the own certificate, which in TLS 1.3 comes only after the client believes that all is well.

use crate::identity::{Certificate, Identity, SECURE};
use rustls::pki_types::ServerName;
use rustls::{AlertDescription, CertificateError, ClientConfig, ClientConnection, RootCertStore};
use std::io::{ErrorKind, Read as _};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::sync::Arc;
use std::time::Duration;

/// How long each step may take.
const STEP: Duration = Duration::from_millis(800);
/// How long a refusal of the own certificate is waited for.
const REFUSAL: Duration = Duration::from_millis(250);

/// What was found at an endpoint.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Reach {
    /// Somebody listens; with TLS, both accepted each other's certificates.
    #[error("somebody listens at {endpoint}{}", .certificate.as_ref().map(|own| format!(": {}", own.name())).unwrap_or_default())]
    Open {
        /// The endpoint.
        endpoint: String,
        /// What the router shows of itself.
        certificate: Option<Certificate>,
    },
    /// Nobody listens, or there is no way.
    #[error("nothing listens at {endpoint} ({why}): start the router there, or name another one")]
    Nobody {
        /// The endpoint.
        endpoint: String,
        /// What the system says.
        why: String,
    },
    /// Something listens that does not speak TLS.
    #[error(
        "what listens at {endpoint} does not speak TLS: start that router with --identity, or leave out the identity \
         here"
    )]
    Plain {
        /// The endpoint.
        endpoint: String,
    },
    /// The router's certificate is of another authority.
    #[error(
        "the router at {endpoint} shows a certificate of another authority than ca.pem in {identity}: take the identity \
         from whoever runs this router"
    )]
    OtherAuthority {
        /// The endpoint.
        endpoint: String,
        /// The directory of the own identity.
        identity: String,
    },
    /// The router's certificate is for other names.
    #[error(
        "certificate name mismatch: the router at {endpoint} shows a certificate for {}; connect by one of these, or \
         issue it with `axle keys issue router@HOST --address {wanted}`",
        .shown.join(", ")
    )]
    OtherName {
        /// The endpoint.
        endpoint: String,
        /// The name that was looked for.
        wanted: String,
        /// The names in the certificate.
        shown: Vec<String>,
    },
    /// The router's certificate has run out, or is not valid yet by the clock of this computer.
    #[error(
        "the certificate of the router at {endpoint} has expired, or is not valid yet by the clock of this computer: \
         issue it anew with `axle keys issue router@HOST`"
    )]
    RouterExpired {
        /// The endpoint.
        endpoint: String,
    },
    /// The router refuses the own certificate.
    #[error("the router at {endpoint} refuses the certificate of {name}: {why}")]
    Refused {
        /// The endpoint.
        endpoint: String,
        /// Whose certificate it is; `nobody` without one.
        name: String,
        /// What the router says, and what to do.
        why: String,
    },
    /// Something else.
    #[error("no TLS with {endpoint}: {why}")]
    Other {
        /// The endpoint.
        endpoint: String,
        /// What rustls says.
        why: String,
    },
}

impl Reach {
    /// Whether nothing is wrong so far.
    #[must_use]
    pub const fn is_open(&self) -> bool {
        matches!(self, Self::Open { .. })
    }
}

/// Knocks at an endpoint. Blocks, for two seconds at most.
#[must_use]
pub fn probe(endpoint: &str, identity: Option<&Identity>) -> Reach {
    let endpoint = endpoint.to_owned();
    let (is_tls, address) = match (endpoint.strip_prefix(SECURE), endpoint.strip_prefix("tcp/")) {
        (Some(address), _) => (true, address),
        (None, address) => (false, address.unwrap_or(&endpoint)),
    };
    let nobody = |fault: std::io::Error| Reach::Nobody { endpoint: endpoint.clone(), why: fault.to_string() };
    let stream = match connect(address) {
        Ok(stream) => stream,
        Err(fault) => return nobody(fault),
    };
    if !is_tls {
        return plain(endpoint.clone(), stream);
    }
    let Some(identity) = identity else {
        let why = "it has none; name one with --identity DIR".to_owned();
        return Reach::Refused { endpoint, name: "nobody".into(), why };
    };
    match handshake(address, stream, identity) {
        Ok(certificate) => Reach::Open { endpoint, certificate },
        Err(fault) => explain(endpoint.clone(), address, identity, &fault),
    }
}

fn connect(address: &str) -> std::io::Result<TcpStream> {
    let mut last = std::io::Error::new(ErrorKind::NotFound, "the name means nothing here");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, STEP) {
            Ok(stream) => {
                stream.set_read_timeout(Some(STEP))?;
                stream.set_write_timeout(Some(STEP))?;
                return Ok(stream);
            }
            Err(fault) => last = fault,
        }
    }
    Err(last)
}

/// A router waits for its client to speak; one that wants TLS says so when it hears something else.
fn plain(endpoint: String, mut stream: TcpStream) -> Reach {
    use std::io::Write as _;
    let mut said = [0; 1];
    // Two bytes of length and nothing of that length: no message of Zenoh, and no record of TLS.
    let heard = stream
        .write_all(&[0; 8])
        .and_then(|()| stream.set_read_timeout(Some(REFUSAL)))
        .and_then(|()| stream.read(&mut said));
    match heard {
        // The first byte of an alert of TLS.
        Ok(1) if said == [21] => Reach::Refused {
            endpoint,
            name: "nobody".into(),
            why: "it wants TLS; name an identity with --identity DIR".into(),
        },
        _ => Reach::Open { endpoint, certificate: None },
    }
}

/// Shakes hands, and waits for what the router has to say against the own certificate.
fn handshake(
    address: &str,
    mut stream: TcpStream,
    identity: &Identity,
) -> std::io::Result<Option<Certificate>> {
    let other = |fault: &dyn std::fmt::Display| std::io::Error::other(fault.to_string());
    let (authority, own, key) = identity.material().map_err(|fault| other(&fault))?;
    let mut roots = RootCertStore::empty();
    roots.add(authority).map_err(std::io::Error::other)?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&rustls::version::TLS13])
        .map_err(std::io::Error::other)?
        .with_root_certificates(roots)
        .with_client_auth_cert(vec![own], key)
        .map_err(std::io::Error::other)?;
    let host = host_of(address).to_owned();
    let name = ServerName::try_from(host).map_err(|fault| other(&fault))?;
    let mut connection = ClientConnection::new(Arc::new(config), name).map_err(std::io::Error::other)?;
    while connection.is_handshaking() {
        connection.complete_io(&mut stream)?;
    }
    let shown = connection.peer_certificates().and_then(|chain| Certificate::from_der(chain.first()?).ok());
    stream.set_read_timeout(Some(REFUSAL))?;
    loop {
        match connection.read_tls(&mut stream) {
            // It has ended the connection without a word, which is a refusal too.
            Ok(0) => return Err(std::io::Error::other("it closed the connection")),
            Ok(_) => {
                connection.process_new_packets().map_err(std::io::Error::other)?;
            }
            // Nothing was said against it.
            Err(fault) if matches!(fault.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                return Ok(shown);
            }
            Err(fault) => return Err(fault),
        }
    }
}

fn host_of(address: &str) -> &str {
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    host.trim_start_matches('[').trim_end_matches(']')
}

fn explain(endpoint: String, address: &str, identity: &Identity, fault: &std::io::Error) -> Reach {
    let tls = fault.get_ref().and_then(|inner| inner.downcast_ref::<rustls::Error>());
    let refused = |why: &str| Reach::Refused {
        endpoint: endpoint.clone(),
        name: identity.name().to_owned(),
        why: why.to_owned(),
    };
    match tls {
        Some(rustls::Error::InvalidCertificate(why)) => match why {
            CertificateError::UnknownIssuer | CertificateError::BadSignature => {
                Reach::OtherAuthority { endpoint, identity: identity.directory().display().to_string() }
            }
            CertificateError::NotValidForName => {
                Reach::OtherName { endpoint, wanted: host_of(address).to_owned(), shown: Vec::new() }
            }
            CertificateError::NotValidForNameContext { presented, .. } => {
                let shown = presented.iter().map(|name| bare_name(name)).collect();
                Reach::OtherName { endpoint, wanted: host_of(address).to_owned(), shown }
            }
            CertificateError::Expired
            | CertificateError::ExpiredContext { .. }
            | CertificateError::NotValidYet
            | CertificateError::NotValidYetContext { .. } => Reach::RouterExpired { endpoint },
            other => Reach::Other { endpoint, why: other.to_string() },
        },
        Some(rustls::Error::AlertReceived(alert)) => match alert {
            AlertDescription::CertificateExpired => {
                refused("it has expired by the clock of that computer; issue it anew with `axle keys issue`")
            }
            AlertDescription::UnknownCA | AlertDescription::DecryptError => {
                refused("it is of another authority; take the identity from whoever runs this router")
            }
            AlertDescription::CertificateRequired => {
                refused("it wants one; name an identity with --identity DIR")
            }
            other => refused(&format!("{other:?}")),
        },
        Some(rustls::Error::InvalidMessage(_)) => Reach::Plain { endpoint },
        Some(other) => Reach::Other { endpoint, why: other.to_string() },
        // A router without TLS waits for more of its own protocol, or hangs up.
        None if matches!(
            fault.kind(),
            ErrorKind::UnexpectedEof
                | ErrorKind::WouldBlock
                | ErrorKind::TimedOut
                | ErrorKind::ConnectionReset
        ) =>
        {
            Reach::Plain { endpoint }
        }
        None => refused(&fault.to_string()),
    }
}

/// `DnsName("lab")` and `IpAddress(127.0.0.1)` as people write them.
fn bare_name(shown: &str) -> String {
    let inner = shown.split_once('(').map_or(shown, |(_, inner)| inner.trim_end_matches(')'));
    inner.trim_matches('"').to_owned()
}
