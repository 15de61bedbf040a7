//! The memory of the filter: what was measured in the last seconds, with the states of every instant.
//!
//! Bounded in time by `ekf.window` and in number; a measurement that is older than the memory is refused.

mod absolute;
mod poses;
mod span;

use super::filter::{Filter, Motion, Noise, TRACK};
use super::watch::{Seen, Watch};
use crate::measurement::Counts;
use crate::params::NavigatorParams;
pub(super) use absolute::{Absolute, Verdict, What};
use absolute::{Trust, apply, judge, travel};
use axle_schema::event::Event;
use axle_schema::{EncodersData, InertialData, Pose};
use nalgebra::Matrix3;
use span::{Inertia, Reach, SLIP, motion, sift, ticked};
use std::collections::VecDeque;

/// The most nodes, and the most fixes and ranges, that are remembered.
const MOST: usize = 4096;

/// An instant of the past.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) reading: EncodersData,
    /// Whether motion counts from here, and the span before it says nothing.
    anchor: bool,
    /// When a wheel ticked last.
    ticked: f64,
    /// The middle of the span before it.
    middle: Option<f64>,
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

impl Node {
    fn new(reading: &EncodersData, (odom, map): (Filter, Filter)) -> Self {
        Self {
            reading: *reading,
            anchor: false,
            ticked: reading.stamp.0,
            middle: None,
            odom,
            map,
            rates: None,
            looked: false,
            placed: false,
            slip: 0.0,
        }
    }
    fn stamp(&self) -> f64 {
        self.reading.stamp.0
    }
}

/// The last seconds.
#[derive(Clone, Debug)]
pub(super) struct Timeline {
    /// Before the first reading.
    start: (Filter, Filter),
    nodes: VecDeque<Node>,
    absolutes: VecDeque<Absolute>,
    inertia: Inertia,
    noise: Noise,
    trust: Trust,
    reach: Reach,
    window: f64,
    /// Whether nothing has been forgotten yet: then what came before the first reading counts at it.
    young: bool,
    pub(super) noticed: Vec<Event>,
}

impl Timeline {
    pub(super) fn new(odom: Filter, map: Filter, noise: Noise, params: &NavigatorParams) -> Self {
        let beyond = |limit: f64| if limit > 0.0 { limit } else { f64::INFINITY };
        Self {
            start: (odom, map),
            nodes: VecDeque::new(),
            absolutes: VecDeque::new(),
            inertia: Inertia::default(),
            noise,
            trust: Trust {
                gate: beyond(params.ekf.gate),
                elbow: beyond(params.ekf.range_elbow),
                proved: false,
            },
            reach: Reach::new(params),
            window: params.ekf.window.0,
            young: true,
            noticed: Vec::new(),
        }
    }

    /// Begins at these poses, in `odom` and in `map`.
    pub(super) fn resume(&mut self, odom: (Pose, &Matrix3<f64>), map: (Pose, &Matrix3<f64>)) {
        self.start.0.place(odom.0, odom.1);
        self.start.1.place(map.0, map.1);
    }

    /// A new anchor. What it is made of tells of a past that is over.
    pub(super) fn restart(&mut self, datum: &EncodersData) {
        if let Some(node) = self.nodes.pop_back() {
            self.start = (node.odom, node.map);
        }
        self.nodes.clear();
        self.absolutes.clear();
        self.inertia.clear();
        self.young = true;
        self.begin(datum);
    }

    fn begin(&mut self, datum: &EncodersData) {
        let mut node = Node { anchor: true, looked: true, ..Node::new(datum, self.start.clone()) };
        if self.young {
            apply(&mut self.absolutes, &mut node.map, f64::NEG_INFINITY, datum.stamp.0, self.trust);
        }
        self.nodes.push_back(node);
    }

    /// Puts a reading in its place; false if it has none.
    pub(super) fn encoders(&mut self, datum: &EncodersData, watch: &mut Watch, counts: &mut Counts) -> bool {
        let stamp = datum.stamp.0;
        let at = self.nodes.partition_point(|node| node.stamp() < stamp);
        if at == 0 {
            if self.nodes.is_empty() {
                self.begin(datum);
                return true;
            }
            return false;
        }
        if self.nodes.get(at).is_some_and(|node| node.stamp() <= stamp) {
            return false;
        }
        let before = &self.nodes[at - 1];
        let anchor = !self.reach.believes(&before.reading, datum);
        if let Some(after) = self.nodes.get(at) {
            // A late reading is taken for what it tells of the way; one that contradicts its neighbours tells nothing.
            if anchor || !self.reach.believes(datum, &after.reading) {
                counts.jumps += 1;
                return false;
            }
            counts.late += 1;
        }
        counts.jumps += u64::from(anchor);
        let node = Node { anchor, ..Node::new(datum, (before.odom.clone(), before.map.clone())) };
        self.nodes.insert(at, node);
        self.reckon(at, true, true, watch);
        self.replay(at + 1, true, watch);
        self.forget();
        true
    }

    pub(super) fn inertial(&mut self, data: &InertialData, watch: &mut Watch, counts: &mut Counts) -> bool {
        let (stamp, newest) = (data.stamp.0, self.newest_stamp());
        if stamp < newest - self.window {
            return false;
        }
        let turned = self.inertia.gyro.insert(stamp, data.gyro.0);
        let pushed = data.ax.and_then(|ax| self.inertia.forward.insert(stamp, ax.0));
        let Some(from) = turned.into_iter().chain(pushed).reduce(f64::min) else { return false };
        let at = self.nodes.partition_point(|node| node.stamp() <= from).max(1);
        if at < self.nodes.len() {
            counts.late += u64::from(stamp < newest);
            self.replay(at, true, watch);
        }
        true
    }

    /// Puts a fix or a range in its place; false if that is forgotten.
    pub(super) fn absolute(&mut self, absolute: Absolute, watch: &mut Watch, counts: &mut Counts) -> bool {
        let stamp = absolute.stamp;
        let first = self.nodes.front().map(Node::stamp);
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
        let at = self.nodes.partition_point(|node| node.stamp() < stamp);
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
        for absolute in self.absolutes.iter_mut().filter(|a| a.stamp <= stamp && a.verdict.is_none()) {
            judge(absolute, &mut node.map, self.trust);
        }
    }

    /// Reckons the nodes from `first` on again; `odom` only where the motion itself may be another.
    fn replay(&mut self, first: usize, moved: bool, watch: &mut Watch) {
        for index in first.max(1)..self.nodes.len() {
            self.reckon(index, moved, false, watch);
        }
    }

    /// Reckons a node from the one before it. A fresh one has the states of that already.
    fn reckon(&mut self, index: usize, moved: bool, fresh: bool, watch: &mut Watch) {
        let before = &self.nodes[index - 1];
        let from = before.stamp();
        let (mut motion, raw) = motion(before, &self.nodes[index], &self.inertia, &self.reach, watch);
        let odom = (moved && !fresh).then(|| before.odom.clone());
        let map = (!fresh && !self.nodes[index].placed).then(|| before.map.clone());
        let last_tick = ticked(before, &self.nodes[index]);
        let node = &mut self.nodes[index];
        (node.middle, node.ticked) = (Some(from + motion.dt / 2.0), last_tick);
        if let Some(odom) = odom {
            node.odom = odom;
        }
        if moved {
            let track = self.noise.track * (1.0 + node.odom.x[TRACK]);
            let gyro = motion.gyro.map(|angle| angle - node.odom.bias() * motion.dt);
            if !node.looked && !node.anchor && (motion.gyro.is_some() || raw.is_some()) {
                node.looked = true;
                let is_whole = self.inertia.gyro.is_whole(from, node.reading.stamp.0);
                // A robot that stood begins to move within a tick, which its wheels do not show yet.
                let begins = Motion { ticks: true, ..motion };
                let turn = node.odom.doubt_turn(&begins, &self.noise);
                let seen = Seen {
                    stamp: node.reading.stamp.0,
                    dt: motion.dt,
                    left: motion.left,
                    right: motion.right,
                    track,
                    gyro: gyro.filter(|_| is_whole),
                    turn: turn.filter(|_| is_whole),
                    way: node.odom.doubt_way(&begins, &self.noise),
                    change: motion.push.map(|push| push.change),
                };
                self.noticed.extend(watch.look(&seen, raw.filter(|_| is_whole), SLIP));
                node.slip = watch.slip_variance(track);
                motion.extra += node.slip;
            }
            let believed = sift(&motion, &mut node.odom, &self.noise, watch.gyro_is_proved());
            let _ = node.odom.predict(&believed, &self.noise);
            let by_wheels = (motion.right - motion.left) / track;
            let turn = believed.gyro.and(gyro).unwrap_or(by_wheels);
            let v = f64::midpoint(motion.left, motion.right) / motion.dt;
            node.rates = (!node.anchor)
                .then_some([v, turn / motion.dt])
                .filter(|rates| rates.iter().all(|rate| rate.is_finite()));
        }
        if node.placed {
            return;
        }
        if let Some(map) = map {
            node.map = map;
        }
        let trust = Trust { proved: watch.gyro_is_proved(), ..self.trust };
        travel(&mut node.map, &motion, from, &mut self.absolutes, &self.noise, trust);
    }

    fn forget(&mut self) {
        let oldest = self.newest_stamp() - self.window;
        while self.nodes.len() > 2 && (self.nodes[1].stamp() <= oldest || self.nodes.len() > MOST) {
            let _ = self.nodes.pop_front();
            self.young = false;
        }
        let Some(first) = self.nodes.front().map(Node::stamp).filter(|_| !self.young) else { return };
        self.inertia.forget(first);
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
}
