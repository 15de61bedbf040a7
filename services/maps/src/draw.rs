//! Maps as pictures: a PNG, and letters for a terminal.

use crate::{Grid, is_occupied};
use axle_schema::Refusal;
use axle_schema::map::UNKNOWN;

/// The map as a PNG, with the lightness that map savers write: 254 free, 0 occupied, 205 unknown.
///
/// # Errors
/// Refuses what cannot be encoded, which is nothing that a [`Grid`] can be.
pub fn png(grid: &Grid) -> Result<Vec<u8>, Refusal> {
    let light = |value: u8| match value {
        UNKNOWN => 205,
        value if is_occupied(value) => 0,
        0 => 254,
        // In between, in proportion; never the lightness of the three others.
        value => 250 - value,
    };
    let rows = grid.cells().chunks_exact(grid.width()).rev();
    let pixels: Vec<u8> = rows.flatten().map(|&value| light(value)).collect();
    let mut bytes = Vec::new();
    #[allow(clippy::cast_possible_truncation, reason = "sides are at most 65535")]
    let mut encoder = png::Encoder::new(&mut bytes, grid.width() as u32, grid.height() as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(&pixels)?;
        writer.finish()
    });
    written.map_err(Refusal::internal)?;
    Ok(bytes)
}

/// The map in letters, at most `columns` of them in a row: `.` free, `#` occupied, `?` unknown.
///
/// A letter stands for about twice as many rows as columns, since letters are about twice as high as wide. Where it
/// stands for several cells, one that is occupied counts most, then one that is unknown.
#[must_use]
pub fn ascii(grid: &Grid, columns: usize) -> String {
    let wide = grid.width().div_ceil(columns.max(1)).max(1);
    let high = if wide == 1 { 1 } else { 2 * wide };
    let mut text = String::new();
    for row in (0..grid.height().div_ceil(high)).rev() {
        for column in 0..grid.width().div_ceil(wide) {
            let rows = row * high..((row + 1) * high).min(grid.height());
            let values = rows.flat_map(|y| {
                (column * wide..((column + 1) * wide).min(grid.width())).map(move |x| grid.value(x, y))
            });
            let letter = values.fold('.', |letter, value| match (letter, value) {
                ('#', _) => '#',
                (_, UNKNOWN) => '?',
                (_, value) if is_occupied(value) => '#',
                (letter, _) => letter,
            });
            text.push(letter);
        }
        text.push('\n');
    }
    text
}

/// What a chart draws of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// Nobody knows.
    Unknown,
    /// An obstacle.
    Occupied,
}

/// The cells that are not free as areas of the plane, each by its four corners in metres; at most `most` of them.
///
/// Cells side by side become one area, and equal rows above each other too. Of a map with more specks than that several
/// cells are drawn as one.
#[must_use]
pub fn areas(grid: &Grid, most: usize) -> Vec<(Ink, [(f64, f64); 4])> {
    let mut size = 1;
    loop {
        let found = areas_of(grid, size, most);
        if found.len() <= most || size >= grid.width().max(grid.height()) {
            return found;
        }
        size *= 2;
    }
}

/// The same with squares of `size` cells; may give up beyond `most`.
fn areas_of(grid: &Grid, size: usize, most: usize) -> Vec<(Ink, [(f64, f64); 4])> {
    // Areas that reach up to the row below: columns, first row, and ink.
    let mut open: Vec<(usize, usize, usize, Ink)> = Vec::new();
    let mut done = Vec::new();
    let rows = grid.height().div_ceil(size);
    for row in 0..=rows {
        let runs = if row < rows { runs(grid, row, size) } else { Vec::new() };
        let mut next = Vec::with_capacity(runs.len());
        for &(begin, end, ink) in &runs {
            let below = open.iter().find(|area| (area.0, area.1, area.3) == (begin, end, ink));
            next.push((begin, end, below.map_or(row, |area| area.2), ink));
        }
        let ended = open.iter().filter(|area| !runs.contains(&(area.0, area.1, area.3)));
        done.extend(
            ended.map(|&(begin, end, first, ink)| (ink, corners(grid, size, (begin, first), (end, row)))),
        );
        open = next;
        if done.len() > most {
            break;
        }
    }
    done
}

/// Runs of equal squares that are not free in a row: where they begin and end.
fn runs(grid: &Grid, row: usize, size: usize) -> Vec<(usize, usize, Ink)> {
    let mut runs: Vec<(usize, usize, Ink)> = Vec::new();
    for column in 0..grid.width().div_ceil(size) {
        let rows = row * size..((row + 1) * size).min(grid.height());
        let values = rows.flat_map(|y| {
            (column * size..((column + 1) * size).min(grid.width())).map(move |x| grid.value(x, y))
        });
        let ink = values.fold(None, |ink, value| match (ink, value) {
            (Some(Ink::Occupied), _) => ink,
            (_, UNKNOWN) => Some(Ink::Unknown),
            (_, value) if is_occupied(value) => Some(Ink::Occupied),
            _ => ink,
        });
        let Some(ink) = ink else { continue };
        match runs.last_mut() {
            Some(last) if last.1 == column && last.2 == ink => last.1 += 1,
            _ => runs.push((column, column + 1, ink)),
        }
    }
    runs
}

#[allow(clippy::cast_precision_loss, reason = "sides are below 2^16")]
fn corners(grid: &Grid, size: usize, from: (usize, usize), to: (usize, usize)) -> [(f64, f64); 4] {
    let u = |column: usize| (column * size).min(grid.width()) as f64;
    let v = |row: usize| (row * size).min(grid.height()) as f64;
    let (a, b) = ((u(from.0), v(from.1)), (u(to.0), v(to.1)));
    [a, (b.0, a.1), b, (a.0, b.1)].map(|(u, v)| grid.in_metres(u, v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Description, image};
    use axle_schema::{Metres, Pose};

    fn grid() -> Grid {
        Grid::new("m", Metres(0.1), Pose::default(), 4, vec![0, 100, 0, 0, 0, UNKNOWN, 0, 40]).expect("a map")
    }

    #[test]
    fn the_picture_is_read_as_the_map_that_it_was_made_of() {
        let read = image::read(&png(&grid()).expect("a picture")).expect("an image");
        let text = "image: m.png\nresolution: 0.1\norigin: [0, 0, 0]\n";
        let again = Description::read(text.as_bytes()).and_then(|it| it.grid("m", &read)).expect("a map");
        // 40 of 100 is between the thresholds of a map of three values: 250 - 40 is a grey of its own.
        assert_eq!(again.cells(), [0, 100, 0, 0, 0, UNKNOWN, 0, 0]);
    }

    #[test]
    fn areas_cover_what_is_not_free_and_are_few() {
        let mut cells = vec![0; 100];
        for index in [11, 12, 21, 22, 31, 32] {
            cells[index] = 100;
        }
        cells[99] = UNKNOWN;
        let grid = Grid::new("m", Metres(0.5), Pose::new(1.0, 2.0, 0.0), 10, cells).expect("a map");
        let wall = [(1.5, 2.5), (2.5, 2.5), (2.5, 4.0), (1.5, 4.0)];
        let speck = [(5.5, 6.5), (6.0, 6.5), (6.0, 7.0), (5.5, 7.0)];
        assert_eq!(areas(&grid, 10), [(Ink::Occupied, wall), (Ink::Unknown, speck)]);
        let board = (0..10_000).map(|index| if (index / 100 + index) % 2 == 0 { 0 } else { 100 }).collect();
        let grid = Grid::new("m", Metres(0.5), Pose::default(), 100, board).expect("a map");
        assert_eq!(areas(&grid, 100).len(), 1, "too many specks become one area");
    }

    #[test]
    fn letters_show_the_upper_row_first_and_obstacles_before_all() {
        assert_eq!(ascii(&grid(), 80), ".?..\n.#..\n");
        assert_eq!(ascii(&grid(), 2), "#.\n");
    }
}
