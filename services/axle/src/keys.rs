//! The directory of keys: the project's own authority, what it has issued, and an identity for each owner.
//!
//! ```text
//! axle-keys/ca.pem              the authority; everybody gets a copy
//!           ca.key.pem          its key, mode 0600: stays on the computer where keys are issued
//!           ledger.toml         what was issued, until when, and what was revoked
//!           d-corrector@r1/     an identity: ca.pem, cert.pem, key.pem
//!           router@onboard/     the identity of a router, and access.json: who may do what at it
//! ```

mod authority;
mod ledger;
mod owner;

pub(crate) use authority::{Authority, Issue};
pub(crate) use ledger::{Entry, Ledger};
pub(crate) use owner::{Owner, Role};

use crate::access;
use crate::out::usage;
use crate::topology::Topology;
use anyhow::Context as _;
use std::io::Write as _;
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

/// The access rules in the identity of a router.
pub(crate) const ACCESS_FILE: &str = "access.json";

/// A directory of keys.
pub(crate) struct Keys {
    directory: PathBuf,
    pub(crate) ledger: Ledger,
}

impl Keys {
    /// Makes a new one.
    ///
    /// # Errors
    /// When there is one already: its owner would lose the key that everybody trusts.
    pub(crate) fn init(directory: &Path, name: &str, days: u32) -> anyhow::Result<Self> {
        if directory.join(authority::CERTIFICATE).exists() {
            return Err(usage(format!(
                "{} holds an authority already; take another directory",
                directory.display()
            )));
        }
        make_directory(directory)?;
        let keys = Self { directory: directory.to_owned(), ledger: Ledger::default() };
        Authority::create(directory, name, days)?;
        keys.save()?;
        Ok(keys)
    }

    /// Opens one.
    ///
    /// # Errors
    /// When there is none, or its ledger cannot be read.
    pub(crate) fn open(directory: &Path) -> anyhow::Result<Self> {
        if !directory.join(ledger::FILE).exists() {
            return Err(usage(format!(
                "{} holds no keys; make an authority with `axle keys init`, or name its directory with --keys DIR",
                directory.display()
            )));
        }
        let ledger = Ledger::read(directory)?;
        Ok(Self { directory: directory.to_owned(), ledger })
    }

    /// Where the identity of an owner lies.
    pub(crate) fn identity(&self, owner: &Owner) -> PathBuf {
        self.directory.join(owner.to_string())
    }

    /// Issues a certificate with a new key. One that was issued before stays valid until it ends or is revoked.
    pub(crate) fn issue(&mut self, issue: &Issue) -> anyhow::Result<&Entry> {
        let authority = Authority::open(&self.directory)?;
        let number = self.ledger.issued_to(&issue.owner) + 1;
        let issued = authority.issue(issue, number)?;
        let place = self.identity(&issue.owner);
        make_directory(&place)?;
        // In this order: whoever reads in between finds a key that does not fit, and says so.
        write(&place.join(axle_mesh::identity::AUTHORITY_FILE), &authority.pem, 0o644)?;
        write(&place.join(axle_mesh::identity::KEY_FILE), &issued.key, 0o600)?;
        write(&place.join(axle_mesh::identity::CERTIFICATE_FILE), &issued.certificate, 0o644)?;
        self.ledger.certificates.push(issued.entry);
        self.save()?;
        self.ledger.certificates.last().context("the entry that was just written")
    }

    /// Takes everything that was issued to an owner back. Returns how many certificates that were.
    pub(crate) fn revoke(&mut self, owner: &Owner) -> anyhow::Result<usize> {
        let mut count = 0;
        for entry in self.ledger.certificates.iter_mut().filter(|entry| entry.name == owner.to_string()) {
            count += usize::from(!entry.revoked);
            entry.revoked = true;
        }
        self.save()?;
        Ok(count)
    }

    /// Writes the access rules of every router of a topology that has an identity here. Returns the hosts.
    pub(crate) fn write_rules(&self, topology: &Topology) -> anyhow::Result<Vec<String>> {
        let mut written = Vec::new();
        for host in topology.hosts.keys() {
            let place = self.identity(&Owner::Router { host: host.clone() });
            if place.is_dir() {
                let rules = access::rules(topology, host, &self.ledger);
                write(&place.join(ACCESS_FILE), &serde_json::to_string_pretty(&rules)?, 0o644)?;
                written.push(host.clone());
            }
        }
        Ok(written)
    }

    fn save(&self) -> anyhow::Result<()> {
        write(&self.directory.join(ledger::FILE), &self.ledger.to_text()?, 0o600)
    }
}

/// A directory that only its owner can look into.
pub(crate) fn make_directory(path: &Path) -> anyhow::Result<()> {
    std::fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(path)
        .with_context(|| format!("make the directory {}", path.display()))
}

/// Writes a file as a whole or not at all, with this mode from its first byte on.
pub(crate) fn write(path: &Path, text: &str, mode: u32) -> anyhow::Result<()> {
    // Two who write the same at once do not write into each other's file.
    let beside = path.with_extension(format!("{}.new", std::process::id()));
    let written = || {
        // One that a crash has left has its own mode, so it goes first.
        drop(std::fs::remove_file(&beside));
        let mut file = std::fs::OpenOptions::new().write(true).create_new(true).mode(mode).open(&beside)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        std::fs::rename(&beside, path)
    };
    written().with_context(|| format!("write {}", path.display()))
}
