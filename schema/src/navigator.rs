//! Where the robot is: poses, and displacements between them.

use crate::codec::Message;
use crate::unit::Numbers;
use crate::{Metres, MetresPerSecond, Radians, RadiansPerSecond, Refusal, Seconds, Sides, Track};
use serde::{Deserialize, Serialize};

/// Position and heading in a plane: x forward, y left, heading counter-clockwise from +x (REP-103).
///
/// The heading is not wrapped, so that it also counts turns; [`Radians::wrapped`] is for output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Position along x.
    pub x: Metres,
    /// Position along y.
    pub y: Metres,
    /// Direction of the robot's x axis.
    pub heading: Radians,
}

impl Pose {
    /// A pose from metres and radians.
    #[must_use]
    pub const fn new(x: f64, y: f64, heading: f64) -> Self {
        Self { x: Metres(x), y: Metres(y), heading: Radians(heading) }
    }
    /// The pose after a displacement given in the frame of this pose.
    #[must_use]
    pub fn moved(self, x: Metres, y: Metres, turn: Radians) -> Self {
        let (sin, cos) = self.heading.0.sin_cos();
        Self {
            x: Metres(self.x.0 + cos * x.0 - sin * y.0),
            y: Metres(self.y.0 + sin * x.0 + cos * y.0),
            heading: self.heading + turn,
        }
    }
    /// This pose seen from `basis`: the displacement that [`Pose::moved`] takes back.
    #[must_use]
    pub fn seen_from(self, basis: Self) -> Self {
        let (sin, cos) = basis.heading.0.sin_cos();
        let (dx, dy) = (self.x.0 - basis.x.0, self.y.0 - basis.y.0);
        Self::new(cos * dx + sin * dy, cos * dy - sin * dx, self.heading.0 - basis.heading.0)
    }
    /// Refuses a pose that no robot of this earth has.
    ///
    /// # Errors
    /// Names the coordinate.
    pub fn check(self) -> Result<(), Refusal> {
        for (what, value) in [("x in m", self.x.0), ("y in m", self.y.0), ("heading in rad", self.heading.0)]
        {
            crate::refusal::within(what, value, -1e9, 1e9)?;
        }
        Ok(())
    }
    /// Straight distance between the positions.
    #[must_use]
    pub fn distance(self, other: Self) -> Metres {
        Metres((self.x.0 - other.x.0).hypot(self.y.0 - other.y.0))
    }
}

/// Speed of the robot in its own frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Forward speed of the middle of the axle.
    pub v: MetresPerSecond,
    /// Turn rate.
    pub omega: RadiansPerSecond,
}

impl Twist {
    /// The wheel speeds that make the robot move like this.
    #[must_use]
    pub fn wheel_speeds(self, track: Track) -> Sides<MetresPerSecond> {
        let turning = MetresPerSecond(self.omega.0 * (track.get() / 2.0));
        Sides::new(self.v - turning, self.v + turning)
    }
    /// How the robot moves at these wheel speeds.
    #[must_use]
    pub fn of_wheels(speeds: Sides<MetresPerSecond>, track: Track) -> Self {
        let Sides { left, right } = speeds;
        Self { v: left * 0.5 + right * 0.5, omega: RadiansPerSecond((right - left).0 / track.get()) }
    }
}

/// The pose of the robot at a stamp of the robot's clock, in the frame `odom` (REP-105).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NavigatorData {
    /// Seconds since the boot of the robot process.
    pub stamp: Seconds,
    /// Where the robot is.
    pub pose: Pose,
    /// How fast it moves, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub twist: Option<Twist>,
    /// Covariance of (x, y, heading), row by row, in m², m·rad and rad², where it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<Numbers<9>>,
}

/// The displacement of a robot in an interval, in the frame of its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NavigatorSpan {
    /// Length of the interval.
    pub duration: Seconds,
    /// Displacement along the first heading.
    pub x: Metres,
    /// Displacement to the left of the first heading.
    pub y: Metres,
    /// Turn, not wrapped.
    pub heading: Radians,
}

impl Message for NavigatorData {
    const NAME: &'static str = "NavigatorData";
    const LIMIT: usize = 1024;

    fn check(&self) -> Result<(), Refusal> {
        self.pose.check()?;
        let Some(Numbers(covariance)) = self.covariance else { return Ok(()) };
        for (name, index) in [("x", 0), ("y", 4), ("heading", 8)] {
            crate::refusal::within(&format!("variance of {name}"), covariance[index], 0.0, f64::MAX)?;
        }
        Ok(())
    }
}
impl Message for NavigatorSpan {
    const NAME: &'static str = "NavigatorSpan";
    const LIMIT: usize = 256;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_displacement_is_taken_back_by_seeing_from_its_start() {
        let basis = Pose::new(2.0, -1.0, 0.7);
        let moved = basis.moved(Metres(0.5), Metres(-0.25), Radians(4.0));
        let back = moved.seen_from(basis);
        assert!((back.x.0 - 0.5).abs() < 1e-15 && (back.y.0 + 0.25).abs() < 1e-15);
        assert!((back.heading.0 - 4.0).abs() < 1e-15);
    }
}
