//! How well a demonstration went: numbers, table, chart.

use super::{Driven, Files};
use crate::chart::{self, PathSeries, WheelPoint, Wheels};
use crate::cli::Demo;
use crate::out::{data, note, table};
use crate::path::{cross_track, of_plan};
use anyhow::Context as _;
use axle_schema::presence::Status;
use axle_schema::task::{CorrectorProgress, Phase, PilotProgress};
use axle_schema::{Metres, NavigatorData, Seconds, Sides};
use std::path::PathBuf;

/// The robot got there when it stands within this distance of the last way point, by the emulator's truth.
const ARRIVED: Metres = Metres(0.03);

/// The result of a demonstration.
pub(crate) struct Account {
    end: PilotProgress,
    seed: u64,
    final_error: Metres,
    cross_track: (Metres, Metres),
    statuses: Vec<Status>,
    processes: Vec<(String, Option<u32>)>,
    chart: PathBuf,
    recording: PathBuf,
}

/// Due and real distances of the wheels at each beat that knew them.
fn wheels(beats: &[CorrectorProgress]) -> Wheels {
    let pick = |side: fn(&CorrectorProgress) -> Option<Sides<Metres>>| {
        beats
            .iter()
            .filter_map(|beat| {
                let Sides { left, right } = side(beat)?;
                Some(WheelPoint { time: beat.elapsed.0, left: left.0, right: right.0 })
            })
            .collect()
    };
    Wheels { due: pick(|beat| beat.due), real: pick(|beat| beat.real) }
}

impl Account {
    /// Measures and draws.
    pub(crate) fn of(args: &Demo, files: &Files, driven: Driven) -> anyhow::Result<Self> {
        let Driven { end, seen, statuses, processes } = driven;
        let plan = seen.plan.as_ref().context("the plan of the task was not heard")?;
        let last = args.way.points.last().context("the way has no point")?;
        let truth = seen.truth.last().context("the emulator's truth was not heard")?;
        let positions = |list: &[NavigatorData]| -> Vec<(f64, f64)> {
            list.iter().map(|data| (data.pose.x.0, data.pose.y.0)).collect()
        };
        let (planned, driven) = (of_plan(plan), positions(&seen.truth));
        let paths = [
            PathSeries::planned(planned.clone()),
            PathSeries::driven(driven.clone()),
            PathSeries::estimated(positions(&seen.poses)),
        ];
        let points: Vec<_> = args.way.points.iter().map(|point| (point.x.0, point.y.0)).collect();
        let title = format!("{} points by {}, seed {}", points.len(), end.corrector, args.seed);
        let svg = chart::demo_chart(&title, &paths, &points, &wheels(&seen.beats))?;
        std::fs::write(&files.chart, svg).with_context(|| format!("write {}", files.chart.display()))?;
        Ok(Self {
            seed: args.seed,
            final_error: last.distance(truth.pose),
            cross_track: cross_track(&planned, &driven),
            end,
            statuses,
            processes,
            chart: files.chart.clone(),
            recording: files.recording.clone(),
        })
    }

    /// Whether the robot got there: the pilot says so, and the truth agrees.
    fn reached(&self) -> bool {
        self.end.phase == Phase::Done && self.final_error <= ARRIVED
    }

    /// Fails unless the robot got there.
    pub(crate) fn verdict(&self) -> anyhow::Result<()> {
        match &self.end.phase {
            Phase::Failed(refusal) => anyhow::bail!("not reached: {refusal}"),
            Phase::Done if !self.reached() => anyhow::bail!(
                "not reached: the robot stands {:.1} cm from the last way point, allowed are {:.0} cm",
                self.final_error.0 * 100.0,
                ARRIVED.0 * 100.0
            ),
            Phase::Done => Ok(()),
            other => anyhow::bail!("not reached: {other:?}"),
        }
    }

    fn late_beats(&self) -> u64 {
        self.statuses.iter().map(|status| status.late).sum()
    }
    fn late_p99(&self) -> Seconds {
        self.statuses
            .iter()
            .filter(|status| status.beats > 0)
            .map(|status| status.late_p99)
            .fold(Seconds::ZERO, Seconds::max)
    }

    /// Prints the table, or the JSON object.
    pub(crate) fn report(&self, json: bool) -> anyhow::Result<()> {
        if json {
            return Ok(data(&self.to_json().to_string())?);
        }
        let cm = |length: Metres| format!("{:.1} cm", length.0 * 100.0);
        let beats: u64 = self.statuses.iter().map(|status| status.beats).sum();
        let rows = [
            ("reached", if self.reached() { "yes" } else { "no" }.to_owned()),
            ("way points reached", format!("{} of {}", self.end.reached, self.end.points)),
            ("final position error (truth)", cm(self.final_error)),
            ("cross-track error, RMS (truth)", cm(self.cross_track.0)),
            ("cross-track error, largest (truth)", cm(self.cross_track.1)),
            ("duration", format!("{:.1} s", self.end.elapsed.0)),
            ("late beats (over 5 ms)", format!("{} of {beats}", self.late_beats())),
            ("lateness of beats, p99 of the worst service", format!("{:.1} ms", self.late_p99().0 * 1e3)),
        ];
        table(&["result", ""], rows.map(|(name, value)| vec![name.to_owned(), value]))?;
        let services = self.statuses.iter().map(|status| {
            let p99 =
                if status.beats > 0 { format!("{:.1} ms", status.late_p99.0 * 1e3) } else { "-".into() };
            let counts = [status.sent, status.received, status.refused, status.beats, status.late];
            let mut row = vec![status.service.clone(), status.pid.to_string()];
            row.extend(counts.map(|count| count.to_string()));
            row.push(p99);
            row
        });
        table(&["service", "pid", "sent", "received", "refused", "beats", "late", "late p99"], services)?;
        note(&format!("chart      {}", self.chart.display()));
        note(&format!("recording  {}", self.recording.display()));
        Ok(())
    }

    fn to_json(&self) -> serde_json::Value {
        let processes: Vec<_> = self
            .processes
            .iter()
            .map(|(service, pid)| serde_json::json!({ "service": service, "pid": pid }))
            .collect();
        let messages: serde_json::Map<_, _> = self
            .statuses
            .iter()
            .map(|status| {
                let counts = serde_json::json!({ "sent": status.sent, "received": status.received, "refused": status.refused });
                (status.service.clone(), counts)
            })
            .collect();
        serde_json::json!({
            "reached": self.reached(),
            "points_reached": self.end.reached,
            "points": self.end.points,
            "final_error_m": self.final_error,
            "cross_track_rms_m": self.cross_track.0,
            "cross_track_max_m": self.cross_track.1,
            "duration_s": self.end.elapsed,
            "phase": self.end.phase,
            "late_beats": self.late_beats(),
            "late_p99_s": self.late_p99(),
            "seed": self.seed,
            "messages": messages,
            "processes": processes,
            "chart": self.chart,
            "recording": self.recording,
        })
    }
}
