//! The pictures of a tournament: for each course and scenario the paths of all correctors, and box plots of their errors.

use crate::chart::{PathSeries, Spread, contest_chart};
use crate::out::{note, usage};
use crate::path;
use anyhow::Context as _;
use axle_sim::{Run, Tournament};
use std::path::Path;

/// The most correctors whose inks can be told apart.
const MOST: usize = 6;
/// Metres to centimetres.
const CM: f64 = 100.0;

pub(super) fn draw(tournament: &Tournament, runs: &[Run], directory: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(directory).map_err(|fault| {
        usage(format!("--svg {}: cannot make this directory: {fault}", directory.display()))
    })?;
    let cells =
        tournament.courses.iter().flat_map(|course| tournament.scenarios.iter().map(move |s| (course, s)));
    let cell_size = tournament.seats.len() * tournament.runs;
    let mut files = 0;
    for (index, (course, scenario)) in cells.enumerate() {
        let first = index * cell_size;
        let Some(cell) = runs.get(first..first + cell_size) else { break };
        let of_seats = || cell.chunks(tournament.runs).zip(&tournament.seats).take(MOST);
        let plan = tournament.brief(first)?.plan;
        // The paths are those of the first run of each, which all have had the same accidents.
        let driven = of_seats().enumerate().filter_map(|(index, (runs, seat))| {
            let points = runs.first()?.path.clone();
            Some(PathSeries { name: seat.name.to_owned(), points, ink: index + 1 })
        });
        let paths: Vec<_> = [PathSeries::planned(path::of_plan(&plan))].into_iter().chain(driven).collect();
        let spreads: Vec<_> = of_seats().map(|(runs, seat)| spread(seat.name, runs.iter())).collect();
        let title =
            format!("{}, {}: {} runs each, the first one drawn", course.name, scenario.name, tournament.runs);
        let svg = contest_chart(&title, &paths, ("final error (cm)", &spreads))?;
        write(&directory.join(format!("{}-{}.svg", course.name, scenario.name)), &svg)?;
        files += 1;
    }
    let of_seat = |seat: usize| {
        let runs = runs.chunks(tournament.runs).skip(seat).step_by(tournament.seats.len()).flatten();
        spread(tournament.seats[seat].name, runs)
    };
    let spreads: Vec<_> = (0..tournament.seats.len().min(MOST)).map(of_seat).collect();
    let title = format!("All courses and scenarios, seed {}", tournament.seed);
    write(&directory.join("all.svg"), &contest_chart(&title, &[], ("final error (cm)", &spreads))?)?;
    note(&format!("drawn: {} pictures in {}", files + 1, directory.display()));
    Ok(())
}

fn spread<'a>(name: &str, runs: impl Iterator<Item = &'a Run>) -> Spread {
    Spread { name: name.to_owned(), values: runs.map(|run| run.values[0] * CM).collect() }
}

fn write(file: &Path, svg: &str) -> anyhow::Result<()> {
    std::fs::write(file, svg).with_context(|| format!("write {}", file.display()))
}
