//! The vector field of the W-corrector beside a plan, for pictures.

use super::field::{self, Field};
use super::{FieldDriver, WParams};
use crate::follow::{Steering as _, Way};
use crate::path::{Limits, Path, Place};
use crate::route::{self, Part};
use axle_schema::contract::Bounds as _;
use axle_schema::refusal::within;
use axle_schema::{Metres, MetresPerSecond, Plan, Pose, Radians, Refusal, Twist};

/// The most arrows of one picture.
pub const MAX_ARROWS: usize = 1500;
/// So many rows of arrows stand on each side of the path.
const ROWS: i8 = 3;

/// With which velocity the field says to be at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrow {
    /// Where.
    pub x: Metres,
    /// Where.
    pub y: Metres,
    /// The direction of the field.
    pub heading: Radians,
    /// Its length.
    pub speed: MetresPerSecond,
}

/// The field in rows beside the paths of a plan, `spacing` apart, 0.01 to 10 m; wider where there would be too many.
///
/// # Errors
/// Refuses parameters, spacings and plans that are out of range, by name.
pub fn arrows(params: &WParams, plan: &Plan, spacing: Metres) -> Result<Vec<Arrow>, Refusal> {
    params.check()?;
    within("spacing of arrows in m", spacing.0, 0.01, 10.0)?;
    let driver = FieldDriver { params: params.clone() };
    let rules = params.rules(params.period);
    let limits = Limits { robot: rules.robot, effort: rules.effort, turn: driver.longest_turn() };
    let paths: Vec<Path> = route::parts(plan, &limits, rules.robot.wheel_acceleration.0)?
        .into_iter()
        .filter_map(|part| if let Part::Way(path) = part { Some(path) } else { None })
        .collect();
    let rows = f64::from(2 * ROWS + 1);
    let length: f64 = paths.iter().map(|path| path.length).sum();
    #[allow(clippy::cast_precision_loss, reason = "a small count")]
    let spacing = spacing.0.max(length * rows / (MAX_ARROWS as f64 / 2.0));
    let mut arrows = Vec::new();
    for path in &paths {
        for (index, piece) in path.pieces.iter().enumerate() {
            let mut s = spacing / 2.0;
            while s < piece.length && arrows.len() + 2 * usize::from(ROWS.unsigned_abs()) < MAX_ARROWS {
                for row in -ROWS..=ROWS {
                    let left = f64::from(row) * spacing;
                    let on = piece.at(s);
                    let pose = on.moved(Metres::ZERO, Metres(left), Radians::ZERO);
                    let place = Place { piece: index, s, left };
                    let braking = (2.0 * rules.deceleration() * path.left(place).max(0.0)).sqrt();
                    let speed = path.speed(place, rules.deceleration()).min(braking);
                    let way = Way { path, place, pose, speed, twist: Twist::default(), rules: &rules };
                    let flow = match params.field {
                        Field::Points => field::points::flow(params, &way),
                        Field::Path => field::path::flow(params, &way),
                    };
                    let Pose { x, y, .. } = pose;
                    arrows.push(Arrow { x, y, heading: Radians(flow.psi), speed: MetresPerSecond(flow.w) });
                }
                s += spacing;
            }
        }
    }
    Ok(arrows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Geometry, Leg};

    fn plan(geometries: &[Geometry]) -> Plan {
        let legs = geometries.iter().map(|&geometry| Leg { geometry, point: 0, speed: None }).collect();
        Plan { legs, ..Plan::default() }
    }

    #[test]
    fn the_field_leads_along_a_line_and_back_to_it() {
        let line = plan(&[Geometry::Line { length: Metres(2.0) }]);
        let arrows = arrows(&WParams::default(), &line, Metres(0.2)).expect("a field");
        assert_eq!(arrows.len(), 70);
        for arrow in arrows {
            // ψ = -atan(k·n): ahead on the line, to the right of who is left of it.
            let expected = -(WParams::default().pull.0 * arrow.y.0).atan();
            assert!((arrow.heading.0 - expected).abs() < 1e-12, "{arrow:?}");
            assert!(arrow.speed.0 > 0.0 && arrow.speed.0 <= 2.0);
        }
    }

    #[test]
    fn there_are_never_too_many_arrows() {
        let far = plan(&[Geometry::Line { length: Metres(1e5) }, Geometry::Turn { angle: Radians(1.0) }]);
        let count = arrows(&WParams::default(), &far, Metres(0.01)).expect("a field").len();
        assert!(count > 100 && count <= MAX_ARROWS, "{count}");
        assert!(arrows(&WParams::default(), &plan(&[]), Metres(0.1)).expect("no field").is_empty());
        assert!(arrows(&WParams::default(), &far, Metres(f64::NAN)).is_err());
    }

    #[test]
    fn a_field_of_points_leads_to_the_end_of_its_leg() {
        let params = WParams { field: Field::Points, ..WParams::default() };
        let line = plan(&[Geometry::Line { length: Metres(2.0) }]);
        for arrow in arrows(&params, &line, Metres(0.2)).expect("a field") {
            let expected = (-arrow.y.0).atan2(2.0 - arrow.x.0);
            assert!((arrow.heading.0 - expected).abs() < 1e-12, "{arrow:?}");
        }
    }
}
