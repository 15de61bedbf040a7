//! Why a service did not do what it was asked: the serialised error of Axle.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A typed "no". It travels as the error reply of a query, is counted where there is nobody to answer, and its text
/// says what was wrong, with what value, and what to do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Refusal {
    /// The bytes are not what the key carries.
    #[error("malformed {what}: {why}")]
    Malformed {
        /// Name of the expected message.
        what: String,
        /// The field and the fault.
        why: String,
    },
    /// The message or a list in it is larger than its limit.
    #[error("{what} is too large: {got}, at most {limit}")]
    TooLarge {
        /// What is too large, with its unit.
        what: String,
        /// The size that came.
        got: u64,
        /// The size that is allowed.
        limit: u64,
    },
    /// The encoding names another message than the key carries.
    #[error("wrong type: this key carries {expected}, the sample says it is {got}")]
    WrongType {
        /// The message of the key.
        expected: String,
        /// What the sample's encoding says.
        got: String,
    },
    /// A value is outside its range.
    #[error("{what} is out of range: {got}, allowed is {limit}")]
    OutOfRange {
        /// The quantity.
        what: String,
        /// Its value, as text, since it may be NaN.
        got: String,
        /// The allowed range.
        limit: String,
    },
    /// The request asks for nothing, or lacks what it needs.
    #[error("{what} is missing: {hint}")]
    Missing {
        /// What is missing.
        what: String,
        /// What to do.
        hint: String,
    },
    /// No such name.
    #[error("unknown {what} \"{got}\"; known: {known}")]
    Unknown {
        /// What kind of name.
        what: String,
        /// The name that came.
        got: String,
        /// The names that exist.
        known: String,
    },
    /// The task cannot be done in this world.
    #[error("unreachable: {why}")]
    Unreachable {
        /// Why.
        why: String,
    },
    /// Nobody answered.
    #[error("{what} is unavailable: {hint}")]
    Unavailable {
        /// Who was asked.
        what: String,
        /// What to do.
        hint: String,
    },
    /// Somebody answers, but not within the time allowed.
    #[error("{what} did not answer within {seconds} s")]
    TimedOut {
        /// Who was asked.
        what: String,
        /// How long the asker waited.
        #[serde(
            serialize_with = "crate::unit::finite",
            deserialize_with = "crate::unit::deserialize_finite"
        )]
        seconds: f64,
    },
    /// Somebody else has it.
    #[error("busy: {holder} has it")]
    Busy {
        /// Who has it.
        holder: String,
    },
    /// The drive is not enabled.
    #[error("the drive is disabled: {why}")]
    Disabled {
        /// What disabled it, and how to enable it.
        why: String,
    },
    /// An authority that is no longer valid.
    #[error("fenced: {why}")]
    Fenced {
        /// Which token was refused, and which is valid.
        why: String,
    },
    /// The robot did not do what it was told, or the measurements cannot be believed.
    #[error("failed: {why}")]
    Failed {
        /// What happened.
        why: String,
    },
    /// A fault of Axle itself.
    #[error("internal error: {why}")]
    Internal {
        /// What happened.
        why: String,
    },
}

impl crate::Message for Refusal {
    const NAME: &'static str = "Refusal";
}

impl Refusal {
    /// A value outside its range; NaN and infinities may be given.
    pub fn out_of_range(what: impl Into<String>, got: impl fmt::Display, limit: impl Into<String>) -> Self {
        Self::OutOfRange { what: what.into(), got: got.to_string(), limit: limit.into() }
    }
    /// Bytes that are not the message `what`.
    pub fn malformed(what: impl Into<String>, why: impl fmt::Display) -> Self {
        Self::Malformed { what: what.into(), why: why.to_string() }
    }
    /// Nothing where something is needed.
    pub fn missing(what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Missing { what: what.into(), hint: hint.into() }
    }
    /// Nobody answered.
    pub fn unavailable(what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Unavailable { what: what.into(), hint: hint.into() }
    }
    /// A fault of Axle itself.
    pub fn internal(why: impl fmt::Display) -> Self {
        Self::Internal { why: why.to_string() }
    }
}

/// Refuses `value` unless it is within `low..=high`; NaN is refused.
///
/// # Errors
/// [`Refusal::OutOfRange`] with the name, the value and the range.
pub fn within(what: &str, value: f64, low: f64, high: f64) -> Result<(), Refusal> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        // Numbers with hundreds of digits tell nobody anything.
        let short = |number: f64| {
            if number.abs() < 1e7 { number.to_string() } else { format!("{number:e}") }
        };
        Err(Refusal::out_of_range(what, short(value), format!("{} to {}", short(low), short(high))))
    }
}
