//! `axle bench motion`: how long the exact routine takes, how exact it is, and what Simpson's rule costs for as much.
//!
//! Everything is measured in one run of one process, so that the ratios hold on any computer.

use crate::batch;
use crate::out::{data, table};
use anyhow::Context as _;
use axle_schema::motion::Wheels;
use axle_schema::{Dwm, Metres, MetresPerSecond, Seconds, Sides, Track};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// The reference vectors: movements and where they end, to 25 digits.
const GOLDEN: &str = include_str!("../../../../schema/tests/data/golden_dwm.jsonl");
/// Each time is the best of that many runs: what disturbs a run only makes it longer.
const RUNS: u32 = 15;
/// Movements of the batch.
const BATCH: u32 = 1_000_000;
/// Simpson's rule is as exact as the routine when it misses by no more than this share of the way.
const EQUAL: f64 = 1e-14;

struct Case {
    wheels: Wheels,
    t: f64,
    x: f64,
    y: f64,
    path: f64,
    robot_like: bool,
}

fn golden() -> anyhow::Result<Vec<Case>> {
    let case = |line: &str| {
        let value: serde_json::Value = serde_json::from_str(line).context("a reference vector")?;
        let number =
            |key: &str| value[key].as_f64().with_context(|| format!("a reference vector without {key}"));
        let wheels = Wheels {
            v0l: number("v0l")?,
            v0r: number("v0r")?,
            v1l: number("v1l")?,
            v1r: number("v1r")?,
            duration: number("T")?,
            track: number("track")?,
        };
        Ok(Case {
            wheels,
            t: number("t")?,
            x: number("x")?,
            y: number("y")?,
            path: number("path")?,
            robot_like: value["category"] == "generic_robot",
        })
    };
    GOLDEN.lines().map(case).collect()
}

/// The displacement at the time `t` by Simpson's rule with `n` intervals.
fn simpson(w: &Wheels, t: f64, n: u32) -> (f64, f64) {
    let (mut x, mut y) = (0.0, 0.0);
    let (v0, n0) = ((w.v0l + w.v0r) / 2.0, w.v0r - w.v0l);
    let (dv, dn) = ((w.v1l + w.v1r) / 2.0 - v0, w.v1r - w.v1l - n0);
    for k in 0..=n {
        let time = t * f64::from(k) / f64::from(n);
        let share = time / w.duration;
        let (sin, cos) = ((n0 + dn * share / 2.0) * time / w.track).sin_cos();
        let weight = if k == 0 || k == n { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
        let v = weight * (v0 + dv * share);
        x += v * cos;
        y += v * sin;
    }
    let size = t / f64::from(n) / 3.0;
    (x * size, y * size)
}

/// The fewest intervals, to a factor of about 1.2, with which Simpson's rule is as exact; none below 200 000.
fn intervals(case: &Case) -> Option<u32> {
    let mut n = 2;
    while n < 200_000 {
        let (x, y) = simpson(&case.wheels, case.t, n);
        if (x - case.x).hypot(y - case.y) <= EQUAL * case.path {
            return Some(n);
        }
        n = (n + n / 5 + 2) & !1;
    }
    None
}

/// The best of some runs.
fn best(mut work: impl FnMut()) -> Duration {
    let mut once = || {
        let began = Instant::now();
        work();
        began.elapsed()
    };
    (0..RUNS).map(|_| once()).min().unwrap_or_default()
}

/// Nanoseconds of each of `count`.
fn nanoseconds(time: Duration, count: usize) -> f64 {
    #[allow(clippy::cast_precision_loss, reason = "a count")]
    let count = count.max(1) as f64;
    time.as_secs_f64() * 1e9 / count
}

/// Robot-like movements, by a plain congruential generator so that every run has the same.
fn movements() -> Vec<Dwm> {
    let mut state = 1_u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from((state >> 32) as u32) / 4_294_967_296.0
    };
    let mut speeds = move || [uniform(), uniform(), uniform(), uniform(), uniform()];
    (0..BATCH)
        .filter_map(|_| {
            let [a, b, c, d, t] = speeds();
            let side = |left: f64, right: f64| {
                Sides::new(MetresPerSecond(3.0 * left - 1.5), MetresPerSecond(3.0 * right - 1.5))
            };
            Dwm::new(side(a, b), side(c, d), Seconds(0.05 + 2.0 * t)).ok()
        })
        .collect()
}

/// Measures and prints.
pub(crate) fn motion(json: bool) -> anyhow::Result<()> {
    let cases = golden()?;
    let max_error = cases
        .iter()
        .filter(|case| case.path > 0.0)
        .map(|case| {
            let motion = case.wheels.at(case.t);
            (motion.x - case.x).hypot(motion.y - case.y) / case.path
        })
        .fold(0.0, f64::max);
    let repeats = 100;
    let eval = best(|| {
        for _ in 0..repeats {
            for case in &cases {
                black_box(black_box(&case.wheels).at(black_box(case.t)));
            }
        }
    });
    let eval_ns = nanoseconds(eval, repeats * cases.len());

    let robots: Vec<_> = cases
        .iter()
        .filter(|case| case.robot_like && case.path > 0.0)
        .filter_map(|case| intervals(case).map(|n| (case, n)))
        .collect();
    let exact = best(|| {
        for _ in 0..repeats {
            for (case, _) in &robots {
                black_box(black_box(&case.wheels).at(black_box(case.t)));
            }
        }
    });
    let by_simpson = best(|| {
        for (case, n) in &robots {
            black_box(simpson(black_box(&case.wheels), black_box(case.t), *n));
        }
    });
    let exact_ns = nanoseconds(exact, repeats * robots.len());
    let simpson_ratio = nanoseconds(by_simpson, robots.len()) / exact_ns;

    let movements = movements();
    let track = Track::new(Metres(0.3))?;
    // Both allocate their results, so that both pay for the pages.
    let alone = best(|| {
        let mut ends = vec![axle_schema::motion::Motion::default(); movements.len()];
        axle_schema::dwm::fill_ends(black_box(&movements), track, &mut ends);
        drop(black_box(ends));
    });
    let together = best(|| drop(black_box(batch::ends(black_box(&movements), track))));
    let batch_ns = nanoseconds(together, movements.len());
    let batch_speedup = alone.as_secs_f64() / together.as_secs_f64();
    if json {
        let line = serde_json::json!({
            "eval_ns": eval_ns, "simpson_ratio": simpson_ratio, "max_error": max_error,
            "batch_ns": batch_ns, "batch_speedup": batch_speedup, "batch": movements.len(),
            "cases": cases.len(), "simpson_cases": robots.len(), "simpson_error": EQUAL,
        });
        return Ok(data(&line.to_string())?);
    }
    let rows = [
        ("one evaluation, mean of the reference vectors", format!("{eval_ns:.0} ns")),
        ("largest error, share of the way", format!("{max_error:.1e}")),
        ("Simpson's rule, for 1e-14 of the way", format!("{simpson_ratio:.0} times as long")),
        ("a million movements, each", format!("{batch_ns:.0} ns")),
        ("all cores against one", format!("{batch_speedup:.2} times as fast")),
    ];
    Ok(table(&["", ""], rows.map(|(name, value)| vec![name.into(), value]))?)
}
