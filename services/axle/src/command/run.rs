//! `axle run SERVICE`: one service as a process.

use super::unknown_service;
use crate::cli::Run;
use crate::out::{table, usage};
use crate::settings::Settings;
use crate::topology::check_inputs;
use crate::{catalog, run};

/// Reads `STREAM=OTHER`; both must be known, and carry the same.
fn inputs(entry: &'static catalog::Entry, given: &[String]) -> anyhow::Result<Vec<(String, String)>> {
    let read = |text: &String| {
        let wrong = || {
            usage(format!(
                "--input {text}: give it as STREAM=OTHER, for example navigator/pose=emulator/truth"
            ))
        };
        text.split_once('=').map(|(input, from)| (input.to_owned(), from.to_owned())).ok_or_else(wrong)
    };
    let inputs = given.iter().map(read).collect::<anyhow::Result<Vec<_>>>()?;
    check_inputs(&inputs.iter().cloned().collect(), entry)
        .map_err(|fault| usage(format!("--input: {fault:#}")))?;
    Ok(inputs)
}

pub(super) async fn run(settings: &Settings, args: Run) -> anyhow::Result<()> {
    if args.service == "help" || args.service == "list" {
        let rows = catalog::CATALOG.iter().map(|entry| vec![entry.name.to_owned(), entry.about.to_owned()]);
        return Ok(table(&["service", "what it does"], rows)?);
    }
    let entry = catalog::find(&args.service).ok_or_else(|| unknown_service(&args.service))?;
    let inputs = inputs(entry, &args.input)?;
    if (args.board.is_some() || args.port.is_some()) && !catalog::takes_board(entry.name) {
        return Err(usage(format!(
            "{} has no board: --board and --port are for robot and emulator",
            entry.name
        )));
    }
    run::run(entry, settings, args.params, inputs, (args.board, args.port)).await
}
