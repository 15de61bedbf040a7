//! What the tests of other projects prove about a fusion of odometry and fixes (WPILib's pose estimator and filter, BSD-3-
//! Clause, at caf0fb2: the cases are theirs, the numbers are given again here, and no code of theirs is used).

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test ends at what is not as it should be, and says what it measured"
)]
#![allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers, and the very same bits"
)]

mod robot;

use axle_navigator::{EkfParams, Measurement, Method, Navigator, NavigatorParams};
use axle_schema::{
    Drivetrain, EncodersData, Fix, HeadingFix, InertialData, Metres, MetresPerSecond, Numbers, Pose, Radians,
    RadiansPerSecond, Seconds, Track,
};
use robot::{DT, Robot, fix};

fn params(ekf: EkfParams) -> NavigatorParams {
    NavigatorParams { method: Method::Ekf, ekf, ..NavigatorParams::default() }
}

/// A way like theirs, a loop of metres with fixes of 10 cm that are 0.25 s old: mean, largest and last error.
fn course(seed: u64, start: Pose, ekf: EkfParams) -> [f64; 3] {
    let mut robot =
        Robot::new(seed, &params(EkfParams { start_sd: Metres(0.0), start_heading_sd: Radians(0.0), ..ekf }));
    let mut navigator = Navigator::new(NavigatorParams { start, ..params(ekf) }).expect("valid");
    let _ = navigator.take(robot.encoders());
    let (mut sum, mut worst, mut n) = (0.0, 0.0_f64, 0.0);
    for step in 1..=1000_u32 {
        let (left, right) = robot.winding();
        for measurement in robot.drive(left, right).iter().rev() {
            let _ = navigator.measure(measurement);
        }
        // Every 0.1 s.
        if step % 5 == 0 && step >= 13 {
            let _ = navigator.measure(&robot.fix(13, 0.1));
        }
        let miss = navigator.position().expect("one").map.distance(robot.truth).0;
        // A wrong start is given the time to be found.
        if start == Pose::default() || step > 500 {
            sum += miss;
            worst = worst.max(miss);
            n += 1.0;
        }
    }
    [sum / n, worst, navigator.position().expect("one").map.distance(robot.truth).0]
}

#[test]
fn fixes_of_the_past_count_at_their_own_time() {
    let ekf = EkfParams { start_sd: Metres(0.02), start_heading_sd: Radians(0.01), ..EkfParams::default() };
    for seed in 1..20 {
        let [mean, worst, last] = course(seed, Pose::default(), ekf);
        assert!(mean < 0.05 && worst < 0.2 && last < 0.08, "seed {seed}: {mean}, {worst}, {last} m");
    }
}

#[test]
fn a_wrong_start_is_forgotten_from_whatever_direction() {
    for direction in 0..8 {
        let heading = f64::from(direction) * std::f64::consts::FRAC_PI_4;
        let ekf = EkfParams { start_sd: Metres(2.0), start_heading_sd: Radians(3.0), ..EkfParams::default() };
        let [mean, worst, last] = course(21, Pose::new(heading.cos(), heading.sin(), heading), ekf);
        assert!(mean < 0.06 && worst < 0.2 && last < 0.08, "{heading} rad: {mean}, {worst}, {last} m");
    }
}

#[test]
fn contradicting_fixes_are_no_reason_to_believe_one_of_them() {
    let ekf = EkfParams {
        start_sd: Metres(0.1),
        start_heading_sd: Radians(0.1),
        gate: 0.0,
        ..EkfParams::default()
    };
    let start = Pose::new(1.0, 2.0, 270_f64.to_radians());
    let mut navigator = Navigator::new(NavigatorParams { start, ..params(ekf) }).expect("valid");
    let _ = navigator.take(EncodersData::default());
    let fixes = [[0.0, 0.0, 0.0_f64], [3.0, 1.0, 90.0], [2.0, 4.0, 180.0]];
    for _ in 0..1000 {
        for [x, y, degrees] in fixes {
            let heading = Some(HeadingFix { angle: Radians(degrees.to_radians()), variance: 0.2025 });
            let _ = navigator.measure(&Measurement::Fix(Fix { heading, ..fix(0.0, x, y, 0.45) }));
        }
    }
    let map = navigator.position().expect("one").map;
    for [x, y, _] in fixes {
        assert!(map.distance(Pose::new(x, y, 0.0)).0 > 0.08, "{map:?}");
    }
}

#[test]
fn the_past_is_interpolated_and_reckoned_again() {
    // Both wheels at 1 m/s from 1 s to 2 s; then a fix of 0.9 s, before everything, as good as the start is.
    let ekf = EkfParams { start_sd: Metres(1.0), start_heading_sd: Radians(0.0), ..EkfParams::default() };
    let mut navigator =
        Navigator::new(NavigatorParams { k: Metres(0.0), start: Pose::new(1.0, 0.0, 0.0), ..params(ekf) })
            .expect("valid");
    for n in 50..=100 {
        let t = f64::from(n) * DT;
        let _ = navigator.take(EncodersData { stamp: Seconds(t), left: Metres(t), right: Metres(t) });
    }
    let check = |navigator: &Navigator, y: f64| {
        for (t, x) in [(1.02, 1.02), (1.01, 1.01), (0.5, 1.0), (2.5, 2.0)] {
            let (odom, map) = navigator.poses_at(Seconds(t)).expect("remembered");
            assert!(map.distance(Pose::new(x, y, 0.0)).0 < 1e-9, "at {t} s: {map:?}");
            assert!(odom.distance(Pose::new(x, 0.0, 0.0)).0 < 1e-9, "odom stays");
        }
    };
    check(&navigator, 0.0);
    let covariance = Numbers([1.0, 0.0, 0.0, 1.0]);
    let before = Fix { stamp: Seconds(0.9), x: Metres(1.0), y: Metres(0.2), covariance, heading: None };
    let _ = navigator.measure(&Measurement::Fix(before));
    check(&navigator, 0.1);
    // The same message once more, as a buffer repeats it, changes nothing.
    let _ = navigator.measure(&Measurement::Fix(before));
    check(&navigator, 0.1);
}

/// A cubic with the given ends and headings, as long at its ends as they are apart (WPILib's are of the fifth degree).
struct Curve {
    from: [f64; 2],
    to: [f64; 2],
    slopes: [[f64; 2]; 2],
}

impl Curve {
    fn new(from: [f64; 3], to: [f64; 3]) -> Self {
        let far = 1.2 * (to[0] - from[0]).hypot(to[1] - from[1]);
        let slope = |heading: f64| [far * heading.cos(), far * heading.sin()];
        Self { from: [from[0], from[1]], to: [to[0], to[1]], slopes: [slope(from[2]), slope(to[2])] }
    }
    /// The point at `u` from 0 to 1, and how fast it goes by `u`.
    fn at(&self, u: f64) -> ([f64; 2], [f64; 2]) {
        let (u2, u3) = (u * u, u * u * u);
        let mix = |a: f64, b: f64, c: f64, d: f64| {
            std::array::from_fn(|i| {
                a * self.from[i] + b * self.slopes[0][i] + c * self.to[i] + d * self.slopes[1][i]
            })
        };
        let point = mix(2.0 * u3 - 3.0 * u2 + 1.0, u3 - 2.0 * u2 + u, 3.0 * u2 - 2.0 * u3, u3 - u2);
        let speed = mix(6.0 * u2 - 6.0 * u, 3.0 * u2 - 4.0 * u + 1.0, 6.0 * u - 6.0 * u2, 3.0 * u2 - 2.0 * u);
        (point, speed)
    }
    fn heading(&self, u: f64) -> f64 {
        let (_, [dx, dy]) = self.at(u);
        dy.atan2(dx)
    }
}

#[test]
fn a_long_way_with_noisy_wheels_and_a_good_heading_ends_where_it_should() {
    // Peer case ekf-001: half a track of 0.4191 m, 0.1 m/s², readings every 5 ms; the heading is measured to 0.0001 rad, and
    // each wheel's speed to 0.5 m/s. The end is to be off by less than 1 m in x and in y.
    const STEP: f64 = 0.005;
    let (start, end) = ([2.75, 22.521, 0.0], [24.73, 19.68, 5.846]);
    let curve = Curve::new(start, end);
    let fine = 200_000_u32;
    let mut lengths = vec![0.0];
    for n in 1..=fine {
        let [a, b] = [n - 1, n].map(|n| curve.at(f64::from(n) / f64::from(fine)).0);
        lengths.push(lengths[lengths.len() - 1] + (b[0] - a[0]).hypot(b[1] - a[1]));
    }
    let length = lengths[lengths.len() - 1];
    // Half of the way it gains speed, and half of it loses it again: 8.8 m/s are never reached.
    let whole = 2.0 * (length / 0.1).sqrt();
    let covered = |t: f64| {
        if t < whole / 2.0 { 0.05 * t * t } else { length - 0.05 * (whole - t).max(0.0).powi(2) }
    };
    let param =
        |t: f64| lengths.partition_point(|&s| s < covered(t)).min(fine as usize) as f64 / f64::from(fine);
    for seed in 1..20 {
        let mut random = robot::Random(seed);
        let track = Track::new(Metres(2.0 * 0.4191)).expect("a track");
        let robot = Drivetrain { track, wheel_speed: MetresPerSecond(8.8), ..Drivetrain::default() };
        // A speed that is off by 0.5 m/s in each 5 ms is a way that is off by 0.035 m after 1 s.
        let ekf = EkfParams {
            wheel_noise: 0.5 * STEP.sqrt(),
            gyro_noise: 0.0002 / STEP.sqrt(),
            bias_sd: 0.0,
            bias_walk: 0.0,
            ..EkfParams::default()
        };
        let start = Pose::new(start[0], start[1], start[2]);
        let mut navigator =
            Navigator::new(NavigatorParams { k: Metres(0.0), start, robot, ..params(ekf) }).expect("valid");
        let _ = navigator.take(EncodersData::default());
        let (mut wheels, mut heading, mut said) = ([0.0; 2], 0.0, 0.0);
        let mut n = 0_u32;
        while f64::from(n) * STEP < whole {
            n += 1;
            let t = f64::from(n) * STEP;
            let way = covered(t) - covered(t - STEP);
            let turned = Radians(curve.heading(param(t)) - heading).wrapped().0;
            heading += turned;
            for (side, wheel) in wheels.iter_mut().enumerate() {
                let outward = if side == 0 { -0.4191 } else { 0.4191 };
                *wheel += way + outward * turned + 0.5 * STEP * random.normal();
            }
            let measured = heading + 0.0001 * random.normal();
            let stamp = Seconds(t);
            let gyro = InertialData {
                stamp,
                gyro: RadiansPerSecond((measured - said) / STEP),
                ..InertialData::default()
            };
            said = measured;
            let _ = navigator.measure(&Measurement::Inertial(gyro));
            let _ = navigator.take(EncodersData { stamp, left: Metres(wheels[0]), right: Metres(wheels[1]) });
        }
        let map = navigator.position().expect("one").map;
        let (dx, dy) = ((map.x.0 - end[0]).abs(), (map.y.0 - end[1]).abs());
        assert!(dx < 1.0 && dy < 1.0, "seed {seed}: off by {dx} m and {dy} m after {length} m");
        assert!((map.heading - Radians(end[2])).wrapped().0.abs() < 0.05, "seed {seed}: {map:?}");
    }
}
