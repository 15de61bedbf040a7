//! Where a search may go: one bit for each cell, by rows and by columns.
//!
//! Around the map there is a border of cells that are not free, so that no step looks beyond an end.

use crate::search::{Cell, Watch};
use crate::terrain::Terrain;
use axle_schema::Refusal;

/// So many rows are read between two looks at whether anybody still waits: 65 535 cells each at most.
const PACE: usize = 16;

/// Lines of bits; 1 is free. Both sides of a line, and a line above and one below, are not free.
#[derive(Clone, Debug)]
struct Lines {
    words: usize,
    bits: Vec<u64>,
}

impl Lines {
    fn new(length: usize, lines: usize) -> Self {
        let words = (length + 2).div_ceil(64);
        Self { words, bits: vec![0; words * (lines + 2)] }
    }
    /// Takes the bits of a line, 64 at a time, the first place lowest.
    fn fill(&mut self, line: usize, bits: impl Iterator<Item = u64>) {
        let first = (line + 1) * self.words;
        let words = self.bits.get_mut(first..first + self.words).unwrap_or_default();
        // The border is before them.
        let mut before = 0;
        for (word, bits) in words.iter_mut().zip(bits.chain([0])) {
            *word = bits << 1 | before;
            before = bits >> 63;
        }
    }
    /// The same bits with places for lines and lines for places; `length` and `lines` are theirs.
    fn turned(&self, length: usize, lines: usize) -> Self {
        let mut turned = Self::new(lines, length);
        for line in (0..lines + 2).step_by(64) {
            for word in 0..self.words {
                let mut block: [u64; 64] = std::array::from_fn(|i| {
                    self.bits.get((line + i) * self.words + word).copied().unwrap_or(0)
                });
                transpose(&mut block);
                let places = turned.bits.chunks_exact_mut(turned.words).skip(word * 64);
                for (place, bits) in places.zip(block) {
                    if let Some(word) = place.get_mut(line / 64) {
                        *word = bits;
                    }
                }
            }
        }
        turned
    }
    /// The three places around one, as bits: the one before it is the lowest.
    #[allow(clippy::cast_possible_truncation, reason = "three bits")]
    fn around(&self, line: usize, place: usize) -> usize {
        let (word, shift) = (place / 64, place % 64);
        let mut bits = self.word(line, word) >> shift;
        if shift > 61 {
            bits |= self.word(line, word + 1) << (64 - shift);
        }
        bits as usize & 7
    }
    /// A word of a line; beyond the ends there is nothing.
    fn word(&self, line: usize, word: usize) -> u64 {
        if word < self.words { self.bits.get(line * self.words + word).copied().unwrap_or(0) } else { 0 }
    }
    /// The words of a line from which a run along it is stopped: at cells that are not free, and beside the ends of
    /// obstacles. `ahead` says whether the run goes to higher places.
    fn stops(&self, line: usize, word: usize, ahead: bool) -> u64 {
        let beside = |line: usize| {
            let here = self.word(line, word);
            let behind = if ahead {
                here << 1 | if word > 0 { self.word(line, word - 1) >> 63 } else { 0 }
            } else {
                here >> 1 | self.word(line, word + 1) << 63
            };
            here & !behind
        };
        !self.word(line, word) | beside(line - 1) | beside(line + 1)
    }
    /// The first place behind `from` at which a run is stopped, and whether one can be there.
    fn run(&self, line: usize, from: usize, ahead: bool) -> (usize, bool) {
        let (line, from) = (line + 1, from + 1);
        let mut word = from / 64;
        let mut mask = if ahead { !1_u64 << (from % 64) } else { (1_u64 << (from % 64)) - 1 };
        loop {
            let stops = self.stops(line, word, ahead) & mask;
            if stops != 0 {
                let bit = if ahead { stops.trailing_zeros() } else { 63 - stops.leading_zeros() } as usize;
                // The border is never free, so that a run ends before it and the place is within the map.
                return ((word * 64 + bit).saturating_sub(1), self.word(line, word) >> bit & 1 == 1);
            }
            mask = !0;
            word = if ahead { word + 1 } else { word.saturating_sub(1) };
        }
    }
}

/// Exchanges the rows and the columns of 64 x 64 bits, by halves (H. S. Warren, "Hacker's Delight", 2012, section 7-3).
#[allow(clippy::indexing_slicing, reason = "below 64")]
fn transpose(block: &mut [u64; 64]) {
    let (mut width, mut mask) = (32, 0xffff_ffff_u64);
    while width != 0 {
        let mut row = 0;
        while row < 64 {
            let swapped = (block[row] >> width ^ block[row + width]) & mask;
            block[row] ^= swapped << width;
            block[row + width] ^= swapped;
            row = (row + width + 1) & !width;
        }
        width /= 2;
        mask ^= mask << width;
    }
}

/// The cells of a map that are free.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// How far the middle of a free cell is from the nearest obstacle at least, in cells.
    least: f64,
    rows: Lines,
    columns: Lines,
}

impl Cells {
    /// The cells whose middle is wide enough for `room`, in cells, to the nearest obstacle.
    ///
    /// Between the middles of two neighbours, at most √2 apart, the distance may be smaller than at both: by Stewart's
    /// theorem its square is smaller by at most half a square cell. Up to half a cell nothing needs to be added, since
    /// steps stay within free cells and do not cut corners.
    ///
    /// # Errors
    /// What `watch` ends it with.
    pub(crate) fn new(terrain: &Terrain, room: f64, watch: Watch<'_>) -> Result<Self, Refusal> {
        let clearance = terrain.clearance();
        let least = Self::needed(room) - 1e-6;
        let (width, height) = (clearance.width(), clearance.height());
        let mut rows = Lines::new(width, height);
        for (row, line) in clearance.distances().chunks_exact(width).enumerate() {
            let word = |part: &[f32]| {
                part.iter()
                    .rev()
                    .fold(0, |word, &distance| word << 1 | u64::from(f64::from(distance) >= least))
            };
            rows.fill(row, line.chunks(64).map(word));
            if row % PACE == 0 {
                watch(0.0)?;
            }
        }
        let columns = rows.turned(width, height);
        Ok(Self { width, height, least, rows, columns })
    }

    /// How far the middle of a free cell must be from the nearest obstacle, in cells.
    pub(crate) fn needed(room: f64) -> f64 {
        if room <= 0.5 { 0.5 } else { (room * room + 0.5).sqrt() }
    }

    /// How far the middle of a free cell is from the nearest obstacle at least, in cells.
    pub(crate) const fn least(&self) -> f64 {
        self.least
    }

    /// The number of a cell, row by row; a map has at most 2^24 cells.
    #[allow(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "cells within the map")]
    pub(crate) fn number(&self, (column, row): Cell) -> u32 {
        (row as usize * self.width + column as usize) as u32
    }
    /// The cell with this number.
    #[allow(clippy::cast_possible_wrap, clippy::cast_possible_truncation, reason = "sides are below 2^16")]
    pub(crate) fn cell(&self, number: u32) -> Cell {
        let width = self.width as u32;
        ((number % width) as i32, (number / width) as i32)
    }
    /// How much larger the number of the next cell in a direction is.
    #[allow(clippy::cast_possible_wrap, clippy::cast_possible_truncation, reason = "sides are below 2^16")]
    pub(crate) fn offset(&self, (dx, dy): Cell) -> i32 {
        dy * self.width as i32 + dx
    }

    /// Which of the nine cells around a cell of the map are free, as bits, the row below first.
    #[allow(clippy::cast_sign_loss, reason = "cells within the map")]
    pub(crate) fn around(&self, (column, row): Cell) -> usize {
        let (column, row) = (column as usize, row as usize);
        let rows = &self.rows;
        rows.around(row, column) | rows.around(row + 1, column) << 3 | rows.around(row + 2, column) << 6
    }

    /// How many cells there are, free or not.
    pub(crate) const fn count(&self) -> usize {
        self.width * self.height
    }

    /// Whether a cell is free; beyond the edge none is.
    pub(crate) fn is_free(&self, (column, row): (i32, i32)) -> bool {
        let (Ok(column), Ok(row)) = (usize::try_from(column + 1), usize::try_from(row + 1)) else {
            return false;
        };
        column <= self.width + 1
            && row <= self.height + 1
            && self.rows.word(row, column / 64) >> (column % 64) & 1 == 1
    }

    /// Runs along a row, or along a column: where it is stopped first, and whether it is a place to be.
    ///
    /// `across` is the row, `from` the place in it. Stopped is a run at a cell that is not free, and at one beside which
    /// an obstacle has ended: from there a step aside may lead on.
    #[allow(clippy::cast_sign_loss, reason = "free cells are within the map")]
    pub(crate) fn run(&self, along_row: bool, across: i32, from: i32, ahead: bool) -> (i32, bool) {
        let lines = if along_row { &self.rows } else { &self.columns };
        let (place, is_free) = lines.run(across as usize, from as usize, ahead);
        // Before the first place the border stops the run; it is not free, and where exactly it is does not matter.
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_possible_wrap,
            reason = "sides are below 2^16"
        )]
        let place = place as i32;
        (place, is_free)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_maps::{Grid, Unknown};
    use axle_schema::{Metres, Pose};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn runs_are_those_of_single_steps(
            width in 1_usize..150,
            cells in proptest::collection::vec(proptest::bool::weighted(0.1), 1..600),
        ) {
            let mut cells: Vec<u8> = cells.into_iter().map(|solid| if solid { 100 } else { 0 }).collect();
            cells.resize(cells.len().div_ceil(width) * width, 0);
            let map = Grid::new("m", Metres(1.0), Pose::default(), width, cells).and_then(|grid| grid.to_data()).expect("a map");
            let terrain = Terrain::of(&map, Unknown::Blocked).expect("a map");
            let cells = Cells::new(&terrain, 0.0, &mut |_| Ok(())).expect("unwatched");
            for row in 0..cells.height as i32 {
                for column in (0..width as i32).filter(|&column| cells.is_free((column, row))) {
                    prop_assert!(!terrain.clearance().is_solid(i64::from(column), i64::from(row)));
                    for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                        let (mut x, mut y) = (column, row);
                        let expected = loop {
                            (x, y) = (x + dx, y + dy);
                            if !cells.is_free((x, y)) {
                                break None;
                            }
                            let ends = |side: i32| {
                                let (a, b) = (x + dy * side, y + dx * side);
                                cells.is_free((a, b)) && !cells.is_free((a - dx, b - dy))
                            };
                            if ends(1) || ends(-1) {
                                break Some((x, y));
                            }
                        };
                        let (place, is_free) = if dy == 0 {
                            let (place, is_free) = cells.run(true, row, column, dx > 0);
                            ((place, row), is_free)
                        } else {
                            let (place, is_free) = cells.run(false, column, row, dy > 0);
                            ((column, place), is_free)
                        };
                        prop_assert_eq!(is_free.then_some(place), expected);
                    }
                }
            }
        }
    }
}
