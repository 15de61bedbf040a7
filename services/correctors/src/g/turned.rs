//! How far the robot has turned since the task began, by its gyroscope.

use crate::newest::{Measured, Newest, Watch};
use axle_schema::contract::Seen;
use axle_schema::{Drivetrain, InertialData, Refusal, Seconds, Track};

impl Measured for InertialData {
    const NAME: &'static str = "the turn rates of the gyroscope";
    fn stamp(&self) -> Seconds {
        self.stamp
    }
    fn way_to(&self, next: &Self, track: Track) -> f64 {
        (next.gyro.0 * (next.stamp - self.stamp).0 * track.get() / 2.0).abs() + 0.0 * self.gyro.0
    }
}

/// The turn, and what the gyroscope says at rest.
#[derive(Clone, Debug)]
pub(super) struct Turned {
    newest: Newest<InertialData>,
    /// Until this time of the task, s, the robot rests, and what is measured is bias.
    still: f64,
    sum: f64,
    count: f64,
    bias: f64,
    /// The turn at the newest measurement, rad.
    angle: f64,
}

impl Turned {
    /// Begins at rest.
    ///
    /// # Errors
    /// Refuses when no turn rate is seen.
    pub(super) fn new(seen: &Seen, watch: Watch, robot: Drivetrain, still: Seconds) -> Result<Self, Refusal> {
        let newest = Newest::new(seen.inertial, seen.at, watch, robot)?;
        Ok(Self { newest, still: still.0, sum: 0.0, count: 0.0, bias: 0.0, angle: 0.0 })
    }

    /// Takes the newest turn rate.
    ///
    /// # Errors
    /// Fails when turn rates stop, cannot be believed, or go back in time.
    pub(super) fn hear(&mut self, seen: &Seen) -> Result<(), Refusal> {
        let Some(before) = self.newest.hear(seen.inertial, seen.at)? else { return Ok(()) };
        let now = self.newest.value();
        if self.still > 0.0 {
            self.sum += now.gyro.0;
            self.count += 1.0;
        } else {
            // Between two measurements the turn rate changes evenly.
            let rate = f64::midpoint(before.gyro.0, now.gyro.0) - self.bias;
            self.angle += rate * (now.stamp - before.stamp).0;
        }
        Ok(())
    }

    /// Whether the bias is known; the robot rests until then.
    pub(super) fn is_ready(&mut self, elapsed: Seconds) -> bool {
        if self.still > 0.0 && elapsed.0 >= self.still {
            self.still = 0.0;
            self.bias = if self.count > 0.0 { self.sum / self.count } else { 0.0 };
        }
        self.still <= 0.0
    }

    /// The turn at a stamp near the newest measurement, rad.
    pub(super) fn angle(&self, stamp: Seconds) -> f64 {
        if self.still > 0.0 {
            return 0.0;
        }
        let now = self.newest.value();
        self.angle + (now.gyro.0 - self.bias) * (stamp - now.stamp).0.clamp(-0.1, 0.1)
    }
}
