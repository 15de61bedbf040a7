//! The command line.

mod calibrate;
pub(crate) mod drive;
mod keys;
mod lines;
mod login;
mod map;
mod recording;
mod tap;
mod tournament;

pub(crate) use calibrate::Calibrate;
pub(crate) use keys::{Install, Issue, Keys};
pub(crate) use lines::{Chart, Convert, Estimate};
pub(crate) use login::Login;
pub(crate) use map::Map;
pub(crate) use recording::{Play, Record, RecordWork, Replay, Why};
pub(crate) use tap::{Tap, Top};
pub(crate) use tournament::Tournament;

use crate::settings::Settings;
use axle_robot::BoardKind;
use axle_schema::{Joints, PlanStrategy, Pose, Refusal, Strategy, WayTask};
use clap::{Parser, Subcommand, ValueEnum};
use serde::de::DeserializeOwned;
use std::net::SocketAddr;
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
    /// Find out what is wrong between the services of a topology, or whether one service works
    Doctor(Doctor),
    /// Issue certificates, and the access rules of routers
    #[command(subcommand)]
    Keys(Keys),
    /// Say who may log in at the page from other computers
    #[command(subcommand)]
    Login(Login),
    /// Write the units, parameters and certificates of one computer, for systemd
    Install(Install),
    /// List the streams with type, rate and size
    Ls(Ls),
    /// Ask Pathfinder for the geometries of a way, and Pathdriver for the movements
    Plan(Plan),
    /// Show, check and inflate maps
    #[command(subcommand)]
    Map(Map),
    /// Drive a way, and show how far the robot is
    Go(Go),
    /// Let the robot drive on from a loading point
    Confirm,
    /// Show the robots of a fleet: their order, and who waits for whom
    Traffic(Traffic),
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
    /// Make a service log more or less while it runs; `axle tap 'axle/*/*/log'` prints what is logged
    Log(Log),
    /// Watch the services, beats, rates and gates, and stop, enable or look into them, in a terminal
    Top(Top),
    /// Record any streams to MCAP; look at recordings, repair them, cut parts out of them
    Record(Record),
    /// Say again what was recorded
    Play(Play),
    /// Feed services what they had when a recording was made, and compare what they say, bit for bit
    Replay(Replay),
    /// Tell why the wheels of a robot did what they did: from the command back to the way
    Why(Why),
    /// Convert JSON lines: movements to poses, encoder readings to spans, and every other arrow of the map
    Convert(Convert),
    /// Draw JSON lines, a recording or what is said now as SVG or PNG: the path, and what the wheels do over time
    Chart(Chart),
    /// Estimate where a robot was from a log of its measurements, by any method of the navigator
    Estimate(Estimate),
    /// Compare the correctors on emulated robots in virtual time, or tune one
    Tournament(Tournament),
    /// Measure motors, wheels and track of a robot, which drives about in its room; or watch whether they still are so
    Calibrate(Calibrate),
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
    /// The process that `axle bench record` kills
    #[command(hide = true)]
    BenchRecorder {
        /// The recording
        file: PathBuf,
    },
    /// The other end of `axle bench mesh`
    #[command(hide = true)]
    BenchPeer,
}

impl Command {
    /// Whether it only looks at what others do, so that they may have the processor first.
    pub(crate) const fn looks_on(&self) -> bool {
        matches!(self, Self::Tap(_) | Self::Top(_) | Self::Chart(_))
    }
}

/// `axle traffic`.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Traffic {
    /// Explain for whom this robot waits [default: a table of all robots]
    #[arg(id = "of", value_name = "ROBOT")]
    pub(crate) robot: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
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
    /// Show the robot in a browser too, and stay until Ctrl-C
    #[arg(long, value_name = "IP:PORT", num_args = 0..=1, require_equals = true, default_missing_value = PAGE)]
    pub(crate) page: Option<SocketAddr>,
    /// Emulate this board too, and drive it through a serial line: arduino, roomba, eddie, dwm-text
    #[arg(long, value_name = "KIND", value_parser = BoardKind::parse)]
    pub(crate) board: Option<BoardKind>,
}

/// Where the page is unless somebody says otherwise.
const PAGE: &str = "127.0.0.1:8080";

/// Arguments of `axle up`.
#[derive(Debug, clap::Args)]
pub(crate) struct Up {
    /// The topology [default: one emulated robot and its planners]
    pub(crate) topology: Option<PathBuf>,
    /// Where the router listens, instead of where the topology says
    #[arg(long, env = "AXLE_LISTEN", hide_env_values = true, value_name = "tcp/HOST:PORT")]
    pub(crate) listen: Option<String>,
    /// Show the robots in a browser too: starts a gateway, unless the topology has one
    #[arg(long, value_name = "IP:PORT", num_args = 0..=1, require_equals = true, default_missing_value = PAGE)]
    pub(crate) page: Option<SocketAddr>,
    /// Encrypt everything, with the identities of this directory of `axle keys`
    #[arg(long, env = "AXLE_KEYS", hide_env_values = true, value_name = "DIR")]
    pub(crate) keys: Option<PathBuf>,
}

/// Arguments of `axle run`.
#[derive(Debug, clap::Args)]
pub(crate) struct Run {
    /// The service; `axle run help` lists them
    #[arg(env = "AXLE_SERVICE", hide_env_values = true)]
    pub(crate) service: String,
    /// Hear a stream from elsewhere; may be given several times
    #[arg(
        long,
        env = "AXLE_INPUT",
        hide_env_values = true,
        value_name = "STREAM=OTHER",
        value_delimiter = ','
    )]
    pub(crate) input: Vec<String>,
    /// Its parameters [default: those that `axle params SERVICE` prints]
    #[arg(long, env = "AXLE_PARAMS", hide_env_values = true, value_name = "FILE")]
    pub(crate) params: Option<PathBuf>,
    /// The board of a robot or emulator: arduino, roomba, eddie, orfa, dwm-text
    #[arg(long, env = "AXLE_BOARD", hide_env_values = true, value_name = "KIND", value_parser = BoardKind::parse)]
    pub(crate) board: Option<BoardKind>,
    /// The port of the robot's board [default: /dev/ttyUSB0]; of an emulated board, a link to make to its terminal
    #[arg(long, env = "AXLE_PORT", hide_env_values = true, value_name = "PATH")]
    pub(crate) port: Option<PathBuf>,
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
    #[arg(
        long,
        env = "AXLE_LINK",
        hide_env_values = true,
        value_name = "tcp/HOST:PORT",
        value_delimiter = ','
    )]
    pub(crate) link: Vec<String>,
    /// Listen beyond this computer although nothing is encrypted or authenticated
    #[arg(long, env = "AXLE_INSECURE_LAN", hide_env_values = true)]
    pub(crate) insecure_lan: bool,
    /// With an identity, who may do what [default: access.json beside the certificate]
    #[arg(long, value_name = "FILE")]
    pub(crate) access: Option<PathBuf>,
}

/// `axle doctor`.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Doctor {
    /// Look at one process: the service or router of this computer that is named, the healthcheck of a container
    #[arg(long = "self")]
    pub(crate) own: bool,
    /// With --self, the service or `router`
    #[arg(env = "AXLE_SERVICE", hide_env_values = true, required_if_eq("own", "true"))]
    pub(crate) service: Option<String>,
    /// Look at every pair of this topology [default: one emulated robot and its planners]
    #[arg(long, value_name = "FILE", conflicts_with = "own")]
    pub(crate) topology: Option<PathBuf>,
    /// Print one JSON object, or one a finding
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
    /// How the way is made: turn-and-go, rounded, arcs, smooth, dubins, map [default: Pathfinder's choice]
    #[arg(long, value_name = "NAME", value_parser = PlanStrategy::of_name)]
    pub(crate) strategy: Option<PlanStrategy>,
    /// The map.yaml to plan on [default: the map service, where the strategy needs one]
    #[arg(long, value_name = "FILE")]
    pub(crate) map: Option<PathBuf>,
    /// Visit the points in an order that makes the way short
    #[arg(long)]
    pub(crate) order: bool,
    /// Radius of the robot, in metres [default: Pathfinder's choice]
    #[arg(long, value_name = "METRES")]
    pub(crate) body: Option<f64>,
    /// How long Pathfinder may search, in seconds [default: Pathfinder's choice]
    #[arg(long, value_name = "SECONDS")]
    pub(crate) deadline: Option<f64>,
    /// Plan in this process, without a mesh
    #[arg(long)]
    pub(crate) here: bool,
    /// The parameters of Pathfinder for --here [default: those that `axle params pathfinder` prints]
    #[arg(long, value_name = "FILE", requires = "here")]
    pub(crate) params: Option<PathBuf>,
    /// Ask Pathdriver too, and print the movements
    #[arg(long)]
    pub(crate) drive: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Draw the path, and with --drive the speeds of the wheels
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// How the speeds are chosen: stop or continuous [default: as Pathdriver's parameters say]
    #[arg(long, value_name = "NAME", requires = "drive", value_parser = word::<Strategy>)]
    pub(crate) speeds: Option<Strategy>,
    /// How legs of different curvature meet: jump or blend [default: as Pathdriver's parameters say]
    #[arg(long, value_name = "NAME", requires = "drive", value_parser = word::<Joints>)]
    pub(crate) joints: Option<Joints>,
    /// The most that a wheel speed may jump, in m/s [default: as Pathdriver's parameters say]
    #[arg(long, value_name = "M/S", requires = "drive")]
    pub(crate) jump: Option<f64>,
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
    /// The way points, counted from 1, at which the robot waits for `axle confirm`
    #[arg(long, value_name = "N,N,…", value_delimiter = ',')]
    pub(crate) confirm: Vec<u32>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `axle log`.
#[derive(Debug, clap::Args)]
pub(crate) struct Log {
    /// The service
    pub(crate) service: String,
    /// error, warn, info, debug, trace, off, or per part (info,axle_mesh=debug)
    pub(crate) level: String,
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
    /// How long a step of each corrector takes, and how much faster than real time the tournament is
    Tournament {
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
    /// How long the bridge to a board takes from a setpoint to the first byte on the line
    Board {
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
    /// Every fault a robot on two computers meets, while it drives: what is lost, what is told, and that it drives again
    Faults(crate::bench::faults::Faults),
    /// What a fleet of emulated robots at 10 Hz costs, and how late its beats come
    Fleet {
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// How many robots; each is four processes
        #[arg(long, default_value_t = 10, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=200))]
        robots: u32,
    },
    /// How many messages a second one core records, and what kills leave of a recording
    Record {
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// How many recorders to kill
        #[arg(long, default_value_t = 40, value_name = "N", value_parser = clap::value_parser!(u32).range(1..100_000))]
        kills: u32,
    },
    /// What it costs those who drive that 5 and 50 taps look on, and that one of them is frozen
    Taps {
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// How many messages in each phase, a hundred a second
        #[arg(long, default_value_t = 1000, value_name = "N", value_parser = clap::value_parser!(u32).range(100..1_000_000))]
        rounds: u32,
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
    /// How long a measurement takes through the navigator, in the mesh
    Navigator {
        /// Print one JSON object
        #[arg(long)]
        json: bool,
        /// How many poses
        #[arg(long, default_value_t = 1000, value_name = "N", value_parser = clap::value_parser!(u32).range(100..1_000_000))]
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

/// A word of the schema by its name there.
fn word<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_value(text.into()).map_err(|fault| fault.to_string())
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
