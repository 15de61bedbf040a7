//! Plans on a maze of 512 x 512 cells, beside the A* of the crate `pathfinding` on the same grid; a plain plan; and how
//! soon a plan on the largest map ends when nobody waits for it any more.
//!
//! `cargo bench -p axle-pathfinder` prints how long a plan takes, shortened at any angle and rounded: median, 99 of 100
//! and largest, and how many times as long the other search needs. It looks at every twelfth row of the scenario, of all
//! lengths, and takes the best of three runs, since others share the machine. Times are of this machine and not judged.
//! The bench fails where a way is longer than the published one, where the ratio to the other search is far from what it
//! was, and where a plan looks too rarely at whether it shall end.

#![allow(clippy::print_stdout, clippy::expect_used, reason = "a bench prints, and its data are known")]
#![allow(clippy::disallowed_methods, reason = "a bench measures time")]
#![allow(clippy::indexing_slicing, reason = "its data are known")]

use axle_maps::{Grid, Unknown};
use axle_pathfinder::{PathfinderParams, Terrain, plan};
use axle_schema::{MapData, Metres, Plan, PlanAsk, PlanStrategy, Pose, Refusal, WayPoint, WayTask};
use std::hint::black_box;
use std::time::Instant;

const MAP: &str = include_str!("../tests/data/maze512-32-0.map");
const ROWS: &str = include_str!("../tests/data/maze512-32-0.map.scen");
/// Of so many rows one is planned, and so many times.
const STEP: usize = 12;
const RUNS: usize = 3;
/// Side of a cell where nothing but Pathfinder's own parameters counts.
const USUAL: f64 = 0.05;

fn main() {
    maze();
    turn_and_go();
    largest();
}

/// What is measured: what people call it, how many times as fast as the other search it must be, and the times in s.
struct Row {
    name: &'static str,
    least: f64,
    times: Vec<f64>,
}

fn maze() {
    let rows: Vec<&str> = MAP.lines().skip(4).collect();
    let (width, height) = (rows[0].len(), rows.len());
    let cells = rows.iter().rev().flat_map(|row| row.bytes());
    let cells: Vec<u8> = cells.map(|letter| if b".GS".contains(&letter) { 0 } else { 100 }).collect();
    let free: Vec<bool> = cells.iter().map(|&cell| cell == 0).collect();
    let map = |side: f64| {
        let grid = Grid::new("maze", Metres(side), Pose::default(), width, cells.clone()).expect("a map");
        grid.to_data().expect("a message")
    };
    let begun = Instant::now();
    let coarse = Terrain::of(&map(1.0), Unknown::Blocked).expect("a map");
    let ready = begun.elapsed().as_secs_f64();
    println!("a map of {width} x {height} cells is ready after {:.1} ms", 1e3 * ready);
    let fine = Terrain::of(&map(USUAL), Unknown::Blocked).expect("a map");

    let usual = PathfinderParams { strategy: PlanStrategy::Map, ..PathfinderParams::default() };
    let (body, margin) = (Metres(0.0), Metres(0.0));
    let shortest = PathfinderParams { body, margin, clearance_weight: 0.0, ..usual.clone() };
    let clear = PathfinderParams { body, margin, comfort: Metres(3.0), ..usual.clone() };
    let [mut shortest_row, mut clear_row, mut usual_row] =
        [("shortest", 8.0), ("3 cells clear", 1.5), ("as it comes", 1.5)].map(|(name, least)| Row {
            name,
            least,
            times: Vec::new(),
        });
    let mut others = Vec::new();
    for line in ROWS.lines().skip(1).step_by(STEP) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |index: usize| words[index].parse::<usize>().expect("a number");
        let cell = |index: usize| (number(index), height - 1 - number(index + 1));
        let (start, goal) = (cell(4), cell(6));
        let optimal: f64 = words[8].parse().expect("a length");
        let ask = |side: f64| {
            let place = |(x, y): (usize, usize)| (side * (x as f64 + 0.5), side * (y as f64 + 0.5));
            let ((x0, y0), (x, y)) = (place(start), place(goal));
            let (way, start) = (WayTask { points: vec![WayPoint::at(x, y)] }, Some(Pose::new(x0, y0, 0.0)));
            PlanAsk { way, start, ..PlanAsk::default() }
        };
        let planned = |params, side, terrain| {
            best(|| plan(params, black_box(&ask(side)), Some(terrain), &mut |_| Ok(())))
        };
        // The published lengths have two digits behind the point.
        let check = |found: Plan, side: f64, most: f64| {
            let length = found.length.0 / side;
            assert!(length <= most, "{length} cells, and {optimal} is possible: {line}");
        };
        let (time, found) = planned(&shortest, 1.0, &coarse);
        shortest_row.times.push(time);
        check(found.expect("a plan"), 1.0, optimal + 0.006);
        let (time, found) = planned(&clear, 1.0, &coarse);
        clear_row.times.push(time);
        check(found.expect("a plan"), 1.0, 1.5 * optimal + 0.01);
        match planned(&usual, USUAL, &fine) {
            (time, Ok(found)) => {
                usual_row.times.push(time);
                check(found, USUAL, 2.0 * optimal + 0.01);
            }
            // Some rows begin or end where only a robot without a body has room.
            (_, Err(refusal)) => assert!(refusal.to_string().contains("too narrow"), "{refusal}: {line}"),
        }
        let (time, found) = best(|| other(&free, (width, height), start, goal));
        others.push(time);
        assert!((f64::from(found) / 1e6 - optimal).abs() < 0.01, "the same lengths");
    }
    let their_median = quantile(&mut others, 0.5);
    println!("the A* of pathfinding: {}", spread(&mut others));
    for Row { name, least, mut times } in [shortest_row, clear_row, usual_row] {
        let ratio = their_median / quantile(&mut times, 0.5);
        println!("map, {name:>13}: {}; the A* takes {ratio:.1} times as long", spread(&mut times));
        assert!(ratio > least, "the other search takes only {ratio:.1} times as long as a plan, {name}");
        assert!(times.len() > 10, "only {} rows were planned, {name}", times.len());
    }
}

/// The shortest time of some runs, in s, and what came out.
fn best<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let mut runs = (0..RUNS).map(|_| {
        let begun = Instant::now();
        let found = run();
        (begun.elapsed().as_secs_f64(), found)
    });
    let first = runs.next().expect("a run");
    runs.fold(first, |best, next| if next.0 < best.0 { next } else { best })
}

fn quantile(times: &mut [f64], share: f64) -> f64 {
    times.sort_by(f64::total_cmp);
    times[((times.len() - 1) as f64 * share).ceil() as usize]
}

fn spread(times: &mut [f64]) -> String {
    let [median, p99, most] = [0.5, 0.99, 1.0].map(|share| 1e3 * quantile(times, share));
    format!("median {median:.2} ms, p99 {p99:.2} ms, most {most:.2} ms in {} rows", times.len())
}

/// The length of a shortest way, in millionths of a cell: that crate wants whole numbers or something like them.
fn other(free: &[bool], (width, height): (usize, usize), start: (usize, usize), goal: (usize, usize)) -> u32 {
    const STRAIGHT: u32 = 1_000_000;
    const OBLIQUE: u32 = 1_414_214;
    let is_free = |x: usize, y: usize| x < width && y < height && free[y * width + x];
    let successors = |&(x, y): &(usize, usize)| {
        let mut found = Vec::with_capacity(8);
        for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
            let (nx, ny) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            if is_free(nx, ny) && is_free(nx, y) && is_free(x, ny) {
                found.push(((nx, ny), if dx != 0 && dy != 0 { OBLIQUE } else { STRAIGHT }));
            }
        }
        found
    };
    let rest = |&(x, y): &(usize, usize)| {
        let (dx, dy) = (x.abs_diff(goal.0) as u32, y.abs_diff(goal.1) as u32);
        STRAIGHT * (dx.max(dy) - dx.min(dy)) + OBLIQUE * dx.min(dy)
    };
    let found = pathfinding::directed::astar::astar(&start, successors, rest, |&at| at == goal);
    found.expect("a way").1
}

/// A thousand way points, turned and driven straight.
fn turn_and_go() {
    let points =
        (0..1000).map(|n| f64::from(n) * 2.4).map(|angle| WayPoint::at(9.0 * angle.cos(), 9.0 * angle.sin()));
    let ask = PlanAsk { way: WayTask { points: points.collect() }, ..PlanAsk::default() };
    let params = PathfinderParams::default();
    let mut times: Vec<f64> = (0..200)
        .map(|_| {
            let begun = Instant::now();
            black_box(plan(&params, black_box(&ask), None, &mut |_| Ok(())).expect("a plan"));
            begun.elapsed().as_secs_f64()
        })
        .collect();
    let [median, p99] = [0.5, 0.99].map(|share| 1e3 * quantile(&mut times, share));
    println!("turn-and-go, 1000 way points: median {median:.3} ms, p99 {p99:.3} ms");
}

/// A map of 2^24 cells with a wall in every sixteenth row that is open at one end, left and right in turn.
fn serpentine() -> MapData {
    let side = 4096_usize;
    let is_solid =
        |x: usize, y: usize| y % 16 == 15 && if (y / 16).is_multiple_of(2) { x < side - 16 } else { x >= 16 };
    let cells = (0..side * side).map(|index| if is_solid(index % side, index / side) { 100 } else { 0 });
    let grid = Grid::new("serpentine", Metres(1.0), Pose::default(), side, cells.collect()).expect("a map");
    grid.to_data().expect("a message")
}

/// How long a plan on the largest map takes, how long it goes on at most without a look at whether it shall end, and how
/// soon it ends at a deadline of 50 ms.
fn largest() {
    let map = serpentine();
    let way = WayTask { points: vec![WayPoint::at(4090.5, 4090.5)] };
    let ask = PlanAsk { way, start: Some(Pose::new(4.5, 4.5, 0.0)), ..PlanAsk::default() };
    let params = PathfinderParams { strategy: PlanStrategy::Map, ..PathfinderParams::default() };
    let asked = |deadline: f64| {
        let begun = Instant::now();
        let (mut last, mut gap) = (0.0, 0.0_f64);
        let mut watch = |_| {
            let now = begun.elapsed().as_secs_f64();
            gap = gap.max(now - last);
            last = now;
            if now <= deadline {
                Ok(())
            } else {
                Err(Refusal::TimedOut { what: "pathfinder".into(), seconds: deadline })
            }
        };
        let terrain = Terrain::watched(&map, Unknown::Blocked, &mut watch);
        let found = terrain.and_then(|terrain| plan(&params, &ask, Some(&terrain), &mut watch));
        let whole = begun.elapsed().as_secs_f64();
        (found, gap.max(whole - last), whole)
    };
    let (found, gap, whole) = asked(f64::INFINITY);
    let length = found.expect("a way").length;
    let (refused, _, late) = asked(0.05);
    assert!(matches!(refused, Err(Refusal::TimedOut { .. })), "{refused:?}");
    println!(
        "2^24 cells, a way of {:.0} m: {whole:.2} s in all, {:.1} ms at most without a look; with 50 ms ended after {:.1} ms",
        length.0,
        1e3 * gap,
        1e3 * late
    );
    assert!(gap < whole / 8.0, "{gap} s of {whole} s without a look at whether to go on");
}
