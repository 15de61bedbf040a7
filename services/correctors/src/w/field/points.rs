//! The paper's field: straight to the next way point, slower at both ends of the leg.

use super::Flow;
use crate::follow::Way;
use crate::w::WParams;

/// The field of the paper, III.C, with its symbols: p the robot, `p_i` the next way point.
///
/// |w| = min(v_max, √(2·|p - p_i|·a_max), √(2·|p - p_i-1|·a_max)), towards `p_i` (the paper's points away: model.md,
/// erratum 13a), and at the start of the leg at least `floor`, since nothing else would ever start there (13b).
pub(crate) fn flow(params: &WParams, way: &Way<'_>) -> Flow {
    let a = way.rules.deceleration();
    let (before, next) = way.path.ends(way.place);
    let braking = |distance: f64| (2.0 * distance * a).sqrt();
    let starting = braking(before.distance(way.pose).0).max(params.floor.0);
    // Within `arrival` the next point is driven to; a point in the middle of a path is no place to stay.
    let stopping = braking(next.distance(way.pose).0).max(params.floor.0);
    let (dx, dy) = (next.x.0 - way.pose.x.0, next.y.0 - way.pose.y.0);
    // So near the goal its direction is noise.
    let psi = if dx.hypot(dy) < params.finish.radius.0 { way.pose.heading.0 } else { dy.atan2(dx) };
    Flow { w: way.speed.min(stopping).min(starting), psi, bend: 0.0 }
}
