//! A path without a stop: lines and arcs that go over into each other, and where a robot is along it.
//!
//! A path is seen in the direction of travel: where the robot drives backward, its heading is turned by half a circle,
//! and everything is as if it drove forward.

use axle_schema::{Drivetrain, Geometry, Leg, Metres, Pose, Radians, motion};

/// A piece of constant curvature.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    /// Where it begins, in the direction of travel.
    pub(crate) start: Pose,
    /// Turn for every metre of the way, to the left positive, 1/m.
    pub(crate) curvature: f64,
    /// Its length, m.
    pub(crate) length: f64,
    /// What is behind when it begins, m.
    pub(crate) begin: f64,
    /// The largest speed on it, and at its end, m/s.
    speed: f64,
    exit: f64,
}

impl Piece {
    /// The pose `s` metres after its start; on the tangent, outside of it.
    pub(crate) fn at(&self, s: f64) -> Pose {
        let on = s.clamp(0.0, self.length);
        let turn = self.curvature * on;
        let (x, y) = motion::chord(on, turn);
        let pose = self.start.moved(Metres(x), Metres(y), Radians(turn));
        pose.moved(Metres(s - on), Metres::ZERO, Radians::ZERO)
    }

    /// How far along the piece the nearest point of its line or circle is, next to `hint`, m; and how far to the left
    /// of it `pose` is, m.
    fn nearest(&self, pose: Pose, hint: f64) -> (f64, f64) {
        let Pose { x, y, .. } = pose.seen_from(self.start);
        let (x, y, k) = (x.0, y.0, self.curvature);
        if k.abs() < 1e-9 {
            return (x, y);
        }
        // The centre is at (0, 1/k). Written so that it holds for flat arcs too.
        let (along, across) = (k * x, 1.0 - k * y);
        let left = (2.0 * y - k * (x * x + y * y)) / (1.0 + along.hypot(across));
        let turn = along.atan2(across);
        // An arc may go round more than once: the turn next to the hint.
        let rounds = ((hint * k - turn) / std::f64::consts::TAU).round();
        ((turn + rounds * std::f64::consts::TAU) / k, left)
    }
}

/// Pieces, each of which begins where the one before it ends, in its direction.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    pub(crate) pieces: Vec<Piece>,
    /// Its length, m.
    pub(crate) length: f64,
    /// Whether it is driven forward.
    pub(crate) forward: bool,
}

/// A place along a path.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    /// The piece.
    pub(crate) piece: usize,
    /// The way from the start of the piece, m; more than its length beyond the end of the path.
    pub(crate) s: f64,
    /// How far the robot is to the left of the path, m.
    pub(crate) left: f64,
}

/// What a robot is allowed on a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// The robot.
    pub(crate) robot: Drivetrain,
    /// The share of its limits that may be used.
    pub(crate) effort: f64,
    /// The longest piece that is not divided: as a turn, rad.
    pub(crate) turn: f64,
}

impl Path {
    /// A path that begins with this leg; none for a leg that goes nowhere.
    pub(crate) fn begin(start: Pose, leg: &Leg, limits: &Limits) -> Option<Self> {
        let forward = match leg.geometry {
            Geometry::Line { length } => length.0 > 0.0,
            Geometry::Arc { radius, angle } => radius.0 * angle.0 > 0.0,
            Geometry::Turn { .. } => return None,
        };
        let mut path = Self { pieces: Vec::new(), length: 0.0, forward };
        path.extend(start, leg, limits).then_some(path)
    }

    /// Goes on with this leg, if it drives in the same direction; otherwise nothing changes.
    pub(crate) fn extend(&mut self, start: Pose, leg: &Leg, limits: &Limits) -> bool {
        let (signed, turn) = match leg.geometry {
            Geometry::Line { length } => (length.0, 0.0),
            Geometry::Arc { radius, angle } => (radius.0 * angle.0, angle.0),
            Geometry::Turn { .. } => return false,
        };
        let whole = signed.abs();
        if (signed > 0.0) != self.forward || !(whole > 0.0 && whole.is_finite()) {
            return false;
        }
        let curvature = turn / whole;
        let travel = travel(start, self.forward);
        let whole_piece = Piece {
            start: travel,
            curvature,
            length: whole,
            begin: self.length,
            speed: cruise(curvature, leg, limits),
            exit: 0.0,
        };
        let parts = (turn.abs() / limits.turn - 1e-9).ceil().clamp(1.0, MOST_PARTS);
        let length = whole / parts;
        let mut part = 0.0;
        while part < parts {
            let from = length * part;
            let start = whole_piece.at(from);
            self.pieces.push(Piece { start, length, begin: self.length + from, ..whole_piece });
            part += 1.0;
        }
        self.length += whole;
        true
    }

    /// Finds how fast the ends of the pieces may be passed, so that no wheel must jump and the last one is the goal.
    ///
    /// Where the curvature changes by Δκ the wheels change by v·Δκ·Δ/2 (model.md 4.4, P2): `jump` of it is allowed.
    pub(crate) fn limit(&mut self, limits: &Limits, jump: f64) {
        let track = limits.robot.track.get();
        let a = limits.robot.wheel_acceleration.0 * limits.effort;
        let mut next: Option<(f64, f64, f64)> = None;
        for piece in self.pieces.iter_mut().rev() {
            piece.exit = match next {
                None => 0.0,
                Some((curvature, speed, entry)) => {
                    let change = (curvature - piece.curvature).abs();
                    let joint = if change > 1e-9 { 2.0 * jump / (track * change) } else { f64::INFINITY };
                    joint.min(speed).min(entry).min(piece.speed)
                }
            };
            let entry = (piece.exit * piece.exit + 2.0 * a * piece.length).sqrt();
            next = Some((piece.curvature, piece.speed, entry));
        }
    }

    /// The place of `pose`, a pose in the direction of travel, searched from `from` on.
    ///
    /// The end of a piece counts as passed `early` metres before it.
    pub(crate) fn place(&self, pose: Pose, from: Place, early: f64) -> Place {
        let mut place = from;
        while let Some(piece) = self.pieces.get(place.piece) {
            let (s, left) = piece.nearest(pose, place.s.clamp(0.0, piece.length));
            let is_last = place.piece + 1 == self.pieces.len();
            if s < piece.length - if is_last { 0.0 } else { early.min(piece.length / 2.0) } {
                return Place { s: s.max(0.0), left, ..place };
            }
            if is_last {
                // Beyond the end the path goes on straight.
                let beyond = pose.seen_from(piece.at(piece.length));
                return Place { s: piece.length + beyond.x.0.max(0.0), left: beyond.y.0, ..place };
            }
            place = Place { piece: place.piece + 1, s: 0.0, left };
        }
        place
    }

    /// The way that is left from a place to the end, m; negative beyond it.
    pub(crate) fn left(&self, place: Place) -> f64 {
        self.pieces.get(place.piece).map_or(0.0, |piece| self.length - piece.begin - place.s)
    }

    /// The largest speed at a place at which nothing that follows is too sudden, but for the end of the path, m/s.
    pub(crate) fn speed(&self, place: Place, deceleration: f64) -> f64 {
        let Some(piece) = self.pieces.get(place.piece) else { return 0.0 };
        if place.piece + 1 == self.pieces.len() {
            return piece.speed;
        }
        let braking = piece.exit * piece.exit + 2.0 * deceleration * (piece.length - place.s).max(0.0);
        piece.speed.min(braking.sqrt())
    }

    /// The pose of the path `ahead` metres after a place, on the tangent beyond its end; and the curvature there.
    pub(crate) fn ahead(&self, place: Place, ahead: f64) -> (Pose, f64) {
        let (mut index, mut s) = (place.piece, place.s + ahead);
        while let Some(piece) = self.pieces.get(index) {
            if s <= piece.length {
                return (piece.at(s), piece.curvature);
            }
            if index + 1 == self.pieces.len() {
                return (piece.at(s), 0.0);
            }
            s -= piece.length;
            index += 1;
        }
        (Pose::default(), 0.0)
    }

    /// Where the piece begins and ends that a place is on.
    pub(crate) fn ends(&self, place: Place) -> (Pose, Pose) {
        let ends = |piece: &Piece| (piece.start, piece.at(piece.length));
        self.pieces.get(place.piece).map_or((Pose::default(), Pose::default()), ends)
    }

    /// The goal, in the direction of travel.
    pub(crate) fn goal(&self) -> Pose {
        self.pieces.last().map_or(Pose::default(), |piece| piece.at(piece.length))
    }
}

/// The most parts that one arc is divided into.
const MOST_PARTS: f64 = 32.0;

/// A pose of the robot, in the direction of travel, or the other way round.
pub(crate) fn travel(pose: Pose, forward: bool) -> Pose {
    let half = if forward { 0.0 } else { std::f64::consts::PI };
    Pose { heading: pose.heading + Radians(half), ..pose }
}

/// The largest speed on a leg (model.md 4.4: the wheels, the middle of the axle and the turn rate), m/s.
fn cruise(curvature: f64, leg: &Leg, limits: &Limits) -> f64 {
    let Limits { robot, effort, .. } = *limits;
    let wheel = robot.wheel_speed.0 / (1.0 + curvature.abs() * robot.track.get() / 2.0);
    // A line has no curvature: the quotient is then infinite and limits nothing.
    let most = robot.speed.0.min(wheel).min(robot.turn_rate.0 / curvature.abs()) * effort;
    leg.speed.map_or(most, |speed| most.min(speed.0))
}

#[cfg(test)]
mod tests;
