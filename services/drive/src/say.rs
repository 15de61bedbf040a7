//! What the façade is asked, and what it says: the contract's requests, answers and notifications, and the gate's words.

use axle_schema::command::{AllStop, Command, Enable, LeaseAsk, Release};
use axle_schema::differential_drive::{
    DriveDistance, DriveOperation, DriveStage, DriveState, EnableDrive, RotateDegrees, SetDrivePower,
    SetDriveSpeed, StopDrive,
};
use axle_schema::{Metres, MetresPerSecond, Refusal, Seconds, Sides, StopId, TaskId};

/// Names one request until it is answered; whoever runs the façade chooses it.
pub type Ticket = u64;

/// A request of the contract.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// `AllStop`.
    Stop(StopDrive),
    /// `EnableDrive`.
    Enable(EnableDrive),
    /// `SetDrivePower`.
    Power(SetDrivePower),
    /// `SetDriveSpeed`.
    Speed(SetDriveSpeed),
    /// `DriveDistance`.
    Distance(DriveDistance),
    /// `RotateDegrees`.
    Rotate(RotateDegrees),
    /// `ResetEncoders`.
    Reset,
    /// `Get`.
    Get,
}

/// What a request is answered, unless it is refused.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// It is done, or it is what the wheels do from now on.
    Done,
    /// The drive is stopped and disabled.
    Stopped(StopId),
    /// The notifications of this operation follow.
    Begun(TaskId),
    /// The state.
    State(Box<DriveState>),
}

/// Something that the façade wants said or asked.
#[derive(Clone, Debug, PartialEq)]
pub enum Out {
    /// The answer to a request.
    Answer(Ticket, Result<Reply, Refusal>),
    /// To the gate: a movement.
    Command(Command),
    /// To the gate: a question, whose answer goes to [`crate::Facade::leased`].
    AskLease(LeaseAsk),
    /// To the gate: the wheels are not needed any more.
    Release(Release),
    /// To the gate: stop at once.
    Stop(AllStop),
    /// To the gate: a question, whose answer goes to [`crate::Facade::enabled`] with the ticket.
    Enable(Ticket, Enable),
    /// Notification: a stage of a distance.
    Distance(DriveDistance),
    /// Notification: a stage of a turn.
    Rotate(RotateDegrees),
    /// Notification: the state.
    Update(Box<DriveState>),
}

/// A request to move, checked, in SI units.
pub(crate) enum Wish {
    /// Wheel speeds, for as long as they hold.
    Speeds { operation: DriveOperation, target: Sides<MetresPerSecond>, hold: Seconds },
    /// A movement with an end; without a drive it is over at once.
    Operation { stages: Stages, drive: Option<axle_schema::Drive> },
}

impl Wish {
    /// Whether it is granted without moving a wheel.
    pub(crate) fn needs_no_wheels(&self) -> bool {
        match self {
            Self::Speeds { target, .. } => *target == Sides::default(),
            Self::Operation { drive, .. } => drive.is_none(),
        }
    }
}

/// An operation as its notifications name it.
#[derive(Clone, Debug)]
pub(crate) enum Stages {
    Distance(DriveDistance),
    Rotate(RotateDegrees),
}

impl Stages {
    pub(crate) const fn operation(&self) -> DriveOperation {
        match self {
            Self::Distance(_) => DriveOperation::Distance,
            Self::Rotate(_) => DriveOperation::Rotate,
        }
    }
    /// The notification of a stage.
    pub(crate) fn reach(&self, stage: DriveStage, why: Option<Refusal>) -> Out {
        match self.clone() {
            Self::Distance(distance) => Out::Distance(DriveDistance { stage, why, ..distance }),
            Self::Rotate(rotate) => Out::Rotate(RotateDegrees { stage, why, ..rotate }),
        }
    }
    /// How far each wheel has to go, in metres.
    pub(crate) fn way(&self, track: f64) -> Sides<Metres> {
        match self {
            Self::Distance(DriveDistance { distance, power, .. }) => {
                let way = if power.get() < 0.0 { -*distance } else { *distance };
                Sides::new(way, way)
            }
            // On the spot the wheels run on a circle of the track's diameter.
            Self::Rotate(RotateDegrees { degrees, .. }) => {
                let way = Metres(degrees.to_radians() * track / 2.0);
                Sides::new(-way, way)
            }
        }
    }
    /// The share of full power that was asked for, without its sign.
    pub(crate) const fn power(&self) -> f64 {
        match self {
            Self::Distance(DriveDistance { power, .. }) | Self::Rotate(RotateDegrees { power, .. }) => {
                power.get().abs()
            }
        }
    }
}
