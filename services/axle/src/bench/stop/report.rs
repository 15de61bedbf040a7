//! What all injections come to.

use super::injection::{Fault, Injected, Stopped};
use crate::bench::quantile;
use crate::out::{data, table};
use std::time::Duration;

/// The oldest echo that the gates of the bench accept, and one reading of the encoders, in ms: what is older was stale.
const OLDEST: f64 = 250.0 + 20.0;

pub(super) struct Report {
    kinds: [usize; 3],
    brake: Times,
    standstill: Times,
    /// From an AllStop to the setpoint that brakes, and to the word of it.
    all_stop: [Times; 2],
    /// The oldest command that was obeyed, and how many were too old, by the robot's clock.
    oldest_ms: f64,
    stale: usize,
    obeyed: usize,
    /// Commands that were obeyed and not heard by the bench, so that nothing is known of their age.
    unjudged: usize,
    /// Injections after which the wheels went on, or did not come to rest.
    missed: usize,
    gate_us: f64,
}

/// Times in milliseconds, sorted.
struct Times(Vec<f64>);

impl Times {
    fn of(times: impl Iterator<Item = Duration>) -> Self {
        let mut times: Vec<f64> = times.map(|time| time.as_secs_f64() * 1e3).collect();
        times.sort_by(f64::total_cmp);
        Self(times)
    }
    fn at(&self, share: f64) -> f64 {
        quantile(&self.0, share)
    }
    fn to_json(&self) -> serde_json::Value {
        serde_json::json!({ "p50": self.at(0.5), "p99": self.at(0.99), "max": self.at(1.0) })
    }
    fn row(&self, name: &str) -> Vec<String> {
        let figures = [0.5, 0.99, 1.0].map(|share| format!("{:.1} ms", self.at(share)));
        [name.to_owned(), self.0.len().to_string()].into_iter().chain(figures).collect()
    }
}

impl Report {
    pub(super) fn of(injected: &[Injected], gate_us: f64) -> Self {
        let count = |is: fn(&Fault) -> bool| injected.iter().filter(|one| is(&one.fault)).count();
        let ages = || injected.iter().flat_map(|one| one.ages.iter().copied());
        let noticed = || injected.iter().filter(|one| !one.may_go_on);
        let stops = || injected.iter().filter_map(|one| one.all_stop);
        let all_stop = |time: fn(Stopped) -> Duration| Times::of(stops().map(time));
        Self {
            kinds: [
                count(|fault| matches!(fault, Fault::Kill)),
                count(|fault| matches!(fault, Fault::Freeze(_))),
                count(|fault| matches!(fault, Fault::Cut(_))),
            ],
            brake: Times::of(noticed().filter_map(|one| one.brake)),
            standstill: Times::of(noticed().filter_map(|one| one.standstill)),
            all_stop: [all_stop(|stopped| stopped.braking), all_stop(|stopped| stopped.heard)],
            oldest_ms: ages().fold(0.0, f64::max),
            stale: ages().filter(|age| *age > OLDEST).count(),
            obeyed: ages().count(),
            unjudged: injected.iter().map(|one| one.unjudged).sum(),
            missed: noticed().filter(|one| one.brake.is_none() || one.standstill.is_none()).count(),
            gate_us,
        }
    }

    pub(super) fn print(&self, json: bool) -> anyhow::Result<()> {
        let [kills, freezes, cuts] = self.kinds;
        if json {
            let line = serde_json::json!({
                "injections": kills + freezes + cuts, "kills": kills, "freezes": freezes, "cuts": cuts,
                "brake_ms": self.brake.to_json(), "standstill_ms": self.standstill.to_json(),
                "all_stop_ms": self.all_stop[0].to_json(), "all_stop_heard_ms": self.all_stop[1].to_json(),
                "stale_applied": self.stale, "missed": self.missed, "commands_judged": self.obeyed,
                "commands_unjudged": self.unjudged, "oldest_applied_ms": self.oldest_ms,
                "gate_command_us": self.gate_us,
            });
            data(&line.to_string())?;
        } else {
            let rows = [
                self.brake.row("from a fault to braking"),
                self.standstill.row("from braking to standstill"),
                self.all_stop[0].row("from an AllStop to braking"),
                self.all_stop[1].row("until the word of that is back"),
            ];
            table(&["", "times", "p50", "p99", "max"], rows)?;
            data(&format!(
                "{kills} kills, {freezes} freezes, {cuts} cuts: {} missed; of {} commands that were obeyed {} were too old, \
                 the oldest was {:.0} ms old, {} more could not be judged; the gate costs a command {:.1} µs",
                self.missed, self.obeyed, self.stale, self.oldest_ms, self.unjudged, self.gate_us
            ))?;
        }
        anyhow::ensure!(
            self.missed == 0 && self.stale == 0,
            "the gate missed {} faults and obeyed {} commands that were too old",
            self.missed,
            self.stale
        );
        Ok(())
    }
}
