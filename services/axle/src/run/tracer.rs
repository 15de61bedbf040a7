//! What a service worked from, said beside its outputs: a recording of it can be replayed bit for bit.

use axle_mesh::{Mesh, Publisher};
use axle_schema::contract::Params;
use axle_schema::meta::{Cause, Meta};
use axle_schema::trace::{MAX_NAMED, Named, Setting, Trace};
use axle_schema::{RobotId, Seconds, key};
use std::fmt::Display;

/// After so many traces the setting is said again, for a recorder that came late.
const AGAIN: u64 = 100;

/// What a service was set to.
pub(crate) fn setting<P: Params>(params: &P, period: Option<Seconds>) -> Setting {
    // Parameters are checked numbers and names: JSON can hold them. If not, a replay says what is missing.
    let params = serde_json::to_string(params).unwrap_or_default();
    Setting { params, period, version: env!("CARGO_PKG_VERSION").to_owned() }
}

/// Says traces; one that cannot be said is missed by a replay only.
pub(crate) struct Tracer {
    publisher: Publisher<Trace>,
    setting: Setting,
    said: u64,
    next: Trace,
}

impl Tracer {
    pub(crate) fn new(
        mesh: &Mesh,
        robot: &RobotId,
        service: &'static str,
        setting: Setting,
    ) -> anyhow::Result<Self> {
        let publisher = mesh.publisher(&key::trace(service).of(robot))?;
        Ok(Self { publisher, setting, said: 0, next: Trace::default() })
    }
    /// The service knows something from before it began, which no sample holds.
    pub(crate) fn goes_on(&mut self) {
        self.said = self.said.max(1);
    }
    /// A sample was taken.
    pub(crate) fn took(&mut self, port: impl Display, meta: Option<Meta>) {
        match meta {
            Some(meta) => {
                self.next.took.push(Named::new(port, Cause { source: meta.source, seq: meta.seq }));
            }
            None => self.next.nameless = self.next.nameless.saturating_add(1),
        }
        if self.next.took.len() >= MAX_NAMED {
            self.said(None);
        }
    }
    /// What was taken since the last time has led to this, or to nothing.
    pub(crate) fn said(&mut self, sample: Option<Named>) {
        let trace = std::mem::take(&mut self.next);
        self.say(Trace { first: self.said == 0, said: sample.into_iter().collect(), ..trace });
    }
    /// Says a whole trace.
    pub(crate) fn say(&mut self, mut trace: Trace) {
        if trace.first || self.said.is_multiple_of(AGAIN) {
            trace.setting = Some(self.setting.clone());
        }
        self.said += 1;
        if let Err(refusal) = self.publisher.put(&trace, None) {
            tracing::debug!("a trace could not be said: {refusal}");
        }
    }
}
