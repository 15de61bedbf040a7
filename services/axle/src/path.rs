//! Paths as points, for drawing and for measuring how far from them a robot was.

use axle_schema::{Geometry, Metres, Plan, Pose, Radians};

/// Points of an arc are at most this far apart.
const SPACING: f64 = 0.02;

/// The path of the middle of the axle when a plan is driven exactly.
pub(crate) fn of_plan(plan: &Plan) -> Vec<(f64, f64)> {
    let mut pose = plan.start;
    let mut points = vec![(pose.x.0, pose.y.0)];
    for leg in &plan.legs {
        if let Geometry::Arc { radius, angle } = leg.geometry {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to 2 to 1000"
            )]
            let steps = ((radius.0 * angle.0).abs() / SPACING).clamp(2.0, 1000.0) as u32;
            for step in 1..steps {
                let share = f64::from(step) / f64::from(steps);
                let part = Geometry::Arc { radius, angle: angle * share };
                push(&mut points, part.end_from(pose));
            }
        }
        pose = leg.geometry.end_from(pose);
        push(&mut points, pose);
    }
    points
}

fn push(points: &mut Vec<(f64, f64)>, pose: Pose) {
    let point = (pose.x.0, pose.y.0);
    if points.last() != Some(&point) {
        points.push(point);
    }
}

/// The root of the mean square of the distances of `points` from the path, and the largest of them.
pub(crate) fn cross_track(path: &[(f64, f64)], points: &[(f64, f64)]) -> (Metres, Metres) {
    let (mut sum, mut largest) = (0.0, 0.0_f64);
    for &point in points {
        let distance = distance_to_path(path, point);
        sum += distance * distance;
        largest = largest.max(distance);
    }
    #[allow(clippy::cast_precision_loss, reason = "a count of points")]
    let count = points.len().max(1) as f64;
    (Metres((sum / count).sqrt()), Metres(largest))
}

fn distance_to_path(path: &[(f64, f64)], point: (f64, f64)) -> f64 {
    let first = path.first().map_or(f64::INFINITY, |first| (point.0 - first.0).hypot(point.1 - first.1));
    path.windows(2).map(|pair| distance_to_segment(pair[0], pair[1], point)).fold(first, f64::min)
}

fn distance_to_segment(from: (f64, f64), to: (f64, f64), point: (f64, f64)) -> f64 {
    let length = (to.0 - from.0).hypot(to.1 - from.1);
    let heading = (to.1 - from.1).atan2(to.0 - from.0);
    let basis = Pose { x: Metres(from.0), y: Metres(from.1), heading: Radians(heading) };
    let seen = Pose::new(point.0, point.1, heading).seen_from(basis);
    (seen.x.0 - seen.x.0.clamp(0.0, length)).hypot(seen.y.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::Leg;

    #[test]
    fn the_distance_from_a_path_is_that_of_its_nearest_point() {
        let path = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)];
        for (point, distance) in [((0.5, 0.1), 0.1), ((-0.3, 0.4), 0.5), ((1.2, 0.5), 0.2), ((1.0, 1.0), 0.0)]
        {
            assert!((distance_to_path(&path, point) - distance).abs() < 1e-12, "{point:?}");
        }
        let (rms, largest) = cross_track(&path, &[(0.5, 0.3), (0.5, -0.4)]);
        assert!((rms.0 - 0.125_f64.sqrt()).abs() < 1e-12 && (largest.0 - 0.4).abs() < 1e-12);
    }

    #[test]
    fn an_arc_is_drawn_round() {
        let geometry = Geometry::Arc { radius: Metres(1.0), angle: Radians(std::f64::consts::PI) };
        let plan = Plan { legs: vec![Leg { geometry, point: 0, speed: None }], ..Plan::default() };
        let points = of_plan(&plan);
        assert!(points.len() > 100);
        assert!(points.iter().all(|point| (point.0.hypot(point.1 - 1.0) - 1.0).abs() < 1e-12));
    }
}
