//! Replaying: one service gets what it had when a recording was made, in virtual time, and its outputs are compared
//! with the recorded ones, bit for bit.
//!
//! A service is a value and time is an argument, so the same inputs in the same order give the same bits. Which inputs
//! it had, in which order, and what its clock showed is in its traces (`run/tracer.rs`); the inputs themselves, and what
//! it said, are recorded as they were. Nothing is judged that the recording does not hold: a trace or a sample that is
//! missing ends the judgement until the next beginning, and the report says so.

mod corrector;
mod functional;
mod log;
mod report;
mod stateful;

pub(crate) use corrector::corrector;
pub(crate) use functional::functional;
pub(crate) use log::{Item, Log};
pub(crate) use report::{Difference, Report};
pub(crate) use stateful::{navigator, source};

use crate::params::load;
use axle_schema::contract::Params;
use axle_schema::trace::Setting;
use std::path::Path;

/// Replays one service from a recording, with other parameters if there are any.
pub(crate) type Replay = fn(&Log, &'static str, Option<&Path>) -> anyhow::Result<Report>;

/// The parameters of a replay: those of a file, or those that the service had.
fn params<P: Params>(setting: &Setting, against: Option<&Path>) -> Result<P, String> {
    if against.is_some() {
        // The file was read before: what is wrong with it was said then.
        return load(against).map_err(|fault| format!("{fault:#}"));
    }
    let params: P = serde_json::from_str(&setting.params)
        .map_err(|fault| format!("its parameters cannot be read by this version: {fault}"))?;
    params.check().map_err(|refusal| format!("its parameters are out of range: {refusal}"))?;
    Ok(params)
}
