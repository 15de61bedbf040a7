//! The strategy "map": around the obstacles of a map.
//!
//! The map is searched cell by cell, where the robot has room with its `margin`, or, if there is no such way, without it.
//! The way that is found is shortened: wherever a straight line to a later cell has room and costs no more, it is taken,
//! so that the way bends at any angle and is never longer. The corners that the search has made are then rounded, as far
//! as there is room; the way points of the question are visited exactly.
//!
//! What cannot be reached is refused with the reason: where it is too narrow, and by how much.

use crate::Task;
use crate::cells::Cells;
use crate::corner::{self, Corner, Rounded, Shape, Vertex};
use crate::search::{self, Cell, Toll, Watch};
use crate::terrain::{Place, Terrain};
use crate::way::Way;
use axle_schema::{Geometry, Leg, Metres, Pose, Refusal, WayPoint};

/// The least radius of a corner that the search has made, in m; a tighter one is turned on the spot.
const LEAST_RADIUS: f64 = 0.02;
/// How many times the radius of a corner is halved before it is given up.
const HALVINGS: u32 = 6;

/// Visits all points, around what stands in the way.
pub(crate) fn plan(
    way: &mut Way,
    task: &Task<'_>,
    terrain: &Terrain,
    points: &[(usize, WayPoint)],
    watch: Watch<'_>,
) -> Result<(), Refusal> {
    let planner = Planner::new(task, terrain, watch)?;
    for (number, &(index, point)) in points.iter().enumerate() {
        if way.sets_out(task.params.merge, index, &point) {
            #[allow(clippy::cast_precision_loss, reason = "a few thousand points")]
            let (behind, all) = (number as f64, points.len() as f64);
            let mut part = |fraction: f64| watch((behind + fraction) / all);
            let found = planner.find(way.at(), index, &point, &mut part)?;
            if found.is_tight {
                let margin = task.params.margin;
                way.note(format!("the way to point {} leaves no margin of {margin} everywhere", index + 1));
            }
            let vertices: Vec<Vertex> = found
                .places
                .iter()
                .map(|&(u, v)| {
                    let (x, y) = terrain.grid().in_metres(u, v);
                    WayPoint { heading: None, ..WayPoint { x: Metres(x), y: Metres(y), ..point } }
                })
                .chain([point])
                .map(|point| Vertex { index, point, exact: false })
                .collect();
            corner::drive(way, &vertices, |corner| planner.round(corner));
        } else if let Some(heading) = point.heading {
            way.turn_to(heading.0, index, &point);
        }
    }
    Ok(())
}

/// The distances in metres between all points on the map, the start first, for an order of them.
pub(crate) fn distances(
    task: &Task<'_>,
    terrain: &Terrain,
    start: Pose,
    points: &[(usize, WayPoint)],
    watch: Watch<'_>,
) -> Result<Vec<Vec<f64>>, Refusal> {
    let planner = Planner::new(task, terrain, watch)?;
    let mut cells = vec![planner.end(start.x, start.y, "the start")?.cell];
    for (index, point) in points {
        cells.push(planner.end(point.x, point.y, &format!("way point {}", index + 1))?.cell);
    }
    let mut table = vec![vec![0.0; cells.len()]; cells.len()];
    for (row, &from) in cells.iter().enumerate() {
        for (column, &to) in cells.iter().enumerate().skip(row + 1) {
            let found = search::jump(&planner.tight, from, to, watch)?;
            let length = found.map_or(f64::INFINITY, |(length, _)| terrain.metres(length).0);
            for (a, b) in [(row, column), (column, row)] {
                if let Some(place) = table.get_mut(a).and_then(|row| row.get_mut(b)) {
                    *place = length;
                }
            }
        }
    }
    Ok(table)
}

/// What a way on a map needs, all of it in cells.
struct Planner<'a> {
    task: &'a Task<'a>,
    terrain: &'a Terrain,
    /// The room that the robot needs, and that it needs with its margin.
    room: f64,
    wish: f64,
    /// Where it has room, without and with its margin.
    tight: Cells,
    wide: Cells,
    /// What it costs to come near to an obstacle.
    toll: Toll<'a>,
}

/// A way that was found.
struct Found {
    /// Where it bends, without its ends.
    places: Vec<Place>,
    /// Whether it is too narrow for the margin somewhere.
    is_tight: bool,
}

/// An end of the way: where it is, and the free cell from which it is reached straight.
struct End {
    place: Place,
    cell: Cell,
}

/// The middle of a cell.
fn middle((column, row): Cell) -> Place {
    (f64::from(column) + 0.5, f64::from(row) + 0.5)
}

impl<'a> Planner<'a> {
    fn new(task: &'a Task<'_>, terrain: &'a Terrain, watch: Watch<'_>) -> Result<Self, Refusal> {
        let room = terrain.cells(task.body);
        let wish = terrain.cells(task.body + task.params.margin);
        let (tight, wide) = (Cells::new(terrain, room, watch)?, Cells::new(terrain, wish, watch)?);
        let toll = Toll {
            distances: terrain.clearance().distances(),
            room,
            comfort: terrain.cells(task.params.comfort),
            weight: task.params.clearance_weight,
        };
        Ok(Self { task, terrain, room, wish, tight, wide, toll })
    }

    fn find(&self, from: Pose, index: usize, point: &WayPoint, watch: Watch<'_>) -> Result<Found, Refusal> {
        let start = self.end(from.x, from.y, "the start")?;
        let goal = self.end(point.x, point.y, &format!("way point {}", index + 1))?;
        for (cells, room, is_tight) in [(&self.wide, self.wish, false), (&self.tight, self.room, true)] {
            // With the margin both ends must have it as well.
            let way = if self.task.params.clearance_weight > 0.0 {
                search::weighed(cells, start.cell, goal.cell, &self.toll, watch)?
            } else {
                search::jump(cells, start.cell, goal.cell, watch)?
            };
            if let Some((_, cells)) = way {
                let places = self.shortened(&start, &goal, cells, room, watch)?;
                return Ok(Found { places, is_tight });
            }
        }
        Err(self.why(&start, &goal, index, watch)?)
    }

    /// An end of a way: it must have room itself, and a straight way with room to a free cell nearby.
    fn end(&self, x: Metres, y: Metres, name: &str) -> Result<End, Refusal> {
        let unreachable = |why: String| Refusal::Unreachable { why };
        let grid = self.terrain.grid();
        let Some(place) = self.terrain.place(x, y) else {
            let far = (self.terrain.clearance().width(), self.terrain.clearance().height());
            #[allow(clippy::cast_precision_loss, reason = "sides are below 2^16")]
            let ((x0, y0), (x1, y1)) = (grid.in_metres(0.0, 0.0), grid.in_metres(far.0 as f64, far.1 as f64));
            return Err(unreachable(format!(
                "{name} ({x}, {y}) is outside the map, which reaches from ({x0:.2}, {y0:.2}) to ({x1:.2}, {y1:.2}) m"
            )));
        };
        let wide = self.terrain.clearance().at(place.0, place.1, self.room + 1.0);
        if wide <= 0.0 {
            return Err(unreachable(format!("{name} ({x}, {y}) is inside an obstacle")));
        }
        // A point right at the limit is not too near by rounding.
        if wide < self.room - 1e-9 {
            let (has, short) = (self.terrain.metres(wide), self.terrain.metres(self.room - wide));
            return Err(unreachable(format!(
                "{name} ({x}, {y}) is too narrow by {}: an obstacle is {} away, and the robot has a radius of {}",
                centimetres(short),
                centimetres(has),
                centimetres(self.task.body)
            )));
        }
        #[allow(clippy::cast_possible_truncation, reason = "within the map")]
        let own = (place.0.floor() as i32, place.1.floor() as i32);
        let reach = 3;
        let around = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (own.0 + dx, own.1 + dy)));
        let mut around: Vec<Cell> = around.filter(|&cell| self.tight.is_free(cell)).collect();
        let far = |cell: Cell| (middle(cell).0 - place.0).hypot(middle(cell).1 - place.1);
        // A cell with margin is better than a nearer one without.
        let rank = |cell: &Cell| (!self.wide.is_free(*cell), far(*cell));
        around.sort_by(|a, b| rank(a).0.cmp(&rank(b).0).then(rank(a).1.total_cmp(&rank(b).1)));
        let cell = around.into_iter().find(|&cell| self.terrain.is_wide(place, middle(cell), self.room));
        let cell = cell.ok_or_else(|| {
            unreachable(format!("{name} ({x}, {y}) is in a corner that the robot fits into and cannot leave"))
        })?;
        Ok(End { place, cell })
    }

    /// What a place costs beyond the length, by how close the next obstacle is to the middle of its cell.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "places are within the map")]
    fn price(&self, place: Place) -> f64 {
        self.toll.price(place.1 as usize * self.terrain.clearance().width() + place.0 as usize)
    }

    /// What a straight line costs, its length among it.
    fn cost(&self, a: Place, b: Place) -> f64 {
        let length = (b.0 - a.0).hypot(b.1 - a.1);
        if self.task.params.clearance_weight <= 0.0 {
            return length;
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most the map's diagonal"
        )]
        let parts = length.ceil().max(1.0) as u32;
        let prices = (0..parts).map(|part| {
            let share = (f64::from(part) + 0.5) / f64::from(parts);
            self.price((a.0 + (b.0 - a.0) * share, a.1 + (b.1 - a.1) * share))
        });
        length * (1.0 + prices.sum::<f64>() / f64::from(parts))
    }

    /// The way in fewer and longer lines, none of which costs more than what it replaces.
    fn shortened(
        &self,
        start: &End,
        goal: &End,
        cells: Vec<Cell>,
        room: f64,
        watch: Watch<'_>,
    ) -> Result<Vec<Place>, Refusal> {
        let mut places = vec![start.place];
        places.extend(cells.into_iter().map(middle));
        places.push(goal.place);
        places.dedup();
        // Once in each direction: what bends late is bent early, and the other way round.
        for _ in 0..2 {
            places = self.pulled(&places, room, watch)?;
            places.reverse();
        }
        let end = places.len().saturating_sub(1);
        Ok(places.get(1..end).unwrap_or_default().to_vec())
    }

    /// From each place on to the farthest one that a straight line reaches as cheaply.
    #[allow(clippy::indexing_slicing, reason = "places are counted here")]
    fn pulled(&self, places: &[Place], room: f64, watch: Watch<'_>) -> Result<Vec<Place>, Refusal> {
        // What the way costs up to each place.
        let mut costs = Vec::with_capacity(places.len());
        let mut sum = 0.0;
        for (index, &place) in places.iter().enumerate() {
            sum += index.checked_sub(1).map_or(0.0, |before| self.cost(places[before], place));
            costs.push(sum);
        }
        let mut pulled = Vec::new();
        let mut at = 0;
        while let Some(&place) = places.get(at) {
            pulled.push(place);
            let mut reaches = |to: usize| {
                // The way is known; from here on it only becomes shorter.
                watch(1.0)?;
                Ok(self.cost(place, places[to]) <= costs[to] - costs[at] + 1e-9
                    && self.terrain.is_wide(place, places[to], self.room_between(place, places[to], room)))
            };
            // Twice as far until it fails, then back by halves: most ways see far or not at all.
            let (mut good, mut stride) = (at + 1, 1);
            while good + stride < places.len() && reaches(good + stride)? {
                good += stride;
                stride *= 2;
            }
            while stride > 0 {
                if good + stride < places.len() && reaches(good + stride)? {
                    good += stride;
                }
                stride /= 2;
            }
            at = good;
        }
        Ok(pulled)
    }

    /// The ends of a way need no margin, or the robot could not leave a narrow place.
    fn room_between(&self, a: Place, b: Place, room: f64) -> f64 {
        let wide = |place: Place| self.terrain.clearance().at(place.0, place.1, room + 0.1);
        room.min(wide(a)).min(wide(b)).max(self.room)
    }

    /// The widest arc round a corner that has room.
    fn round(&self, corner: &Corner) -> Option<Rounded> {
        let shape = Shape::arc(corner.angle)?;
        let mut radius = shape.radius(self.task.params.radius.0, corner.room, self.task.params.corridor.0);
        for _ in 0..HALVINGS {
            if radius < LEAST_RADIUS {
                return None;
            }
            let rounded = shape.scaled(radius);
            let begin = corner.at.moved(Metres(-rounded.tangent), Metres::ZERO, axle_schema::Radians::ZERO);
            let mut at = begin;
            let fits = rounded.arcs.iter().all(|&arc| {
                let from = at;
                at = arc.end_from(from);
                follow(self.terrain, from, arc, self.room).is_ok()
            });
            if fits {
                return Some(rounded);
            }
            radius /= 2.0;
        }
        None
    }

    /// Why there is no way.
    fn why(&self, start: &End, goal: &End, index: usize, watch: Watch<'_>) -> Result<Refusal, Refusal> {
        let clearance = self.terrain.clearance();
        let size = (clearance.width(), clearance.height());
        let distance = |cell: Cell| {
            let (u, v) = middle(cell);
            clearance.at(u, v, 0.0)
        };
        let (wide, narrow) = search::widest(size, distance, start.cell, goal.cell, watch)?;
        let (u, v) = middle(narrow);
        let (x, y) = self.terrain.grid().in_metres(u, v);
        let number = index + 1;
        let needs = self.task.body;
        let why = if wide <= 0.0 {
            format!("no way leads to point {number}, however small the robot: it is walled in")
        } else {
            // Where the body just fits, the search still wants what its steps from cell to cell may lose.
            let short = if wide < self.room { self.room - wide } else { Cells::needed(self.room) - wide };
            format!(
                "the way to point {number} is too narrow by {} at ({x:.2}, {y:.2}) m: the nearest obstacle is {} from \
                 its middle, and the robot has a radius of {}",
                centimetres(self.terrain.metres(short.max(0.0))),
                centimetres(self.terrain.metres(wide)),
                centimetres(needs)
            )
        };
        Ok(Refusal::Unreachable { why })
    }
}

/// A length as people say it.
fn centimetres(length: Metres) -> String {
    format!("{:.1} cm", length.0 * 100.0)
}

/// Whether a leg has room everywhere; else where it has not, and how wide it is there, in cells.
pub(crate) fn follow(
    terrain: &Terrain,
    from: Pose,
    geometry: Geometry,
    room: f64,
) -> Result<(), (Place, f64)> {
    let (length, at) = along(terrain, from, geometry);
    terrain.follow(length, room, at)
}

/// The length of a leg in cells, and the place so many cells along it.
fn along(terrain: &Terrain, from: Pose, geometry: Geometry) -> (f64, impl Fn(f64) -> Place + '_) {
    let whole = geometry.length().0;
    let at = move |gone: f64| {
        let share = if whole > 0.0 { terrain.metres(gone).0 / whole } else { 0.0 };
        let part = match geometry {
            Geometry::Line { length } => Geometry::Line { length: length * share },
            Geometry::Turn { angle } => Geometry::Turn { angle: angle * share },
            Geometry::Arc { radius, angle } => Geometry::Arc { radius, angle: angle * share },
        };
        let pose = part.end_from(from);
        terrain.grid().in_cells(pose.x.0, pose.y.0)
    };
    (terrain.cells(geometry.length()), at)
}

/// How much room is left beside the robot where its way is narrowest.
///
/// # Errors
/// Refuses a way that an obstacle stands in, with the leg and the place; and what `watch` ends it with.
pub(crate) fn clearance(
    terrain: &Terrain,
    start: Pose,
    legs: &[Leg],
    body: Metres,
    watch: Watch<'_>,
) -> Result<Metres, Refusal> {
    // Beyond 10 m nobody cares, and the search would be long.
    let mut least = terrain.cells(Metres(10.0) + body);
    let mut at = start;
    for (index, leg) in legs.iter().enumerate() {
        let (length, path) = along(terrain, at, leg.geometry);
        let (wide, (u, v)) = terrain.narrowest(length, least, path, watch)?;
        // What the search has allowed may be narrower by rounding.
        if wide <= 0.0 || terrain.metres(wide).0 < body.0 - 1e-4 {
            let (x, y) = terrain.grid().in_metres(u, v);
            let what = if wide > 0.0 {
                format!("comes within {} of an obstacle", centimetres(terrain.metres(wide)))
            } else {
                "leads through an obstacle or out of the map".to_owned()
            };
            let why = format!(
                "leg {} to point {} {what} at ({x:.2}, {y:.2}) m, and the robot has a radius of {}; the strategy map \
                 goes around",
                index + 1,
                leg.point + 1,
                centimetres(body)
            );
            return Err(Refusal::Unreachable { why });
        }
        least = wide;
        at = leg.geometry.end_from(at);
    }
    Ok(Metres((terrain.metres(least) - body).0.max(0.0)))
}

#[cfg(test)]
mod tests;
