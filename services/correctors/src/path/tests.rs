//! Paths: places on lines and circles, and speeds at joints.

use super::*;
use axle_schema::{Metres, MetresPerSecond};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

const LIMITS: fn() -> Limits = || Limits { robot: Drivetrain::default(), effort: 1.0, turn: f64::INFINITY };

fn leg(geometry: Geometry) -> Leg {
    Leg { geometry, point: 0, speed: None }
}
fn line(length: f64) -> Leg {
    leg(Geometry::Line { length: Metres(length) })
}
fn arc(radius: f64, angle: f64) -> Leg {
    leg(Geometry::Arc { radius: Metres(radius), angle: Radians(angle) })
}
fn path(legs: &[Leg], limits: &Limits) -> Path {
    let mut at = Pose::default();
    let mut path: Option<Path> = None;
    for leg in legs {
        match &mut path {
            None => path = Path::begin(at, leg, limits),
            Some(path) => assert!(path.extend(at, leg, limits), "{leg:?} goes on"),
        }
        at = leg.geometry.end_from(at);
    }
    path.expect("a path")
}

#[test]
fn a_place_on_lines_and_arcs_is_the_nearest_point() {
    // 1 m straight, a quarter to the left on 0.5 m, 1 m straight: it ends at (1.5, 1.5).
    let path = path(&[line(1.0), arc(0.5, FRAC_PI_2), line(1.0)], &LIMITS());
    let table = [
        ((0.3, 0.1), 0, 0.3, 0.1),
        ((-0.2, 0.0), 0, 0.0, 0.0),
        ((1.0 + 0.4 * 0.5_f64.sin(), 0.5 - 0.4 * 0.5_f64.cos()), 1, 0.25, 0.1),
        ((1.6, 0.7), 2, 0.2, -0.1),
        ((1.5, 1.9), 2, 1.4, 0.0),
    ];
    for ((x, y), piece, s, left) in table {
        let place = path.place(Pose::new(x, y, 0.0), Place::default(), 0.0);
        assert_eq!(place.piece, piece, "at ({x}, {y}): {place:?}");
        assert!((place.s - s).abs() < 1e-12 && (place.left - left).abs() < 1e-12, "at ({x}, {y}): {place:?}");
    }
    let goal = path.goal();
    assert!((goal.x.0 - 1.5).abs() < 1e-12 && (goal.y.0 - 1.5).abs() < 1e-12);
    assert!((path.length - 2.0 - FRAC_PI_2 / 2.0).abs() < 1e-12);
}

#[test]
fn a_circle_of_two_rounds_is_followed_round_by_round() {
    let path = path(&[arc(-0.5, -2.0 * TAU)], &LIMITS());
    let mut place = Place::default();
    for n in 0..=200 {
        let s = path.length * f64::from(n) / 200.0;
        place = path.place(path.pieces[0].at(s), place, 0.0);
        assert!((place.s - s).abs() < 1e-9 && place.left.abs() < 1e-9, "at {s} m: {place:?}");
    }
}

#[test]
fn backward_is_forward_the_other_way_round() {
    // Backward along a circle with its centre on the left: in the direction of travel it is on the right.
    let path = path(&[arc(0.5, -FRAC_PI_2)], &LIMITS());
    assert!(!path.forward && path.pieces[0].curvature < 0.0);
    let goal = travel(path.goal(), false);
    let end = arc(0.5, -FRAC_PI_2).geometry.end_from(Pose::default());
    assert!(goal.distance(end).0 < 1e-12 && (goal.heading - end.heading).wrapped().0.abs() < 1e-12);
    assert!(!path.forward && Path::begin(Pose::default(), &line(0.0), &LIMITS()).is_none());
}

#[test]
fn long_arcs_are_divided_where_that_is_asked_for() {
    let limits = Limits { turn: FRAC_PI_2, ..LIMITS() };
    let path = path(&[arc(0.5, TAU), line(1.0)], &limits);
    assert_eq!(path.pieces.len(), 5);
    let (start, end) = path.ends(Place { piece: 1, ..Place::default() });
    assert!((start.x.0 - 0.5).abs() < 1e-12 && (start.y.0 - 0.5).abs() < 1e-12, "{start:?}");
    assert!(end.x.0.abs() < 1e-12 && (end.y.0 - 1.0).abs() < 1e-12 && (end.heading.0 - PI).abs() < 1e-12);
}

#[test]
fn a_joint_is_passed_as_slowly_as_the_jump_of_the_wheels_asks_for() {
    let mut path = path(&[line(1.0), arc(0.5, PI)], &LIMITS());
    path.limit(&LIMITS(), 0.09);
    // 2·0.09 / (0.3·2) = 0.3 m/s at the joint; before it what brakes at 1.5 m/s², at most 0.6 m/s.
    let at = |piece, s| path.speed(Place { piece, s, left: 0.0 }, 1.5);
    assert!((at(0, 1.0) - 0.3).abs() < 1e-12 && (at(0, 0.99) - (0.09_f64 + 0.03).sqrt()).abs() < 1e-12);
    assert!((at(0, 0.0) - 0.6).abs() < 1e-12 && (at(1, 0.0) - 0.6).abs() < 1e-12);
    let slow = Leg { speed: Some(MetresPerSecond(0.1)), ..line(1.0) };
    let path = tests::path(&[slow], &LIMITS());
    assert!((path.speed(Place::default(), 1.5) - 0.1).abs() < 1e-12, "a leg may be slower");
}
