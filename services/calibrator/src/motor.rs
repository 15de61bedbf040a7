//! What a motor does with its signal: friction, speed and inertia of one wheel in one direction.
//!
//! The model is that of a motor with friction, `s = ks + kv·v + ka·a` (s the signal, v the speed, a the acceleration;
//! ka/kv is the time constant). Its integral from one time to another needs no derivative of noisy counts:
//! `∫s dt = ks·T + kv·Δd + ka·Δv`. Each pass drives three speeds one after the other. Within each, and from the middle of
//! one to the middle of the next, this is an equation for ks, kv and ka; least squares solve them.

use crate::log::Log;
use crate::statistics::{least_squares, of_passes};
use axle_schema::Sides;
use axle_schema::calibration::Branch;
use axle_schema::unit::Numbers;

/// A signal counts as held from so long on, and the wheel needs so long to come to its speed, s.
const HELD: f64 = 0.45;
const SETTLE: f64 = 0.3;
/// A branch is no line when a level is off by more than this share of its signal in all passes.
const BENT: f64 = 0.01;

/// One pass of one wheel in one direction.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pass {
    /// ks, kv, ka.
    pub(crate) numbers: [f64; 3],
    /// Speed and signal of each level, in the order in which they were driven.
    pub(crate) levels: Vec<[f64; 2]>,
}

/// Evaluates what was heard while the wheel went in one direction (1 or -1).
pub(crate) fn pass(log: &Log, direction: f64, wheel: impl Fn(Sides<f64>) -> f64 + Copy) -> Option<Pass> {
    let (mut rows, mut targets, mut levels) = (Vec::new(), Vec::new(), Vec::new());
    let mut last: Option<crate::log::Local> = None;
    for (begin, end) in log.plateaus(HELD) {
        let from = begin + SETTLE;
        // The newest counts may be a bit older than the newest signals.
        let Some(local) = log.local(from, end, wheel) else { continue };
        let span = end - from;
        let impulse = |from, to| log.impulse(from, to).map(|impulse| wheel(impulse) * direction);
        rows.push([span, local.speed * span * direction, local.acceleration * span * direction]);
        targets.push(impulse(from, end)?);
        if let Some(last) = last {
            let (way, gain) = (local.distance - last.distance, local.speed - last.speed);
            rows.push([local.time - last.time, way * direction, gain * direction]);
            targets.push(impulse(last.time, local.time)?);
        }
        levels.push([local.speed * direction, impulse(from, end)? / span]);
        last = Some(local);
    }
    let (numbers, _) = least_squares(&rows, &targets)?;
    let is_motor = numbers[1] > 0.0 && levels.len() >= 2;
    is_motor.then_some(Pass { numbers, levels })
}

/// The branch that the passes agree on, without its dead band: a line, or points where no line fits.
pub(crate) fn branch(passes: &[Pass]) -> Option<Branch> {
    let mean = |number: usize| {
        let values: Vec<f64> = passes.iter().map(|pass| pass.numbers[number]).collect();
        of_passes(&values, 0.0).map(|estimate| estimate.value).or_else(|| values.first().copied())
    };
    let (ks, kv, ka) = (mean(0)?.clamp(0.0, 1.0), mean(1)?.clamp(0.01, 1000.0), mean(2)?.clamp(0.0, 100.0));
    let mut branch = Branch { ks, kv, ka, ..Branch::default() };
    if is_bent(passes) {
        branch.points = points(passes).unwrap_or_default();
    }
    Some(branch)
}

/// What is left of the signal of each level of a pass when the line of that pass is taken off.
pub(crate) fn left(pass: &Pass) -> Vec<[f64; 2]> {
    let [ks, kv, _] = pass.numbers;
    pass.levels.iter().map(|[speed, signal]| [*speed, signal - ks - kv * speed]).collect()
}

/// Whether some level lies off the line in the same way in all passes.
fn is_bent(passes: &[Pass]) -> bool {
    if passes.len() < 3 {
        return false;
    }
    let levels = passes.iter().map(|pass| pass.levels.len()).min().unwrap_or(0);
    (0..levels).any(|level| {
        let off: Vec<f64> = passes.iter().map(|pass| left(pass)[level][1]).collect();
        let signal: f64 = passes.iter().map(|pass| pass.levels[level][1]).sum::<f64>() / float(passes.len());
        // Twice Student's interval, since there are several levels and a line is to be preferred.
        of_passes(&off, 0.0).is_some_and(|estimate| {
            let half = (estimate.high - estimate.low) / 2.0;
            estimate.value.abs() > 2.0 * half && estimate.value.abs() > BENT * signal
        })
    })
}

/// The mean of each level, in the order of their speeds.
fn points(passes: &[Pass]) -> Option<Vec<Numbers<2>>> {
    let levels = passes.iter().map(|pass| pass.levels.len()).min()?;
    let mean = |level: usize, of: usize| {
        passes.iter().map(|pass| pass.levels[level][of]).sum::<f64>() / float(passes.len())
    };
    let mut points: Vec<Numbers<2>> =
        (0..levels).map(|level| Numbers([mean(level, 0), mean(level, 1).min(1.0)])).collect();
    points.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
    let grows = points.windows(2).all(|pair| pair[0].0[0] < pair[1].0[0] && pair[0].0[1] < pair[1].0[1]);
    (points.len() >= 2 && grows && points[0].0[0] >= 0.0).then_some(points)
}

/// The uncertainty of one pass that all passes may share, from whole ticks: one deviation of ks, kv and ka.
pub(crate) fn resolution(pass: &Pass, tick: f64, span: f64) -> [f64; 3] {
    let speeds = || pass.levels.iter().map(|level| level[0]);
    let (low, high) = (speeds().fold(f64::INFINITY, f64::min), speeds().fold(0.0, f64::max));
    // A count is off by up to a tick, evenly: its deviation is a tick by the root of 12. A speed over a span has two.
    let speed = tick / 12.0_f64.sqrt() * 2.0_f64.sqrt() / span.max(1e-3);
    let (range, kv) = ((high - low).max(1e-3), pass.numbers[1]);
    let kv_off = kv * speed * 2.0_f64.sqrt() / range;
    [kv_off * high.max(low), kv_off, kv * tick / 12.0_f64.sqrt() * 2.0_f64.sqrt() / range]
}

#[allow(clippy::cast_precision_loss, reason = "a few passes")]
pub(crate) const fn float(count: usize) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn passes(bend: f64) -> Vec<Pass> {
        [0.0, 0.002, -0.001, 0.001]
            .map(|noise| {
                let levels = [0.1, 0.5, 0.3].map(|v: f64| [v, 0.05 + 0.8 * v + bend * v * v + noise * 0.1]);
                let rows: Vec<[f64; 2]> = levels.iter().map(|level| [1.0, level[0]]).collect();
                let (line, _) = least_squares(&rows, &levels.map(|level| level[1])).expect("a line");
                Pass { numbers: [line[0], line[1], 0.04], levels: levels.to_vec() }
            })
            .to_vec()
    }

    #[test]
    fn a_line_stays_a_line_and_a_bent_motor_becomes_points() {
        let line = branch(&passes(0.0)).expect("a branch");
        assert!((line.kv - 0.8).abs() < 1e-3 && line.points.is_empty(), "{line:?}");
        let bent = branch(&passes(0.4)).expect("a branch");
        assert_eq!(bent.points.len(), 3, "{bent:?}");
        let Numbers([speed, signal]) = bent.points[1];
        assert!((speed - 0.3).abs() < 1e-12 && (signal - (0.05 + 0.24 + 0.036)).abs() < 1e-3);
    }
}
