//! The two kinds of services of the paper, as values without a process, a clock or a network.
//!
//! A service is a value; the mesh makes a process of it. Both kinds can therefore be run by a test, a simulator or a
//! replay in virtual time, and give the same answers bit for bit.

use crate::codec::Message;
use crate::task::Task;
use crate::{Dwm, EncodersData, InertialData, Metres, NavigatorData, Refusal, Seconds, Sides};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Values that have ranges.
pub trait Bounds {
    /// Refuses values outside their ranges.
    ///
    /// # Errors
    /// Names the field, its value and its range.
    fn check(&self) -> Result<(), Refusal>;
}

/// Parameters of an algorithm: one TOML file per service, every field with unit and range, unknown fields refused.
pub trait Params: Bounds + Clone + Default + Serialize + DeserializeOwned + Send + Sync + 'static {
    /// The file with all defaults and their explanations, as it is shipped in `deploy/params`.
    const FILE: &'static str;
}

/// A functional service: a model of a single function (paper, section II).
pub trait Functional: Send + Sync + 'static {
    /// Its parameters.
    type Params: Params;
    /// What it is asked.
    type Ask: Message;
    /// What it answers.
    type Answer: Message;

    /// Answers one question. The same parameters and question give the same answer, bit for bit.
    ///
    /// # Errors
    /// A [`Refusal`] that says what is wrong with the question.
    fn answer(params: &Self::Params, ask: &Self::Ask) -> Result<Self::Answer, Refusal>;
}

/// What a corrector sees at a beat: the newest of everything that the robot has measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// The time of the beat, by the clock of whoever runs the corrector: its only clock. It grows from beat to beat.
    pub at: Seconds,
    /// The newest wheel distances, stamped by the robot's clock.
    pub encoders: Option<EncodersData>,
    /// The newest turn rate, stamped by the robot's clock.
    pub inertial: Option<InertialData>,
    /// The newest estimated pose, stamped by the robot's clock.
    pub pose: Option<NavigatorData>,
}

/// What a corrector decides at a beat.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Make this movement until the next beat.
    Drive(Dwm),
    /// The task is done and the robot stands.
    Done,
    /// The task cannot be done.
    Fail(Refusal),
}

/// What a corrector says of its task after a beat.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Account {
    /// The robot's clock at the measurement that was used.
    pub stamp: Seconds,
    /// Time since the task began, by the robot's clock.
    pub elapsed: Seconds,
    /// The share of the plan that should be behind, 0 to 1.
    pub fraction: f64,
    /// Distances that the wheels should have covered since the task began, where the corrector knows them.
    pub due: Option<Sides<Metres>>,
    /// Distances that they have covered.
    pub real: Option<Sides<Metres>>,
}

/// A corrector: a continuous service that drives one task to its end (paper, sections II and III).
///
/// A running corrector has a task: `begin` makes the value, and its end drops it. There is no reset.
pub trait Corrector: Sized + Send + 'static {
    /// Its parameters.
    type Params: Params;
    /// The kind of plan it follows.
    type Plan: Send + 'static;

    /// The time from beat to beat that the parameters ask for.
    fn period(params: &Self::Params) -> Seconds;

    /// Takes a task; `period` is the time from beat to beat.
    ///
    /// # Errors
    /// A [`Refusal`] for a plan that cannot be followed from what is seen.
    fn begin(
        params: &Self::Params,
        period: Seconds,
        task: Task<Self::Plan>,
        seen: &Seen,
    ) -> Result<Self, Refusal>;

    /// One beat. Never called twice with the same `seen.at`.
    fn step(&mut self, seen: &Seen) -> Step;

    /// The gate had taken the wheels back, because commands were lost, and gives them again: the robot has braked, and
    /// nobody was obeyed for the time `pause`, by the beats. A step follows at the same beat.
    fn resume(&mut self, seen: &Seen, pause: Seconds);

    /// What the last beat was about.
    fn account(&self) -> Account;
}
