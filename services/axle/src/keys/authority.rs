//! The authority: a certificate that signs all others, and its key.

use super::{Entry, Owner, Role, write};
use crate::out::usage;
use anyhow::Context as _;
use axle_schema::RobotId;
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer,
    KeyPair, KeyUsagePurpose, SerialNumber,
};
use std::path::Path;
use time::OffsetDateTime;

pub(super) const CERTIFICATE: &str = "ca.pem";
const KEY: &str = "ca.key.pem";
/// Clocks of computers differ: a certificate is valid from a little before its issue.
const BEFORE: i64 = 3600;
const DAY: i64 = 86_400;

/// What is issued.
#[derive(Clone, Debug)]
pub(crate) struct Issue {
    pub(crate) owner: Owner,
    pub(crate) role: Role,
    /// The robots that a person may act on; none are all.
    pub(crate) robots: Vec<RobotId>,
    /// The names and addresses at which a router is reached.
    pub(crate) addresses: Vec<String>,
    pub(crate) days: u32,
}

/// A certificate, its key, and the line of the ledger.
pub(super) struct Issued {
    pub(super) certificate: String,
    pub(super) key: String,
    pub(super) entry: Entry,
}

/// An authority that can sign.
pub(crate) struct Authority {
    issuer: Issuer<'static, KeyPair>,
    pub(super) pem: String,
}

impl Authority {
    /// Makes a new one.
    pub(super) fn create(directory: &Path, name: &str, days: u32) -> anyhow::Result<()> {
        let mut params = CertificateParams::new(Vec::new())?;
        params.distinguished_name = subject(name, "authority");
        // It signs owners, and nobody who signs others.
        params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
        (params.not_before, params.not_after) = validity(days)?;
        params.serial_number = Some(serial());
        let key = KeyPair::generate()?;
        let certificate = params.self_signed(&key)?;
        write(&directory.join(KEY), &key.serialize_pem(), 0o600)?;
        write(&directory.join(CERTIFICATE), &certificate.pem(), 0o644)
    }

    /// Opens the one in a directory.
    pub(super) fn open(directory: &Path) -> anyhow::Result<Self> {
        let read = |file: &str| {
            let path = directory.join(file);
            std::fs::read_to_string(&path).map_err(|fault| {
                usage(format!(
                    "cannot read {}: {fault}; keys are issued where the authority is",
                    path.display()
                ))
            })
        };
        let (pem, key) = (read(CERTIFICATE)?, read(KEY)?);
        let key = KeyPair::from_pem(&key).with_context(|| format!("read the key {KEY}"))?;
        let issuer = Issuer::from_ca_cert_pem(&pem, key).with_context(|| format!("read {CERTIFICATE}"))?;
        Ok(Self { issuer, pem })
    }

    /// Signs a certificate for a new key; `number` counts the certificates of this owner.
    pub(super) fn issue(&self, issue: &Issue, number: usize) -> anyhow::Result<Issued> {
        let name = issue.owner.to_string();
        let common_name = if number > 1 { format!("{name}~{number}") } else { name.clone() };
        let mut params = CertificateParams::new(issue.addresses.clone())
            .map_err(|fault| usage(format!("--address {}: {fault}", issue.addresses.join(", "))))?;
        params.distinguished_name = subject(&common_name, issue.role.word());
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = match issue.role {
            // Routers link to routers; nobody else can pass for one.
            Role::Router => vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth],
            // It is shown to browsers, and to no router.
            Role::Page => vec![ExtendedKeyUsagePurpose::ServerAuth],
            _ => vec![ExtendedKeyUsagePurpose::ClientAuth],
        };
        (params.not_before, params.not_after) = validity(issue.days)?;
        let (expires, serial) = (params.not_after.unix_timestamp(), serial());
        params.serial_number = Some(serial.clone());
        params.use_authority_key_identifier_extension = true;
        let key = KeyPair::generate()?;
        let certificate = params.signed_by(&key, &self.issuer)?;
        let entry = Entry {
            name,
            common_name,
            role: issue.role,
            robots: issue.robots.clone(),
            serial: serial.to_bytes().iter().map(|byte| format!("{byte:02x}")).collect(),
            issued: now().unix_timestamp(),
            expires,
            revoked: false,
        };
        Ok(Issued { certificate: certificate.pem(), key: key.serialize_pem(), entry })
    }
}

fn subject(common_name: &str, role: &str) -> DistinguishedName {
    let mut name = DistinguishedName::new();
    name.push(DnType::CommonName, common_name);
    name.push(DnType::OrganizationalUnitName, role);
    name
}

fn now() -> OffsetDateTime {
    // A clock before 1970 or after 9999 is the clock of no computer that can issue certificates.
    #[allow(clippy::cast_possible_truncation, reason = "seconds since 1970 fit")]
    let seconds = axle_mesh::clock::wall() as i64;
    OffsetDateTime::from_unix_timestamp(seconds).unwrap_or(OffsetDateTime::UNIX_EPOCH)
}

fn validity(days: u32) -> anyhow::Result<(OffsetDateTime, OffsetDateTime)> {
    let (from, until) = (now().unix_timestamp() - BEFORE, now().unix_timestamp() + i64::from(days) * DAY);
    Ok((OffsetDateTime::from_unix_timestamp(from)?, OffsetDateTime::from_unix_timestamp(until)?))
}

/// A number that no other certificate has: 126 random bits, the first of which is not zero.
fn serial() -> SerialNumber {
    let mut bytes = [axle_mesh::random_bits().to_be_bytes(), axle_mesh::random_bits().to_be_bytes()].concat();
    bytes[0] = bytes[0] & 0x7f | 0x40;
    SerialNumber::from(bytes)
}
