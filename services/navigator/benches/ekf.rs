//! How long the filter takes for a reading of the encoders and one of the gyro, alone and in the service, and for a late
//! fix that has a second reckoned again; and for an hour.
//!
//! `cargo bench -p axle-navigator --bench ekf` measures; with `-- --test` each bench runs once and is not measured.

#![allow(missing_docs, reason = "what criterion's macros make has none")]
#![allow(clippy::expect_used, reason = "a bench that cannot begin shall end")]

use axle_navigator::{EkfParams, Measurement, Method, Navigator, NavigatorParams};
use axle_schema::{
    EncodersData, Fix, InertialData, Metres, MetresPerSecondSquared, Numbers, RadiansPerSecond, Seconds,
};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use std::hint::black_box;

/// From reading to reading, in s.
const DT: f64 = 0.01;

/// Readings of an hour.
const HOUR: u32 = 360_000;

/// A robot on a winding way, that says what encoders and gyro say, and a navigator that hears it.
struct Ride {
    navigator: Navigator,
    n: u32,
    covered: [f64; 2],
    accelerates: bool,
}

impl Ride {
    fn new(ekf: EkfParams) -> Self {
        let params = NavigatorParams { method: Method::Ekf, ekf, ..NavigatorParams::default() };
        let navigator = Navigator::new(params).expect("valid");
        let accelerates = ekf.accelerometer_noise > 0.0;
        let mut ride = Self { navigator, n: 0, covered: [0.0; 2], accelerates };
        // The memory is full, as it is nearly always.
        (0..1000).for_each(|_| ride.step());
        ride
    }

    fn now(&self) -> f64 {
        f64::from(self.n) * DT
    }

    /// The next reading of the gyro and of the encoders: one update.
    fn step(&mut self) {
        self.n += 1;
        let t = self.now();
        let (v, omega) = (0.4, 0.8 * (0.45 * t).sin());
        self.covered[0] += (v - omega * 0.15) * DT;
        self.covered[1] += (v + omega * 0.15) * DT;
        let stamp = Seconds(t);
        let ax = self.accelerates.then_some(MetresPerSecondSquared(0.0));
        let gyro = InertialData { stamp, gyro: RadiansPerSecond(omega), ax, ay: None };
        let [left, right] = self.covered.map(Metres);
        let _ = self.navigator.measure(&Measurement::Inertial(gyro));
        let _ = black_box(self.navigator.take(EncodersData { stamp, left, right }));
    }
}

fn updates(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("ekf");
    for (name, ekf) in [
        ("encoders and gyro", EkfParams::default()),
        ("and accelerometer", EkfParams { accelerometer_noise: 0.01, ..EkfParams::default() }),
        ("and measures", EkfParams { wheel_sd: 0.01, track_sd: 0.01, ..EkfParams::default() }),
    ] {
        let mut ride = Ride::new(ekf);
        group.bench_function(name, |bench| bench.iter(|| ride.step()));
        assert_eq!(ride.navigator.counts().stale, 0, "every reading counted");
    }
    group.bench_function("fix of a second ago", |bench| {
        let mut ride = Ride::new(EkfParams::default());
        bench.iter_batched(
            || {
                ride.step();
                let covariance = Numbers([1e-2, 0.0, 0.0, 1e-2]);
                let stamp = Seconds(ride.now() - 1.0);
                let map = ride.navigator.poses_at(stamp).expect("remembered").1;
                (ride.navigator.clone(), Fix { stamp, x: map.x, y: map.y, covariance, heading: None })
            },
            |(mut navigator, fix)| {
                let _ = navigator.measure(&Measurement::Fix(fix));
                navigator
            },
            BatchSize::SmallInput,
        );
    });
    group.sample_size(10);
    group.bench_function("an hour at 100 Hz", |bench| {
        let mut ride = Ride::new(EkfParams::default());
        bench.iter(|| (0..HOUR).for_each(|_| ride.step()));
    });
    group.finish();
}

criterion_group!(benches, updates);
criterion_main!(benches);
