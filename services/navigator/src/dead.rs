//! Dead reckoning by whatever method, and where its frame `odom` lies in `map`.
//!
//! An absolute reference moves `map -> odom` and leaves `odom` as it is. It counts at its own stamp: the readings since
//! then are kept, and its uncertainty grows along them anew.

use crate::accelerated::Accelerated;
use crate::measurement::{map_to_odom, position};
use crate::params::{Method, NavigatorParams};
use crate::reckoning::{Reckoning, Step, row_by_row};
use crate::ticks::Ticks;
use crate::{arc, half_turn, point_and_shoot};
use axle_schema::series::Datum as _;
use axle_schema::{EncodersData, Metres, NavigatorData, Numbers, Pose, Position, Radians, Twist};
use nalgebra::Matrix3;
use std::collections::VecDeque;

/// The most readings that are kept.
const MOST: usize = 4096;

#[derive(Clone, Debug)]
enum Kind {
    Simple(Step, Reckoning),
    Accelerated(Accelerated),
    Ticks(Ticks),
}

impl Kind {
    fn new(method: Method, start: &Reckoning) -> Self {
        let start = start.clone();
        match method {
            Method::PointAndShoot => Self::Simple(point_and_shoot::STEP, start),
            Method::HalfTurn => Self::Simple(half_turn::STEP, start),
            Method::Accelerated => Self::Accelerated(Accelerated::new(start)),
            Method::Ticks => Self::Ticks(Ticks::new(start)),
            Method::Arc | Method::Ekf => Self::Simple(arc::STEP, start),
        }
    }
}

/// A method of dead reckoning with its memory.
#[derive(Clone, Debug)]
pub(crate) struct Dead {
    kind: Kind,
    track: f64,
    k: Metres,
    /// How long readings are kept, in s.
    window: f64,
    /// Readings with their poses in `odom`, and whether motion counts from there.
    log: VecDeque<(EncodersData, Pose, bool)>,
    /// The uncertainty in `map`.
    map: Reckoning,
    /// Where `odom` lies in `map`.
    origin: Pose,
    twist: Option<Twist>,
}

impl Dead {
    pub(crate) fn new(params: &NavigatorParams) -> Self {
        let start = Reckoning::new(params.start, Matrix3::zeros());
        Self {
            kind: Kind::new(params.method, &start),
            track: params.robot.track.get(),
            k: params.k,
            window: params.ekf.window.0,
            log: VecDeque::new(),
            map: start,
            origin: Pose::default(),
            twist: None,
        }
    }

    /// Goes on from where another one was.
    pub(crate) fn resume(&mut self, params: &NavigatorParams, from: &Position) {
        let covariance = |p: &Numbers<9>| Matrix3::from_row_slice(&p.0);
        let odom = from.odom.covariance.as_ref().map_or_else(Matrix3::zeros, covariance);
        self.kind = Kind::new(params.method, &Reckoning::new(from.odom.pose, odom));
        self.map = Reckoning::new(from.map, covariance(&from.map_covariance));
        self.origin = from.map_to_odom;
    }

    /// Motion counts from this reading.
    pub(crate) fn anchor(&mut self, datum: &EncodersData) {
        match &mut self.kind {
            Kind::Simple(..) => {}
            Kind::Accelerated(accelerated) => accelerated.anchor(),
            Kind::Ticks(ticks) => ticks.anchor(datum),
        }
        self.twist = None;
        if self.log.back().is_some_and(|last| last.0.stamp.0 >= datum.stamp.0) {
            self.log.clear();
        }
        self.keep(datum, true);
    }

    /// Moves to the next reading; `last` is the one before.
    pub(crate) fn advance(&mut self, last: &EncodersData, datum: &EncodersData, twist: Option<Twist>) {
        let span = last.span_to(datum);
        match &mut self.kind {
            Kind::Simple(step, reckoning) => {
                reckoning.advance(step(span.left.0, span.right.0, self.track), &span, self.track, self.k);
            }
            Kind::Accelerated(accelerated) => accelerated.advance(&span, self.track, self.k),
            Kind::Ticks(ticks) => ticks.advance(datum, self.track, self.k),
        }
        self.twist = twist;
        grow(&mut self.map, last, datum, self.track, self.k);
        self.keep(datum, false);
    }

    fn keep(&mut self, datum: &EncodersData, anchor: bool) {
        let oldest = datum.stamp.0 - self.window;
        while self.log.len() >= MOST || self.log.front().is_some_and(|kept| kept.0.stamp.0 < oldest) {
            let _ = self.log.pop_front();
        }
        self.log.push_back((*datum, self.newest().pose(), anchor));
    }

    fn newest(&self) -> &Reckoning {
        match &self.kind {
            Kind::Simple(_, reckoning) => reckoning,
            Kind::Accelerated(accelerated) => accelerated.newest(),
            Kind::Ticks(ticks) => ticks.newest(),
        }
    }

    pub(crate) fn data(&self) -> Option<NavigatorData> {
        let (datum, ..) = self.log.back()?;
        let covariance = Some(Numbers(row_by_row(&self.newest().covariance())));
        Some(NavigatorData { stamp: datum.stamp, pose: self.newest().pose(), twist: self.twist, covariance })
    }

    fn in_map(&self, odom: Pose) -> Pose {
        self.origin.moved(odom.x, odom.y, odom.heading)
    }

    pub(crate) fn position(&self) -> Option<Position> {
        let (wheels, ..) = self.log.back()?;
        let odom = self.data()?;
        Some(position(*wheels, odom, self.in_map(odom.pose), row_by_row(&self.map.covariance())))
    }

    /// The poses at a stamp, in `odom` and in `map`.
    pub(crate) fn poses_at(&self, stamp: f64) -> Option<(Pose, Pose)> {
        let at = self.log.partition_point(|kept| kept.0.stamp.0 < stamp);
        let odom = match (at.checked_sub(1).map(|at| &self.log[at]), self.log.get(at)) {
            (None, None) => return None,
            (None, Some(kept)) | (Some(kept), None) => kept.1,
            (Some((before, from, _)), Some((after, to, _))) => {
                let share = (stamp - before.stamp.0) / (after.stamp.0 - before.stamp.0);
                let there = to.seen_from(*from);
                let part = |whole: f64| whole * share;
                from.moved(Metres(part(there.x.0)), Metres(part(there.y.0)), Radians(part(there.heading.0)))
            }
        };
        Some((odom, self.in_map(odom)))
    }

    /// The robot was there at `stamp`; false if that is forgotten.
    pub(crate) fn set(&mut self, stamp: f64, pose: Pose, covariance: &Matrix3<f64>) -> bool {
        let Some(first) = self.log.front().map(|kept| kept.0.stamp.0) else {
            self.origin = map_to_odom(pose, self.newest().pose());
            self.map = Reckoning::new(pose, *covariance);
            return true;
        };
        if stamp < first {
            return false;
        }
        let Some((odom, _)) = self.poses_at(stamp) else { return false };
        self.origin = map_to_odom(pose, odom);
        let at = self.log.partition_point(|kept| kept.0.stamp.0 < stamp).min(self.log.len() - 1);
        drop(self.log.drain(..at));
        let mut map = Reckoning::new(pose, *covariance);
        for (last, next) in self.log.iter().zip(self.log.iter().skip(1)).filter(|(_, next)| !next.2) {
            grow(&mut map, &last.0, &next.0, self.track, self.k);
        }
        self.map = map;
        true
    }
}

fn grow(map: &mut Reckoning, last: &EncodersData, datum: &EncodersData, track: f64, k: Metres) {
    let span = last.span_to(datum);
    map.advance(arc::STEP(span.left.0, span.right.0, track), &span, track, k);
}
