//! `axle bench tournament`: how long a step of each corrector takes, and how much faster than real time the simulator is.
//!
//! A step is measured alone, on what the corrector saw on a drive in the simulator. Each step is done several times in whole
//! drives, and the shortest time of each counts: what disturbs a step only makes it longer.

use crate::out::{data, table};
use anyhow::Context as _;
use axle_schema::contract::Step;
use axle_sim::{COURSES, Course, Run, SCENARIOS, Scenario, Seat, Tournament, seats, sights};
use std::time::{Duration, Instant};

/// How often each drive is done again.
const DRIVES: u32 = 15;
/// What is driven: long arcs of both directions, by a robot with all faults.
const DRIVE: (&str, &str, u64) = ("slalom", "everything", 1);
/// How often each corrector drives each course in each scenario in the tournament of the default.
const RUNS: u32 = 10;

/// Mean and longest time of a step.
struct Steps {
    name: &'static str,
    count: usize,
    mean: Duration,
    longest: Duration,
}

/// Measures and prints.
pub(crate) fn tournament(json: bool) -> anyhow::Result<()> {
    let steps = seats().iter().map(steps).collect::<anyhow::Result<Vec<_>>>()?;
    let (driven, took) = play()?;
    let (real_time, whole) = (driven / took.as_secs_f64(), took.as_secs_f64() * f64::from(RUNS));
    let micros = |time: Duration| time.as_secs_f64() * 1e6;
    if json {
        let of = |steps: &Steps| {
            let times = serde_json::json!({
                "steps": steps.count, "mean_us": micros(steps.mean), "longest_us": micros(steps.longest),
            });
            (steps.name.to_owned(), times)
        };
        let steps: serde_json::Map<_, _> = steps.iter().map(of).collect();
        let line = serde_json::json!({
            "steps": steps, "times_real_time_per_core": real_time, "default_tournament_core_s": whole,
        });
        return Ok(data(&line.to_string())?);
    }
    let row = |steps: &Steps| {
        vec![
            format!("a step of the {}", steps.name),
            format!("{:.2} µs, at most {:.2} µs", micros(steps.mean), micros(steps.longest)),
        ]
    };
    let rest = [
        vec!["the simulator, on one core".into(), format!("{real_time:.0} times real time")],
        vec!["`axle tournament`".into(), format!("{whole:.0} s of one core")],
    ];
    Ok(table(&["", ""], steps.iter().map(row).chain(rest))?)
}

/// Measures the steps of a corrector.
fn steps(seat: &Seat) -> anyhow::Result<Steps> {
    let (course, scenario, seed) = DRIVE;
    let brief = Course::find(course).context("the course of the bench")?.brief(seed)?;
    let world = Scenario::find(scenario).context("the scenario of the bench")?.world(seed);
    let seen = sights(seat, &brief, &world)?;
    let first = seen.first().context("the corrector has not begun")?;
    let mut times = vec![Duration::MAX; seen.len()];
    for _ in 0..DRIVES {
        let mut corrector = seat.begin(&brief, first)?;
        for (seen, shortest) in seen.iter().zip(&mut times) {
            let begin = Instant::now();
            let step = corrector.step(seen);
            *shortest = (*shortest).min(begin.elapsed());
            if let Step::Fail(refusal) = step {
                return Err(anyhow::Error::from(refusal).context(format!("{} fails in the bench", seat.name)));
            }
        }
    }
    let (sum, longest) = (times.iter().sum::<Duration>(), times.iter().max().copied().unwrap_or_default());
    let mean = sum / u32::try_from(times.len().max(1))?;
    Ok(Steps { name: seat.name, count: times.len(), mean, longest })
}

/// Drives a tenth of the default tournament on this thread; says how long the robots drove, in s, and how long it took.
fn play() -> anyhow::Result<(f64, Duration)> {
    let (courses, scenarios) = (COURSES.iter().collect(), SCENARIOS.iter().collect());
    let tenth = Tournament { seats: seats(), courses, scenarios, runs: 1, seed: 1 };
    let begin = Instant::now();
    let runs: Result<Vec<Run>, _> = (0..tenth.jobs()).map(|job| tenth.play(job)).collect();
    let driven: f64 = runs?.iter().map(|run| run.virtual_time.0).sum();
    Ok((driven, begin.elapsed()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_of_a_drive_is_measured() {
        let seat = seats().swap_remove(0);
        let measured = steps(&seat).expect("it drives");
        // The slalom takes ten seconds and more, with twenty beats in each.
        assert!(measured.count > 200 && measured.mean <= measured.longest, "{}", measured.count);
        assert!(measured.longest < Duration::from_secs(1));
    }
}
