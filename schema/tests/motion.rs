//! The exact motion routine and the dead reckoning against reference vectors, and their laws.
//!
//! `data/README.md` says what the vectors are.

#![allow(clippy::float_cmp, reason = "some results are documented to be exact")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a broken file of reference vectors ends the test")]

use axle_schema::motion::{Motion, Shape, Wheels, arc, half_turn, point_and_shoot, shape};
use proptest::prelude::*;
use serde_json::Value;

/// Relative spacing of `f64` just above 1.
const EPSILON: f64 = f64::EPSILON;

/// The lines of a file of JSON values.
fn lines(file: &str) -> Vec<Value> {
    file.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("no number {key} in {value}"))
}

/// The largest wheel speed of a movement.
fn fastest(w: &Wheels) -> f64 {
    [w.v0l, w.v0r, w.v1l, w.v1r].iter().fold(0.0, |most, speed| speed.abs().max(most))
}

/// The total variation of the heading up to `t`, or a little more, in radians.
fn phase(w: &Wheels, t: f64) -> f64 {
    (w.at(0.0).omega.abs() + w.at(t).omega.abs()) * t / 2.0
}

/// Speeds of the left and of the right wheel at the time `t`.
fn speeds(w: &Wheels, t: f64) -> (f64, f64) {
    let share = t / w.duration;
    (w.v0l + (w.v1l - w.v0l) * share, w.v0r + (w.v1r - w.v0r) * share)
}

/// `b`, given in the frame at the end of `a`, in the frame of the start of `a`; `v` and `omega` are those of
/// `b`.
fn then(a: Motion, b: Motion) -> Motion {
    let (sin, cos) = a.theta.sin_cos();
    Motion {
        x: a.x + b.x * cos - b.y * sin,
        y: a.y + b.x * sin + b.y * cos,
        theta: a.theta + b.theta,
        path: a.path + b.path,
        ..b
    }
}

fn distance(a: Motion, b: Motion) -> f64 {
    (a.x - b.x).hypot(a.y - b.y)
}

// ---- reference vectors --------------------------------------------------------------------------

fn golden() -> Vec<(Wheels, f64, Value)> {
    let cases: Vec<_> = lines(include_str!("data/golden_dwm.jsonl"))
        .into_iter()
        .map(|case| {
            let wheels = Wheels {
                v0l: number(&case, "v0l"),
                v0r: number(&case, "v0r"),
                v1l: number(&case, "v1l"),
                v1r: number(&case, "v1r"),
                duration: number(&case, "T"),
                track: number(&case, "track"),
            };
            (wheels, number(&case, "t"), case)
        })
        .collect();
    assert_eq!(cases.len(), 400);
    cases
}

#[test]
fn a_movement_ends_where_the_reference_says() {
    for (wheels, t, case) in golden() {
        let (motion, path) = (wheels.at(t), number(&case, "path"));
        let error = (motion.x - number(&case, "x")).hypot(motion.y - number(&case, "y"));
        // The worst of these cases is at 5e-16; another mathematical library may cost as much again, and a
        // lost digit ten times.
        assert!(error <= 1e-15 * path, "misses by {:e} of the path: {case}", error / path);

        // A correctly rounded heading may still differ by one unit, since the reference is decimal and breaks
        // ties.
        let theta = number(&case, "theta");
        assert!((motion.theta - theta).abs() <= EPSILON * theta.abs(), "theta {}: {case}", motion.theta);
        let allowed = 4.0 * EPSILON * fastest(&wheels) * 2.0 * t / wheels.track;
        assert!((motion.theta - theta).abs() <= allowed, "theta {}: {case}", motion.theta);
    }
}

#[test]
fn a_movement_has_the_speeds_and_the_length_of_way_of_the_reference() {
    for (wheels, t, case) in golden() {
        let motion = wheels.at(t);
        let columns = [("v", motion.v, 1.0), ("omega", motion.omega, 1.0), ("path", motion.path, 2.0)];
        for (key, value, units) in columns {
            let expected = number(&case, key);
            assert!((value - expected).abs() <= units * EPSILON * expected.abs(), "{key} {value}: {case}");
        }
    }
}

#[test]
fn a_movement_has_the_shape_of_the_reference_and_its_zeros_are_exact() {
    for (wheels, t, case) in golden() {
        let motion = wheels.at(t);
        let (found, zeros): (_, &[f64]) = match shape(&wheels) {
            Shape::Rest => ("rest", &[motion.x, motion.y, motion.theta, motion.path]),
            Shape::Line => ("line", &[motion.y, motion.theta]),
            Shape::Spin => ("spin", &[motion.x, motion.y, motion.v, motion.path]),
            Shape::Circle => ("circle", &[]),
            Shape::Spiral => ("spiral", &[]),
            Shape::Clothoid => ("clothoid", &[]),
        };
        assert_eq!(found, case["shape"], "{case}");
        assert!(zeros.iter().all(|zero| zero.to_bits() == 0), "{motion:?}: {case}");
    }
}

/// Drives each sequence of encoder samples with one integrator and compares all recorded poses.
fn check_odometer(column: &str, reckon: fn(f64, f64, f64) -> (f64, f64, f64)) {
    let pose = |value: &Value| [0, 1, 2].map(|k| value[k].as_f64().unwrap());
    let sequences = lines(include_str!("data/golden_odometry.jsonl"));
    assert_eq!(sequences.len(), 52);
    for sequence in sequences {
        let track = number(&sequence, "track");
        let [x, y, theta] = pose(&sequence["start"]);
        let size = 1.0 + x.hypot(y) + theta.abs() + number(&sequence, "wheel_path");
        let mut now = Motion { x, y, theta, ..Motion::default() };
        let mut expected =
            sequence["index"].as_array().unwrap().iter().zip(sequence[column].as_array().unwrap());
        let mut next = expected.next();
        for (k, step) in sequence["steps"].as_array().unwrap().iter().enumerate() {
            let (x, y, theta) = reckon(step[0].as_f64().unwrap(), step[1].as_f64().unwrap(), track);
            now = then(now, Motion { x, y, theta, ..Motion::default() });
            let Some((_, reference)) = next.filter(|(index, _)| index.as_u64() == Some(k as u64)) else {
                continue;
            };
            let [x, y, theta] = pose(reference);
            let error = (now.x - x).hypot(now.y - y).max((now.theta - theta).abs());
            assert!(error <= 1e-12 * size, "{column}, step {k}, error {error:e}: {}", sequence["category"]);
            next = expected.next();
        }
        assert!(next.is_none(), "not all poses of {} were reached", sequence["category"]);
    }
}

#[test]
fn the_exact_arc_follows_the_reference() {
    check_odometer("exact", arc);
}

#[test]
fn point_and_shoot_follows_the_reference() {
    check_odometer("p6", point_and_shoot);
}

#[test]
fn half_turn_follows_the_reference() {
    check_odometer("brown", half_turn);
}

// ---- tables -------------------------------------------------------------------------------------

/// A movement from wheel speeds, with a duration of 2 s and a track of 0.3 m.
fn wheels(v0l: f64, v0r: f64, v1l: f64, v1r: f64) -> Wheels {
    Wheels { v0l, v0r, v1l, v1r, duration: 2.0, track: 0.3 }
}

#[test]
fn shapes_are_decided_without_rounding() {
    let (big, tiny) = (f64::MAX, 5e-324);
    let cases = [
        (wheels(0.0, -0.0, 0.0, 0.0), Shape::Rest),
        (wheels(0.0, 0.0, 0.5, 0.5), Shape::Line),
        (wheels(0.1, -0.1, 0.0, 0.0), Shape::Spin),
        (wheels(0.0, 0.5, 0.0, 0.7), Shape::Circle),
        // Both products underflow to zero, but only the first two movements keep the ratio of the speeds.
        (wheels(tiny, 2.0 * tiny, 2.0 * tiny, 4.0 * tiny), Shape::Circle),
        (wheels(1e-200, 2e-200, 2e-200, 4e-200), Shape::Circle),
        (wheels(1e-200, 2e-200, 2e-200, 4.1e-200), Shape::Clothoid),
        // Both products overflow.
        (wheels(big, big / 2.0, big / 2.0, big / 4.0), Shape::Circle),
        (wheels(big, big / 2.0, big / 2.0, big / 5.0), Shape::Clothoid),
        (wheels(0.1, 0.2, 0.3, 0.6), Shape::Circle),
        // The product of the outer two, 1 − ε², rounds to that of the inner two.
        (wheels(1.0 + EPSILON, 2.0, 0.5, 1.0 - EPSILON), Shape::Clothoid),
        (wheels(0.25, 0.5, 1.0, 1.25), Shape::Spiral),
        // In decimal a spiral; in binary the accelerations differ.
        (wheels(0.1, 0.2, 0.3, 0.4), Shape::Clothoid),
        // Both differences round to 1.
        (wheels(0.0, -1e-30, 1.0, 1.0), Shape::Clothoid),
        // Both differences overflow, and are equal or not.
        (wheels(-big, -big / 2.0, big / 2.0, big), Shape::Spiral),
        (wheels(-big, -big, big / 2.0, big), Shape::Clothoid),
        // One of them overflows.
        (wheels(-big, 0.0, big, big), Shape::Clothoid),
    ];
    for (wheels, expected) in cases {
        assert_eq!(shape(&wheels), expected, "{wheels:?}");
        let mirrored =
            Wheels { v0l: wheels.v0r, v0r: wheels.v0l, v1l: wheels.v1r, v1r: wheels.v1l, ..wheels };
        assert_eq!(shape(&mirrored), expected, "{mirrored:?}");
        let reversed =
            Wheels { v0l: wheels.v1l, v0r: wheels.v1r, v1l: wheels.v0l, v1r: wheels.v0r, ..wheels };
        assert_eq!(shape(&reversed), expected, "{reversed:?}");
    }
}

#[test]
fn time_is_limited_to_the_movement() {
    let curve = wheels(0.2, 0.5, 1.0, 0.6);
    let start = Motion { v: 0.35, omega: (0.5 - 0.2) / 0.3, ..Motion::default() };
    for before in [0.0, -0.0, -1.0, f64::NEG_INFINITY] {
        assert_eq!(curve.at(before), start, "{before}");
    }
    for after in [2.0, 2.1, f64::INFINITY] {
        assert_eq!(curve.at(after), curve.end(), "{after}");
    }
    assert_eq!((curve.end().v, curve.end().omega), (0.8, (0.6 - 1.0) / 0.3));
}

#[test]
fn a_movement_of_no_duration_goes_nowhere_and_has_the_speeds_of_its_end() {
    let jump = Wheels { duration: 0.0, ..wheels(0.2, 0.5, 1.0, 0.5) };
    let expected = Motion { v: 0.75, omega: -0.5 / 0.3, ..Motion::default() };
    for t in [-1.0, 0.0, 1.0] {
        assert_eq!(jump.at(t), expected, "{t}");
    }
}

#[test]
fn what_is_not_a_number_stays_visible() {
    let curve = wheels(0.2, 0.5, 1.0, 0.6);
    assert!(curve.at(f64::NAN).x.is_nan());
    for broken in [
        Wheels { v0l: f64::NAN, ..curve },
        Wheels { v1r: f64::NAN, ..curve },
        Wheels { duration: f64::NAN, ..curve },
        Wheels { track: f64::NAN, ..curve },
    ] {
        assert!(broken.at(1.0).y.is_nan() && broken.end().y.is_nan(), "{broken:?}");
    }
}

#[test]
fn numbers_of_extreme_size_give_the_result_of_moderate_ones_in_other_units() {
    // More than a turn with an inflection inside, so that the Fresnel integral is used too.
    let usual = Wheels { v0l: -0.75, v0r: 1.25, v1l: 1.5, v1r: 1.0, duration: 3.0, track: 0.25 };
    for (length, time) in
        [(300, 0), (-300, 0), (900, 100), (-900, -100), (0, 300), (0, -300), (500, -400), (-600, 400)]
    {
        let (length, time) = (2f64.powi(length), 2f64.powi(time));
        let speed = length / time;
        let wild = Wheels {
            v0l: usual.v0l * speed,
            v0r: usual.v0r * speed,
            v1l: usual.v1l * speed,
            v1r: usual.v1r * speed,
            duration: usual.duration * time,
            track: usual.track * length,
        };
        for t in [0.0, 1.0, 2.0, 3.0] {
            let (wild, usual) = (wild.at(t * time), usual.at(t));
            let back = Motion {
                x: wild.x / length,
                y: wild.y / length,
                theta: wild.theta,
                v: wild.v / speed,
                omega: wild.omega * time,
                path: wild.path / length,
            };
            assert_eq!(back, usual, "{length:e} m, {time:e} s, t {t}");
        }
    }
}

#[test]
fn extreme_ratios_keep_the_digits_that_the_answer_has() {
    // A line is a line, however short the track: no phase exists that could lose digits.
    let line = Wheels { v0l: 1e200, v0r: 1e200, v1l: 1e200, v1r: 1e200, duration: 1.0, track: 1e-200 };
    assert_eq!(line.end(), Motion { x: 1e200, y: 0.0, theta: 0.0, v: 1e200, omega: 0.0, path: 1e200 });
    // A track so wide that the turn is tiny.
    let wide = Wheels { v0l: 0.0, v0r: 2.0, v1l: 0.0, v1r: 2.0, duration: 1.0, track: 1e300 };
    let end = wide.end();
    assert_eq!((end.x, end.path, end.theta, end.omega), (1.0, 1.0, 2e-300, 2e-300));
    assert!((end.y - 1e-300).abs() < 1e-314, "{end:?}");
    // Sums of speeds that overflow.
    let fast =
        Wheels { v0l: f64::MAX, v0r: f64::MAX, v1l: f64::MAX, v1r: f64::MAX, duration: 0.5, track: 1.0 };
    assert_eq!((fast.end().x, fast.end().v), (f64::MAX / 2.0, f64::MAX));
    // An instant so early that the share of the duration underflows.
    let early = Wheels { v0l: 1.0, v0r: 2.0, v1l: 2.0, v1r: 3.0, duration: 1e300, track: 1.0 };
    let motion = early.at(1e-300);
    assert_eq!((motion.v, motion.omega, motion.theta), (1.5, 1.0, 1e-300));
    assert!((motion.x / 1.5e-300 - 1.0).abs() < 1e-15, "{motion:?}");
}

#[test]
fn an_arc_is_the_movement_at_constant_speeds() {
    for (left, right) in [(0.1, 0.1), (0.1, 0.1 + 1e-12), (0.3, -0.3), (0.0, 0.2), (-0.5, 1.5), (0.0, 0.0)] {
        let motion = Wheels { v0l: left, v0r: right, v1l: left, v1r: right, duration: 1.0, track: 0.3 }.end();
        let (x, y, theta) = arc(left, right, 0.3);
        let error = (x - motion.x).hypot(y - motion.y);
        assert!(error <= 4.0 * EPSILON * motion.path, "({left}, {right}): {error:e}");
        assert!((theta - motion.theta).abs() <= EPSILON * theta.abs(), "({left}, {right}): {theta}");
    }
}

#[test]
fn the_approximations_miss_by_what_their_documentation_says() {
    let turn: f64 = 10f64.to_radians();
    let track = 0.3;
    let (left, right) = (1.0 - turn * track / 2.0, 1.0 + turn * track / 2.0);
    let (x, y, theta) = arc(left, right, track);
    for (reckon, expected) in [(point_and_shoot as fn(f64, f64, f64) -> _, 8.72e-2), (half_turn, 1.27e-3)] {
        let (x6, y6, theta6) = reckon(left, right, track);
        let error = (x6 - x).hypot(y6 - y);
        assert!((error / expected - 1.0).abs() < 1e-2, "{error}");
        assert_eq!(theta6, theta);
    }
}

// ---- laws ---------------------------------------------------------------------------------------

/// Movements of small robots, with speeds that are often equal, opposite or zero.
fn movement() -> impl Strategy<Value = Wheels> {
    let speed = || prop_oneof![6 => -1.5..1.5, 1 => Just(0.0), 1 => Just(0.5), 1 => Just(-0.5)];
    // The difference of two speeds, down to the last digit.
    let nudge = || prop_oneof![3 => Just(None), 1 => (-16.0..-1.0, prop::bool::ANY).prop_map(Some)];
    (speed(), speed(), speed(), speed(), nudge(), nudge(), 0.01..10.0, 0.05..1.0).prop_map(
        |(v0l, v0r, v1l, v1r, start, end, duration, track)| {
            let near = |left: f64, right: f64, nudge: Option<(f64, bool)>| match nudge {
                Some((power, same)) => (if same { left } else { -left }) + 10f64.powf(power),
                None => right,
            };
            Wheels { v0l, v0r: near(v0l, v0r, start), v1l, v1r: near(v1l, v1r, end), duration, track }
        },
    )
}

/// Every finite `f64`, with a bias to the edges of the range.
fn wild() -> impl Strategy<Value = f64> {
    use prop::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    const EDGES: [f64; 10] =
        [f64::MAX, -f64::MAX, f64::MIN_POSITIVE, 5e-324, -5e-324, 0.0, 1.0, -1.0, 1e-200, 1e200];
    // About the range that needs no change of units.
    let usual = (-61.0..61.0, prop::bool::ANY)
        .prop_map(|(power, plus)| 10f64.powf(power) * if plus { 1.0 } else { -1.0 });
    let any = POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO;
    prop_oneof![3 => any, 3 => usual, 1 => prop::sample::select(&EDGES[..])]
}

/// The displacement by a method of its own: composite Gauss–Legendre quadrature, twelve nodes for each 2.5
/// rad at most.
fn by_panels(w: &Wheels, t: f64) -> (f64, f64) {
    const RULE: [(f64, f64); 6] = [
        (0.125_233_408_511_468_9, 0.249_147_045_813_402_8),
        (0.367_831_498_998_180_2, 0.233_492_536_538_354_8),
        (0.587_317_954_286_617_4, 0.203_167_426_723_065_92),
        (0.769_902_674_194_304_7, 0.160_078_328_543_346_23),
        (0.904_117_256_370_474_9, 0.106_939_325_995_318_43),
        (0.981_560_634_246_719_2, 0.047_175_336_386_511_83),
    ];
    let panels = (phase(w, t) / 2.5).ceil().max(1.0);
    let (n0, n1) = (w.v0r - w.v0l, w.v1r - w.v1l);
    let (mut x, mut y) = (0.0, 0.0);
    for k in 0..panels as u32 {
        for (node, weight) in RULE.into_iter().flat_map(|(node, weight)| [(node, weight), (-node, weight)]) {
            let time = t * (f64::from(k) + (1.0 + node) / 2.0) / panels;
            let share = time / w.duration;
            let turning = 2.0 * n0 + (n1 - n0) * share;
            let theta = turning * time / (2.0 * w.track);
            let speed = (w.v0l + w.v0r + (w.v1l + w.v1r - (w.v0l + w.v0r)) * share) / 2.0;
            let step = weight / 2.0 * t / panels * speed;
            x += step * theta.cos();
            y += step * theta.sin();
        }
    }
    (x, y)
}

/// Enough cases to meet every branch often; a failure prints its smallest example, so nothing is stored.
fn config() -> ProptestConfig {
    ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn the_position_is_the_integral_of_the_velocity(w in movement(), share in 0.0..=1.0) {
        let t = w.duration * share;
        let (motion, (x, y)) = (w.at(t), by_panels(&w, t));
        let error = (motion.x - x).hypot(motion.y - y);
        // The panels compute in plain f64: their speeds and phases are good to an ulp of the largest speed.
        let allowed = 2.0 * EPSILON * (1.0 + phase(&w, t)) * (motion.path + fastest(&w) * t);
        prop_assert!(error <= allowed, "{error:e}, allowed {allowed:e}");
    }

    #[test]
    fn two_parts_make_the_whole(w in movement(), share in 0.0..=1.0) {
        let t = w.duration * share;
        let (left, right) = speeds(&w, t);
        let first = Wheels { v1l: left, v1r: right, duration: t, ..w };
        let second = Wheels { v0l: left, v0r: right, duration: w.duration - t, ..w };
        let (joined, whole) = (then(first.end(), second.end()), w.end());
        let reach = fastest(&w) * w.duration;
        let turn = 2.0 * reach / w.track;
        // The speeds at the joint are rounded, which changes the headings of all of the second part by some
        // ulps of the turn.
        prop_assert!(distance(joined, whole) <= 4.0 * EPSILON * (1.0 + turn) * reach);
        prop_assert!((joined.theta - whole.theta).abs() <= 4.0 * EPSILON * turn);
        prop_assert!((joined.path - whole.path).abs() <= 4.0 * EPSILON * reach);
    }

    #[test]
    fn the_mirror_image_of_a_movement_swaps_its_wheels(w in movement(), share in 0.0..=1.0) {
        let t = w.duration * share;
        let motion = w.at(t);
        let mirrored = Wheels { v0l: w.v0r, v0r: w.v0l, v1l: w.v1r, v1r: w.v1l, ..w }.at(t);
        let expected = Motion { y: -motion.y, theta: -motion.theta, omega: -motion.omega, ..motion };
        prop_assert_eq!(mirrored, expected);
    }

    #[test]
    fn negative_speeds_drive_the_point_reflection_with_the_turn_undone(w in movement(), share in 0.0..=1.0) {
        // Wheels that swap and turn backwards keep ω and negate v, so the way is reflected in its start.
        let t = w.duration * share;
        let motion = w.at(t);
        let backwards = Wheels { v0l: -w.v0r, v0r: -w.v0l, v1l: -w.v1r, v1r: -w.v1l, ..w }.at(t);
        prop_assert_eq!(backwards, Motion { x: -motion.x, y: -motion.y, v: -motion.v, ..motion });
    }

    #[test]
    fn a_movement_driven_in_reverse_leads_back(w in movement()) {
        let back = Wheels { v0l: -w.v1l, v0r: -w.v1r, v1l: -w.v0l, v1r: -w.v0r, ..w };
        let home = then(w.end(), back.end());
        prop_assert_eq!(home.theta, 0.0);
        let allowed = 4e-15 * (1.0 + w.end().theta.abs()) * home.path;
        prop_assert!(distance(home, Motion::default()) <= allowed, "{home:?}, allowed {allowed:e}");
    }

    #[test]
    fn twice_the_speed_takes_half_the_time(w in movement(), share in 0.0..=1.0) {
        let t = w.duration * share;
        let motion = w.at(t);
        let (v0l, v0r, v1l, v1r) = (2.0 * w.v0l, 2.0 * w.v0r, 2.0 * w.v1l, 2.0 * w.v1r);
        let fast = Wheels { v0l, v0r, v1l, v1r, duration: w.duration / 2.0, ..w }.at(t / 2.0);
        prop_assert_eq!(fast, Motion { v: 2.0 * motion.v, omega: 2.0 * motion.omega, ..motion });
    }

    #[test]
    fn any_factor_of_time_leaves_the_way_as_it_is(w in movement(), factor in 0.1..10.0) {
        let (v0l, v0r, v1l, v1r) = (w.v0l / factor, w.v0r / factor, w.v1l / factor, w.v1r / factor);
        let slow = Wheels { v0l, v0r, v1l, v1r, duration: w.duration * factor, ..w }.end();
        let reach = fastest(&w) * w.duration;
        prop_assert!(distance(slow, w.end()) <= 4.0 * EPSILON * (1.0 + 2.0 * reach / w.track) * reach);
    }

    #[test]
    fn the_way_is_never_shorter_than_the_displacement(w in movement(), share in 0.0..=1.0) {
        let motion = w.at(w.duration * share);
        prop_assert!(motion.x.hypot(motion.y) <= motion.path * (1.0 + 4.0 * EPSILON));
    }

    #[test]
    fn finite_arguments_give_no_nan(
        speeds in prop::array::uniform4(wild()),
        duration in wild(),
        track in wild(),
        t in wild(),
    ) {
        let [v0l, v0r, v1l, v1r] = speeds;
        let w = Wheels { v0l, v0r, v1l, v1r, duration: duration.abs(), track: track.abs().max(5e-324) };
        for t in [t.abs().min(w.duration), w.duration / 3.0, w.duration] {
            let motion = w.at(t);
            let Motion { x, y, theta, v, omega, path } = motion;
            prop_assert!(![x, y, theta, v, omega, path].iter().any(|number| number.is_nan()), "{:?}", motion);
            // The results stay below these bounds, so they can be infinite only where the bounds are.
            let omega_bound = 2.0 * fastest(&w) / w.track;
            prop_assert!(v.is_finite() && (omega.is_finite() || omega_bound.is_infinite()), "{:?}", motion);
            prop_assert!(theta.is_finite() || (omega_bound * t).is_infinite(), "{:?}", motion);
            prop_assert!(path.is_finite() || (fastest(&w) * t).is_infinite(), "{:?}", motion);
            // Halves, so that the hypotenuse of representable numbers does not overflow; and a little of what
            // the fastest wheel could have covered, since digits that far below it may be lost.
            let lost = fastest(&w) * 1e-300 * t + 1e-320;
            prop_assert!((x / 2.0).hypot(y / 2.0) <= path / 2.0 * (1.0 + 1e-14) + lost, "{:?}", motion);
        }
    }

    #[test]
    fn finite_distances_reckon_to_no_nan(left in wild(), right in wild(), track in wild()) {
        let track = track.abs().max(5e-324);
        if !((right / 2.0 - left / 2.0) / track * 2.0).is_finite() {
            return Ok(());
        }
        for reckon in [arc, point_and_shoot, half_turn] {
            let (x, y, theta) = reckon(left, right, track);
            prop_assert!(x.is_finite() && y.is_finite() && theta.is_finite(), "({x}, {y}, {theta})");
        }
    }
}
