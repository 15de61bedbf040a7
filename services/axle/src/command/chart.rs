//! `axle chart FILE|KEYS…`: draws whatever `axle convert` reads or writes, recordings, and what is said now, as one SVG or
//! PNG.
//!
//! Each file is a run: a path, and where its lines tell it, the distances and the speeds of the wheels over time.
//! Several runs lie over each other. A line that cannot be drawn is told on stderr with its number, and the others are
//! drawn all the same; then the exit code is 1. A mesh is needed for keys only: what is said on them is recorded for a while
//! beside the chart, and drawn as any recording is.

mod recording;
mod run;

use crate::chart::{
    MAX_SERIES, MAX_WALLS, Panel, PathSeries, Wall, WheelPoint, believed_chart, floor_chart, png,
};
use crate::cli::Chart;
use crate::lines::{Lines, words};
use crate::out::{data, note, usage};
use crate::run::map::read as read_map;
use crate::run::recorder::Recording;
use crate::settings::Settings;
use anyhow::Context as _;
use axle_recorder::RecorderParams;
use axle_schema::{Metres, Track, key};
use recording::Heard;
use run::Run;
use std::fs::File;
use std::io::{self, Read, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What an MCAP file begins with; no JSON does.
const MCAP: [u8; 5] = *b"\x89MCAP";

/// What a file holds.
enum Source {
    /// Lines of JSON, how many there are, and how many could not be drawn.
    Run(Run, u64, u64),
    Recording(Heard),
}

/// Draws the files, stdin for `-`, and what is said on keys.
pub(super) async fn chart(settings: &Settings, args: &Chart) -> anyhow::Result<()> {
    // What keys begin with; a file of such a name is drawn all the same.
    let root = key::everything(None);
    let root = root.trim_end_matches('*');
    let is_key = |name: &&String| name.starts_with(root) && !Path::new(name.as_str()).exists();
    let keys: Vec<_> = args.files.iter().filter(is_key).cloned().collect();
    if keys.is_empty() {
        return draw(args);
    }
    let heard = hear(settings, &keys, args.seconds).await?;
    let mut files: Vec<_> = args.files.iter().filter(|name| !keys.contains(name)).cloned().collect();
    files.insert(0, heard.0.display().to_string());
    draw(&Chart { files, ..args.clone() })
}

/// A recording that is drawn and then removed.
struct Brief(PathBuf);

impl Drop for Brief {
    fn drop(&mut self) {
        // What cannot be removed is left to the system's own cleaning.
        drop(std::fs::remove_file(&self.0));
    }
}

/// Listens for a while.
async fn hear(settings: &Settings, keys: &[String], seconds: f64) -> anyhow::Result<Brief> {
    let heard = Brief(std::env::temp_dir().join(format!("axle-{}-now.mcap", std::process::id())));
    let params = RecorderParams { file: Some(heard.0.clone()), derived: false, ..RecorderParams::default() };
    let who = settings.robot.as_ref().map_or("all", axle_schema::RobotId::as_str);
    let mut stop = crate::signal::stop()?.or_after(Duration::from_secs_f64(seconds));
    let mesh = settings.join("chart").await?;
    let recording = Recording::begin(&mesh, keys, who, params).map_err(|fault| {
        let is_key = matches!(fault.downcast_ref(), Some(axle_mesh::Fault::KeyExpression(_)));
        if is_key { usage(fault) } else { fault }
    })?;
    note(&format!("listening to {} for {seconds} s; Ctrl-C draws what came until then", keys.join(", ")));
    let totals = recording.end(&mut stop).await?;
    mesh.leave().await;
    anyhow::ensure!(totals.samples > 0, "nothing was said on {} for {seconds} s", keys.join(", "));
    Ok(heard)
}

fn draw(args: &Chart) -> anyhow::Result<()> {
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
    let floor = args.map.as_deref().map(read_map).transpose()?;
    let walls = floor.map_or_else(Vec::new, |grid| axle_maps::areas(&grid, MAX_WALLS));
    let svg = svg(&sources, &walls)?;
    let is_png =
        args.png || args.out.as_ref().is_some_and(|file| file.extension().is_some_and(|end| end == "png"));
    let picture = if is_png { png(&svg)? } else { svg.into_bytes() };
    match &args.out {
        Some(file) => {
            std::fs::write(file, picture).with_context(|| format!("write {}", file.display()))?;
            note(&format!("drawn: {}", file.display()));
        }
        None if is_png => io::stdout().lock().write_all(&picture).context("write the picture")?,
        None => data(String::from_utf8_lossy(&picture).trim_end())?,
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
    Read::by_ref(&mut input).take(MCAP.len() as u64).read_to_end(&mut magic).map_err(failed)?;
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
fn svg(sources: &[(String, Source)], walls: &[Wall]) -> anyhow::Result<String> {
    if let [(name, Source::Recording(heard))] = sources {
        anyhow::ensure!(!heard.is_empty(), "nothing to draw: {name} holds no plan and no pose");
        let panels = heard.panels();
        return believed_chart(name, &heard.paths(), &heard.way_points, (walls, &heard.ellipses()), &panels);
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
            Source::Recording(heard) => heard.speeds(),
        })
        .collect();
    let panels: Vec<_> = [("wheel distance (m)", distances), ("wheel speed (m/s)", speeds)]
        .into_iter()
        .filter(|(_, runs)| runs.iter().any(|run| run.len() > 1))
        .map(|(axis, runs)| Panel::of_runs(axis, &runs))
        .collect();
    let title: Vec<_> = sources.iter().map(|(name, _)| name.as_str()).collect();
    floor_chart(&title.join(", "), &paths, &[], walls, &panels)
}

#[cfg(test)]
mod tests;
