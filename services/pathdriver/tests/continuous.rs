//! The laws of the strategy "continuous", for jumps and for blends.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by a panic")]

use axle_pathdriver::{Body, Joints, Pathdriver, PathdriverParams, Strategy as Planned};
use axle_schema::contract::Functional as _;
use axle_schema::{
    Drive, DriveAsk, Drivetrain, Geometry, Leg, Manner, Message as _, Metres, MetresPerSecond,
    MetresPerSecondSquared, Pose, Radians, RadiansPerSecond, Seconds, Sides, Track,
};
use proptest::prelude::*;

fn any_geometry() -> impl Strategy<Value = Geometry> {
    prop_oneof![
        2 => (-0.2..2.0).prop_map(|length| Geometry::Line { length: Metres(length) }),
        1 => (-7.0..7.0).prop_map(|angle| Geometry::Turn { angle: Radians(angle) }),
        4 => (prop_oneof![0.0..2.0, -2.0..0.0], 0.0..2.0)
            .prop_map(|(radius, angle): (f64, f64)| Geometry::Arc {
                radius: Metres(radius),
                // Mostly forward, since a change of the direction rests.
                angle: Radians(angle.copysign(radius)),
            }),
        1 => (-2.0..2.0, -1.0..1.0)
            .prop_map(|(radius, angle)| Geometry::Arc { radius: Metres(radius), angle: Radians(angle) }),
    ]
}

prop_compose! {
    fn any_robot()(
        track in 0.05..1.0, wheel_speed in 0.1..2.0, acceleration in 0.2..5.0, speed in 0.1..2.0, turn_rate in 0.2..6.0,
    ) -> Drivetrain {
        Drivetrain {
            track: Track::new(Metres(track)).expect("a track"),
            wheel_speed: MetresPerSecond(wheel_speed),
            wheel_acceleration: MetresPerSecondSquared(acceleration),
            speed: MetresPerSecond(speed),
            turn_rate: RadiansPerSecond(turn_rate),
        }
    }
}

prop_compose! {
    fn any_body()(acceleration in 0.2..5.0, turn_acceleration in 1.0..20.0, lateral in 0.05..3.0) -> Body {
        Body {
            acceleration: MetresPerSecondSquared(acceleration),
            turn_acceleration,
            lateral: MetresPerSecondSquared(lateral),
        }
    }
}

/// Nothing within a movement is beyond a limit; checked at its ends and between.
fn check_limits(drive: &Drive, legs: &[Leg], params: &PathdriverParams) -> Result<(), TestCaseError> {
    let PathdriverParams { effort, body, robot, .. } = params;
    let (effort, track) = (*effort, robot.track.get());
    let slack = 1.0 + 1e-9;
    let owners = drive.counts.iter().enumerate().flat_map(|(leg, &n)| std::iter::repeat_n(leg, n as usize));
    let mut owners: Vec<usize> = owners.collect();
    owners.push(usize::MAX);
    for (dwm, owner) in drive.dwms.iter().zip(owners.windows(2)) {
        // A blend belongs to both of its legs; that it keeps the slower one's limit is asked of it.
        let asked =
            |owner: usize| legs.get(owner).and_then(|leg| leg.speed).map_or(f64::INFINITY, |speed| speed.0);
        let v_max = asked(owner[0]).min(robot.speed.0 * effort);
        // A phase of a nanosecond is short by some of its digits.
        let loose = 1.0 + 1e-6 + 1e-12 / dwm.duration().0;
        for a in dwm.accelerations().both() {
            prop_assert!(a.0.abs() <= robot.wheel_acceleration.0 * effort * loose, "{} in {:?}", a, dwm);
        }
        let both = dwm.accelerations();
        let (along, round) = ((both.left.0 + both.right.0) / 2.0, (both.right.0 - both.left.0) / track);
        prop_assert!(along.abs() <= body.acceleration.0 * effort * loose, "{} in {:?}", along, dwm);
        prop_assert!(round.abs() <= body.turn_acceleration * effort * loose, "{} in {:?}", round, dwm);
        for part in 0..=8 {
            let at = dwm.speeds_at(Seconds(dwm.duration().0 * f64::from(part) / 8.0));
            let (v, omega) = ((at.left.0 + at.right.0) / 2.0, (at.right.0 - at.left.0) / track);
            prop_assert!(at.left.0.abs().max(at.right.0.abs()) <= robot.wheel_speed.0 * effort * slack);
            prop_assert!(v.abs() <= v_max * slack, "{} of {} m/s in {:?}", v, v_max, dwm);
            prop_assert!(omega.abs() <= robot.turn_rate.0 * effort * slack);
            prop_assert!((v * omega).abs() <= body.lateral.0 * effort * slack, "{:?}", dwm);
        }
    }
    Ok(())
}

/// The largest jump of a wheel speed, the beginning from `first` and the end at rest included.
fn largest_jump(drive: &Drive, first: Sides<MetresPerSecond>) -> f64 {
    let mut last = first;
    let mut largest = 0.0_f64;
    for dwm in &drive.dwms {
        let jump = last.zip(dwm.start(), |before, after| (before - after).abs().0);
        largest = largest.max(jump.left).max(jump.right);
        last = dwm.end();
    }
    largest.max(last.left.0.abs()).max(last.right.0.abs())
}

fn end(drive: &Drive, track: Track) -> Pose {
    drive.dwms.iter().fold(Pose::default(), |pose, dwm| dwm.pose_at(pose, track, dwm.duration()))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn a_continuous_drive_keeps_its_limits_its_path_and_its_word_and_is_never_slower_than_stops(
        geometries in proptest::collection::vec(any_geometry(), 0..15),
        speeds in proptest::collection::vec(proptest::option::weighted(0.3, 0.01..2.0), 15),
        (robot, body, effort) in (any_robot(), any_body(), 0.05..1.0),
        (jump, offset) in (0.0..0.3, 0.0..0.01),
        blend in any::<bool>(),
    ) {
        let legs: Vec<Leg> = geometries
            .iter()
            .zip(&speeds)
            .map(|(&geometry, speed)| Leg { geometry, point: 0, speed: speed.map(MetresPerSecond) })
            .collect();
        let joints = if blend { Joints::Blend } else { Joints::Jump };
        let params = PathdriverParams { effort, body, robot, ..PathdriverParams::default() };
        let manner = Manner {
            strategy: Some(Planned::Continuous),
            joints: Some(joints),
            jump: Some(MetresPerSecond(jump)),
            offset: Some(Metres(offset)),
        };
        let stops = DriveAsk { legs: legs.clone(), ..DriveAsk::default() };
        let ask = DriveAsk { manner: Some(manner), ..stops.clone() };
        let drive = Pathdriver::answer(&params, &ask).expect("a plan that can be driven");
        prop_assert!(drive.check().is_ok());
        check_limits(&drive, &legs, &params)?;

        let largest = largest_jump(&drive, Sides::default());
        prop_assert!(largest <= if blend { 1e-9 } else { jump + 1e-9 }, "{} m/s", largest);
        prop_assert!((drive.jump.0 - largest).abs() <= 1e-9, "{} m/s, not {}", largest, drive.jump);

        let due = geometries.iter().fold(Pose::default(), |pose, geometry| geometry.end_from(pose));
        let end = end(&drive, robot.track);
        prop_assert!((end.heading.0 - due.heading.0).abs() < 1e-9);
        prop_assert_eq!(drive.offset.is_some(), blend && !geometries.is_empty() && !drive.dwms.is_empty());
        let aside = drive.offset.map_or(0.0, |offset| offset.0);
        prop_assert!(end.distance(due).0 <= aside + 1e-9, "{:?}, not {:?}", end, due);
        // Half of the legs' joints at most are blends that push the same way: the word is no empty one.
        prop_assert!(aside <= 1.1 * offset * geometries.len() as f64 + 1e-9, "{} m", aside);

        let rested = Pathdriver::answer(&params, &stops).expect("a plan that can be driven");
        let (fast, slow) = (drive.duration.0, rested.duration.0);
        prop_assert!(fast <= slow + 1e-9, "{} s, and {} s with stops", fast, slow);
    }

    #[test]
    fn a_drive_can_be_planned_anew_at_any_of_its_instants(
        geometries in proptest::collection::vec(any_geometry(), 1..8),
        robot in any_robot(),
        part in 0.0..1.0,
    ) {
        let manner = Some(Manner {
            strategy: Some(Planned::Continuous),
            jump: Some(MetresPerSecond(0.05)),
            ..Manner::default()
        });
        let params = PathdriverParams { robot, ..PathdriverParams::default() };
        let leg = |&geometry: &Geometry| Leg { geometry, point: 0, speed: None };
        let ask = DriveAsk { legs: geometries.iter().map(leg).collect(), manner, ..DriveAsk::default() };
        let drive = Pathdriver::answer(&params, &ask).expect("a plan that can be driven");
        prop_assume!(!drive.dwms.is_empty());
        // Where the robot is after a part of the movements, and what of the legs is left then.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of a list")]
        let index = (part * drive.dwms.len() as f64) as usize;
        let owner = drive
            .counts
            .iter()
            .scan(0, |sum, &count| { *sum += count as usize; Some(*sum) })
            .position(|sum| index < sum)
            .expect("every movement has a leg");
        let before: usize = drive.counts[..owner].iter().map(|&count| count as usize).sum();
        let share: f64 = {
            let whole = geometries[owner].wheel_distances(robot.track);
            let driven = drive.dwms[before..index].iter().fold(Sides::new(0.0, 0.0), |sum, dwm| {
                sum.zip(dwm.encoders_span().sides(), |sum, more| sum + more.0)
            });
            if whole.left.0.abs() > whole.right.0.abs() { driven.left / whole.left.0 } else { driven.right / whole.right.0 }
        };
        let left = match geometries[owner] {
            Geometry::Line { length } => Geometry::Line { length: length * (1.0 - share) },
            Geometry::Turn { angle } => Geometry::Turn { angle: angle * (1.0 - share) },
            Geometry::Arc { radius, angle } => Geometry::Arc { radius, angle: angle * (1.0 - share) },
        };
        let legs = std::iter::once(left).chain(geometries[owner + 1..].iter().copied());
        let speeds = drive.dwms[index].start();
        let anew = DriveAsk {
            legs: legs.map(|geometry| leg(&geometry)).collect(),
            speeds: Some(speeds),
            manner,
            ..DriveAsk::default()
        };
        let again = Pathdriver::answer(&params, &anew).expect("what is possible stays possible");
        let rest: f64 = drive.dwms[index..].iter().map(|dwm| dwm.duration().0).sum();
        prop_assert!((again.duration.0 - rest).abs() < 1e-6, "{} s, not {} s", again.duration, rest);
        prop_assert!(again.jump.0 <= 0.05 + 1e-9);
    }
}

#[test]
fn contradictory_and_absurd_wishes_are_refused_by_name() {
    let leg = Leg { geometry: Geometry::Line { length: Metres(1.0) }, point: 0, speed: None };
    let check = |manner: Manner, words: &str| {
        let ask = DriveAsk { legs: vec![leg], manner: Some(manner), ..DriveAsk::default() };
        let refusal = Pathdriver::answer(&PathdriverParams::default(), &ask).expect_err(words).to_string();
        assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
    };
    for jump in [-0.1, 1.5, f64::NAN, f64::INFINITY] {
        check(Manner { jump: Some(MetresPerSecond(jump)), ..Manner::default() }, "manner.jump");
    }
    for offset in [-0.1, 0.5, f64::NAN] {
        check(Manner { offset: Some(Metres(offset)), ..Manner::default() }, "manner.offset");
    }
    for text in ["[body]\nlateral = 0.0", "[body]\nacceleration = 1e9", "jump = 2.0", "offset = -1.0"] {
        let params: PathdriverParams = toml::from_str(text).expect("numbers");
        assert!(Pathdriver::answer(&params, &DriveAsk { legs: vec![leg], ..DriveAsk::default() }).is_err());
    }
}
