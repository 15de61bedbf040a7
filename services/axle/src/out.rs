//! What is printed: data on stdout, words for people on stderr, and one way to print an error.

use comfy_table::{ContentArrangement, Table, TableComponent, presets};
use std::io::{self, IsTerminal as _, Write as _};
use std::process::ExitCode;

/// The command line or a file is wrong: exit code 2. Everything else that fails has exit code 1.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Usage(pub(crate) String);

/// A wrong command line or file, in words.
pub(crate) fn usage(words: impl std::fmt::Display) -> anyhow::Error {
    anyhow::Error::new(Usage(words.to_string()))
}

/// Prints an error with everything that caused it, and says with which code to exit.
pub(crate) fn fail(fault: &anyhow::Error) -> ExitCode {
    // A reader that went away (`axle tap | head`) is no failure.
    if fault.downcast_ref::<io::Error>().is_some_and(|fault| fault.kind() == io::ErrorKind::BrokenPipe) {
        return ExitCode::SUCCESS;
    }
    note(&format!("axle: {fault:#}"));
    ExitCode::from(if fault.downcast_ref::<Usage>().is_some() { 2 } else { 1 })
}

/// A line of data.
pub(crate) fn data(line: &str) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    writeln!(stdout, "{line}")?;
    stdout.flush()
}

/// A line for people. A stderr that is closed is nobody's fault.
pub(crate) fn note(line: &str) {
    drop(writeln!(io::stderr().lock(), "{line}"));
}

/// Whether people read stderr: then there are progress bars.
pub(crate) fn is_watched() -> bool {
    io::stderr().is_terminal()
}

/// A table for people, on stdout. Without a terminal it is not fitted to any width.
pub(crate) fn table(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> io::Result<()> {
    let mut table = Table::new();
    table.load_preset(presets::UTF8_HORIZONTAL_ONLY).set_content_arrangement(ContentArrangement::Dynamic);
    table.remove_style(TableComponent::HorizontalLines).remove_style(TableComponent::MiddleIntersections);
    table.set_header(header.to_vec());
    for row in rows {
        table.add_row(row);
    }
    data(&table.to_string())
}
