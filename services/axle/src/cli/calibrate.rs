//! The arguments of `axle calibrate`.

use axle_calibrator::Room;
use std::path::PathBuf;

/// Arguments of `axle calibrate`.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Calibrate {
    /// The free floor around the robot, which stands in its middle: length along its nose, and width, in metres
    #[arg(long, value_name = "2x2")]
    pub(crate) room: Option<Room>,
    /// How often everything is measured, 2 to 20: intervals come from how the passes differ
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(2..=20))]
    pub(crate) passes: u32,
    /// Measure where the squares end with a ruler, and type it in: for robots without a gyroscope
    #[arg(long, requires = "room")]
    pub(crate) by_hand: bool,
    /// Where to write the calibration, the report and its pictures
    #[arg(long, value_name = "DIR", default_value = "calibration")]
    pub(crate) out: PathBuf,
    /// Measure, but leave the robot as it is
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Watch a robot that others drive, and propose what its calibration should be
    #[arg(long, conflicts_with_all = ["room", "dry_run"])]
    pub(crate) watch: bool,
    /// Apply what the watch proposes, whenever the robot stands and nobody holds it
    #[arg(long, requires = "watch")]
    pub(crate) adapt: bool,
    /// End the watch after so many seconds [default: never]
    #[arg(long = "for", value_name = "SECONDS", requires = "watch", value_parser = clap::value_parser!(u32).range(1..=86_400))]
    pub(crate) seconds: Option<u32>,
    /// Move nothing: fit what the motors do after a step from a recording, as the emulator takes it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["room", "dry_run", "watch"])]
    pub(crate) recording: Option<PathBuf>,
    /// The time after a step within which the wheels reach their speed
    #[arg(long, value_name = "SECONDS", default_value_t = 0.8, requires = "recording")]
    pub(crate) response: f64,
    /// The speed that a full signal stands for, in m/s; that of the emulator is a fifth more than robot.wheel_speed
    #[arg(long, value_name = "M/S", default_value_t = 1.2, requires = "recording")]
    pub(crate) full_speed: f64,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}
