//! The pursuit-corrector, beat by beat; whole courses are in tests/closed_loop.rs.

use super::*;
use crate::path::{Limits, Path, Place};
use axle_schema::{Geometry, Leg, MetresPerSecond, Pose, RadiansPerSecond, Twist};

/// What the rule says to a robot at `pose` on this geometry, at 0.4 m/s.
fn steer(geometry: Geometry, pose: Pose) -> Aim {
    let params = PursuitParams { lookahead: Seconds(0.5), nearest: Metres(0.12), ..PursuitParams::default() };
    let limits = Limits { robot: params.robot, effort: 1.0, turn: f64::INFINITY };
    let leg = Leg { geometry, point: 0, speed: None };
    let path = Path::begin(Pose::default(), &leg, &limits).expect("a path");
    let place = path.place(pose, Place::default(), 0.0);
    let twist = Twist { v: MetresPerSecond(0.4), omega: RadiansPerSecond(0.0) };
    let rules = params.rules(params.period);
    let way = Way { path: &path, place, pose, speed: 0.4, twist, rules: &rules };
    Pursuit { params: params.clone(), rotates: false }.steer(&way)
}

#[test]
fn the_parameter_file_holds_the_defaults() {
    let read: PursuitParams = toml::from_str(PursuitParams::FILE).expect("the file is valid");
    assert_eq!(read, PursuitParams::default());
    let written = toml::Table::try_from(PursuitParams::default()).expect("parameters are a table");
    let table: toml::Table = toml::from_str(PursuitParams::FILE).expect("the file is a table");
    assert_eq!(table, written, "the file lists every field");
    assert!(toml::from_str::<PursuitParams>("lokahead = 1").is_err(), "a misspelt field is refused");
}

#[test]
fn on_a_circle_the_robot_keeps_its_curvature_and_beside_a_line_it_drives_the_arc_to_the_point() {
    let circle = Geometry::Arc { radius: Metres(-0.5), angle: Radians(-3.0) };
    let aim = steer(circle, Pose::default());
    assert!((aim.v - 0.4).abs() < 1e-12 && (aim.omega + 0.8).abs() < 1e-9, "{aim:?}");
    // 0.5 s at 0.4 m/s are 0.2 m ahead; the point is 5 cm to the left: κ = 2·0.05/(0.2² + 0.05²).
    let line = Geometry::Line { length: Metres(2.0) };
    let aim = steer(line, Pose::new(1.0, -0.05, 0.0));
    assert!((aim.omega / aim.v - 0.1 / 0.0425).abs() < 1e-9, "{aim:?}");
    let narrow = steer(Geometry::Arc { radius: Metres(0.15), angle: Radians(1.0) }, Pose::default());
    assert!(narrow.v < 0.4 * 0.8, "slower on narrow arcs: {narrow:?}");
}

#[test]
fn a_point_far_to_the_side_is_turned_to_on_the_spot() {
    let aim = steer(Geometry::Line { length: Metres(2.0) }, Pose::new(1.0, 0.0, 2.0));
    assert!(aim.v.abs() < 1e-12 && aim.omega < -1.0, "{aim:?}");
}
