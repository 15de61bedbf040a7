//! The commands: one file each.

mod calibrate;
mod chart;
mod check;
mod convert;
mod docs;
mod doctor;
mod drive;
mod estimate;
pub(crate) mod go;
mod graph;
mod install;
mod keys;
mod log;
mod login;
mod ls;
mod map;
mod plan;
mod play;
mod ps;
mod record;
mod replay;
mod router;
mod run;
mod stop;
mod tap;
mod top;
mod tournament;
mod traffic;
pub(crate) mod up;
mod why;

use crate::cli::{Bench, Cli, Command};
use crate::out::{data, usage};
use crate::settings::Settings;
use crate::{bench, catalog, conform, demo};
use clap::CommandFactory as _;

/// Does what the command line says.
pub(crate) async fn dispatch(cli: Cli) -> anyhow::Result<()> {
    let Cli { settings, command } = cli;
    match command {
        Command::Demo(args) => demo::demo(&settings.alone(), args).await,
        Command::Up(args) => up::up(&settings, args).await,
        Command::Run(args) => run::run(&settings, args).await,
        Command::Router(args) => router::router(&settings, args).await,
        Command::Ps(args) => ps::ps(&settings, args.json).await,
        Command::Doctor(args) => doctor::doctor(&settings, &args).await,
        Command::Keys(args) => keys::keys(&args),
        Command::Login(args) => login::login(&args),
        Command::Install(args) => install::install(&settings, &args),
        Command::Ls(args) => ls::ls(&settings, &args).await,
        Command::Plan(args) => plan::plan(&settings, args).await,
        Command::Map(args) => map::map(args),
        Command::Go(args) => go::go(&settings, args).await,
        Command::Drive(args) => drive::drive(&settings, args).await,
        Command::Confirm => traffic::confirm(&settings).await,
        Command::Traffic(args) => traffic::traffic(&settings, &args).await,
        Command::Stop(args) => stop::stop(&settings, &args).await,
        Command::Enable(args) => stop::enable(&settings, args.json).await,
        Command::Check { topology } => check::check(topology.as_deref()),
        Command::Graph(args) => graph::graph(&settings, &args).await,
        Command::Conform(args) => conform::conform(&settings, &args).await,
        Command::Log(args) => log::log(&settings, args).await,
        Command::Tap(args) => tap::tap(&settings, &args).await,
        Command::Top(args) => top::top(&settings, &args).await,
        Command::Record(args) => record::record(&settings, args).await,
        Command::Play(args) => play::play(&settings, &args).await,
        Command::Replay(args) => replay::replay(&settings, &args),
        Command::Why(args) => why::why(&settings, &args).await,
        Command::Convert(args) => convert::convert(&args),
        Command::Chart(args) => chart::chart(&settings, &args).await,
        Command::Estimate(args) => estimate::estimate(&args),
        Command::Tournament(args) => tournament::tournament(&args),
        Command::Calibrate(args) => calibrate::calibrate(&settings, &args).await,
        Command::Params { service } => {
            let entry = catalog::find(&service).ok_or_else(|| unknown_service(&service))?;
            Ok(data(entry.params.trim_end())?)
        }
        Command::Bench(what) => measure(&settings, what).await,
        Command::BenchRecorder { file } => bench::record::be_killed(&file),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "axle", &mut script);
            Ok(data(String::from_utf8_lossy(&script).trim_end())?)
        }
        Command::Docs { page } => Ok(data(docs::page(page).trim_end())?),
        Command::BenchCommander => bench::stop::command(&settings).await,
        Command::BenchPeer => bench::peer(&settings).await,
    }
}

/// `axle bench`.
async fn measure(settings: &Settings, what: Bench) -> anyhow::Result<()> {
    match what {
        Bench::Motion { json } => bench::motion::motion(json),
        Bench::Tournament { json } => bench::tournament::tournament(json),
        Bench::Board { json } => bench::board::board(json).await,
        Bench::Record { json, kills } => bench::record::record(json, kills),
        Bench::Taps { json, rounds } => bench::taps::taps(&settings.alone(), json, rounds).await,
        Bench::Mesh { json, rounds } => bench::mesh(&settings.alone(), json, rounds).await,
        Bench::Navigator { json, rounds } => bench::navigator::navigator(settings, json, rounds).await,
        Bench::Fleet { json, robots } => bench::fleet::fleet(settings, json, robots).await,
        Bench::Faults(args) => bench::faults::faults(settings, &args).await,
        Bench::Stop { json, injections } => bench::stop::stop(&settings.alone(), json, injections).await,
    }
}

/// A service that is not in the catalogue.
fn unknown_service(name: &str) -> anyhow::Error {
    let shown: String = name.chars().take(64).collect();
    usage(format!("unknown service {shown:?}; known: {}", catalog::names()))
}
