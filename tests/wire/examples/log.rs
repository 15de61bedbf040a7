//! What golden files hold of logs.

use super::Golden;
use axle_schema::log::{LogLevel, LogLine, SetLog};
use std::collections::BTreeMap;

pub(super) fn examples(all: &mut Vec<Golden>) {
    let line = LogLine {
        level: LogLevel::Warn,
        text: "task failed: a wheel does not follow".into(),
        fields: [("task".to_owned(), "4d".to_owned())].into(),
        span: Some("beat".into()),
        dropped: 3,
    };
    let bare = LogLine { fields: BTreeMap::new(), span: None, dropped: 0, ..line.clone() };
    for (name, level) in [
        ("error", LogLevel::Error),
        ("short", LogLevel::Info),
        ("debug", LogLevel::Debug),
        ("trace", LogLevel::Trace),
    ] {
        all.push(Golden::new(name, LogLine { level, ..bare.clone() }));
    }
    all.push(Golden::new("", line));
    all.push(Golden::new("", SetLog { level: "info,axle_mesh=debug".into() }));
}
