//! What processes log, as it travels the mesh: the same lines that stand on their stderr.

use crate::Refusal;
use crate::codec::Message;
use crate::plan::limit_list;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The longest text of a line, in bytes.
pub const MAX_TEXT: usize = 1024;
/// The most fields of a line, and the longest name and value of one, in bytes.
pub const MAX_FIELDS: usize = 16;
/// See [`MAX_FIELDS`].
pub const MAX_FIELD: usize = 128;

/// How much a line matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LogLevel {
    /// Something does not work.
    Error,
    /// Something is not as it should be.
    Warn,
    /// What happens.
    Info,
    /// How it happens.
    Debug,
    /// Every step of it.
    Trace,
}

/// One line of a log. Who says it stands in its key, and when in its attachment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogLine {
    /// How much it matters.
    pub level: LogLevel,
    /// The line.
    pub text: String,
    /// What it is about, those of its beat or query included: `task`, for example.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub fields: BTreeMap<String, String>,
    /// The beat or query in which it was said, and what that is part of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub span: Option<String>,
    /// Lines before this one that came too fast for the mesh and stand on the stderr of the process only.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub dropped: u64,
}
#[allow(clippy::trivially_copy_pass_by_ref, reason = "the shape that serde asks for")]
const fn is_zero(number: &u64) -> bool {
    *number == 0
}

impl Message for LogLine {
    const NAME: &'static str = "LogLine";
    const LIMIT: usize = 8192;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("bytes of a line of a log", self.text.len(), MAX_TEXT)?;
        limit_list("fields of a line of a log", self.fields.len(), MAX_FIELDS)?;
        let span = self.span.as_ref().map_or(0, String::len);
        limit_list("bytes of the span of a line of a log", span, MAX_FIELD)?;
        for (name, value) in &self.fields {
            limit_list("bytes of a field of a line of a log", name.len().max(value.len()), MAX_FIELD)?;
        }
        Ok(())
    }
}

/// Asks a process to log more, or less, until it ends.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetLog {
    /// error, warn, info, debug, trace, off, or per part, as `--log` takes it: `info,axle_mesh=debug`.
    pub level: String,
}
impl Message for SetLog {
    const NAME: &'static str = "SetLog";
    const LIMIT: usize = 512;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("bytes of a level", self.level.len(), 256)
    }
}

/// The beginning of a text, of at most so many bytes, without what a terminal would obey.
#[must_use]
pub fn cut(text: &str, most: usize) -> String {
    let mut short = String::with_capacity(text.len().min(most));
    for c in text.chars().map(|c| if c.is_control() { ' ' } else { c }) {
        if short.len() + c.len_utf8() > most {
            break;
        }
        short.push(c);
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_without_end_is_cut_and_one_that_is_not_is_refused() {
        let long = "ä".repeat(MAX_TEXT);
        let line = |text: String| LogLine {
            level: LogLevel::Warn,
            text,
            fields: BTreeMap::new(),
            span: None,
            dropped: 0,
        };
        assert!(line(long.clone()).check().is_err());
        assert!(line(cut(&long, MAX_TEXT)).check().is_ok());
        assert_eq!(cut("a\u{1b}[31mb\nc", 100), "a [31mb c");
        assert_eq!(cut("äöü", 3), "ä");
        let fields: BTreeMap<_, _> = (0..17).map(|number| (number.to_string(), String::new())).collect();
        assert!(LogLine { fields, ..line(String::new()) }.check().is_err());
        let fields = [("task".to_owned(), "x".repeat(129))].into();
        assert!(LogLine { fields, ..line(String::new()) }.check().is_err());
        assert!(LogLine { span: Some("x".repeat(129)), ..line(String::new()) }.check().is_err());
        assert!(SetLog { level: "x".repeat(257) }.check().is_err());
    }
}
