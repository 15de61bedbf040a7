//! The searches against published scenarios, and against each other.

use super::*;
use crate::terrain::Terrain;
use axle_maps::{Grid, Unknown};
use axle_schema::{Metres, Pose};
use proptest::prelude::*;

/// A file of the benchmarks.
macro_rules! data {
    ($name:literal) => {
        include_str!(concat!("../../tests/data/", $name))
    };
}

/// A map of the benchmarks of N. Sturtevant ("Benchmarks for Grid-Based Pathfinding", 2012; Open Data Commons
/// Attribution), whose rows go down.
fn terrain(text: &str) -> Terrain {
    let rows: Vec<&str> = text.lines().skip(4).collect();
    let cells = rows.iter().rev().flat_map(|row| row.bytes());
    let cells = cells.map(|letter| if b".GS".contains(&letter) { 0 } else { 100 }).collect();
    let grid = Grid::new("benchmark", Metres(1.0), Pose::default(), rows[0].len(), cells).expect("a map");
    Terrain::of(&grid.to_data().expect("a message"), Unknown::Blocked).expect("a map")
}

/// Start, goal and optimal length of every row of a scenario, with half a unit of the last digit that is printed.
fn scenarios(text: &str, height: i32) -> Vec<(Cell, Cell, f64, f64)> {
    let rows = text.lines().skip(1).filter(|line| !line.is_empty());
    let rows = rows.map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |index: usize| words[index].parse::<i32>().expect("a number");
        let cell = |index: usize| (number(index), height - 1 - number(index + 1));
        let digits = words[8].split_once('.').map_or(0, |(_, digits)| digits.len());
        let half = 0.5 * 10_f64.powi(-i32::try_from(digits).expect("few digits"));
        (cell(4), cell(6), words[8].parse().expect("a length"), half)
    });
    rows.collect()
}

/// Every cell costs its length.
fn free_of(terrain: &Terrain) -> Toll<'_> {
    Toll { distances: terrain.clearance().distances(), room: 0.0, comfort: 0.0, weight: 0.0 }
}

fn unwatched(_: f64) -> Result<(), Refusal> {
    Ok(())
}

/// The length of a way over cells, which must be free all along.
fn length(cells: &Cells, way: &[Cell]) -> f64 {
    let mut sum = 0.0;
    for pair in way.windows(2) {
        let (mut at, to) = (pair[0], pair[1]);
        while at != to {
            let (dx, dy) = ((to.0 - at.0).signum(), (to.1 - at.1).signum());
            assert!(
                cells.is_free((at.0 + dx, at.1)) && cells.is_free((at.0, at.1 + dy)),
                "{at:?} cuts a corner"
            );
            at = (at.0 + dx, at.1 + dy);
            assert!(cells.is_free(at), "{at:?} is not free");
            sum += if dx != 0 && dy != 0 { SQRT_2 } else { 1.0 };
        }
    }
    sum
}

#[test]
fn ways_are_as_long_as_the_published_optimal_ones() {
    let cases = [
        (data!("empty-16-16.map"), data!("empty-16-16-even-1.scen"), 1),
        (data!("empty-16-16.map"), data!("empty-16-16-random-1.scen"), 1),
        (data!("arena.map"), data!("arena.map.scen"), 1),
        (data!("room-32-32-4.map"), data!("room-32-32-4-even-1.scen"), 1),
        (data!("room-32-32-4.map"), data!("room-32-32-4-random-1.scen"), 1),
        (data!("room-64-64-8.map"), data!("room-64-64-8-even-1.scen"), 1),
        (data!("room-64-64-8.map"), data!("room-64-64-8-random-1.scen"), 1),
        (data!("warehouse-10-20-10-2-1.map"), data!("warehouse-10-20-10-2-1-even-1.scen"), 1),
        (data!("warehouse-10-20-10-2-1.map"), data!("warehouse-10-20-10-2-1-random-1.scen"), 1),
        (data!("maze-32-32-2.map"), data!("maze-32-32-2-even-1.scen"), 1),
        (data!("maze-32-32-2.map"), data!("maze-32-32-2-random-1.scen"), 1),
        (data!("random-32-32-20.map"), data!("random-32-32-20-even-1.scen"), 1),
        (data!("random-32-32-20.map"), data!("random-32-32-20-random-1.scen"), 1),
        // The bench looks at more rows of the large one.
        (data!("maze512-32-0.map"), data!("maze512-32-0.map.scen"), 20),
    ];
    let mut count = 0;
    for (map, scenario, step) in cases {
        let terrain = terrain(map);
        let cells = Cells::new(&terrain, 0.0, &mut unwatched).expect("unwatched");
        for (start, goal, optimal, half) in scenarios(scenario, cells.height as i32).into_iter().step_by(step)
        {
            let (found, way) = jump(&cells, start, goal, &mut unwatched).expect("unwatched").expect("a way");
            assert!((found - optimal).abs() <= half + 1e-6, "{start:?} to {goal:?}: {found}, not {optimal}");
            assert!((length(&cells, &way) - found).abs() < 1e-9, "{start:?} to {goal:?}");
            count += 1;
            // The other search is slower; some rows of the smaller maps will do.
            if count % 10 == 0 && step == 1 {
                let found =
                    weighed(&cells, start, goal, &free_of(&terrain), &mut unwatched).expect("unwatched");
                let (found, way) = found.expect("a way");
                assert!(
                    (found - optimal).abs() <= half + 1e-6 && (length(&cells, &way) - found).abs() < 1e-9
                );
            }
        }
    }
    assert!(count > 4700, "{count} rows");
}

#[test]
fn a_search_says_how_far_it_is_and_ends_when_it_is_told_to() {
    let terrain = terrain(data!("maze512-32-0.map"));
    let cells = Cells::new(&terrain, 0.0, &mut unwatched).expect("unwatched");
    let free: Vec<Cell> = (0..cells.width as i32)
        .flat_map(|x| (0..cells.height as i32).map(move |y| (x, y)))
        .filter(|&cell| cells.is_free(cell))
        .collect();
    let mut heard = Vec::new();
    let mut watch = |fraction| {
        heard.push(fraction);
        if heard.len() == 3 { Err(Refusal::Failed { why: "enough".into() }) } else { Ok(()) }
    };
    let ended = weighed(&cells, free[0], free[free.len() - 1], &free_of(&terrain), &mut watch);
    assert_eq!(ended, Err(Refusal::Failed { why: "enough".into() }));
    assert!(heard.len() == 3 && heard.iter().all(|fraction| (0.0..=1.0).contains(fraction)), "{heard:?}");
}

/// A map of single obstacles.
fn scattered(width: usize, solid: Vec<bool>) -> Terrain {
    let mut cells: Vec<u8> = solid.into_iter().map(|solid| if solid { 100 } else { 0 }).collect();
    cells.resize(cells.len().div_ceil(width) * width, 0);
    let grid = Grid::new("m", Metres(1.0), Pose::default(), width, cells).expect("a map");
    Terrain::of(&grid.to_data().expect("a message"), Unknown::Blocked).expect("a map")
}

proptest! {
    #[test]
    fn both_searches_find_the_same_length_or_nothing(
        width in 2_usize..30,
        cells in proptest::collection::vec(proptest::bool::weighted(0.3), 4..500),
        (a, b) in (any::<proptest::sample::Index>(), any::<proptest::sample::Index>()),
    ) {
        let terrain = scattered(width, cells);
        let cells = Cells::new(&terrain, 0.0, &mut unwatched).expect("unwatched");
        let cell = |index: proptest::sample::Index| {
            let number = index.index(cells.count());
            ((number % cells.width) as i32, (number / cells.width) as i32)
        };
        let (start, goal) = (cell(a), cell(b));
        let jumped = jump(&cells, start, goal, &mut unwatched).expect("unwatched");
        let stepped = weighed(&cells, start, goal, &free_of(&terrain), &mut unwatched).expect("unwatched");
        match (jumped, stepped) {
            (Some((one, way)), Some((other, _))) => {
                prop_assert!((one - other).abs() < 1e-9, "{one} and {other}");
                prop_assert!((length(&cells, &way) - one).abs() < 1e-9);
                let back = jump(&cells, goal, start, &mut unwatched).expect("unwatched").expect("a way");
                prop_assert!((back.0 - one).abs() < 1e-9, "as long as the way back");
            }
            (None, None) => {}
            (one, other) => prop_assert!(false, "{one:?} and {other:?}"),
        }
    }

    #[test]
    fn the_way_is_the_cheapest_of_all(
        width in 2_usize..24,
        cells in proptest::collection::vec(proptest::bool::weighted(0.06), 4..500),
        (a, b) in (any::<proptest::sample::Index>(), any::<proptest::sample::Index>()),
        (room, wish, comfort, weight) in (0.0..1.2, 0.0..0.7, 0.0..4.0, 0.0..5.0),
    ) {
        let terrain = scattered(width, cells);
        let cells = Cells::new(&terrain, room + wish, &mut unwatched).expect("unwatched");
        let toll = Toll { distances: terrain.clearance().distances(), room, comfort, weight };
        let cell = |index: proptest::sample::Index| cells.cell(index.index(cells.count()) as u32);
        let (start, goal) = (cell(a), cell(b));
        let found = weighed(&cells, start, goal, &toll, &mut unwatched).expect("unwatched");
        // Bellman and Ford's way: every step is tried until nothing becomes cheaper.
        let mut costs = vec![f64::INFINITY; cells.count()];
        if cells.is_free(start) && cells.is_free(goal) {
            costs[cells.number(start) as usize] = 0.0;
        }
        let mut changes = true;
        while changes {
            changes = false;
            for number in 0..cells.count() {
                let (x, y) = cells.cell(number as u32);
                for (dx, dy) in DIRECTIONS {
                    let next = (x + dx, y + dy);
                    if cells.is_free(next) && cells.is_free((x, next.1)) && cells.is_free((next.0, y)) {
                        let place = cells.number(next) as usize;
                        let cost = costs[number] + f64::from(dx * dx + dy * dy).sqrt() * (1.0 + toll.price(place));
                        if cost < costs[place] - 1e-12 {
                            (costs[place], changes) = (cost, true);
                        }
                    }
                }
            }
        }
        let least = costs[cells.number(goal) as usize];
        match found {
            Some((cost, way)) => {
                prop_assert!((cost - least).abs() < 1e-9, "{cost}, and {least} is possible");
                prop_assert!(way[0] == start && way[way.len() - 1] == goal);
                let steps = way.windows(2).map(|pair| {
                    length(&cells, pair) * (1.0 + toll.price(cells.number(pair[1]) as usize))
                });
                prop_assert!((steps.sum::<f64>() - cost).abs() < 1e-9, "the way costs what it is said to");
                prop_assert!(way.windows(2).all(|pair| octile(pair[0], pair[1]) < 1.5), "step by step");
            }
            None => prop_assert!(least.is_infinite(), "{least} is possible"),
        }
    }
}
