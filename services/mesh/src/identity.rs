//! Who a process is: a certificate of the project's own authority, and its key.
//!
//! An identity is a directory with three files, `ca.pem`, `cert.pem` and `key.pem`, as `axle keys issue` writes it.
//! With one, every link is TLS and both ends show their certificates (mTLS); the router binds its access rules to the
//! common name. What is wrong with an identity is found here before anything is connected, and said by name: a link
//! that does not come about for it would only look like an absent router.

use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use std::path::{Path, PathBuf};
use x509_parser::certificate::X509Certificate;
use x509_parser::extensions::GeneralName;
use x509_parser::prelude::FromDer as _;

/// The certificate of the authority that everybody trusts.
pub const AUTHORITY_FILE: &str = "ca.pem";
/// The certificate of the process.
pub const CERTIFICATE_FILE: &str = "cert.pem";
/// Its private key.
pub const KEY_FILE: &str = "key.pem";
/// What every endpoint begins with when there is an identity.
pub const SECURE: &str = "tls/";

/// The largest file that is read as a certificate or a key.
const MAX_FILE: u64 = 64 * 1024;

/// What is wrong with an identity.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IdentityFault {
    /// A file that cannot be read.
    #[error("cannot read {path}: {source}; `axle keys issue` makes the directory of an identity")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file that is not what its name says.
    #[error("{path} holds no {what}: {why}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What it should hold.
        what: &'static str,
        /// What is wrong.
        why: String,
    },
    /// A key that others can read.
    #[error("{path} can be read by others (mode {mode:o}): whoever has it is {name}; chmod 600 {path}")]
    Open {
        /// The file.
        path: PathBuf,
        /// Its mode.
        mode: u32,
        /// Whose key it is.
        name: String,
    },
    /// A certificate that another authority has signed.
    #[error(
        "the certificate of {name} in {directory} is not signed by the authority beside it: issue it anew with `axle \
         keys issue {name}`, or take ca.pem from whoever issued it"
    )]
    OtherAuthority {
        /// Whose certificate it is.
        name: String,
        /// Where it lies.
        directory: PathBuf,
    },
    /// A certificate whose time is over.
    #[error("the certificate of {name} in {directory} expired {} ago: issue it anew with `axle keys issue {name}`", span(*.ago))]
    Expired {
        /// Whose certificate it is.
        name: String,
        /// Where it lies.
        directory: PathBuf,
        /// For how many seconds.
        ago: f64,
    },
    /// A certificate whose time has not come.
    #[error(
        "the certificate of {name} in {directory} is valid only in {}: the clock of this computer is probably wrong",
        span(*.until)
    )]
    NotYet {
        /// Whose certificate it is.
        name: String,
        /// Where it lies.
        directory: PathBuf,
        /// In how many seconds.
        until: f64,
    },
    /// A key that belongs to another certificate.
    #[error("key.pem in {directory} does not belong to the certificate of {name} beside it: issue both anew")]
    OtherKey {
        /// Whose certificate it is.
        name: String,
        /// Where it lies.
        directory: PathBuf,
    },
}

/// Seconds for people: days, hours or minutes.
#[must_use]
pub fn span(seconds: f64) -> String {
    match seconds {
        days if days >= 2.0 * 86400.0 => format!("{:.0} days", (days / 86400.0).floor()),
        hours if hours >= 7200.0 => format!("{:.0} hours", (hours / 3600.0).floor()),
        minutes if minutes >= 120.0 => format!("{:.0} minutes", (minutes / 60.0).floor()),
        seconds => format!("{seconds:.0} s"),
    }
}

/// What a certificate says.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// Its common name: what the access rules of routers know its owner by.
    pub common_name: String,
    /// The kind of its owner: `service`, `router`, `viewer`, `operator` or `commander`.
    pub role: String,
    /// From when it is valid, in seconds since 1970.
    pub begins: f64,
    /// Until when.
    pub expires: f64,
    /// The host names and addresses at which its owner may be reached, if it is a router.
    pub addresses: Vec<String>,
}

impl Certificate {
    /// Reads a certificate in DER.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn from_der(der: &[u8]) -> Result<Self, String> {
        let (_, parsed) = X509Certificate::from_der(der).map_err(|fault| fault.to_string())?;
        let text = |attribute: Option<&x509_parser::x509::AttributeTypeAndValue<'_>>| {
            attribute.and_then(|value| value.as_str().ok()).map(str::to_owned)
        };
        let subject = parsed.subject();
        let common_name = text(subject.iter_common_name().next()).ok_or("it has no common name")?;
        let role = text(subject.iter_organizational_unit().next()).unwrap_or_default();
        let names = parsed.subject_alternative_name().map_err(|fault| fault.to_string())?;
        let addresses = names
            .map_or_else(Vec::new, |names| names.value.general_names.iter().filter_map(address).collect());
        #[allow(
            clippy::cast_precision_loss,
            reason = "seconds since 1970 are exact as f64 for millions of years"
        )]
        let (begins, expires) =
            (parsed.validity().not_before.timestamp() as f64, parsed.validity().not_after.timestamp() as f64);
        Ok(Self { common_name, role, begins, expires, addresses })
    }

    /// Its owner: the common name without the number that a later issue adds.
    #[must_use]
    pub fn name(&self) -> &str {
        owner(&self.common_name)
    }
}

/// The owner in a common name: `d-corrector@r1~2` is the second issue of `d-corrector@r1`.
#[must_use]
pub fn owner(common_name: &str) -> &str {
    common_name.split_once('~').map_or(common_name, |(name, _)| name)
}

/// The host names and addresses that a certificate of whatever authority is for, and until when, in seconds since 1970.
///
/// # Errors
/// What is wrong with it, in words.
pub fn served_names(der: &[u8]) -> Result<(Vec<String>, f64), String> {
    let (_, parsed) = X509Certificate::from_der(der).map_err(|fault| fault.to_string())?;
    let names = parsed.subject_alternative_name().map_err(|fault| fault.to_string())?;
    let names =
        names.map_or_else(Vec::new, |names| names.value.general_names.iter().filter_map(address).collect());
    #[allow(clippy::cast_precision_loss, reason = "seconds since 1970")]
    let expires = parsed.validity().not_after.timestamp() as f64;
    Ok((names, expires))
}

/// Refuses a key that everybody can read.
///
/// # Errors
/// As [`IdentityFault`] says it.
pub fn check_private(key: &Path) -> Result<(), IdentityFault> {
    let mode = mode_of(key)?;
    if mode & 0o007 == 0 {
        return Ok(());
    }
    Err(IdentityFault::Open { path: key.to_owned(), mode, name: "the page".to_owned() })
}

fn address(name: &GeneralName<'_>) -> Option<String> {
    match name {
        GeneralName::DNSName(name) => Some((*name).to_owned()),
        GeneralName::IPAddress(bytes) => match **bytes {
            [a, b, c, d] => Some(std::net::Ipv4Addr::new(a, b, c, d).to_string()),
            _ => <[u8; 16]>::try_from(*bytes).ok().map(|bytes| std::net::Ipv6Addr::from(bytes).to_string()),
        },
        _ => None,
    }
}

/// A certificate and its key, looked at and found to be in order.
#[derive(Clone, Debug)]
pub struct Identity {
    directory: PathBuf,
    /// What its certificate says.
    pub certificate: Certificate,
}

impl Identity {
    /// Reads the identity in `directory`; `now` is the time in seconds since 1970.
    ///
    /// # Errors
    /// An [`IdentityFault`] that names the file or the owner, and what to do.
    pub fn read(directory: &Path, now: f64) -> Result<Self, IdentityFault> {
        // Zenoh reads the files by these paths, from wherever it is.
        let directory = std::path::absolute(directory)
            .map_err(|source| IdentityFault::Read { path: directory.to_owned(), source })?;
        let identity = Self { certificate: Self::check(&directory, now)?, directory };
        Ok(identity)
    }

    fn check(directory: &Path, now: f64) -> Result<Certificate, IdentityFault> {
        let at = |file: &str| directory.join(file);
        let authority = certificate_in(&at(AUTHORITY_FILE))?;
        let own = certificate_in(&at(CERTIFICATE_FILE))?;
        let malformed = |file: &str, what, why| IdentityFault::Malformed { path: at(file), what, why };
        let certificate = Certificate::from_der(&own)
            .map_err(|why| malformed(CERTIFICATE_FILE, "certificate of Axle", why))?;
        let (name, directory) = (certificate.name().to_owned(), directory.to_owned());
        let (_, signed) = X509Certificate::from_der(&own)
            .map_err(|why| malformed(CERTIFICATE_FILE, "certificate", why.to_string()))?;
        let (_, signer) = X509Certificate::from_der(&authority)
            .map_err(|why| malformed(AUTHORITY_FILE, "certificate", why.to_string()))?;
        if signed.verify_signature(Some(signer.public_key())).is_err() {
            return Err(IdentityFault::OtherAuthority { name, directory });
        }
        if now >= certificate.expires {
            return Err(IdentityFault::Expired { name, directory, ago: now - certificate.expires });
        }
        if now < certificate.begins {
            return Err(IdentityFault::NotYet { name, directory, until: certificate.begins - now });
        }
        let (path, key) = (at(KEY_FILE), read(&at(KEY_FILE))?);
        let mode = mode_of(&path)?;
        // A group may read it, so that a service manager can hand it to the user of a service.
        if mode & 0o007 != 0 {
            return Err(IdentityFault::Open { path, mode, name });
        }
        let key = PrivateKeyDer::from_pem_slice(&key)
            .map_err(|why| malformed(KEY_FILE, "private key", why.to_string()))?;
        let provider = rustls::crypto::ring::default_provider();
        let fits = rustls::sign::CertifiedKey::from_der(vec![own], key, &provider);
        match fits {
            Ok(_) => Ok(certificate),
            Err(_) => Err(IdentityFault::OtherKey { name, directory }),
        }
    }

    /// Its owner, for example `d-corrector@r1`.
    #[must_use]
    pub fn name(&self) -> &str {
        self.certificate.name()
    }
    /// Where its files lie.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.directory
    }
    /// The certificates and the key as rustls takes them: the authority, the own certificate, the key.
    pub(crate) fn material(
        &self,
    ) -> Result<(CertificateDer<'static>, CertificateDer<'static>, PrivateKeyDer<'static>), IdentityFault>
    {
        let key = self.directory.join(KEY_FILE);
        let parsed = PrivateKeyDer::from_pem_slice(&read(&key)?).map_err(|why| IdentityFault::Malformed {
            path: key,
            what: "private key",
            why: why.to_string(),
        })?;
        let at = |file: &str| certificate_in(&self.directory.join(file));
        Ok((at(AUTHORITY_FILE)?, at(CERTIFICATE_FILE)?, parsed))
    }
    /// The settings of Zenoh that make it so, as JSON5 values by their configuration key.
    #[must_use]
    pub fn settings(&self) -> Vec<(&'static str, String)> {
        // A path may hold quotes; JSON knows what to do with them.
        let file =
            |name: &str| serde_json::Value::from(self.directory.join(name).display().to_string()).to_string();
        let (authority, certificate, key) = (file(AUTHORITY_FILE), file(CERTIFICATE_FILE), file(KEY_FILE));
        vec![
            ("transport/link/tls/root_ca_certificate", authority),
            ("transport/link/tls/connect_certificate", certificate.clone()),
            ("transport/link/tls/connect_private_key", key.clone()),
            ("transport/link/tls/listen_certificate", certificate),
            ("transport/link/tls/listen_private_key", key),
            ("transport/link/tls/enable_mtls", "true".to_owned()),
            ("transport/link/tls/verify_name_on_connect", "true".to_owned()),
            // A certificate that runs out ends its link, and not only the next attempt.
            ("transport/link/tls/close_link_on_expiration", "true".to_owned()),
        ]
    }
}

/// Whether this is a host name or an address, as the certificate of a router may hold it.
#[must_use]
pub fn is_address(text: &str) -> bool {
    rustls::pki_types::ServerName::try_from(text).is_ok()
}

/// The same endpoint with TLS: an identity is never used in plain.
#[must_use]
pub fn secured(endpoint: &str) -> String {
    endpoint.strip_prefix("tcp/").map_or_else(|| endpoint.to_owned(), |address| format!("{SECURE}{address}"))
}

fn certificate_in(path: &Path) -> Result<CertificateDer<'static>, IdentityFault> {
    CertificateDer::from_pem_slice(&read(path)?).map_err(|why| IdentityFault::Malformed {
        path: path.to_owned(),
        what: "certificate",
        why: why.to_string(),
    })
}

fn read(path: &Path) -> Result<Vec<u8>, IdentityFault> {
    use std::io::Read as _;
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(MAX_FILE).read_to_end(&mut bytes))
        .map_err(|source| IdentityFault::Read { path: path.to_owned(), source })?;
    Ok(bytes)
}

fn mode_of(path: &Path) -> Result<u32, IdentityFault> {
    use std::os::unix::fs::PermissionsExt as _;
    let metadata = std::fs::metadata(path);
    let metadata = metadata.map_err(|source| IdentityFault::Read { path: path.to_owned(), source })?;
    Ok(metadata.permissions().mode() & 0o777)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_endpoint_is_secured_once_and_a_span_is_for_people() {
        assert_eq!(secured("tcp/lab:7447"), "tls/lab:7447");
        assert_eq!(secured("tls/lab:7447"), "tls/lab:7447");
        for (seconds, words) in
            [(12.4, "12 s"), (600.0, "10 minutes"), (7200.0, "2 hours"), (90.0 * 86400.0, "90 days")]
        {
            assert_eq!(span(seconds), words);
        }
        assert_eq!(owner("d-corrector@r1~2"), "d-corrector@r1");
    }

    #[test]
    fn what_is_no_identity_is_refused_by_file() {
        let place = std::env::temp_dir().join(format!("axle-identity-{}", std::process::id()));
        std::fs::create_dir_all(&place).expect("a directory");
        let fault = || Identity::read(&place, 0.0).expect_err("no identity").to_string();
        assert!(fault().contains("cannot read") && fault().contains(AUTHORITY_FILE), "{}", fault());
        std::fs::write(place.join(AUTHORITY_FILE), "no certificate").expect("a file");
        assert!(fault().contains("holds no certificate"), "{}", fault());
        std::fs::remove_dir_all(&place).expect("removed");
    }
}
