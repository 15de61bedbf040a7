//! A motor whose acceleration after a step is a polynomial of time.
//!
//! It adds up what follows from every change of what it is asked for. With the step response r(t), the polynomial up to T
//! and r(T) from then on, and R its integral, a change at the rate m from t₀ to t₁ gives the speed
//! `m·(R(t - t₀) - R(t - t₁))`.

use std::collections::VecDeque;

/// The most changes that are remembered: 2 s at beats of 1 ms, and what a slower one needs less.
const MOST: usize = 2048;

/// One change: its rate, and how long ago it began and ended.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    rate: f64,
    begun: f64,
    ended: f64,
}

/// The memory of one motor.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Memory {
    changes: VecDeque<Change>,
    /// What older changes have come to.
    settled: f64,
}

impl Memory {
    /// The speed after another interval, in which what is asked goes linearly by `change`.
    pub(crate) fn turn(&mut self, change: f64, duration: f64, time: f64, coefficients: &[f64; 5]) -> f64 {
        for change in &mut self.changes {
            change.begun += duration;
            change.ended += duration;
        }
        self.changes.push_back(Change { rate: change / duration, begun: duration, ended: 0.0 });
        let reached: f64 = coefficients.iter().sum();
        while self.changes.front().is_some_and(|oldest| oldest.ended >= time) || self.changes.len() > MOST {
            let Some(oldest) = self.changes.pop_front() else { break };
            self.settled += oldest.rate * (oldest.begun - oldest.ended) * reached;
        }
        let way = |t: f64| integral(t, time, coefficients);
        let moving: f64 =
            self.changes.iter().map(|change| change.rate * (way(change.begun) - way(change.ended))).sum();
        let speed = self.settled + moving;
        // What is left of sums that cancel is no speed.
        if speed.abs() < 1e-9 { 0.0 } else { speed }
    }
}

/// The integral of the step response from 0 to t.
fn integral(t: f64, time: f64, coefficients: &[f64; 5]) -> f64 {
    let u = (t / time).min(1.0);
    let mut sum = 0.0;
    for (power, coefficient) in [2.0, 3.0, 4.0, 5.0, 6.0].iter().zip(coefficients).rev() {
        sum = (sum + coefficient / power) * u;
    }
    let reached: f64 = coefficients.iter().sum();
    sum * u * time + (t - time).max(0.0) * reached
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_gives_the_polynomial_itself_in_intervals_of_any_length() {
        let coefficients = [0.5, 2.0, -1.5, 0.0, 0.0];
        for duration in [0.001, 0.004, 0.02] {
            let mut memory = Memory::default();
            // A step: what is asked changes within a moment.
            memory.turn(0.4, 1e-6, 0.5, &coefficients);
            let mut now = 0.0;
            while now < 0.8 {
                let speed = memory.turn(0.0, duration, 0.5, &coefficients);
                now += duration;
                let u: f64 = (now / 0.5).min(1.0);
                let exact = 0.4 * (0.5 * u + 2.0 * u * u - 1.5 * u * u * u);
                assert!((speed - exact).abs() < 1e-5, "{duration} s, at {now} s: {speed} and {exact}");
            }
            assert!((memory.settled - 0.4).abs() < 1e-9, "old changes are forgotten: {memory:?}");
        }
    }
}
