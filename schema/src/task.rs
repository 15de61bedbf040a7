//! Tasks given to correctors and to the pilot, and how far they are.

use crate::codec::Message;
use crate::id::TaskId;
use crate::refusal::within;
use crate::unit::{deserialize_finite, finite};
use crate::{Drive, Metres, Plan, Refusal, Seconds, Sides, WayTask};
use serde::{Deserialize, Serialize};

/// A plan of some kind for a corrector. A new task replaces the running one; the same id again changes nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Task<P> {
    /// Names the task in cancellations and progress.
    pub id: TaskId,
    /// What is to be driven.
    pub plan: P,
}

impl Message for Task<Drive> {
    const NAME: &'static str = "DriveTask";
    const LIMIT: usize = Drive::LIMIT + 64;
    fn check(&self) -> Result<(), Refusal> {
        self.plan.check()
    }
}
impl Message for Task<Plan> {
    const NAME: &'static str = "PlanTask";
    const LIMIT: usize = Plan::LIMIT + 64;
    fn check(&self) -> Result<(), Refusal> {
        self.plan.check()
    }
}
impl Message for Task<WayTask> {
    const NAME: &'static str = "WayTaskTask";
    const LIMIT: usize = WayTask::LIMIT + 64;
    fn check(&self) -> Result<(), Refusal> {
        self.plan.check()
    }
}

/// Ends a task before its time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cancel {
    /// The task to end; another one is not touched.
    pub id: TaskId,
}
impl Message for Cancel {
    const NAME: &'static str = "Cancel";
    const LIMIT: usize = 64;
}

/// Where a task stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Being planned: Pathfinder and Pathdriver are asked.
    Planning,
    /// Being driven.
    Running,
    /// Reached.
    Done,
    /// Ended by a cancellation.
    Canceled,
    /// Ended by a newer task.
    Replaced,
    /// Ended without reaching its goal.
    Failed(Refusal),
}

impl Phase {
    /// Whether nothing more will happen.
    #[must_use]
    pub const fn is_over(&self) -> bool {
        !matches!(self, Self::Planning | Self::Running)
    }
}

/// What a corrector is doing, said at every beat and once more when the task ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CorrectorProgress {
    /// The task.
    pub task: TaskId,
    /// Where it stands.
    pub phase: Phase,
    /// The robot's clock at the measurement that the beat used.
    pub stamp: Seconds,
    /// Time since the task began, by the robot's clock.
    pub elapsed: Seconds,
    /// The share of the plan that should be behind, 0 to 1.
    #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
    pub fraction: f64,
    /// Distances that the wheels should have covered since the task began, where the corrector knows them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub due: Option<Sides<Metres>>,
    /// Distances that they have covered.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub real: Option<Sides<Metres>>,
}
impl Message for CorrectorProgress {
    const NAME: &'static str = "CorrectorProgress";
    const LIMIT: usize = 2048;
    fn check(&self) -> Result<(), Refusal> {
        within("fraction", self.fraction, 0.0, 1.0)
    }
}

/// Asks the pilot to drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoAsk {
    /// The points to visit.
    pub way: WayTask,
    /// Which corrector drives; left out, the pilot's own choice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corrector: Option<String>,
    /// The numbers, from 1, of the way points at which the robot waits until a person confirms that it may drive on.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub confirm: Vec<u32>,
}
impl Message for GoAsk {
    const NAME: &'static str = "GoAsk";
    const LIMIT: usize = 256 * 1024 + 128;
    fn check(&self) -> Result<(), Refusal> {
        if let Some(name) = &self.corrector {
            crate::plan::limit_list("letters of a corrector's name", name.len(), 64)?;
        }
        crate::plan::limit_list("way points to confirm", self.confirm.len(), crate::way::MAX_POINTS)?;
        self.way.check()?;
        let last = self.way.points.len() as f64;
        self.confirm.iter().try_for_each(|&point| within("way point to confirm", f64::from(point), 1.0, last))
    }
}

/// The pilot took the task; its progress follows on `pilot/progress`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Accepted {
    /// Names the task in cancellations and progress.
    pub task: TaskId,
}
impl Message for Accepted {
    const NAME: &'static str = "Accepted";
    const LIMIT: usize = 64;
}

/// How far the pilot is with a task: said on change and a few times a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PilotProgress {
    /// The task.
    pub task: TaskId,
    /// Where it stands.
    pub phase: Phase,
    /// The corrector that drives it.
    pub corrector: String,
    /// Way points reached so far.
    pub reached: u32,
    /// Way points of the task.
    pub points: u32,
    /// Straight distance from the estimated position to the last way point.
    pub distance_left: Metres,
    /// The share of the plan that should be behind, 0 to 1.
    #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
    pub fraction: f64,
    /// Time since the task was accepted, by the pilot's clock.
    pub elapsed: Seconds,
    /// For whom or what the robot stands, in a sentence; none while it drives.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub waiting: Option<String>,
}
impl Message for PilotProgress {
    const NAME: &'static str = "PilotProgress";
    const LIMIT: usize = 2048;
    fn check(&self) -> Result<(), Refusal> {
        within("fraction", self.fraction, 0.0, 1.0)
    }
}
