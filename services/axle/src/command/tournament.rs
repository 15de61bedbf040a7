//! `axle tournament`: every corrector on every course in every scenario, in virtual time and on all cores.
//!
//! The runs are those of `axle-sim`; here are the threads, the progress and what is printed. A run depends on its number
//! alone, and results are put in the order of their numbers, so that threads change nothing.

mod draw;
mod print;
mod tune;

use crate::cli::Tournament as Args;
use crate::out::{self, is_watched, note, usage};
use anyhow::Context as _;
use axle_schema::Refusal;
use axle_sim::{COURSES, Course, Run, SCENARIOS, Scenario, Seat, TRIALS, Tournament, seats};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::num::NonZero;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::Instant;

/// How often each drives when nobody says so.
const RUNS: u16 = 10;

pub(super) fn tournament(args: &Args) -> anyhow::Result<()> {
    if args.list {
        return list();
    }
    if let Some(name) = &args.tune {
        return tune::tune(args, name);
    }
    let tournament = build(args, players(&args.only)?, args.runs.unwrap_or(RUNS), args.seed)?;
    let begin = Instant::now();
    let runs = play(&tournament, args, "driving")?;
    let took = begin.elapsed().as_secs_f64();
    let driven: f64 = runs.iter().map(|run| run.virtual_time.0).sum();
    if let Some(directory) = &args.svg {
        draw::draw(&tournament, &runs, directory)?;
    }
    let rows = tournament.rows(&runs);
    if args.json {
        print::json(&rows)?;
    } else if args.csv {
        print::csv(&rows)?;
    } else {
        print::tables(&tournament, &rows, args.markdown)?;
    }
    let hours = driven / 3600.0;
    note(&format!(
        "{} runs, {hours:.1} hours of driving in {took:.1} s ({:.0} times real time)",
        runs.len(),
        driven / took
    ));
    Ok(())
}

/// The correctors of these names, or all.
fn players(only: &[String]) -> anyhow::Result<Vec<Seat>> {
    let all = seats();
    let known = all.iter().map(|seat| seat.name).collect::<Vec<_>>().join(", ");
    if only.is_empty() {
        return Ok(all);
    }
    if let Some(unknown) = only.iter().find(|name| all.iter().all(|seat| seat.name != name.as_str())) {
        return Err(usage(format!("--only {unknown:?} is no corrector; known: {known}")));
    }
    Ok(all.into_iter().filter(|seat| only.iter().any(|name| name == seat.name)).collect())
}

/// The tournament that the arguments ask for.
fn build(args: &Args, seats: Vec<Seat>, runs: u16, seed: u64) -> anyhow::Result<Tournament> {
    let courses = chosen("--courses", &args.courses, COURSES, |course| course.name)?;
    let scenarios = chosen("--scenarios", &args.scenarios, SCENARIOS, |scenario| scenario.name)?;
    Ok(Tournament { seats, courses, scenarios, runs: usize::from(runs), seed })
}

/// Those of a table that are named, in the order of the table; all if none is.
fn chosen<T>(
    flag: &str,
    names: &[String],
    all: &'static [T],
    name_of: fn(&T) -> &'static str,
) -> anyhow::Result<Vec<&'static T>> {
    let known = || all.iter().map(name_of).collect::<Vec<_>>().join(", ");
    if let Some(unknown) = names.iter().find(|name| all.iter().all(|one| name_of(one) != name.as_str())) {
        return Err(usage(format!("{flag} {unknown:?} is unknown; known: {}", known())));
    }
    let is_chosen = |one: &&T| names.is_empty() || names.iter().any(|name| name == name_of(one));
    Ok(all.iter().filter(is_chosen).collect())
}

/// Plays all runs, on as many threads as there are cores or as asked for.
fn play(tournament: &Tournament, args: &Args, what: &'static str) -> anyhow::Result<Vec<Run>> {
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let threads = args.threads.map_or(cores, |threads| usize::from(threads.get()));
    let jobs = tournament.jobs();
    let bar = bar(jobs, what);
    let (next, results): (_, Vec<OnceLock<Result<Run, Refusal>>>) =
        (AtomicUsize::new(0), std::iter::repeat_with(OnceLock::new).take(jobs).collect());
    std::thread::scope(|scope| {
        for _ in 0..threads.min(jobs) {
            scope.spawn(|| {
                loop {
                    let job = next.fetch_add(1, Relaxed);
                    let Some(result) = results.get(job) else { break };
                    // Nobody else has this number.
                    drop(result.set(tournament.play(job)));
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    let runs = results
        .into_iter()
        .map(|result| result.into_inner().context("a run was left out")?.map_err(Into::into));
    runs.collect()
}

fn bar(jobs: usize, what: &'static str) -> ProgressBar {
    if !is_watched() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(jobs as u64), ProgressDrawTarget::stderr_with_hz(10));
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len} runs, {eta} left") {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar
}

/// What there is to drive.
fn list() -> anyhow::Result<()> {
    let course = |course: &Course| vec!["course".into(), course.name.into(), course.about.into()];
    let scenario = |scenario: &Scenario| vec!["scenario".into(), scenario.name.into(), scenario.about.into()];
    let trial = |trial: &Scenario| vec!["trial of --tune".into(), trial.name.into(), trial.about.into()];
    let rows =
        COURSES.iter().map(course).chain(SCENARIOS.iter().map(scenario)).chain(TRIALS.iter().map(trial));
    Ok(out::table(&["kind", "name", "what it is"], rows)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::CATALOG;

    #[test]
    fn every_corrector_of_the_catalogue_plays() {
        let correctors = CATALOG.iter().filter(|entry| entry.takes.is_some()).map(|entry| entry.name);
        let mut listed: Vec<_> = correctors.collect();
        let mut playing: Vec<_> = seats().iter().map(|seat| seat.name).collect();
        listed.sort_unstable();
        playing.sort_unstable();
        assert_eq!(playing, listed);
    }

    #[test]
    fn an_unknown_name_is_refused_with_those_that_are_known() {
        let wrong = |result: anyhow::Result<()>, words: &str| {
            let fault = result.expect_err(words).to_string();
            assert!(fault.contains(words), "{fault}");
        };
        wrong(players(&["x-corrector".into()]).map(drop), "known: d-corrector");
        wrong(chosen("--courses", &["x".into()], COURSES, |course| course.name).map(drop), "straight, turn");
    }
}
