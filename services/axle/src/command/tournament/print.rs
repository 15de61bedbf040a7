//! What a tournament prints: JSON, CSV, and tables for people, on a terminal or in Markdown.

use crate::out::{data, table};
use axle_sim::{ALL, Estimate, Interval, METRICS, Row, Tournament};
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::fmt::Write as _;

/// A row as a JSON object: names first, then the measures.
struct Line<'a>(&'a Row);

impl Serialize for Line<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let Row { corrector, course, scenario, runs, estimates, failure } = self.0;
        let mut map = to.serialize_map(None)?;
        map.serialize_entry("corrector", corrector)?;
        map.serialize_entry("course", course)?;
        map.serialize_entry("scenario", scenario)?;
        map.serialize_entry("runs", runs)?;
        for (metric, estimate) in METRICS.iter().zip(estimates) {
            map.serialize_entry(metric.name, &Measure(estimate))?;
        }
        if let Some(why) = failure {
            map.serialize_entry("failure", why)?;
        }
        map.end()
    }
}

struct Measure<'a>(&'a Estimate);

impl Serialize for Measure<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let Estimate { mean: Interval { mean, low, high }, behind } = self.0;
        let mut map = to.serialize_map(Some(4))?;
        map.serialize_entry("mean", mean)?;
        map.serialize_entry("low", low)?;
        map.serialize_entry("high", high)?;
        map.serialize_entry("behind_best", behind)?;
        map.end()
    }
}

pub(super) fn json(rows: &[Row]) -> anyhow::Result<()> {
    for row in rows {
        data(&serde_json::to_string(&Line(row))?)?;
    }
    Ok(())
}

pub(super) fn csv(rows: &[Row]) -> anyhow::Result<()> {
    let mut text = "corrector,course,scenario,runs".to_owned();
    for metric in METRICS {
        let name = metric.name;
        // Writing to a string cannot fail.
        let _ =
            write!(text, ",{name},{name}_low,{name}_high,{name}_behind,{name}_behind_low,{name}_behind_high");
    }
    for row in rows {
        let _ = write!(text, "\n{},{},{},{}", row.corrector, row.course, row.scenario, row.runs);
        for Estimate { mean, behind } in &row.estimates {
            for number in [mean.mean, mean.low, mean.high, behind.mean, behind.low, behind.high] {
                let _ = write!(text, ",{number}");
            }
        }
    }
    Ok(data(&text)?)
}

/// How a measure is shown: what one is called, how many of its units one shown unit has, and how many digits it gets.
const SHOWN: [(&str, f64, usize); METRICS.len()] = [
    ("final error, cm", 100.0, 1),
    ("heading, °", 180.0 / std::f64::consts::PI, 1),
    ("off path RMS, cm", 100.0, 1),
    ("off path max, cm", 100.0, 1),
    ("time, s", 1.0, 1),
    ("reversals", 1.0, 1),
    ("effort, m²/s³", 1.0, 1),
    ("success, %", 100.0, 0),
];
const KEY: &str = "Means, with the interval of 95 % in brackets. * is the best; = cannot be told from the best, run by run.";

/// One measure, and how it compares: `1.2 [1.0, 1.5] *`.
fn shown(
    metric: usize,
    Estimate { mean: Interval { mean, low, high }, behind }: &Estimate,
    alone: bool,
) -> String {
    let (_, factor, digits) = SHOWN[metric];
    let number = |value: f64| format!("{:.digits$}", value * factor);
    let is_best = behind.mean <= 0.0 && behind.high <= 0.0;
    let mark = match () {
        () if alone => "",
        () if is_best => " *",
        () if behind.low <= 0.0 => " =",
        () => "",
    };
    format!("{} [{}, {}]{mark}", number(*mean), number(*low), number(*high))
}

/// The rows over all courses and scenarios, then the final error in each scenario, then that on each course.
pub(super) fn tables(tournament: &Tournament, rows: &[Row], markdown: bool) -> anyhow::Result<()> {
    let alone = tournament.seats.len() == 1;
    let course = if tournament.courses.len() == 1 { tournament.courses[0].name } else { ALL };
    let total = &rows[rows.len().saturating_sub(tournament.seats.len())..];
    let head: Vec<&str> = ["corrector", "runs"].into_iter().chain(SHOWN.map(|(name, ..)| name)).collect();
    let body = total.iter().map(|row| {
        let measures =
            row.estimates.iter().enumerate().map(|(metric, estimate)| shown(metric, estimate, alone));
        [row.corrector.to_owned(), row.runs.to_string()].into_iter().chain(measures).collect()
    });
    print("Over everything", &head, body.collect(), markdown)?;
    for metric in [0, 7] {
        let head: Vec<&str> =
            ["scenario"].into_iter().chain(tournament.seats.iter().map(|seat| seat.name)).collect();
        let body = tournament.scenarios.iter().map(|scenario| {
            let of = |seat: &axle_sim::Seat| {
                let row = rows.iter().find(|row| {
                    row.corrector == seat.name && row.course == course && row.scenario == scenario.name
                });
                row.map_or_else(String::new, |row| shown(metric, &row.estimates[metric], alone))
            };
            [scenario.name.to_owned()].into_iter().chain(tournament.seats.iter().map(of)).collect()
        });
        let title = format!("{} in each scenario", SHOWN[metric].0);
        print(&title, &head, body.collect(), markdown)?;
    }
    let failures = total.iter().filter_map(|row| Some((row.corrector, row.failure.as_ref()?)));
    let failures: Vec<_> =
        failures.map(|(name, why)| format!("{name} failed most often since: {why}")).collect();
    let words = [KEY.to_owned()].into_iter().chain(failures).collect::<Vec<_>>();
    Ok(data(&words.join(if markdown { "\n\n" } else { "\n" }))?)
}

/// A table with its title.
fn print(title: &str, head: &[&str], body: Vec<Vec<String>>, markdown: bool) -> anyhow::Result<()> {
    if !markdown {
        data(title)?;
        table(head, body)?;
        return Ok(data("")?);
    }
    let line = |cells: Vec<&str>| format!("| {} |\n", cells.join(" | "));
    let mut text = format!("### {title}\n\n{}", line(head.to_vec()));
    text += &line(vec!["---"; head.len()]);
    for row in &body {
        text += &line(row.iter().map(String::as_str).collect());
    }
    Ok(data(&text)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(mean: f64, behind: [f64; 3]) -> Estimate {
        let [behind, low, high] = behind;
        Estimate {
            mean: Interval { mean, low: mean - 0.001, high: mean + 0.002 },
            behind: Interval { mean: behind, low, high },
        }
    }

    #[test]
    fn the_best_and_what_cannot_be_told_from_it_are_marked() {
        assert_eq!(shown(0, &estimate(0.012, [0.0; 3]), false), "1.2 [1.1, 1.4] *");
        assert_eq!(shown(0, &estimate(0.012, [0.001, -0.001, 0.003]), false), "1.2 [1.1, 1.4] =");
        assert_eq!(shown(0, &estimate(0.012, [0.001, 0.0005, 0.003]), false), "1.2 [1.1, 1.4]");
        assert_eq!(shown(0, &estimate(0.012, [0.0; 3]), true), "1.2 [1.1, 1.4]");
    }

    #[test]
    fn a_row_begins_with_its_names_and_holds_every_measure() {
        let row = Row {
            corrector: "d-corrector",
            course: "square",
            scenario: "slip",
            runs: 2,
            estimates: [estimate(0.5, [0.0; 3]); METRICS.len()],
            failure: None,
        };
        let text = serde_json::to_string(&Line(&row)).expect("JSON");
        let begin = r#"{"corrector":"d-corrector","course":"square","scenario":"slip","runs":2,"final_error_m":{"mean":0.5,"#;
        assert!(text.starts_with(begin), "{text}");
        let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert!(METRICS.iter().all(|metric| value[metric.name]["behind_best"]["high"].is_number()), "{text}");
    }
}
