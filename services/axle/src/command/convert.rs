//! `axle convert FROM TO`: the map of conversions on JSON lines, from stdin to stdout.
//!
//! Every arrow of the map is a line of [`ARROWS`]; this file reads and writes lines. A line that cannot
//! be converted is told on stderr with its number, and the others are converted all the same; then the exit code is 1.
//! No mesh is needed. Numbers are written as the shortest decimals that read back as the same `f64`.

mod arrows;

use crate::cli::Convert;
use crate::out::{data, note, usage};
use arrows::{ARROWS, Arrow, Work};
use std::io::{self, BufRead, BufReader, Read as _, Write};

/// The longest line that is read, in bytes: no datum of the map needs a tenth of it.
const LONGEST: u64 = 64 * 1024;

/// Converts stdin to stdout, or prints the map.
pub(crate) fn convert(args: &Convert) -> anyhow::Result<()> {
    let (Some(from), Some(to), false) = (&args.from, &args.to, args.map) else {
        return Ok(data(&map())?);
    };
    let arrow = ARROWS.iter().find(|arrow| arrow.from == from && arrow.to == to).ok_or_else(|| {
        usage(format!("there is no arrow from {from:?} to {to:?}; `axle convert --map` shows all"))
    })?;
    let work = arrow.work(args).map_err(usage)?;
    let (lines, bad) = pump(BufReader::new(io::stdin().lock()), &mut io::stdout().lock(), work, &mut note)?;
    anyhow::ensure!(bad == 0, "{bad} of {lines} lines could not be converted");
    Ok(())
}

/// Every arrow, in a table.
fn map() -> String {
    let line =
        |Arrow { from, to, takes, about, .. }: &Arrow| format!("{from:<15} -> {to:<16} {takes:<24} {about}");
    let arrows: Vec<_> = ARROWS.iter().map(line).collect();
    format!(
        "{}\n\nEvery line is a JSON object. \"track\" (metres) may stand in the line or be given by --track.\n\
         One arrow after another: axle convert encoders-data encoders-span | axle convert encoders-span dwm | …",
        arrows.join("\n")
    )
}

/// Reads all lines, writes what they become, and gives how many there were and how many were bad.
fn pump(
    mut input: BufReader<impl io::Read>,
    output: &mut impl Write,
    mut work: Work,
    complain: &mut dyn FnMut(&str),
) -> io::Result<(u64, u64)> {
    let (mut lines, mut bad) = (0, 0);
    let mut output = io::BufWriter::new(output);
    let mut line = Vec::new();
    loop {
        line.clear();
        if input.by_ref().take(LONGEST).read_until(b'\n', &mut line)? == 0 {
            break;
        }
        lines += 1;
        let too_long = line.len() as u64 == LONGEST && line.last() != Some(&b'\n');
        if too_long {
            skip_line(&mut input)?;
        }
        let answer = if too_long {
            Err(format!("longer than {LONGEST} bytes"))
        } else if line.trim_ascii().is_empty() {
            // Blank lines separate nothing and mean nothing.
            continue;
        } else {
            serde_json::from_slice(&line)
                .map_err(|fault| fault.to_string())
                .and_then(|value| work.line(&value))
        };
        match answer {
            Ok(answers) => answers.iter().try_for_each(|answer| writeln!(output, "{answer}"))?,
            Err(why) => {
                bad += 1;
                complain(&format!("line {lines}: {why}"));
            }
        }
        // Whoever converts a live stream wants each line when it comes.
        if input.buffer().is_empty() {
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
    Ok((lines, bad))
}

fn skip_line(input: &mut impl BufRead) -> io::Result<()> {
    let mut rest = Vec::new();
    loop {
        rest.clear();
        let read = input.by_ref().take(LONGEST).read_until(b'\n', &mut rest)?;
        if read == 0 || rest.last() == Some(&b'\n') {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests;
