//! The series language against reference vectors, its laws, and streams that wait.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a broken file of reference vectors ends the test")]

use axle_schema::series::{Accumulate as _, Convert as _, Datum as _, Spread as _, Symmetry as _};
use axle_schema::{
    Dwm, EncodersData, EncodersSpan, Geometry, Metres, MetresPerSecond, NavigatorData, NavigatorSpan, Pose,
    Radians, Refusal, Seconds, Sides, Track,
};
use futures_util::{FutureExt as _, StreamExt as _, stream};
use proptest::prelude::*;
use serde_json::Value;
use std::future::ready;

fn data(stamp: f64, pose: Pose) -> NavigatorData {
    NavigatorData { stamp: Seconds(stamp), pose, ..NavigatorData::default() }
}

fn four(value: &Value) -> [f64; 4] {
    [0, 1, 2, 3].map(|k| value[k].as_f64().unwrap_or_else(|| panic!("four numbers instead of {value}")))
}

fn measured(value: &Value) -> NavigatorData {
    let [t, x, y, theta] = four(value);
    data(t, Pose::new(x, y, theta))
}

fn list(value: &Value) -> &Vec<Value> {
    value.as_array().unwrap()
}

/// The largest difference of any number of two spans.
fn difference(a: &NavigatorSpan, b: [f64; 4]) -> f64 {
    [a.duration.0 - b[0], a.x.0 - b[1], a.y.0 - b[2], a.heading.0 - b[3]]
        .iter()
        .fold(0.0, |most, d| d.abs().max(most))
}

#[test]
fn spread_and_accumulate_follow_the_reference() {
    let cases = include_str!("data/golden_pose_compose.jsonl").lines();
    let cases: Vec<Value> = cases.map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(cases.len(), 34);
    for case in cases {
        let poses: Vec<_> = list(&case["poses"]).iter().map(measured).collect();
        let basis = measured(&case["basis"]);
        // The tolerance of model.md 8: 1e-15·n·(1+|basis|+Σ|dp|)·(1+max|θ|).
        let way: f64 = poses.windows(2).map(|pair| pair[0].pose.distance(pair[1].pose).0).sum();
        let turned =
            poses.iter().fold(basis.pose.heading.0.abs(), |most, d| d.pose.heading.0.abs().max(most));
        let reach = 1.0 + basis.pose.x.0.hypot(basis.pose.y.0) + way;
        #[allow(clippy::cast_precision_loss, reason = "a count of poses")]
        let allowed = 1e-15 * poses.len() as f64 * reach * (1.0 + turned);

        let spans: Vec<_> = poses.iter().copied().spread().collect();
        assert_eq!(spans.len(), list(&case["spans"]).len(), "{}", case["category"]);
        for (span, expected) in spans.iter().zip(list(&case["spans"])) {
            let error = difference(span, four(expected));
            assert!(error <= allowed, "{}: {span:?} {expected} {error:e}", case["category"]);
        }
        for (span, expected) in spans.iter().zip(list(&case["dtheta_wrapped"])) {
            let turn = span.heading.wrapped().0 - expected.as_f64().unwrap();
            // π and −π are one direction, and rounding decides between them.
            assert!(Radians(turn).wrapped().0.abs() <= allowed, "{}: {span:?} {expected}", case["category"]);
        }
        let total = poses[0].span_to(poses.last().unwrap());
        assert!(difference(&total, four(&case["total_span"])) <= allowed, "{}", case["category"]);
        let accumulated: Vec<_> = spans.into_iter().accumulate(basis).collect();
        assert_eq!(accumulated.len(), list(&case["accumulated"]).len());
        for (found, expected) in accumulated.iter().zip(list(&case["accumulated"])) {
            let expected = four(expected);
            let found = NavigatorSpan {
                duration: found.stamp,
                x: found.pose.x,
                y: found.pose.y,
                heading: found.pose.heading,
            };
            let error = difference(&found, expected);
            assert!(error <= allowed, "{}: {found:?} {expected:?} {error:e}", case["category"]);
        }
    }
}

fn readings() -> impl Strategy<Value = Vec<EncodersData>> {
    prop::collection::vec((0.001..0.5, -1.0..1.0, -1.0..1.0), 0..20).prop_map(|steps| {
        let spans = steps.into_iter().map(|(duration, left, right)| EncodersSpan {
            duration: Seconds(duration),
            left: Metres(left),
            right: Metres(right),
        });
        spans.accumulate(EncodersData::default()).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn to_accumulate_what_was_spread_is_the_identity(
        poses in prop::collection::vec((0.0..1e3, -1e2..1e2, -1e2..1e2, -20.0..20.0), 1..20),
    ) {
        let poses: Vec<_> = poses.into_iter().map(|(t, x, y, h)| data(t, Pose::new(x, y, h))).collect();
        let again: Vec<_> = poses.iter().copied().spread().accumulate(poses[0]).collect();
        prop_assert_eq!(again.len(), poses.len());
        for (a, b) in again.iter().zip(&poses) {
            prop_assert!(a.pose.distance(b.pose).0 <= 1e-11 && (a.stamp - b.stamp).0.abs() <= 1e-11);
            prop_assert!((a.pose.heading - b.pose.heading).0.abs() <= 1e-12);
        }
    }

    #[test]
    fn streams_say_the_same_as_iterators(readings in readings()) {
        use axle_schema::series::stream as s;
        let track = Track::new(Metres(0.3)).unwrap();
        let spans: Vec<_> = readings.iter().copied().spread().collect();
        let streamed = s::Spread::spread(stream::iter(readings.clone())).collect::<Vec<_>>().now_or_never();
        prop_assert_eq!(streamed.as_ref(), Some(&spans));
        let again = s::Accumulate::accumulate(stream::iter(spans.clone()), EncodersData::default());
        let expected: Vec<_> = spans.iter().copied().accumulate(EncodersData::default()).collect();
        prop_assert_eq!(again.collect::<Vec<_>>().now_or_never(), Some(expected));
        let movements = s::Convert::to_accelerated_dwms(stream::iter(spans.clone())).collect::<Vec<_>>();
        let expected: Vec<_> = spans.iter().copied().to_accelerated_dwms().collect();
        prop_assert_eq!(movements.now_or_never(), Some(expected.clone()));
        let poses = s::Convert::to_navigator_spans(stream::iter(expected.clone()), track).collect::<Vec<_>>();
        let expected: Vec<_> = expected.into_iter().to_navigator_spans(track).collect();
        prop_assert_eq!(poses.now_or_never(), Some(expected));
        let rights = s::Symmetry::rights(stream::iter(spans.clone())).collect::<Vec<_>>();
        let expected: Vec<_> = spans.iter().copied().rights().collect();
        prop_assert_eq!(rights.now_or_never(), Some(expected));
    }

    #[test]
    fn a_movement_cut_into_samples_is_reckoned_back_with_their_accelerations(
        v in prop::array::uniform4(-1.0..1.0), count in 3_u32..30,
    ) {
        let track = Track::new(Metres(0.3)).unwrap();
        let [v0l, v0r, v1l, v1r] = v.map(MetresPerSecond);
        let movement = Dwm::new(Sides::new(v0l, v0r), Sides::new(v1l, v1r), Seconds(1.0)).unwrap();
        let readings = (0..=count).map(|k| {
            let t = Seconds(f64::from(k) / f64::from(count));
            let Sides { left, right } = movement.distances_at(t);
            EncodersData { stamp: t, left, right }
        });
        let spans = readings.spread().to_accelerated_dwms().to_navigator_spans(track);
        let spans = spans.collect::<Result<Vec<_>, _>>().unwrap();
        let end = spans.into_iter().accumulate(NavigatorData::default()).last().unwrap();
        let expected = movement.pose_at(Pose::default(), track, Seconds(1.0));
        prop_assert!(end.pose.distance(expected).0 <= 1e-12, "{end:?} {expected:?}");
    }
}

#[test]
fn the_span_type_follows_from_the_datum() {
    // No annotation but that of the data: what `spread` gives is known.
    let [a, b] = [data(0.0, Pose::default()), data(1.0, Pose::new(1.0, 0.0, 0.0))];
    let x: f64 = [a, b].into_iter().spread().map(|span| span.x.0).sum();
    let left: f64 = [EncodersData::default(); 2].into_iter().spread().map(|span| span.left.0).sum();
    assert_eq!((x.to_bits(), left.to_bits()), (1f64.to_bits(), 0f64.to_bits()));
}

#[test]
fn a_refusal_travels_to_the_end_of_the_chain() {
    let jump = EncodersSpan { duration: Seconds(0.0), left: Metres(1.0), right: Metres(0.0) };
    let track = Track::new(Metres(0.3)).unwrap();
    let spans: Result<Vec<NavigatorSpan>, Refusal> =
        [EncodersSpan::default(), jump].into_iter().to_dwm().to_navigator_spans(track).collect();
    assert!(matches!(spans, Err(Refusal::OutOfRange { .. })), "{spans:?}");
    // A plan becomes a drawing without any refusal.
    let plan = [Geometry::Line { length: Metres(1.0) }, Geometry::Turn { angle: Radians(1.0) }];
    let drawn: Vec<_> =
        plan.into_iter().to_navigator_spans(track).accumulate(NavigatorData::default()).collect();
    assert_eq!(drawn.len(), 3);
}

#[test]
fn a_stream_waits_for_its_readings_and_loses_none() {
    use axle_schema::series::stream::Spread as _;
    // A stream that is not ready at every second question.
    let mut asked = 0_u32;
    let slow = stream::poll_fn(move |context| {
        asked += 1;
        if asked % 2 == 1 {
            context.waker().wake_by_ref();
            return std::task::Poll::Pending;
        }
        let stamp = f64::from(asked / 2);
        std::task::Poll::Ready(
            (asked <= 10).then(|| EncodersData { stamp: Seconds(stamp), ..EncodersData::default() }),
        )
    });
    let mut count = Box::pin(
        slow.spread().fold(0, |count, span| ready(count + i32::from(span.duration == Seconds(1.0)))),
    );
    let found = (0..100).find_map(|_| count.as_mut().now_or_never());
    assert_eq!(found, Some(4), "five readings have four spans between them");
}
