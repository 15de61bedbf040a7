//! The map of conversions: geometries, curves, spans and halves, there and back.

#![allow(clippy::float_cmp, reason = "some results are documented to be exact")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a refusal where none is due ends the test")]

use axle_schema::encoders::continuous;
use axle_schema::{
    Curve, Dwm, EncodersData, EncodersSpan, Geometry, Metres, MetresPerSecond, NavigatorData, PerMetre, Pose,
    Radians, Refusal, Seconds, Sides, Symmetric, Tolerance, Track,
};
use proptest::prelude::*;

fn track() -> Track {
    Track::new(Metres(0.3)).unwrap()
}

fn speeds(left: f64, right: f64) -> Sides<MetresPerSecond> {
    Sides::new(MetresPerSecond(left), MetresPerSecond(right))
}

fn dwm(v0: (f64, f64), v1: (f64, f64), duration: f64) -> Dwm {
    Dwm::new(speeds(v0.0, v0.1), speeds(v1.0, v1.1), Seconds(duration)).unwrap()
}

fn span(duration: f64, left: f64, right: f64) -> EncodersSpan {
    EncodersSpan { duration: Seconds(duration), left: Metres(left), right: Metres(right) }
}

const fn tolerance(position: f64, heading: f64) -> Tolerance {
    Tolerance { position: Metres(position), heading: Radians(heading) }
}

fn line(length: f64) -> Geometry {
    Geometry::Line { length: Metres(length) }
}
fn turn(angle: f64) -> Geometry {
    Geometry::Turn { angle: Radians(angle) }
}
fn arc(radius: f64, angle: f64) -> Geometry {
    Geometry::Arc { radius: Metres(radius), angle: Radians(angle) }
}
fn spiral(start: f64, end: f64, angle: f64) -> Curve {
    Curve::Spiral { start_radius: Metres(start), end_radius: Metres(end), angle: Radians(angle) }
}
fn clothoid(start: f64, end: f64, length: f64) -> Curve {
    Curve::Clothoid { start_curvature: PerMetre(start), end_curvature: PerMetre(end), length: Metres(length) }
}

// ---- movement to geometry -----------------------------------------------------------------------

/// The numbers of a curve, for comparison.
fn numbers(curve: Curve) -> Vec<f64> {
    match curve {
        Curve::Steady(Geometry::Line { length }) => vec![length.0],
        Curve::Steady(Geometry::Turn { angle }) => vec![angle.0],
        Curve::Steady(Geometry::Arc { radius, angle }) => vec![radius.0, angle.0],
        Curve::Spiral { start_radius, end_radius, angle } => vec![start_radius.0, end_radius.0, angle.0],
        Curve::Clothoid { start_curvature, end_curvature, length } => {
            vec![start_curvature.0, end_curvature.0, length.0]
        }
    }
}

fn check(movement: Dwm, tolerance: Tolerance, expected: impl Into<Curve>) {
    let expected = expected.into();
    let found = movement.curve(track(), tolerance).unwrap();
    assert_eq!(found.name(), expected.name(), "{movement:?}: {found:?}");
    for (found, expected) in numbers(found).into_iter().zip(numbers(expected)) {
        assert!(
            (found - expected).abs() <= 1e-12 * (1.0 + expected.abs()),
            "{movement:?}: {found} {expected}"
        );
    }
    if let Ok(geometry) = Geometry::try_from(expected) {
        let found = movement.geometry(track(), tolerance).unwrap();
        assert_eq!(Curve::from(found).name(), Curve::from(geometry).name(), "{movement:?}");
    } else {
        movement.geometry(track(), tolerance).unwrap_err();
    }
}

#[test]
fn a_movement_is_the_simplest_geometry_within_the_tolerance() {
    let usual = Tolerance::default();
    check(Dwm::rest(Seconds(1.0)), usual, line(0.0));
    check(dwm((0.1, 0.1), (0.5, 0.5), 2.0), usual, line(0.6));
    check(dwm((-0.1, -0.1), (-0.5, -0.5), 2.0), usual, line(-0.6));
    check(dwm((-0.1, 0.1), (-0.5, 0.5), 2.0), usual, turn(4.0));
    // v=(.2,.5)→(.4,1), T=2, Δ=.3: model.md, erratum 1.
    check(dwm((0.2, 0.5), (0.4, 1.0), 2.0), usual, arc(0.35, 3.0));
    check(dwm((-0.4, -1.0), (-0.2, -0.5), 2.0), usual, arc(0.35, -3.0));
    // Decimal speeds, whose ratios are equal for people and differ for f64.
    check(dwm((0.1, 0.3), (0.2, 0.6), 1.0), usual, arc(0.3, 1.0));
    // Half a millimetre of path is no path for a millimetre of tolerance; but it must not turn unseen.
    check(dwm((0.0005, 0.0005), (0.0005, 0.0005), 1.0), tolerance(1e-3, 1e-3), line(0.0005));
    check(dwm((-0.1, 0.101), (-0.1, 0.101), 1.0), tolerance(1e-3, 1e-3), turn(0.67));
    // A micrometre over a metre is a line; with no tolerance it is an arc.
    check(dwm((1.0, 1.000_000_1), (1.0, 1.000_000_1), 1.0), usual, line(1.000_000_05));
    let strict = dwm((1.0, 1.5), (1.0, 1.5), 1.0).geometry(track(), tolerance(0.0, 0.0));
    assert!(matches!(strict, Ok(Geometry::Arc { .. })), "a steady movement is an arc without any tolerance");
}

#[test]
fn a_movement_with_equal_accelerations_is_a_spiral_and_one_with_opposite_accelerations_a_clothoid() {
    let usual = Tolerance::default();
    check(dwm((0.25, 0.5), (1.0, 1.25), 1.5), usual, spiral(0.45, 1.35, 1.25));
    check(dwm((0.1, 0.2), (0.3, 0.4), 1.0), usual, spiral(0.45, 1.05, 1.0 / 3.0));
    check(dwm((0.5, 0.5), (0.2, 0.8), 2.0), usual, clothoid(0.0, 4.0, 1.0));
    check(dwm((-0.5, -0.5), (-0.8, -0.2), 2.0), usual, clothoid(0.0, -4.0, -1.0));
    // From forward to backward at a constant turning rate: the radius changes its sign.
    check(dwm((0.1, 0.4), (-0.4, -0.1), 2.0), usual, spiral(0.25, -0.25, 2.0));
}

#[test]
fn a_movement_that_is_no_geometry_is_refused_with_its_distance_from_the_nearest() {
    let both = dwm((0.2, 0.5), (1.0, 0.6), 2.0);
    let refusal = both.curve(track(), Tolerance::default()).unwrap_err();
    let Refusal::OutOfRange { what, got, limit } = &refusal else { panic!("{refusal}") };
    assert!(what.contains("clothoid") && got.contains("spiral") && got.contains("arc"), "{refusal}");
    assert!(limit.contains("0.000001 m"), "{refusal}");
    // A wheel that changes its direction: the geometry would lose the overshoot (model.md, 4.2).
    for overshoot in [
        dwm((0.5, 0.5), (-0.3, -0.3), 2.0),
        dwm((-0.5, 0.5), (0.3, -0.3), 2.0),
        dwm((0.5, 1.0), (-0.25, -0.5), 2.0),
    ] {
        assert!(overshoot.geometry(track(), tolerance(1e-2, 1e-2)).is_err(), "{overshoot:?}");
    }
    // A rounding error of the planner is no overshoot.
    let rounded = dwm((0.5, 0.5), (-1e-17, -1e-17), 2.0);
    assert!(matches!(rounded.geometry(track(), Tolerance::default()), Ok(Geometry::Line { .. })));
}

fn any_dwm() -> impl Strategy<Value = Dwm> {
    let speed = || prop_oneof![5 => -1.5..1.5, 1 => Just(0.0), 1 => Just(0.5)];
    // Perturbed lines, turns, circles, spirals and clothoids as well as movements of no shape at all.
    let kind = 0..5_u8;
    (speed(), speed(), speed(), speed(), kind, -8.0..-1.0, 0.01..5.0).prop_map(
        |(v0l, v0r, v1l, v1r, kind, power, duration): (f64, f64, f64, f64, u8, f64, f64)| {
            let bit = 10f64.powf(power);
            let (v0r, v1l, v1r) = match kind {
                0 => (v0l + bit, v1l, v1l - bit),
                1 => (-v0l + bit, v1l, -v1l),
                2 => (v0r, v0l * v1l + bit, v0r * v1l),
                3 => (v0r, v1l, v0r + (v1l - v0l) + bit),
                _ => (v0r, v1l, v1r),
            };
            dwm((v0l, v0r), (v1l, v1r), duration)
        },
    )
}

/// Whether some place of the curve is within `tolerance` of `pose`, in position and in heading.
fn is_near(curve: &Curve, pose: Pose, tolerance: Tolerance) -> bool {
    // In 4 mm of the faster wheel the middle of the axle moves 4 mm at most, and a robot of this track turns by 27 mrad.
    let mut samples = curve.poses(Pose::default(), track(), Seconds(4e-3)).unwrap();
    samples.any(|sample| {
        sample.pose.distance(pose).0 <= tolerance.position.0 + 2.1e-3
            && (sample.pose.heading.0 - pose.heading.0).abs() <= tolerance.heading.0 + 0.014
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_robot_stays_within_the_tolerance_of_the_curve(movement in any_dwm(), power in -4.0..-0.5) {
        let within = tolerance(10f64.powf(power), 10f64.powf(power));
        let Ok(curve) = movement.curve(track(), within) else { return Ok(()) };
        for state in movement.poses(NavigatorData::default(), track(), movement.duration() * 0.05) {
            prop_assert!(is_near(&curve, state.pose, within), "{curve:?} is far from {state:?}");
        }
        let end = curve.navigator_span();
        let whole = movement.navigator_span(track());
        let miss = (end.x.0 - whole.x.0).hypot(end.y.0 - whole.y.0);
        prop_assert!(miss <= within.position.0 + 1e-12, "{curve:?} ends {miss} m away");
        prop_assert!((end.heading.0 - whole.heading.0).abs() <= within.heading.0 + 1e-12);
    }

    #[test]
    fn a_geometry_is_what_its_normalized_movement_drives(
        radius in -3.0..3.0, angle in -7.0..7.0, length in -3.0..3.0, kind in 0..3_u8,
    ) {
        let geometry = match kind {
            0 => line(length),
            1 => turn(angle),
            _ => arc(radius, angle),
        };
        let movement = geometry.normalized_dwm(track()).unwrap();
        let again = movement.geometry(track(), Tolerance::default()).unwrap();
        let (there, back) = (geometry.navigator_span(), again.navigator_span());
        let miss = (there.x.0 - back.x.0).hypot(there.y.0 - back.y.0);
        prop_assert!(miss <= 1.1e-6, "{geometry:?} {again:?}");
        prop_assert!((there.heading.0 - back.heading.0).abs() <= 1.1e-6, "{geometry:?} {again:?}");
        let end = Curve::from(geometry).poses(Pose::default(), track(), Seconds(0.1)).unwrap().last().unwrap();
        let miss = end.pose.distance(Pose { x: there.x, y: there.y, heading: there.heading });
        prop_assert!(miss.0 <= 1e-14 * (1.0 + movement.duration().0), "{geometry:?} {miss}");
        prop_assert!((movement.peak_speed().0 - 1.0).abs() <= 2.0 * f64::EPSILON, "{movement:?}");
    }

    #[test]
    fn a_spiral_and_a_clothoid_are_what_their_movements_drive(
        start in -3.0..3.0, end in -3.0..3.0, size in -7.0..7.0, width in 0.05..1.0, is_spiral in any::<bool>(),
    ) {
        let curve = if is_spiral { spiral(start, end, size) } else { clothoid(start, end, size) };
        let track = Track::new(Metres(width)).unwrap();
        let movement = curve.normalized_dwm(track).unwrap();
        prop_assert!((movement.peak_speed().0 - 1.0).abs() <= 2.0 * f64::EPSILON, "{movement:?}");
        let (there, driven) = (curve.navigator_span(), movement.navigator_span(track));
        let miss = (there.x.0 - driven.x.0).hypot(there.y.0 - driven.y.0);
        prop_assert!(miss <= 1e-13 * (1.0 + movement.duration().0), "{curve:?} {miss:e}");
        prop_assert!((there.heading.0 - driven.heading.0).abs() <= 1e-12 * (1.0 + size.abs()), "{curve:?}");
        if let Ok(again) = movement.curve(track, tolerance(1e-9, 1e-9)) {
            let back = again.navigator_span();
            let miss = (there.x.0 - back.x.0).hypot(there.y.0 - back.y.0);
            prop_assert!(miss <= 1.1e-9, "{curve:?} {again:?}");
        } else {
            prop_assert!(false, "{curve:?} is not found again");
        }
    }

    #[test]
    fn spans_of_movements_made_from_spans_are_the_spans(
        steps in prop::collection::vec((0.01..1.0, -1.0..1.0, -1.0..1.0), 1..20),
        v0 in prop::option::of((-1.0..1.0, -1.0..1.0)),
    ) {
        let spans: Vec<_> = steps.iter().map(|&(t, l, r)| span(t, l, r)).collect();
        let start = v0.map(|(l, r)| speeds(l, r));
        let chain = continuous(&spans, start).unwrap();
        let mut last = start;
        for (movement, span) in chain.iter().zip(&spans) {
            if let Some(last) = last {
                prop_assert_eq!(movement.start(), last);
            }
            last = Some(movement.end());
            for again in [*movement, span.to_dwm().unwrap()].map(|dwm| dwm.encoders_span()) {
                prop_assert_eq!(again.duration, span.duration);
                let size = movement.peak_speed().0 * span.duration.0;
                prop_assert!((again.left - span.left).0.abs() <= 1e-15 * (1.0 + size), "{again:?} {span:?}");
                prop_assert!((again.right - span.right).0.abs() <= 1e-15 * (1.0 + size), "{again:?} {span:?}");
            }
        }
    }

    #[test]
    fn no_other_start_speed_is_smoother_than_the_one_of_least_squares(
        steps in prop::collection::vec((0.01..1.0, -1.0..1.0), 1..20), other in -0.5..0.5,
    ) {
        let spans: Vec<_> = steps.iter().map(|&(t, l)| span(t, l, 0.0)).collect();
        let roughness = |chain: &[Dwm]| -> f64 {
            chain.iter().map(|dwm| dwm.accelerations().left.0.powi(2) * dwm.duration().0).sum()
        };
        let best = continuous(&spans, None).unwrap();
        let start = best[0].start();
        let moved = Sides::new(start.left + MetresPerSecond(other), start.right);
        let other = continuous(&spans, Some(moved)).unwrap();
        prop_assert!(roughness(&best) <= roughness(&other) * (1.0 + 1e-9));
    }

    #[test]
    fn halves_join_to_what_was_split(movement in any_dwm(), t in -1e3..1e3, l in -1e3..1e3, r in -1e3..1e3) {
        prop_assert_eq!(Dwm::join(movement.split()), Ok(movement));
        let data = EncodersData { stamp: Seconds(t), left: Metres(l), right: Metres(r) };
        prop_assert_eq!(EncodersData::join(data.split()), Ok(data));
        let span = span(t, l, r);
        prop_assert_eq!(EncodersSpan::join(span.split()), Ok(span));
    }
}

// ---- tables -------------------------------------------------------------------------------------

#[test]
fn a_chain_has_the_speeds_of_the_model() {
    // model.md 4.3: m=.1,.3,.5,.6,.6, T=.1.
    let spans: Vec<_> = [0.1, 0.3, 0.5, 0.6, 0.6].iter().map(|m| span(0.1, m * 0.1, 0.0)).collect();
    for (start, expected) in [
        (Some(speeds(0.0, 0.0)), [0.0, 0.2, 0.4, 0.6, 0.6, 0.6]),
        (None, [0.02, 0.18, 0.42, 0.58, 0.62, 0.58]),
    ] {
        let chain = continuous(&spans, start).unwrap();
        let found = std::iter::once(chain[0].start()).chain(chain.iter().map(Dwm::end));
        for (found, expected) in found.zip(expected) {
            assert!((found.left.0 - expected).abs() < 1e-12, "{} instead of {expected}", found.left);
            assert_eq!(found.right, MetresPerSecond::ZERO);
        }
    }
    assert_eq!(continuous(&[], None), Ok(Vec::new()));
}

#[test]
fn a_span_from_a_start_speed_ends_as_far_on_the_other_side_of_the_mean() {
    let movement = span(0.5, 0.1, -0.2).to_dwm_from(speeds(0.0, -0.5)).unwrap();
    assert_eq!(movement.end(), speeds(0.4, 2.0 * (-0.2 / 0.5) + 0.5));
}

#[test]
fn a_span_without_duration_moves_nothing_or_is_refused() {
    assert_eq!(span(0.0, 0.0, 0.0).to_dwm(), Ok(Dwm::rest(Seconds::ZERO)));
    let still = span(0.0, 0.0, 0.0).to_dwm_from(speeds(0.1, 0.2)).unwrap();
    assert_eq!(
        (still.start(), still.end(), still.duration()),
        (speeds(0.1, 0.2), speeds(0.1, 0.2), Seconds(0.0))
    );
    for jump in
        [span(0.0, 0.1, 0.0), span(-1.0, 0.1, 0.0), span(f64::NAN, 0.0, 0.0), span(0.0, f64::NAN, 0.0)]
    {
        let refused = jump.to_dwm().is_err() && continuous(&[jump], None).is_err();
        assert!(refused || jump.duration.0.is_nan() && jump.left == Metres::ZERO, "{jump:?}");
    }
}

#[test]
fn halves_of_different_times_are_refused() {
    let data = EncodersData { stamp: Seconds(1.0), ..EncodersData::default() }.split();
    let other = EncodersData { stamp: Seconds(2.0), ..EncodersData::default() }.split();
    let refusal = EncodersData::join(Sides::new(data.left, other.right)).unwrap_err();
    assert_eq!(
        refusal.to_string(),
        "stamp of two halves is out of range: 1 s and 2 s, allowed is the same stamp"
    );
}

#[test]
fn a_spiral_and_a_clothoid_are_refused_where_a_constant_ratio_is_needed() {
    for (curve, name) in [(spiral(0.1, 0.2, 1.0), "spiral"), (clothoid(0.0, 1.0, 1.0), "clothoid")] {
        let words = Geometry::try_from(curve).unwrap_err().to_string();
        assert!(words.contains(name) && words.contains("line, turn, arc"), "{words}");
    }
}

#[test]
fn a_curve_is_written_like_a_geometry() {
    for (curve, json) in [
        (Curve::from(arc(-0.5, 0.25)), r#"{"arc":{"radius":-0.5,"angle":0.25}}"#),
        (spiral(0.5, 1.0, 2.0), r#"{"spiral":{"start_radius":0.5,"end_radius":1.0,"angle":2.0}}"#),
        (clothoid(0.0, 4.0, 1.0), r#"{"clothoid":{"start_curvature":0.0,"end_curvature":4.0,"length":1.0}}"#),
    ] {
        assert_eq!(serde_json::to_string(&curve).unwrap(), json);
        assert_eq!(serde_json::from_str::<Curve>(json).unwrap(), curve);
    }
    let fault = serde_json::from_str::<Curve>(r#"{"parabola":{"length":1}}"#).unwrap_err().to_string();
    assert!(fault.contains("parabola") && fault.contains("clothoid"), "{fault}");
}

#[test]
fn a_curve_beyond_every_robot_is_refused_by_the_name_of_its_number() {
    for (curve, name) in [
        (spiral(2e6, 1.0, 1.0), "start radius of a spiral"),
        (spiral(1.0, 1.0, f64::NAN), "angle of a spiral"),
        (clothoid(0.0, -1e7, 1.0), "end curvature of a clothoid"),
        (Curve::from(line(f64::INFINITY)), "length of a line"),
    ] {
        let words = curve.check().unwrap_err().to_string();
        assert!(words.contains(name), "{words}");
    }
}

#[test]
fn a_chart_has_the_start_the_end_and_equal_steps_between() {
    let movement = dwm((0.2, 0.5), (0.4, 1.0), 2.0);
    let from =
        NavigatorData { stamp: Seconds(10.0), pose: Pose::new(1.0, 2.0, 0.5), ..NavigatorData::default() };
    let stamps =
        |step| movement.poses(from, track(), Seconds(step)).map(|data| data.stamp.0).collect::<Vec<_>>();
    assert_eq!(stamps(0.5), [10.0, 10.5, 11.0, 11.5, 12.0]);
    assert_eq!(stamps(0.6).len(), 5);
    for no_step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(stamps(no_step), [10.0, 12.0]);
    }
    assert_eq!(Dwm::rest(Seconds::ZERO).poses(from, track(), Seconds(0.1)).count(), 1);
    let end = movement.poses(from, track(), Seconds(0.5)).last().unwrap();
    assert_eq!(end.pose, movement.pose_at(from.pose, track(), Seconds(2.0)));
    assert_eq!(Curve::from(line(0.0)).poses(Pose::default(), track(), Seconds(0.1)).unwrap().count(), 1);
}

#[test]
fn a_long_arc_keeps_the_digits_of_its_heading() {
    // Wheel distances of a metre's track differ in the tenth digit only.
    let span = arc(1e6, 1e-6).navigator_span();
    assert_eq!(span.heading, Radians(1e-6));
    assert!((span.y.0 - 5e-7).abs() < 1e-19, "{span:?}");
}

#[test]
fn a_curve_that_hardly_bends_is_a_line() {
    for curvature in [5e-324, -5e-324, 1e-310, 2e-308] {
        for length in [1e6, 1.0, -1.0, 5e-324] {
            let (start_curvature, end_curvature) = (PerMetre(curvature), PerMetre(0.0));
            let curve = Curve::Clothoid { start_curvature, end_curvature, length: Metres(length) };
            let span = curve.navigator_span();
            assert_eq!(span.x, Metres(length), "{curve:?}");
            assert!(span.y.0.abs() < 1e-290 && span.heading.0.abs() < 1e-300, "{span:?}");
        }
    }
}
