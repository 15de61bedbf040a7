//! `axle map`: shows, checks and inflates maps, without a mesh.

use crate::chart;
use crate::cli::Map as Args;
use crate::out::{data, note, table, usage};
use crate::run::map::{description, read};
use anyhow::Context as _;
use axle_maps::{Clearance, Grid, Unknown, describe::Mode};
use axle_schema::{Metres, Pose};
use std::path::Path;

pub(super) fn map(args: Args) -> anyhow::Result<()> {
    match args {
        Args::Show { map, json, svg, png, columns } => {
            let grid = read(&map)?;
            if let Some(file) = &svg {
                let walls = axle_maps::areas(&grid, chart::MAX_WALLS);
                write(file, chart::map_chart(&grid.name, &[], &[], &walls)?.as_bytes())?;
            }
            if let Some(file) = &png {
                write(file, &axle_maps::png(&grid)?)?;
            }
            show(&grid, json, columns)
        }
        Args::Check { map, body } => check(&map, body),
        Args::Inflate { map, body, out } => inflate(&map, body, &out),
    }
}

fn show(grid: &Grid, json: bool, columns: u16) -> anyhow::Result<()> {
    let (free, occupied, unknown) = grid.counts();
    let (width, height) = (grid.width(), grid.height());
    let Pose { x, y, heading } = grid.origin;
    if json {
        let facts = serde_json::json!({
            "name": grid.name, "resolution": grid.resolution, "width": width, "height": height,
            "origin": grid.origin, "free": free, "occupied": occupied, "unknown": unknown,
            "content": grid.to_data()?.content,
        });
        return Ok(data(&facts.to_string())?);
    }
    data(axle_maps::ascii(grid, usize::from(columns)).trim_end())?;
    #[allow(clippy::cast_precision_loss, reason = "numbers of cells, for people")]
    let share = |cells: usize| format!("{:.1} %", 100.0 * cells as f64 / (width * height) as f64);
    #[allow(clippy::cast_precision_loss, reason = "numbers of cells, for people")]
    let metres = |cells: usize| grid.resolution.0 * cells as f64;
    let rows = [
        ("name", grid.name.clone()),
        (
            "size",
            format!(
                "{:.2} x {:.2} m, {width} x {height} cells of {}",
                metres(width),
                metres(height),
                grid.resolution
            ),
        ),
        ("origin", format!("({}, {}), heading {heading}", x, y)),
        ("free", share(free)),
        ("occupied", share(occupied)),
        ("unknown", share(unknown)),
    ];
    table(&["what", "value"], rows.into_iter().map(|(what, value)| vec![what.to_owned(), value]))?;
    Ok(())
}

/// Reads the map as every service would, and says how much of it one robot can reach from its largest place.
fn check(map: &Path, body: f64) -> anyhow::Result<()> {
    let grid = read(map)?;
    let data_size = grid.to_data().map_err(|refusal| usage(format!("{}: {refusal}", map.display())))?;
    let (free, _, unknown) = grid.counts();
    let clearance = Clearance::of(&grid, Unknown::Blocked);
    let limit = Metres(body).0 / grid.resolution.0;
    axle_schema::refusal::within("--body in m", body, 0.0, 100.0).map_err(usage)?;
    let (largest, parts) = reachable(&clearance, limit);
    data(&format!("{}: {} x {} cells of {}", map.display(), grid.width(), grid.height(), grid.resolution))?;
    if free == 0 {
        return Err(usage(format!("{}: no cell is free; is `negate` right?", map.display())));
    }
    if parts == 0 {
        return Err(usage(format!("{}: a robot of radius {body} m fits nowhere", map.display())));
    }
    if unknown * 2 > grid.cells().len() {
        note("more than half of the map is unknown: are free_thresh and occupied_thresh right?");
    }
    #[allow(clippy::cast_precision_loss, reason = "numbers of cells, for people")]
    let area = |cells: usize| cells as f64 * grid.resolution.0 * grid.resolution.0;
    data(&format!(
        "a robot of radius {body} m reaches {:.2} m² of {:.2} m² that are free, in {parts} parts that are not joined",
        area(largest),
        area(free)
    ))?;
    data(&format!("content {}, {} runs", data_size.content, data_size.runs.len() / 2))?;
    Ok(())
}

/// Cells of the largest part in which the middle of a robot can move about, and how many such parts there are.
fn reachable(clearance: &Clearance, limit: f64) -> (usize, usize) {
    let (width, height) = (clearance.width(), clearance.height());
    let mut open: Vec<bool> = clearance
        .distances()
        .iter()
        .map(|&distance| distance > 0.0 && f64::from(distance) >= limit)
        .collect();
    let (mut largest, mut parts) = (0, 0);
    for first in 0..open.len() {
        let mut size = 0;
        let mut next = vec![first];
        while let Some(cell) = next.pop() {
            let Some(place) = open.get_mut(cell) else { continue };
            if !std::mem::replace(place, false) {
                continue;
            }
            size += 1;
            let (column, row) = (cell % width, cell / width);
            next.extend((column > 0).then(|| cell - 1));
            next.extend((column + 1 < width).then_some(cell + 1));
            next.extend((row > 0).then(|| cell - width));
            next.extend((row + 1 < height).then_some(cell + width));
        }
        largest = largest.max(size);
        parts += usize::from(size > 0);
    }
    (largest, parts)
}

fn inflate(map: &Path, body: f64, out: &Path) -> anyhow::Result<()> {
    let grid = read(map)?;
    let clearance = Clearance::of(&grid, Unknown::Blocked);
    let inflated = clearance.inflated(&grid, Metres(body)).map_err(usage)?;
    let image = out.with_extension("png");
    let name = image.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = name.ok_or_else(|| usage(format!("--out {}: it is no file", out.display())))?;
    if image == out {
        return Err(usage(format!(
            "--out {}: it ends in .yaml; the image is written beside it",
            out.display()
        )));
    }
    let (described, _) = description(map)?;
    // The picture has the three lightnesses of map savers, whatever the first one had.
    let written = axle_maps::Description {
        image: name,
        negate: false,
        occupied_thresh: 0.65,
        free_thresh: 0.196,
        mode: Mode::Trinary,
        ..described
    };
    write(&image, &axle_maps::png(&inflated)?)?;
    write(out, written.write().as_bytes())
}

fn write(file: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(file, bytes).with_context(|| format!("write {}", file.display()))?;
    note(&format!("written: {}", file.display()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_are_not_joined_are_counted() {
        let cells = b"...#.....#...".map(|letter| if letter == b'#' { 100 } else { 0 }).to_vec();
        let grid = Grid::new("m", Metres(1.0), Pose::default(), 13, cells).expect("a map");
        assert_eq!(reachable(&Clearance::of(&grid, Unknown::Blocked), 0.2), (5, 3));
        assert_eq!(reachable(&Clearance::of(&grid, Unknown::Blocked), 0.6), (0, 0));
    }
}
