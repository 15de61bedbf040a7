//! The arguments of the commands that work on lines of JSON, without a mesh.

use std::path::PathBuf;

/// Arguments of `axle convert`.
#[derive(Debug, clap::Args)]
pub(crate) struct Convert {
    /// What comes in: dwm, geometry, encoders-data, encoders-span, navigator-data, navigator-span, halves
    #[arg(required_unless_present = "map", requires = "to")]
    pub(crate) from: Option<String>,
    /// What goes out; beyond these, dwm can become a pose
    pub(crate) to: Option<String>,
    /// Print the map of conversions
    #[arg(long)]
    pub(crate) map: bool,
    /// The distance between the wheels in metres, where a line has no "track"
    #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
    pub(crate) track: Option<f64>,
    /// The measurement to accumulate from, in JSON [default: zero]
    #[arg(long, value_name = "JSON")]
    pub(crate) start: Option<String>,
    /// The time between two poses, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.05, allow_hyphen_values = true)]
    pub(crate) step: f64,
    /// How far from a geometry a movement may be, in metres
    #[arg(long, value_name = "METRES", default_value_t = 1e-6, allow_hyphen_values = true)]
    pub(crate) position_tolerance: f64,
    /// How far from the direction of a geometry a movement may head, in radians
    #[arg(long, value_name = "RADIANS", default_value_t = 1e-6, allow_hyphen_values = true)]
    pub(crate) heading_tolerance: f64,
    /// The wheel speeds at the beginning of the first span, in m/s; each movement starts where the last ended
    #[arg(
        long,
        value_name = "LEFT,RIGHT",
        value_delimiter = ',',
        allow_hyphen_values = true,
        conflicts_with = "chain"
    )]
    pub(crate) speeds: Option<Vec<f64>>,
    /// Make one chain of all spans, without a jump of a speed and as smooth as can be
    #[arg(long)]
    pub(crate) chain: bool,
}

/// Arguments of `axle chart`.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Chart {
    /// JSON lines as `axle convert` reads or writes them, or an MCAP recording; - is stdin; several are compared. What
    /// begins with axle/ and is no file are keys, which are listened to
    #[arg(required = true, value_name = "FILE|KEYS")]
    pub(crate) files: Vec<String>,
    /// How long to listen to keys, in seconds; Ctrl-C ends it earlier
    #[arg(long = "for", default_value_t = 10.0, value_name = "SECONDS", value_parser = super::listening)]
    pub(crate) seconds: f64,
    /// The distance between the wheels in metres, where a line has no "track"
    #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
    pub(crate) track: Option<f64>,
    /// The map.yaml of the floor, drawn below the paths
    #[arg(long, value_name = "FILE")]
    pub(crate) map: Option<PathBuf>,
    /// Where to write the chart; a name that ends with .png makes a PNG [default: stdout]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Make a PNG and no SVG
    #[arg(long)]
    pub(crate) png: bool,
}

/// Arguments of `axle estimate`.
#[derive(Debug, clap::Args)]
pub(crate) struct Estimate {
    /// JSON lines of measurements, or an MCAP recording; - is stdin
    #[arg(value_name = "LOG")]
    pub(crate) file: String,
    /// arc, point-and-shoot, half-turn, accelerated, ticks or ekf [default: that of the parameters]
    #[arg(long, value_name = "NAME", conflicts_with = "compare")]
    pub(crate) method: Option<String>,
    /// Parameters of the navigator [default: those that `axle params navigator` prints]
    #[arg(long, value_name = "FILE")]
    pub(crate) params: Option<PathBuf>,
    /// Print how far the estimate is from the truth, instead of the poses
    #[arg(long)]
    pub(crate) report: bool,
    /// Run all methods, and print the report of each
    #[arg(long)]
    pub(crate) compare: bool,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Draw the paths, and the errors over time
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
}
