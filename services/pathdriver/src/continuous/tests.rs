//! Joints one by one, moving starts, and the fastest drive against all others of a grid.

use super::*;
use axle_schema::{Drivetrain, Geometry, Leg, MetresPerSecondSquared, RadiansPerSecond};

fn limits() -> Limits {
    Limits::of_wheels(Drivetrain {
        wheel_speed: MetresPerSecond(1.0),
        wheel_acceleration: MetresPerSecondSquared(1.5),
        speed: MetresPerSecond(0.8),
        turn_rate: RadiansPerSecond(2.0),
        ..Drivetrain::default()
    })
}
fn line(length: f64) -> Geometry {
    Geometry::Line { length: Metres(length) }
}
fn turn(angle: f64) -> Geometry {
    Geometry::Turn { angle: Radians(angle) }
}
fn arc(radius: f64, angle: f64) -> Geometry {
    Geometry::Arc { radius: Metres(radius), angle: Radians(angle) }
}
fn ask(geometries: &[Geometry]) -> DriveAsk {
    let legs = geometries.iter().map(|&geometry| Leg { geometry, point: 0, speed: None }).collect();
    DriveAsk { legs, ..DriveAsk::default() }
}
fn moving(geometries: &[Geometry], left: f64, right: f64) -> DriveAsk {
    let speeds = Some(Sides::new(MetresPerSecond(left), MetresPerSecond(right)));
    DriveAsk { speeds, ..ask(geometries) }
}
const fn allowed(jump: f64) -> Allowed {
    Allowed { jump, offset: Metres(0.001) }
}
fn jumped(jump: f64, ask: &DriveAsk) -> Drive {
    drive(&limits(), Joints::Jump, allowed(jump), ask).expect("a drive")
}
fn blended(ask: &DriveAsk) -> Drive {
    drive(&limits(), Joints::Blend, Allowed { jump: 0.0, offset: Metres(0.001) }, ask).expect("a drive")
}
/// The speed of the middle of the axle after the movements of the first leg.
fn after_first(drive: &Drive) -> f64 {
    let end = drive.dwms[drive.counts[0] as usize - 1].end();
    f64::midpoint(end.left.0, end.right.0)
}

#[test]
fn legs_of_one_curvature_meet_for_nothing() {
    for legs in [vec![line(0.5); 4], vec![arc(0.5, 0.6); 3], vec![turn(1.0); 2], vec![line(-0.3); 2]] {
        let parts = jumped(0.0, &ask(&legs));
        let whole = match legs[0] {
            Geometry::Line { length } => line(length.0 * legs.len() as f64),
            Geometry::Turn { angle } => turn(angle.0 * legs.len() as f64),
            Geometry::Arc { radius, angle } => arc(radius.0, angle.0 * legs.len() as f64),
        };
        let once = jumped(0.0, &ask(&[whole]));
        assert!((parts.duration - once.duration).0.abs() < 1e-9, "{legs:?}: {parts:?}");
        assert!(parts.jump.0 <= 0.0 && once.jump.0 <= 0.0);
    }
}

#[test]
fn a_joint_is_as_fast_as_its_jump_allows_and_rests_where_none_is_possible() {
    let check = |legs: &[Geometry], jump: f64, v: f64| {
        let drive = jumped(jump, &ask(legs));
        assert!((after_first(&drive) - v).abs() < 1e-12, "{legs:?}, {jump} m/s: {}", after_first(&drive));
        assert!(drive.jump.0 <= jump + 1e-12, "{:?}", drive.jump);
    };
    // v = 2j / (Δ·Δκ).
    check(&[line(1.0), arc(0.5, 1.5), line(1.0)], 0.15, 0.5);
    check(&[line(1.0), arc(0.5, 1.5), line(1.0)], 0.0, 0.0);
    check(&[arc(0.5, 1.0), arc(-0.5, -1.0)], 0.06, 0.1);
    check(&[line(-1.0), arc(0.5, -1.5)], 0.15, -0.5);
    // The joint would allow 1 m/s; the circle allows the wheels 1 m/s, hence the middle of the axle 0.769 m/s.
    check(&[line(2.0), arc(0.5, 1.5)], 0.3, 1.0 / 1.3);
    for legs in
        [[line(1.0), turn(1.0)], [turn(1.0), line(1.0)], [line(1.0), line(-1.0)], [turn(1.0), turn(-1.0)]]
    {
        check(&legs, 1.0, 0.0);
    }
    // The last leg is too short to brake from more: v² = 2·1.5/1.3·0.05.
    check(&[line(1.0), arc(0.5, 0.1)], 1.0, (2.0 * 1.5 / 1.3 * 0.05_f64).sqrt());
}

#[test]
fn the_blend_of_the_model_is_the_clothoid_of_the_model() {
    // model.md 4.4, P3: v 0.5, Δκ 2, a 1.5, Δ 0.3: τ 0.1 s, ℓ 0.05 m, 2.083e-4 m to both sides.
    let mut slow = ask(&[line(1.0), arc(0.5, 1.5)]);
    slow.legs.iter_mut().for_each(|leg| leg.speed = Some(MetresPerSecond(0.5)));
    let drive = blended(&slow);
    let blend = drive.dwms[drive.counts[0] as usize - 1];
    assert!((blend.duration().0 - 0.1).abs() < 1e-12, "{blend:?}");
    assert!(
        (blend.start().left.0 - 0.5).abs() < 1e-15 && (blend.end().right.0 - 0.65).abs() < 1e-12,
        "{blend:?}"
    );
    assert_eq!(drive.jump, MetresPerSecond::ZERO);
    let offset = drive.offset.expect("blends say what they cost").0;
    assert!((offset - 2.083e-4).abs() < 1e-6, "{offset}");
    // Against the path that was really driven.
    let track = limits().robot.track;
    let end = drive.dwms.iter().fold(Pose::default(), |pose, dwm| dwm.pose_at(pose, track, dwm.duration()));
    let due = slow.legs.iter().fold(Pose::default(), |pose, leg| leg.geometry.end_from(pose));
    assert!((end.distance(due).0 - offset).abs() < 1e-12, "{end:?}, not {due:?}, {offset} m away");
}

#[test]
fn a_moving_robot_goes_on_with_the_least_jump() {
    let check = |ask: &DriveAsk, jump: f64, start: (f64, f64)| {
        let drive = jumped(jump, ask);
        let got = drive.dwms[0].start();
        assert!((got.left.0 - start.0).abs() < 1e-12 && (got.right.0 - start.1).abs() < 1e-12, "{got:?}");
        let travelled: f64 = drive.dwms.iter().map(|dwm| dwm.encoders_span().left.0).sum();
        let due: f64 =
            ask.legs.iter().map(|leg| leg.geometry.wheel_distances(limits().robot.track).left.0).sum();
        assert!((travelled - due).abs() < 1e-12 && drive.jump.0 <= jump + 1e-12, "{drive:?}");
    };
    check(&moving(&[line(1.0)], 0.3, 0.3), 0.0, (0.3, 0.3));
    check(&moving(&[line(1.0)], 0.32, 0.28), 0.05, (0.3, 0.3));
    check(&moving(&[line(-1.0), arc(1.0, -0.5)], -0.4, -0.4), 0.1, (-0.4, -0.4));
    check(&moving(&[arc(0.5, 1.0), line(1.0)], 0.35, 0.65), 0.06, (0.35, 0.65));
    // 0.06 m are too short to brake from 0.45 m/s, but not from what a jump of 0.05 m/s leaves.
    check(&moving(&[line(0.06)], 0.45, 0.45), 0.05, (0.18_f64.sqrt(), 0.18_f64.sqrt()));
}

#[test]
fn a_moving_robot_that_cannot_go_on_is_refused_with_the_reason() {
    let check = |ask: &DriveAsk, words: &str| {
        for joints in [Joints::Jump, Joints::Blend] {
            let refusal = drive(&limits(), joints, allowed(0.05), ask).expect_err(words).to_string();
            assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
        }
    };
    check(&moving(&[line(1.0)], 0.4, 0.2), "in the ratio 1.000000 to 1.000000");
    check(&moving(&[line(-1.0)], 0.3, 0.3), "forward along it");
    check(&moving(&[line(1.0)], 0.9, 0.9), "at most at 0.800 m/s");
    check(&moving(&[line(0.02), line(0.02)], 0.5, 0.5), "cannot brake in time");
    check(&moving(&[line(0.02), turn(1.0)], 0.5, 0.5), "more than 0.245 m/s");
    check(&moving(&[line(0.0)], 0.5, 0.5), "no leg to brake on");
}

/// The time of a drive whose middle of the axle has the speeds `v` at its inner joints; none where a leg is too short.
fn time(courses: &[Course], v: &[f64]) -> Option<f64> {
    let mut sum = 0.0;
    for (index, course) in courses.iter().enumerate() {
        let at = |joint: usize| match joint {
            0 => 0.0,
            _ => v.get(joint - 1).map_or(0.0, |v| v / course.kv.abs()),
        };
        let (u0, u1) = (at(index), at(index + 1));
        let possible = (u1 * u1 - u0 * u0).abs() <= 2.0 * course.a * course.s && u0.max(u1) <= course.u_max;
        if !possible {
            return None;
        }
        sum += course.movements(u0, u1).expect("finite").iter().map(|dwm| dwm.duration().0).sum::<f64>();
    }
    Some(sum)
}

#[test]
fn no_other_speeds_at_the_joints_are_faster() {
    let cases: [&[Geometry]; 5] = [
        &[line(1.0), arc(0.5, 1.5), line(0.5)],
        &[line(0.05), arc(1.0, 0.05), line(2.0)],
        &[arc(0.4, 1.0), arc(-0.4, -0.2), arc(0.8, 0.05)],
        &[line(0.3), arc(0.2, 0.3), line(0.02), arc(-2.0, -0.5)],
        &[line(-0.02), arc(0.6, -0.9), line(-0.4)],
    ];
    let jump = 0.1;
    for geometries in cases {
        let ask = ask(geometries);
        let got = jumped(jump, &ask).duration.0;
        let courses: Vec<Course> =
            ask.legs.iter().map(|leg| Course::of(leg, &limits()).expect("it moves")).collect();
        let caps: Vec<f64> = courses
            .windows(2)
            .map(|pair| joint(&pair[0], &pair[1], &limits(), Joints::Jump, allowed(jump)).cap.sqrt())
            .collect();
        // Every combination of 60 speeds at every joint.
        let parts = 60_usize;
        let mut best = f64::INFINITY;
        for number in 0..parts.pow(u32::try_from(caps.len()).expect("few")) {
            let mut rest = number;
            let v: Vec<f64> = caps
                .iter()
                .map(|cap| {
                    let part = rest % parts;
                    rest /= parts;
                    cap * (part + 1) as f64 / parts as f64
                })
                .collect();
            best = best.min(time(&courses, &v).unwrap_or(f64::INFINITY));
        }
        assert!(got <= best + 1e-9, "{geometries:?}: {got} s, but {best} s is possible");
        assert!(got >= best - 0.1, "{geometries:?}: {got} s is much faster than the grid's {best} s");
    }
}

#[test]
fn a_drive_with_too_many_movements_is_refused_by_name() {
    let legs: Vec<Geometry> =
        (0..axle_schema::plan::MAX_LEGS).map(|n| arc(if n % 2 == 0 { 1.0 } else { 2.0 }, 1.0)).collect();
    // So slow a blend makes every leg speed up, cruise and brake between two of them: four movements.
    let tiny = Allowed { jump: 0.0, offset: Metres(1e-9) };
    let refusal = drive(&limits(), Joints::Blend, tiny, &ask(&legs)).expect_err("49151 movements");
    let words = refusal.to_string();
    assert!(words.contains("49151, at most 36864") && words.contains("fewer legs"), "{words}");
}
