//! `axle run SERVICE`: one service as a process.

use super::unknown_service;
use crate::cli::Run;
use crate::out::table;
use crate::settings::Settings;
use crate::{catalog, run};

pub(super) async fn run(settings: &Settings, args: Run) -> anyhow::Result<()> {
    if args.service == "help" || args.service == "list" {
        let rows = catalog::CATALOG.iter().map(|entry| vec![entry.name.to_owned(), entry.about.to_owned()]);
        return Ok(table(&["service", "what it does"], rows)?);
    }
    let entry = catalog::find(&args.service).ok_or_else(|| unknown_service(&args.service))?;
    run::run(entry, settings, args.params).await
}
