//! What a navigator can measure by, and what it says of itself beside the pose.

use axle_schema::{EncodersData, Fix, InertialData, NavigatorData, Numbers, Pose, Position, Range, Seconds};

/// Anything that tells of where the robot is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measurement {
    /// Wheel distances.
    Encoders(EncodersData),
    /// The turn rate, and accelerations where they are measured.
    Inertial(InertialData),
    /// An absolute position.
    Fix(Fix),
    /// A distance to a known point.
    Range(Range),
}

impl Measurement {
    /// Its own time.
    #[must_use]
    pub const fn stamp(&self) -> Seconds {
        match self {
            Self::Encoders(data) => data.stamp,
            Self::Inertial(data) => data.stamp,
            Self::Fix(fix) => fix.stamp,
            Self::Range(range) => range.stamp,
        }
    }

    /// Whether all its numbers are finite, its coordinates of this earth, and its variances above 0.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let near = |values: &[f64]| values.iter().all(|value| value.abs() <= 1e9);
        near(&[self.stamp().0])
            && match self {
                Self::Encoders(data) => near(&[data.left.0, data.right.0]),
                Self::Inertial(data) => {
                    near(&[data.gyro.0, data.ax.map_or(0.0, |a| a.0), data.ay.map_or(0.0, |a| a.0)])
                }
                Self::Fix(Fix { x, y, covariance: Numbers([xx, xy, yx, yy]), heading, .. }) => {
                    let heading = heading.is_none_or(|heading| {
                        near(&[heading.angle.0, heading.variance]) && heading.variance > 0.0
                    });
                    near(&[x.0, y.0, *xx, *xy, *yx, *yy])
                        && *xx > 0.0
                        && *yy > 0.0
                        && xy.abs().max(yx.abs()).powi(2) < xx * yy
                        && heading
                }
                Self::Range(range) => {
                    near(&[range.x.0, range.y.0, range.distance.0, range.sd.0]) && range.sd.0 > 0.0
                }
            }
    }
}

/// From the poses of the same instant in both frames. Whose clock it is by, only the process knows.
pub(crate) fn position(
    wheels: EncodersData,
    odom: NavigatorData,
    map: Pose,
    map_covariance: [f64; 9],
) -> Position {
    let map_to_odom = map_to_odom(map, odom.pose);
    Position {
        wheels,
        odom,
        map,
        map_covariance: Numbers(map_covariance),
        map_to_odom,
        ..Position::default()
    }
}

/// The transformation that takes `odom` to `map`, from one pose in both.
pub(crate) fn map_to_odom(map: Pose, odom: Pose) -> Pose {
    let origin = Pose::default().seen_from(odom);
    map.moved(origin.x, origin.y, origin.heading)
}

/// How often a measurement was not simply the next one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Measurements that were dropped: repeated, too old to be put in their place, or not sound.
    pub stale: u64,
    /// Stamps that went back by more than 1 s or ahead by more than 10 min: the robot or its clock restarted.
    pub restarts: u64,
    /// Readings that no wheel can have made.
    pub jumps: u64,
    /// Fixes and ranges that were too far off to be believed.
    pub rejected: u64,
    /// Measurements that came out of order and were applied at their own time.
    pub late: u64,
}
