//! `axle bench motion`: how long the exact routine takes, how exact it is, and what Simpson's rule costs for as much.
//!
//! Everything is measured in one run of one process, so that the ratios hold on any computer.

use super::cases::{Case, EQUAL, golden, movements};
use crate::batch;
use crate::out::{data, table};
use anyhow::Context as _;
use axle_schema::motion::Wheels;
use axle_schema::motion::simpson::simpson;
use axle_schema::{Metres, Track};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Each time is the best of that many runs: what disturbs a run only makes it longer. Where a run takes a part of a
/// millisecond there are more of them, so that some run between two turns of other processes.
const RUNS: u32 = 15;
const SHORT_RUNS: u32 = 600;
/// Movements of the batch.
const BATCH: u32 = 1_000_000;

/// The best of so many runs.
fn best(runs: u32, mut work: impl FnMut()) -> Duration {
    let mut once = || {
        let began = Instant::now();
        work();
        began.elapsed()
    };
    (0..runs).map(|_| once()).min().unwrap_or_default()
}

/// Nanoseconds of each of `count`.
fn nanoseconds(time: Duration, count: usize) -> f64 {
    #[allow(clippy::cast_precision_loss, reason = "a count")]
    let count = count.max(1) as f64;
    time.as_secs_f64() * 1e9 / count
}

/// Measures and prints.
pub(crate) fn motion(json: bool) -> anyhow::Result<()> {
    let cases = golden().context("read the reference vectors")?;
    let max_error = cases.iter().map(Case::error).fold(0.0, f64::max);
    let all: Vec<_> = cases.iter().map(|case| (case.wheels(), case.time())).collect();
    let repeats = 4;
    let evaluate = |all: &[(Wheels, f64)]| {
        let time = best(SHORT_RUNS, || {
            for _ in 0..repeats {
                for (wheels, t) in all {
                    black_box(black_box(wheels).at(black_box(*t)));
                }
            }
        });
        nanoseconds(time, repeats * all.len())
    };
    let eval_ns = evaluate(&all);

    let robots: Vec<_> = cases.iter().filter_map(|case| Some((case, case.intervals()?))).collect();
    let exact_ns = evaluate(&robots.iter().map(|(case, _)| (case.wheels(), case.time())).collect::<Vec<_>>());
    let by_simpson = best(SHORT_RUNS, || {
        for (case, n) in &robots {
            black_box(simpson(black_box(&case.wheels()), black_box(case.time()), *n));
        }
    });
    let simpson_ratio = nanoseconds(by_simpson, robots.len()) / exact_ns;

    let movements = movements(BATCH);
    let track = Track::new(Metres(0.3))?;
    // Both allocate their results, so that both pay for the pages.
    let alone = best(RUNS, || {
        let mut ends = vec![axle_schema::motion::Motion::default(); movements.len()];
        axle_schema::dwm::fill_ends(black_box(&movements), track, &mut ends);
        drop(black_box(ends));
    });
    let together = best(RUNS, || drop(black_box(batch::ends(black_box(&movements), track))));
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

#[cfg(test)]
mod tests {
    use super::*;
    use allocation_counter::measure;
    use axle_schema::motion::Motion;

    #[test]
    fn a_batch_is_what_each_movement_is() {
        let track = Track::new(Metres(0.3)).unwrap();
        for count in [0, 1, 2, 3, 101] {
            let movements = movements(count);
            let expected: Vec<_> = movements.iter().map(|dwm| dwm.motion_at(track, dwm.duration())).collect();
            assert_eq!(batch::ends(&movements, track), expected);
        }
    }

    #[test]
    fn a_batch_allocates_its_results_once_and_nothing_else_that_grows() {
        let track = Track::new(Metres(0.3)).unwrap();
        let movements = movements(10_000);
        let results = size_of::<Motion>() as u64 * 10_000;
        let mut ends = Vec::new();
        let whole = measure(|| ends = batch::ends(&movements, track));
        // What starting some threads takes does not depend on the movements.
        let threads = whole.bytes_total - results;
        assert!(threads < results / 4, "{threads} bytes besides {results}");
        // What each thread does takes nothing at all.
        let part = measure(|| axle_schema::dwm::fill_ends(&movements, track, &mut ends));
        assert_eq!(part.count_total, 0);
    }

    #[test]
    fn the_routine_keeps_its_promise_on_every_reference_vector() {
        let cases = golden().unwrap();
        assert_eq!(cases.len(), 400);
        assert!(cases.iter().all(|case| case.error() <= EQUAL));
        assert!(cases.iter().filter_map(Case::intervals).count() >= 10);
    }
}
