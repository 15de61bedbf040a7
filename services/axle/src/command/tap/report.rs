//! Rates, bandwidths and ages of streams, once a second.

use crate::cli::Tap;
use crate::out::data;
use axle_mesh::Raw;
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::time::{Instant, sleep_until};

/// What is reported.
#[derive(Clone, Copy, PartialEq, Eq)]
enum What {
    Nothing,
    Rate,
    Bandwidth,
    Age,
}

/// What was heard of a stream in the last second.
#[derive(Default)]
struct Heard {
    count: u64,
    bytes: u64,
    /// Seconds from the sender's stamp to the arrival, by two clocks.
    ages: Vec<f64>,
}

/// The most ages of one second that are looked at.
const MOST: usize = 10_000;

pub(super) struct Report {
    what: What,
    json: bool,
    since: Instant,
    streams: BTreeMap<String, Heard>,
}

impl Report {
    pub(super) fn new(args: &Tap) -> Self {
        let what = match (args.hz, args.bw, args.age) {
            (true, ..) => What::Rate,
            (_, true, _) => What::Bandwidth,
            (.., true) => What::Age,
            _ => What::Nothing,
        };
        Self { what, json: args.json, since: Instant::now(), streams: BTreeMap::new() }
    }
    pub(super) fn is_on(&self) -> bool {
        self.what != What::Nothing
    }
    pub(super) fn count(&mut self, raw: &Raw) {
        let stream = self.streams.entry(raw.key.clone()).or_default();
        stream.count += 1;
        stream.bytes += raw.payload.len() as u64;
        if self.what == What::Age
            && stream.ages.len() < MOST
            && let Some(meta) = raw.meta()
        {
            #[allow(clippy::cast_precision_loss, reason = "a float holds the microseconds since 1970")]
            stream.ages.push(raw.received as f64 / 1e9 - meta.stamp);
        }
    }
    pub(super) async fn due(&self) {
        if self.is_on() {
            sleep_until(self.since + Duration::from_secs(1)).await;
        } else {
            std::future::pending().await
        }
    }
    #[allow(clippy::cast_precision_loss, reason = "rates for people")]
    pub(super) fn print(&mut self) -> anyhow::Result<()> {
        let seconds = self.since.elapsed().as_secs_f64().max(1e-3);
        for (key, heard) in &self.streams {
            let (hz, bytes) = (heard.count as f64 / seconds, heard.bytes as f64 / seconds);
            let age = Age::of(&heard.ages);
            if self.json {
                let mut line = serde_json::json!({ "key": key, "hz": hz, "bytes_per_second": bytes });
                if self.what == What::Age {
                    line["age_s"] = age.map(|age| age.middle).into();
                    line["uncertainty_s"] = age.map(|age| age.uncertainty).into();
                }
                data(&line.to_string())?;
                continue;
            }
            data(&match (self.what, age) {
                (What::Rate | What::Nothing, _) => format!("{key} {hz:.1} Hz"),
                (What::Bandwidth, _) => format!("{key} {:.2} kB/s", bytes / 1000.0),
                (What::Age, Some(age)) => format!("{key} {}", age.words()),
                (What::Age, None) => format!("{key} of unknown age: its sender says no time"),
            })?;
        }
        self.since = Instant::now();
        self.streams.values_mut().for_each(|stream| *stream = Heard::default());
        Ok(())
    }
}

/// The age of the samples of one second.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Age {
    middle: f64,
    uncertainty: f64,
    /// By so much at least the clocks of sender and listener differ.
    skew: f64,
}

impl Age {
    /// The median; uncertain by the spread of the ages, and by what the clocks are known to differ: no sample arrives
    /// before it was sent.
    fn of(ages: &[f64]) -> Option<Self> {
        let mut ages: Vec<f64> = ages.iter().copied().filter(|age| age.is_finite()).collect();
        ages.sort_by(f64::total_cmp);
        let (first, last) = (*ages.first()?, *ages.last()?);
        let skew = (-first).max(0.0);
        let middle = ages.get(ages.len() / 2)?.max(0.0);
        Some(Self { middle, uncertainty: (last - first) / 2.0 + skew, skew })
    }
    fn words(self) -> String {
        let skew = if self.skew > 0.0 {
            format!(" (the clocks differ by {:.1} ms at least)", self.skew * 1e3)
        } else {
            String::new()
        };
        format!("{:.1} ms old ± {:.1} ms{skew}", self.middle * 1e3, self.uncertainty * 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_age_is_as_uncertain_as_it_spreads_and_clocks_differ() {
        let age = Age::of(&[0.003, 0.001, 0.002]).expect("an age");
        assert!((age.middle - 0.002).abs() < 1e-12 && (age.uncertainty - 0.001).abs() < 1e-12);
        assert!(age.words().starts_with("2.0 ms old ± 1.0 ms") && !age.words().contains("clocks"));
        let age = Age::of(&[-0.5, -0.5]).expect("an age");
        assert!(age.middle == 0.0 && age.words().contains("differ by 500.0 ms"), "{}", age.words());
        assert_eq!(Age::of(&[f64::NAN]), None);
    }
}
