//! The strategy "stop": rest after every leg (model.md 4.4, P1).
//!
//! Bounded acceleration needs continuous wheel speeds, and legs of different curvature can only meet at rest. So this
//! is the one strategy that needs no excuse: no jump, and the path is the plan's own.

use crate::leg::Course;
use crate::limits::Limits;
use axle_schema::dwm::MAX_DURATION;
use axle_schema::{Drive, DriveAsk, Dwm, MetresPerSecond, Refusal, Seconds, Sides};

/// Speeds at the beginning that differ by less than this, in m/s, from what the first leg needs are taken for it.
pub(crate) const SAME_SPEED: f64 = 1e-6;

/// The movements for the legs of `ask` within `limits`.
pub(crate) fn drive(limits: &Limits, ask: &DriveAsk) -> Result<Drive, Refusal> {
    let mut drive = Drive { counts: Vec::with_capacity(ask.legs.len()), ..Drive::default() };
    let mut beginning = given(ask.speeds)?;
    for (index, leg) in ask.legs.iter().enumerate() {
        let movements = match Course::of(leg, limits) {
            Some(course) => {
                let u0 = beginning.take().map_or(Ok(0.0), |speeds| first_speed(&course, speeds))?;
                course.movements(u0, 0.0)?
            }
            None => Vec::new(),
        };
        movements.iter().try_for_each(|dwm| check_duration(index + 1, dwm))?;
        #[allow(clippy::cast_possible_truncation, reason = "a leg has at most three movements")]
        drive.counts.push(movements.len() as u32);
        drive.dwms.extend(movements);
    }
    if let Some(speeds) = beginning {
        return Err(unreachable(speeds, "there is no leg to brake on"));
    }
    drive.duration = drive.dwms.iter().map(Dwm::duration).sum();
    Ok(drive)
}

/// The speeds at the beginning; none when the robot stands.
pub(crate) fn given(
    speeds: Option<Sides<MetresPerSecond>>,
) -> Result<Option<Sides<MetresPerSecond>>, Refusal> {
    let Some(speeds) = speeds else { return Ok(None) };
    for (side, speed) in [("left", speeds.left), ("right", speeds.right)] {
        let limit = axle_schema::dwm::MAX_WHEEL_SPEED;
        axle_schema::refusal::within(
            &format!("{side} wheel speed at the beginning in m/s"),
            speed.0,
            -limit,
            limit,
        )?;
    }
    let stands = speeds.both().iter().all(|speed| speed.0.abs() <= SAME_SPEED);
    Ok((!stands).then_some(speeds))
}

/// The speed of the leading wheel at the beginning of the first leg, when the wheels run at `speeds`.
fn first_speed(course: &Course, speeds: Sides<MetresPerSecond>) -> Result<f64, Refusal> {
    let Sides { left, right } = course.k;
    // The nearest speeds in the ratio of the leg; the square of k is at least 1, since the leading wheel has 1.
    let u0 = (speeds.left.0 * left + speeds.right.0 * right) / (left * left + right * right);
    let [off_left, off_right] = speeds.zip(course.speeds(u0), |is, needed| (is - needed).abs().0).both();
    if !(u0 > 0.0 && off_left <= SAME_SPEED && off_right <= SAME_SPEED) {
        let ratio =
            format!("the first leg needs them in the ratio {left:.6} to {right:.6}, forward along it");
        return Err(unreachable(speeds, &ratio));
    }
    if u0 > course.u_max + SAME_SPEED {
        let limit = format!("the faster wheel may run at most at {:.3} m/s on the first leg", course.u_max);
        return Err(unreachable(speeds, &limit));
    }
    let needed = u0 * u0 / (2.0 * course.a);
    if needed > course.s {
        let short = format!("braking takes {needed:.3} m and the first leg has {:.3} m", course.s);
        return Err(unreachable(speeds, &short));
    }
    Ok(u0.min(course.u_max))
}

pub(crate) fn unreachable(speeds: Sides<MetresPerSecond>, why: &str) -> Refusal {
    let Sides { left, right } = speeds;
    let why = format!("the wheels run at {left} and {right} at the beginning, but {why}; stop first");
    Refusal::Unreachable { why }
}

/// A movement longer than the longest that a [`Dwm`] may describe is refused here, not by its receiver.
pub(crate) fn check_duration(number: usize, dwm: &Dwm) -> Result<(), Refusal> {
    if dwm.duration().0 <= MAX_DURATION {
        return Ok(());
    }
    let what = format!("duration of leg {number}");
    let limit = format!("at most {} per movement; put way points on the way", Seconds(MAX_DURATION));
    Err(Refusal::out_of_range(what, dwm.duration(), limit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Drivetrain, Geometry, Leg, Metres, Radians};

    fn robot() -> Limits {
        Limits::of_wheels(Drivetrain::default())
    }

    fn line(length: f64) -> Leg {
        Leg { geometry: Geometry::Line { length: Metres(length) }, point: 0, speed: None }
    }
    fn ask(legs: Vec<Leg>, left: f64, right: f64) -> DriveAsk {
        let speeds = Some(Sides::new(MetresPerSecond(left), MetresPerSecond(right)));
        DriveAsk { legs, speeds, robot: None, manner: None }
    }

    #[test]
    fn nothing_to_drive_is_an_empty_drive() {
        let empty = drive(&robot(), &DriveAsk::default()).expect("no legs are no fault");
        assert_eq!(empty, Drive::default());
        let none = drive(&robot(), &ask(vec![line(0.0)], 0.0, 0.0)).expect("no length is no fault");
        assert_eq!((none.dwms.len(), none.counts.as_slice()), (0, [0].as_slice()));
    }

    #[test]
    fn a_moving_robot_goes_on_along_the_first_leg() {
        let drive = drive(&robot(), &ask(vec![line(1.0)], 0.3, 0.3)).expect("the same ratio");
        assert!((drive.dwms[0].start().left.0 - 0.3).abs() < 1e-12);
        let distance: f64 = drive.dwms.iter().map(|dwm| dwm.encoders_span().left.0).sum();
        assert!((distance - 1.0).abs() < 1e-12, "drives {distance} m");
        assert_eq!(drive.dwms[drive.dwms.len() - 1].end(), Sides::default());
    }

    #[test]
    fn a_robot_that_moves_otherwise_than_the_first_leg_is_refused_with_the_reason() {
        let check = |legs: Vec<Leg>, left, right, words: &str| {
            let refusal = drive(&robot(), &ask(legs, left, right)).expect_err(words).to_string();
            assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
        };
        check(vec![line(1.0)], 0.3, 0.2, "in the ratio 1.000000 to 1.000000");
        check(vec![line(-1.0)], 0.3, 0.3, "forward along it");
        check(vec![line(1.0)], 0.7, 0.7, "at most at 0.600 m/s");
        check(vec![line(0.02)], 0.3, 0.3, "braking takes 0.030 m and the first leg has 0.020 m");
        check(vec![], 0.3, 0.3, "no leg to brake on");
        let turn = Leg { geometry: Geometry::Turn { angle: Radians(1.0) }, ..line(0.0) };
        check(vec![turn, line(1.0)], 0.3, 0.3, "in the ratio -1.000000 to 1.000000");
    }

    #[test]
    fn the_speed_of_a_leg_limits_the_middle_of_the_axle() {
        let slow = Leg { speed: Some(MetresPerSecond(0.1)), ..line(1.0) };
        let drive = drive(&robot(), &DriveAsk { legs: vec![slow], ..DriveAsk::default() });
        let peak = drive.expect("a slow line").dwms.iter().map(|dwm| dwm.peak_speed().0).fold(0.0, f64::max);
        assert!((peak - 0.1).abs() < 1e-12, "peaks at {peak} m/s");
    }

    #[test]
    fn a_leg_of_hours_is_refused_with_its_number() {
        let refusal = drive(&robot(), &DriveAsk { legs: vec![line(1.0), line(1e5)], ..DriveAsk::default() });
        let words = refusal.expect_err("100 km").to_string();
        assert!(words.contains("duration of leg 2") && words.contains("way points"), "{words}");
    }
}
