//! The command line of `axle drive`.

use clap::{Args, Subcommand};

/// What to ask the drive.
#[derive(Debug, Subcommand)]
pub(crate) enum Drive {
    /// Give powers to the wheels, -1 to 1, and renew them until the time is over
    Power {
        /// Of the left wheel
        #[arg(allow_negative_numbers = true, value_parser = share)]
        left: f64,
        /// Of the right wheel
        #[arg(allow_negative_numbers = true, value_parser = share)]
        right: f64,
        /// For how long
        #[command(flatten)]
        time: Time,
    },
    /// Give speeds to the wheels, in m/s, and renew them until the time is over
    Speed {
        /// Of the left wheel
        #[arg(allow_negative_numbers = true)]
        left: f64,
        /// Of the right wheel
        #[arg(allow_negative_numbers = true)]
        right: f64,
        /// For how long
        #[command(flatten)]
        time: Time,
    },
    /// Drive straight by a distance, and show how far the robot is
    Distance {
        /// In metres, 0 to 1000; a negative power drives backward
        #[arg(allow_negative_numbers = true)]
        metres: f64,
        /// How much power, -1 to 1
        #[arg(long, default_value_t = 0.4, allow_negative_numbers = true, value_parser = share)]
        power: f64,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// Turn on the spot by an angle, and show how far the robot is
    Rotate {
        /// In degrees, counter-clockwise positive, -36000 to 36000
        #[arg(allow_negative_numbers = true)]
        degrees: f64,
        /// How much power, -1 to 1; its sign does not matter
        #[arg(long, default_value_t = 0.3, allow_negative_numbers = true, value_parser = share)]
        power: f64,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// Set the encoders of the drive to zero
    Reset,
    /// Print the state of the drive
    State {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Print every update and notification, one line each
    Watch {
        /// Print JSON
        #[arg(long)]
        json: bool,
        /// End after that many lines
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
        count: Option<u64>,
    },
    /// Enable the drive, quoting the stop that is in force
    Enable,
    /// Disable the drive: stops at once, whoever drives
    Disable,
    /// Drive by the keyboard: arrows or WASD; releasing the key stops
    Teleop {
        /// How much power for straight on, 0.05 to 1; turns take half of it
        #[arg(long, default_value_t = 0.4, value_parser = strength)]
        power: f64,
    },
}

/// How long powers and speeds are renewed.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Time {
    /// For so many seconds; the wheels brake afterwards
    #[arg(long = "for", default_value_t = 1.0, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) seconds: f64,
}

fn bounded(text: &str, low: f64, high: f64) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if (low..=high).contains(&number) => Ok(number),
        _ => Err(format!("write a number, {low} to {high}")),
    }
}
fn share(text: &str) -> Result<f64, String> {
    bounded(text, -1.0, 1.0)
}
fn strength(text: &str) -> Result<f64, String> {
    bounded(text, 0.05, 1.0)
}
fn seconds(text: &str) -> Result<f64, String> {
    bounded(text, 0.1, 3600.0)
}
