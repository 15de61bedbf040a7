//! The strategy "continuous": on from leg to leg, as fast as the limits allow (model.md 4.4, P2 and P3).
//!
//! Bounded acceleration needs continuous wheel speeds, which legs of different curvature cannot have where they meet.
//! So a joint has a price, and the speed there is as high as the price allows:
//!
//! * *jump* (P2): the middle of the axle goes on at its speed v, each wheel jumps by v·|Δκ|·Δ/2, at most by `jump`;
//! * *blend* (P3): half of a clothoid of length ℓ = v²·|Δκ|·m is taken from either leg. There the wheels change their
//!   speeds as fast as they may; nothing jumps, the heading is kept, and the rest of the path moves aside by
//!   |Δκ|·ℓ²/24, at most by `offset`.
//!
//! Where the direction changes, before and after a turn on the spot, and at the end, the robot rests. Legs of the same
//! curvature meet for nothing.
//!
//! Symbols: u the speed of the leading wheel of a leg, x the speed that both legs of a joint know (of the middle of the
//! axle, or of the leading wheel between equal legs), X = x², Δκ the difference of the curvatures, Δ the track. A
//! backward pass lowers X until every leg is long enough to brake, a forward pass until it is long enough to speed up;
//! then each leg is driven as fast as its ends allow. With jumps that is the fastest drive along the path, since every
//! X is the largest that any drive could have there.

use crate::leg::{Course, LEAST_PHASE};
use crate::limits::{Allowed, Limits};
use crate::stop::{SAME_SPEED, check_duration, given, unreachable};
use axle_schema::motion::chord;
use axle_schema::plan::MAX_DWMS;
use axle_schema::{
    Drive, DriveAsk, Dwm, Joints, Metres, MetresPerSecond, Pose, Radians, Refusal, Seconds, Sides, Track,
};

/// Ratios of wheels that differ by less than this are the same: no wheel jumps by a nanometre per second.
const SAME_RATIO: f64 = 1e-12;
/// A leg whose middle moves less than this for a leading wheel at 1 is a turn on the spot.
const SPOT: f64 = 1e-9;

/// Where two legs meet, where the drive begins, or where it ends.
#[derive(Clone, Copy, Debug, Default)]
struct Joint {
    /// The largest X, m²/s².
    cap: f64,
    /// u of the leg before and of the leg behind for x = 1; 0 where the robot rests.
    before: f64,
    behind: f64,
    /// Half the length of the blend for X = 1, of the middle of the axle, s²/m; 0 without a blend.
    half: f64,
    /// X, m²/s².
    x2: f64,
}

/// A leg that moves, its number from 0, and its course.
type Part = (usize, Course);

/// The movements for the legs of `ask` within `limits`.
pub(crate) fn drive(
    limits: &Limits,
    joints: Joints,
    allowed: Allowed,
    ask: &DriveAsk,
) -> Result<Drive, Refusal> {
    let parts: Vec<Part> = ask
        .legs
        .iter()
        .enumerate()
        .filter_map(|(number, leg)| Some((number, Course::of(leg, limits)?)))
        .collect();
    let beginning = given(ask.speeds)?;
    let Some((_, first)) = parts.first() else {
        let empty = Drive { counts: vec![0; ask.legs.len()], ..Drive::default() };
        return beginning.map_or(Ok(empty), |speeds| Err(unreachable(speeds, "there is no leg to brake on")));
    };
    let mut route = vec![Joint::default()];
    if let Some(speeds) = beginning {
        route[0] = Joint { cap: first.u_max * first.u_max, behind: 1.0, ..Joint::default() };
        range(first, speeds, allowed.jump)?;
    }
    route.extend(parts.windows(2).map(|pair| joint(&pair[0].1, &pair[1].1, limits, joints, allowed)));
    route.push(Joint::default());

    backward(&parts, &mut route);
    if let Some(speeds) = beginning {
        route[0].x2 = begin(first, speeds, allowed.jump, route[0].x2)?.powi(2);
    }
    forward(&parts, &mut route);
    let mut drive = movements(&parts, &route, limits.robot.track, beginning)?;
    drive.offset = drive.offset.filter(|_| joints == Joints::Blend);
    drive.counts.resize(ask.legs.len(), 0);
    Ok(drive)
}

/// What two legs allow where they meet.
fn joint(from: &Course, to: &Course, limits: &Limits, joints: Joints, allowed: Allowed) -> Joint {
    let off = from.k.zip(to.k, |from, to| (from - to).abs());
    if off.left.max(off.right) <= SAME_RATIO {
        let u = from.u_max.min(to.u_max);
        return Joint { cap: u * u, before: 1.0, behind: 1.0, ..Joint::default() };
    }
    if from.kv.abs() < SPOT || to.kv.abs() < SPOT || from.kv * to.kv < 0.0 {
        return Joint::default();
    }
    let bend = (from.k_omega / from.kv - to.k_omega / to.kv).abs();
    let (before, behind) = (1.0 / from.kv.abs(), 1.0 / to.kv.abs());
    let fastest = (from.u_max / before).min(to.u_max / behind);
    let free = fastest * fastest;
    match joints {
        Joints::Jump => {
            let v = 2.0 * allowed.jump / (limits.robot.track.get() * bend);
            Joint { cap: free.min(v * v), before, behind, half: 0.0, x2: 0.0 }
        }
        Joints::Blend => {
            // ℓ = v²·|Δκ|·m: neither a wheel nor the turn rate changes faster than it may.
            let m = (limits.robot.track.get() / (2.0 * limits.robot.wheel_acceleration.0))
                .max(1.0 / limits.turn_acceleration);
            let half = bend * m / 2.0;
            // |Δκ|·ℓ²/24 ≤ offset, and a leg gives at most half of itself to each of its two joints.
            let aside = (24.0 * allowed.offset.0 / bend).sqrt() / (2.0 * half);
            let room = (from.s / (2.0 * before)).min(to.s / (2.0 * behind)) / half;
            Joint { cap: free.min(aside).min(room), before, behind, half, x2: 0.0 }
        }
    }
}

/// X at every joint from the last to the first: as large as the braking distances allow.
///
/// A leg of length s without its parts of two blends must brake from u0 to u1: u0² - u1² ≤ 2a(s - h0 - h1), and
/// all four are proportional to the X of their joints.
fn backward(parts: &[Part], route: &mut [Joint]) {
    for (index, (_, course)) in parts.iter().enumerate().rev() {
        let (start, end) = (route[index], route[index + 1]);
        let two_a = 2.0 * course.a;
        let room = two_a * course.s + end.x2 * end.before * (end.before - two_a * end.half);
        let cost = start.behind * (start.behind + two_a * start.half);
        route[index].x2 = if cost > 0.0 { start.cap.min(room / cost).max(0.0) } else { 0.0 };
    }
}

/// The same from the first to the last, for speeding up.
fn forward(parts: &[Part], route: &mut [Joint]) {
    for (index, (_, course)) in parts.iter().enumerate() {
        let (start, end) = (route[index], route[index + 1]);
        let two_a = 2.0 * course.a;
        let room = two_a * course.s + start.x2 * start.behind * (start.behind - two_a * start.half);
        let cost = end.before * (end.before + two_a * end.half);
        if cost > 0.0 {
            route[index + 1].x2 = end.x2.min(room / cost).max(0.0);
        }
    }
}

/// The speeds of the leading wheel of the first leg that wheels at `speeds` reach by a jump of at most `jump`.
fn range(course: &Course, speeds: Sides<MetresPerSecond>, jump: f64) -> Result<(f64, f64), Refusal> {
    let jump = jump.max(SAME_SPEED);
    let (mut low, mut high) = (0.0_f64, f64::INFINITY);
    for (speed, k) in [(speeds.left.0, course.k.left), (speeds.right.0, course.k.right)] {
        if k.abs() > SPOT {
            let (a, b) = ((speed - jump) / k, (speed + jump) / k);
            (low, high) = (low.max(a.min(b)), high.min(a.max(b)));
        } else if speed.abs() > jump {
            high = -1.0;
        }
    }
    if high > 0.0 && low <= high {
        return Ok((low, high));
    }
    let Sides { left, right } = course.k;
    let why = format!(
        "the first leg needs them in the ratio {left:.6} to {right:.6}, forward along it, and {jump:.3} m/s is \
         the most that a wheel may jump"
    );
    Err(unreachable(speeds, &why))
}

/// The speed of the leading wheel with which a moving robot goes over to the first leg; `most` is the largest X.
fn begin(course: &Course, speeds: Sides<MetresPerSecond>, jump: f64, most: f64) -> Result<f64, Refusal> {
    let (low, high) = range(course, speeds, jump)?;
    let most = most.sqrt();
    if low > most {
        let limit = if most < course.u_max {
            format!("from more than {most:.3} m/s of its faster wheel the robot cannot brake in time")
        } else {
            format!("the faster wheel may run at most at {:.3} m/s on the first leg", course.u_max)
        };
        return Err(unreachable(speeds, &limit));
    }
    // The nearest speeds in the ratio of the leg: nothing jumps that need not.
    let Sides { left, right } = course.k;
    let u = (speeds.left.0 * left + speeds.right.0 * right) / (left * left + right * right);
    Ok(u.max(low).min(high.min(most)))
}

/// The movements along the legs, with the given X at their joints.
fn movements(
    parts: &[Part],
    route: &[Joint],
    track: Track,
    beginning: Option<Sides<MetresPerSecond>>,
) -> Result<Drive, Refusal> {
    let legs = parts.last().map_or(0, |(number, _)| number + 1);
    let mut drive = Drive { counts: vec![0; legs], ..Drive::default() };
    drive.dwms.reserve(3 * parts.len());
    let mut last = beginning.unwrap_or_default();
    let mut aside = Aside { track, at: Pose::default(), farthest: 0.0 };
    for (index, (number, course)) in parts.iter().enumerate() {
        let (start, end) = (route[index], route[index + 1]);
        let (x0, x1) = (start.x2.sqrt(), end.x2.sqrt());
        let straight = course.without(start.half * start.x2 * start.behind, end.half * end.x2 * end.before);
        let before = drive.dwms.len();
        drive.dwms.extend(straight.movements(x0 * start.behind, x1 * end.before)?);
        aside.turn(course);
        if let (Some((_, next)), true) = (parts.get(index + 1), end.half > 0.0) {
            // The blend counts for the leg before it. τ = ℓ / v.
            let duration = Seconds(2.0 * end.half * x1);
            let (from, to) = (course.speeds(x1 * end.before), next.speeds(x1 * end.behind));
            if duration.0 > LEAST_PHASE {
                let blend = Dwm::new(from, to, duration)?;
                aside.take(course, next, end.half * end.x2, &blend);
                drive.dwms.push(blend);
            }
        }
        for dwm in &drive.dwms[before..] {
            check_duration(number + 1, dwm)?;
            let jump = last.zip(dwm.start(), |from, to| (to - from).abs());
            // Rounding is no jump.
            drive.jump = [jump.left, jump.right]
                .into_iter()
                .filter(|jump| jump.0 > 1e-12)
                .fold(drive.jump, MetresPerSecond::max);
            last = dwm.end();
        }
        #[allow(clippy::cast_possible_truncation, reason = "a leg has at most four movements")]
        let count = (drive.dwms.len() - before) as u32;
        drive.counts[*number] = count;
    }
    if drive.dwms.len() > MAX_DWMS {
        let what = "movements of a drive (a blend adds one at every joint; give fewer legs)".into();
        return Err(Refusal::TooLarge { what, got: drive.dwms.len() as u64, limit: MAX_DWMS as u64 });
    }
    drive.offset = Some(Metres(aside.farthest));
    drive.duration = drive.dwms.iter().map(Dwm::duration).sum();
    Ok(drive)
}

/// How far blends have moved the path aside of the plan's own.
struct Aside {
    track: Track,
    /// The displacement so far, and the planned heading.
    at: Pose,
    /// The largest displacement, m.
    farthest: f64,
}

impl Aside {
    /// The plan has been followed to the end of a leg.
    fn turn(&mut self, course: &Course) {
        self.at.heading += Radians(course.k_omega * course.s);
    }

    /// A blend instead of the last and the first `half` (of the middle of the axle, m) of two legs that meet here.
    fn take(&mut self, from: &Course, to: &Course, half: f64, blend: &Dwm) {
        let half = half * from.kv.signum();
        let [first, second] = [from, to].map(|course| half * course.k_omega / course.kv);
        let begin = Pose { heading: self.at.heading - Radians(first), ..self.at };
        let moved = |pose: Pose, angle: f64| {
            let (x, y) = chord(half, angle);
            pose.moved(Metres(x), Metres(y), Radians(angle))
        };
        let planned = moved(moved(begin, first), second);
        let span = blend.navigator_span(self.track);
        let driven = begin.moved(span.x, span.y, span.heading);
        self.at.x += driven.x - planned.x;
        self.at.y += driven.y - planned.y;
        self.farthest = self.farthest.max(self.at.x.0.hypot(self.at.y.0));
    }
}

#[cfg(test)]
mod tests;
