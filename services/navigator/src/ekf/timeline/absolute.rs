//! Fixes and ranges at their own time: how the filter in `map` travels by them.

use super::super::filter::{Filter, Motion, Noise};
use super::span::sift;
use axle_schema::Numbers;
use std::collections::VecDeque;

/// A measurement against the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::ekf) enum What {
    Fix { z: [f64; 2], r: Numbers<4>, heading: Option<(f64, f64)> },
    Range { point: [f64; 2], distance: f64, variance: f64 },
}

/// What became of it.
#[derive(Clone, Copy, Debug)]
pub(in crate::ekf) struct Verdict {
    pub(in crate::ekf) squared: f64,
    pub(in crate::ekf) degrees: usize,
    pub(in crate::ekf) believed: bool,
}

/// A fix or a range at its own time.
#[derive(Clone, Copy, Debug)]
pub(in crate::ekf) struct Absolute {
    pub(in crate::ekf) stamp: f64,
    pub(in crate::ekf) what: What,
    pub(in crate::ekf) verdict: Option<Verdict>,
    pub(in crate::ekf) settled: bool,
}

/// What is believed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trust {
    /// The largest squared normalised innovation of a fix.
    pub(super) gate: f64,
    /// From how many standard deviations on a range counts as if it were so far off.
    pub(super) elbow: f64,
    /// Whether the gyro may be believed against the wheels.
    pub(super) proved: bool,
}

/// Moves along a span, and stops on the way for each fix and range of it.
pub(super) fn travel(
    map: &mut Filter,
    motion: &Motion,
    from: f64,
    absolutes: &mut VecDeque<Absolute>,
    noise: &Noise,
    trust: Trust,
) {
    let to = from + motion.dt;
    let mut now = from;
    // What the accelerometer says is about the whole span, and counts where it begins.
    let mut push = motion.push;
    loop {
        let first = absolutes.partition_point(|absolute| absolute.stamp <= now);
        let stop = absolutes.get(first).map(|absolute| absolute.stamp).filter(|&stamp| stamp < to);
        let next = stop.unwrap_or(to);
        let share = (next - now) / motion.dt;
        let part = Motion {
            dt: next - now,
            left: motion.left * share,
            right: motion.right * share,
            gyro: motion.gyro.map(|angle| angle * share),
            push: push.take(),
            extra: motion.extra * share,
            along: motion.along * share,
            unseen: motion.unseen * share,
            ..*motion
        };
        let part = sift(&part, map, noise, trust.proved);
        let _ = map.predict(&part, noise);
        apply(absolutes, map, now, next, trust);
        now = next;
        if stop.is_none() {
            return;
        }
    }
}

/// Applies the fixes and ranges after `from` and up to `to`.
pub(super) fn apply(absolutes: &mut VecDeque<Absolute>, map: &mut Filter, from: f64, to: f64, trust: Trust) {
    let first = absolutes.partition_point(|absolute| absolute.stamp <= from);
    for absolute in absolutes.iter_mut().skip(first).take_while(|absolute| absolute.stamp <= to) {
        judge(absolute, map, trust);
    }
}

pub(super) fn judge(absolute: &mut Absolute, map: &mut Filter, trust: Trust) {
    let Trust { gate, elbow, .. } = trust;
    let (squared, degrees, gate) = match absolute.what {
        What::Fix { z, r, heading } => {
            let squared = map.fix(z, &r, [0.0, 0.0], gate);
            if let (Some((angle, variance)), true) = (heading, squared <= gate) {
                let _ = map.heading(angle, variance, gate);
            }
            (squared, 2, gate)
        }
        What::Range { point, distance, variance } => {
            // The same chance of one in a thousand with one degree of freedom as with two.
            let gate = gate * (10.8 / 13.8);
            (map.range(point, distance, variance, gate, elbow), 1, gate)
        }
    };
    absolute.verdict.get_or_insert(Verdict { squared, degrees, believed: squared <= gate });
}
