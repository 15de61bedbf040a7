//! The strategy "smooth": corners become clothoids, so that the curvature grows and falls and never jumps far.
//!
//! A corner is a clothoid into the curve, an arc, and the clothoid out of it. A geometry is driven with a constant ratio
//! of the wheel speeds (model.md's 4.4, and every corrector that follows geometries), which no clothoid is; so each is
//! made of arcs whose curvature differs by at most `curvature_step`. At a speed v the wheel speeds then step by at most
//! v · step · track / 2, and a corner is a few millimetres beside that of the clothoid; Pathdriver can drive over the steps, or
//! blend them into the very clothoid.

use crate::corner::Shape;
use crate::way::Way;
use crate::{Task, rounded};
use axle_schema::WayPoint;

/// Visits all points, and passes by the corners.
pub(crate) fn plan(way: &mut Way, task: &Task<'_>, points: &[(usize, WayPoint)]) {
    rounded::round(way, task, points, |corner, fit| {
        let params = task.params;
        let mut radius = params.radius.0;
        // A tighter corner has more curvature and needs more steps, and with more steps it is a little tighter.
        for _ in 0..3 {
            radius = fit(&Shape::blend(corner.angle, params.blend, steps(radius, params.curvature_step))?);
        }
        let shape = Shape::blend(corner.angle, params.blend, steps(radius, params.curvature_step))?;
        Some((radius.min(fit(&shape)), shape))
    });
}

/// How many arcs keep the steps of curvature below `step`, from a straight line to a radius.
fn steps(radius: f64, step: f64) -> u32 {
    let steps = 1.0 / (radius.max(1e-3) * step);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 1e3")]
    let steps = (steps * 1.001).ceil().clamp(1.0, 1e3) as u32;
    steps
}

#[cfg(test)]
mod tests {
    use crate::tests::{end, given, planned};
    use axle_schema::{Geometry, PlanStrategy};

    #[test]
    fn the_curvature_never_steps_further_than_allowed() {
        let params = given(PlanStrategy::Smooth);
        let plan = planned(&params, "2,0 2,2 4,3 4,0 1,-2");
        let mut last = 0.0;
        let mut arcs = 0;
        for leg in &plan.legs {
            let curvature = match leg.geometry {
                Geometry::Line { .. } => 0.0,
                Geometry::Arc { radius, .. } => 1.0 / radius.0,
                Geometry::Turn { .. } => panic!("there is room everywhere: {plan:?}"),
            };
            arcs += usize::from(curvature != 0.0);
            let step: f64 = curvature - last;
            assert!(step.abs() <= params.curvature_step, "a step of {step}/m in {:?}", plan.legs);
            last = curvature;
        }
        assert!(arcs > 20, "{arcs} arcs");
        let end = end(&plan);
        assert!((end.x.0 - 1.0).hypot(end.y.0 + 2.0) < 1e-9, "ends at {end:?}");
    }

    #[test]
    fn many_small_steps_come_close_to_the_clothoid() {
        use axle_schema::{Curve, Metres, PerMetre, Pose};
        // From straight to a radius of 0.5 m within 1 m: it turns by 1 rad.
        let (start_curvature, end_curvature) = (PerMetre(0.0), PerMetre(2.0));
        let clothoid =
            Curve::Clothoid { start_curvature, end_curvature, length: Metres(1.0) }.navigator_span();
        let off = |steps: u32| {
            let mut pose = Pose::default();
            for step in 0..steps {
                let curvature = 2.0 * (f64::from(step) + 0.5) / f64::from(steps);
                let arc = Geometry::arc_by_distance(Metres(1.0 / curvature), Metres(1.0 / f64::from(steps)));
                pose = arc.expect("an arc").end_from(pose);
            }
            assert!((pose.heading.0 - 1.0).abs() < 1e-12, "the heading is exact: {pose:?}");
            (pose.x.0 - clothoid.x.0).hypot(pose.y.0 - clothoid.y.0)
        };
        // The error falls with the square of the number of steps.
        let (few, many) = (off(4), off(32));
        assert!(few < 0.011 && many < few / 60.0, "{few} and {many} m");
    }
}
