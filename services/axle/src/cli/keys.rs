//! `axle keys` and `axle install`.

use crate::keys::Role;
use axle_schema::RobotId;
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// Where keys lie.
#[derive(Clone, Debug, Args)]
pub(crate) struct KeysDirectory {
    /// The directory of keys
    #[arg(long, env = "AXLE_KEYS", hide_env_values = true, value_name = "DIR", default_value = "axle-keys")]
    pub(crate) keys: PathBuf,
}

/// `axle keys`.
#[derive(Clone, Debug, Subcommand)]
pub(crate) enum Keys {
    /// Make an authority, which signs all certificates
    Init {
        /// The directory.
        #[command(flatten)]
        directory: KeysDirectory,
        /// The name of the authority
        #[arg(long, default_value = "axle", value_name = "NAME")]
        name: String,
        /// How long it is valid
        #[arg(long, default_value_t = 3650, value_name = "DAYS", value_parser = clap::value_parser!(u32).range(1..36_500))]
        days: u32,
    },
    /// Issue certificates, and write the access rules of the routers
    Issue(Issue),
    /// Take everything back that was issued to somebody, and write the access rules of the routers
    Revoke {
        /// Whose certificates: d-corrector@r1, router@onboard, ann
        name: String,
        /// The topology that the access rules follow [default: one emulated robot and its planners]
        #[arg(long, value_name = "FILE")]
        topology: Option<PathBuf>,
        /// The directory.
        #[command(flatten)]
        directory: KeysDirectory,
    },
    /// Show what was issued, and until when it is valid
    Show {
        /// The directory.
        #[command(flatten)]
        directory: KeysDirectory,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}

/// `axle keys issue`.
#[derive(Clone, Debug, Args)]
pub(crate) struct Issue {
    /// For whom: SERVICE@ROBOT, pathfinder@all, router@HOST, page@HOST, or the name of a person [default: everybody of
    /// the topology who has none]
    pub(crate) names: Vec<String>,
    /// What the persons may do
    #[arg(long, value_name = "ROLE")]
    pub(crate) role: Option<Role>,
    /// The robots that the persons may act on; may be given several times [default: all]
    #[arg(long = "only", value_name = "ROBOT")]
    pub(crate) robots: Vec<RobotId>,
    /// A name or address at which the routers and pages are reached, beside those of the topology; may be given several
    /// times
    #[arg(long, value_name = "HOST")]
    pub(crate) address: Vec<String>,
    /// How long the certificates are valid
    #[arg(long, default_value_t = 90, value_name = "DAYS", value_parser = clap::value_parser!(u32).range(1..3650))]
    pub(crate) days: u32,
    /// The topology that the access rules follow [default: one emulated robot and its planners]
    #[arg(long, value_name = "FILE")]
    pub(crate) topology: Option<PathBuf>,
    /// The directory.
    #[command(flatten)]
    pub(crate) directory: KeysDirectory,
}

/// `axle install`.
#[derive(Clone, Debug, Args)]
pub(crate) struct Install {
    /// The topology
    #[arg(long, value_name = "FILE")]
    pub(crate) topology: PathBuf,
    /// Below which directory to write, for a root file system that is mounted elsewhere
    #[arg(long, default_value = "/", value_name = "DIR")]
    pub(crate) prefix: PathBuf,
    /// Copy the identities of this computer from this directory of `axle keys`
    #[arg(long, env = "AXLE_KEYS", hide_env_values = true, value_name = "DIR")]
    pub(crate) keys: Option<PathBuf>,
    /// Where the program lies on that computer
    #[arg(long, default_value = "/usr/local/bin/axle", value_name = "FILE")]
    pub(crate) program: PathBuf,
}
