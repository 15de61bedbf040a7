//! What was issued: the only memory of the authority.

use super::{Owner, Role};
use crate::out::usage;
use axle_schema::RobotId;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The file.
pub(super) const FILE: &str = "ledger.toml";
/// The most certificates that one authority remembers.
const MAX_CERTIFICATES: usize = 10_000;

/// One certificate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    /// Whose it is.
    pub(crate) name: String,
    /// What access rules know it by: the name, and a number from the second issue on.
    pub(crate) common_name: String,
    /// What its owner may do.
    pub(crate) role: Role,
    /// The robots that a person may act on; none are all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) robots: Vec<RobotId>,
    /// The serial number, in hexadecimal digits.
    pub(crate) serial: String,
    /// When it was issued, in seconds since 1970.
    pub(crate) issued: i64,
    /// When it ends, in seconds since 1970.
    pub(crate) expires: i64,
    /// Whether routers let its owner do nothing any more.
    #[serde(default)]
    pub(crate) revoked: bool,
}

/// All certificates of an authority, in the order of their issue.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Ledger {
    #[serde(default)]
    pub(crate) certificates: Vec<Entry>,
}

impl Ledger {
    pub(super) fn read(directory: &Path) -> anyhow::Result<Self> {
        let path = directory.join(FILE);
        let wrong = |why: String| usage(format!("{}: {why}", path.display()));
        let text = std::fs::read_to_string(&path).map_err(|fault| wrong(fault.to_string()))?;
        let ledger: Self = toml::from_str(&text).map_err(|fault| wrong(fault.to_string()))?;
        if ledger.certificates.len() > MAX_CERTIFICATES {
            return Err(wrong(format!("more than {MAX_CERTIFICATES} certificates")));
        }
        for entry in &ledger.certificates {
            Owner::parse(&entry.name).map_err(|fault| wrong(format!("{fault:#}")))?;
        }
        Ok(ledger)
    }

    pub(super) fn to_text(&self) -> anyhow::Result<String> {
        Ok(format!("# Written by `axle keys`; it holds no secrets.\n\n{}", toml::to_string(self)?))
    }

    /// How many certificates an owner has had.
    pub(crate) fn issued_to(&self, owner: &Owner) -> usize {
        let name = owner.to_string();
        self.certificates.iter().filter(|entry| entry.name == name).count()
    }

    /// The certificates of an owner that routers accept.
    pub(crate) fn accepted_of(&self, owner: &Owner) -> impl Iterator<Item = &Entry> {
        let name = owner.to_string();
        self.certificates.iter().filter(move |entry| entry.name == name && !entry.revoked)
    }

    /// The certificates of persons that routers accept.
    pub(crate) fn persons(&self) -> impl Iterator<Item = &Entry> {
        self.certificates.iter().filter(|entry| {
            !entry.revoked && !matches!(entry.role, Role::Service | Role::Router | Role::Page)
        })
    }
}
