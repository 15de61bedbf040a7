//! The strategy "dubins": the shortest way forward whose curves have a smallest radius, with a heading at every point.
//!
//! Between two poses the shortest such way is one of six: two curves with a line between them (LSL, RSR, LSR, RSL), or
//! three curves (RLR, LRL); L. E. Dubins, "On Curves of Minimal Length …" (1957), in the formulas of A. M. Shkel and V.
//! Lumelsky, "Classification of the Dubins set" (2001). A point that comes without a heading gets the best one of a
//! compass of them, chosen for the whole way at once.

use crate::Task;
use crate::way::{Way, bearing};
use axle_schema::{Geometry, Metres, Pose, Radians, WayPoint};
use std::f64::consts::TAU;

/// How many headings are tried at a point that has none, and at how many points at most.
const COMPASS: u32 = 24;
const MOST_POINTS: usize = 512;
/// An angle that is short of a full turn by less than this, in rad, is none: it comes from rounding.
const LEAST: f64 = 1e-10;

/// The turn of each of three parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Left,
    Straight,
    Right,
}
use Part::{Left, Right, Straight};

/// One of the six ways: its parts, and how long they are for a radius of 1.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Word {
    parts: [Part; 3],
    lengths: [f64; 3],
}

/// Visits all points, with a heading at each.
pub(crate) fn plan(way: &mut Way, task: &Task<'_>, points: &[(usize, WayPoint)]) {
    let radius = task.params.radius.0;
    let mut visited: Vec<(usize, WayPoint)> = Vec::with_capacity(points.len());
    let mut at = way.at();
    for &(index, point) in points {
        let here = point.distance(at).0 <= task.params.merge.0;
        // The same place with another heading is a loop, which is a way.
        if here
            && point.heading.is_none_or(|heading| Radians(heading.0 - at.heading.0).wrapped().0.abs() < 1e-6)
        {
            way.repeat(index + 1, visited.last().map(|(index, _)| index + 1), &point);
        } else {
            visited.push((index, point));
            at = Pose { x: point.x, y: point.y, heading: point.heading.unwrap_or(at.heading) };
        }
    }
    let headings = headings(way.at(), &visited, radius);
    for (&(index, point), &heading) in visited.iter().zip(&headings) {
        let goal = Pose { x: point.x, y: point.y, heading: Radians(heading) };
        let Word { parts, lengths } = shortest(way.at(), goal, radius);
        for (part, length) in parts.into_iter().zip(lengths) {
            let geometry = match part {
                Left => Geometry::Arc { radius: Metres(radius), angle: Radians(length) },
                Right => Geometry::Arc { radius: Metres(-radius), angle: Radians(-length) },
                Straight => Geometry::Line { length: Metres(length * radius) },
            };
            way.add(geometry, index, &point);
        }
        way.arrived(index);
    }
}

/// The heading of every point: its own, or the one of the compass with which the whole way is shortest.
fn headings(start: Pose, points: &[(usize, WayPoint)], radius: f64) -> Vec<f64> {
    let choices: Vec<Vec<f64>> = (0..points.len()).map(|index| choices(start, points, index)).collect();
    // The shortest ways to each choice of a point, and over which choice of the point before they lead.
    let mut before = vec![(0.0, start)];
    let mut through: Vec<Vec<usize>> = Vec::with_capacity(points.len());
    for ((_, point), choices) in points.iter().zip(&choices) {
        let mut here = Vec::with_capacity(choices.len());
        let mut over = Vec::with_capacity(choices.len());
        for &heading in choices {
            let goal = Pose { x: point.x, y: point.y, heading: Radians(heading) };
            let mut best = (f64::INFINITY, 0);
            for (choice, &(length, from)) in before.iter().enumerate() {
                // No way is shorter than the straight one.
                if length + from.distance(goal).0 < best.0 {
                    let total = length + shortest(from, goal, radius).length() * radius;
                    if total < best.0 {
                        best = (total, choice);
                    }
                }
            }
            here.push((best.0, goal));
            over.push(best.1);
        }
        through.push(over);
        before = here;
    }
    let last = before.iter().enumerate().min_by(|a, b| a.1.0.total_cmp(&b.1.0));
    let mut choice = last.map_or(0, |(choice, _)| choice);
    let mut headings = vec![0.0; points.len()];
    for index in (0..points.len()).rev() {
        let of = |list: &[f64]| list.get(choice).copied();
        if let (Some(heading), Some(value)) =
            (headings.get_mut(index), choices.get(index).and_then(|it| of(it)))
        {
            *heading = value;
        }
        choice = through.get(index).and_then(|over| over.get(choice)).copied().unwrap_or(0);
    }
    headings
}

/// The headings to try at a point: its own, or that from the point before to the point behind and the compass around it.
fn choices(start: Pose, points: &[(usize, WayPoint)], index: usize) -> Vec<f64> {
    let Some(&(_, point)) = points.get(index) else { return Vec::new() };
    if let Some(heading) = point.heading {
        return vec![heading.0];
    }
    let before = index.checked_sub(1).and_then(|index| points.get(index));
    let before = before.map_or(start, |(_, point)| Pose { x: point.x, y: point.y, heading: Radians::ZERO });
    let behind = points.get(index + 1).map_or(point, |(_, point)| *point);
    let middle = bearing(before, &behind);
    let tried = if points.len() <= MOST_POINTS { COMPASS } else { 1 };
    (0..tried).map(|step| middle + TAU * f64::from(step) / f64::from(tried)).collect()
}

impl Word {
    /// Length for a radius of 1.
    fn length(&self) -> f64 {
        self.lengths.iter().sum()
    }
}

/// The shortest way between two poses.
fn shortest(from: Pose, to: Pose, radius: f64) -> Word {
    let seen = to.seen_from(from);
    let (x, y) = (seen.x.0 / radius, seen.y.0 / radius);
    let d = x.hypot(y);
    // The frame in which the line between the two places is the x axis: α and β are the headings there.
    let direction = if d > 0.0 { y.atan2(x) } else { 0.0 };
    let (alpha, beta) = (turn(-direction), turn(seen.heading.0 - direction));
    let words = words(alpha, beta, d);
    let straight = Word { parts: [Left, Straight, Left], lengths: [0.0, d, 0.0] };
    words.into_iter().flatten().min_by(|a, b| a.length().total_cmp(&b.length())).unwrap_or(straight)
}

/// The six ways, as far as they exist (Shkel and Lumelsky, equations 11 to 19).
fn words(alpha: f64, beta: f64, d: f64) -> [Option<Word>; 6] {
    let ((sa, ca), (sb, cb)) = (alpha.sin_cos(), beta.sin_cos());
    let cab = (alpha - beta).cos();
    let word = |parts, t: f64, p: f64, q: f64| Some(Word { parts, lengths: [turn(t), p, turn(q)] });
    // What is negative by rounding alone is nothing.
    let root = |square: f64| (square > -1e-12).then(|| square.max(0.0).sqrt());

    let lsl = root(2.0 + d * d - 2.0 * cab + 2.0 * d * (sa - sb)).and_then(|p| {
        let angle = (cb - ca).atan2(d + sa - sb);
        word([Left, Straight, Left], angle - alpha, p, beta - angle)
    });
    let rsr = root(2.0 + d * d - 2.0 * cab + 2.0 * d * (sb - sa)).and_then(|p| {
        let angle = (ca - cb).atan2(d - sa + sb);
        word([Right, Straight, Right], alpha - angle, p, angle - beta)
    });
    let lsr = root(d * d - 2.0 + 2.0 * cab + 2.0 * d * (sa + sb)).and_then(|p| {
        let angle = (-ca - cb).atan2(d + sa + sb) - (-2.0_f64).atan2(p);
        word([Left, Straight, Right], angle - alpha, p, angle - beta)
    });
    let rsl = root(d * d - 2.0 + 2.0 * cab - 2.0 * d * (sa + sb)).and_then(|p| {
        let angle = (ca + cb).atan2(d - sa - sb) - 2.0_f64.atan2(p);
        word([Right, Straight, Left], alpha - angle, p, beta - angle)
    });
    let curve = |cosine: f64| (cosine.abs() <= 1.0).then(|| turn(TAU - cosine.acos()));
    let rlr = curve((6.0 - d * d + 2.0 * cab + 2.0 * d * (sa - sb)) / 8.0).and_then(|p| {
        let t = alpha - (ca - cb).atan2(d - sa + sb) + p / 2.0;
        word([Right, Left, Right], t, p, alpha - beta - t + p)
    });
    let lrl = curve((6.0 - d * d + 2.0 * cab + 2.0 * d * (sb - sa)) / 8.0).and_then(|p| {
        let t = -alpha + (cb - ca).atan2(d + sa - sb) + p / 2.0;
        word([Left, Right, Left], t, p, beta - alpha - t + p)
    });
    [lsl, rsr, lsr, rsl, rlr, lrl]
}

/// An angle from 0 up to a full turn.
fn turn(angle: f64) -> f64 {
    let turn = angle.rem_euclid(TAU);
    if TAU - turn < LEAST { 0.0 } else { turn }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{end, given, planned};
    use axle_schema::PlanStrategy;
    use proptest::prelude::*;

    fn end_of(word: &Word, from: Pose, radius: f64) -> Pose {
        word.parts.iter().zip(word.lengths).fold(from, |pose, (part, length)| {
            let arc = |radius: f64, angle| Geometry::Arc { radius: Metres(radius), angle: Radians(angle) };
            let geometry = match part {
                Left => arc(radius, length),
                Right => arc(-radius, -length),
                Straight => Geometry::Line { length: Metres(length * radius) },
            };
            geometry.end_from(pose)
        })
    }

    #[test]
    fn lengths_are_those_that_others_found() {
        use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
        // Start, goal, radius and length; the first start and goal are those of a test of PythonRobotics, and all
        // lengths were found independently, from the closed forms and from the tangents of circles.
        let cases = [
            ([1.0, 1.0, FRAC_PI_4], [-3.0, -3.0, -FRAC_PI_4], 1.0, 9.475_401_840_016_211),
            ([0.0, 0.0, FRAC_PI_2], [1.0, 0.0, FRAC_PI_2], 1.0, 7.283_185_307_179_586),
            ([0.0; 3], [0.0, 0.0, PI], 2.0, 14.660_765_716_752_366),
            ([0.0; 3], [5.0, 5.0, 3.0], 1.0, 8.715_667_935_298_356),
            ([0.0; 3], [0.0, 2.0, PI], 1.0, PI),
        ];
        for (from, to, radius, length) in cases {
            let pose = |[x, y, heading]: [f64; 3]| Pose::new(x, y, heading);
            let found = shortest(pose(from), pose(to), radius).length() * radius;
            assert!((found - length).abs() < 1e-8, "{from:?} to {to:?}: {found}, not {length}");
        }
    }

    #[test]
    fn a_way_back_beside_itself_is_half_a_circle() {
        let plan = planned(&given(PlanStrategy::Dubins), "0,1,3.141592653589793");
        assert_eq!(plan.legs.len(), 1, "{:?}", plan.legs);
        assert!((plan.length.0 - std::f64::consts::PI * 0.5).abs() < 1e-9, "{}", plan.length);
    }

    #[test]
    fn without_headings_the_way_is_hardly_longer_than_its_lines() {
        let plan = planned(&given(PlanStrategy::Dubins), "4,0 8,1 12,1");
        let lines = 4.0 + 17.0_f64.sqrt() + 4.0;
        assert!(plan.length.0 >= lines && plan.length.0 < lines * 1.01, "{} for {lines}", plan.length);
        let end = end(&plan);
        assert!((end.x.0 - 12.0).hypot(end.y.0 - 1.0) < 1e-9, "{end:?}");
    }

    proptest! {
        #[test]
        fn every_word_ends_at_the_goal_and_none_is_shorter_than_the_line(
            (x, y, heading) in (-6.0..6.0, -6.0..6.0, -4.0..4.0),
            (x0, y0, heading0) in (-6.0..6.0, -6.0..6.0, -4.0..4.0),
            radius in 0.1..3.0,
        ) {
            let (from, to) = (Pose::new(x0, y0, heading0), Pose::new(x, y, heading));
            let seen = to.seen_from(from);
            let direction = seen.y.0.atan2(seen.x.0);
            let d = seen.x.0.hypot(seen.y.0) / radius;
            let all = words(turn(-direction), turn(seen.heading.0 - direction), d);
            prop_assert!(all[0].is_some() && all[1].is_some(), "LSL and RSR always exist");
            for word in all.iter().flatten() {
                let end = end_of(word, from, radius);
                prop_assert!(end.distance(to).0 < 1e-6 * radius, "{word:?} ends at {end:?}, not at {to:?}");
                prop_assert!(Radians(end.heading.0 - to.heading.0).wrapped().0.abs() < 1e-6);
                prop_assert!(word.length() * radius >= from.distance(to).0 - 1e-9);
            }
            let best = shortest(from, to, radius);
            let backward = |pose: Pose| Pose { heading: Radians(pose.heading.0 + std::f64::consts::PI), ..pose };
            let back = shortest(backward(to), backward(from), radius);
            prop_assert!((best.length() - back.length()).abs() < 1e-6, "as long as its mirror image in time");
        }
    }
}
