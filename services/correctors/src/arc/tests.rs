//! The arc-corrector, beat by beat; whole courses are in tests/closed_loop.

use super::*;
use axle_schema::{Pose, motion};

#[test]
fn the_parameter_file_holds_the_defaults() {
    let read: ArcParams = toml::from_str(ArcParams::FILE).expect("the file is valid");
    assert_eq!(read, ArcParams::default());
    let written = toml::Table::try_from(ArcParams::default()).expect("parameters are a table");
    let table: toml::Table = toml::from_str(ArcParams::FILE).expect("the file is a table");
    assert_eq!(table, written, "the file lists every field");
    for sharpening in [0.0, -9.0, f64::NAN] {
        let wrong = ArcParams { sharpening, ..ArcParams::default() };
        assert!(wrong.check().expect_err("no such power").to_string().contains("sharpening"));
    }
}

#[test]
fn the_arc_of_twice_the_angle_ends_at_the_target_with_the_hump_of_the_model() {
    for beta in [-1.5_f64, -0.3, 0.1, 0.7, 1.2] {
        let (d, kappa) = (2.0, 2.0 * beta.sin() / 2.0);
        let (x, y) = motion::chord(2.0 * beta / kappa, 2.0 * beta);
        assert!((x - d * beta.cos()).abs() < 1e-12 && (y - d * beta.sin()).abs() < 1e-12, "at {beta}");
        // The farthest point from the chord is half-way.
        let (x, y) = motion::chord(beta / kappa, beta);
        let middle = Pose::new(x, y, 0.0).seen_from(Pose::new(0.0, 0.0, beta));
        let hump = d / 2.0 * (beta / 2.0).tan();
        assert!((middle.y.0 + hump).abs() < 1e-12, "at {beta}: {} for {hump}", middle.y.0);
    }
}

#[test]
fn sharpening_raises_the_ratio_of_the_wheels_and_keeps_the_outer_one() {
    // Wheels at 0.85 and 1.15 for a curvature of 1 1/m: the outer one keeps 1.15.
    let (share, kappa) = sharpened(1.0, 0.3, 1.0);
    assert!((share - 1.0).abs() < 1e-12 && (kappa - 1.0).abs() < 1e-12, "1 is the arc itself");
    let (share, kappa) = sharpened(-1.0, 0.3, 9.0);
    let (outer, inner) = (share * (1.0 - kappa * 0.15), share * (1.0 + kappa * 0.15));
    assert!((outer - 1.15).abs() < 1e-12, "{outer}");
    assert!((inner / outer - (0.85_f64 / 1.15).powi(9)).abs() < 1e-12, "{inner}");
    let (share, kappa) = sharpened(10.0, 0.3, 3.0);
    assert!(share * (1.0 - kappa * 0.15) < 0.0, "on a narrow arc the inner wheel runs backward");
    let (share, kappa) = sharpened(1e9, 0.3, 1.0);
    assert!(share.is_finite() && kappa.is_finite());
}
