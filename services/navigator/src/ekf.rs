//! The method "ekf": a Kalman filter of encoders, gyro, accelerometer, fixes and ranges (model.md 6).
//!
//! Encoders set the pace. Every reading of the last seconds is a node with the filters of its instant; a measurement
//! that comes late, or out of order, is put in its place, and what came after it is reckoned again. One that is ahead
//! of the encoders waits for them. Beside the filter in `map` runs a second one that hears no fixes: it is `odom`,
//! continuous, with a covariance that says how far it may have drifted; a late fix does not touch it.
//!
//! When something fails: a fix that is too far off is not believed; three in a row that agree with each other are, and
//! the robot begins anew there. A heading that nothing tells is unknown, and stays so while the robot stands (see
//! [`seed`]). A slipping wheel loses its weight, a gyro in degrees is left out; both are said.

mod filter;
mod means;
mod seed;
mod timeline;
mod watch;

use crate::measurement::{Counts, position};
use crate::navigator::Innovation;
use crate::params::NavigatorParams;
use crate::reckoning::row_by_row;
use axle_schema::{
    EncodersData, Event, Fix, InertialData, Metres, MetresPerSecond, NavigatorData, Numbers, Pose, Position,
    RadiansPerSecond, Range, Seconds, Twist,
};
use filter::{Filter, Noise};
use nalgebra::Matrix3;
use seed::Seed;
use std::f64::consts::PI;
use timeline::{Absolute, Timeline, Verdict, What};
use watch::Watch;

/// A start heading of a larger standard deviation than this, in rad, is unknown.
const UNKNOWN: f64 = 0.5;
/// So many fixes in a row that agree with each other, and not with the pose, are right.
const KIDNAPPED: usize = 3;
/// The most innovations, and the most events, that wait for being asked for.
const MOST: usize = 4096;

/// The filter with its memory.
#[derive(Clone, Debug)]
pub(crate) struct Ekf {
    params: NavigatorParams,
    timeline: Timeline,
    watch: Watch,
    /// Whether the heading is still to be found.
    seeking: bool,
    seed: Seed,
    rejected: u32,
    innovations: Vec<Innovation>,
    events: Vec<Event>,
}

impl Ekf {
    pub(crate) fn new(params: &NavigatorParams) -> Self {
        let sd = params.ekf.start_heading_sd.0;
        let seeking = sd >= UNKNOWN;
        let position = params.ekf.start_sd.0.powi(2);
        let heading = if seeking { PI * PI / 3.0 } else { sd * sd };
        let covariance = Matrix3::from_diagonal(&[position, position, heading].into());
        let noise = Noise {
            track: params.robot.track.get(),
            k: params.k.0,
            wheel: params.ekf.wheel_noise.powi(2),
            tick: params.tick.0,
            gyro: params.ekf.gyro_noise.powi(2),
            bias: params.ekf.bias_walk.powi(2),
            push: params.ekf.accelerometer_noise.powi(2),
        };
        let odom = Filter::new(params.start, &Matrix3::zeros(), &params.ekf);
        let map = Filter::new(params.start, &covariance, &params.ekf);
        Self {
            params: params.clone(),
            timeline: Timeline::new(odom, map, noise, params),
            watch: Watch::default(),
            seeking,
            seed: Seed::default(),
            rejected: 0,
            innovations: Vec::new(),
            events: Vec::new(),
        }
    }

    /// Goes on from where another one was; nothing is known of its bias and of the measures of the robot.
    pub(crate) fn resume(&mut self, from: &Position) {
        let covariance = |p: &Numbers<9>| Matrix3::from_row_slice(&p.0);
        let map = covariance(&from.map_covariance);
        self.timeline.resume(
            (from.odom.pose, &from.odom.covariance.as_ref().map_or_else(Matrix3::zeros, covariance)),
            (from.map, &map),
        );
        self.seeking = map[(2, 2)] >= UNKNOWN * UNKNOWN;
    }

    /// A new anchor: nothing is known of the motion before it, and no earlier stamp can be put in order with it.
    pub(crate) fn restart(&mut self, datum: &EncodersData) {
        self.timeline.restart(datum);
        self.watch.restart();
    }

    /// The next reading, or one that is put between others; false if it has no place.
    pub(crate) fn encoders(&mut self, datum: &EncodersData, counts: &mut Counts) -> bool {
        let taken = self.timeline.encoders(datum, &mut self.watch, counts);
        self.settle(counts);
        taken
    }

    pub(crate) fn inertial(&mut self, data: &InertialData, counts: &mut Counts) {
        if !self.timeline.inertial(data, &mut self.watch, counts) {
            counts.stale += 1;
        }
        self.settle(counts);
    }

    pub(crate) fn fix(&mut self, fix: &Fix, counts: &mut Counts) {
        let heading = fix.heading.map(|heading| (heading.angle.0, heading.variance));
        self.absolute(fix.stamp.0, What::Fix { z: [fix.x.0, fix.y.0], r: fix.covariance, heading }, counts);
    }

    pub(crate) fn range(&mut self, range: &Range, counts: &mut Counts) {
        let distance = range.distance.0 - self.params.ekf.range_bias.0;
        let what = What::Range { point: [range.x.0, range.y.0], distance, variance: range.sd.0.powi(2) };
        self.absolute(range.stamp.0, what, counts);
    }

    fn absolute(&mut self, stamp: f64, what: What, counts: &mut Counts) {
        if !self.timeline.absolute(
            Absolute { stamp, what, verdict: None, settled: false },
            &mut self.watch,
            counts,
        ) {
            counts.stale += 1;
        }
        self.settle(counts);
    }

    /// The robot is there: an absolute reference. Uncertainty restarts, and what came before is obsolete.
    pub(crate) fn set(&mut self, stamp: f64, pose: Pose, covariance: &Matrix3<f64>) -> bool {
        if !self.timeline.set(stamp, pose, covariance, &mut self.watch) {
            return false;
        }
        self.seeking = false;
        self.seed.clear();
        self.rejected = 0;
        true
    }

    /// Draws conclusions from the fixes and ranges that were applied for the first time.
    fn settle(&mut self, counts: &mut Counts) {
        self.events.append(&mut self.timeline.noticed);
        self.events.truncate(MOST);
        while let Some((absolute, verdict)) = self.timeline.next_settled() {
            if let (What::Fix { heading: None, .. }, true) = (&absolute.what, self.seeking) {
                self.seek(&absolute);
                continue;
            }
            if self.innovations.len() < MOST {
                let Verdict { squared, degrees, .. } = verdict;
                self.innovations.push(Innovation { stamp: Seconds(absolute.stamp), squared, degrees });
            }
            if verdict.believed {
                self.rejected = 0;
                self.seeking &= !matches!(absolute.what, What::Fix { heading: Some(_), .. });
            } else {
                counts.rejected += 1;
                self.doubt(&absolute, verdict.squared);
            }
        }
    }

    /// A fix while the heading is unknown.
    fn seek(&mut self, absolute: &Absolute) {
        let What::Fix { z, r, .. } = absolute.what else { return };
        let Some(odom) = self.timeline.odom_at(absolute.stamp) else { return };
        self.seed.take(odom, z, r.0[0].max(r.0[3]));
        let Some(now) = self.timeline.newest_odom() else { return };
        if let Some(found) = self.seed.find(now) {
            self.timeline.place(found.pose, &found.covariance);
            self.seeking = false;
            self.seed.clear();
        } else {
            // The position is that of the fix; where the robot went since depends on the heading that nobody knows.
            let map = self.timeline.newest_map();
            let since = now.distance(odom).0;
            let covariance = Matrix3::from_diagonal(
                &[r.0[0] + since * since, r.0[3] + since * since, PI * PI / 3.0].into(),
            );
            self.timeline.place(Pose::new(z[0], z[1], map.heading.0), &covariance);
        }
    }

    /// A fix that was not believed: several that agree with each other are right all the same.
    fn doubt(&mut self, absolute: &Absolute, squared: f64) {
        let What::Fix { z, r, heading } = absolute.what else { return };
        let Some(odom) = self.timeline.odom_at(absolute.stamp) else { return };
        if self.rejected == 0 {
            self.seed.clear();
        }
        self.rejected += 1;
        self.seed.take(odom, z, r.0[0].max(r.0[3]));
        if !self.seed.agree(KIDNAPPED) {
            return;
        }
        let map = self.timeline.newest_map();
        self.events.push(Event::Kidnapped {
            stamp: Seconds(absolute.stamp),
            distance: Metres((map.x.0 - z[0]).hypot(map.y.0 - z[1])),
            squared,
            fixes: self.rejected,
        });
        self.rejected = 0;
        self.seed.keep(KIDNAPPED);
        if let Some((angle, variance)) = heading {
            let covariance = Matrix3::from_diagonal(&[r.0[0], r.0[3], variance].into());
            self.timeline.place(Pose::new(z[0], z[1], angle), &covariance);
            return;
        }
        self.seeking = true;
        self.seek(absolute);
    }

    /// Squared normalised innovations of fixes and ranges since the last call, with their degrees of freedom.
    pub(crate) fn innovations(&mut self) -> Vec<Innovation> {
        std::mem::take(&mut self.innovations)
    }

    pub(crate) fn events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// The newest pose in `odom`.
    pub(crate) fn data(&self) -> Option<NavigatorData> {
        let node = self.timeline.newest()?;
        Some(NavigatorData {
            stamp: node.reading.stamp,
            pose: node.odom.pose(),
            twist: node
                .rates
                .map(|[v, omega]| Twist { v: MetresPerSecond(v), omega: RadiansPerSecond(omega) }),
            covariance: Some(Numbers(row_by_row(&node.odom.covariance()))),
        })
    }

    pub(crate) fn position(&self) -> Option<Position> {
        let node = self.timeline.newest()?;
        Some(position(node.reading, self.data()?, node.map.pose(), row_by_row(&node.map.covariance())))
    }

    /// The poses at a stamp within the window, in `odom` and in `map`.
    pub(crate) fn poses_at(&self, stamp: f64) -> Option<(Pose, Pose)> {
        Some((self.timeline.odom_at(stamp)?, self.timeline.map_at(stamp)?))
    }

    /// Bias of the gyro in rad/s, and the relative errors of left radius, right radius and track.
    pub(crate) fn measures(&self) -> Option<[f64; 4]> {
        Some(self.timeline.newest()?.map.learned())
    }
}
