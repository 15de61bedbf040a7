//! A field that leads onto a path and along it: the source of fields that the paper announces, geometries.
//!
//! It has the direction of the path where the robot is on it, and leads back to it the more, the farther away it is, at
//! most at a right angle (Nelson et al., "Vector field path following for miniature air vehicles", 2007).

use super::Flow;
use crate::follow::Way;
use crate::w::WParams;

/// ψ = χ - atan(k·n) for a path of direction χ, n metres to the right of the robot.
pub(crate) fn flow(params: &WParams, way: &Way<'_>) -> Flow {
    let (nearest, curvature) = way.path.ahead(way.place, 0.0);
    let n = way.place.left;
    // Beside a circle the way is shorter or longer than on it; a robot near its centre goes nowhere along it.
    let bend = curvature / (1.0 - curvature * n).max(0.5);
    Flow { w: way.speed, psi: nearest.heading.0 - (params.pull.0 * n).atan(), bend }
}
