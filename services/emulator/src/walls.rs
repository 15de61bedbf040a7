//! The walls of a map: a robot cannot drive through them.
//!
//! The body is a circle around the middle of the axle. Where a wall is in its way the robot stands and its wheels spin:
//! encoders count on, and only the heading follows the wheels. Away from a wall it drives as ever.

use crate::params::WallsParams;
use axle_maps::{Clearance, Grid, Unknown};
use axle_schema::{MapData, Pose, Refusal, Sides};
use std::sync::Arc;

/// How finely it is found where the body meets a wall: one of so many parts of the way between two beats.
const PARTS: u32 = 10;

/// Rooms that differ by less are the same, in cells.
const HALF_CELL: f64 = 0.5;

/// What stands around the robot.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Walls {
    grid: Arc<Grid>,
    clearance: Arc<Clearance>,
    /// Radius of the body, in cells.
    body: f64,
}

impl Walls {
    /// The walls of a map; what is unknown on it stands in nobody's way.
    pub(crate) fn of(map: &MapData, params: WallsParams) -> Result<Self, Refusal> {
        let grid = Grid::of_data(map)?;
        let clearance = Clearance::of(&grid, Unknown::Free);
        let body = params.body.0 / grid.resolution.0;
        Ok(Self { grid: Arc::new(grid), clearance: Arc::new(clearance), body })
    }

    /// How much room there is around the middle of the axle, in cells, as far as that matters.
    fn room(&self, pose: Pose) -> f64 {
        let (u, v) = self.grid.in_cells(pose.x.0, pose.y.0);
        self.clearance.at(u, v, self.body + 1.0)
    }

    /// On which side of its front a wall is that keeps the robot from `wanted`: on both where it stands straight before it.
    pub(crate) fn sides(&self, at: Pose, wanted: Pose) -> Sides<bool> {
        let (ahead, aside) = (at.heading.0.cos(), at.heading.0.sin());
        // Only what is before it presses a bumper.
        if (wanted.x - at.x).0 * ahead + (wanted.y - at.y).0 * aside <= 0.0 {
            return Sides::default();
        }
        let reach = self.grid.resolution * (self.body * std::f64::consts::FRAC_1_SQRT_2);
        let room = |side: f64| {
            let (x, y) = (at.x + reach * (ahead - side * aside), at.y + reach * (aside + side * ahead));
            self.room(Pose { x, y, ..at })
        };
        let (left, right) = (room(1.0), room(-1.0));
        Sides::new(left <= right + HALF_CELL, right <= left + HALF_CELL)
    }

    /// How far the robot gets that would go from one pose to another within a beat.
    pub(crate) fn hold(&self, from: Pose, to: Pose) -> Pose {
        let (before, behind) = (self.room(from), self.room(to));
        // Who stands too near already may leave, but not come nearer.
        let least = self.body.min(before);
        if behind >= least {
            return to;
        }
        let share = |part: u32| {
            let share = f64::from(part) / f64::from(PARTS);
            Pose { x: from.x + (to.x - from.x) * share, y: from.y + (to.y - from.y) * share, ..to }
        };
        (1..PARTS).map(share).take_while(|&pose| self.room(pose) >= least).last().unwrap_or_else(|| share(0))
    }
}
