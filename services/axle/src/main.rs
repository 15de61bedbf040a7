//! The one command of Axle: every service, the router, and the tools around them.
//!
//! `main` only joins: it reads the command line, starts the log and hands over. Exit codes: 0 done, 1 failed, 2 the
//! command line or a file is wrong.

mod access;
mod batch;
mod bench;
mod catalog;
mod chart;
mod cli;
mod command;
mod conform;
mod demo;
mod keys;
mod lines;
mod log;
mod logins;
mod notify;
mod out;
mod params;
mod path;
mod replay;
mod run;
mod settings;
mod signal;
mod supervisor;
mod threads;
mod topology;
mod unread;
mod why;

use clap::Parser as _;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    log::start(&cli.settings.log, cli.settings.log_format);
    if cli.command.looks_on() {
        threads::give_way();
    }
    // Zenoh needs a runtime of several threads; two are enough for a service.
    let runtime = match tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build() {
        Ok(runtime) => runtime,
        Err(fault) => return out::fail(&anyhow::Error::new(fault).context("start the asynchronous runtime")),
    };
    let result = runtime.block_on(command::dispatch(cli));
    // A thread that still waits for a router must not keep the process.
    runtime.shutdown_background();
    log::lane::end();
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(fault) => out::fail(&fault),
    }
}
