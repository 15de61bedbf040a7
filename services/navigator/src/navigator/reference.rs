//! Absolute references: where the robot is, by somebody's word or by a fix that resets dead reckoning.

use super::{Keeper, Navigator};
use axle_schema::refusal::within;
use axle_schema::{Fix, Numbers, Pose, Refusal, Seconds};
use nalgebra::Matrix3;

impl Navigator {
    /// The robot was at `pose` in `map` at `stamp`: an absolute reference, such as a person's word or a docking station.
    /// Uncertainty restarts with the covariance `p` of (x, y, heading), row by row, and measurements before it are obsolete.
    /// `odom` goes on as before.
    ///
    /// # Errors
    /// Refuses a pose that no robot has, a covariance that is none, and a stamp that the memory does not reach.
    pub fn set_position(&mut self, stamp: Seconds, pose: Pose, p: &Numbers<9>) -> Result<(), Refusal> {
        pose.check()?;
        within("stamp in s", stamp.0, -1e9, 1e9)?;
        let p = covariance(p)?;
        let is_set = match &mut self.keeper {
            Keeper::Dead(dead) => dead.set(stamp.0, pose, &p),
            Keeper::Ekf(ekf) => ekf.set(stamp.0, pose, &p),
        };
        if is_set {
            Ok(())
        } else {
            Err(Refusal::out_of_range("stamp of the position", stamp, "a stamp of the last seconds"))
        }
    }

    /// A fix resets the position of the warehouse's method; the heading too where the fix knows it.
    pub(super) fn reset(&mut self, fix: &Fix) {
        let Keeper::Dead(dead) = &mut self.keeper else { return };
        let p = dead.position().map_or([0.0; 9], |position| position.map_covariance.0);
        let Numbers([xx, xy, _, yy]) = fix.covariance;
        let heading = fix.heading.map_or_else(
            || (dead.poses_at(fix.stamp.0).map_or(self.params.start, |(_, map)| map).heading, p[8]),
            |heading| (heading.angle, heading.variance),
        );
        let covariance = Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, heading.1);
        if !dead.set(fix.stamp.0, Pose { x: fix.x, y: fix.y, heading: heading.0 }, &covariance) {
            self.counts.stale += 1;
        }
    }
}

/// A covariance of (x, y, heading), row by row.
pub(super) fn covariance(p: &Numbers<9>) -> Result<Matrix3<f64>, Refusal> {
    let p = Matrix3::from_row_slice(&p.0);
    let p = (p + p.transpose()) / 2.0;
    for (name, index) in [("x", 0), ("y", 1), ("heading", 2)] {
        within(&format!("variance of {name}"), p[(index, index)], 0.0, 1e9)?;
    }
    // The eigenvalues of a matrix with NaN would be sought for ever.
    if !p.iter().all(|value| value.is_finite()) || p.symmetric_eigenvalues().min() < -1e-9 * p.amax() {
        return Err(Refusal::malformed("covariance", "it is not positive semidefinite"));
    }
    Ok(p)
}
