//! Plans on maps: never through an obstacle, never longer than cell by cell, and refused with the reason.

use crate::tests::{end, given};
use crate::{Pathfinder, PathfinderParams};
use axle_maps::{Clearance, Grid, Unknown};
use axle_schema::contract::Functional as _;
use axle_schema::{Geometry, MapData, Metres, Plan, PlanAsk, PlanStrategy, Pose, Refusal, WayPoint, WayTask};
use proptest::prelude::*;

/// A map of letters, the uppermost row first: `#` is an obstacle. Its origin is (0, 0).
fn drawn(rows: &[&str], resolution: f64) -> Grid {
    let cells =
        rows.iter().rev().flat_map(|row| row.bytes()).map(|letter| if letter == b'#' { 100 } else { 0 });
    Grid::new("m", Metres(resolution), Pose::default(), rows[0].len(), cells.collect()).expect("a map")
}
fn said(grid: &Grid) -> Option<MapData> {
    Some(grid.to_data().expect("a message"))
}
fn params() -> PathfinderParams {
    PathfinderParams { body: Metres(0.2), margin: Metres(0.0), ..given(PlanStrategy::Map) }
}
fn planned(params: &PathfinderParams, grid: &Grid, from: (f64, f64), way: &str) -> Result<Plan, Refusal> {
    let way = WayTask::parse(way).expect("a way");
    let start = Some(Pose::new(from.0, from.1, 0.0));
    Pathfinder::answer(params, &PlanAsk { way, start, map: said(grid), ..PlanAsk::default() })
}

/// The smallest distance from a plan to an obstacle, in metres, looked at every few millimetres.
fn nearest(grid: &Grid, plan: &Plan) -> f64 {
    let clearance = Clearance::of(grid, Unknown::Blocked);
    let mut at = plan.start;
    let mut nearest = f64::INFINITY;
    for leg in &plan.legs {
        for part in 0..=200 {
            let share = f64::from(part) / 200.0;
            let part = match leg.geometry {
                Geometry::Line { length } => Geometry::Line { length: length * share },
                Geometry::Turn { angle } => Geometry::Turn { angle: angle * share },
                Geometry::Arc { radius, angle } => Geometry::Arc { radius, angle: angle * share },
            };
            let pose = part.end_from(at);
            let (u, v) = grid.in_cells(pose.x.0, pose.y.0);
            nearest = nearest.min(clearance.at(u, v, 1e3) * grid.resolution.0);
        }
        at = leg.geometry.end_from(at);
    }
    nearest
}

/// Two rooms of 2 m with a wall between them that has a gap of five cells, half a metre.
fn rooms() -> Grid {
    let open = ".".repeat(41);
    let wall = format!("{}#{}", ".".repeat(20), ".".repeat(20));
    let rows: Vec<&str> = (0..21).map(|row| if (8..13).contains(&row) { &*open } else { &*wall }).collect();
    drawn(&rows, 0.1)
}

#[test]
fn the_way_goes_through_the_gap_and_keeps_its_distance() {
    let plan = planned(&params(), &rooms(), (0.5, 0.5), "3.5,0.5").expect("a plan");
    let (last, near) = (end(&plan), nearest(&rooms(), &plan));
    assert!((last.x.0 - 3.5).hypot(last.y.0 - 0.5) < 1e-9, "{last:?}");
    assert!(near >= 0.2 - 1e-3, "{near} m from an obstacle");
    let clearance = plan.clearance.expect("on a map").0;
    assert!((clearance - (near - 0.2).max(0.0)).abs() < 2e-3, "{clearance} beside {near}");
    // Straight to the gap and straight on: 2 · hypot(1.55, 0.55) m at least, if the way has no width.
    assert!(plan.length.0 > 3.1 && plan.length.0 < 3.9, "{}", plan.length);
    assert!(
        plan.legs.iter().any(|leg| matches!(leg.geometry, Geometry::Arc { .. })),
        "it is rounded: {plan:?}"
    );
}

#[test]
fn what_cannot_be_reached_is_refused_with_the_reason() {
    let mut wide = params();
    wide.body = Metres(0.28);
    let check = |params: &PathfinderParams, grid: &Grid, way: &str, words: &str| {
        let refusal = planned(params, grid, (0.5, 0.5), way).expect_err(words).to_string();
        assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
    };
    check(&wide, &rooms(), "3.5,0.5", "the way to point 1 is too narrow by 3.0 cm at (2.05, 1.05) m");
    check(&wide, &rooms(), "0.5,0.8 1.75,0.5", "way point 2 (1.75 m, 0.5 m) is too narrow by 3.0 cm");
    check(&params(), &rooms(), "2.05,0.2", "way point 1 (2.05 m, 0.2 m) is inside an obstacle");
    check(
        &params(),
        &rooms(),
        "9,9",
        "is outside the map, which reaches from (0.00, 0.00) to (4.10, 2.10) m",
    );
    let shut = drawn(&["..#..", "..#..", "..#..", "..#..", "..#.."], 0.5);
    check(&params(), &shut, "2.25,1.25", "no way leads to point 1, however small the robot: it is walled in");
    let refusal = planned(&params(), &rooms(), (2.05, 0.2), "0.5,0.5").expect_err("a wall").to_string();
    assert!(refusal.contains("the start (2.05 m, 0.2 m) is inside an obstacle"), "{refusal}");
}

#[test]
fn other_strategies_are_held_to_the_map_as_well() {
    let through = |strategy| planned(&given(strategy), &rooms(), (0.5, 0.5), "3.5,0.5");
    let refusal = through(PlanStrategy::TurnAndGo).expect_err("through a wall").to_string();
    assert!(
        refusal.contains("leg 1 to point 1 leads through an obstacle or out of the map at (2.0"),
        "{refusal}"
    );
    let plan = planned(&given(PlanStrategy::TurnAndGo), &rooms(), (0.5, 0.5), "0.5,1.5").expect("free");
    assert!((plan.clearance.expect("on a map").0 - 0.25).abs() < 1e-6, "{plan:?}");
}

#[test]
fn an_order_on_a_map_counts_the_ways_around() {
    // Behind the wall is near in a straight line and far around it.
    let mut rows = vec![".....#....."; 10];
    rows.push("...........");
    let mut params = params();
    params.body = Metres(0.1);
    let ask = |map| PlanAsk {
        way: WayTask::parse("3.25,5.25 0.25,5.25").expect("a way"),
        start: Some(Pose::new(2.25, 5.25, 0.0)),
        reorder: true,
        map,
        ..PlanAsk::default()
    };
    let on = Pathfinder::answer(&params, &ask(said(&drawn(&rows, 0.5)))).expect("a plan");
    assert_eq!(on.order, [1, 0]);
    let straight = PathfinderParams { strategy: PlanStrategy::TurnAndGo, ..params };
    assert_eq!(Pathfinder::answer(&straight, &ask(None)).expect("a plan").order, [0, 1]);
}

/// A serpentine of 512 x 512 cells: every eighth row is a wall that is open at one end, left and right in turn.
fn serpentine() -> Grid {
    let side = 512;
    let is_solid =
        |x: usize, y: usize| y % 8 == 7 && if (y / 8).is_multiple_of(2) { x < side - 8 } else { x >= 8 };
    let cells = (0..side * side).map(|index| if is_solid(index % side, index / side) { 100 } else { 0 });
    Grid::new("m", Metres(0.1), Pose::default(), side, cells.collect()).expect("a map")
}

#[test]
fn whoever_no_longer_waits_ends_the_plan_wherever_it_is() {
    let map = said(&serpentine()).expect("a map");
    let points = |way| WayTask::parse(way).expect("a way");
    let ask = |way, reorder| PlanAsk {
        way: points(way),
        start: Some(Pose::new(0.35, 0.35, 0.0)),
        reorder,
        ..PlanAsk::default()
    };
    let ended = Refusal::Failed { why: "enough".into() };
    let cases = [
        (PlanStrategy::Map, 1.0, ask("0.35,50.75", false), 1000),
        (PlanStrategy::Map, 0.0, ask("0.35,50.75", false), 100),
        (PlanStrategy::Map, 0.0, ask("0.35,9.15 0.35,5.15 0.35,3.55", true), 100),
        (PlanStrategy::TurnAndGo, 0.0, ask("50.8,0.35 0.35,0.35 50.8,0.35", false), 20),
    ];
    for (strategy, clearance_weight, ask, least) in cases {
        let params = PathfinderParams { strategy, clearance_weight, ..params() };
        // It looks at whether to go on `looks` times, and is told to end at the last.
        let after = |looks: usize| {
            let mut looked = 0;
            let mut watch = |_| {
                looked += 1;
                if looked < looks { Ok(()) } else { Err(ended.clone()) }
            };
            let terrain = crate::Terrain::watched(&map, Unknown::Blocked, &mut watch);
            let found = terrain.and_then(|terrain| crate::plan(&params, &ask, Some(&terrain), &mut watch));
            (found.map(|plan| plan.legs.len()), looked)
        };
        let (found, all) = after(usize::MAX);
        assert!(found.is_ok() && all > least, "{found:?} after {all} looks: {strategy}");
        for part in 1..=12 {
            let looks = (all * part / 12).max(1);
            assert_eq!(after(looks), (Err(ended.clone()), looks), "{strategy}: {looks} of {all}");
        }
    }
}

#[test]
fn a_leg_that_leaves_the_map_is_not_followed_to_its_far_end() {
    let terrain = crate::Terrain::of(&said(&rooms()).expect("a map"), Unknown::Blocked).expect("a map");
    let far = WayTask { points: vec![WayPoint::at(1e5, 0.5); 1] };
    let ask = PlanAsk { way: far, start: Some(Pose::new(0.5, 0.5, 0.0)), ..PlanAsk::default() };
    let mut looked = 0;
    let refused = crate::plan(&given(PlanStrategy::TurnAndGo), &ask, Some(&terrain), &mut |_| {
        looked += 1;
        Ok(())
    });
    let refusal = refused.expect_err("through the wall").to_string();
    assert!(
        refusal.contains("through an obstacle or out of the map at (2.0") && looked < 10,
        "{refusal}: {looked}"
    );
}

/// A file of the benchmarks.
macro_rules! data {
    ($name:literal) => {
        include_str!(concat!("../../tests/data/", $name))
    };
}

#[test]
fn a_way_is_never_longer_than_cell_by_cell() {
    let cases = [
        (data!("warehouse-10-20-10-2-1.map"), data!("warehouse-10-20-10-2-1-even-1.scen"), 9),
        (data!("arena.map"), data!("arena.map.scen"), 4),
        (data!("room-64-64-8.map"), data!("room-64-64-8-random-1.scen"), 25),
        (data!("maze-32-32-2.map"), data!("maze-32-32-2-random-1.scen"), 7),
        (data!("random-32-32-20.map"), data!("random-32-32-20-random-1.scen"), 8),
    ];
    let (mut count, mut shorter) = (0, 0);
    for (text, scenario, step) in cases {
        let rows: Vec<String> =
            text.lines().skip(4).map(|row| row.replace(['@', 'T', 'O', 'W'], "#")).collect();
        let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
        let grid = drawn(&rows, 1.0);
        let map = said(&grid);
        let terrain = crate::Terrain::of(map.as_ref().expect("a map"), Unknown::Blocked).expect("a map");
        let mut params = params();
        (params.body, params.clearance_weight) = (Metres(0.0), 0.0);
        for line in scenario.lines().skip(1).step_by(step) {
            let words: Vec<&str> = line.split_whitespace().collect();
            let number = |index: usize| words[index].parse::<f64>().expect("a number");
            let point = |index: usize| (number(index) + 0.5, rows.len() as f64 - 0.5 - number(index + 1));
            let ((x0, y0), (x, y)) = (point(4), point(6));
            let way = WayTask { points: vec![WayPoint::at(x, y)] };
            let ask = PlanAsk { way, start: Some(Pose::new(x0, y0, 0.0)), ..PlanAsk::default() };
            let plan = crate::plan(&params, &ask, Some(&terrain), &mut |_| Ok(())).expect("a plan");
            let optimal = number(8);
            // Lengths that are printed to six digits are known to half of the last one.
            assert!(plan.length.0 <= optimal * (1.0 + 5e-6) + 1e-6, "{} for {optimal}: {line}", plan.length);
            assert!(plan.length.0 >= (x - x0).hypot(y - y0) - 1e-6);
            count += 1;
            shorter += usize::from(plan.length.0 < optimal - 0.1);
        }
    }
    assert!(shorter * 3 > count, "{shorter} of {count} are shorter at any angle");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn no_plan_comes_nearer_to_an_obstacle_than_the_robot_is_wide(
        solid in proptest::collection::vec((0..40_usize, 0..40_usize), 1..25),
        (from, to) in ((0.3..3.7_f64, 0.3..3.7_f64), (0.3..3.7_f64, 0.3..3.7_f64)),
        (weight, margin, radius) in (0.0..3.0, 0.0..0.1, 0.05..1.0),
    ) {
        let mut cells = vec![0; 1600];
        for (column, row) in solid {
            cells[row * 40 + column] = 100;
        }
        let grid = Grid::new("m", Metres(0.1), Pose::default(), 40, cells).expect("a map");
        let params = PathfinderParams {
            clearance_weight: weight,
            margin: Metres(margin),
            radius: Metres(radius),
            ..params()
        };
        match planned(&params, &grid, from, &format!("{},{}", to.0, to.1)) {
            Ok(plan) => {
                prop_assert!(nearest(&grid, &plan) >= 0.2 - 1e-3, "{} m in {plan:?}", nearest(&grid, &plan));
                let last = end(&plan);
                prop_assert!((last.x.0 - to.0).hypot(last.y.0 - to.1) < 1e-3, "ends at {last:?}");
            }
            Err(refusal) => prop_assert!(matches!(refusal, Refusal::Unreachable { .. }), "{refusal}"),
        }
    }
}
