//! Arguments of `axle tournament`.

use std::num::NonZero;
use std::path::PathBuf;

/// Arguments of `axle tournament`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "docs/tournament.md reads a real run. The same seed prints the same bytes, on any computer of \
                        one kind and any number of threads."
)]
#[command(group = clap::ArgGroup::new("print").args(["json", "csv", "markdown"]))]
pub(crate) struct Tournament {
    /// The correctors that play [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',', num_args = 1..)]
    pub(crate) only: Vec<String>,
    /// The courses [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',', num_args = 1..)]
    pub(crate) courses: Vec<String>,
    /// The scenarios: what is wrong with the robot [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',', num_args = 1..)]
    pub(crate) scenarios: Vec<String>,
    /// How often each corrector drives each course in each scenario [default: 10, and 1 for each try of --tune]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) runs: Option<u16>,
    /// What all accidents come from
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// How many threads [default: one for each core]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<NonZero<u8>>,
    /// Print JSON, one line for each corrector, course and scenario
    #[arg(long)]
    pub(crate) json: bool,
    /// Print a table for a spreadsheet
    #[arg(long)]
    pub(crate) csv: bool,
    /// Print tables in Markdown
    #[arg(long)]
    pub(crate) markdown: bool,
    /// Draw the paths and box plots, one file for each course and scenario
    #[arg(long, value_name = "DIR")]
    pub(crate) svg: Option<PathBuf>,
    /// Look for better parameters of this corrector, and print them as its parameter file
    #[arg(long, value_name = "NAME", conflicts_with_all = ["print", "svg", "only"])]
    pub(crate) tune: Option<String>,
    /// List the courses and scenarios
    #[arg(long, exclusive = true)]
    pub(crate) list: bool,
}
