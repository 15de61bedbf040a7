//! The motion between two readings: what wheels, gyro and accelerometer say of it, and how far each is believed.

use super::super::filter::{Filter, Motion, Noise, Push};
use super::super::means::Means;
use super::super::watch::Watch;
use super::Node;
use crate::params::NavigatorParams;
use axle_schema::EncodersData;
use axle_schema::series::Datum as _;

/// Without readings for so long, in s, nobody knows the way between them.
pub(super) const GAP: f64 = 1.0;
/// A sensor is believed against the wheels beyond this squared normalised difference: one in 10⁷ by chance.
pub(super) const SLIP: f64 = 28.0;
/// A robot of which no wheel ticks for so long, in s, stands.
const STANDS: f64 = 1.0;
/// How many times what the robot can a sensor may say.
const BELIEF: f64 = 1.5;

/// What the robot can do.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// The largest speed of a wheel, in m/s.
    wheel_speed: f64,
    /// The largest turn rate, in rad/s.
    turn_rate: f64,
    /// How much farther a wheel may seem to have come, in m.
    jump: f64,
}

impl Reach {
    pub(super) fn new(params: &NavigatorParams) -> Self {
        let wheel_speed = BELIEF * params.robot.wheel_speed.0;
        let turn_rate = 2.0 * wheel_speed / params.robot.track.get();
        Self { wheel_speed, turn_rate, jump: params.jump.0 }
    }

    /// Whether both wheels can have come that far.
    pub(super) fn believes(&self, from: &EncodersData, to: &EncodersData) -> bool {
        let span = from.span_to(to);
        let reach = self.wheel_speed * span.duration.0 + self.jump;
        span.left.0.abs() <= reach && span.right.0.abs() <= reach
    }
}

/// The gyro's and the accelerometer's readings.
#[derive(Clone, Debug, Default)]
pub(super) struct Inertia {
    pub(super) gyro: Means,
    pub(super) forward: Means,
}

impl Inertia {
    pub(super) fn clear(&mut self) {
        self.gyro.clear();
        self.forward.clear();
    }
    pub(super) fn forget(&mut self, stamp: f64) {
        self.gyro.forget(stamp);
        self.forward.forget(stamp);
    }
}

/// The motion of the span from `before` to `node`, and the gyro's angle, believed or not.
pub(super) fn motion(
    before: &Node,
    node: &Node,
    inertia: &Inertia,
    reach: &Reach,
    watch: &Watch,
) -> (Motion, Option<f64>) {
    let span = before.reading.span_to(&node.reading);
    let (from, to, dt) = (before.reading.stamp.0, node.reading.stamp.0, span.duration.0);
    let raw = inertia.gyro.between(from, to);
    let possible = raw.filter(|angle| angle.abs() <= reach.turn_rate * dt && watch.gyro_is_usable());
    let (left, right) = if node.anchor { (0.0, 0.0) } else { (span.left.0, span.right.0) };
    let somewhere = reach.wheel_speed * dt / 3.0;
    let way = f64::midpoint(left.abs(), right.abs());
    let middle = f64::midpoint(from, to);
    // Nobody knows the speed of a span that was not seen.
    let push = before.middle.filter(|_| !before.anchor && !node.anchor && dt <= GAP).and_then(|last| {
        let change = inertia.forward.between(last, middle)?;
        (change.abs() <= 2.0 * reach.wheel_speed).then_some(Push { change, over: middle - last })
    });
    let motion = Motion {
        dt,
        left,
        right,
        ticks: to - ticked(before, node) <= STANDS,
        gyro: possible,
        push,
        extra: node.slip + if node.anchor { somewhere * somewhere } else { 0.0 },
        along: 0.0,
        unseen: if dt > GAP { way * way / 4.0 } else { 0.0 },
    };
    (motion, raw.filter(|_| !node.anchor))
}

/// When a wheel ticked last, up to the stamp of `node`.
pub(super) fn ticked(before: &Node, node: &Node) -> f64 {
    let span = before.reading.span_to(&node.reading);
    let moves = span.left.0.abs().max(span.right.0.abs()) > 0.0;
    if moves { node.reading.stamp.0 } else { before.ticked }
}

/// For longer than this, in s, no speed is known by an accelerometer.
const SKID: f64 = 1.0;

/// Where the wheels and a gyro that has proved itself differ by more than noise, a wheel slips: its distance is then as
/// uncertain as the difference is large. A gyro that has not is left out of such a span. Where the accelerometer differs,
/// both wheels slip alike; after a while it is the accelerometer that cannot be right.
pub(super) fn sift(motion: &Motion, filter: &mut Filter, noise: &Noise, proved: bool) -> Motion {
    let mut sifted = *motion;
    if let Some(turn) = filter.doubt_turn(motion, noise).filter(|turn| turn.squared() > SLIP) {
        if proved {
            sifted.extra += (turn.nu * turn.nu - turn.s) * noise.track * noise.track / 2.0;
        } else {
            sifted.gyro = None;
        }
    }
    match filter.doubt_way(&sifted, noise).filter(|way| way.squared() > SLIP) {
        Some(way) if filter.skidded < SKID => {
            filter.skidded += motion.dt;
            sifted.along += (way.nu * way.nu - way.s) * motion.dt * motion.dt;
        }
        Some(_) => (sifted.push, filter.skidded) = (None, 0.0),
        None => filter.skidded = 0.0,
    }
    sifted
}
