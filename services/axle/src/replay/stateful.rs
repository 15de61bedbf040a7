//! Source and navigator, replayed: what they took, in its order; what they said.

use super::log::Traced;
use super::{Log, Report, params};
use axle_navigator::{Navigator, NavigatorParams};
use axle_schema::contract::Params;
use axle_schema::meta::Meta;
use axle_schema::trace::{Named, Setting};
use axle_schema::{Message, Refusal, key};
use axle_source::{Source, SourceParams};
use std::path::Path;

/// A service that lives as long as its process, as a value.
trait Lives: Sized {
    type Params: Params;
    type Said: Message;
    fn begin(params: Self::Params) -> Result<Self, Refusal>;
    /// Takes a sample of the stream `port`.
    fn take(&mut self, port: &str, meta: Option<Meta>, item: &super::Item) -> Result<(), Refusal>;
    /// What it says now.
    fn says(&mut self) -> Option<Self::Said>;
}

struct Sourcing {
    source: Source,
    params: SourceParams,
}
impl Lives for Sourcing {
    type Params = SourceParams;
    type Said = axle_schema::window::Window;
    fn begin(params: SourceParams) -> Result<Self, Refusal> {
        Ok(Self { source: Source::new(&params)?, params })
    }
    fn take(&mut self, port: &str, meta: Option<Meta>, item: &super::Item) -> Result<(), Refusal> {
        if port == key::ENCODERS.port().to_string() {
            self.source.take_encoders(meta, item.read()?);
        } else if port == key::INERTIAL.port().to_string() {
            self.source.take_inertial(meta, item.read()?);
        } else if port == key::RANGE.port().to_string() {
            self.source.take_range(meta, item.read()?);
        } else {
            self.source.take_fix(meta, item.read()?);
        }
        Ok(())
    }
    fn says(&mut self) -> Option<Self::Said> {
        Some(self.source.recent(self.params.recent))
    }
}

struct Navigating {
    navigator: Navigator,
    newest: Option<axle_schema::NavigatorData>,
}
impl Lives for Navigating {
    type Params = NavigatorParams;
    type Said = axle_schema::NavigatorData;
    fn begin(params: NavigatorParams) -> Result<Self, Refusal> {
        Ok(Self { navigator: Navigator::new(params)?, newest: None })
    }
    fn take(&mut self, _: &str, _: Option<Meta>, item: &super::Item) -> Result<(), Refusal> {
        self.newest = self.navigator.hear(&item.read()?);
        drop((self.navigator.events(), self.navigator.innovations()));
        Ok(())
    }
    fn says(&mut self) -> Option<Self::Said> {
        self.newest.take()
    }
}

/// Buffers everything again.
///
/// # Errors
/// Never; what cannot be judged is in the report.
pub(crate) fn source(log: &Log, service: &'static str, against: Option<&Path>) -> anyhow::Result<Report> {
    Ok(live::<Sourcing>(log, service, against))
}

/// Integrates everything again.
///
/// # Errors
/// Never; what cannot be judged is in the report.
pub(crate) fn navigator(log: &Log, service: &'static str, against: Option<&Path>) -> anyhow::Result<Report> {
    Ok(live::<Navigating>(log, service, against))
}

fn live<L: Lives>(log: &Log, service: &'static str, against: Option<&Path>) -> Report {
    let mut report = Report::default();
    let mut living: Option<L> = None;
    let mut lost = "the recording begins after the service";
    for Traced { trace, follows, time } in log.traces(service) {
        if trace.first {
            living = match begin::<L>(trace.setting.as_ref(), against) {
                Ok(begun) => Some(begun),
                Err(why) => {
                    report.skip(why);
                    continue;
                }
            };
        } else if !follows && living.take().is_some() {
            lost = "an earlier trace of the service was not recorded";
        }
        let Some(value) = &mut living else {
            report.skip(lost);
            continue;
        };
        if let Err(why) = feed(value, log, &trace.took, trace.nameless) {
            report.skip(why);
            living = None;
            lost = "an earlier input of the service is missing";
            continue;
        }
        let said = trace.said.first();
        match (value.says(), said.map(|named| (named, log.find(named)))) {
            (Some(now), Some((named, Some(item)))) => {
                report.compare(time, &named.port, &item.payload, &now);
            }
            (None, Some((named, Some(_)))) => {
                report.compare_words(time, &named.port, "a sample", "nothing");
            }
            (_, Some((named, None))) => {
                report.skip(format!("an output on {} was not recorded", named.port));
            }
            (Some(_), None) if trace.took.len() < axle_schema::trace::MAX_NAMED => {
                report.compare_words(time, service, "nothing", "a sample");
            }
            (_, None) => {}
        }
    }
    report
}

fn begin<L: Lives>(setting: Option<&Setting>, against: Option<&Path>) -> Result<L, String> {
    let params = params(setting.ok_or("the service begins without its parameters")?, against)?;
    L::begin(params).map_err(|refusal| refusal.to_string())
}

fn feed<L: Lives>(value: &mut L, log: &Log, took: &[Named], nameless: u32) -> Result<(), String> {
    if nameless > 0 {
        return Err("a measurement came without an attachment, and cannot be found".into());
    }
    for named in took {
        let missing = || format!("a sample of {} was not recorded", named.port);
        let item = log.find(named).ok_or_else(missing)?;
        value.take(&named.port, item.meta, item).map_err(|refusal| refusal.to_string())?;
    }
    Ok(())
}
