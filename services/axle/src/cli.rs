//! The command line.

pub(crate) mod drive;
mod lines;
mod tournament;

pub(crate) use lines::{Chart, Convert, Estimate};
pub(crate) use tournament::Tournament;

use crate::settings::Settings;
use axle_schema::{Pose, Refusal, WayTask};
use clap::{Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Services that drive differential-wheeled robots, over Zenoh.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true, disable_help_subcommand = true, max_term_width = 110)]
#[command(after_help = "Start with `axle demo`. Exit codes: 0 done, 1 failed, 2 wrong command line or file.")]
pub(crate) struct Cli {
    /// Settings that every command takes.
    #[command(flatten)]
    pub(crate) settings: Settings,
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Drive an emulated robot around a square, through a real mesh, and draw what it did
    Demo(Demo),
    /// Start the router and all services of a topology, and watch over them
    Up(Up),
    /// Run one service
    Run(Run),
    /// Run the Zenoh router of this computer
    Router(Router),
    /// List the live services
    Ps(Json),
    /// Find out whether a service works, by a round trip of data through its router
    Doctor(Doctor),
    /// List the streams with type, rate and size
    Ls(Ls),
    /// Ask Pathfinder for the geometries of a way, and Pathdriver for the movements
    Plan(Plan),
    /// Drive a way, and show how far the robot is
    Go(Go),
    /// Drive by the Generic Differential Drive contract: powers, speeds, distances, degrees, the keyboard
    #[command(subcommand)]
    Drive(drive::Drive),
    /// Stop the wheels at once; nothing moves until `axle enable`
    Stop(Stop),
    /// Allow the wheels to move again after a stop
    Enable(Json),
    /// Check a topology: unknown services, missing inputs, two who say the same
    Check {
        /// The topology [default: one emulated robot and its planners]
        topology: Option<PathBuf>,
    },
    /// Draw a topology: services, streams and computers, and what of it is alive
    Graph(Graph),
    /// Judge a drive by the Generic Differential Drive contract, clause by clause; the robot moves
    Conform(Conform),
    /// Print any stream, decoded, one line a message
    Tap(Tap),
    /// Convert JSON lines: movements to poses, encoder readings to spans, and every other arrow of the map
    Convert(Convert),
    /// Draw JSON lines or a recording as SVG: the path, and what the wheels do over time
    Chart(Chart),
    /// Estimate where a robot was from a log of its measurements, by any method of the navigator
    Estimate(Estimate),
    /// Compare the correctors on emulated robots in virtual time, or tune one
    Tournament(Tournament),
    /// Print the parameters of a service with their explanations
    Params {
        /// The service
        service: String,
    },
    /// Measure the mesh, and the computation of motion
    #[command(subcommand)]
    Bench(Bench),
    /// Print a script that completes commands in a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print a generated page of the documentation
    #[command(hide = true)]
    Docs {
        /// The page
        page: Page,
    },
    /// The process that `axle bench stop` kills
    #[command(hide = true)]
    BenchCommander,
    /// The other end of `axle bench mesh`
    #[command(hide = true)]
    BenchPeer,
}

/// `axle stop`.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Stop {
    /// Stop every robot of the mesh, whatever --robot says
    #[arg(long)]
    pub(crate) all: bool,
    /// Print one JSON object a robot
    #[arg(long)]
    pub(crate) json: bool,
}

/// `axle graph`.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Graph {
    /// The topology [default: one emulated robot and its planners]
    pub(crate) topology: Option<PathBuf>,
    /// Mark what is alive, silent or missing on the mesh now
    #[arg(long)]
    pub(crate) live: bool,
    /// Write the picture to a file
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// Print one JSON object a wire
    #[arg(long, conflicts_with = "dot")]
    pub(crate) json: bool,
    /// Print it in the language of Graphviz
    #[arg(long)]
    pub(crate) dot: bool,
}

/// `axle conform`.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Conform {
    /// Print one JSON object a clause
    #[arg(long)]
    pub(crate) json: bool,
    /// Write the report to a file as well
    #[arg(long, value_name = "FILE")]
    pub(crate) markdown: Option<PathBuf>,
}

/// Prints data for machines.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Json {
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `axle demo`.
#[derive(Debug, clap::Args)]
pub(crate) struct Demo {
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    /// The seed of the robot's errors
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) seed: u64,
    /// Where to write demo.svg, demo.mcap and demo.log
    #[arg(long, default_value = "demo-out", value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// The points to visit, in metres
    #[arg(long, value_name = "x,y x,y …", default_value = "0,0 1,0 1,1 0,1 0,0", value_parser = way, allow_hyphen_values = true)]
    pub(crate) way: WayTask,
    /// The corrector that drives
    #[arg(long, value_name = "NAME", default_value = "d-corrector")]
    pub(crate) corrector: String,
}

/// Arguments of `axle up`.
#[derive(Debug, clap::Args)]
pub(crate) struct Up {
    /// The topology [default: one emulated robot and its planners]
    pub(crate) topology: Option<PathBuf>,
    /// Where the router listens, instead of where the topology says
    #[arg(long, env = "AXLE_LISTEN", hide_env_values = true, value_name = "tcp/HOST:PORT")]
    pub(crate) listen: Option<String>,
}

/// Arguments of `axle run`.
#[derive(Debug, clap::Args)]
pub(crate) struct Run {
    /// The service; `axle run help` lists them
    #[arg(env = "AXLE_SERVICE", hide_env_values = true)]
    pub(crate) service: String,
    /// Hear a stream from elsewhere; may be given several times
    #[arg(long, value_name = "STREAM=OTHER")]
    pub(crate) input: Vec<String>,
    /// Its parameters [default: those that `axle params SERVICE` prints]
    #[arg(long, env = "AXLE_PARAMS", hide_env_values = true, value_name = "FILE")]
    pub(crate) params: Option<PathBuf>,
}

/// Arguments of `axle router`.
#[derive(Debug, clap::Args)]
pub(crate) struct Router {
    /// Where to listen; may be given several times
    #[arg(
        long,
        env = "AXLE_LISTEN", hide_env_values = true,
        value_name = "tcp/HOST:PORT",
        value_delimiter = ',',
        default_value = axle_router::DEFAULT_ENDPOINT
    )]
    pub(crate) listen: Vec<String>,
    /// A router of another computer to link to; may be given several times
    #[arg(long, value_name = "tcp/HOST:PORT", value_delimiter = ',')]
    pub(crate) link: Vec<String>,
    /// Listen beyond this computer although nothing is encrypted or authenticated
    #[arg(long)]
    pub(crate) insecure_lan: bool,
}

/// `axle doctor`.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Doctor {
    /// Look at one process: the service or router of this computer that is named, the healthcheck of a container
    #[arg(long = "self", required = true)]
    pub(crate) own: bool,
    /// The service, or `router`
    #[arg(env = "AXLE_SERVICE", hide_env_values = true)]
    pub(crate) service: String,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `axle ls`.
#[derive(Debug, clap::Args)]
pub(crate) struct Ls {
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// How long to listen, in seconds
    #[arg(long = "for", default_value_t = 2.0, value_name = "SECONDS", value_parser = listening)]
    pub(crate) seconds: f64,
}

/// Arguments of `axle plan`.
#[derive(Debug, clap::Args)]
pub(crate) struct Plan {
    /// The points to visit: "x,y x,y …" in metres; a third number is a heading in radians
    #[arg(value_parser = way, allow_hyphen_values = true)]
    pub(crate) way: WayTask,
    /// Where the robot is: x,y,heading
    #[arg(long, value_name = "x,y,heading", value_parser = pose, allow_hyphen_values = true)]
    pub(crate) from: Option<Pose>,
    /// Ask Pathdriver too, and print the movements
    #[arg(long)]
    pub(crate) drive: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Draw the path
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
}

/// Arguments of `axle go`.
#[derive(Debug, clap::Args)]
pub(crate) struct Go {
    /// The points to visit: "x,y x,y …" in metres; a third number is a heading in radians
    #[arg(value_parser = way, allow_hyphen_values = true)]
    pub(crate) way: WayTask,
    /// The corrector that drives [default: the pilot's choice]
    #[arg(long, value_name = "NAME")]
    pub(crate) corrector: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `axle tap`.
#[derive(Debug, clap::Args)]
pub(crate) struct Tap {
    /// The keys: axle/r1/navigator/pose, axle/r1/**, axle/*/gate/state …
    pub(crate) keys: String,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// End after that many messages
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) count: Option<u64>,
    /// Print the rate of each stream, once a second
    #[arg(long, conflicts_with = "bw")]
    pub(crate) hz: bool,
    /// Print the bandwidth of each stream, once a second
    #[arg(long)]
    pub(crate) bw: bool,
}

/// The benches.
#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    /// The exact motion of a movement: time, error, and the price of Simpson's rule
    Motion {
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// How soon the wheels brake when whoever commands them is killed, frozen or cut off
    Stop {
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// How many faults to inject
        #[arg(long, default_value_t = 100, value_name = "N", value_parser = clap::value_parser!(u32).range(6..100_000))]
        injections: u32,
    },
    /// A query and a hop of Axle against bare Zenoh, side by side
    Mesh {
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// How many rounds of each
        #[arg(long, default_value_t = 5000, value_name = "N", value_parser = clap::value_parser!(u32).range(100..1_000_000))]
        rounds: u32,
    },
}

/// Generated pages.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Page {
    /// docs/keys.md
    Keys,
    /// docs/services.md
    Services,
    /// docs/cli.md
    Cli,
    /// docs/dead-reckoning.md
    DeadReckoning,
}

fn way(text: &str) -> Result<WayTask, Refusal> {
    WayTask::parse(text)
}

fn pose(text: &str) -> Result<Pose, Refusal> {
    let way = WayTask::parse(text)?;
    match &way.points[..] {
        [point] => Ok(Pose { x: point.x, y: point.y, heading: point.heading.unwrap_or_default() }),
        _ => Err(Refusal::malformed("pose", "write one point: x,y,heading")),
    }
}

fn listening(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.1..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("write seconds, 0.1 to 3600".into()),
    }
}
