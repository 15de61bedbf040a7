//! The strategy "turn and go": on the spot towards the next point, straight to it, and so on (paper, section II).
//!
//! Every turn is the shorter one. A point with a heading gets a last turn on its place. The plan is exact up to
//! rounding: each leg starts where the legs before it really end, so that errors do not add up over many points.

use crate::way::Way;
use axle_schema::{Geometry, Metres, WayPoint};

/// Visits all points, with the numbers that they have in the question.
pub(crate) fn plan(way: &mut Way, merge: Metres, points: &[(usize, WayPoint)]) {
    for (index, point) in points {
        visit(way, merge, *index, point);
    }
}

/// Visits one point.
pub(crate) fn visit(way: &mut Way, merge: Metres, index: usize, point: &WayPoint) {
    if way.sets_out(merge, index, point) {
        way.turn_towards(index, point);
        // After the turn, so that the line is as long as the place where it begins asks for.
        way.add(Geometry::Line { length: point.distance(way.at()) }, index, point);
        way.arrived(index);
    }
    if let Some(heading) = point.heading {
        way.turn_to(heading.0, index, point);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::plan::MAX_NOTES;
    use axle_schema::{Message as _, MetresPerSecond, Plan, Pose, Radians};
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    const MERGE: Metres = Metres(1e-3);

    fn plan(merge: Metres, start: Pose, points: &[WayPoint]) -> Plan {
        let mut way = Way::new(start);
        super::plan(&mut way, merge, &points.iter().copied().enumerate().collect::<Vec<_>>());
        way.into_plan()
    }

    fn at(points: &[(f64, f64)]) -> Vec<WayPoint> {
        points.iter().map(|&(x, y)| WayPoint::at(x, y)).collect()
    }

    fn end(plan: &Plan) -> Pose {
        plan.legs.iter().fold(plan.start, |pose, leg| leg.geometry.end_from(pose))
    }

    /// Checks the plan from the origin against legs written as "turn" (rad) and "line" (m).
    fn check(points: &[WayPoint], legs: &[(&str, f64)]) -> Plan {
        let plan = plan(MERGE, Pose::default(), points);
        assert_eq!(plan.legs.len(), legs.len(), "{:?}", plan.legs);
        for (leg, &(kind, size)) in plan.legs.iter().zip(legs) {
            let (got_kind, got) = match leg.geometry {
                Geometry::Turn { angle } => ("turn", angle.0),
                Geometry::Line { length } => ("line", length.0),
                Geometry::Arc { .. } => ("arc", 0.0),
            };
            assert!(got_kind == kind && (got - size).abs() < 1e-12, "{leg:?} is not a {kind} of {size}");
        }
        plan
    }

    #[test]
    fn a_square_is_four_lines_and_three_left_turns_that_end_at_the_last_point() {
        let square = at(&[(1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)]);
        let turn = ("turn", FRAC_PI_2);
        let line = ("line", 1.0);
        let plan = check(&square, &[line, turn, line, turn, line, turn, line]);
        let end = end(&plan);
        assert!(end.x.0.abs() < 1e-12 && end.y.0.abs() < 1e-12, "ends at {end:?}");
        assert!((plan.length.0 - 4.0).abs() < 1e-12);
        assert_eq!(plan.legs.iter().map(|leg| leg.point).collect::<Vec<_>>(), [0, 1, 1, 2, 2, 3, 3]);
        assert!(plan.notes.is_empty());
    }

    #[test]
    fn the_shorter_way_round_is_turned() {
        let mut start = Pose::new(0.0, 0.0, 3.0);
        let back = plan(MERGE, start, &at(&[(1.0, -3.0)]));
        start.heading = Radians(3.0 + 20.0 * PI);
        for plan in [back, plan(MERGE, start, &at(&[(1.0, -3.0)]))] {
            // From 3 rad to atan2(-3, 1) = -1.249 rad: 2.034 to the left, not 4.249 to the right.
            let Geometry::Turn { angle } = plan.legs[0].geometry else {
                panic!("{plan:?} begins with a turn")
            };
            assert!((angle.0 - (2.0 * PI - 3.0 - 3.0_f64.atan())).abs() < 1e-12, "{angle}");
        }
    }

    #[test]
    fn a_point_with_a_heading_ends_with_a_turn_to_it() {
        let mut points = at(&[(1.0, 0.0)]);
        points[0].heading = Some(Radians(-FRAC_PI_2));
        check(&points, &[("line", 1.0), ("turn", -FRAC_PI_2)]);
    }

    #[test]
    fn the_speed_of_a_point_goes_into_every_leg_to_it() {
        let mut points = at(&[(1.0, 0.0), (1.0, 1.0)]);
        points[1].speed = Some(MetresPerSecond(0.2));
        let plan = check(&points, &[("line", 1.0), ("turn", FRAC_PI_2), ("line", 1.0)]);
        let speeds: Vec<_> = plan.legs.iter().map(|leg| leg.speed).collect();
        assert_eq!(speeds, [None, Some(MetresPerSecond(0.2)), Some(MetresPerSecond(0.2))]);
    }

    #[test]
    fn a_repeated_point_is_visited_once_and_noted() {
        let mut points = at(&[(0.0, 0.0), (1.0, 0.0), (1.0, 0.0005), (2.0, 0.0)]);
        points[2].heading = Some(Radians(0.0));
        let plan = check(&points, &[("line", 1.0), ("line", 1.0)]);
        assert_eq!(
            plan.notes,
            [
                "way point 1 is where the robot starts (0 m, 0 m): nothing to drive",
                "way point 3 repeats the place of way point 2 (1 m, 0.0005 m): visited once",
            ]
        );
    }

    #[test]
    fn creeping_points_are_not_all_merged_into_the_first() {
        let points: Vec<_> = (1..=10).map(|n| WayPoint::at(f64::from(n) * 0.0006, 0.0)).collect();
        let end = end(&plan(MERGE, Pose::default(), &points));
        assert!((end.x.0 - 0.006).abs() <= MERGE.0, "ends at {end:?}");
    }

    #[test]
    fn the_notes_have_a_bound() {
        let plan = plan(MERGE, Pose::default(), &vec![WayPoint::at(0.0, 0.0); 100]);
        assert_eq!(plan.notes.len(), MAX_NOTES);
        assert_eq!(
            plan.notes[MAX_NOTES - 1],
            "85 more way points repeat the place before them: visited once"
        );
        assert!(plan.legs.is_empty() && plan.check().is_ok());
    }

    #[test]
    fn the_longest_task_is_planned_and_still_ends_at_its_last_point() {
        let points: Vec<_> = (0..4096)
            .map(|n| {
                let angle = f64::from(n) * 2.4;
                let mut point = WayPoint::at(10.0 * angle.cos(), 10.0 * angle.sin());
                point.heading = Some(Radians(angle));
                point
            })
            .collect();
        let plan = plan(MERGE, Pose::default(), &points);
        assert!(plan.check().is_ok(), "the answer is one that may be sent");
        let end = end(&plan);
        assert!(points[4095].distance(end).0 < 1e-11, "ends at {end:?}");
    }

    proptest! {
        #[test]
        fn the_last_leg_ends_at_the_last_point(
            coordinates in proptest::collection::vec((-50.0..50.0, -50.0..50.0), 1..40),
            (x, y, heading) in (-50.0..50.0, -50.0..50.0, -10.0..10.0),
        ) {
            let points = at(&coordinates);
            let plan = plan(Metres(0.0), Pose::new(x, y, heading), &points);
            let end = end(&plan);
            prop_assert!(points[points.len() - 1].distance(end).0 < 1e-12 * 50.0, "ends at {end:?}");
            prop_assert!(plan.legs.iter().all(|leg| leg.geometry.check().is_ok()));
        }
    }
}
