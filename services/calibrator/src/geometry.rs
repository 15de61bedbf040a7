//! How large the wheels are, and how far apart they are: what odometry needs.
//!
//! From rest to rest the robot turns by `θ = (cᵣ·dᵣ - cₗ·dₗ)/b`, where d is what a wheel has counted, c what it covers when
//! 1 m is counted, and b the effective track (J. Borenstein and L. Feng, "UMBmark: a benchmark test for measuring
//! odometry errors in mobile robots", 1995, whose E_d is cᵣ/cₗ and whose E_b is b over the described track). A gyroscope
//! tells θ. Each pass drives a square to the left, one to the right, and turns on the spot: every side, corner and turn is
//! one equation for cᵣ/b and cₗ/b. What all wheels share, the length of a metre, no turn can tell; it stays as it is.

use crate::statistics::least_squares;
use axle_schema::Sides;

/// What a leg is part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// A square to the left.
    Left,
    /// A square to the right.
    Right,
    /// A turn on the spot.
    Turn,
}

/// One movement from rest to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Leg {
    pub(crate) part: Part,
    /// What the wheels have counted, m.
    pub(crate) counted: Sides<f64>,
    /// How far the gyroscope says that the robot has turned, rad, with its bias still in it.
    pub(crate) turned: f64,
    /// How long that was added up, s.
    pub(crate) span: f64,
}

/// What a pass tells of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Body {
    /// cᵣ/cₗ.
    pub(crate) ratio: f64,
    /// b, where the mean of both c is 1.
    pub(crate) track: f64,
}

impl Body {
    /// cₗ and cᵣ.
    pub(crate) fn scale(self) -> Sides<f64> {
        Sides::new(2.0 / (1.0 + self.ratio), 2.0 * self.ratio / (1.0 + self.ratio))
    }
    fn way(self, counted: Sides<f64>) -> f64 {
        let scale = self.scale();
        f64::midpoint(scale.left * counted.left, scale.right * counted.right)
    }
    fn turn(self, counted: Sides<f64>) -> f64 {
        let scale = self.scale();
        (scale.right * counted.right - scale.left * counted.left) / self.track
    }
}

/// The body by those legs that `which` chooses, and what is left of the turn of each of them.
pub(crate) fn body(legs: &[Leg], which: impl Fn(Part) -> bool) -> Option<(Body, Vec<[f64; 2]>)> {
    let chosen: Vec<&Leg> = legs.iter().filter(|leg| which(leg.part)).collect();
    let rows: Vec<[f64; 2]> = chosen.iter().map(|leg| [leg.counted.right, -leg.counted.left]).collect();
    let turns: Vec<f64> = chosen.iter().map(|leg| leg.turned).collect();
    let ([right, left], off) = least_squares(&rows, &turns)?;
    (right > 0.0 && left > 0.0).then_some(())?;
    let body = Body { ratio: right / left, track: 2.0 / (right + left) };
    Some((body, turns.iter().zip(&off).map(|(turn, off)| [*turn, *off]).collect()))
}

/// The track by turns on the spot, where the wheels are known.
pub(crate) fn track(legs: &[Leg], ratio: f64) -> Option<f64> {
    let scale = Body { ratio, track: 1.0 }.scale();
    let (mut turned, mut apart) = (0.0, 0.0);
    for leg in legs.iter().filter(|leg| leg.part == Part::Turn) {
        let way = scale.right * leg.counted.right - scale.left * leg.counted.left;
        turned += leg.turned * way.signum();
        apart += way.abs();
    }
    (turned > 0.0).then(|| apart / turned)
}

/// By how much odometry with this body misses the end of a square of which the gyroscope knows every turn: the "return
/// position error" of the benchmark, m.
pub(crate) fn miss(legs: &[Leg], part: Part, body: Body) -> (f64, f64) {
    let legs = || legs.iter().filter(|leg| leg.part == part);
    let believed = walk(legs().map(|leg| (body.way(leg.counted), body.turn(leg.counted))));
    let real = walk(legs().map(|leg| (body.way(leg.counted), leg.turned)));
    (believed.0 - real.0, believed.1 - real.1)
}

/// Where odometry with this body believes that these counts end, ahead and to the left of the start, m.
pub(crate) fn end(legs: &[Sides<f64>], body: Body) -> (f64, f64) {
    walk(legs.iter().map(|counted| (body.way(*counted), body.turn(*counted))))
}

/// The end of legs with these ways and turns.
fn walk(legs: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (x, y, _) = legs.fold((0.0, 0.0, 0.0), |(x, y, heading), (way, turn)| {
        // The chord of an arc, in the direction of its middle.
        let half = turn / 2.0;
        let chord = if half.abs() > 1e-9 { way * half.sin() / half } else { way };
        let direction: f64 = heading + half;
        (x + chord * direction.cos(), y + chord * direction.sin(), heading + turn)
    });
    (x, y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pass of a robot with this body, side 1 m.
    fn legs(body: Body) -> Vec<Leg> {
        let mut legs = Vec::new();
        for (part, sign) in [(Part::Left, 1.0), (Part::Right, -1.0)] {
            for _ in 0..4 {
                for counted in [Sides::new(1.0, 1.0), Sides::new(-0.23 * sign, 0.23 * sign)] {
                    legs.push(Leg { part, counted, turned: body.turn(counted), span: 2.0 });
                }
            }
        }
        for counted in [Sides::new(-1.0, 1.0), Sides::new(1.0, -1.0)] {
            legs.push(Leg { part: Part::Turn, counted, turned: body.turn(counted), span: 3.0 });
        }
        legs
    }

    #[test]
    fn wheels_and_track_are_found_by_squares_and_by_turns() {
        let truth = Body { ratio: 1.02, track: 0.31 };
        let legs = legs(truth);
        let (found, off) = body(&legs, |part| part != Part::Turn).expect("a body");
        assert!((found.ratio - 1.02).abs() < 1e-12 && (found.track - 0.31).abs() < 1e-12, "{found:?}");
        assert!(off.len() == 16 && off.iter().all(|[_, off]| off.abs() < 1e-12));
        assert!((track(&legs, 1.02).expect("turns") - 0.31).abs() < 1e-12);
        let (x, y) = miss(&legs, Part::Left, truth);
        assert!(x.hypot(y) < 1e-12);
        let (x, y) = miss(&legs, Part::Left, Body { ratio: 1.0, track: 0.3 });
        assert!(x.hypot(y) > 0.03, "uncalibrated it misses: {x}, {y}");
    }

    #[test]
    fn legs_that_tell_nothing_give_no_body() {
        let truth = Body { ratio: 1.0, track: 0.3 };
        let straight: Vec<Leg> = legs(truth).into_iter().filter(|leg| leg.counted.left > 0.9).collect();
        assert!(body(&straight[..4], |part| part == Part::Left).is_none(), "straight lines tell no track");
        assert_eq!(body(&[], |_| true), None);
    }
}
