//! The commands: one file each.

mod chart;
mod check;
mod convert;
mod docs;
mod doctor;
mod drive;
mod estimate;
pub(crate) mod go;
mod graph;
mod ls;
mod plan;
mod ps;
mod router;
mod run;
mod stop;
mod tap;
mod tournament;
pub(crate) mod up;

use crate::cli::{Cli, Command};
use crate::out::{data, usage};
use crate::{bench, catalog, conform, demo};
use clap::CommandFactory as _;

/// Does what the command line says.
pub(crate) async fn dispatch(cli: Cli) -> anyhow::Result<()> {
    let Cli { settings, command } = cli;
    match command {
        Command::Demo(args) => demo::demo(&settings, args).await,
        Command::Up(args) => up::up(&settings, args).await,
        Command::Run(args) => run::run(&settings, args).await,
        Command::Router(args) => router::router(args).await,
        Command::Ps(args) => ps::ps(&settings, args.json).await,
        Command::Doctor(args) => doctor::doctor(&settings, &args).await,
        Command::Ls(args) => ls::ls(&settings, &args).await,
        Command::Plan(args) => plan::plan(&settings, args).await,
        Command::Go(args) => go::go(&settings, args).await,
        Command::Drive(args) => drive::drive(&settings, args).await,
        Command::Stop(args) => stop::stop(&settings, &args).await,
        Command::Enable(args) => stop::enable(&settings, args.json).await,
        Command::Check { topology } => check::check(topology.as_deref()),
        Command::Graph(args) => graph::graph(&settings, &args).await,
        Command::Conform(args) => conform::conform(&settings, &args).await,
        Command::Tap(args) => tap::tap(&settings, &args).await,
        Command::Convert(args) => convert::convert(&args),
        Command::Chart(args) => chart::draw(&args),
        Command::Estimate(args) => estimate::estimate(&args),
        Command::Tournament(args) => tournament::tournament(&args),
        Command::Params { service } => {
            let entry = catalog::find(&service).ok_or_else(|| unknown_service(&service))?;
            Ok(data(entry.params.trim_end())?)
        }
        Command::Bench(crate::cli::Bench::Motion { json }) => bench::motion::motion(json),
        Command::Bench(crate::cli::Bench::Mesh { json, rounds }) => {
            bench::mesh(&settings, json, rounds).await
        }
        Command::Bench(crate::cli::Bench::Stop { json, injections }) => {
            bench::stop::stop(&settings, json, injections).await
        }
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

/// A service that is not in the catalogue.
fn unknown_service(name: &str) -> anyhow::Error {
    let shown: String = name.chars().take(64).collect();
    usage(format!("unknown service {shown:?}; known: {}", catalog::names()))
}
