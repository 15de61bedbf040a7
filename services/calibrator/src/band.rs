//! The dead band: the signal up to which a standing wheel stays at rest.
//!
//! The signal grows slowly from below until the wheel has counted two ticks. It began to move before that: a wheel that
//! breaks loose at once, right before; one that follows its line from rest on, earlier by the time that two ticks take at
//! a speed that grows from nothing. So the dead band lies between the two, and the interval is that of both together.

use crate::log::Log;
use crate::statistics::Estimate;
use axle_schema::Sides;

/// More ticks than this are a movement, and so two: one may be the edge of a tick that the wheel stood on.
pub(crate) const TICKS: f64 = 1.5;

/// The signals between which a wheel began to move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bracket {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// Where in a ramp a wheel began to move: `least` is the least that is a movement, `kv` and `ka` are those of its motor. `None` where it did not move.
pub(crate) fn bracket(
    log: &Log,
    (least, tick): (f64, f64),
    (kv, ka): (f64, f64),
    wheel: impl Fn(Sides<f64>) -> f64 + Copy,
) -> Option<Bracket> {
    let (begin, first) = *log.counts.first()?;
    let (moved, _) = *log.counts.iter().find(|(_, counts)| (wheel(*counts) - wheel(first)).abs() >= least)?;
    let before = log.counts.iter().rev().find(|(stamp, _)| *stamp < moved)?.0;
    let signal = |time: f64| {
        let after = log.signals.iter().find(|(stamp, _)| *stamp >= time)?;
        Some(wheel(after.1).abs())
    };
    let high = signal(moved)?;
    // The rate of the ramp, over the time before.
    let since = (moved - 1.0).max(begin + 0.1);
    let rate = (high - signal(since)?) / (moved - since);
    let low = if rate > 0.0 {
        let began = moved - before + hidden((least + tick) * kv / rate, ka / kv);
        (high - rate * began).min(step_below(log, moved - began, wheel)?)
    } else {
        0.0
    };
    Some(Bracket { low: low.clamp(0.0, high), high })
}

/// The signal before that of `time`: a board knows whole numbers only, and a wheel that breaks loose at one of them may have
/// been about to since the one before.
fn step_below(log: &Log, time: f64, wheel: impl Fn(Sides<f64>) -> f64 + Copy) -> Option<f64> {
    let signals = || log.signals.iter().map(|(stamp, signals)| (*stamp, wheel(*signals).abs()));
    let level = signals().take_while(|(stamp, _)| *stamp <= time).last().or_else(|| signals().next())?.1;
    let below = signals().map(|(_, signal)| signal).filter(|signal| *signal < level - 1e-9);
    Some(below.fold(0.0, f64::max).min(level))
}

/// The time in which a wheel covers a way from rest when its target speed grows from nothing; `way` is in units of that
/// growth. With the time constant τ: `t²/2 - τt + τ²(1 - e^(-t/τ)) = way`.
fn hidden(way: f64, tau: f64) -> f64 {
    let tau = tau.max(0.0);
    let covered = |t: f64| {
        let lag = if tau > 0.0 { tau * t - tau * tau * (1.0 - (-t / tau).exp()) } else { 0.0 };
        t * t / 2.0 - lag
    };
    let (mut low, mut high) = (0.0, (2.0 * way.max(0.0)).sqrt() + 2.0 * tau + 1e-3);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if covered(middle) < way { low = middle } else { high = middle }
    }
    high
}

/// What all brackets have in common, or what they cover together where they have nothing in common.
pub(crate) fn common(brackets: &[Bracket]) -> Option<Estimate> {
    let fold = |start: f64, by: fn(f64, f64) -> f64, end: fn(&Bracket) -> f64| {
        brackets.iter().map(end).fold(start, by)
    };
    (!brackets.is_empty()).then_some(())?;
    let (mut low, mut high) =
        (fold(0.0, f64::max, |bracket| bracket.low), fold(f64::INFINITY, f64::min, |bracket| bracket.high));
    if low > high {
        (low, high) = (
            fold(f64::INFINITY, f64::min, |bracket| bracket.low),
            fold(0.0, f64::max, |bracket| bracket.high),
        );
    }
    let middles: Vec<f64> = brackets.iter().map(|bracket| f64::midpoint(bracket.low, bracket.high)).collect();
    let repeatability =
        crate::statistics::of_passes(&middles, 0.0).map_or(0.0, |estimate| estimate.repeatability);
    Some(Estimate { value: f64::midpoint(low, high), low, high, repeatability })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hidden_time_is_that_of_the_way() {
        assert!((hidden(0.5, 0.0) - 1.0).abs() < 1e-9, "t²/2 = 0.5");
        let slow = hidden(0.5, 0.2);
        assert!(slow > 1.1 && slow < 1.25, "about the time constant later: {slow}");
    }

    #[test]
    fn brackets_narrow_each_other() {
        let both = [Bracket { low: 0.04, high: 0.06 }, Bracket { low: 0.05, high: 0.07 }];
        let estimate = common(&both).expect("brackets");
        assert!((estimate.low, estimate.high) == (0.05, 0.06) && estimate.holds(0.055));
        let apart = [Bracket { low: 0.01, high: 0.02 }, Bracket { low: 0.05, high: 0.07 }];
        let estimate = common(&apart).expect("brackets");
        assert_eq!((estimate.low, estimate.high), (0.01, 0.07));
        assert_eq!(common(&[]), None);
    }
}
