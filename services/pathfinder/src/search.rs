//! Searching a map cell by cell: eight neighbours, a straight step of length 1, an oblique one of √2 that cuts no corner.
//!
//! [`jump`] finds a shortest way. It is jump point search (D. Harabor and A. Grastien, "Online Graph Pruning for
//! Pathfinding on Grid Maps", 2011; without cutting corners as in "Improving Jump Point Search", 2014): of all shortest
//! ways that differ only in the order of their steps it looks at one, and runs along rows and columns 64 cells at a time.
//! [`weighed`] finds the cheapest way where cells cost more the nearer the next obstacle is. [`widest`] finds how wide a
//! robot could be at most, to say why there is no way.
//!
//! A search may take long on a large map. It says from time to time how far it is, and gives up when it is told to.

use crate::cells::Cells;
use axle_schema::Refusal;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::SQRT_2;

mod weighed;

pub(crate) use weighed::{Toll, weighed};

/// A cell: column and row.
pub(crate) type Cell = (i32, i32);

/// Hears how far a search is, 0 to 1, and may end it.
pub type Watch<'a> = &'a mut dyn FnMut(f64) -> Result<(), Refusal>;

/// So many cells are looked at between two words.
const PACE: u32 = 1024;
/// The same for a cell from which runs go in all directions, across the whole map where nothing stands.
const JUMPS: u32 = 16;

/// The eight directions, the straight ones first.
const DIRECTIONS: [Cell; 8] = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)];

/// The length of the shortest way between two cells where nothing is in between.
pub(crate) fn octile(a: Cell, b: Cell) -> f64 {
    let (dx, dy) = (f64::from((a.0 - b.0).abs()), f64::from((a.1 - b.1).abs()));
    dx.max(dy) + (SQRT_2 - 1.0) * dx.min(dy)
}

/// The mark of a cell that was looked at: its best way is known. Numbers of cells are below 2^24.
const DONE: u32 = 1 << 31;

/// What a search knows of every cell.
struct Known<'a> {
    cells: &'a Cells,
    /// The length of the best way to a cell so far; 0 where there is none, but at the start.
    lengths: Vec<f64>,
    /// The cell before it on this way, as its number, and whether it is [`DONE`]: what is read together lies together.
    before: Vec<u32>,
    /// Cells to look at: what the way over them costs at least, as the bits of that number, which are in its order.
    open: BinaryHeap<Reverse<(u64, u32)>>,
    looked: u32,
}

impl<'a> Known<'a> {
    fn new(cells: &'a Cells) -> Self {
        let count = cells.count();
        Self { cells, lengths: vec![0.0; count], before: vec![0; count], open: BinaryHeap::new(), looked: 0 }
    }
    /// Takes a way to a cell, if it is better than what is known; `rest` is what the way from there costs at least.
    fn reach(&mut self, cell: Cell, from: u32, length: f64, rest: f64) {
        let number = self.cells.number(cell);
        let place = number as usize;
        let (Some(known), Some(before)) = (self.lengths.get_mut(place), self.before.get_mut(place)) else {
            return;
        };
        if *before & DONE != 0 {
            return;
        }
        // A way that is better by rounding alone is none.
        if *known > 0.0 && length >= *known - 1e-12 {
            return;
        }
        *known = length;
        *before = from;
        self.open.push(Reverse(((length + rest).to_bits(), number)));
    }

    /// The next cell to look at, with the least cost; none when all are done.
    fn next(&mut self, watch: Watch<'_>, fraction: impl Fn(Cell) -> f64) -> Result<Option<u32>, Refusal> {
        while let Some(Reverse((_, number))) = self.open.pop() {
            let Some(before) = self.before.get_mut(number as usize) else { continue };
            if *before & DONE != 0 {
                continue;
            }
            *before |= DONE;
            self.looked += 1;
            if self.looked.is_multiple_of(JUMPS) {
                watch(fraction(self.cells.cell(number)))?;
            }
            return Ok(Some(number));
        }
        Ok(None)
    }

    /// The cell before this one on its best way.
    fn before(&self, number: u32) -> Option<u32> {
        self.before.get(number as usize).map(|before| before & !DONE)
    }

    fn length(&self, number: u32) -> f64 {
        self.lengths.get(number as usize).copied().unwrap_or(0.0)
    }

    /// The way from the start to a cell, both among its cells.
    fn way(&self, start: Cell, goal: Cell) -> Vec<Cell> {
        let (first, mut at) = (self.cells.number(start), self.cells.number(goal));
        let mut way = vec![goal];
        while at != first {
            at = self.before(at).unwrap_or(first);
            way.push(self.cells.cell(at));
        }
        way.reverse();
        way
    }
}

/// How much of the way to the goal has been found, by the cell that is nearest to it.
fn progress(start: Cell, goal: Cell) -> impl Fn(Cell) -> f64 {
    let whole = octile(start, goal).max(1.0);
    move |cell| (1.0 - octile(cell, goal) / whole).clamp(0.0, 1.0)
}

/// A shortest way over free cells and its length in cells; the cells are those where it may turn. None if there is none.
///
/// # Errors
/// What `watch` ends it with.
pub(crate) fn jump(
    cells: &Cells,
    start: Cell,
    goal: Cell,
    watch: Watch<'_>,
) -> Result<Option<(f64, Vec<Cell>)>, Refusal> {
    if !(cells.is_free(start) && cells.is_free(goal)) {
        return Ok(None);
    }
    if start == goal {
        return Ok(Some((0.0, vec![start])));
    }
    let mut known = Known::new(cells);
    let first = cells.number(start);
    if let Some(before) = known.before.get_mut(first as usize) {
        *before |= DONE;
    }
    let fraction = progress(start, goal);
    for direction in DIRECTIONS {
        jump_on(&mut known, (start, first), direction, goal);
    }
    while let Some(number) = known.next(watch, &fraction)? {
        let cell = cells.cell(number);
        if cell == goal {
            return Ok(Some((known.length(number), known.way(start, goal))));
        }
        let from = cells.cell(known.before(number).unwrap_or(first));
        let (dx, dy) = ((cell.0 - from.0).signum(), (cell.1 - from.1).signum());
        if dx != 0 && dy != 0 {
            for direction in [(dx, 0), (0, dy), (dx, dy)] {
                jump_on(&mut known, (cell, number), direction, goal);
            }
        } else {
            jump_on(&mut known, (cell, number), (dx, dy), goal);
            for (sx, sy) in [(dy, dx), (-dy, -dx)] {
                // Aside only where an obstacle has just ended: otherwise there was a way there already.
                let aside = (cell.0 + sx, cell.1 + sy);
                if cells.is_free(aside) && !cells.is_free((aside.0 - dx, aside.1 - dy)) {
                    jump_on(&mut known, (cell, number), (sx, sy), goal);
                    jump_on(&mut known, (cell, number), (dx + sx, dy + sy), goal);
                }
            }
        }
    }
    Ok(None)
}

/// Runs from a cell in a direction to the next one from which a way may lead elsewhere.
fn jump_on(known: &mut Known<'_>, (cell, number): (Cell, u32), (dx, dy): Cell, goal: Cell) {
    let found = if dx != 0 && dy != 0 {
        oblique(known.cells, cell, (dx, dy), goal)
    } else {
        straight(known.cells, cell, (dx, dy), goal)
    };
    if let Some(place) = found {
        let length = known.length(number) + octile(cell, place);
        known.reach(place, number, length, octile(place, goal));
    }
}

fn straight(cells: &Cells, (x, y): Cell, (dx, _dy): Cell, goal: Cell) -> Option<Cell> {
    let along_row = dx != 0;
    let ahead = if along_row { dx > 0 } else { _dy > 0 };
    let (across, from, goal_across, goal_along) =
        if along_row { (y, x, goal.1, goal.0) } else { (x, y, goal.0, goal.1) };
    let (place, is_free) = cells.run(along_row, across, from, ahead);
    let passes = if ahead {
        from < goal_along && goal_along <= place
    } else {
        place <= goal_along && goal_along < from
    };
    if goal_across == across && passes {
        return Some(goal);
    }
    let found = if along_row { (place, across) } else { (across, place) };
    is_free.then_some(found)
}

fn oblique(cells: &Cells, (mut x, mut y): Cell, (dx, dy): Cell, goal: Cell) -> Option<Cell> {
    loop {
        if !(cells.is_free((x + dx, y)) && cells.is_free((x, y + dy)) && cells.is_free((x + dx, y + dy))) {
            return None;
        }
        (x, y) = (x + dx, y + dy);
        if (x, y) == goal
            || straight(cells, (x, y), (dx, 0), goal).is_some()
            || straight(cells, (x, y), (0, dy), goal).is_some()
        {
            return Some((x, y));
        }
    }
}

/// The way from start to goal that is widest where it is narrowest: this width, to the nearest obstacle, and the cell
/// where it is. 0 where no way leads to the goal at all.
///
/// # Errors
/// What `watch` ends it with.
pub(crate) fn widest(
    (width, height): (usize, usize),
    distance: impl Fn(Cell) -> f64,
    start: Cell,
    goal: Cell,
    watch: Watch<'_>,
) -> Result<(f64, Cell), Refusal> {
    #[allow(clippy::cast_sign_loss, reason = "cells within the map")]
    let number = |(column, row): Cell| row as usize * width + column as usize;
    let mut reached = vec![false; width * height];
    // The width of the way so far, the widest first, and where it was narrowest.
    let mut open = BinaryHeap::new();
    let own = distance(start);
    open.push((own.to_bits(), start, start));
    let mut looked = 0_u32;
    while let Some((bits, cell, narrow)) = open.pop() {
        let wide = f64::from_bits(bits);
        if cell == goal {
            return Ok((wide, narrow));
        }
        match reached.get_mut(number(cell)) {
            Some(reached) if !*reached => *reached = true,
            _ => continue,
        }
        looked += 1;
        if looked.is_multiple_of(PACE) {
            watch(1.0)?;
        }
        // Steps aside only: an oblique one cuts a corner unless two of these lead there as well.
        for (dx, dy) in DIRECTIONS.into_iter().take(4) {
            let next = (cell.0 + dx, cell.1 + dy);
            let is_inside = usize::try_from(next.0).is_ok_and(|column| column < width)
                && usize::try_from(next.1).is_ok_and(|row| row < height);
            if !is_inside || reached.get(number(next)).copied().unwrap_or(true) {
                continue;
            }
            let here = distance(next);
            if here > 0.0 {
                open.push(if here < wide { (here.to_bits(), next, next) } else { (bits, next, narrow) });
            }
        }
    }
    Ok((0.0, start))
}

#[cfg(test)]
mod tests;
