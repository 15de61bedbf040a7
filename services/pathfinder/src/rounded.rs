//! The strategy "rounded": corners become arcs (Lucas, "Rounding a Corner").
//!
//! The arc is as wide as `radius` allows, as the straight ways on both sides have room for, and as keeps it within
//! `corridor` of the corner. Its inner wheel never runs backward: where there is no room for a radius of half the track,
//! at which that wheel stands, the robot turns on the spot. A point with a heading is visited exactly.

use crate::Task;
use crate::corner::{self, Corner, Shape, Vertex};
use crate::way::Way;
use axle_schema::WayPoint;

/// Visits all points, and passes by the corners.
pub(crate) fn plan(way: &mut Way, task: &Task<'_>, points: &[(usize, WayPoint)]) {
    round(way, task, points, |corner, fit| {
        let shape = Shape::arc(corner.angle)?;
        Some((fit(&shape), shape))
    });
}

/// Rounds the corners; `choose` makes the shape of a corner that it then has fitted: its radius, and the corner.
pub(crate) fn round(
    way: &mut Way,
    task: &Task<'_>,
    points: &[(usize, WayPoint)],
    choose: impl Fn(&Corner, &dyn Fn(&Shape) -> f64) -> Option<(f64, Shape)>,
) {
    let vertices = distinct(way, task, points);
    let least = task.robot.track.get() / 2.0;
    let mut tight = 0_usize;
    corner::drive(way, &vertices, |corner| {
        let fit = |shape: &Shape| shape.radius(task.params.radius.0, corner.room, task.params.corridor.0);
        let (radius, shape) = choose(corner, &fit)?;
        if radius < least {
            tight += 1;
            return None;
        }
        Some(shape.scaled(radius))
    });
    if tight > 0 {
        way.note(format!(
            "{tight} corners have no room for an arc whose inner wheel does not run backward (radius {least:.3} m): \
             turned on the spot"
        ));
    }
}

/// The points without those that repeat the place before them; their headings are kept.
fn distinct(way: &mut Way, task: &Task<'_>, points: &[(usize, WayPoint)]) -> Vec<Vertex> {
    let mut vertices: Vec<Vertex> = Vec::with_capacity(points.len());
    let mut at = way.at();
    for &(index, point) in points {
        if point.distance(at).0 > task.params.merge.0 {
            vertices.push(Vertex { index, point, exact: false });
            (at.x, at.y) = (point.x, point.y);
        } else {
            way.repeat(index + 1, vertices.last().map(|vertex| vertex.index + 1), &point);
            match (vertices.last_mut(), point.heading) {
                (Some(last), Some(_)) => last.point.heading = point.heading,
                (None, Some(heading)) => way.turn_to(heading.0, index, &point),
                (_, None) => {}
            }
        }
    }
    vertices
}
