//! A corrector, replayed: the same tasks, the same beats, the same windows and poses before it; the same commands.

use super::log::Traced;
use super::{Log, Report, params};
use crate::run::corrector::{Driven, progress};
use axle_correctors::tenure::command;
use axle_schema::command::{Command, Lease};
use axle_schema::contract::{Seen, Step};
use axle_schema::task::{CorrectorProgress, Phase, Task};
use axle_schema::trace::{Named, Setting, Trace};
use axle_schema::window::Window;
use axle_schema::{NavigatorData, Seconds, TaskId, key};
use std::path::Path;

/// A task that is driven again.
struct Running<C> {
    id: TaskId,
    corrector: C,
    period: Seconds,
}

/// Drives every task of a corrector again.
///
/// # Errors
/// Never; what cannot be judged is in the report.
pub(crate) fn corrector<C: Driven>(
    log: &Log,
    service: &'static str,
    against: Option<&Path>,
) -> anyhow::Result<Report> {
    let mut report = Report::default();
    let mut running: Option<Running<C>> = None;
    let mut lost = "the recording begins in the middle of a task";
    for Traced { trace, follows, time } in log.traces(service) {
        let seen = match seen(log, &trace) {
            Ok(seen) => seen,
            Err(why) => {
                running = None;
                report.skip(why);
                lost = "an earlier beat of the task cannot be repeated";
                continue;
            }
        };
        if trace.first {
            running = match begin::<C>(log, service, &trace, &seen, against) {
                Ok(begun) => Some(begun),
                Err(why) => {
                    report.skip(why);
                    lost = "the beginning of the task cannot be repeated";
                    continue;
                }
            };
        } else if !follows && running.take().is_some() {
            lost = "an earlier beat of the task was not recorded";
        }
        let Some(Running { id, corrector, period }) =
            running.as_mut().filter(|running| Some(running.id) == trace.task)
        else {
            report.skip(lost);
            continue;
        };
        if let Some(pause) = trace.resumed {
            corrector.resume(&seen, pause);
        }
        let step = corrector.step(&seen);
        let account = corrector.account();
        let phase = match &step {
            Step::Drive(_) => Phase::Running,
            Step::Done => Phase::Done,
            Step::Fail(refusal) => Phase::Failed(refusal.clone()),
        };
        let stream = key::corrector_progress(service).port().to_string();
        let now: CorrectorProgress = progress(*id, phase, account);
        compare(&mut report, log, &trace, time, &stream, Some(&now));
        let stream = key::COMMAND.port().to_string();
        let recorded = said(&trace, &stream).and_then(|named| log.find(named));
        // The lease is the gate's word, not the corrector's: it is taken from the recorded command.
        let lease = recorded.and_then(|item| item.read::<Command>().ok());
        let now = match (&step, lease) {
            (Step::Drive(dwm), Some(Command { boot, epoch, seq, echo, .. })) => {
                let lease = Lease { boot, epoch, tick: echo, silence_stop: Seconds::ZERO };
                Some(command(&lease, seq, *period, &seen, *dwm))
            }
            _ => None,
        };
        match (&step, said(&trace, &stream)) {
            (Step::Drive(_), None) => report.compare_words(time, &stream, "no command", "a command"),
            (Step::Drive(_), Some(_)) | (_, None) => {
                compare(&mut report, log, &trace, time, &stream, now.as_ref());
            }
            (_, Some(_)) => report.compare_words(time, &stream, "a command", "no command"),
        }
        if !matches!(step, Step::Drive(_)) {
            running = None;
            lost = "the replay had ended the task before";
        }
    }
    Ok(report)
}

/// The corrector at the beginning of its task.
fn begin<C: Driven>(
    log: &Log,
    service: &'static str,
    trace: &Trace,
    seen: &Seen,
    against: Option<&Path>,
) -> Result<Running<C>, String> {
    let setting: &Setting = trace.setting.as_ref().ok_or("a task begins without its parameters")?;
    let params: C::Params = params(setting, against)?;
    let id = trace.task.ok_or("a trace names no task")?;
    let orders = log.stream(&C::orders(service).port().to_string());
    let order = orders
        .iter()
        .filter_map(|item| item.read::<C::Order>().ok())
        .map(Into::into)
        .find(|order: &Task<C::Plan>| order.id == id)
        .ok_or("the order of a task was not recorded")?;
    let period = setting.period.unwrap_or_else(|| C::period(&params));
    let corrector = C::begin(&params, period, order, seen)
        .map_err(|refusal| format!("the corrector refuses a task that it took: {refusal}"))?;
    Ok(Running { id, corrector, period })
}

/// What the corrector had before it.
fn seen(log: &Log, trace: &Trace) -> Result<Seen, String> {
    if trace.nameless > 0 {
        return Err("a measurement came without an attachment, and cannot be found".into());
    }
    let mut seen = Seen { at: trace.at.ok_or("a trace has no time")?, ..Seen::default() };
    for named in &trace.took {
        let missing = || format!("a sample of {} was not recorded", named.port);
        let item = log.find(named).ok_or_else(missing)?;
        if named.port == key::RECENT.port().to_string() {
            let window: Window = item.read().map_err(|refusal| refusal.to_string())?;
            seen.encoders = window.encoders.last().copied().or(seen.encoders);
            seen.inertial = window.inertial.last().copied().or(seen.inertial);
        } else {
            seen.pose = Some(item.read::<NavigatorData>().map_err(|refusal| refusal.to_string())?);
        }
    }
    Ok(seen)
}

fn said<'a>(trace: &'a Trace, stream: &str) -> Option<&'a Named> {
    trace.said.iter().find(|named| named.port == stream)
}

/// Compares what was said on a stream with what is said now.
fn compare<M: axle_schema::Message>(
    report: &mut Report,
    log: &Log,
    trace: &Trace,
    time: f64,
    stream: &str,
    now: Option<&M>,
) {
    let Some(named) = said(trace, stream) else { return };
    match (log.find(named), now) {
        (Some(item), Some(now)) => report.compare(time, stream, &item.payload, now),
        _ => report.skip(format!("an output on {stream} was not recorded")),
    }
}
