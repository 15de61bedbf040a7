//! What a service worked from: said beside its output, for replay and for "why did it do that".
//!
//! The inputs themselves are recorded anyway; what a recording lacks is which of them the service had taken when it
//! spoke, in which order, and what its clock showed. With that a replay gives the same outputs bit for bit.

use crate::codec::Message;
use crate::id::{Boot, TaskId};
use crate::meta::Cause;
use crate::plan::limit_list;
use crate::{Drive, DriveAsk, Plan, PlanAsk, Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// The most samples that one trace names.
pub const MAX_NAMED: usize = 128;
/// The most letters of parameters, as JSON.
pub const MAX_PARAMS: usize = 32 * 1024;

/// Names a sample together with the stream on which it was said.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Named {
    /// The last two chunks of its key: `navigator/pose`.
    pub port: String,
    /// The run of the process that published it.
    pub source: Boot,
    /// Its sequence number on its key.
    pub seq: u64,
}

impl Named {
    /// A sample of a stream.
    #[must_use]
    pub fn new(port: impl std::fmt::Display, sample: Cause) -> Self {
        Self { port: port.to_string(), source: sample.source, seq: sample.seq }
    }
    /// Its name without the stream.
    #[must_use]
    pub const fn cause(&self) -> Cause {
        Cause { source: self.source, seq: self.seq }
    }
}

/// What a service was told to be when it began.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// Its parameters as JSON; every float reads back as the very bits that it was.
    pub params: String,
    /// The time from beat to beat, where it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period: Option<Seconds>,
    /// The version of Axle.
    pub version: String,
}

/// One beat of a service, or one sample that it took.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// Whether nothing went before: the first of a process, or of a corrector's task.
    pub first: bool,
    /// A corrector went on at this beat, after its wheels had not been held for so long.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resumed: Option<Seconds>,
    /// How the service was set; said with the first trace and again now and then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub setting: Option<Setting>,
    /// What the service's own clock showed at the beat, where it has beats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<Seconds>,
    /// The task, of a corrector.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<TaskId>,
    /// A corrector names the samples that it had before it, the others those that they took since the last trace, in
    /// this order.
    pub took: Vec<Named>,
    /// Samples taken that have no name, since their publisher sends no attachment.
    #[serde(default)]
    pub nameless: u32,
    /// What was said because of that.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub said: Vec<Named>,
}
impl Message for Trace {
    const NAME: &'static str = "Trace";
    const LIMIT: usize = 64 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("samples that a trace took", self.took.len(), MAX_NAMED)?;
        limit_list("samples that a trace said", self.said.len(), MAX_NAMED)?;
        for named in self.took.iter().chain(&self.said) {
            limit_list("letters of a port", named.port.len(), 128)?;
        }
        self.setting.as_ref().map_or(Ok(()), check_setting)
    }
}

fn check_setting(setting: &Setting) -> Result<(), Refusal> {
    limit_list("letters of a version", setting.version.len(), 128)?;
    limit_list("letters of parameters", setting.params.len(), MAX_PARAMS)
}

/// A question to a functional service, and what it answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answered<Q, A> {
    /// What it was asked.
    pub ask: Q,
    /// What it answered.
    #[serde(default = "none", skip_serializing_if = "Option::is_none")]
    pub answer: Option<A>,
    /// Or why it did not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refusal: Option<Refusal>,
    /// How the service was set.
    pub setting: Setting,
}

/// `Option::default` would ask for a default of `A`.
const fn none<A>() -> Option<A> {
    None
}

impl Message for Answered<PlanAsk, Plan> {
    const NAME: &'static str = "PlanAnswered";
    const LIMIT: usize = PlanAsk::LIMIT + Plan::LIMIT + MAX_PARAMS + 4096;
    fn check(&self) -> Result<(), Refusal> {
        check_setting(&self.setting)?;
        self.ask.check()?;
        self.answer.as_ref().map_or(Ok(()), Message::check)
    }
}
impl Message for Answered<DriveAsk, Drive> {
    const NAME: &'static str = "DriveAnswered";
    const LIMIT: usize = DriveAsk::LIMIT + Drive::LIMIT + MAX_PARAMS + 4096;
    fn check(&self) -> Result<(), Refusal> {
        check_setting(&self.setting)?;
        self.ask.check()?;
        self.answer.as_ref().map_or(Ok(()), Message::check)
    }
}
