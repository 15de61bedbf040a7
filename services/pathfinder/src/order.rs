//! A short order of many way points: from the start through all of them, wherever the way ends.
//!
//! Up to twelve points the order is the shortest there is (Held and Karp, "A Dynamic Programming Approach to Sequencing
//! Problems", 1962). Beyond, the nearest point next is the beginning, and turning parts of the way round (2-opt) and
//! moving points elsewhere (Or-opt) make it shorter until nothing helps or the work that is allowed is done. Where
//! there are not too many, two of its parts are then exchanged at random and the same is tried again, some times over
//! (O. Martin, S. Otto and E. Felten, "Large-Step Markov Chains for the Traveling Salesman Problem", 1991).

use crate::search::Watch;
use axle_schema::Refusal;

/// The most points for which the shortest order is found.
pub const EXACT: usize = 12;
/// The most distances that are looked at to make an order better.
const WORK: usize = 60_000_000;

/// How many times parts are exchanged, and the most points with which that is tried.
const KICKS: usize = 64;
const KICKED: usize = 128;

/// The order in which `count` points are visited; `distance(i, j)` is symmetric, and 0 stands for the start, 1 for the
/// first point.
///
/// # Errors
/// What `watch` ends it with.
pub(crate) fn order(
    count: usize,
    distance: impl Fn(usize, usize) -> f64,
    watch: Watch<'_>,
) -> Result<Vec<usize>, Refusal> {
    let tour = if count <= EXACT { exact(count, &distance) } else { improved(count, &distance, watch)? };
    Ok(tour.into_iter().map(|place| place - 1).collect())
}

/// The shortest order, as places 1 to `count`.
#[allow(clippy::indexing_slicing, reason = "sets and points are counted here")]
fn exact(count: usize, distance: &impl Fn(usize, usize) -> f64) -> Vec<usize> {
    if count == 0 {
        return Vec::new();
    }
    // The length of the shortest way from the start through the points of a set to one of them, and the one before it.
    let mut best = vec![(f64::INFINITY, 0_usize); (1 << count) * count];
    for last in 0..count {
        best[(1 << last) * count + last] = (distance(0, last + 1), 0);
    }
    for set in 1_usize..1 << count {
        for last in (0..count).filter(|last| set >> last & 1 == 1) {
            let so_far = best[set * count + last].0;
            for next in (0..count).filter(|next| set >> next & 1 == 0) {
                let length = so_far + distance(last + 1, next + 1);
                let place = &mut best[(set | 1 << next) * count + next];
                if length < place.0 {
                    *place = (length, last);
                }
            }
        }
    }
    let mut set = (1 << count) - 1;
    let mut last =
        (0..count).min_by(|&a, &b| best[set * count + a].0.total_cmp(&best[set * count + b].0)).unwrap_or(0);
    let mut tour = Vec::with_capacity(count);
    while set != 0 {
        tour.push(last + 1);
        let before = best[set * count + last].1;
        set &= !(1 << last);
        last = before;
    }
    tour.reverse();
    tour
}

/// A short order, as places 1 to `count`.
#[allow(clippy::indexing_slicing, reason = "places of the tour are counted here")]
fn improved(
    count: usize,
    distance: &impl Fn(usize, usize) -> f64,
    watch: Watch<'_>,
) -> Result<Vec<usize>, Refusal> {
    // The start stays at place 0 of the tour.
    let mut tour = vec![0];
    let mut rest: Vec<usize> = (1..=count).collect();
    while !rest.is_empty() {
        watch(0.0)?;
        let at = tour[tour.len() - 1];
        let nearest = (0..rest.len())
            .min_by(|&a, &b| distance(at, rest[a]).total_cmp(&distance(at, rest[b])))
            .unwrap_or(0);
        tour.push(rest.swap_remove(nearest));
    }
    let mut work = WORK;
    while two_opt(&mut tour, distance, &mut work, watch)? | or_opt(&mut tour, distance, &mut work, watch)? {}
    let length = |tour: &[usize]| tour.windows(2).map(|pair| distance(pair[0], pair[1])).sum::<f64>();
    let mut best = length(&tour);
    // The same points get the same order whenever somebody asks, so chance begins with the same number.
    let mut chance = 1_u64;
    for _ in 0..if (3..=KICKED).contains(&count) { KICKS } else { 0 } {
        let mut cuts = [0; 3].map(|_: usize| {
            // The generator of D. E. Knuth's MMIX; its upper bits are the good ones.
            chance = chance.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            #[allow(clippy::cast_possible_truncation, reason = "31 bits")]
            let draw = (chance >> 33) as usize;
            1 + draw % (count + 1)
        });
        cuts.sort_unstable();
        let mut other = tour.clone();
        other[cuts[0]..cuts[2]].rotate_left(cuts[1] - cuts[0]);
        while two_opt(&mut other, distance, &mut work, watch)?
            | or_opt(&mut other, distance, &mut work, watch)?
        {}
        let its = length(&other);
        if its < best - SHORTER {
            (tour, best) = (other, its);
        }
    }
    tour.remove(0);
    Ok(tour)
}

/// What counts as shorter, so that rounding does not go round in circles.
const SHORTER: f64 = 1e-9;

/// Turns parts of the way round wherever that makes it shorter.
#[allow(clippy::indexing_slicing, reason = "places of the tour are counted here")]
fn two_opt(
    tour: &mut [usize],
    distance: &impl Fn(usize, usize) -> f64,
    work: &mut usize,
    watch: Watch<'_>,
) -> Result<bool, Refusal> {
    let mut better = false;
    for first in 1..tour.len() {
        watch(0.0)?;
        for last in first + 1..tour.len() {
            let Some(left) = work.checked_sub(4) else { return Ok(false) };
            *work = left;
            let (before, a, b) = (tour[first - 1], tour[first], tour[last]);
            let mut gain = distance(before, a) - distance(before, b);
            // Behind the last point there is nothing.
            if let Some(&behind) = tour.get(last + 1) {
                gain += distance(b, behind) - distance(a, behind);
            }
            if gain > SHORTER {
                tour[first..=last].reverse();
                better = true;
            }
        }
    }
    Ok(better)
}

/// Moves one, two or three points that follow each other to another place wherever that makes the way shorter.
#[allow(clippy::indexing_slicing, reason = "places of the tour are counted here")]
fn or_opt(
    tour: &mut [usize],
    distance: &impl Fn(usize, usize) -> f64,
    work: &mut usize,
    watch: Watch<'_>,
) -> Result<bool, Refusal> {
    let mut better = false;
    let between = |a: Option<usize>, b: Option<usize>| match (a, b) {
        (Some(a), Some(b)) => distance(a, b),
        _ => 0.0,
    };
    for length in 1..=3 {
        for first in 1..tour.len().saturating_sub(length) {
            watch(0.0)?;
            let last = first + length - 1;
            let (before, behind) = (Some(tour[first - 1]), tour.get(last + 1).copied());
            let (a, b) = (Some(tour[first]), Some(tour[last]));
            let freed = between(before, a) + between(b, behind) - between(before, behind);
            let mut best = (SHORTER, None);
            for place in (0..tour.len()).filter(|&place| place + 1 < first || place > last) {
                let Some(left) = work.checked_sub(3) else { return Ok(false) };
                *work = left;
                let (c, d) = (Some(tour[place]), tour.get(place + 1).copied());
                for (from, to, turned) in [(a, b, false), (b, a, true)] {
                    let gain = freed - (between(c, from) + between(to, d) - between(c, d));
                    if gain > best.0 {
                        best = (gain, Some((place, turned)));
                    }
                }
            }
            if let (_, Some((place, turned))) = best {
                if turned {
                    tour[first..=last].reverse();
                }
                if place > last {
                    tour[first..=place].rotate_left(length);
                } else {
                    tour[place + 1..=last].rotate_right(length);
                }
                better = true;
            }
        }
    }
    Ok(better)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points() -> impl Strategy<Value = Vec<(f64, f64)>> {
        prop::collection::vec((0.0..10.0, 0.0..10.0), 2..9)
    }
    fn between(points: &[(f64, f64)]) -> impl Fn(usize, usize) -> f64 + '_ {
        |a, b| (points[a].0 - points[b].0).hypot(points[a].1 - points[b].1)
    }
    fn length(tour: &[usize], distance: impl Fn(usize, usize) -> f64) -> f64 {
        let mut at = 0;
        tour.iter().map(|&next| distance(std::mem::replace(&mut at, next), next)).sum()
    }
    /// The shortest of all orders.
    fn shortest(at: usize, rest: &[usize], distance: &dyn Fn(usize, usize) -> f64) -> f64 {
        let ways = rest.iter().map(|&next| {
            let others: Vec<usize> = rest.iter().copied().filter(|&other| other != next).collect();
            distance(at, next) + shortest(next, &others, distance)
        });
        ways.reduce(f64::min).unwrap_or(0.0)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn few_points_get_the_shortest_order(points in points()) {
            let count = points.len() - 1;
            let all: Vec<usize> = (1..=count).collect();
            let best = shortest(0, &all, &between(&points));
            let mut tour = exact(count, &between(&points));
            prop_assert!((length(&tour, between(&points)) - best).abs() < 1e-9);
            tour.sort_unstable();
            prop_assert_eq!(tour, all);
        }

        #[test]
        fn what_is_improved_visits_all_and_is_hardly_longer(points in points()) {
            let count = points.len() - 1;
            let best = length(&exact(count, &between(&points)), between(&points));
            let mut tour = improved(count, &between(&points), &mut |_| Ok(())).expect("unwatched");
            let found = length(&tour, between(&points));
            prop_assert!(found < best * 1.15 + 1e-9, "{found} for {best}");
            tour.sort_unstable();
            prop_assert_eq!(tour, (1..=count).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_thousand_points_get_an_order_that_is_far_shorter_than_theirs() {
        let points: Vec<(f64, f64)> =
            (0..=1000).map(f64::from).map(|n| ((n * 7.13).sin() * 50.0, (n * 3.7).cos() * 50.0)).collect();
        let given: Vec<usize> = (1..=1000).collect();
        let tour: Vec<usize> = order(1000, between(&points), &mut |_| Ok(()))
            .expect("unwatched")
            .into_iter()
            .map(|point| point + 1)
            .collect();
        let (before, after) = (length(&given, between(&points)), length(&tour, between(&points)));
        assert!(after < before / 10.0, "{after} for {before}");
    }
}
