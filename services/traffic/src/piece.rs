//! Pieces: what of a way is reserved and given back as a whole, and which part of the floor it takes.

use axle_schema::plan::MAX_LEGS;
use axle_schema::traffic::ClaimedWay;
use axle_schema::{Geometry, Leg, Metres, Pose, Radians, Refusal};
use std::collections::BTreeSet;
use std::ops::Range;

/// A square of the floor, by its column and row.
pub(crate) type Cell = (i32, i32);

/// The most cells that one way may take.
const MAX_CELLS: usize = 100_000;
/// The largest coordinate of a cell: beyond it no robot of a fleet drives.
const FAR: f64 = 1e7;

/// A piece of a way.
#[derive(Clone, Debug, Default)]
pub(crate) struct Piece {
    /// Where it ends.
    pub(crate) end: Pose,
    /// Path of the middle of the axle, m.
    pub(crate) length: f64,
    /// What the robot may touch on it.
    pub(crate) cells: Vec<Cell>,
}

/// Which legs make a piece: it ends with each leg that is not a turn, and with the last leg.
#[must_use]
pub fn pieces(legs: &[Leg]) -> Vec<Range<usize>> {
    let mut pieces = Vec::new();
    let mut begin = 0;
    for (index, leg) in legs.iter().enumerate() {
        if leg.geometry.length() > Metres::ZERO || index + 1 == legs.len() {
            pieces.push(begin..index + 1);
            begin = index + 1;
        }
    }
    pieces
}

/// The same path in legs of at most `longest`: each long one in equal parts.
///
/// # Errors
/// [`Refusal::TooLarge`] for a path that has too many of them.
pub fn cut(legs: &[Leg], longest: Metres) -> Result<Vec<Leg>, Refusal> {
    let mut parts = Vec::with_capacity(legs.len());
    for leg in legs {
        let count = (leg.geometry.length() / longest).ceil().max(1.0);
        if parts.len() as f64 + count > MAX_LEGS as f64 {
            let what = format!("a way in pieces of {longest} (choose longer pieces or a shorter way)");
            return Err(Refusal::TooLarge { what, got: u64::MAX, limit: MAX_LEGS as u64 });
        }
        let geometry = part_of(&leg.geometry, 1.0 / count);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most MAX_LEGS")]
        parts.extend(std::iter::repeat_n(Leg { geometry, ..*leg }, count as usize));
    }
    Ok(parts)
}

/// The same path in as few legs as possible: what [`cut`] has cut is joined again, so that nobody rests there.
#[must_use]
pub fn join(legs: &[Leg]) -> Vec<Leg> {
    let mut joined: Vec<Leg> = Vec::with_capacity(legs.len());
    for leg in legs {
        match joined.last_mut() {
            Some(last) if (last.point, last.speed) == (leg.point, leg.speed) => {
                match sum_of(&last.geometry, &leg.geometry) {
                    Some(sum) => last.geometry = sum,
                    None => joined.push(*leg),
                }
            }
            _ => joined.push(*leg),
        }
    }
    joined
}

fn part_of(geometry: &Geometry, share: f64) -> Geometry {
    match *geometry {
        Geometry::Line { length } => Geometry::Line { length: length * share },
        Geometry::Turn { angle } => Geometry::Turn { angle: angle * share },
        Geometry::Arc { radius, angle } => Geometry::Arc { radius, angle: angle * share },
    }
}

/// One geometry for two in a row, if there is one.
fn sum_of(first: &Geometry, second: &Geometry) -> Option<Geometry> {
    match (*first, *second) {
        (Geometry::Line { length: a }, Geometry::Line { length: b }) if a.0 * b.0 > 0.0 => {
            Some(Geometry::Line { length: a + b })
        }
        (Geometry::Arc { radius, angle: a }, Geometry::Arc { radius: other, angle: b })
            if (radius - other).abs() <= Metres::ZERO && a.0 * b.0 > 0.0 =>
        {
            Some(Geometry::Arc { radius, angle: a + b })
        }
        _ => None,
    }
}

/// The pieces of a way; the first is the place where it begins. `cell` and `margin` in m.
///
/// # Errors
/// Refuses a way that takes too much of the floor, or leads too far away.
pub(crate) fn of(way: &ClaimedWay, cell: f64, margin: f64) -> Result<Vec<Piece>, Refusal> {
    let reach = way.radius.0 + margin;
    let mut at = way.start;
    let mut floor = Floor { cell, reach: reach + cell / 4.0, cells: 0 };
    let mut all = vec![Piece { end: at, length: 0.0, cells: floor.under(&[at])? }];
    for range in pieces(&way.legs) {
        let mut path = vec![at];
        let mut length = 0.0;
        for leg in &way.legs[range] {
            let long = leg.geometry.length().0;
            length += long;
            // Whoever is within half a step of a sample is within its circle.
            let steps = (long / (cell / 2.0)).ceil().clamp(1.0, MAX_CELLS as f64);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let steps = steps as u32;
            if steps as usize >= MAX_CELLS {
                return Err(too_large());
            }
            let begin = at;
            path.extend(
                (1..=steps)
                    .map(|step| part_of(&leg.geometry, f64::from(step) / f64::from(steps)).end_from(begin)),
            );
            at = leg.geometry.end_from(at);
        }
        all.push(Piece { end: at, length, cells: floor.under(&path)? });
    }
    Ok(all)
}

fn too_large() -> Refusal {
    let what = "cells of the floor that a way takes (drive it in parts)".into();
    Refusal::TooLarge { what, got: MAX_CELLS as u64 + 1, limit: MAX_CELLS as u64 }
}

/// The floor as squares.
struct Floor {
    cell: f64,
    /// How far from the middle of the axle a cell belongs to the robot, m.
    reach: f64,
    /// Handed out so far.
    cells: usize,
}

impl Floor {
    /// The cells within reach of any of the places.
    fn under(&mut self, places: &[Pose]) -> Result<Vec<Cell>, Refusal> {
        let mut cells = BTreeSet::new();
        for place in places {
            let (x, y) = (place.x.0 / self.cell, place.y.0 / self.cell);
            let reach = self.reach / self.cell;
            if !(x.abs() + reach < FAR && y.abs() + reach < FAR) {
                return Err(Refusal::out_of_range(
                    "a place of the way",
                    format!("({}, {})", place.x, place.y),
                    format!("within {} of the origin", Metres(FAR * self.cell)),
                ));
            }
            #[allow(clippy::cast_possible_truncation, reason = "within FAR of the origin")]
            let span = |low: f64, high: f64| (low.floor() as i32)..=(high.floor() as i32);
            for column in span(x - reach, x + reach) {
                // The nearest edge of the column and of the row.
                let near = |at: f64, index: i32| at - at.clamp(f64::from(index), f64::from(index) + 1.0);
                let dx = near(x, column);
                for row in span(y - reach, y + reach) {
                    if dx.hypot(near(y, row)) <= reach {
                        cells.insert((column, row));
                    }
                }
            }
            if self.cells + cells.len() > MAX_CELLS {
                return Err(too_large());
            }
        }
        self.cells += cells.len();
        Ok(cells.into_iter().collect())
    }
}

/// A stage from where the robot really stands: its first line is aimed anew at the point where it should end, so that
/// the errors of the stages before do not add up.
///
/// `at` is where the robot is, `planned` where the legs begin. A first arc is driven as it is.
#[must_use]
pub fn aim(at: Pose, planned: Pose, legs: &[Leg]) -> Vec<Leg> {
    let first = legs.iter().position(|leg| leg.geometry.length() > Metres::ZERO);
    let Some(index) = first else { return legs.to_vec() };
    let Geometry::Line { length } = legs[index].geometry else { return legs.to_vec() };
    let end = legs[..=index].iter().fold(planned, |pose, leg| leg.geometry.end_from(pose));
    let (dx, dy) = ((end.x - at.x).0, (end.y - at.y).0);
    let distance = dx.hypot(dy);
    let backward = length.0 < 0.0;
    // Shorter than this, the direction of what is left says nothing.
    if distance < 0.05 {
        return legs.to_vec();
    }
    let bearing = dy.atan2(dx) + if backward { std::f64::consts::PI } else { 0.0 };
    let angle = Radians(bearing - at.heading.0).wrapped();
    let mut stage = Vec::with_capacity(legs.len() + 1);
    // Less than half a degree is not worth a turn.
    if angle.0.abs() > 0.005 {
        stage.push(Leg { geometry: Geometry::Turn { angle }, ..legs[index] });
    }
    let length = Metres(if backward { -distance } else { distance });
    stage.push(Leg { geometry: Geometry::Line { length }, ..legs[index] });
    // What the new direction differs by is made good where the line ends: what follows has the planned one.
    let heading = if angle.0.abs() > 0.005 { at.heading + angle } else { at.heading };
    let off = (end.heading - heading).wrapped();
    let mut rest = legs[index + 1..].iter().copied();
    match rest.next() {
        Some(Leg { geometry: Geometry::Turn { angle }, point, speed }) => {
            stage.push(Leg { geometry: Geometry::Turn { angle: angle + off }, point, speed });
        }
        Some(next) if off.0.abs() > 0.005 => {
            stage.extend([Leg { geometry: Geometry::Turn { angle: off }, ..next }, next]);
        }
        next => stage.extend(next),
    }
    stage.extend(rest);
    stage
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leg(geometry: Geometry) -> Leg {
        Leg { geometry, point: 0, speed: None }
    }
    fn line(length: f64) -> Leg {
        leg(Geometry::Line { length: Metres(length) })
    }
    fn turn(angle: f64) -> Leg {
        leg(Geometry::Turn { angle: Radians(angle) })
    }
    fn end(start: Pose, legs: &[Leg]) -> Pose {
        legs.iter().fold(start, |pose, leg| leg.geometry.end_from(pose))
    }

    #[test]
    fn a_piece_ends_with_what_moves_and_with_the_last_leg() {
        assert_eq!(
            pieces(&[turn(1.0), line(1.0), line(2.0), turn(1.0), turn(1.0), line(1.0), turn(2.0)]),
            [0..2, 2..3, 3..6, 6..7]
        );
        assert!(pieces(&[]).is_empty());
    }

    #[test]
    fn what_is_cut_is_joined_to_what_it_was() {
        let arc = leg(Geometry::Arc { radius: Metres(-1.0), angle: Radians(-2.0) });
        let legs = [line(2.3), turn(1.0), arc, line(-1.0), line(0.4)];
        let parts = cut(&legs, Metres(0.5)).expect("few");
        assert_eq!(parts.len(), 5 + 1 + 4 + 2 + 1);
        assert!(parts.iter().all(|leg| leg.geometry.length().0 <= 0.5 + 1e-12));
        let start = Pose::new(1.0, 2.0, 3.0);
        assert!(end(start, &parts).distance(end(start, &legs)).0 < 1e-12);
        let joined = join(&parts);
        assert_eq!(joined.len(), legs.len());
        assert!(end(start, &joined).distance(end(start, &legs)).0 < 1e-12);
        assert!(cut(&[line(1e6)], Metres(0.5)).is_err(), "two million pieces are refused");
    }

    #[test]
    fn a_piece_takes_all_of_the_floor_that_its_robot_can_touch() {
        let legs = vec![leg(Geometry::Arc { radius: Metres(0.8), angle: Radians(1.5) })];
        let way = ClaimedWay { start: Pose::new(-0.3, 0.7, 0.2), legs: legs.clone(), radius: Metres(0.25) };
        let pieces = of(&way, 0.1, 0.0).expect("a way");
        for part in 0..=1000 {
            let at = part_of(&legs[0].geometry, f64::from(part) / 1000.0).end_from(way.start);
            for direction in 0..16 {
                let angle = f64::from(direction) * std::f64::consts::PI / 8.0;
                let rim = (at.x.0 + 0.25 * angle.cos(), at.y.0 + 0.25 * angle.sin());
                #[allow(clippy::cast_possible_truncation, reason = "near the origin")]
                let cell = ((rim.0 / 0.1).floor() as i32, (rim.1 / 0.1).floor() as i32);
                assert!(pieces[1].cells.contains(&cell), "{rim:?} belongs to nobody");
            }
        }
        assert!(pieces[1].cells.len() < 200, "and little more: {}", pieces[1].cells.len());
    }

    #[test]
    fn a_way_that_takes_the_whole_world_is_refused() {
        let way = |start, legs| ClaimedWay { start, legs, radius: Metres(0.25) };
        assert!(of(&way(Pose::default(), vec![line(1e5)]), 0.1, 0.0).is_err());
        assert!(of(&way(Pose::new(1e30, 0.0, 0.0), Vec::new()), 0.1, 0.0).is_err());
        assert!(of(&way(Pose::new(f64::NAN, 0.0, 0.0), Vec::new()), 0.1, 0.0).is_err());
    }

    #[test]
    fn a_stage_is_aimed_from_where_the_robot_stands() {
        let planned = Pose::new(1.0, 1.0, 0.0);
        let legs = [line(2.0), turn(1.0), line(1.0)];
        let due = end(planned, &legs[..2]);
        for at in [planned, Pose::new(1.02, 0.96, 0.03), Pose::new(0.95, 1.05, -0.1)] {
            let stage = aim(at, planned, &legs);
            let lines = stage.iter().position(|leg| leg.geometry.length().0 > 1.5).expect("the long line");
            let reached = end(at, &stage[..=lines + 1]);
            assert!(reached.distance(due).0 < 0.012, "{at:?} comes to {reached:?}, not {due:?}");
            assert!((reached.heading - due.heading).wrapped().0.abs() < 1e-9);
        }
        // An arc must begin in the planned direction.
        let arc = leg(Geometry::Arc { radius: Metres(1.0), angle: Radians(1.0) });
        let (at, due) = (Pose::new(1.0, 1.03, 0.0), end(planned, &[line(0.3), arc]));
        let reached = end(at, &aim(at, planned, &[line(0.3), arc]));
        assert!(reached.distance(due).0 < 1e-9, "{at:?} comes to {reached:?}, not {due:?}");
        let back = aim(Pose::new(1.0, 1.1, 0.0), planned, &[line(-2.0)]);
        let reached = end(Pose::new(1.0, 1.1, 0.0), &back);
        assert!(reached.distance(Pose::new(-1.0, 1.0, 0.0)).0 < 1e-9, "{reached:?}");
    }
}
