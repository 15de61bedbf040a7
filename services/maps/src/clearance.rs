//! How far the next obstacle is: exactly, from the middle of every cell and from any point.
//!
//! An obstacle is the whole square of a cell, and what lies beyond the edge of the map. Distances are in cells. From the
//! middles they are found in two passes, rows after columns, with the lower envelope of parabolas of Felzenszwalb and
//! Huttenlocher ("Distance Transforms of Sampled Functions", 2012); the time grows with the number of cells only.

use crate::{Grid, is_occupied};
use axle_schema::map::UNKNOWN;
use axle_schema::{Metres, Refusal};
use std::convert::Infallible;

/// What a cell is that nobody knows anything of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unknown {
    /// An obstacle.
    #[default]
    Blocked,
    /// Free.
    Free,
}

/// The distances to the next obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Clearance {
    width: usize,
    height: usize,
    /// Whether each cell is an obstacle, row by row from the origin.
    solid: Vec<bool>,
    /// From the middle of each cell to the nearest obstacle, in cells; 0 within one.
    distances: Vec<f32>,
}

impl Clearance {
    /// The distances on a map.
    #[must_use]
    pub fn of(grid: &Grid, unknown: Unknown) -> Self {
        match Self::watched(grid, unknown, || Ok::<(), Infallible>(())) {
            Ok(clearance) => clearance,
            Err(never) => match never {},
        }
    }

    /// The same, which `watch` may end: it is asked every few rows, since a large map takes most of a second.
    ///
    /// # Errors
    /// What `watch` ends it with.
    pub fn watched<E>(
        grid: &Grid,
        unknown: Unknown,
        mut watch: impl FnMut() -> Result<(), E>,
    ) -> Result<Self, E> {
        watch()?;
        let blocked = |&value: &u8| is_occupied(value) || (value == UNKNOWN && unknown == Unknown::Blocked);
        let solid: Vec<bool> = grid.cells().iter().map(blocked).collect();
        let (width, height) = (grid.width(), grid.height());
        let distances = distances(&solid, width, height, &mut watch)?;
        Ok(Self { width, height, solid, distances })
    }

    /// Cells of a row.
    #[must_use]
    pub const fn width(&self) -> usize {
        self.width
    }
    /// Rows.
    #[must_use]
    pub const fn height(&self) -> usize {
        self.height
    }
    /// From the middle of each cell to the nearest obstacle, in cells, row by row from the origin; 0 within one.
    #[must_use]
    pub fn distances(&self) -> &[f32] {
        &self.distances
    }

    /// Whether a cell is an obstacle; outside the map all are.
    #[must_use]
    pub fn is_solid(&self, column: i64, row: i64) -> bool {
        self.index(column, row).is_none_or(|index| self.solid.get(index).copied().unwrap_or(true))
    }

    fn index(&self, column: i64, row: i64) -> Option<usize> {
        let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
        (column < self.width && row < self.height).then_some(row * self.width + column)
    }

    /// The distance from the point (u, v), in cells from the origin, to the nearest obstacle: exact where it is less
    /// than `most`, else `most` or some distance between. 0 within an obstacle and outside the map.
    #[must_use]
    pub fn at(&self, u: f64, v: f64, most: f64) -> f64 {
        #[allow(clippy::cast_possible_truncation, reason = "saturates, and such cells are outside the map")]
        let (column, row) = (u.floor() as i64, v.floor() as i64);
        let Some(index) = self.index(column, row).filter(|_| u.is_finite() && v.is_finite()) else {
            return 0.0;
        };
        let from_middle = f64::from(self.distances.get(index).copied().unwrap_or(0.0));
        let aside = (u - (column as f64 + 0.5)).hypot(v - (row as f64 + 0.5));
        // The distance changes at most by as much as the point moves.
        let at_least = from_middle - aside;
        if at_least >= most {
            return at_least;
        }
        let at_most = most.min(from_middle + aside);
        #[allow(clippy::cast_possible_truncation, reason = "at most the sides of a map")]
        let reach = (at_most.min(1e6).ceil() as i64).max(0) + 1;
        // Nothing is nearer than `at_least`, so that in each row only a few cells to the left and to the right may be the
        // nearest: the work grows with the distance and not with its square. Distances are kept in few digits.
        let inner = (at_least - 1e-3).max(0.0).powi(2);
        let mut nearest = at_most * at_most;
        for y in row - reach..=row + reach {
            let dy = ((v - (y as f64 + 0.5)).abs() - 0.5).max(0.0);
            let (least, far) = (inner - dy * dy, nearest - dy * dy);
            if far <= 0.0 {
                continue;
            }
            let far = far.sqrt();
            let mut look = |from: f64, to: f64| {
                #[allow(clippy::cast_possible_truncation, reason = "at most the sides of a map")]
                for x in from.floor() as i64..=to.floor() as i64 {
                    if self.is_solid(x, y) {
                        let dx = ((u - (x as f64 + 0.5)).abs() - 0.5).max(0.0);
                        nearest = nearest.min(dx * dx + dy * dy);
                    }
                }
            };
            if least > 0.0 {
                let near = least.sqrt();
                look(u - 1.0 - far, u - near);
                look(u + near, u + far);
            } else {
                look(u - 1.0 - far, u + far);
            }
        }
        nearest.sqrt()
    }

    /// The map with every cell occupied whose middle is closer to an obstacle than `radius`: what costmaps call
    /// inflation.
    ///
    /// # Errors
    /// Refuses a radius below 0 or above 100 m.
    pub fn inflated(&self, grid: &Grid, radius: Metres) -> Result<Grid, Refusal> {
        axle_schema::refusal::within("radius in m", radius.0, 0.0, 100.0)?;
        let limit = radius.0 / grid.resolution.0;
        let cells = grid.cells().iter().zip(&self.distances).map(|(&value, &distance)| {
            if f64::from(distance) < limit && value != UNKNOWN { 100 } else { value }
        });
        Grid::new(&grid.name, grid.resolution, grid.origin, self.width, cells.collect())
    }
}

/// So many cells are reckoned between two looks at whether anybody still waits.
const PACE: usize = 1 << 14;

#[allow(clippy::indexing_slicing, reason = "columns and rows are counted here")]
fn distances<E>(
    solid: &[bool],
    width: usize,
    height: usize,
    watch: &mut impl FnMut() -> Result<(), E>,
) -> Result<Vec<f32>, E> {
    // Whoever watches is asked after so many rows, and so some times a millisecond at least.
    let pace = (PACE / width.max(1)).max(1);
    let mut found = vec![0.0_f32; solid.len()];
    // Up the columns, all columns at once, so that memory is read in its order; then down. Beyond the edge is an
    // obstacle.
    let mut runs = vec![0.5_f32; width];
    for row in 0..height {
        if row % pace == 0 {
            watch()?;
        }
        let cells = row * width..(row + 1) * width;
        for ((run, &solid), found) in runs.iter_mut().zip(&solid[cells.clone()]).zip(&mut found[cells]) {
            *found = if solid { 0.0 } else { *run };
            *run = if solid { 0.5 } else { *run + 1.0 };
        }
    }
    runs.fill(0.5);
    for row in (0..height).rev() {
        if row % pace == 0 {
            watch()?;
        }
        let cells = row * width..(row + 1) * width;
        for ((run, &solid), found) in runs.iter_mut().zip(&solid[cells.clone()]).zip(&mut found[cells]) {
            *found = found.min(*run);
            *run = if solid { 0.5 } else { *run + 1.0 };
        }
    }
    let mut envelope = Envelope::default();
    for (row, line) in found.chunks_exact_mut(width).enumerate() {
        if row % pace == 0 {
            watch()?;
        }
        envelope.spread(line);
    }
    Ok(found)
}

/// The lowest of the parabolas (x - i)² + h(i) over the borders i = 0, 1, … between the cells of a row.
///
/// The nearest point of an obstacle is on a border of its cell, or straight above or below.
#[derive(Default)]
struct Envelope {
    /// Those that are lowest somewhere, from left to right: border, height, and where they begin to be lowest.
    parts: Vec<(f64, f64, f64)>,
}

impl Envelope {
    /// Makes distances within the columns of a row into distances in the plane.
    #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "below 2^17")]
    fn spread(&mut self, row: &mut [f32]) {
        self.parts.clear();
        let mut left = 0.0;
        for border in 0..=row.len() {
            let right = row.get(border).copied().map_or(0.0, f64::from);
            let height = f64::min(left, right).powi(2);
            left = right;
            self.add(border as f64, height);
        }
        let mut parts = self.parts.iter().peekable();
        let mut lowest = (0.0, 0.0, 0.0);
        for (column, distance) in row.iter_mut().enumerate() {
            let x = column as f64 + 0.5;
            while let Some(&part) = parts.next_if(|part| part.2 <= x) {
                lowest = part;
            }
            let across = (x - lowest.0).powi(2) + lowest.1;
            *distance = across.sqrt().min(f64::from(*distance)) as f32;
        }
    }

    fn add(&mut self, border: f64, height: f64) {
        let mut begin = f64::NEG_INFINITY;
        while let Some(&(other, its, its_begin)) = self.parts.last() {
            // Where both are equally high: behind it the new one is lower.
            begin = f64::midpoint(border, other) + (height - its) / (2.0 * (border - other));
            if begin > its_begin {
                break;
            }
            self.parts.pop();
            begin = f64::NEG_INFINITY;
        }
        self.parts.push((border, height, begin));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::Pose;
    use proptest::prelude::*;

    fn grid(width: usize, rows: &[&str]) -> Grid {
        // The first text is the uppermost row, as one sees it.
        let cells = rows.iter().rev().flat_map(|row| row.bytes());
        let cells = cells.map(|letter| match letter {
            b'#' => 100,
            b'?' => UNKNOWN,
            _ => 0,
        });
        Grid::new("m", Metres(0.1), Pose::default(), width, cells.collect()).expect("a map")
    }

    #[test]
    fn a_known_map_has_known_distances() {
        let clearance =
            Clearance::of(&grid(5, &[".....", ".....", "..#..", ".....", "....."]), Unknown::Blocked);
        let at = |column: usize, row: usize| f64::from(clearance.distances()[row * 5 + column]);
        assert!(at(2, 2).abs() < 1e-6 && (at(1, 2) - 0.5).abs() < 1e-6 && (at(0, 0) - 0.5).abs() < 1e-6);
        // Half a cell to the right and half a cell up to the corner of the square.
        assert!((at(1, 1) - 0.5_f64.sqrt()).abs() < 1e-6, "{}", at(1, 1));
        assert!((clearance.at(1.9, 2.5, 9.0) - 0.1).abs() < 1e-9);
        assert!((clearance.at(1.7, 1.6, 9.0) - 0.5).abs() < 1e-9, "0.3 and 0.4 from the corner");
        assert_eq!(clearance.at(2.5, 2.5, 9.0).to_bits(), 0.0_f64.to_bits());
        assert_eq!(clearance.at(-1.0, 2.5, 9.0).to_bits(), 0.0_f64.to_bits());
        assert_eq!(clearance.at(f64::NAN, 2.5, 9.0).to_bits() << 1, 0, "no number is nowhere");
    }

    #[test]
    fn what_is_unknown_is_blocked_unless_told_otherwise() {
        let grid = grid(3, &["...", ".?.", "..."]);
        let middle = |unknown| f64::from(Clearance::of(&grid, unknown).distances()[4]);
        assert!(middle(Unknown::Blocked).abs() < 1e-6 && (middle(Unknown::Free) - 1.5).abs() < 1e-6);
    }

    #[test]
    fn whoever_no_longer_waits_ends_it_wherever_it_is() {
        let grid = Grid::new("m", Metres(0.1), Pose::default(), 1000, vec![0; 1_000_000]).expect("a map");
        let after = |looks: usize| {
            let mut left = looks;
            let watch = || {
                left = left.checked_sub(1).ok_or("enough")?;
                Ok(())
            };
            Clearance::watched(&grid, Unknown::Blocked, watch).map(|found: Clearance| found.width())
        };
        // Before anything, and after so many sixteenths of a thousand rows in each of the three passes.
        for looks in [0, 1, 62, 63, 64, 125, 180] {
            assert_eq!(after(looks), Err("enough"), "after {looks} looks");
        }
        assert_eq!(after(190), Ok(1000));
    }

    #[test]
    fn inflation_fills_what_is_too_near() {
        let grid = grid(7, &[".......", ".......", ".......", "...#...", ".......", ".......", "......."]);
        let inflated = Clearance::of(&grid, Unknown::Blocked).inflated(&grid, Metres(0.06)).expect("a map");
        // 0.6 cells: the four neighbours, and all cells of the edge, whose middles are half a cell from it.
        let (_, occupied, _) = inflated.counts();
        assert_eq!(occupied, 1 + 4 + 24);
        let refused = Clearance::of(&grid, Unknown::Blocked).inflated(&grid, Metres(f64::NAN));
        assert!(refused.expect_err("no number").to_string().contains("radius in m"));
    }

    proptest! {
        #[test]
        fn distances_are_those_of_the_nearest_square(
            width in 1_usize..20,
            cells in proptest::collection::vec(proptest::bool::weighted(0.2), 1..200),
            point in (0.0..1.0, 0.0..1.0),
        ) {
            let mut cells: Vec<u8> = cells.into_iter().map(|solid| if solid { 100 } else { 0 }).collect();
            cells.resize(cells.len().div_ceil(width) * width, 0);
            let grid = Grid::new("m", Metres(0.1), Pose::default(), width, cells).expect("a map");
            let clearance = Clearance::of(&grid, Unknown::Blocked);
            let (w, h) = (width as i64, grid.height() as i64);
            let brute = |u: f64, v: f64| {
                let mut nearest = f64::INFINITY;
                for y in -1..=h {
                    for x in -1..=w {
                        if clearance.is_solid(x, y) {
                            let dx = ((u - (x as f64 + 0.5)).abs() - 0.5).max(0.0);
                            let dy = ((v - (y as f64 + 0.5)).abs() - 0.5).max(0.0);
                            nearest = nearest.min(dx.hypot(dy));
                        }
                    }
                }
                nearest
            };
            for (index, &distance) in clearance.distances().iter().enumerate() {
                let (u, v) = ((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
                prop_assert!((f64::from(distance) - brute(u, v)).abs() < 1e-5, "{distance} at {u}, {v}");
            }
            let (u, v) = (point.0 * w as f64, point.1 * h as f64);
            let exact = brute(u, v);
            prop_assert!((clearance.at(u, v, 1e9) - exact).abs() < 1e-5, "{exact} at {u}, {v}");
            prop_assert!(clearance.at(u, v, 1.0) >= exact.min(1.0) - 1e-5);
        }
    }
}
