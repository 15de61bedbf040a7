//! The plan while it is being made: where its legs end so far, and what the asker should know.

use axle_schema::plan::MAX_NOTES;
use axle_schema::{Geometry, Leg, Metres, Plan, Pose, Radians, WayPoint};

/// Turns smaller than this, in rad, are left out: they come from rounding, and a robot would stop for them. A line of
/// 10 m then ends within 10 nm of its point.
const LEAST_TURN: f64 = 1e-9;
/// Ways shorter than this, in m, are left out likewise.
const LEAST_LENGTH: f64 = 1e-9;

/// The legs of a plan, one after the other.
pub(crate) struct Way {
    start: Pose,
    /// Where the legs so far end.
    at: Pose,
    /// The number of the point that is there, counted from 1; none at the start.
    place: Option<usize>,
    legs: Vec<Leg>,
    repeated: usize,
    notes: Vec<String>,
}

impl Way {
    pub(crate) const fn new(start: Pose) -> Self {
        Self { start, at: start, place: None, legs: Vec::new(), repeated: 0, notes: Vec::new() }
    }

    /// Where the legs so far end.
    pub(crate) const fn at(&self) -> Pose {
        self.at
    }
    /// The legs so far.
    pub(crate) fn legs(&self) -> &[Leg] {
        &self.legs
    }

    /// Whether there is a way to the point; one that is there already is noted.
    pub(crate) fn sets_out(&mut self, merge: Metres, index: usize, point: &WayPoint) -> bool {
        let sets_out = point.distance(self.at).0 > merge.0;
        if !sets_out {
            self.repeat(index + 1, self.place, point);
        }
        sets_out
    }

    /// A point was reached.
    pub(crate) const fn arrived(&mut self, index: usize) {
        self.place = Some(index + 1);
    }

    /// Turns on the spot, the shorter way, until the point is ahead.
    pub(crate) fn turn_towards(&mut self, index: usize, point: &WayPoint) {
        self.turn_to(bearing(self.at, point), index, point);
    }

    /// Turns on the spot, the shorter way, to a direction.
    pub(crate) fn turn_to(&mut self, direction: f64, index: usize, point: &WayPoint) {
        let angle = Radians(direction - self.at.heading.0).wrapped();
        self.add(Geometry::Turn { angle }, index, point);
    }

    /// Adds a leg, unless it is too small to be more than rounding.
    pub(crate) fn add(&mut self, geometry: Geometry, index: usize, point: &WayPoint) {
        let least = match geometry {
            Geometry::Turn { angle } => angle.0.abs() < LEAST_TURN,
            Geometry::Line { .. } | Geometry::Arc { .. } => geometry.length().0 < LEAST_LENGTH,
        };
        if !least {
            #[allow(clippy::cast_possible_truncation, reason = "a way task has at most MAX_POINTS points")]
            self.legs.push(Leg { geometry, point: index as u32, speed: point.speed });
            self.at = geometry.end_from(self.at);
        }
    }

    /// Tells the asker something, if there is room.
    pub(crate) fn note(&mut self, words: String) {
        // The last place is for the count of those points that have no note of their own.
        if self.notes.len() + 1 < MAX_NOTES {
            self.notes.push(words);
        }
    }

    /// Notes that a point, counted from 1, repeats the one before it.
    pub(crate) fn repeat(&mut self, number: usize, place: Option<usize>, point: &WayPoint) {
        let (x, y) = (point.x, point.y);
        let before = self.notes.len();
        self.note(match place {
            Some(place) => {
                format!("way point {number} repeats the place of way point {place} ({x}, {y}): visited once")
            }
            None => format!("way point {number} is where the robot starts ({x}, {y}): nothing to drive"),
        });
        if self.notes.len() == before {
            self.repeated += 1;
        }
    }

    /// The plan, with what its legs say of themselves.
    pub(crate) fn into_plan(mut self) -> Plan {
        if self.repeated > 0 {
            let rest = self.repeated;
            self.notes.push(format!("{rest} more way points repeat the place before them: visited once"));
        }
        let length = self.legs.iter().map(|leg| leg.geometry.length()).sum();
        Plan { start: self.start, legs: self.legs, length, notes: self.notes, ..Plan::default() }
    }
}

/// The direction of a point, seen from a place.
pub(crate) fn bearing(from: Pose, point: &WayPoint) -> f64 {
    (point.y.0 - from.y.0).atan2(point.x.0 - from.x.0)
}
