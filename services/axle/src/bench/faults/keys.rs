//! Certificates for a bed, and for those who must not get in.

use crate::settings::Settings;
use anyhow::Context as _;
use axle_mesh::clock::STEP;
use std::path::{Path, PathBuf};
use tokio::process::Command;

/// Long enough ago for a certificate of a day.
const LONG_AGO: &str = "-864000";

/// Who knocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Knock {
    /// With a certificate of another authority.
    Other,
    /// With none at all.
    Nobody,
    /// With one that has run out, and a clock that says it has not.
    Expired,
    /// With one for another robot.
    OtherRobot,
}

impl Knock {
    /// The identity that is shown.
    pub(super) fn identity(self, keys: &Path) -> Option<PathBuf> {
        match self {
            Self::Nobody => None,
            Self::Other => Some(other(keys).join("eve")),
            Self::Expired => Some(keys.join("old")),
            Self::OtherRobot => Some(keys.join("mallory")),
        }
    }
    /// The clock of whoever shows it.
    pub(super) fn variables(self) -> &'static [(&'static str, &'static str)] {
        if self == Self::Expired { &[(STEP, LONG_AGO)] } else { &[] }
    }
    /// What they are told, in part.
    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Nobody => "it wants TLS",
            Self::Other => "another authority",
            Self::Expired => "refuses the certificate of old",
            Self::OtherRobot => "access rules",
        }
    }
}

/// Another authority, beside.
fn other(keys: &Path) -> PathBuf {
    keys.with_extension("other")
}

async fn axle(
    args: &[&str],
    keys: &Path,
    topology: Option<&Path>,
    clock: Option<&str>,
) -> anyhow::Result<()> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(args).arg("--keys").arg(keys).args(["--log", "error"]).env_remove("AXLE_IDENTITY");
    if let Some(topology) = topology {
        command.arg("--topology").arg(topology);
    }
    if let Some(clock) = clock {
        command.env(STEP, clock);
    }
    let done = command.output().await.context("run axle keys")?;
    let words = String::from_utf8_lossy(&done.stderr);
    anyhow::ensure!(done.status.success(), "axle {}: {words}", args.join(" "));
    Ok(())
}

/// Issues everything, and says with which settings the bench takes part.
pub(super) async fn issue(settings: &Settings, keys: &Path, topology: &Path) -> anyhow::Result<Settings> {
    let topology = Some(topology);
    axle(&["keys", "init"], keys, None, None).await?;
    axle(&["keys", "issue"], keys, topology, None).await?;
    axle(&["keys", "issue", "ann", "--role", "operator"], keys, topology, None).await?;
    axle(&["keys", "issue", "mallory", "--role", "commander", "--only", "r2"], keys, topology, None).await?;
    axle(&["keys", "issue", "old", "--role", "commander", "--days", "1"], keys, topology, Some(LONG_AGO))
        .await?;
    let other = other(keys);
    axle(&["keys", "init"], &other, None, None).await?;
    axle(&["keys", "issue", "eve", "--role", "commander"], &other, topology, None).await?;
    Ok(Settings { identity: Some(keys.join("ann")), ..settings.clone() })
}

/// Removes everything that was issued.
pub(super) fn remove(keys: &Path) {
    for directory in [keys, &other(keys)] {
        drop(std::fs::remove_dir_all(directory));
    }
}
