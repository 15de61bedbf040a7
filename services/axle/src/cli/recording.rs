//! The arguments of the commands that make and read recordings.

use crate::settings::Settings;
use axle_schema::RobotId;
use std::path::PathBuf;

/// Arguments of `axle record`.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct Record {
    /// Look at a recording, repair one, or cut a part out of one
    #[command(subcommand)]
    pub(crate) work: Option<RecordWork>,
    /// What to record: axle/r1/**, axle/*/gate/state … [default: everything of the robot, or of all]
    pub(crate) keys: Vec<String>,
    /// The file to make; one that exists gets a number [default: one in recordings/, named after robot and time]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// End after that many seconds
    #[arg(long = "for", value_name = "SECONDS", value_parser = super::listening)]
    pub(crate) seconds: Option<f64>,
    /// How the recorder works: see `axle params recorder`
    #[arg(long, value_name = "FILE")]
    pub(crate) params: Option<PathBuf>,
}

/// What can be done with recordings.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum RecordWork {
    /// Tell what a recording holds, and whether it is whole
    Info {
        /// The recording
        file: PathBuf,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// Write what is left of a damaged recording into a new, whole one
    Recover {
        /// The recording
        file: PathBuf,
        /// The file to make
        out: PathBuf,
    },
    /// Write a part of a recording into a new one
    Cut {
        /// The recording
        file: PathBuf,
        /// The file to make
        out: PathBuf,
        /// Where the part begins, in seconds since the beginning
        #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
        from: f64,
        /// Where it ends [default: the end]
        #[arg(long, value_name = "SECONDS")]
        to: Option<f64>,
        /// Only streams whose key holds this text; may be given several times
        #[arg(long, value_name = "TEXT")]
        only: Vec<String>,
    },
}

/// Arguments of `axle play`.
#[derive(Debug, clap::Args)]
pub(crate) struct Play {
    /// The recording
    pub(crate) file: PathBuf,
    /// How many times faster than it was recorded, 0.01 to 1000
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    pub(crate) rate: f64,
    /// Begin again at the end
    #[arg(long = "loop")]
    pub(crate) again: bool,
    /// Wait for the space bar before anything is said
    #[arg(long)]
    pub(crate) paused: bool,
    /// Say what was said of one robot as if it were another; may be given several times
    #[arg(long, value_name = "FROM=TO")]
    pub(crate) remap: Vec<String>,
    /// Say commands, stops and orders too, which may move or stop a robot
    #[arg(long)]
    pub(crate) commands: bool,
}

/// Arguments of `axle replay`.
#[derive(Debug, clap::Args)]
pub(crate) struct Replay {
    /// The recording
    pub(crate) file: PathBuf,
    /// The service to replay [default: every service that can be]
    #[arg(long, value_name = "NAME")]
    pub(crate) service: Option<String>,
    /// Parameters to compare with, instead of those that the service had
    #[arg(long, value_name = "PARAMS", requires = "service")]
    pub(crate) against: Option<PathBuf>,
    /// Print one JSON object a service
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `axle why`.
#[derive(Debug, clap::Args)]
pub(crate) struct Why {
    /// The robot
    pub(crate) whose: RobotId,
    /// A recording [default: what is said on the mesh now]
    pub(crate) file: Option<PathBuf>,
    /// When, in seconds of the robot's clock [default: the newest command]
    #[arg(long, value_name = "SECONDS")]
    pub(crate) at: Option<f64>,
    /// How long to listen where there is no recording
    #[arg(long = "for", default_value_t = 2.0, value_name = "SECONDS", value_parser = super::listening)]
    pub(crate) seconds: f64,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

impl Why {
    /// The settings, with the robot that is asked about.
    pub(crate) fn settings(&self, settings: &Settings) -> Settings {
        Settings { robot: Some(self.whose.clone()), ..settings.clone() }
    }
}
