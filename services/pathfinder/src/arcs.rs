//! The strategy "arcs": an arc to every point, as the warehouse's robot drives (model.md, errata 25 and 26).
//!
//! With β the angle between the heading and the direction of the point, at the distance d, the arc that begins along the
//! heading and ends at the point turns by 2β, has the radius d/(2 sin β), and swings out by (d/2) tan(β/2): its hump. In
//! an aisle of a metre and a half the hump must be small. Where it would be larger than `hump`, where β is more than a
//! right angle, or where the inner wheel would run backward, the robot first turns on the spot, no further than needed.

use crate::Task;
use crate::way::{Way, bearing};
use axle_schema::{Geometry, Metres, Radians, WayPoint};
use std::f64::consts::FRAC_PI_2;

/// Visits all points.
pub(crate) fn plan(way: &mut Way, task: &Task<'_>, points: &[(usize, WayPoint)]) {
    for &(index, point) in points {
        if way.sets_out(task.params.merge, index, &point) {
            let distance = point.distance(way.at()).0;
            let beta = Radians(bearing(way.at(), &point) - way.at().heading.0).wrapped().0;
            let most = steepest(distance, task.params.hump.0, task.robot.track.get());
            if beta.abs() > most {
                way.turn_to(way.at().heading.0 + beta - most.copysign(beta), index, &point);
            }
            approach(way, index, &point);
            way.arrived(index);
        }
        if let Some(heading) = point.heading {
            way.turn_to(heading.0, index, &point);
        }
    }
}

/// The largest β of an arc over a distance whose hump and inner wheel are within their limits, 0 to a right angle.
fn steepest(distance: f64, hump: f64, track: f64) -> f64 {
    let by_hump = 2.0 * (2.0 * hump / distance).atan();
    let by_wheel = (distance / track).min(1.0).asin();
    by_hump.min(by_wheel).min(FRAC_PI_2)
}

/// The largest radius that a geometry may have, in m. Where the point is nearly straight ahead, or a very small hump is
/// allowed over a long distance, the robot turns towards it and goes straight.
const FLATTEST: f64 = 1e6;

/// The arc from where the robot is to the point; a line if it is straight ahead.
fn approach(way: &mut Way, index: usize, point: &WayPoint) {
    let at = way.at();
    let distance = point.distance(at).0;
    let beta = Radians(bearing(at, point) - at.heading.0).wrapped().0;
    let radius = distance / (2.0 * beta.sin());
    let geometry = if radius.abs() <= FLATTEST {
        Geometry::Arc { radius: Metres(radius), angle: Radians(2.0 * beta) }
    } else {
        way.turn_towards(index, point);
        Geometry::Line { length: point.distance(way.at()) }
    };
    way.add(geometry, index, point);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pathfinder;
    use crate::tests::{end, given, planned};
    use axle_schema::contract::Functional as _;
    use axle_schema::{PlanAsk, PlanStrategy, Pose, WayTask};
    use proptest::prelude::*;

    #[test]
    fn an_arc_leads_to_a_point_aside_and_swings_out_by_its_hump() {
        // 1 m ahead and 0.2 m to the left: β = atan 0.2, hump (d/2) tan(β/2) = 5.05 cm.
        let plan = planned(&given(PlanStrategy::Arcs), "1,0.2");
        let Geometry::Arc { radius, angle } = plan.legs[0].geometry else { panic!("{plan:?}") };
        let (d, beta) = (1.04_f64.sqrt(), 0.2_f64.atan());
        assert!((radius.0 - d / (2.0 * beta.sin())).abs() < 1e-12 && (angle.0 - 2.0 * beta).abs() < 1e-12);
        assert!((radius.0 * (1.0 - beta.cos()) - d / 2.0 * (beta / 2.0).tan()).abs() < 1e-12);
        assert_eq!(plan.legs.len(), 1);
    }

    #[test]
    fn what_is_flatter_than_any_arc_is_a_line() {
        // β = 1e-6 over 5 m would need a radius of 2500 km.
        let plan = planned(&given(PlanStrategy::Arcs), "5,0.000005");
        let shapes: Vec<Geometry> = plan.legs.iter().map(|leg| leg.geometry).collect();
        assert!(matches!(shapes[..], [Geometry::Turn { .. }, Geometry::Line { .. }]), "{plan:?}");
        assert!((end(&plan).x.0 - 5.0).abs() < 1e-12 && (end(&plan).y.0 - 5e-6).abs() < 1e-12);
    }

    #[test]
    fn a_hump_that_is_too_large_is_turned_away_first() {
        let mut params = given(PlanStrategy::Arcs);
        params.hump = Metres(0.05);
        let plan = planned(&params, "0,1");
        let Geometry::Turn { angle } = plan.legs[0].geometry else { panic!("{plan:?}") };
        // tan(β/2) = 2 · 0.05: what is left of the right angle is turned on the spot.
        assert!((angle.0 - (FRAC_PI_2 - 2.0 * 0.1_f64.atan())).abs() < 1e-12, "{plan:?}");
        params.hump = Metres(0.0);
        assert!(
            matches!(planned(&params, "0,1").legs[1].geometry, Geometry::Line { .. }),
            "no hump is no arc"
        );
    }

    proptest! {
        #[test]
        fn every_point_is_reached_within_the_hump(
            coordinates in proptest::collection::vec((-9.0..9.0, -9.0..9.0), 1..20),
            heading in -7.0..7.0,
            hump in 0.0..2.0,
        ) {
            let points: Vec<_> = coordinates.iter().map(|&(x, y)| WayPoint::at(x, y)).collect();
            let last = points[points.len() - 1];
            let mut params = given(PlanStrategy::Arcs);
            (params.hump, params.merge) = (Metres(hump), Metres(0.0));
            let ask = PlanAsk { way: WayTask { points }, start: Some(Pose::new(0.0, 0.0, heading)), ..PlanAsk::default() };
            let plan = Pathfinder::answer(&params, &ask).expect("a plan");
            prop_assert!(last.distance(end(&plan)).0 < 1e-9, "ends at {:?}", end(&plan));
            for leg in &plan.legs {
                if let Geometry::Arc { radius, angle } = leg.geometry {
                    let swing = radius.0.abs() * (1.0 - (angle.0 / 2.0).cos());
                    prop_assert!(swing <= hump + 1e-9, "a hump of {swing} m: {leg:?}");
                    prop_assert!(radius.0.abs() >= params.robot.track.get() / 2.0 - 1e-9, "{leg:?}");
                }
            }
        }
    }
}
