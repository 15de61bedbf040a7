//! How long ten thousand geometries take, rest and message checks included.
//!
//! `cargo bench -p axle-pathdriver` measures; with `-- --test` each bench runs once and is not measured.

#![allow(missing_docs, reason = "what criterion's macros make has none")]
#![allow(clippy::expect_used, reason = "a bench that cannot begin shall end")]

use axle_pathdriver::{Joints, Pathdriver, PathdriverParams, Strategy};
use axle_schema::contract::Functional as _;
use axle_schema::{DriveAsk, Geometry, Leg, Metres, Radians};
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;

/// Geometries of the plan.
const LEGS: u32 = 10_000;

/// Lines and arcs in turn, and now and then a turn on the spot.
fn ask() -> DriveAsk {
    let geometry = |number: u32| match number % 10 {
        9 => Geometry::Turn { angle: Radians(1.0) },
        odd if odd % 2 == 1 => {
            let side = if number % 4 == 1 { 1.0 } else { -1.0 };
            Geometry::Arc { radius: Metres(side * 0.5), angle: Radians(side * 0.7) }
        }
        even => Geometry::Line { length: Metres(0.2 + 0.1 * f64::from(even)) },
    };
    let legs = (0..LEGS).map(|number| Leg { geometry: geometry(number), point: 0, speed: None }).collect();
    DriveAsk { legs, ..DriveAsk::default() }
}

fn profiles(criterion: &mut Criterion) {
    let ask = ask();
    let mut group = criterion.benchmark_group("10 000 geometries");
    let ways = [
        ("stop", Strategy::Stop, Joints::Jump),
        ("jump", Strategy::Continuous, Joints::Jump),
        ("blend", Strategy::Continuous, Joints::Blend),
    ];
    for (name, strategy, joints) in ways {
        let params = PathdriverParams { strategy, joints, ..PathdriverParams::default() };
        group.bench_function(name, |bench| {
            bench.iter(|| Pathdriver::answer(&params, black_box(&ask)).expect("a drive"));
        });
    }
    group.finish();
}

criterion_group!(benches, profiles);
criterion_main!(benches);
