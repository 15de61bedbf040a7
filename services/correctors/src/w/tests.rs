//! The W-corrector in its parts; whole courses are in tests/closed_loop.

use super::*;
use crate::path::{Limits, Path, Place};
use axle_schema::{Geometry, Leg, Pose, Twist};

fn path(geometry: Geometry) -> Path {
    let limits = Limits { robot: Drivetrain::default(), effort: 1.0, turn: f64::INFINITY };
    let leg = Leg { geometry, point: 0, speed: None };
    Path::begin(Pose::default(), &leg, &limits).expect("a path")
}

/// What `look` sees of a robot at `pose` that moves like `twist`.
fn at<T>(geometry: Geometry, pose: Pose, twist: Twist, look: impl Fn(&Way<'_>) -> T) -> T {
    let (path, params) = (path(geometry), WParams { effort: 1.0, ..WParams::default() });
    let rules = params.rules(params.period);
    let place = path.place(pose, Place::default(), 0.0);
    look(&Way { path: &path, place, pose, speed: 0.6, twist, rules: &rules })
}

const LINE: Geometry = Geometry::Line { length: Metres(2.0) };
const REST: Twist = Twist { v: MetresPerSecond(0.0), omega: RadiansPerSecond(0.0) };

#[test]
fn the_parameter_file_holds_the_defaults() {
    let read: WParams = toml::from_str(WParams::FILE).expect("the file is valid");
    assert_eq!(read, WParams::default());
    let written = toml::Table::try_from(WParams::default()).expect("parameters are a table");
    let table: toml::Table = toml::from_str(WParams::FILE).expect("the file is a table");
    assert_eq!(table, written, "the file lists every field");
    let wrong = WParams { factor: 1.0, ..WParams::default() };
    assert!(wrong.check().expect_err("nothing would ever change").to_string().contains("factor"));
}

#[test]
fn the_field_of_points_leads_to_the_point_and_is_slow_at_both_ends() {
    let flow =
        |x, y| at(LINE, Pose::new(x, y, 0.0), REST, |way| field::points::flow(&WParams::default(), way));
    // The wheels brake at 1.5 m/s²: √(2·1.5·0.04) is 0.346 m/s.
    let table = [
        ((0.0, 0.0), 0.1),
        ((0.04, 0.0), 0.12_f64.sqrt()),
        ((1.0, 0.0), 0.6),
        ((1.96, 0.0), 0.12_f64.sqrt()),
    ];
    for ((x, y), w) in table {
        let flow = flow(x, y);
        assert!((flow.w - w).abs() < 1e-9 && flow.psi.abs() < 1e-12, "at {x}: {flow:?}");
    }
    assert!((flow(1.0, -1.0).psi - FRAC_PI_2 / 2.0).abs() < 1e-12, "towards, not away");
}

#[test]
fn the_field_of_a_path_leads_back_to_it_and_along_it() {
    let params = WParams { pull: PerMetre(5.0), ..WParams::default() };
    let flow =
        |geometry, x, y| at(geometry, Pose::new(x, y, 0.0), REST, |way| field::path::flow(&params, way));
    assert!(flow(LINE, 1.0, 0.0).psi.abs() < 1e-12);
    assert!((flow(LINE, 1.0, 0.2).psi + FRAC_PI_2 / 2.0).abs() < 1e-12, "5 1/m: 45 degrees at 0.2 m");
    let arc = Geometry::Arc { radius: Metres(0.5), angle: Radians(3.0) };
    let on = flow(arc, 0.5, 0.5);
    assert!((on.psi - FRAC_PI_2).abs() < 1e-12 && (on.bend - 2.0).abs() < 1e-12, "{on:?}");
}

#[test]
fn the_paper_s_driver_leaves_rest_multiplies_and_steps() {
    let drive = |pose, twist| {
        at(LINE, pose, twist, |way| {
            let params = WParams::default();
            Multiplicative::of(&params, Seconds(0.05)).drive(field::path::flow(&params, way), way)
        })
    };
    let straight = Pose::new(1.0, 0.0, 0.0);
    assert!((drive(straight, REST).v - 0.1).abs() < 1e-12, "the floor");
    let slow = Twist { v: MetresPerSecond(0.2), ..REST };
    assert!((drive(straight, slow).v - 0.26).abs() < 1e-12, "1.3 times");
    let fast = Twist { v: MetresPerSecond(1.3), ..REST };
    assert!((drive(straight, fast).v - 1.0).abs() < 1e-12, "divided by 1.3");
    let aside = drive(Pose::new(1.0, 0.0, -0.4), slow);
    assert!((aside.omega - 0.3).abs() < 1e-12, "a step to the left");
    let turning = Twist { omega: RadiansPerSecond(1.5), ..slow };
    let aside = drive(Pose::new(1.0, 0.0, -0.4), turning);
    assert!((aside.omega - 1.2).abs() < 1e-12, "it turns enough already");
}

#[test]
fn the_smooth_driver_turns_before_it_drives() {
    let drive = |heading| {
        at(LINE, Pose::new(1.0, 0.0, heading), REST, |way| {
            driver::smooth::drive(4.0, field::path::flow(&WParams::default(), way), way)
        })
    };
    let away = drive(3.0);
    assert!(away.v.abs() < 1e-12 && (away.omega + 2.0).abs() < 1e-12, "the largest turn rate: {away:?}");
    let aside = drive(0.1);
    assert!((aside.v - 0.6 * 0.1_f64.cos()).abs() < 1e-12 && (aside.omega + 0.4).abs() < 1e-12);
}
