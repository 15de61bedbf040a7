//! From a movement to the geometry that it drives, within a tolerance (model.md, 4.2).
//!
//! Equality of wheel speeds or of their ratios decides nothing here: decimal speeds break it (0.1, 0.2 → 0.3, 0.6 is a
//! circle only by luck of rounding). Every candidate has a bound of how far the robot is from it at any time; it is
//! the answer if the bound is within the tolerance. Symbols are those of model.md 1.1.

use crate::{Curve, Dwm, Geometry, Metres, PerMetre, Radians, Refusal, Track};
use serde::{Deserialize, Serialize};

/// How far a robot that makes the movement may be from the geometry at any time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tolerance {
    /// Distance of the middle of the axle from the path; finite, 0 or more.
    pub position: Metres,
    /// Difference of the heading from the direction of the path; finite, 0 or more.
    pub heading: Radians,
}

impl Default for Tolerance {
    /// A micrometre and a microradian: far below what an encoder sees, far above what rounding does.
    fn default() -> Self {
        Self { position: Metres(1e-6), heading: Radians(1e-6) }
    }
}

/// A curve, and how far the movement is from it at most.
struct Candidate {
    curve: Curve,
    position: f64,
    heading: f64,
}

impl Candidate {
    fn fits(&self, tolerance: Tolerance) -> bool {
        // Written so that a bound that is not a number does not fit.
        self.position <= tolerance.position.0 && self.heading <= tolerance.heading.0
    }
}

/// A quantity whose rate is linear in time: what it comes to, and where it has been on the way.
struct Sweep {
    /// Its value at the end; it begins at 0.
    end: f64,
    /// The largest absolute value on the way.
    largest: f64,
    /// How far it was outside of the values between 0 and `end`.
    beyond: f64,
    /// All of its ups and downs together.
    total: f64,
}

impl Sweep {
    fn of(start_rate: f64, end_rate: f64, time: f64) -> Self {
        let end = (start_rate + end_rate) / 2.0 * time;
        if (start_rate < 0.0) == (end_rate < 0.0) || start_rate == 0.0 || end_rate == 0.0 {
            return Self { end, largest: end.abs(), beyond: 0.0, total: end.abs() };
        }
        // The rate changes its sign: two triangles, and the smaller one is driven forth and back.
        let share = start_rate / (start_rate - end_rate);
        let there = (start_rate * share * time / 2.0).abs();
        let back = (end_rate * (1.0 - share) * time / 2.0).abs();
        Self { end, largest: there.max(end.abs()), beyond: there.min(back), total: there + back }
    }
}

impl Dwm {
    /// The line, turn or arc that the movement drives, if it drives one within `tolerance` (model.md, 4.2).
    ///
    /// The answer is rigorous, but for rounding: at every time the robot is within `tolerance` of a point of the
    /// geometry, in position and in heading. With θ the turn, s the signed way and `path = ∫|v| dt`:
    ///
    /// * a turn misses by `path`;
    /// * a line misses by at most `path·max|θ|`, and its direction by `max|θ|`;
    /// * an arc of radius `R = s/θ` misses by at most `∫|v − Rω| dt = |B − R·D|·T/2`;
    /// * what the robot drives beyond either end of the geometry, because a wheel changes its direction, is added.
    ///
    /// The simplest that fits is taken: of a line and a turn the nearer one, then an arc. Rest is a line of no length.
    /// Speeds are lost, of course: many movements have one geometry.
    ///
    /// # Errors
    /// [`Refusal::OutOfRange`] says how far the movement is from the nearest of the three.
    pub fn geometry(&self, track: Track, tolerance: Tolerance) -> Result<Geometry, Refusal> {
        let candidates = self.steady_candidates(track);
        simplest(&candidates, tolerance)
            .ok_or_else(|| misfit("line, turn or arc", &candidates, tolerance))
            .and_then(Geometry::try_from)
    }

    /// The curve that the movement drives, if it drives one within `tolerance`: as [`Dwm::geometry`], and beyond the
    /// paper spirals and clothoids.
    ///
    /// A spiral of the mean turning rate misses by at most `path·|C|T²/4` (and its direction by `|C|T²/4`), a clothoid
    /// of the mean speed by `∫|v − s/T| dt = |A|T²/4`; of the two the nearer one is taken. A general movement is
    /// neither (model.md, 1.4).
    ///
    /// # Errors
    /// As [`Dwm::geometry`].
    pub fn curve(&self, track: Track, tolerance: Tolerance) -> Result<Curve, Refusal> {
        let mut candidates = self.steady_candidates(track);
        if let Some(curve) = simplest(&candidates, tolerance) {
            return Ok(curve);
        }
        candidates.extend(self.accelerated_candidates(track));
        nearest(&candidates, tolerance)
            .ok_or_else(|| misfit("line, turn, arc, spiral or clothoid", &candidates, tolerance))
    }

    /// The line, the turn and, if the robot turns at all, the arc that are nearest to the movement.
    fn steady_candidates(&self, track: Track) -> Vec<Candidate> {
        let ([b0, b1], [w0, w1]) = self.rates(track);
        let time = self.duration().0;
        let (way, turn) = (Sweep::of(b0, b1, time), Sweep::of(w0, w1, time));
        let line = Candidate {
            curve: Geometry::Line { length: Metres(way.end) }.into(),
            position: way.total * turn.largest + way.beyond,
            heading: turn.largest,
        };
        let spin = Candidate {
            curve: Geometry::Turn { angle: Radians(turn.end) }.into(),
            position: way.total,
            heading: turn.beyond,
        };
        let mut candidates = vec![line, spin];
        let radius = way.end / turn.end;
        if radius.is_finite() {
            candidates.push(Candidate {
                curve: Geometry::Arc { radius: Metres(radius), angle: Radians(turn.end) }.into(),
                position: (b0 - radius * w0).abs() * time / 2.0 + radius.abs() * turn.beyond,
                heading: turn.beyond,
            });
        }
        candidates
    }

    /// The spiral and the clothoid that are nearest to the movement, as far as they exist.
    fn accelerated_candidates(&self, track: Track) -> Vec<Candidate> {
        let ([b0, b1], [w0, w1]) = self.rates(track);
        let time = self.duration().0;
        let (way, turn) = (Sweep::of(b0, b1, time), Sweep::of(w0, w1, time));
        let (mean_v, mean_w) = (way.end / time, turn.end / time);
        let mut candidates = Vec::new();
        let bend = (w1 - w0).abs() * time / 8.0;
        let [start_radius, end_radius] = [b0, b1].map(|v| Metres(v / mean_w));
        if start_radius.is_finite() && end_radius.is_finite() {
            let curve = Curve::Spiral { start_radius, end_radius, angle: Radians(turn.end) };
            candidates.push(Candidate { curve, position: way.total * bend, heading: bend });
        }
        let [start_curvature, end_curvature] = [w0, w1].map(|w| PerMetre(w / mean_v));
        if start_curvature.is_finite() && end_curvature.is_finite() {
            let curve = Curve::Clothoid { start_curvature, end_curvature, length: Metres(way.end) };
            candidates.push(Candidate { curve, position: (b1 - b0).abs() * time / 4.0, heading: 0.0 });
        }
        candidates
    }

    /// Speed of the middle of the axle at the start and at the end, then the turning rates.
    fn rates(&self, track: Track) -> ([f64; 2], [f64; 2]) {
        let (start, end) = (self.start(), self.end());
        let v = [start, end].map(|speeds| 0.5 * speeds.left.0 + 0.5 * speeds.right.0);
        (v, [start, end].map(|speeds| (speeds.right.0 - speeds.left.0) / track.get()))
    }
}

/// The nearer one of line and turn, if it fits; else the arc.
fn simplest(steady: &[Candidate], tolerance: Tolerance) -> Option<Curve> {
    let (simple, arc) = steady.split_at(2.min(steady.len()));
    nearest(simple, tolerance).or_else(|| nearest(arc, tolerance))
}

fn nearest(candidates: &[Candidate], tolerance: Tolerance) -> Option<Curve> {
    candidates
        .iter()
        .filter(|candidate| candidate.fits(tolerance))
        .min_by(|a, b| a.position.total_cmp(&b.position))
        .map(|candidate| candidate.curve)
}

fn misfit(known: &str, candidates: &[Candidate], tolerance: Tolerance) -> Refusal {
    let got = candidates
        .iter()
        .map(|Candidate { curve, position, heading }| {
            format!("{} {position:.3e} m and {heading:.3e} rad", curve.name())
        })
        .collect::<Vec<_>>()
        .join(", ");
    let limit = format!("{} and {}", tolerance.position, tolerance.heading);
    Refusal::out_of_range(format!("deviation of the movement from every {known}"), got, limit)
}
