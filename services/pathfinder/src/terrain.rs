//! A map made ready for planning: where the middle of the axle may be.

use crate::search::Watch;
use axle_maps::{Clearance, Grid, Unknown};
use axle_schema::{MapData, Metres, Refusal};

/// A map, and the distances to its obstacles.
#[derive(Clone, Debug)]
pub struct Terrain {
    grid: Grid,
    clearance: Clearance,
    content: u64,
}

/// A place in cells from the origin of a map.
pub(crate) type Place = (f64, f64);

/// So many places of a way are looked at between two looks at whether anybody still waits.
const PACE: u32 = 256;

/// The room that any way has, in cells.
const LEAST_ROOM: f64 = 0.05;

/// How far one may go where it is `wide`, so that in between it is narrower by 1/400 of a cell at most: by Stewart's
/// theorem the square of the distance is smaller by at most a quarter of the square of the step.
fn step(wide: f64) -> f64 {
    (0.02 * wide.max(0.5)).sqrt()
}

impl Terrain {
    /// Makes a map ready; takes a time that grows with its cells.
    ///
    /// # Errors
    /// Refuses what is no map.
    pub fn of(map: &MapData, unknown: Unknown) -> Result<Self, Refusal> {
        Self::watched(map, unknown, &mut |_| Ok(()))
    }

    /// The same, which `watch` may end: a map of 2^24 cells takes most of a second, and a question may be shorter.
    ///
    /// # Errors
    /// Refuses what is no map, and what `watch` ends it with.
    pub fn watched(map: &MapData, unknown: Unknown, watch: Watch<'_>) -> Result<Self, Refusal> {
        watch(0.0)?;
        let grid = Grid::of_data(map)?;
        let clearance = Clearance::watched(&grid, unknown, || watch(0.0))?;
        Ok(Self { grid, clearance, content: map.content })
    }

    /// What the map says it contains.
    #[must_use]
    pub const fn content(&self) -> u64 {
        self.content
    }
    pub(crate) const fn grid(&self) -> &Grid {
        &self.grid
    }
    pub(crate) const fn clearance(&self) -> &Clearance {
        &self.clearance
    }

    /// So many metres in cells.
    pub(crate) fn cells(&self, length: Metres) -> f64 {
        length.0 / self.grid.resolution.0
    }
    /// So many cells in metres.
    pub(crate) fn metres(&self, cells: f64) -> Metres {
        self.grid.resolution * cells
    }
    /// A point of the plane in cells; none outside the map.
    pub(crate) fn place(&self, x: Metres, y: Metres) -> Option<Place> {
        let (u, v) = self.grid.in_cells(x.0, y.0);
        #[allow(clippy::cast_precision_loss, reason = "sides are below 2^16")]
        let (width, height) = (self.grid.width() as f64, self.grid.height() as f64);
        ((0.0..width).contains(&u) && (0.0..height).contains(&v)).then_some((u, v))
    }

    /// Whether every point of the line from `a` to `b` is at least `room` cells from the nearest obstacle.
    ///
    /// It goes along the line in steps that cannot jump over an obstacle: the distance changes at most by as much as
    /// one moves. Where it is narrow the steps are small beside the room, so that between two of them it is hardly
    /// narrower.
    pub(crate) fn is_wide(&self, a: Place, b: Place, room: f64) -> bool {
        let length = (b.0 - a.0).hypot(b.1 - a.1);
        self.follow(length, room, |gone| {
            let share = if length > 0.0 { gone / length } else { 0.0 };
            (a.0 + (b.0 - a.0) * share, a.1 + (b.1 - a.1) * share)
        })
        .is_ok()
    }

    /// The same along any path, by the length along it; what is narrow, and how wide it is there.
    pub(crate) fn follow(
        &self,
        length: f64,
        room: f64,
        path: impl Fn(f64) -> Place,
    ) -> Result<(), (Place, f64)> {
        // Even a robot without a body does not touch an obstacle.
        let room = room.max(LEAST_ROOM);
        let least_step = if room < 0.5 { LEAST_ROOM / 2.0 } else { step(room) };
        let mut gone = 0.0;
        loop {
            let place = path(gone);
            let wide = self.clearance.at(place.0, place.1, room + 1.0);
            if wide < room - 1e-9 {
                return Err((place, wide));
            }
            if gone >= length {
                return Ok(());
            }
            gone = (gone + (wide - room).max(least_step)).min(length);
        }
    }

    /// The smallest distance to an obstacle along a path, in cells, as far as it is below `least`.
    ///
    /// # Errors
    /// What `watch` ends it with.
    pub(crate) fn narrowest(
        &self,
        length: f64,
        least: f64,
        path: impl Fn(f64) -> Place,
        watch: Watch<'_>,
    ) -> Result<(f64, Place), Refusal> {
        let mut found = (least, path(0.0));
        let mut gone = 0.0;
        for look in 0_u32.. {
            if look % PACE == 0 {
                watch(1.0)?;
            }
            let place = path(gone);
            let wide = self.clearance.at(place.0, place.1, found.0);
            if wide < found.0 {
                found = (wide, place);
            }
            // Narrower than in an obstacle, or beyond the edge, it is nowhere; that way may be very long.
            if gone >= length || found.0 <= 0.0 {
                break;
            }
            gone = (gone + (wide - found.0).max(step(found.0))).min(length);
        }
        Ok(found)
    }
}
