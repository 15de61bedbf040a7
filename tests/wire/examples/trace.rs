//! What golden files hold of what services worked from.

use super::{Golden, drive, plan, way};
use axle_schema::meta::Cause;
use axle_schema::trace::{Answered, Named, Setting, Trace};
use axle_schema::{Boot, DriveAsk, PlanAsk, Refusal, Seconds, TaskId};

pub(super) fn examples(all: &mut Vec<Golden>) {
    let named = |port: &str, seq| Named::new(port, Cause { source: Boot(7), seq });
    let setting = |params: &str, period| Setting { params: params.into(), period, version: "0.1.0".into() };
    all.push(Golden::new(
        "",
        Trace {
            first: true,
            resumed: None,
            setting: Some(setting("{\"beat\":0.05}", Some(Seconds(0.05)))),
            at: Some(Seconds(12.5)),
            task: Some(TaskId(3)),
            took: vec![named("source/recent", 41), named("navigator/pose", 40)],
            nameless: 0,
            said: vec![named("d-corrector/progress", 5), named("gate/command", 6)],
        },
    ));
    all.push(Golden::new(
        "resumed",
        Trace {
            resumed: Some(Seconds(0.1)),
            at: Some(Seconds(13.0)),
            task: Some(TaskId(3)),
            ..Trace::default()
        },
    ));
    all.push(Golden::new("short", Trace { took: vec![named("robot/encoders", 9)], ..Trace::default() }));
    all.push(Golden::new(
        "",
        Answered {
            ask: PlanAsk { way: way(), ..PlanAsk::default() },
            answer: Some(plan()),
            refusal: None,
            setting: setting("{}", None),
        },
    ));
    all.push(Golden::new(
        "",
        Answered {
            ask: DriveAsk { legs: plan().legs, ..DriveAsk::default() },
            answer: Some(drive()),
            refusal: None,
            setting: setting("{}", None),
        },
    ));
    all.push(Golden::new(
        "refused",
        Answered::<DriveAsk, axle_schema::Drive> {
            ask: DriveAsk { legs: plan().legs, ..DriveAsk::default() },
            answer: None,
            refusal: Some(Refusal::Unreachable { why: "a wall".into() }),
            setting: setting("{}", None),
        },
    ));
}
