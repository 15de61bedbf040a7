//! The memory of the filter: what was measured in the last seconds, with the states of every instant.
//!
//! Bounded in time by `ekf.window` and in number; a measurement that is older than the memory is refused.

use super::filter::{Filter, Innovation, Motion, Noise};
use super::gyro::Gyro;
use super::watch::{Seen, Watch};
use crate::event::Event;
use crate::measurement::Counts;
use crate::params::NavigatorParams;
use axle_schema::series::Datum as _;
use axle_schema::{EncodersData, InertialData, Numbers, Pose};
use nalgebra::Matrix3;
use std::collections::VecDeque;

/// The most nodes, and the most fixes and ranges, that are remembered.
const MOST: usize = 4096;
/// Without readings for so long, in s, nobody knows the way between them.
const GAP: f64 = 1.0;
/// The gyro is believed against the wheels beyond this squared normalised difference: one in 10⁷ by chance.
const SLIP: f64 = 28.0;
/// How many times what the robot can a gyro may say.
const BELIEF: f64 = 1.5;

/// An instant of the past.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) reading: EncodersData,
    /// Whether motion counts from here, and the span before it says nothing.
    anchor: bool,
    pub(super) odom: Filter,
    pub(super) map: Filter,
    /// Speed in m/s and turn rate in rad/s of the span before it.
    pub(super) rates: Option<[f64; 2]>,
    /// Whether the watch has seen the span before it.
    looked: bool,
    /// Whether its pose in `map` was set, so that what came before tells nothing of it.
    placed: bool,
    /// What a slip adds to the variance of each wheel's distance, in m².
    slip: f64,
}

/// A measurement against the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum What {
    Fix { z: [f64; 2], r: Numbers<4>, heading: Option<(f64, f64)> },
    Range { point: [f64; 2], distance: f64, variance: f64 },
}

/// What became of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Verdict {
    pub(super) squared: f64,
    pub(super) degrees: usize,
    pub(super) believed: bool,
}

/// A fix or a range at its own time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Absolute {
    pub(super) stamp: f64,
    pub(super) what: What,
    pub(super) verdict: Option<Verdict>,
    pub(super) settled: bool,
}

/// The last seconds.
#[derive(Clone, Debug)]
pub(super) struct Timeline {
    /// Before the first reading.
    start: (Filter, Filter),
    nodes: VecDeque<Node>,
    absolutes: VecDeque<Absolute>,
    gyro: Gyro,
    noise: Noise,
    gate: f64,
    window: f64,
    wheel_speed: f64,
    turn_rate: f64,
    jump: f64,
    /// Whether nothing has been forgotten yet: then what came before the first reading counts at it.
    young: bool,
    pub(super) noticed: Vec<Event>,
}

impl Timeline {
    pub(super) fn new(odom: Filter, map: Filter, noise: Noise, params: &NavigatorParams) -> Self {
        let gate = if params.ekf.gate > 0.0 { params.ekf.gate } else { f64::INFINITY };
        let wheel_speed = BELIEF * params.robot.wheel_speed.0;
        Self {
            start: (odom, map),
            nodes: VecDeque::new(),
            absolutes: VecDeque::new(),
            gyro: Gyro::default(),
            noise,
            gate,
            window: params.ekf.window.0,
            wheel_speed,
            turn_rate: 2.0 * wheel_speed / params.robot.track.get(),
            jump: params.jump.0,
            young: true,
            noticed: Vec::new(),
        }
    }

    pub(super) fn restart(&mut self, datum: &EncodersData) {
        if let Some(node) = self.nodes.pop_back() {
            self.start = (node.odom, node.map);
        }
        self.nodes.clear();
        self.absolutes.clear();
        self.gyro.clear();
        self.young = true;
        self.begin(datum);
    }

    fn begin(&mut self, datum: &EncodersData) {
        let (odom, map) = self.start.clone();
        self.nodes.push_back(Node {
            reading: *datum,
            anchor: true,
            odom,
            map,
            rates: None,
            looked: true,
            placed: false,
            slip: 0.0,
        });
        let stamp = datum.stamp.0;
        if let (Some(node), true) = (self.nodes.back_mut(), self.young) {
            apply(&mut self.absolutes, &mut node.map, f64::NEG_INFINITY, stamp, self.gate);
        }
    }

    /// Puts a reading in its place; false if it has none.
    pub(super) fn encoders(&mut self, datum: &EncodersData, watch: &mut Watch, counts: &mut Counts) -> bool {
        let stamp = datum.stamp.0;
        let at = self.nodes.partition_point(|node| node.reading.stamp.0 < stamp);
        if at == 0 {
            if self.nodes.is_empty() {
                self.begin(datum);
                return true;
            }
            return false;
        }
        if self.nodes.get(at).is_some_and(|node| node.reading.stamp.0 <= stamp) {
            return false;
        }
        let before = &self.nodes[at - 1];
        let anchor = !self.believes(&before.reading, datum);
        if let Some(after) = self.nodes.get(at) {
            // A late reading is taken for what it tells of the way; one that contradicts its neighbours tells nothing.
            if anchor || !self.believes(datum, &after.reading) {
                counts.jumps += 1;
                return false;
            }
            counts.late += 1;
        }
        counts.jumps += u64::from(anchor);
        let node = Node {
            reading: *datum,
            anchor,
            odom: before.odom.clone(),
            map: before.map.clone(),
            rates: None,
            looked: false,
            placed: false,
            slip: 0.0,
        };
        self.nodes.insert(at, node);
        self.replay(at, true, watch);
        self.forget();
        true
    }

    pub(super) fn inertial(&mut self, data: &InertialData, watch: &mut Watch, counts: &mut Counts) -> bool {
        let newest = self.newest_stamp();
        if data.stamp.0 < newest - self.window {
            return false;
        }
        let Some(from) = self.gyro.insert(data.stamp.0, data.gyro.0) else { return false };
        let at = self.nodes.partition_point(|node| node.reading.stamp.0 <= from).max(1);
        if at < self.nodes.len() {
            counts.late += u64::from(data.stamp.0 < newest);
            self.replay(at, true, watch);
        }
        true
    }

    /// Puts a fix or a range in its place; false if that is forgotten.
    pub(super) fn absolute(&mut self, absolute: Absolute, watch: &mut Watch, counts: &mut Counts) -> bool {
        let stamp = absolute.stamp;
        let first = self.nodes.front().map(|node| node.reading.stamp.0);
        if first.is_some_and(|first| stamp < first && !(self.young && stamp >= first - self.window)) {
            return false;
        }
        // Source repeats what is recent: the same measurement counts once.
        #[allow(clippy::float_cmp, reason = "a repetition has the very same numbers")]
        if self.absolutes.iter().any(|other| other.stamp == stamp && other.what == absolute.what) {
            return false;
        }
        if self.absolutes.len() == MOST {
            let _ = self.absolutes.pop_front();
        }
        let at = self.absolutes.partition_point(|other| other.stamp <= stamp);
        self.absolutes.insert(at, absolute);
        let newest = self.newest_stamp();
        if self.nodes.is_empty() || stamp > newest {
            return true;
        }
        counts.late += u64::from(stamp < newest);
        let at = self.nodes.partition_point(|node| node.reading.stamp.0 < stamp);
        if at == 0 || stamp >= newest {
            // At the very instant of a node nothing before it changes.
            let last = at.min(self.nodes.len() - 1);
            self.apply_at(last, stamp);
            self.replay(last + 1, false, watch);
        } else {
            self.replay(at, false, watch);
        }
        true
    }

    fn apply_at(&mut self, index: usize, stamp: f64) {
        let node = &mut self.nodes[index];
        let gate = self.gate;
        for absolute in self.absolutes.iter_mut().filter(|a| a.stamp <= stamp && a.verdict.is_none()) {
            judge(absolute, &mut node.map, gate);
        }
    }

    /// Reckons the nodes from `first` on again; `odom` only where the motion itself may be another.
    fn replay(&mut self, first: usize, moved: bool, watch: &mut Watch) {
        for index in first.max(1)..self.nodes.len() {
            let (mut motion, raw) = self.motion(index, watch);
            let (odom, map) = (self.nodes[index - 1].odom.clone(), self.nodes[index - 1].map.clone());
            let from = self.nodes[index - 1].reading.stamp.0;
            let node = &mut self.nodes[index];
            if moved {
                node.odom = odom;
                let bias = node.odom.x[3];
                let innovation = doubted(&Motion { extra: 0.0, ..motion }, &node.odom, &self.noise);
                let believed = sift(&motion, &node.odom, &self.noise, watch.gyro_is_proved());
                let _ = node.odom.predict(&believed, &self.noise);
                let gyro = motion.gyro.map(|angle| angle - bias * motion.dt);
                let track = self.noise.track * (1.0 + node.odom.x[6]);
                let by_wheels = (motion.right - motion.left) / track;
                let turn = believed.gyro.and(gyro).unwrap_or(by_wheels);
                let v = f64::midpoint(motion.left, motion.right) / motion.dt;
                node.rates = (!node.anchor)
                    .then_some([v, turn / motion.dt])
                    .filter(|rates| rates.iter().all(|rate| rate.is_finite()));
                if !node.looked && !node.anchor && (motion.gyro.is_some() || raw.is_some()) {
                    node.looked = true;
                    let seen = Seen {
                        stamp: node.reading.stamp.0,
                        left: motion.left,
                        right: motion.right,
                        track,
                        gyro,
                        innovation,
                    };
                    self.noticed.extend(watch.look(&seen, raw, SLIP));
                    node.slip = watch.slip_variance(track);
                    motion.extra += node.slip;
                }
            }
            if node.placed {
                continue;
            }
            node.map = map;
            let proved = watch.gyro_is_proved();
            travel(&mut node.map, &motion, from, &mut self.absolutes, self.gate, &self.noise, proved);
        }
    }

    /// The motion of the span before a node, and the gyro's angle, believed or not.
    fn motion(&self, index: usize, watch: &Watch) -> (Motion, Option<f64>) {
        let (before, node) = (&self.nodes[index - 1].reading, &self.nodes[index]);
        let span = before.span_to(&node.reading);
        let dt = span.duration.0;
        let raw = self.gyro.angle(before.stamp.0, node.reading.stamp.0);
        let possible = raw.filter(|angle| angle.abs() <= self.turn_rate * dt && watch.gyro_is_usable());
        let (left, right) = if node.anchor { (0.0, 0.0) } else { (span.left.0, span.right.0) };
        let reach = self.wheel_speed * dt / 3.0;
        let way = f64::midpoint(left.abs(), right.abs());
        let motion = Motion {
            dt,
            left,
            right,
            gyro: possible,
            extra: node.slip + if node.anchor { reach * reach } else { 0.0 },
            unseen: if dt > GAP { way * way / 4.0 } else { 0.0 },
        };
        (motion, raw.filter(|_| !node.anchor))
    }

    fn believes(&self, from: &EncodersData, to: &EncodersData) -> bool {
        let span = from.span_to(to);
        let reach = self.wheel_speed * span.duration.0 + self.jump;
        span.left.0.abs() <= reach && span.right.0.abs() <= reach
    }

    fn forget(&mut self) {
        let oldest = self.newest_stamp() - self.window;
        while self.nodes.len() > 2 && (self.nodes[1].reading.stamp.0 <= oldest || self.nodes.len() > MOST) {
            let _ = self.nodes.pop_front();
            self.young = false;
        }
        let Some(first) = self.nodes.front().map(|node| node.reading.stamp.0) else { return };
        if self.young {
            return;
        }
        self.gyro.forget(first);
        while self.absolutes.front().is_some_and(|absolute| absolute.stamp <= first && absolute.settled) {
            let _ = self.absolutes.pop_front();
        }
    }

    /// The next fix or range that was applied for the first time.
    pub(super) fn next_settled(&mut self) -> Option<(Absolute, Verdict)> {
        let absolute = self.absolutes.iter_mut().find(|a| !a.settled && a.verdict.is_some())?;
        absolute.settled = true;
        Some((*absolute, absolute.verdict?))
    }

    /// Sets the newest pose in `map`, whatever led to it.
    pub(super) fn place(&mut self, pose: Pose, covariance: &Matrix3<f64>) {
        if let Some(node) = self.nodes.back_mut() {
            node.map.place(pose, covariance);
            node.placed = true;
        }
    }

    /// Sets the pose in `map` at a stamp of the past or of now; false if that is forgotten or has not come.
    pub(super) fn set(
        &mut self,
        stamp: f64,
        pose: Pose,
        covariance: &Matrix3<f64>,
        watch: &mut Watch,
    ) -> bool {
        if self.nodes.is_empty() {
            self.start.1.place(pose, covariance);
            return true;
        }
        let at = self.nodes.partition_point(|node| node.reading.stamp.0 < stamp);
        if !self.young && stamp < self.nodes[0].reading.stamp.0 {
            return false;
        }
        let Some(odom) = self.odom_at(stamp).filter(|_| stamp <= self.newest_stamp() + GAP) else {
            return false;
        };
        let at = at.min(self.nodes.len() - 1);
        // The node at or after the stamp is where the robot has come to from there.
        let moved = self.nodes[at].odom.pose().seen_from(odom);
        self.nodes[at].map.place(pose.moved(moved.x, moved.y, moved.heading), covariance);
        drop(self.nodes.drain(..at));
        let first = self.nodes[0].reading.stamp.0;
        self.absolutes.retain(|absolute| absolute.stamp > first);
        self.young = false;
        self.replay(1, false, watch);
        true
    }

    pub(super) fn newest(&self) -> Option<&Node> {
        self.nodes.back()
    }
    pub(super) fn newest_stamp(&self) -> f64 {
        self.nodes.back().map_or(f64::NEG_INFINITY, |node| node.reading.stamp.0)
    }
    pub(super) fn newest_odom(&self) -> Option<Pose> {
        self.newest().map(|node| node.odom.pose())
    }
    pub(super) fn newest_map(&self) -> Pose {
        self.newest().map_or_else(|| self.start.1.pose(), |node| node.map.pose())
    }
    pub(super) fn odom_at(&self, stamp: f64) -> Option<Pose> {
        self.pose_at(stamp, |node| node.odom.pose())
    }
    pub(super) fn map_at(&self, stamp: f64) -> Option<Pose> {
        self.pose_at(stamp, |node| node.map.pose())
    }

    /// Between two nodes the robot is on the way from one to the other; before the first and after the last it is there.
    fn pose_at(&self, stamp: f64, pose: impl Fn(&Node) -> Pose) -> Option<Pose> {
        let at = self.nodes.partition_point(|node| node.reading.stamp.0 < stamp);
        let Some(after) = self.nodes.get(at) else { return self.nodes.back().map(pose) };
        let Some(before) = at.checked_sub(1).map(|at| &self.nodes[at]) else { return Some(pose(after)) };
        let (t0, t1) = (before.reading.stamp.0, after.reading.stamp.0);
        let share = (stamp - t0) / (t1 - t0);
        let (from, to) = (pose(before), pose(after));
        let mix = |from: f64, to: f64| from + (to - from) * share;
        Some(Pose::new(mix(from.x.0, to.x.0), mix(from.y.0, to.y.0), mix(from.heading.0, to.heading.0)))
    }
}

/// Moves along a span, and stops on the way for each fix and range of it.
fn travel(
    map: &mut Filter,
    motion: &Motion,
    from: f64,
    absolutes: &mut VecDeque<Absolute>,
    gate: f64,
    noise: &Noise,
    proved: bool,
) {
    let to = from + motion.dt;
    let mut now = from;
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
            extra: motion.extra * share,
            unseen: motion.unseen * share,
        };
        let part = sift(&part, map, noise, proved);
        let _ = map.predict(&part, noise);
        apply(absolutes, map, now, next, gate);
        now = next;
        if stop.is_none() {
            return;
        }
    }
}

/// Where the wheels and a gyro that has proved itself differ by more than noise, a wheel slips: its distance is then as
/// uncertain as the difference is large. A gyro that has not is left out of such a span.
fn sift(motion: &Motion, filter: &Filter, noise: &Noise, proved: bool) -> Motion {
    let Some(Innovation { nu, s }) = doubted(motion, filter, noise) else { return *motion };
    if nu * nu <= SLIP * s {
        return *motion;
    }
    if !proved {
        return Motion { gyro: None, ..*motion };
    }
    Motion { extra: motion.extra + (nu * nu - s) * noise.track * noise.track / 2.0, ..*motion }
}

/// What the gyro would think of the wheels.
fn doubted(motion: &Motion, filter: &Filter, noise: &Noise) -> Option<Innovation> {
    let gyro = motion.gyro?;
    let d = (motion.right * (1.0 + filter.x[5]) - motion.left * (1.0 + filter.x[4]))
        / (noise.track * (1.0 + filter.x[6]));
    let nu = gyro - filter.x[3] * motion.dt - d;
    let wheels = noise.k * (motion.left.abs() + motion.right.abs()) + 2.0 * motion.extra;
    let measures = motion.left.powi(2) * filter.p[(4, 4)] + motion.right.powi(2) * filter.p[(5, 5)];
    let s = filter.p[(3, 3)] * motion.dt.powi(2)
        + (wheels + measures) / noise.track.powi(2)
        + d * d * filter.p[(6, 6)]
        + noise.gyro * motion.dt;
    Some(Innovation { nu, s })
}

/// Applies the fixes and ranges after `from` and up to `to`.
fn apply(absolutes: &mut VecDeque<Absolute>, map: &mut Filter, from: f64, to: f64, gate: f64) {
    let first = absolutes.partition_point(|absolute| absolute.stamp <= from);
    for absolute in absolutes.iter_mut().skip(first).take_while(|absolute| absolute.stamp <= to) {
        judge(absolute, map, gate);
    }
}

fn judge(absolute: &mut Absolute, map: &mut Filter, gate: f64) {
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
            (map.range(point, distance, variance, gate), 1, gate)
        }
    };
    absolute.verdict.get_or_insert(Verdict { squared, degrees, believed: squared <= gate });
}
