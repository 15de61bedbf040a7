//! `axle chart FILE…`: draws whatever `axle convert` reads or writes, and recordings, as one SVG.
//!
//! Each file is a run: a path, and where its lines tell it, the distances and the speeds of the wheels over time.
//! Several runs lie over each other. A line that cannot be drawn is told on stderr with its number, and the others are
//! drawn all the same; then the exit code is 1. No mesh is needed.

mod recording;
mod run;

use crate::chart::{MAX_SERIES, Panel, PathSeries, WheelPoint, chart, demo_chart};
use crate::cli::Chart;
use crate::lines::{Lines, words};
use crate::out::{data, note, usage};
use anyhow::Context as _;
use axle_schema::{Metres, Track};
use recording::Heard;
use run::Run;
use std::fs::File;
use std::io::{self, Read, Seek as _};
use std::path::Path;

/// What an MCAP file begins with; no JSON does.
const MCAP: [u8; 5] = *b"\x89MCAP";

/// What a file holds.
enum Source {
    /// Lines of JSON, how many there are, and how many could not be drawn.
    Run(Run, u64, u64),
    Recording(Heard),
}

/// Draws the files, or stdin for `-`.
pub(super) fn draw(args: &Chart) -> anyhow::Result<()> {
    if args.files.len() > MAX_SERIES {
        return Err(usage(format!("{} files: at most {MAX_SERIES} can be told apart", args.files.len())));
    }
    if let Some(track) = args.track {
        Track::new(Metres(track)).map_err(|refusal| usage(format!("--track: {}", words(refusal))))?;
    }
    let several = args.files.len() > 1;
    let mut sources = Vec::new();
    let (mut lines, mut bad) = (0, 0);
    for (file, name) in args.files.iter().zip(names(&args.files)) {
        let complain =
            |words: &str| note(&if several { format!("{name}: {words}") } else { words.to_owned() });
        let source = open(file, args.track, &complain)?;
        if let Source::Run(_, read, refused) = &source {
            lines += read;
            bad += refused;
        }
        sources.push((name, source));
    }
    let svg = svg(&sources)?;
    match &args.out {
        Some(file) => {
            std::fs::write(file, svg).with_context(|| format!("write {}", file.display()))?;
            note(&format!("drawn: {}", file.display()));
        }
        None => data(svg.trim_end())?,
    }
    anyhow::ensure!(bad == 0, "{bad} of {lines} lines could not be drawn");
    Ok(())
}

/// What the legend calls the files: their last parts, if these are enough to tell them apart.
fn names(files: &[String]) -> Vec<String> {
    let short = |file: &String| match file.as_str() {
        "-" => "stdin".to_owned(),
        file => Path::new(file).file_name().unwrap_or(file.as_ref()).to_string_lossy().into_owned(),
    };
    let short: Vec<_> = files.iter().map(short).collect();
    let unique = short.iter().all(|name| short.iter().filter(|other| *other == name).count() == 1);
    if unique { short } else { files.to_vec() }
}

fn open(file: &str, track: Option<f64>, complain: &dyn Fn(&str)) -> anyhow::Result<Source> {
    if file == "-" {
        return collect(io::stdin().lock(), track, complain);
    }
    let failed = |fault: io::Error| usage(format!("cannot read {file}: {fault}"));
    let mut input = File::open(file).map_err(failed)?;
    let mut magic = Vec::new();
    input.by_ref().take(MCAP.len() as u64).read_to_end(&mut magic).map_err(failed)?;
    if magic == MCAP {
        return Ok(Source::Recording(Heard::read(Path::new(file), complain)?));
    }
    input.rewind().map_err(failed)?;
    collect(input, track, complain)
}

fn collect(input: impl Read, track: Option<f64>, complain: &dyn Fn(&str)) -> anyhow::Result<Source> {
    let (mut lines, mut run, mut bad) = (Lines::new(input), Run::new(track), 0);
    while let Some(value) = lines.read()? {
        if let Err(why) = value.and_then(|value| run.line(&value)) {
            bad += 1;
            complain(&format!("line {}: {why}", lines.number()));
        }
    }
    Ok(Source::Run(run, lines.number(), bad))
}

/// The picture: a recording alone is drawn as the demo draws it, everything else as runs that are compared.
fn svg(sources: &[(String, Source)]) -> anyhow::Result<String> {
    if let [(name, Source::Recording(heard))] = sources {
        anyhow::ensure!(!heard.is_empty(), "nothing to draw: {name} holds no plan and no pose");
        return demo_chart(name, &heard.paths(), &heard.way_points, &heard.wheels);
    }
    let paths: Vec<_> = sources
        .iter()
        .enumerate()
        .map(|(index, (name, source))| {
            let points = match source {
                Source::Run(run, ..) => run.path(),
                Source::Recording(heard) => heard.path(),
            };
            PathSeries { name: name.clone(), points: points.to_vec(), ink: index + 1 }
        })
        .collect();
    anyhow::ensure!(
        paths.iter().any(|path| !path.points.is_empty()),
        "nothing to draw: no line holds a movement, a geometry, a pose or a reading; `axle convert --map` shows them"
    );
    let distances: Vec<&[WheelPoint]> = sources
        .iter()
        .map(|(_, source)| match source {
            Source::Run(run, ..) => run.distances(),
            Source::Recording(heard) => &heard.wheels.real,
        })
        .collect();
    let speeds: Vec<&[WheelPoint]> = sources
        .iter()
        .map(|(_, source)| match source {
            Source::Run(run, ..) => run.speeds(),
            Source::Recording(_) => &[],
        })
        .collect();
    let panels: Vec<_> = [("wheel distance (m)", distances), ("wheel speed (m/s)", speeds)]
        .into_iter()
        .filter(|(_, runs)| runs.iter().any(|run| run.len() > 1))
        .map(|(axis, runs)| Panel::of_runs(axis, &runs))
        .collect();
    let title: Vec<_> = sources.iter().map(|(name, _)| name.as_str()).collect();
    chart(&title.join(", "), &paths, &[], &panels)
}

#[cfg(test)]
mod tests;
