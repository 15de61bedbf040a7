//! What `axle top` knows, and the lines that it shows of it.

use super::Everybody;
use axle_mesh::Raw;
use axle_schema::command::GateState;
use axle_schema::key::{self, Presence};
use axle_schema::presence::Status;
use axle_schema::{Boot, RobotId, decode};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use tokio::time::Instant;

/// Streams and robots that are remembered.
const MOST: usize = 4096;

/// How a line looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mood {
    Plain,
    Head,
    Chosen,
    Faint,
}

/// A line of the screen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Line {
    pub(super) text: String,
    pub(super) mood: Mood,
}

fn line(mood: Mood, text: impl Into<String>) -> Line {
    Line { text: text.into(), mood }
}

/// A process, now and when it was looked at before.
struct Row {
    presence: Presence,
    status: Option<Status>,
    before: Option<Status>,
    /// Between the two.
    seconds: f64,
}

impl Row {
    /// So many more of it each second.
    #[allow(clippy::cast_precision_loss, reason = "rates for people")]
    fn rate(&self, count: impl Fn(&Status) -> u64) -> Option<f64> {
        let (now, before) = (self.status.as_ref()?, self.before.as_ref()?);
        Some(count(now).saturating_sub(count(before)) as f64 / self.seconds.max(0.1))
    }
}

#[derive(Default)]
struct Stream {
    count: u64,
    bytes: u64,
    hz: f64,
    rate: f64,
}

pub(super) struct Board {
    only: Option<RobotId>,
    rows: Vec<Row>,
    streams: BTreeMap<String, Stream>,
    gates: BTreeMap<String, GateState>,
    chosen: usize,
    looks_inside: bool,
    word: String,
    looked: Option<Instant>,
}

impl Board {
    pub(super) const fn new(only: Option<RobotId>) -> Self {
        Self {
            only,
            rows: Vec::new(),
            streams: BTreeMap::new(),
            gates: BTreeMap::new(),
            chosen: 0,
            looks_inside: false,
            word: String::new(),
            looked: None,
        }
    }

    /// Counts a sample, and reads it if a gate said it.
    pub(super) fn count(&mut self, raw: &Raw) {
        if self.streams.len() < MOST || self.streams.contains_key(&raw.key) {
            let stream = self.streams.entry(raw.key.clone()).or_default();
            stream.count += 1;
            stream.bytes += raw.payload.len() as u64;
        }
        if let Some(place) = key::place(&raw.key)
            && (place.service, place.name) == ("gate", "state")
            && (self.gates.len() < MOST || self.gates.contains_key(place.robot))
            && let Ok(state) = decode::<GateState>(&raw.payload)
        {
            self.gates.insert(place.robot.to_owned(), state);
        }
    }

    /// Takes what everybody says of itself.
    #[allow(clippy::cast_precision_loss, reason = "rates for people")]
    pub(super) fn hear(&mut self, mut everybody: Everybody, now: Instant) {
        let seconds = self.looked.map_or(0.0, |looked| (now - looked).as_secs_f64());
        self.looked = Some(now);
        if let Some(only) = &self.only {
            everybody.retain(|(presence, _)| presence.robot == only.as_str());
        }
        let place = |presence: &Presence| (presence.robot.clone(), presence.service.clone(), presence.pid);
        everybody.sort_by_key(|(presence, _)| place(presence));
        let chosen = self.rows.get(self.chosen).map(|row| row.presence.boot);
        let mut before: BTreeMap<Boot, Status> = std::mem::take(&mut self.rows)
            .into_iter()
            .filter_map(|row| Some((row.presence.boot, row.status?)))
            .collect();
        let row = |(presence, status): (Presence, Option<Status>)| {
            let before = before.remove(&presence.boot);
            Row { presence, status, before, seconds }
        };
        self.rows = everybody.into_iter().map(row).collect();
        let again = self.rows.iter().position(|row| Some(row.presence.boot) == chosen);
        self.chosen = again.unwrap_or(self.chosen).min(self.rows.len().saturating_sub(1));
        for stream in self.streams.values_mut() {
            if seconds > 0.0 {
                stream.hz = stream.count as f64 / seconds;
                stream.rate = stream.bytes as f64 / seconds;
            }
            (stream.count, stream.bytes) = (0, 0);
        }
    }

    pub(super) fn say(&mut self, word: String) {
        self.word = word;
    }
    pub(super) fn select(&mut self, by: isize) {
        let last = self.rows.len().saturating_sub(1);
        self.chosen = self.chosen.saturating_add_signed(by).min(last);
    }
    pub(super) const fn inspect(&mut self) {
        self.looks_inside = !self.looks_inside;
    }
    /// The robot of the chosen line, or the only one.
    pub(super) fn robot(&self) -> Option<RobotId> {
        let chosen = self.rows.get(self.chosen).and_then(|row| RobotId::new(&row.presence.robot).ok());
        let mut gates = self.gates.keys();
        let only =
            || gates.next().filter(|_| self.gates.len() == 1).and_then(|robot| RobotId::new(robot).ok());
        chosen.or_else(only)
    }

    /// The whole screen.
    pub(super) fn lines(&self) -> Vec<Line> {
        let mut lines = vec![line(
            Mood::Head,
            format!("axle top: {} processes, {} streams", self.rows.len(), self.streams.len()),
        )];
        for (robot, state) in &self.gates {
            lines.push(line(Mood::Plain, gate(robot, state)));
        }
        if self.gates.is_empty() {
            lines.push(line(Mood::Faint, "no gate has spoken yet"));
        }
        lines.push(line(Mood::Plain, ""));
        lines.push(line(
            Mood::Head,
            columns(&[
                "service", "robot", "host", "pid", "up", "beats", "late", "p99", "sent", "received",
                "refused",
            ]),
        ));
        for (index, row) in self.rows.iter().enumerate() {
            let mood = match (index == self.chosen, &row.status) {
                (true, _) => Mood::Chosen,
                (false, None) => Mood::Faint,
                (false, Some(_)) => Mood::Plain,
            };
            lines.push(line(mood, service(row)));
        }
        if self.looks_inside
            && let Some(row) = self.rows.get(self.chosen)
        {
            lines.push(line(Mood::Plain, ""));
            lines.extend(self.inside(row));
        }
        lines.push(line(Mood::Plain, ""));
        lines.push(line(Mood::Plain, self.word.clone()));
        lines.push(line(
            Mood::Faint,
            "up, down: choose   i: look inside   s: STOP its robot   e: enable it   q: quit",
        ));
        lines
    }

    /// What a service says and hears, and how often.
    fn inside(&self, row: &Row) -> Vec<Line> {
        let Some(status) = &row.status else {
            return vec![line(Mood::Faint, "it is alive, but does not answer")];
        };
        let flow = |key: &String| match self.streams.get(key) {
            Some(stream) => format!("{:.1} Hz, {:.2} kB/s", stream.hz, stream.rate / 1e3),
            None => "silent, or a call".to_owned(),
        };
        let title = format!("{} {} on {}, run {}", status.service, status.version, status.host, status.boot);
        let says = status.says.iter().map(|key| line(Mood::Plain, format!("  says   {key}  {}", flow(key))));
        let hears =
            status.hears.iter().map(|key| line(Mood::Plain, format!("  hears  {key}  {}", flow(key))));
        [line(Mood::Head, title)].into_iter().chain(says).chain(hears).collect()
    }

    /// The same for programs.
    pub(super) fn json(&self) -> Value {
        let services = self.rows.iter().map(|row| {
            json!({
                "service": row.presence.service, "robot": row.presence.robot, "host": row.presence.host,
                "pid": row.presence.pid, "answers": row.status.is_some(),
                "beats_per_second": row.rate(|status| status.beats),
                "late_per_second": row.rate(|status| status.late),
                "sent_per_second": row.rate(|status| status.sent),
                "received_per_second": row.rate(|status| status.received),
                "refused": row.status.as_ref().map(|status| status.refused),
            })
        });
        let streams = self
            .streams
            .iter()
            .map(|(key, stream)| json!({ "key": key, "hz": stream.hz, "bytes_per_second": stream.rate }));
        json!({
            "services": services.collect::<Value>(), "streams": streams.collect::<Value>(), "gates": self.gates,
        })
    }
}

fn gate(robot: &str, state: &GateState) -> String {
    let enabled = match (state.enabled, state.stop) {
        (true, _) => "enabled".to_owned(),
        (false, Some(stop)) => format!("STOPPED by {stop}"),
        (false, None) => "disabled".to_owned(),
    };
    let refused: u64 = state.rejected.values().sum();
    format!(
        "gate of {robot}: {enabled}, {:?}, held by {}, left {:+.3} right {:+.3} m/s, {} commands obeyed, {refused} refused",
        state.motion,
        state.holder.as_deref().unwrap_or("nobody"),
        state.wheels.left.0,
        state.wheels.right.0,
        state.accepted,
    )
}

fn service(row: &Row) -> String {
    let Presence { robot, service, host, pid, .. } = &row.presence;
    let Some(status) = &row.status else {
        return columns(&[service, robot, host, &pid.to_string(), "silent: alive, but does not answer"]);
    };
    let rate = |rate: Option<f64>| rate.map_or_else(|| "-".to_owned(), |rate| format!("{rate:.1}/s"));
    let (beats, late, p99) = if status.beats > 0 {
        let p99 = format!("{:.1} ms", status.late_p99.0 * 1e3);
        (rate(row.rate(|status| status.beats)), status.late.to_string(), p99)
    } else {
        ("-".to_owned(), "-".to_owned(), "-".to_owned())
    };
    columns(&[
        service,
        robot,
        host,
        &pid.to_string(),
        &format!("{:.0} s", status.uptime.0),
        &beats,
        &late,
        &p99,
        &rate(row.rate(|status| status.sent)),
        &rate(row.rate(|status| status.received)),
        &status.refused.to_string(),
    ])
}

/// Texts in columns; the last one may be as long as it likes.
fn columns(texts: &[&str]) -> String {
    const WIDTHS: [usize; 11] = [18, 10, 14, 8, 8, 10, 7, 9, 10, 10, 8];
    let cells = texts.iter().zip(WIDTHS).map(|(text, width)| format!("{text:<width$}"));
    cells.collect::<Vec<_>>().join(" ").trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn somebody(service: &str, beats: u64) -> (Presence, Option<Status>) {
        let presence = Presence {
            robot: "r1".into(),
            service: service.into(),
            host: "lab".into(),
            pid: 7,
            boot: Boot(service.len() as u64),
        };
        let status = Status {
            service: service.into(),
            robot: "r1".into(),
            host: "lab".into(),
            pid: 7,
            boot: presence.boot,
            version: "0.1.0".into(),
            uptime: axle_schema::Seconds(9.0),
            beats,
            late: 1,
            late_p99: axle_schema::Seconds(0.002),
            sent: beats,
            received: 0,
            refused: 3,
            says: vec!["axle/r1/gate/command".into()],
            hears: Vec::new(),
            said: Vec::new(),
            heard: Vec::new(),
            wall: None,
            certificate: None,
        };
        (presence, Some(status))
    }

    #[test]
    fn rates_come_from_two_looks_and_the_choice_stays_with_its_process() {
        let mut board = Board::new(None);
        let begun = Instant::now();
        board.hear(vec![somebody("pilot", 100), somebody("d-corrector", 100)], begun);
        board.select(1);
        let later = begun + Duration::from_secs(2);
        board.hear(
            vec![somebody("a-corrector1", 0), somebody("pilot", 120), somebody("d-corrector", 140)],
            later,
        );
        let text: Vec<_> = board.lines().into_iter().map(|line| (line.text, line.mood)).collect();
        let of = |name: &str| text.iter().find(|(text, _)| text.starts_with(name)).expect("a line");
        assert!(of("d-corrector").0.contains("20.0/s"), "{text:?}");
        assert!(of("pilot").0.contains("10.0/s") && of("pilot").1 == Mood::Chosen, "{text:?}");
        assert_eq!(board.robot().expect("a robot").as_str(), "r1");
        board.inspect();
        assert!(board.lines().iter().any(|line| line.text.contains("says   axle/r1/gate/command")));
        board.select(isize::MAX);
        board.hear(Vec::new(), later);
        assert!(board.lines().len() > 4, "an empty mesh has a screen too");
    }
}
