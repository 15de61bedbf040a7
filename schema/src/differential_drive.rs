//! The Generic Differential Drive contract: its operations, its state and its notifications, and its partners, the
//! motor and encoder services.
//!
//! Source: the contract's description in Microsoft Robotics Developer Studio. Powers from -1 to 1 and degrees exist at
//! this façade only; everything behind it speaks metres, seconds and radians. What differs from the contract, and why, is said
//! where it differs: a robot starts disabled unless its gate says otherwise, an enable after an AllStop quotes the
//! stop, and a power or a speed ends by itself when its sender falls silent.

use crate::codec::Message;
use crate::command::{BrakeCause, Motion};
use crate::dwm::MAX_WHEEL_SPEED;
use crate::id::{Boot, StopId, TaskId, Tick};
use crate::refusal::within;
use crate::unit::{Duty, deserialize_finite, finite};
use crate::{Metres, MetresPerSecond, Refusal, Seconds, Sides};
use serde::{Deserialize, Serialize};

/// The longest distance of one request, m.
const MAX_DISTANCE: f64 = 1000.0;
/// The largest angle of one request, degrees.
const MAX_DEGREES: f64 = 36_000.0;
/// The longest time that a power or a speed may go on without being renewed, s.
pub const MAX_HOLD: f64 = 5.0;

/// Ends every operation, takes the power from both wheels and disables the drive.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StopDrive {
    /// Who stops, in words that a person understands.
    #[serde(default)]
    pub by: String,
}

/// The receipt of [`StopDrive`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DriveStopped {
    /// What [`EnableDrive`] must quote.
    pub stop: StopId,
}

/// Enables or disables the drive. Disabling it stops a running operation at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EnableDrive {
    /// Whether requests to move are followed from now on.
    pub enable: bool,
    /// The stop that is in force, as [`DriveState::stop`] shows it. Without it an enable does not end an AllStop, so
    /// that an old or repeated enable does not let a stopped robot move again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<StopId>,
}

/// Sets the powers of both wheels, and supersedes what was asked before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetDrivePower {
    /// Of the left wheel: -1 is full power backward, 1 full power forward.
    pub left: Duty,
    /// Of the right wheel.
    pub right: Duty,
    /// For how long it holds unless it is renewed, 0.05 to 5 s; left out, the drive's own choice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold: Option<Seconds>,
}

/// Sets the speeds of both wheels, and supersedes what was asked before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetDriveSpeed {
    /// Of the left wheel, positive forward.
    pub left: MetresPerSecond,
    /// Of the right wheel.
    pub right: MetresPerSecond,
    /// As in [`SetDrivePower`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold: Option<Seconds>,
}

/// How far a [`DriveDistance`] or [`RotateDegrees`] is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveStage {
    /// Asked for.
    #[default]
    InitialRequest,
    /// The robot has begun.
    Started,
    /// The robot is where it should be, by its encoders.
    Completed,
    /// Ended before its time: by another request, by a stop, or because it could not be done.
    Canceled,
}

/// Moves the robot straight by a distance. The same type is the request and, with its stage, the notification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriveDistance {
    /// How far, not negative.
    pub distance: Metres,
    /// With which power: negative drives backward.
    pub power: Duty,
    /// In a request [`DriveStage::InitialRequest`].
    #[serde(default)]
    pub stage: DriveStage,
    /// Names the operation in notifications; a request leaves it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub operation: Option<TaskId>,
    /// Why it was cancelled, in notifications, unless another request was the reason.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<Refusal>,
}

/// Turns the robot on the spot. The same type is the request and, with its stage, the notification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RotateDegrees {
    /// How far in degrees, counter-clockwise positive, seen from above.
    #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
    pub degrees: f64,
    /// With which power; its sign does not matter.
    pub power: Duty,
    /// In a request [`DriveStage::InitialRequest`].
    #[serde(default)]
    pub stage: DriveStage,
    /// Names the operation in notifications; a request leaves it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub operation: Option<TaskId>,
    /// Why it was cancelled, in notifications, unless another request was the reason.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<Refusal>,
}

/// The answer to [`DriveDistance`] and [`RotateDegrees`]: the notifications of this operation follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OperationBegun {
    /// Names the operation in its notifications.
    pub operation: TaskId,
}

/// Sets the distances of both encoders in [`DriveState`] to zero. The measurements of the robot itself go on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResetEncoders {}

/// Asks for the [`DriveState`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetDrive {}

/// One wheel with its motor and encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WheelState {
    /// The power that the drive gives, or the share of full speed that it asks for.
    pub power: Duty,
    /// The speed that the encoder measures.
    pub speed: MetresPerSecond,
    /// The distance that the encoder has measured since the last reset.
    pub distance: Metres,
}

/// What the drive is doing for its clients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveOperation {
    /// Nothing.
    #[default]
    Idle,
    /// Follows powers.
    Power,
    /// Follows speeds.
    Speed,
    /// Moves by a distance.
    Distance,
    /// Turns by an angle.
    Rotate,
}

/// The state of the drive: the answer to [`GetDrive`], and the Update notification, on change and once a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriveState {
    /// The robot's clock at the newest measurement.
    pub stamp: Seconds,
    /// Whether requests to move are followed.
    pub enabled: bool,
    /// The stop that [`EnableDrive`] must quote.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<StopId>,
    /// What the drive is doing.
    pub operation: DriveOperation,
    /// What the gate says of the wheels; a drive is moving unless they stand.
    pub motion: Motion,
    /// Why they brake, or last braked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<BrakeCause>,
    /// Both wheels.
    pub wheels: Sides<WheelState>,
    /// The distance between the wheels.
    pub track: Metres,
    /// The wheel speed that a power of 1 asks for.
    pub full_speed: MetresPerSecond,
}

/// The power of one motor, said at every beat by the drive that is composed of motors. A motor is a gate of its own: it
/// refuses what is older than its limit by its own clock, and stops when nothing comes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorPower {
    /// From the motor's [`MotorReading`].
    pub boot: Boot,
    /// Grows with every sample.
    pub seq: u32,
    /// The latest tick of the motor's clock that the sender had seen.
    pub echo: Tick,
    /// The power.
    pub power: Duty,
}

/// What a motor service says of itself, and what an encoder service measures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotorReading {
    /// The run of the process that owns the motor.
    pub boot: Boot,
    /// Its clock.
    pub stamp: Seconds,
    /// The power that the motor has now, where there is a motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<Duty>,
    /// The distance that the wheel has covered since the boot, where there is an encoder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance: Option<Metres>,
}

impl Message for StopDrive {
    const NAME: &'static str = "StopDrive";
    const LIMIT: usize = 256;
    fn check(&self) -> Result<(), Refusal> {
        crate::plan::limit_list("letters of who stops", self.by.len(), 96)
    }
}
impl Message for DriveStopped {
    const NAME: &'static str = "DriveStopped";
    const LIMIT: usize = 64;
}
impl Message for EnableDrive {
    const NAME: &'static str = "EnableDrive";
    const LIMIT: usize = 128;
}
impl Message for SetDrivePower {
    const NAME: &'static str = "SetDrivePower";
    const LIMIT: usize = 128;
    fn check(&self) -> Result<(), Refusal> {
        check_hold(self.hold)
    }
}
impl Message for SetDriveSpeed {
    const NAME: &'static str = "SetDriveSpeed";
    const LIMIT: usize = 128;
    fn check(&self) -> Result<(), Refusal> {
        within("left speed in m/s", self.left.0, -MAX_WHEEL_SPEED, MAX_WHEEL_SPEED)?;
        within("right speed in m/s", self.right.0, -MAX_WHEEL_SPEED, MAX_WHEEL_SPEED)?;
        check_hold(self.hold)
    }
}
impl Message for DriveDistance {
    const NAME: &'static str = "DriveDistance";
    const LIMIT: usize = 1024;
    fn check(&self) -> Result<(), Refusal> {
        within("distance in m (a negative power drives backward)", self.distance.0, 0.0, MAX_DISTANCE)
    }
}
impl Message for RotateDegrees {
    const NAME: &'static str = "RotateDegrees";
    const LIMIT: usize = 1024;
    fn check(&self) -> Result<(), Refusal> {
        within("degrees", self.degrees, -MAX_DEGREES, MAX_DEGREES)
    }
}
impl Message for OperationBegun {
    const NAME: &'static str = "OperationBegun";
    const LIMIT: usize = 64;
}
impl Message for ResetEncoders {
    const NAME: &'static str = "ResetEncoders";
    const LIMIT: usize = 64;
}
impl Message for GetDrive {
    const NAME: &'static str = "GetDrive";
    const LIMIT: usize = 64;
}
impl Message for DriveState {
    const NAME: &'static str = "DriveState";
    const LIMIT: usize = 1024;
}
impl Message for MotorPower {
    const NAME: &'static str = "MotorPower";
    const LIMIT: usize = 128;
}
impl Message for MotorReading {
    const NAME: &'static str = "MotorReading";
    const LIMIT: usize = 128;
}

fn check_hold(hold: Option<Seconds>) -> Result<(), Refusal> {
    hold.map_or(Ok(()), |hold| within("hold in s", hold.0, 0.05, MAX_HOLD))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn duty(power: f64) -> Duty {
        Duty::new(power).expect("within full power")
    }

    #[test]
    fn a_request_out_of_its_range_is_refused_by_name() {
        let check = |refused: Result<(), Refusal>, words: &str| {
            let text = refused.expect_err(words).to_string();
            assert!(text.contains(words), "{text:?} names {words:?}");
        };
        let straight = |distance| DriveDistance {
            distance: Metres(distance),
            power: duty(0.5),
            stage: DriveStage::InitialRequest,
            operation: None,
            why: None,
        };
        let turn = |degrees| RotateDegrees {
            degrees,
            power: duty(0.5),
            stage: DriveStage::InitialRequest,
            operation: None,
            why: None,
        };
        for distance in [-0.1, 1000.1, f64::NAN, f64::INFINITY, 1e300] {
            check(straight(distance).check(), "a negative power drives backward");
        }
        assert!(straight(0.0).check().is_ok() && straight(1000.0).check().is_ok());
        for degrees in [36_000.1, -36_001.0, f64::NAN, f64::NEG_INFINITY] {
            check(turn(degrees).check(), "degrees");
        }
        assert!(turn(-36_000.0).check().is_ok());
        for hold in [0.0, 0.049, -1.0, 5.01, f64::NAN] {
            let hold = Some(Seconds(hold));
            check(SetDrivePower { hold, ..SetDrivePower::default() }.check(), "hold in s");
            check(SetDriveSpeed { hold, ..SetDriveSpeed::default() }.check(), "hold in s");
        }
        for speed in [20.1, -20.1, f64::NAN, 1e300] {
            let speed = MetresPerSecond(speed);
            check(SetDriveSpeed { left: speed, ..SetDriveSpeed::default() }.check(), "left speed");
            check(SetDriveSpeed { right: speed, ..SetDriveSpeed::default() }.check(), "right speed");
        }
        check(StopDrive { by: "x".repeat(97) }.check(), "letters of who stops");
    }
}
