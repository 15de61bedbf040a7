//! The numbers of the mesh, in the text format that Prometheus reads (version 0.0.4).

use axle_schema::command::{GateState, Motion};
use axle_schema::presence::Status;
use std::fmt::Write as _;

/// What the gateway counts of itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct Own {
    /// Pages that are connected.
    pub browsers: usize,
    /// Sessions of people who have logged in.
    pub sessions: usize,
    /// Questions of pages since the start.
    pub asked: u64,
    /// Those of them that were refused.
    pub refused: u64,
    /// Connections that were turned away at the door.
    pub turned: u64,
    /// Words to pages.
    pub told: u64,
    /// Samples that waited too long for the gateway and were dropped.
    pub dropped: u64,
    /// Events that a slow page missed.
    pub missed: u64,
}

/// One process: whose it is, and what it says of itself if it answers.
#[derive(Clone, Debug)]
pub struct Process {
    /// The robot, or `all`.
    pub robot: String,
    /// Its service.
    pub service: String,
    /// Its computer.
    pub host: String,
    /// Its account; none where it is alive but silent.
    pub status: Option<Status>,
}

/// A metric: its name, its kind, and what it is.
type Kind = (&'static str, &'static str, &'static str);

/// The text of the page `/metrics`.
#[must_use]
pub fn text(own: &Own, processes: &[Process], gates: &[(String, GateState)]) -> String {
    let mut text = String::with_capacity(16 * 1024);
    for ((name, kind, help), value) in [
        (("axle_gateway_browsers", "gauge", "Pages that are connected."), own.browsers as u64),
        (("axle_gateway_sessions", "gauge", "Sessions of people who have logged in."), own.sessions as u64),
        (("axle_gateway_questions_total", "counter", "Questions of pages."), own.asked),
        (("axle_gateway_refused_total", "counter", "Questions of pages that were refused."), own.refused),
        (("axle_gateway_turned_away_total", "counter", "Connections turned away at the door."), own.turned),
        (("axle_gateway_words_total", "counter", "Words to pages."), own.told),
        (
            ("axle_gateway_dropped_total", "counter", "Samples dropped before the gateway read them."),
            own.dropped,
        ),
        (("axle_gateway_missed_total", "counter", "Events that slow pages missed."), own.missed),
    ] {
        head(&mut text, (name, kind, help));
        line(&mut text, name, &[], value as f64);
    }
    of_processes(&mut text, processes);
    of_gates(&mut text, gates);
    text
}

fn of_processes(text: &mut String, processes: &[Process]) {
    head(text, ("axle_up", "gauge", "1 when the process answers, 0 when it is alive but silent."));
    for process in processes {
        let value = f64::from(u8::from(process.status.is_some()));
        line(text, "axle_up", &labels(process), value);
    }
    type Number = fn(&Status) -> f64;
    let numbers: [(Kind, Number); 7] = [
        (("axle_uptime_seconds", "gauge", "Since the process joined."), |s| s.uptime.0),
        (("axle_beats_total", "counter", "Beats made."), |s| s.beats as f64),
        (("axle_late_beats_total", "counter", "Beats more than 5 ms late."), |s| s.late as f64),
        (("axle_beat_lateness_p99_seconds", "gauge", "What 99 of 100 beats were not later than."), |s| {
            s.late_p99.0
        }),
        (("axle_sent_total", "counter", "Messages said and answers given."), |s| s.sent as f64),
        (("axle_received_total", "counter", "Messages and questions taken."), |s| s.received as f64),
        (("axle_refused_total", "counter", "Messages and questions refused."), |s| s.refused as f64),
    ];
    for (kind, number) in numbers {
        head(text, kind);
        for process in processes {
            if let Some(status) = &process.status {
                line(text, kind.0, &labels(process), number(status));
            }
        }
    }
}

fn of_gates(text: &mut String, gates: &[(String, GateState)]) {
    type Number = fn(&GateState) -> f64;
    let numbers: [(Kind, Number); 4] = [
        (("axle_gate_enabled", "gauge", "Whether commands may move the wheels."), |s| {
            f64::from(u8::from(s.enabled))
        }),
        (("axle_gate_moving", "gauge", "Whether the wheels move."), |s| {
            f64::from(u8::from(s.motion != Motion::Standing))
        }),
        (("axle_gate_leases_total", "counter", "Leases granted since boot."), |s| f64::from(s.epoch)),
        (("axle_gate_obeyed_total", "counter", "Commands obeyed since boot."), |s| s.accepted as f64),
    ];
    for (kind, number) in numbers {
        head(text, kind);
        for (robot, state) in gates {
            line(text, kind.0, &[("robot", robot)], number(state));
        }
    }
    let name = "axle_gate_refused_total";
    head(text, (name, "counter", "Commands refused since boot, by reason."));
    for (robot, state) in gates {
        for (reason, count) in &state.rejected {
            let reason = serde_json::to_value(reason).ok();
            let reason = reason.as_ref().and_then(serde_json::Value::as_str).unwrap_or("other");
            line(text, name, &[("robot", robot), ("reason", reason)], *count as f64);
        }
    }
}

fn labels(process: &Process) -> [(&'static str, &str); 3] {
    [("service", &process.service), ("robot", &process.robot), ("host", &process.host)]
}

fn head(text: &mut String, (name, kind, help): Kind) {
    // Writing to a text cannot fail.
    let _ = writeln!(text, "# HELP {name} {help}\n# TYPE {name} {kind}");
}

fn line(text: &mut String, name: &str, labels: &[(&str, &str)], value: f64) {
    text.push_str(name);
    for (index, (label, of)) in labels.iter().enumerate() {
        let _ = write!(text, "{}{label}=\"{}\"", if index == 0 { '{' } else { ',' }, escaped(of));
    }
    let _ = writeln!(text, "{} {value}", if labels.is_empty() { "" } else { "}" });
}

/// A label's value: names come from the network, and must not end the label or the line.
fn escaped(name: &str) -> String {
    name.chars()
        .take(128)
        .map(|c| match c {
            '\\' => "\\\\".to_owned(),
            '"' => "\\\"".to_owned(),
            '\n' => "\\n".to_owned(),
            c => c.to_string(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::command::Reject;
    use axle_schema::{Boot, MetresPerSecond, Seconds, Sides, Tick};

    #[test]
    fn numbers_are_written_as_prometheus_reads_them() {
        let status = Status {
            service: "pilot".into(),
            robot: "r1".into(),
            host: "lab".into(),
            pid: 1,
            boot: Boot(2),
            version: "0.1.0".into(),
            uptime: Seconds(12.5),
            beats: 100,
            late: 3,
            late_p99: Seconds(0.004),
            sent: 5,
            received: 6,
            refused: 7,
            says: Vec::new(),
            hears: Vec::new(),
            said: Vec::new(),
            heard: Vec::new(),
            wall: None,
            certificate: None,
        };
        let process = |service: &str, status| Process {
            robot: "r1".into(),
            service: service.into(),
            host: "lab".into(),
            status,
        };
        let gate = GateState {
            boot: Boot(1),
            tick: Tick(1),
            epoch: 4,
            holder: None,
            enabled: true,
            stop: None,
            stored: false,
            motion: Motion::Driving,
            cause: None,
            wheels: Sides::new(MetresPerSecond(0.0), MetresPerSecond(0.0)),
            accepted: 9,
            rejected: [(Reject::Stale, 2)].into(),
        };
        let own = Own { browsers: 2, ..Own::default() };
        let processes = [process("pilot", Some(status)), process("a\"b\\c\nd", None)];
        let text = text(&own, &processes, &[("r1".into(), gate)]);
        for line in [
            "# TYPE axle_gateway_browsers gauge",
            "axle_gateway_browsers 2",
            "axle_up{service=\"pilot\",robot=\"r1\",host=\"lab\"} 1",
            "axle_up{service=\"a\\\"b\\\\c\\nd\",robot=\"r1\",host=\"lab\"} 0",
            "axle_uptime_seconds{service=\"pilot\",robot=\"r1\",host=\"lab\"} 12.5",
            "axle_late_beats_total{service=\"pilot\",robot=\"r1\",host=\"lab\"} 3",
            "axle_gate_enabled{robot=\"r1\"} 1",
            "axle_gate_refused_total{robot=\"r1\",reason=\"stale\"} 2",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} is missing in\n{text}");
        }
        // Every name has one head, and a value or nothing but text behind it.
        let heads = text.lines().filter(|line| line.starts_with("# TYPE")).count();
        assert_eq!(heads, 21, "{text}");
    }
}
