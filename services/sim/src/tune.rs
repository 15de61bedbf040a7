//! Tuning: looks for values of the knobs that make a corrector better.

use crate::metrics::METRICS;
use crate::run::Run;
use crate::seat::Knob;
use cobyla::{RhoBeg, StopTols};

/// The most parameter sets that are tried.
pub const EVALUATIONS: usize = 60;

/// The first step of the search, as a share of the range of a knob.
const STEP: f64 = 0.15;
/// What a task that fails costs, and the most that any does: a robot that slipped by a metre is lost, not ten times as
/// lost, and no gain brings it back.
const FAILURE: f64 = 10.0;
/// What each change of direction of a wheel costs at the end of a task, but for the first one: it is hunting, which is what
/// destroyed the amplifiers of the authors of the paper (III.D).
const HUNTING: f64 = 5.0;
/// What of the cost a centimetre at the end, a centimetre off the path, a second, and 1 m²/s³ of effort are.
const WEIGHTS: [(&str, f64); 4] =
    [("final_error_m", 100.0), ("cross_track_rms_m", 100.0), ("time_s", 0.02), ("effort_m2_s3", 0.02)];

/// What runs cost, on average: a centimetre at the end is 1, a centimetre off the path 1, a second 0.02, effort 0.02 for
/// each m²/s³, a wheel that hunts at the goal 5 for each time, and no run more than a task that fails, which is 10.
#[must_use]
pub fn cost(runs: &[Run]) -> f64 {
    let of_run = |run: &Run| {
        let cost = METRICS.iter().zip(run.values).fold(0.0, |cost, (metric, value)| {
            let weight =
                WEIGHTS.iter().find(|(name, _)| *name == metric.name).map_or(0.0, |(_, weight)| *weight);
            cost + weight * value + if metric.more { FAILURE * (1.0 - value) } else { 0.0 }
        });
        #[allow(clippy::cast_precision_loss, reason = "at most 32")]
        let hunting = HUNTING * run.hunting.saturating_sub(1) as f64;
        (cost + hunting).min(FAILURE)
    };
    #[allow(clippy::cast_precision_loss, reason = "a count of runs")]
    let count = runs.len().max(1) as f64;
    runs.iter().map(of_run).sum::<f64>() / count
}

/// Looks for the values with the least cost, from `begin` on, within the ranges of the knobs.
///
/// By linear approximations in a shrinking region of trust (COBYLA, Powell 1994), which needs no slopes and bears a cost
/// that is not smooth. The best values that were seen are returned, with their cost; `begin` is among those.
pub fn minimise(knobs: &[Knob], begin: &[f64], evaluate: impl Fn(&[f64]) -> f64) -> (Vec<f64>, f64) {
    // The search sees every knob go from 0 to 1.
    let real = |shares: &[f64]| -> Vec<f64> {
        let value = |(knob, share): (&Knob, &f64)| {
            let (low, high) = knob.range;
            (low + (high - low) * share).clamp(low, high)
        };
        knobs.iter().zip(shares).map(value).collect()
    };
    let shares =
        knobs.iter().zip(begin).map(|(knob, value)| (value - knob.range.0) / (knob.range.1 - knob.range.0));
    let shares: Vec<f64> = shares.collect();
    let best = std::cell::RefCell::new((begin.to_vec(), evaluate(begin)));
    if knobs.is_empty() {
        return best.into_inner();
    }
    let watched = |shares: &[f64], (): &mut ()| {
        let values = real(shares);
        let cost = evaluate(&values);
        if cost < best.borrow().1 {
            *best.borrow_mut() = (values, cost);
        }
        cost
    };
    let bounds = vec![(0.0, 1.0); knobs.len()];
    let constraints: [fn(&[f64], &mut ()) -> f64; 0] = [];
    let tolerances = StopTols { xtol_abs: vec![5e-3; knobs.len()], ..StopTols::default() };
    // How the search ended does not matter: what it has seen on its way is kept.
    drop(cobyla::minimize(
        watched,
        &shares,
        &bounds,
        &constraints,
        (),
        EVALUATIONS - 1,
        RhoBeg::All(STEP),
        Some(tolerances),
    ));
    best.into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOBS: [Knob; 2] = [
        Knob { field: "a", range: (0.0, 10.0), hand: 5.0 },
        Knob { field: "b", range: (-1.0, 1.0), hand: 0.0 },
    ];

    #[test]
    fn the_least_cost_is_found_inside_and_at_the_edge_of_the_ranges() {
        let bowl = |at: [f64; 2]| move |x: &[f64]| (x[0] - at[0]).powi(2) / 100.0 + (x[1] - at[1]).powi(2);
        let (values, cost) = minimise(&KNOBS, &[5.0, 0.0], bowl([7.0, 0.4]));
        assert!((values[0] - 7.0).abs() < 0.3 && (values[1] - 0.4).abs() < 0.05, "{values:?}: {cost}");
        let (values, _) = minimise(&KNOBS, &[5.0, 0.0], bowl([20.0, -3.0]));
        assert!(values[0] > 9.9 && values[0] <= 10.0 && values[1] < -0.99 && values[1] >= -1.0, "{values:?}");
    }

    #[test]
    fn the_search_is_the_same_every_time_and_never_worse_than_its_beginning() {
        let rough = |x: &[f64]| (x[0] * 3.0).sin() + x[1].abs() + (x[0] * 40.0).floor() * 0.01;
        let found = minimise(&KNOBS, &[2.0, 0.5], rough);
        assert_eq!(found, minimise(&KNOBS, &[2.0, 0.5], rough));
        assert!(found.1 <= rough(&[2.0, 0.5]));
    }
}
