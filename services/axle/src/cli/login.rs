//! `axle login`.

use axle_gateway::login::Role;
use axle_schema::RobotId;
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// Where logins stand.
#[derive(Clone, Debug, Args)]
pub(crate) struct LoginFile {
    /// The file [default: logins.toml beside the keys]
    #[arg(long, value_name = "FILE")]
    pub(crate) file: Option<PathBuf>,
    /// The directory of keys
    #[arg(long, env = "AXLE_KEYS", hide_env_values = true, value_name = "DIR", default_value = "axle-keys")]
    pub(crate) keys: PathBuf,
}

impl LoginFile {
    /// The file that is meant.
    pub(crate) fn path(&self) -> PathBuf {
        self.file.clone().unwrap_or_else(|| self.keys.join(crate::logins::FILE))
    }
}

/// `axle login`.
#[derive(Clone, Debug, Subcommand)]
pub(crate) enum Login {
    /// Let a person log in with a password, or a program with a token; asks for the password, or reads it from stdin
    Add {
        /// The name
        name: String,
        /// What they may do: viewers look and stop, operators drive
        #[arg(long, value_name = "ROLE", default_value = "operator", value_parser = role)]
        role: Role,
        /// The robots that they may act on; may be given several times [default: all]
        #[arg(long = "only", value_name = "ROBOT")]
        robots: Vec<RobotId>,
        /// Make a token for a program, and print it
        #[arg(long)]
        token: bool,
        /// The file.
        #[command(flatten)]
        file: LoginFile,
    },
    /// Let somebody in no longer; a running gateway ends their sessions
    Remove {
        /// The name
        name: String,
        /// The file.
        #[command(flatten)]
        file: LoginFile,
    },
    /// Show who may log in
    Show {
        /// The file.
        #[command(flatten)]
        file: LoginFile,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}

fn role(text: &str) -> Result<Role, String> {
    match text {
        "viewer" => Ok(Role::Viewer),
        "operator" => Ok(Role::Operator),
        _ => Err("write viewer or operator".into()),
    }
}
