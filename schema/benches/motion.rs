//! How long the exact motion takes: one evaluation, Simpson's rule of equal accuracy, and a million movements at once.
//!
//! `cargo bench -p axle-schema --bench motion` measures; with `-- --test` each bench runs once and is not measured.
//! `axle bench motion` gives the ratios of the same figures from one run, without the statistics.

#![allow(missing_docs, reason = "what criterion's macros make has none")]
#![allow(clippy::expect_used, reason = "a bench that cannot begin shall end")]

// The cases and the threads are those of the shell: a bench that had its own would measure something else.
#[path = "../../services/axle/src/batch.rs"]
mod batch;
#[path = "../../services/axle/src/bench/cases.rs"]
mod cases;

use axle_schema::motion::simpson::simpson;
use axle_schema::motion::{Motion, Wheels};
use axle_schema::{Metres, Track};
use cases::Case;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;

/// Movements of the batch.
const BATCH: u32 = 1_000_000;

/// One evaluation, the mean over the given movements.
fn evaluate(
    group: &mut criterion::BenchmarkGroup<'_, criterion::measurement::WallTime>,
    name: &str,
    of: &[(Wheels, f64)],
) {
    let mut endless = of.iter().cycle();
    group.bench_function(name, |bench| {
        bench.iter(|| {
            let (wheels, t) = endless.next().expect("a case");
            black_box(wheels).at(black_box(*t))
        });
    });
}

fn evaluation(criterion: &mut Criterion) {
    let golden = cases::golden().expect("the reference vectors");
    let worst = golden.iter().map(Case::error).fold(0.0, f64::max);
    assert!(worst <= cases::EQUAL, "what is fast and wrong is not worth measuring: {worst:e} of the path");
    let all: Vec<_> = golden.iter().map(|case| (case.wheels(), case.time())).collect();
    evaluate(&mut criterion.benchmark_group("one evaluation"), "golden set", &all);

    let robots: Vec<_> =
        golden.iter().filter_map(|case| Some((case.wheels(), case.time(), case.intervals()?))).collect();
    assert!(robots.len() >= 10, "too few movements for a mean: {}", robots.len());
    let mut group = criterion.benchmark_group("robot-like, to 1e-14 of the path");
    evaluate(&mut group, "exact", &robots.iter().map(|&(wheels, t, _)| (wheels, t)).collect::<Vec<_>>());
    let mut endless = robots.iter().cycle();
    group.bench_function("Simpson", |bench| {
        bench.iter(|| {
            let (wheels, t, n) = endless.next().expect("a case");
            simpson(black_box(wheels), black_box(*t), *n)
        });
    });
}

/// Both list their results anew each time, so that both pay for one allocation and its pages.
fn batches(criterion: &mut Criterion) {
    let movements = cases::movements(BATCH);
    let track = Track::new(Metres(0.3)).expect("a track");
    let mut group = criterion.benchmark_group("a million movements");
    group.sample_size(20).throughput(Throughput::Elements(BATCH.into()));
    group.bench_function("one core", |bench| {
        bench.iter(|| {
            let mut ends = vec![Motion::default(); movements.len()];
            axle_schema::dwm::fill_ends(&movements, track, &mut ends);
            ends
        });
    });
    group.bench_function("all cores", |bench| bench.iter(|| batch::ends(&movements, track)));
}

criterion_group!(benches, evaluation, batches);
criterion_main!(benches);
