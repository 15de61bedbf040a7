//! The G-corrector in its parts; whole courses are in tests/closed_loop.

use super::*;
use axle_schema::{Geometry, InertialData, Radians, RadiansPerSecond};

fn plan(geometries: &[Geometry]) -> Plan {
    let legs =
        geometries.iter().map(|&geometry| axle_schema::Leg { geometry, point: 0, speed: None }).collect();
    Plan { legs, ..Plan::default() }
}
const ARC: Geometry = Geometry::Arc { radius: Metres(0.5), angle: Radians(1.0) };
const LINE: Geometry = Geometry::Line { length: Metres(1.0) };

#[test]
fn the_parameter_file_holds_the_defaults() {
    let read: GParams = toml::from_str(GParams::FILE).expect("the file is valid");
    assert_eq!(read, GParams::default());
    let written = toml::Table::try_from(GParams::default()).expect("parameters are a table");
    let table: toml::Table = toml::from_str(GParams::FILE).expect("the file is a table");
    assert_eq!(table, written, "the file lists every field");
    for integral in [0.0, -3.0, f64::NAN] {
        let ratio = Ratio { integral, ..Ratio::default() };
        let wrong = GParams { ratio, ..GParams::default() };
        assert!(wrong.check().expect_err("the ratio would not hold").to_string().contains("ratio.integral"));
    }
}

#[test]
fn the_faster_wheel_leads_and_the_other_keeps_its_ratio() {
    // Wheels on 0.35 m and 0.65 m: the right one leads, over 0.65 m.
    let legs = leg::legs(&plan(&[LINE, ARC]), &Drivetrain::default(), 1.0);
    assert_eq!(legs.len(), 2);
    let at = Sides::new(1.1, 1.26);
    assert!((legs[1].s - 0.65).abs() < 1e-12 && (legs[1].covered(at) - 0.26).abs() < 1e-12);
    assert!((legs[1].error(at) - 0.04).abs() < 1e-12, "0.14 m on the left would be right");
    let speeds = legs[1].speeds(0.65, 0.02);
    assert!((speeds.right - 0.65).abs() < 1e-12 && (speeds.left - 0.37).abs() < 1e-12, "{speeds:?}");
    let turned = legs[1].with_turn(at, 0.3 * 0.3);
    assert!(
        (turned.left - 1.17).abs() < 1e-12,
        "turned by 0.3 rad, it would have covered 9 cm less than the right one"
    );
    assert_eq!(leg::legs(&plan(&[LINE, LINE]), &Drivetrain::default(), 1.0).len(), 1, "one line of 2 m");
}

#[test]
fn an_empty_plan_is_done_and_a_plan_from_elsewhere_is_refused() {
    let encoders = Some(EncodersData::default());
    let seen = Seen { encoders, pose: Some(axle_schema::NavigatorData::default()), ..Seen::default() };
    let begin = |plan| {
        GCorrector::begin(
            &GParams::default(),
            Seconds(0.05),
            Task { id: axle_schema::TaskId(1), plan },
            &seen,
        )
    };
    assert_eq!(begin(Plan::default()).expect("nothing to drive").step(&seen), Step::Done);
    let far = Plan { start: axle_schema::Pose::new(0.5, 0.0, 0.0), ..plan(&[LINE]) };
    assert!(begin(far).expect_err("half a metre").to_string().contains("from the start of its plan"));
}

#[test]
fn the_bias_of_the_gyroscope_is_learnt_at_rest_and_taken_off() {
    let seen = |n: i32, gyro: f64| {
        let (at, gyro) = (Seconds(f64::from(n) * 0.05), RadiansPerSecond(gyro));
        Seen {
            at,
            inertial: Some(InertialData { stamp: at, gyro, ..InertialData::default() }),
            ..Seen::default()
        }
    };
    let watch = Watch::default();
    let mut turned =
        Turned::new(&seen(0, 0.1), watch, Drivetrain::default(), Seconds(0.5)).expect("it speaks");
    for n in 1..=10 {
        turned.hear(&seen(n, 0.1)).expect("at rest");
    }
    assert!(!turned.is_ready(Seconds(0.49)) && turned.is_ready(Seconds(0.5)));
    for n in 11..=30 {
        turned.hear(&seen(n, if n == 11 { 0.6 } else { 1.1 })).expect("turning");
    }
    // 0.025·0.5 + 0.05·0.75 for speeding up, and 18 beats of 0.05 at 1 rad/s.
    let angle = turned.angle(Seconds(1.5));
    assert!((angle - (0.0125 + 0.0375 + 0.9)).abs() < 1e-9, "{angle}");
    assert!((turned.angle(Seconds(1.52)) - angle - 0.02).abs() < 1e-9, "and a bit later");
    for broken in [f64::NAN, 1e9] {
        assert!(turned.hear(&seen(31, broken)).is_ok(), "one of them is passed over");
    }
    assert!((turned.angle(Seconds(1.5)) - angle).abs() < 1e-9);
}
