//! `axle convert FROM TO`: the map of conversions on JSON lines, from stdin to stdout.
//!
//! Every arrow of the map is a line of [`ARROWS`]; this file reads and writes lines. A line that cannot
//! be converted is told on stderr with its number, and the others are converted all the same; then the exit code is 1.
//! No mesh is needed. Numbers are written as the shortest decimals that read back as the same `f64`.

mod arrows;

use crate::cli::Convert;
use crate::lines::Lines;
use crate::out::{data, note, usage};
use arrows::{ARROWS, Arrow, Work};
use std::io::{self, Write};

/// Converts stdin to stdout, or prints the map.
pub(crate) fn convert(args: &Convert) -> anyhow::Result<()> {
    let (Some(from), Some(to), false) = (&args.from, &args.to, args.map) else {
        return Ok(data(&map())?);
    };
    let arrow = ARROWS.iter().find(|arrow| arrow.from == from && arrow.to == to).ok_or_else(|| {
        usage(format!("there is no arrow from {from:?} to {to:?}; `axle convert --map` shows all"))
    })?;
    let work = arrow.work(args).map_err(usage)?;
    let (lines, bad) = pump(Lines::new(io::stdin().lock()), &mut io::stdout().lock(), work, &mut note)?;
    anyhow::ensure!(bad == 0, "{bad} of {lines} lines could not be converted");
    Ok(())
}

/// Every arrow, in a table.
fn map() -> String {
    let line =
        |Arrow { from, to, takes, about, .. }: &Arrow| format!("{from:<15} -> {to:<16} {takes:<29} {about}");
    let arrows: Vec<_> = ARROWS.iter().map(line).collect();
    format!(
        "{}\n\nEvery line is a JSON object. \"track\" (metres) may stand in the line or be given by --track.\n\
         One arrow after another: axle convert encoders-data encoders-span | axle convert encoders-span dwm | …",
        arrows.join("\n")
    )
}

/// Reads all lines, writes what they become, and gives how many there were and how many were bad.
fn pump(
    mut lines: Lines<impl io::Read>,
    output: &mut impl Write,
    mut work: Work,
    complain: &mut dyn FnMut(&str),
) -> io::Result<(u64, u64)> {
    let mut bad = 0;
    let mut output = io::BufWriter::new(output);
    while let Some(value) = lines.read()? {
        match value.and_then(|value| work.line(&value)) {
            Ok(answers) => answers.iter().try_for_each(|answer| writeln!(output, "{answer}"))?,
            Err(why) => {
                bad += 1;
                complain(&format!("line {}: {why}", lines.number()));
            }
        }
        // Whoever converts a live stream wants each line when it comes.
        if lines.waits() {
            output.flush()?;
        }
    }
    match work.end() {
        Ok(answers) => answers.iter().try_for_each(|answer| writeln!(output, "{answer}"))?,
        Err(why) => {
            bad += 1;
            complain(&format!("after the last line: {why}"));
        }
    }
    output.flush()?;
    Ok((lines.number(), bad))
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::converted;
