//! Raw bytes as every number of the motion library: nothing panics, and nothing finite becomes NaN.
//!
//! A short run is part of every test run. A long one, with the same cases every time:
//! `PROPTEST_CASES=80000 PROPTEST_RNG_SEED=1 cargo test --locked -p axle-schema --test fuzz`.
//! `.ci/run fuzz` runs one seed after the other for a minute.

#![allow(clippy::unwrap_used, reason = "what a constructor took must convert")]

use axle_schema::encoders::continuous;
use axle_schema::motion::polynomial::PolynomialWheels;
use axle_schema::motion::{accelerated, slope};
use axle_schema::series::{Accumulate as _, Convert as _, Spread as _, Symmetry as _};
use axle_schema::{
    Curve, Dwm, EncodersData, EncodersSpan, Geometry, Metres, MetresPerSecond, NavigatorData, PerMetre,
    Radians, Seconds, Sides, Symmetric as _, Tolerance, Track,
};
use proptest::prelude::*;

/// Any bits, among them NaN and infinities; half of the time the number of a robot, and often one of the others.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        2 => any::<u64>().prop_map(f64::from_bits),
        4 => -20.0..20.0,
        2 => prop::sample::select(&[0.0, -0.0, 0.1, 0.5, 1.0, -1.0, 1e-300, 1e300, f64::MAX, f64::NAN, f64::INFINITY][..]),
        1 => (-300.0..300.0).prop_map(|power| 10f64.powf(power)),
    ]
}

fn number_of(curve: &Curve) -> bool {
    let span = curve.navigator_span();
    span.x.is_finite() && span.y.is_finite() && span.heading.is_finite()
}

/// Everything that a movement can be asked.
fn ask(dwm: Dwm, track: Track, t: f64) -> Result<(), TestCaseError> {
    let moderate = dwm.peak_speed().0 <= 1e30 && dwm.duration().0 <= 1e30;
    for motion in [dwm.motion_at(track, Seconds(t)), dwm.motion_at(track, dwm.duration())] {
        let numbers = [motion.x, motion.y, motion.theta, motion.v, motion.omega, motion.path];
        prop_assert!(t.is_nan() || !numbers.iter().any(|number| number.is_nan()), "{dwm:?} {t} {motion:?}");
        prop_assert!(
            t.is_nan() || !moderate || numbers.iter().all(|number| number.is_finite()),
            "{dwm:?} {motion:?}"
        );
    }
    let _ = dwm.shape(track);
    let again = Dwm::join(dwm.split()).unwrap();
    prop_assert_eq!(again, dwm);
    for tolerance in [Tolerance::default(), Tolerance { position: Metres(t), heading: Radians(t) }] {
        if let Ok(geometry) = dwm.geometry(track, tolerance) {
            prop_assert!(!moderate || number_of(&geometry.into()), "{dwm:?} {geometry:?}");
            prop_assert!(!moderate || geometry.normalized_dwm(track).is_ok(), "{dwm:?} {geometry:?}");
        }
        if let Ok(curve) = dwm.curve(track, tolerance) {
            let json = serde_json::to_string(&curve);
            prop_assert!(!moderate || json.is_ok(), "{curve:?}");
        }
    }
    let few = dwm.poses(NavigatorData::default(), track, Seconds(t)).take(5).count();
    prop_assert!((1..=5).contains(&few));
    Ok(())
}

fn ask_spans(n: &[f64], track: Track) {
    let spans: Vec<_> = n
        .chunks_exact(3)
        .map(|n| EncodersSpan { duration: Seconds(n[0]), left: Metres(n[1]), right: Metres(n[2]) })
        .collect();
    let _ = continuous(&spans, None);
    let readings: Vec<_> = spans.iter().copied().accumulate(EncodersData::default()).collect();
    assert_eq!(readings.len(), spans.len() + 1);
    let poses = readings.iter().copied().spread().to_accelerated_dwms().to_navigator_spans(track).flatten();
    let _ = poses.accumulate(NavigatorData::default()).spread().count();
    let _: Metres = spans.iter().copied().lefts().map(|half| half.distance).sum();
    let _ = accelerated(n[0], n[1], [n[2], n[3]], n[4], track.get());
    let _ = slope(Some((n[0], n[1])), (n[2], n[3]), Some((n[4], n[5])));
    let wheels = PolynomialWheels { left: &n[..4], right: &n[4..], track: track.get() };
    if let Some(motion) = wheels.at(n[8].abs()) {
        let numbers = [motion.x, motion.y, motion.theta, motion.v, motion.omega, motion.path];
        assert!(!numbers.iter().any(|number| number.is_nan()), "{wheels:?} at {}: {motion:?}", n[8].abs());
    }
}

fn ask_curves(n: &[f64], track: Track) -> Result<(), TestCaseError> {
    let curves = [
        Geometry::Arc { radius: Metres(n[0]), angle: Radians(n[1]) }.into(),
        Curve::Spiral { start_radius: Metres(n[0]), end_radius: Metres(n[1]), angle: Radians(n[2]) },
        Curve::Clothoid {
            start_curvature: PerMetre(n[0]),
            end_curvature: PerMetre(n[1]),
            length: Metres(n[2]),
        },
    ];
    for curve in curves {
        if curve.check().is_ok() {
            prop_assert!(number_of(&curve), "{curve:?}");
            let dwm = curve.normalized_dwm(track).unwrap();
            prop_assert!(dwm.peak_speed().0 <= 1.0 + 1e-15, "{curve:?} {dwm:?}");
        } else {
            let _ = (curve.navigator_span(), curve.normalized_dwm(track));
        }
    }
    Ok(())
}

proptest! {
    // The defaults read the count of cases and the seed from the environment.
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_the_numbers_are_the_motion_library_answers_or_refuses(
        n in prop::collection::vec(any_number(), 12), width in any_number(),
    ) {
        let Ok(track) = Track::new(Metres(width)).or_else(|_| Track::new(Metres(0.3))) else { return Ok(()) };
        let side = |left: f64, right: f64| Sides::new(MetresPerSecond(left), MetresPerSecond(right));
        let dwm = Dwm::new(side(n[0], n[1]), side(n[2], n[3]), Seconds(n[4]));
        let fit = n[..5].iter().all(|number| number.is_finite()) && n[4] >= 0.0;
        prop_assert_eq!(dwm.is_ok(), fit);
        if let Ok(dwm) = dwm {
            ask(dwm, track, n[5])?;
        }
        ask_spans(&n, track);
        ask_curves(&n, track)?;
    }
}
