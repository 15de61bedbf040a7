//! What the timeline knows of the poses of its instants, and how they are set.

use super::span::GAP;
use super::{Node, Timeline};
use crate::ekf::watch::Watch;
use axle_schema::Pose;
use nalgebra::Matrix3;

impl Timeline {
    /// Sets the newest pose in `map`, whatever led to it.
    pub(in crate::ekf) fn place(&mut self, pose: Pose, covariance: &Matrix3<f64>) {
        if let Some(node) = self.nodes.back_mut() {
            node.map.place(pose, covariance);
            node.placed = true;
        }
    }

    /// Sets the pose in `map` at a stamp of the past or of now; false if that is forgotten or has not come.
    pub(in crate::ekf) fn set(
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
        let at = self.nodes.partition_point(|node| node.stamp() < stamp);
        if !self.young && stamp < self.nodes[0].stamp() {
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
        let first = self.nodes[0].stamp();
        self.absolutes.retain(|absolute| absolute.stamp > first);
        self.young = false;
        self.replay(1, false, watch);
        true
    }

    pub(in crate::ekf) fn newest(&self) -> Option<&Node> {
        self.nodes.back()
    }
    pub(in crate::ekf) fn newest_stamp(&self) -> f64 {
        self.nodes.back().map_or(f64::NEG_INFINITY, Node::stamp)
    }
    pub(in crate::ekf) fn newest_odom(&self) -> Option<Pose> {
        self.newest().map(|node| node.odom.pose())
    }
    pub(in crate::ekf) fn newest_map(&self) -> Pose {
        self.newest().map_or_else(|| self.start.1.pose(), |node| node.map.pose())
    }
    pub(in crate::ekf) fn odom_at(&self, stamp: f64) -> Option<Pose> {
        self.pose_at(stamp, |node| node.odom.pose())
    }
    pub(in crate::ekf) fn map_at(&self, stamp: f64) -> Option<Pose> {
        self.pose_at(stamp, |node| node.map.pose())
    }

    /// Between two nodes the robot is on the way from one to the other; before the first and after the last it is there.
    fn pose_at(&self, stamp: f64, pose: impl Fn(&Node) -> Pose) -> Option<Pose> {
        let at = self.nodes.partition_point(|node| node.stamp() < stamp);
        let Some(after) = self.nodes.get(at) else { return self.nodes.back().map(pose) };
        let Some(before) = at.checked_sub(1).map(|at| &self.nodes[at]) else { return Some(pose(after)) };
        let (t0, t1) = (before.stamp(), after.stamp());
        let share = (stamp - t0) / (t1 - t0);
        let (from, to) = (pose(before), pose(after));
        let mix = |from: f64, to: f64| from + (to - from) * share;
        Some(Pose::new(mix(from.x.0, to.x.0), mix(from.y.0, to.y.0), mix(from.heading.0, to.heading.0)))
    }
}
