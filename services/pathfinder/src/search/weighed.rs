//! The cheapest way where cells cost more the nearer the next obstacle is: A*, cell by cell.
//!
//! Costs are not whole numbers, so cells to look at wait in buckets, each for a span of costs, and those of one
//! bucket in any order (R. B. Dial, "Algorithm 360: Shortest-Path Forest with Topological Ordering", 1969). A cell to
//! which a better way is found later is looked at again, so that the way is the cheapest all the same, and no heap has
//! to be kept.
//!
//! Far from obstacles all cells cost the same. There only those neighbours are looked at that jump point search would
//! look at (see [`super::jump`]). This loses nothing: to a neighbour that is left out leads another way that is no
//! dearer, either a shorter one, or one as long whose oblique step is the first and whose straight one is the last.
//! Its last step is never left out for a way that is as long.

use super::{Cell, DIRECTIONS, PACE, Watch, octile, progress};
use crate::cells::Cells;
use axle_schema::Refusal;
use std::f64::consts::SQRT_2;

/// What the cells of a way cost beyond its length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Toll<'a> {
    /// From the middle of each cell to the nearest obstacle, in cells, row by row.
    pub(crate) distances: &'a [f32],
    /// Up to here the distance belongs to the robot, in cells.
    pub(crate) room: f64,
    /// So far beside the robot an obstacle costs something, in cells.
    pub(crate) comfort: f64,
    /// What a cell costs right at an obstacle, in lengths of way; 0 or more.
    pub(crate) weight: f64,
}

impl Toll<'_> {
    /// What a cell costs beyond its length.
    pub(crate) fn price(&self, number: usize) -> f64 {
        let wide = self.distances.get(number).map_or(0.0, |&wide| f64::from(wide)) - self.room;
        if wide < self.comfort { self.weight * (1.0 - wide.max(0.0) / self.comfort) } else { 0.0 }
    }
}

/// The span of costs that one bucket is for, in cells. A smaller one leaves more buckets empty, a larger one looks at
/// more cells twice.
const SPAN: f64 = 0.1;

/// A direction that is none: the start was reached from nowhere.
const NOWHERE: u8 = 8;
/// The mark of a cell that waits in a bucket.
const WAITS: u8 = 1 << 7;

/// Cells to look at, by what the way over them costs at least. A step costs no more than the ring of buckets spans.
struct Buckets {
    ring: Vec<Vec<(u16, u16)>>,
    current: u64,
    count: usize,
}

impl Buckets {
    /// For steps that cost `dearest` at most, beginning at a cost of `least`.
    fn new(dearest: f64, least: f64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below a thousand")]
        let buckets = ((dearest / SPAN).ceil() as usize + 2).next_power_of_two();
        Self { ring: vec![Vec::new(); buckets], current: Self::bucket(least), count: 0 }
    }
    fn bucket(cost: f64) -> u64 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 2^24 · 102 / SPAN")]
        let bucket = (cost * (1.0 / SPAN)) as u64;
        bucket
    }
    fn slot(&mut self, bucket: u64) -> Option<&mut Vec<(u16, u16)>> {
        #[allow(clippy::cast_possible_truncation, reason = "the ring is small")]
        let slot = bucket as usize & (self.ring.len() - 1);
        self.ring.get_mut(slot)
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "sides are below 2^16")]
    fn push(&mut self, (column, row): Cell, cost: f64) {
        // By rounding a cost may be smaller than the one before it.
        let bucket = Self::bucket(cost).max(self.current);
        if let Some(slot) = self.slot(bucket) {
            slot.push((column as u16, row as u16));
            self.count += 1;
        }
    }
    /// One of the cheapest cells.
    fn pop(&mut self) -> Option<Cell> {
        while self.count > 0 {
            let current = self.current;
            if let Some((column, row)) = self.slot(current).and_then(Vec::pop) {
                self.count -= 1;
                return Some((i32::from(column), i32::from(row)));
            }
            self.current += 1;
        }
        None
    }
}

/// What the search knows of the cells.
struct Known {
    /// What the best way to a cell costs so far; 0 where there is none. Zeroed memory is not touched before it is used.
    costs: Vec<f64>,
    /// The direction of its last step, and whether it [`WAITS`].
    steps: Vec<u8>,
}

impl Known {
    #[inline]
    fn get(&self, place: usize) -> (f64, u8) {
        (self.costs.get(place).copied().unwrap_or(0.0), self.steps.get(place).copied().unwrap_or(0))
    }
    #[inline]
    fn set(&mut self, place: usize, cost: f64, step: u8) {
        if let (Some(old), Some(its)) = (self.costs.get_mut(place), self.steps.get_mut(place)) {
            (*old, *its) = (cost, step);
        }
    }
    /// The way from the first cell to the last, both among its cells.
    fn way(&self, cells: &Cells, first: u32, last: u32) -> Vec<Cell> {
        let mut at = last;
        let mut way = vec![cells.cell(last)];
        while at != first {
            let (_, step) = self.get(at as usize);
            let Some(&direction) = DIRECTIONS.get(usize::from(step & !WAITS)) else { break };
            at = at.wrapping_add_signed(-cells.offset(direction));
            way.push(cells.cell(at));
        }
        way.reverse();
        way
    }
}

/// The directions in which a free way leads from a cell, by the bits of its nine cells: row below, own row, row above.
const OPEN: [u8; 512] = {
    let mut open = [0; 512];
    let mut around = 0;
    while around < 512 {
        let (below, own, above) = (around & 7, around >> 3 & 7, around >> 6);
        let (east, north, west, south) = (own >> 2 & 1, above >> 1 & 1, own & 1, below >> 1 & 1);
        // In the order of DIRECTIONS; an oblique step needs both cells beside it.
        #[allow(clippy::indexing_slicing, clippy::cast_possible_truncation, reason = "below 512, and bits")]
        {
            open[around] = (east
                | north << 1
                | west << 2
                | south << 3
                | (above >> 2 & east & north) << 4
                | (above & west & north) << 5
                | (below & west & south) << 6
                | (below >> 2 & east & south) << 7) as u8;
        }
        around += 1;
    }
    open
};

/// The directions that go on from a step where nothing stands around and all costs the same.
const NATURAL: [u8; 9] =
    [1, 1 << 1, 1 << 2, 1 << 3, 0b0001_0011, 0b0010_0110, 0b0100_1100, 0b1000_1001, 0xff];

/// A step in one of the [`DIRECTIONS`].
#[derive(Clone, Copy)]
struct Step {
    to: Cell,
    /// How much larger the number of the cell is that it leads to.
    offset: i32,
    length: f64,
}

/// The cheapest way over free cells and what it costs: a step costs its length times `1 + price` of the cell that it
/// leads to. All cells of the way are given. None if there is none.
///
/// # Errors
/// What `watch` ends it with.
pub(crate) fn weighed(
    cells: &Cells,
    start: Cell,
    goal: Cell,
    toll: &Toll<'_>,
    watch: Watch<'_>,
) -> Result<Option<(f64, Vec<Cell>)>, Refusal> {
    if !(cells.is_free(start) && cells.is_free(goal)) {
        return Ok(None);
    }
    if start == goal {
        return Ok(Some((0.0, vec![start])));
    }
    let (first, last) = (cells.number(start), cells.number(goal));
    let mut known = Known { costs: vec![0.0; cells.count()], steps: vec![0; cells.count()] };
    // A step away from the goal brings the rest to grow by its length as well.
    let mut open = Buckets::new(SQRT_2 * (2.0 + toll.weight), octile(start, goal));
    // Next to nothing, since 0 means that no way is known.
    known.set(first as usize, f64::MIN_POSITIVE, NOWHERE | WAITS);
    open.push(start, octile(start, goal));
    let steps = DIRECTIONS.map(|to| Step {
        to,
        offset: cells.offset(to),
        length: if to.0 != 0 && to.1 != 0 { SQRT_2 } else { 1.0 },
    });
    // From here on the nine cells around a middle are free and cost nothing: a neighbour is at most √2 nearer.
    let calm = (toll.room + toll.comfort).max(cells.least()) + SQRT_2 + 1e-3;
    let fraction = progress(start, goal);
    let mut best = f64::INFINITY;
    let mut looked = 0_u32;
    while let Some(cell) = open.pop() {
        let number = cells.number(cell);
        let place = number as usize;
        let (cost, step) = known.get(place);
        if step & WAITS == 0 {
            continue;
        }
        known.set(place, cost, step & !WAITS);
        looked += 1;
        if looked.is_multiple_of(PACE) {
            watch(fraction(cell))?;
        }
        if cost + octile(cell, goal) >= best {
            // What waits in later buckets is no better either.
            if open.current > Buckets::bucket(best) {
                break;
            }
            continue;
        }
        let is_calm = toll.distances.get(place).is_some_and(|&distance| f64::from(distance) >= calm);
        let ways =
            if is_calm { NATURAL.get(usize::from(step & !WAITS)) } else { OPEN.get(cells.around(cell)) };
        let mut ways = ways.copied().unwrap_or(0);
        while let Some(step) = steps.get(ways.trailing_zeros() as usize) {
            #[allow(clippy::cast_possible_truncation, reason = "below 8")]
            let direction = ways.trailing_zeros() as u8;
            ways &= ways - 1;
            let next = number.wrapping_add_signed(step.offset) as usize;
            let so_far = known.costs.get(next).copied().unwrap_or(0.0);
            // A way that is better by rounding alone is none. Most neighbours are reached more cheaply already,
            // whatever the price is.
            let limit = if so_far > 0.0 { so_far - 1e-12 } else { f64::INFINITY };
            if cost + step.length >= limit {
                continue;
            }
            let new = cost + step.length * (1.0 + toll.price(next));
            let to = (cell.0 + step.to.0, cell.1 + step.to.1);
            let whole = new + octile(to, goal);
            if new >= limit || whole >= best {
                continue;
            }
            if next == last as usize {
                best = new;
            }
            known.set(next, new, direction | WAITS);
            open.push(to, whole);
        }
    }
    Ok(best.is_finite().then(|| (best, known.way(cells, first, last))))
}
