//! Whether the filter knows what it does not know, on the emulated robot: NEES and NIS over 200 seeded runs.
//!
//! The robot's only errors of odometry are slips: short ones, so that many make a noise, whose mean a calibration has found
//! and whose variance the filter is told; and long ones, which it has to find by itself. Its gyro has a bias that walks.

#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a test ends at what is not as it should be, and says what it measured"
)]

use axle_emulator::{Emulator, EmulatorParams, EncodersParams, GyroParams, MotorsParams, SlipParams};
use axle_navigator::{EkfParams, Event, Measurement, Method, Navigator, NavigatorParams};
use axle_schema::{
    EncodersData, Fix, Metres, MetresPerSecond, Numbers, Pose, Radians, RadiansPerSecond, Seconds, Sides,
};

const RUNS: u32 = 200;
/// The step of the physics, and the time from reading to reading, in s.
const STEP: f64 = 0.002;
const DT: f64 = 0.02;
/// From fix to fix, and for how long, in readings.
const FIXES: u32 = 50;
const READINGS: u32 = 1000;
const FIX_SD: f64 = 0.02;
/// Fine encoders: what they cut off is taken for a noise, which it is not quite.
const TICK: Metres = Metres(1e-5);

/// Normal numbers by a seed (SplitMix64 and Box and Muller).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        #[allow(clippy::cast_precision_loss, reason = "53 bits fit")]
        let share = ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64;
        share
    }
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (2.0 * std::f64::consts::PI * self.uniform()).cos()
    }
}

/// What a ground with these slips takes of a metre, on average, and the variance of that in m²/m. Grip and slip take turns;
/// each ends with the step of the physics, so that it is longer by half of one on average.
fn lost(slip: SlipParams, speed: f64) -> (f64, f64) {
    let late = speed * STEP / 2.0;
    let (grip, length) = (1.0 / slip.rate, slip.length.0 + late);
    let (cycle, each) = (grip + late + length, slip.share * length);
    (each / cycle, (each * grip).powi(2) / cycle.powi(3))
}

/// What a proof is about.
#[derive(Clone, Copy)]
struct Case {
    slip: SlipParams,
    /// How late a fix comes, in readings.
    late: usize,
    /// What is known of the ground: the share that it takes, and the noise.
    known: (f64, f64),
}

#[derive(Debug, Default)]
struct Sums {
    nees: f64,
    nis: f64,
    degrees: f64,
    slips: u32,
    worst: f64,
}

/// The robot, and what its navigator is told of it.
fn told(seed: u32, k: f64, random: &mut Random) -> (NavigatorParams, EmulatorParams) {
    let ekf = EkfParams {
        start_sd: Metres(0.05),
        start_heading_sd: Radians(0.1),
        bias_walk: 1e-3,
        gate: 0.0,
        ..EkfParams::default()
    };
    let real = Pose::new(1.0, -2.0, 0.7);
    let start = Pose::new(
        real.x.0 + ekf.start_sd.0 * random.normal(),
        real.y.0 + ekf.start_sd.0 * random.normal(),
        real.heading.0 + ekf.start_heading_sd.0 * random.normal(),
    );
    let params = NavigatorParams {
        method: Method::Ekf,
        start,
        k: Metres(k),
        tick: TICK,
        ekf,
        ..NavigatorParams::default()
    };
    let emulator = EmulatorParams {
        seed: u64::from(seed),
        start: real,
        motors: MotorsParams { gain_deviation: 0.0, jitter: Metres::ZERO, ..MotorsParams::default() },
        encoders: EncodersParams { tick: TICK, ..EncodersParams::default() },
        gyro: GyroParams {
            bias: RadiansPerSecond::ZERO,
            bias_deviation: RadiansPerSecond(ekf.bias_sd),
            noise_deviation: RadiansPerSecond(ekf.gyro_noise / DT.sqrt()),
            drift: RadiansPerSecond(ekf.bias_walk),
        },
        ..EmulatorParams::default()
    };
    (params, emulator)
}

fn run(case: Case, seed: u32, sums: &mut Sums) {
    let mut random = Random(u64::from(seed) * 7919);
    let (share, k) = case.known;
    let (params, emulator) = told(seed, k, &mut random);
    let mut robot = Emulator::new(EmulatorParams { slip: case.slip, ..emulator }).expect("a robot");
    let mut navigator = Navigator::new(params).expect("valid");
    // The radii were calibrated on this ground.
    let calibrated = |data: EncodersData| EncodersData {
        left: data.left * (1.0 - share),
        right: data.right * (1.0 - share),
        ..data
    };
    let _ = navigator.take(calibrated(robot.encoders()));
    let _ = navigator.measure(&Measurement::Inertial(robot.inertial()));
    let mut past = vec![robot.truth()];
    for reading in 1..=READINGS {
        for step in 1..=10 {
            let t = f64::from(reading - 1) * DT + f64::from(step) * STEP;
            let omega = 0.8 * (0.45 * t).sin() + 0.3 * (1.3 * t).cos();
            let speeds = Sides::new(MetresPerSecond(0.4 - 0.15 * omega), MetresPerSecond(0.4 + 0.15 * omega));
            robot.advance(Seconds(t), speeds);
        }
        past.push(robot.truth());
        let _ = navigator.measure(&Measurement::Inertial(robot.inertial()));
        let _ = navigator.take(calibrated(robot.encoders()));
        if reading % FIXES == 0 {
            let there = past[past.len() - 1 - case.late];
            let near = |way: Metres, random: &mut Random| Metres(way.0 + FIX_SD * random.normal());
            let (x, y) = (near(there.pose.x, &mut random), near(there.pose.y, &mut random));
            let covariance = Numbers([FIX_SD * FIX_SD, 0.0, 0.0, FIX_SD * FIX_SD]);
            let fix = Fix { stamp: there.stamp, x, y, covariance, heading: None };
            let _ = navigator.measure(&Measurement::Fix(fix));
        }
    }
    let (position, truth) = (navigator.position().expect("a position"), robot.truth().pose);
    sums.nees += nees(position.map, &position.map_covariance.0, truth);
    sums.worst = sums.worst.max(position.map.distance(truth).0);
    for innovation in navigator.innovations() {
        sums.nis += innovation.squared;
        sums.degrees += 2.0;
    }
    sums.slips += u32::from(navigator.events().iter().any(|event| matches!(event, Event::Slip { .. })));
}

fn runs(case: Case) -> Sums {
    let mut sums = Sums::default();
    (1..=RUNS).for_each(|seed| run(case, seed, &mut sums));
    sums
}

/// The squared normalised error of a pose, of mean 3 if the covariance `p` is honest: `eᵀ P⁻¹ e` by Cramer's rule.
fn nees(estimate: Pose, p: &[f64; 9], truth: Pose) -> f64 {
    let e =
        [estimate.x.0 - truth.x.0, estimate.y.0 - truth.y.0, (estimate.heading - truth.heading).wrapped().0];
    let minor = |r: usize, c: usize| {
        let (a, b, m, n) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        p[3 * a + m] * p[3 * b + n] - p[3 * a + n] * p[3 * b + m]
    };
    let determinant: f64 = (0..3).map(|c| p[c] * minor(0, c)).sum();
    let all = (0..9).map(|at| (at / 3, at % 3));
    all.map(|(r, c)| e[r] * e[c] * minor(r, c)).sum::<f64>() / determinant
}

/// Whether a sum of squares is within the central 95 % of chi squared (Wilson and Hilferty).
fn within(what: &str, sum: f64, degrees: f64) {
    let spread = 2.0 / (9.0 * degrees);
    let [low, high] = [-1.96, 1.96].map(|z: f64| degrees * (1.0 - spread + z * spread.sqrt()).powi(3));
    let [mean, least, most] = [sum, low, high].map(|sum| sum / degrees);
    println!("{what}: {mean:.3} a degree, 95 % within {least:.3} to {most:.3}");
    assert!((low..=high).contains(&sum), "{what}: {mean:.3}, not within {least:.3} to {most:.3}");
}

/// Short slips, ten in a metre.
fn rough() -> Case {
    let slip = SlipParams { rate: 10.0, length: Metres(0.01), share: 0.3 };
    Case { slip, late: 0, known: lost(slip, 0.4) }
}

#[test]
fn with_a_biased_gyro_on_a_rough_ground_the_covariance_is_honest() {
    let sums = runs(rough());
    println!("{sums:?}");
    within("NEES", sums.nees, f64::from(3 * RUNS));
    within("NIS", sums.nis, sums.degrees);
}

#[test]
fn with_fixes_that_come_late_it_is_as_honest() {
    let sums = runs(Case { late: 13, ..rough() });
    within("NEES", sums.nees, f64::from(3 * RUNS));
    within("NIS", sums.nis, sums.degrees);
}

#[test]
fn long_slips_are_noticed_and_leave_it_honest() {
    // One in 30 m, of 30 cm, in which nearly half is lost: 13 cm, or 0.4 rad by the encoders alone.
    let slip = SlipParams { rate: 1.0 / 30.0, length: Metres(0.3), share: 0.45 };
    let sums = runs(Case { slip, late: 0, known: (0.0, NavigatorParams::default().k.0) });
    println!("{sums:?}");
    assert!((0.4..0.7).contains(&(f64::from(sums.slips) / f64::from(RUNS))), "{sums:?}");
    // The noise that is told for grip is not there, so that it may be less sure than it could be, and never surer.
    let (nees, nis) = (sums.nees / f64::from(3 * RUNS), sums.nis / sums.degrees);
    assert!(nees < 1.116 && nis < 1.05, "NEES {nees:.3}, NIS {nis:.3}");
}
