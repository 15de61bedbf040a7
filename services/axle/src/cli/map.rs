//! The arguments of `axle map`.

use clap::Subcommand;
use std::path::PathBuf;

/// What to do with a map.
#[derive(Debug, Subcommand)]
pub(crate) enum Map {
    /// Show a map: in letters and numbers, and as a picture
    Show {
        /// The map.yaml
        map: PathBuf,
        /// Print one JSON object, and no letters
        #[arg(long)]
        json: bool,
        /// Draw it as SVG
        #[arg(long, value_name = "FILE")]
        svg: Option<PathBuf>,
        /// Write it as PNG
        #[arg(long, value_name = "FILE")]
        png: Option<PathBuf>,
        /// Letters of a line
        #[arg(long, default_value_t = 100, value_name = "N", value_parser = clap::value_parser!(u16).range(10..=400))]
        columns: u16,
    },
    /// Say whether a map can be read, and what of it is wrong
    Check {
        /// The map.yaml
        map: PathBuf,
        /// Say too how much of it a robot of this radius can reach, in metres
        #[arg(long, value_name = "METRES", default_value_t = 0.2)]
        body: f64,
    },
    /// Write a map on which every place is occupied that is too near to an obstacle for the middle of a robot
    Inflate {
        /// The map.yaml
        map: PathBuf,
        /// Radius of the robot in metres
        #[arg(long, value_name = "METRES")]
        body: f64,
        /// The map.yaml to write; its image is written beside it
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
}
