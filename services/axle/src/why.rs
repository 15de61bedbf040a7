//! Why did it do that: from what the wheels did back to the way, each link with what it worked from, its error, and how
//! old that was; and for whom a robot stands that has a task.
//!
//! Every sample names the one that caused it; a corrector's trace names all it had before it. An explanation is a
//! function of a log and a time; [`EXPLANATIONS`] lists them, and each says nothing where it has nothing to say.

mod motion;
#[cfg(test)]
mod tests;
pub(crate) mod waiting;

use crate::replay::Log;
use axle_schema::Seconds;
use serde::Serialize;

/// One link of a chain.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Link {
    /// The stream on which it was said.
    pub(crate) stream: String,
    /// What it is, in a few words.
    pub(crate) what: String,
    /// How long before the end of the chain it was said, in s, where that is known.
    pub(crate) before: Option<f64>,
    /// What it says, and what it worked from: names and values.
    pub(crate) facts: Vec<(String, String)>,
}

impl Link {
    fn new(stream: impl Into<String>, what: impl Into<String>) -> Self {
        Self { stream: stream.into(), what: what.into(), ..Self::default() }
    }
    fn fact(mut self, name: &str, value: impl Into<String>) -> Self {
        self.facts.push((name.to_owned(), value.into()));
        self
    }
    fn before(mut self, seconds: f64) -> Self {
        self.before = Some(seconds);
        self
    }
}

/// A chain, its first cause first.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Explanation {
    /// What is explained.
    pub(crate) about: String,
    /// The links.
    pub(crate) links: Vec<Link>,
}

/// Explains what a robot did at a time of its own clock, or last; `None` where it has nothing to say.
pub(crate) type Explain = fn(&Log, Option<Seconds>) -> Option<Explanation>;

/// All that can be explained.
pub(crate) const EXPLANATIONS: &[Explain] = &[waiting::explain, motion::explain];

/// Everything that is known of that time.
pub(crate) fn explain(log: &Log, at: Option<Seconds>) -> Vec<Explanation> {
    EXPLANATIONS.iter().filter_map(|explain| explain(log, at)).collect()
}
