//! `axle estimate LOG`: where a robot was, from a log of its measurements, by any method of the navigator.
//!
//! The poses go to stdout as JSON lines, in `map` and in `odom`; with `--report` or `--compare` the errors against the
//! truth go there instead. A line that cannot be used is told on stderr with its number, and the others are used all the
//! same; then the exit code is 1. What the filter notices (slip, a stuck encoder …) is told on stderr. No mesh is needed.

mod log;
mod report;

use crate::chart::{Panel, PathSeries, chart};
use crate::cli::Estimate;
use crate::out::{data, note, table, usage};
use crate::params::load;
use anyhow::Context as _;
use axle_navigator::{Method, Navigator, NavigatorParams, Position};
use axle_schema::{Numbers, Pose, Seconds, Twist};
use log::{Item, Log};
use report::Report;
use serde::Serialize;
use std::io::{self, Write as _};

/// A pose as it is printed.
#[derive(Serialize)]
struct Line {
    covariance: Numbers<9>,
    map_to_odom: Pose,
    odom: Pose,
    pose: Pose,
    stamp: Seconds,
    twist: Option<Twist>,
}

/// One method and what came of it.
struct Run {
    method: Method,
    poses: Vec<Position>,
    report: Report,
}

/// Runs one method, or all.
pub(super) fn estimate(args: &Estimate) -> anyhow::Result<()> {
    let mut params: NavigatorParams = load(args.params.as_deref())?;
    if let Some(name) = &args.method {
        params.method = Method::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| {
            usage(format!("unknown method {name:?}; known: {}", Method::ALL.map(Method::name).join(", ")))
        })?;
    }
    let log = Log::open(&args.file, &mut params)?;
    anyhow::ensure!(
        log.items.iter().any(|item| matches!(item, Item::Measured(_))),
        "{} holds no measurement; a line is such as {{\"stamp\":0.1,\"encoders\":{{\"left\":0.05,\"right\":0.05}}}}",
        args.file
    );
    let methods = if args.compare { Method::ALL.to_vec() } else { vec![params.method] };
    let keeps = args.svg.is_some() || !(args.report || args.compare);
    let runs = methods
        .into_iter()
        .map(|method| run(&log, NavigatorParams { method, ..params.clone() }, keeps))
        .collect::<anyhow::Result<Vec<_>>>()?;
    if let Some(file) = &args.svg {
        std::fs::write(file, svg(&args.file, &log, &runs)?)
            .with_context(|| format!("write {}", file.display()))?;
        note(&format!("drawn: {}", file.display()));
    }
    print(args, &runs)?;
    anyhow::ensure!(log.bad == 0, "{} of {} lines could not be used", log.bad, log.lines);
    Ok(())
}

/// Everything in the order of the log, which is that of arrival; poses are kept where somebody wants to see them.
fn run(log: &Log, params: NavigatorParams, keeps: bool) -> anyhow::Result<Run> {
    let method = params.method;
    let mut navigator = Navigator::new(params).map_err(usage)?;
    let (mut poses, mut report) = (Vec::new(), Report::default());
    for item in &log.items {
        match item {
            Item::Measured(measurement) => {
                if navigator.measure(measurement).is_some() && keeps {
                    poses.extend(navigator.position());
                }
            }
            Item::Truth(truth) => report.judge(&navigator, truth),
        }
        for innovation in navigator.innovations() {
            report.innovation(innovation);
        }
        for event in navigator.events() {
            report.events += 1;
            note(&format!("{}: {event}", method.name()));
        }
    }
    report.counts = navigator.counts();
    Ok(Run { method, poses, report })
}

fn print(args: &Estimate, runs: &[Run]) -> anyhow::Result<()> {
    if args.json && (args.report || args.compare) {
        return Ok(runs.iter().try_for_each(|run| data(&run.report.json(run.method.name()).to_string()))?);
    }
    if args.report || args.compare {
        let rows = runs.iter().map(|run| run.report.row(run.method.name()));
        return Ok(table(&Report::HEADER, rows)?);
    }
    let mut out = io::BufWriter::new(io::stdout().lock());
    for position in runs.iter().flat_map(|run| &run.poses) {
        let line = Line {
            covariance: position.map_covariance,
            map_to_odom: position.map_to_odom,
            odom: position.odom.pose,
            pose: position.map,
            stamp: position.odom.stamp,
            twist: position.odom.twist,
        };
        serde_json::to_writer(&mut out, &line)?;
        writeln!(out)?;
    }
    Ok(out.flush()?)
}

fn svg(name: &str, log: &Log, runs: &[Run]) -> anyhow::Result<String> {
    let truth: Vec<_> = log.truths().map(|truth| (truth.x, truth.y)).collect();
    let mut paths = Vec::new();
    if !truth.is_empty() {
        paths.push(PathSeries { name: "truth".to_owned(), points: truth, ink: 0 });
    }
    for (index, run) in runs.iter().enumerate() {
        let points = run.poses.iter().map(|position| (position.map.x.0, position.map.y.0)).collect();
        paths.push(PathSeries { name: run.method.name().to_owned(), points, ink: index + 1 });
    }
    let lines = |pick: fn(&report::Error) -> Option<f64>| {
        let of_run = |(index, run): (usize, &Run)| {
            let points: Vec<_> =
                run.report.errors.iter().filter_map(|error| Some((error.stamp, pick(error)?))).collect();
            (run.method.name(), index + 1, points)
        };
        runs.iter().enumerate().map(of_run).collect::<Vec<_>>()
    };
    let mut panels = Vec::new();
    let position = lines(|error| Some(error.distance));
    if position.iter().any(|line| line.2.len() > 1) {
        panels.push(Panel::of_lines("position error (m)", position));
    }
    let mut heading = lines(|error| error.heading);
    if heading.iter().any(|line| line.2.len() > 1) {
        // One method alone has room for how sure it is; of several nobody could tell the bands apart.
        if let [run] = runs {
            let band = |sign: f64| {
                let points = run.report.errors.iter().map(|error| (error.stamp, sign * error.heading_sd));
                points.collect::<Vec<_>>()
            };
            heading.push(("2 σ of the estimate", 2, band(2.0)));
            heading.push(("", 2, band(-2.0)));
        }
        panels.push(Panel::of_lines("heading error (rad)", heading));
    }
    chart(name, &paths, &[], &panels)
}

#[cfg(test)]
mod tests;
