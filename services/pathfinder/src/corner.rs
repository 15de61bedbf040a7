//! Corners of a way, rounded: the shapes, and how a line of points with corners becomes legs.
//!
//! A shape is known for a smallest radius of 1 m and grows in proportion. What limits it are the straight ways before
//! and behind the corner, how far it may stay away from the corner, and the radius that is asked for.

use crate::way::Way;
use axle_schema::{Geometry, Metres, Pose, Radians, WayPoint};

/// The most arcs that one clothoid is made of.
const MOST_STEPS: u32 = 64;
/// A corner that turns by more than this, in rad, is a way back: no arc leads round it.
const MOST_TURN: f64 = 3.1;

/// A corner that turns by an angle, with a smallest radius of 1 m.
pub(crate) struct Shape {
    arcs: Vec<Geometry>,
    /// How far before the corner it begins, and how far behind it ends, m.
    tangent: f64,
    /// How far from the corner it passes, m.
    away: f64,
}

impl Shape {
    /// One arc (Lucas, "Rounding a Corner").
    pub(crate) fn arc(angle: f64) -> Option<Self> {
        Self::of(angle, vec![Geometry::Arc { radius: Metres(angle.signum()), angle: Radians(angle) }])
    }

    /// A clothoid into the curve, an arc, and the same clothoid out of it. The clothoids turn by `share` of the angle.
    ///
    /// Along a clothoid the curvature is linear in the length. It is made of `steps` arcs of equal length, each with the
    /// curvature of its middle, so that the heading is exact at every joint, and between two arcs the curvature changes
    /// by `1/steps`. For more steps they come as close to the clothoid as one likes.
    pub(crate) fn blend(angle: f64, share: f64, steps: u32) -> Option<Self> {
        let steps = steps.clamp(1, MOST_STEPS);
        let (sign, turn) = (angle.signum(), angle.abs());
        // Both clothoids turn by half of the share; the mean of their curvature is 1/2.
        let length = share * turn;
        let count = f64::from(steps);
        let mut arcs: Vec<Geometry> = (0..steps)
            .map(|step| {
                let curvature = (f64::from(step) + 0.5) / count;
                let angle = Radians(sign * curvature * length / count);
                Geometry::Arc { radius: Metres(sign / curvature), angle }
            })
            .collect();
        let middle = Geometry::Arc { radius: Metres(sign), angle: Radians(sign * turn * (1.0 - share)) };
        let out: Vec<Geometry> = arcs.iter().rev().copied().collect();
        arcs.push(middle);
        arcs.extend(out);
        Self::of(angle, arcs)
    }

    /// What the arcs make of a corner; none for one that is straight or turns back.
    fn of(angle: f64, arcs: Vec<Geometry>) -> Option<Self> {
        let turn = angle.abs();
        if !(1e-9..MOST_TURN).contains(&turn) {
            return None;
        }
        let end = arcs.iter().fold(Pose::default(), |pose, arc| arc.end_from(pose));
        // The corner is where the tangents of both ends meet; the shape is the same seen from both.
        let tangent = end.y.0.abs() / turn.sin();
        // From the middle of the chord to the corner, less what the curve bulges towards it.
        let half = turn / 2.0;
        let chord = end.x.0.hypot(end.y.0);
        let bulge = bulge(&arcs, chord);
        Some(Self { arcs, tangent, away: (chord / 2.0 * half.tan() - bulge).max(0.0) })
    }

    /// The largest radius up to `most` that has room in the straight ways and passes the corner within `corridor`.
    pub(crate) fn radius(&self, most: f64, room: f64, corridor: f64) -> f64 {
        let by_corridor = if self.away > 0.0 { corridor / self.away } else { f64::INFINITY };
        most.min(room / self.tangent).min(by_corridor)
    }

    /// The corner with a smallest radius of its own.
    pub(crate) fn scaled(&self, radius: f64) -> Rounded {
        let arcs = self.arcs.iter().map(|arc| match *arc {
            Geometry::Arc { radius: one, angle } => Geometry::Arc { radius: one * radius, angle },
            other => other,
        });
        Rounded { tangent: self.tangent * radius, arcs: arcs.collect() }
    }
}

/// How far the middle of a symmetric curve is from the chord between its ends.
fn bulge(arcs: &[Geometry], chord: f64) -> f64 {
    let halves = arcs.len() / 2;
    let mut pose = Pose::default();
    for arc in arcs.iter().take(halves) {
        pose = arc.end_from(pose);
    }
    if let (Some(Geometry::Arc { radius, angle }), true) = (arcs.get(halves), arcs.len() % 2 == 1) {
        pose = Geometry::Arc { radius: *radius, angle: *angle / 2.0 }.end_from(pose);
    }
    // The chord is half as long again on both sides of the middle.
    (pose.x.0.powi(2) + pose.y.0.powi(2) - (chord / 2.0).powi(2)).max(0.0).sqrt()
}

/// A corner as it is driven.
pub(crate) struct Rounded {
    /// How far before and behind the corner it begins and ends, m.
    pub(crate) tangent: f64,
    /// Its legs.
    pub(crate) arcs: Vec<Geometry>,
}

/// A corner of a line of points.
pub(crate) struct Vertex {
    /// The way point that it leads to, by its number in the question.
    pub(crate) index: usize,
    /// Where it is.
    pub(crate) point: WayPoint,
    /// Whether the robot visits this very place; a corner that is rounded is passed by.
    pub(crate) exact: bool,
}

/// A corner that asks to be rounded.
pub(crate) struct Corner {
    /// Where it is, with the direction in which the robot comes to it.
    pub(crate) at: Pose,
    /// By how much the way turns, to the left positive.
    pub(crate) angle: f64,
    /// What the straight ways on both sides leave for it, m.
    pub(crate) room: f64,
}

/// Drives along the points; `round` says how a corner is rounded, or that it is turned on the spot.
pub(crate) fn drive(way: &mut Way, vertices: &[Vertex], mut round: impl FnMut(&Corner) -> Option<Rounded>) {
    // Where the robot is on the way to a vertex, and how much of it the corner behind has taken.
    let mut from = way.at();
    let mut taken = 0.0;
    for (number, vertex) in vertices.iter().enumerate() {
        let Vertex { index, point, .. } = vertex;
        let length = point.distance(from).0;
        let direction = crate::way::bearing(from, point);
        if taken <= 0.0 {
            way.turn_to(direction, *index, point);
        }
        let corner =
            vertices.get(number + 1).filter(|_| !vertex.exact && point.heading.is_none()).map(|next| {
                let at = Pose { x: point.x, y: point.y, heading: Radians(direction) };
                let behind = next.point.distance(at).0;
                let ends = number + 2 == vertices.len() || next.exact || next.point.heading.is_some();
                // Two corners share the way between them, the first one at most half of it.
                let behind = if ends { behind } else { behind / 2.0 };
                let angle = Radians(crate::way::bearing(at, &next.point) - direction).wrapped().0;
                Corner { at, angle, room: behind.min(length - taken) }
            });
        let rounded = corner.and_then(|corner| round(&corner));
        let tangent = rounded.as_ref().map_or(0.0, |rounded| rounded.tangent);
        way.add(Geometry::Line { length: Metres((length - taken - tangent).max(0.0)) }, *index, point);
        for arc in rounded.iter().flat_map(|rounded| &rounded.arcs) {
            way.add(*arc, *index, point);
        }
        way.arrived(*index);
        if let Some(heading) = point.heading {
            way.turn_to(heading.0, *index, point);
        }
        taken = tangent;
        // A corner is passed by; elsewhere the next leg begins where the robot really is.
        from = if tangent > 0.0 { Pose { x: point.x, y: point.y, ..from } } else { way.at() };
    }
}
