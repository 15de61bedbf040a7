//! Dead reckoning beyond constant speeds: accelerations from neighbouring samples, and polynomials of time.

#![allow(clippy::unwrap_used, reason = "a refusal where none is due ends the test")]
#![allow(clippy::float_cmp, reason = "what is exactly zero is compared with zero")]

use axle_schema::motion::polynomial::{MAX_DEGREE, PolynomialWheels};
use axle_schema::motion::{Wheels, accelerated, arc, slope};
use proptest::prelude::*;

/// A case of arithmetic with 40 digits: coefficients of both wheels, track, time, and x, y, heading, way.
type Case = (&'static [f64], &'static [f64], f64, f64, [f64; 4]);

const REFERENCES: &[Case] = &[
    (&[0.0, 1.0, -0.25], &[0.0, 1.0, -0.25], 0.3, 1.0, [0.4166666666666667, 0.0, 0.0, 0.4166666666666667]),
    (
        &[0.2, 0.4],
        &[0.5, 0.05],
        0.3,
        2.0,
        [1.1011054747365157, 0.2253333068672435, -0.33333333333333354, 1.1500000000000001],
    ),
    (
        &[0.0, 1.0, -0.3, 0.02],
        &[0.0, 0.8, -0.1, -0.01],
        0.3,
        5.0,
        [1.720853171993311, 1.1709547983855126, 3.8194444444444438, 3.697916666666667],
    ),
    (
        &[0.5, -1.0, 0.3],
        &[0.2, 0.5, -0.2],
        0.25,
        4.0,
        [0.18009625676200586, 0.035193017198158746, 0.5333333333333335, 0.46666666666666645],
    ),
    (
        &[0.1, 2.0, -1.5, 0.25],
        &[-0.1, 1.0, 1.0, -0.3],
        0.1,
        5.0,
        [0.38502815436971544, -0.42123762437786805, 47.29166666666668, 5.79603685501743],
    ),
    (
        &[1.0, 0.0, 0.0, 0.0, 0.0, -0.001],
        &[1.0, 0.0, 0.0, 0.0, 0.0, 0.001],
        0.5,
        6.0,
        [3.021191769852387, 0.7820960144569901, 31.104, 6.0],
    ),
    (
        &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-08],
        &[0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        0.2,
        10.0,
        [-0.2009876513083702, -0.6693088658524631, 9.444444444444443, 2.0555555555555554],
    ),
    (
        &[5.0, -1.0, 0.05],
        &[-5.0, 1.5, 0.01],
        0.05,
        8.0,
        [-0.5605349331646726, 0.20725169436865226, -136.53333333333333, 13.120000000000001],
    ),
];

#[test]
fn a_robot_with_polynomial_speeds_ends_where_the_reference_says() {
    for &(left, right, track, t, [x, y, theta, path]) in REFERENCES {
        let motion = PolynomialWheels { left, right, track }.at(t).unwrap();
        let error = (motion.x - x).hypot(motion.y - y) / path;
        assert!(error <= 1e-14, "{left:?} {right:?}: misses by {error:e} of the way");
        assert!(
            (motion.theta - theta).abs() <= 2.0 * f64::EPSILON * theta.abs(),
            "{left:?}: {}",
            motion.theta
        );
        assert!((motion.path / path - 1.0).abs() <= 4.0 * f64::EPSILON, "{left:?}: {}", motion.path);
    }
}

#[test]
fn what_is_not_a_polynomial_movement_has_no_state() {
    let usual = PolynomialWheels { left: &[0.1], right: &[0.2], track: 0.3 };
    let long = [0.0; MAX_DEGREE + 2];
    for (wheels, t) in [
        (usual, -1.0),
        (usual, f64::NAN),
        (usual, f64::INFINITY),
        (PolynomialWheels { track: 0.0, ..usual }, 1.0),
        (PolynomialWheels { track: f64::NAN, ..usual }, 1.0),
        (PolynomialWheels { left: &[f64::NAN], ..usual }, 1.0),
        (PolynomialWheels { left: &long, ..usual }, 1.0),
        // A million turns, and numbers that overflow.
        (PolynomialWheels { left: &[-1e6], right: &[1.1e6], track: 0.3 }, 10.0),
        (PolynomialWheels { left: &[0.0, 0.0, 1e300], right: &[1e300], track: 0.3 }, 1e10),
    ] {
        assert_eq!(wheels.at(t), None, "{wheels:?} at {t}");
    }
    assert_eq!(PolynomialWheels { left: &[], right: &[], track: 0.3 }.at(1.0).unwrap().path, 0.0);
    let start = usual.at(0.0).unwrap();
    assert_eq!((start.x, start.y, start.theta, start.path), (0.0, 0.0, 0.0, 0.0));
    assert!((start.v - 0.15).abs() < 1e-16 && (start.omega - 1.0 / 3.0).abs() < 1e-15, "{start:?}");
}

#[test]
fn the_slope_of_a_constant_acceleration_is_exact_from_whatever_neighbours_there_are() {
    // v = 0.2 + 0.4·t over samples of 1, 2 and 4 s: the mean speeds are those of the middles 0.5, 2 and 5 s.
    let speed = |t: f64| 0.2 + 0.4 * t;
    let (before, here, after) = ((speed(0.5), 1.0), (speed(2.0), 2.0), (speed(5.0), 4.0));
    for (before, after) in [(Some(before), Some(after)), (None, Some(after)), (Some(before), None)] {
        assert!((slope(before, here, after) - 0.4).abs() < 1e-15);
    }
    assert_eq!(slope(None, here, None), 0.0);
}

fn movement() -> impl Strategy<Value = Wheels> {
    let speed = || prop_oneof![6 => -1.5..1.5, 1 => Just(0.0), 1 => Just(0.5)];
    (speed(), speed(), speed(), speed(), 0.01..10.0, 0.05..1.0)
        .prop_map(|(v0l, v0r, v1l, v1r, duration, track)| Wheels { v0l, v0r, v1l, v1r, duration, track })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn linear_polynomials_drive_as_the_closed_forms_say(w in movement(), share in 0.0..=1.0) {
        let left = [w.v0l, (w.v1l - w.v0l) / w.duration];
        let right = [w.v0r, (w.v1r - w.v0r) / w.duration];
        let t = w.duration * share;
        let (found, expected) = (PolynomialWheels { left: &left, right: &right, track: w.track }.at(t).unwrap(), w.at(t));
        let reach = [w.v0l, w.v0r, w.v1l, w.v1r].iter().fold(0.0, |most, v| v.abs().max(most)) * t;
        // The accelerations were rounded, which the exact routine never does.
        let allowed = 1e-15 * (1.0 + 2.0 * reach / w.track) * reach;
        let error = (found.x - expected.x).hypot(found.y - expected.y);
        prop_assert!(error <= 1e-14 * expected.path + allowed, "{error:e} {found:?} {expected:?}");
        prop_assert!((found.theta - expected.theta).abs() <= 1e-15 * (1.0 + 2.0 * reach / w.track));
        prop_assert!((found.path - expected.path).abs() <= 1e-15 * (reach + expected.path));
        prop_assert!((found.v - expected.v).abs() <= 1e-15 && (found.omega - expected.omega).abs() <= 1e-13);
    }

    #[test]
    fn two_polynomial_parts_make_the_whole(
        left in prop::collection::vec(-1.0..1.0, 1..8), right in prop::collection::vec(-1.0..1.0, 1..8),
        t in 0.1..2.0, share in 0.0..1.0,
    ) {
        let wheels = PolynomialWheels { left: &left, right: &right, track: 0.3 };
        let (first, whole) = (wheels.at(t * share).unwrap(), wheels.at(t).unwrap());
        // The speeds from the middle on: p(t₁ + τ).
        let from = |c: &[f64]| {
            let mut c = c.to_vec();
            for low in 0..c.len() {
                for k in (low..c.len() - 1).rev() {
                    c[k] += c[k + 1] * t * share;
                }
            }
            c
        };
        let (left, right) = (from(&left), from(&right));
        let second = PolynomialWheels { left: &left, right: &right, track: 0.3 }.at(t - t * share).unwrap();
        let (sin, cos) = first.theta.sin_cos();
        let (x, y) = (first.x + second.x * cos - second.y * sin, first.y + second.x * sin + second.y * cos);
        prop_assert!((x - whole.x).hypot(y - whole.y) <= 1e-11, "{first:?} {second:?} {whole:?}");
        prop_assert!((first.path + second.path - whole.path).abs() <= 1e-12);
    }

    #[test]
    fn with_its_own_accelerations_a_sample_is_reckoned_exactly(w in movement()) {
        let distance = |v0: f64, v1: f64| f64::midpoint(v0, v1) * w.duration;
        let (left, right) = (distance(w.v0l, w.v1l), distance(w.v0r, w.v1r));
        let rates = [(w.v1l - w.v0l) / w.duration, (w.v1r - w.v0r) / w.duration];
        let (x, y, theta) = accelerated(left, right, rates, w.duration, w.track);
        let end = w.end();
        let reach = [w.v0l, w.v0r, w.v1l, w.v1r].iter().fold(0.0, |most, v| v.abs().max(most)) * w.duration;
        let allowed = 1e-15 * (1.0 + 2.0 * reach / w.track);
        prop_assert!((x - end.x).hypot(y - end.y) <= 4.0 * allowed * (reach + 1e-3), "{x} {y} {end:?}");
        prop_assert!((theta - end.theta).abs() <= allowed);
        let steady = accelerated(left, right, [0.0; 2], w.duration, w.track);
        let (ax, ay, _) = arc(left, right, w.track);
        prop_assert!((steady.0 - ax).hypot(steady.1 - ay) <= 1e-14 * (reach + 1e-3));
        prop_assert_eq!(accelerated(left, right, rates, 0.0, w.track), arc(left, right, w.track));
    }
}
