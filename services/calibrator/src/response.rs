//! Motors that accelerate otherwise than at a constant rate or with one time constant: their acceleration is a
//! polynomial of the time since the step of the signal (G.W. Lucas, "A Tutorial and Elementary Trajectory Model for the
//! Differential Steering System of Robot Wheel Actuators", section "Acceleration").
//!
//! A motor that adds up its steps has the speed `v(t) = Σ Δu·r(t - tⱼ)` after steps Δu of what it is asked for, with
//! `r(t) = c₁·t/T + c₂·(t/T)² + …` up to T and r(T) from then on; the derivative of r is the acceleration after a unit
//! step. What the wheel has covered is linear in the c, so that least squares find them from any recording in which the
//! speeds change, without a test stand. The emulator takes the same numbers.

use crate::statistics::solve;

/// The most coefficients.
pub const MAX_DEGREE: usize = 5;
/// The most readings that are looked at.
const MOST: usize = 3000;

/// What a motor does after a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// After this time the wheel has reached its speed, s.
    pub time: f64,
    /// Of (t/T), (t/T)² …, in m/s for each m/s (or other unit) that is asked for; their sum is what is reached.
    pub coefficients: Vec<f64>,
    /// Root of the mean square of what is left of the distances between two readings, m.
    pub left: f64,
}

impl Response {
    /// The speed at a time after a step of 1.
    #[must_use]
    pub fn speed(&self, t: f64) -> f64 {
        let u = (t / self.time).clamp(0.0, 1.0);
        self.coefficients.iter().rev().fold(0.0, |sum, c| (sum + c) * u)
    }
}

/// Fits the response of one wheel. `asked` is what it was asked for at each stamp, along straight lines between; `covered`
/// what it had covered. The wheel stands at the beginning. `None` for fewer readings than tell something, numbers that
/// make no sense, and a wheel that was always asked for the same.
#[must_use]
pub fn fit(asked: &[(f64, f64)], covered: &[(f64, f64)], time: f64, degree: usize) -> Option<Response> {
    let fits = (1..=MAX_DEGREE).contains(&degree) && time.is_finite() && time > 0.0;
    let (asked, covered) = (asked.get(..MOST).unwrap_or(asked), covered.get(..MOST).unwrap_or(covered));
    let grows = |list: &[(f64, f64)]| list.windows(2).all(|pair| pair[0].0 < pair[1].0);
    (fits && grows(asked) && grows(covered)).then_some(())?;
    let steps: Vec<(f64, f64)> = asked
        .windows(2)
        // A line is a step in its middle, as far as readings this close together can tell.
        .map(|pair| (f64::midpoint(pair[0].0, pair[1].0), pair[1].1 - pair[0].1))
        .filter(|(_, step)| *step != 0.0)
        .collect();
    let mut rows = Vec::new();
    let mut targets = Vec::new();
    let mut before: Option<(Vec<f64>, f64)> = None;
    for (stamp, distance) in covered {
        let mut row = vec![0.0; degree];
        for (at, step) in steps.iter().take_while(|(at, _)| at < stamp) {
            for (k, value) in row.iter_mut().enumerate() {
                *value += step * way(stamp - at, time, k + 1);
            }
        }
        if let Some((last, from)) = before.replace((row.clone(), *distance)) {
            rows.push(row.iter().zip(last).map(|(now, before)| now - before).collect());
            targets.push(distance - from);
        }
    }
    let (coefficients, off) = solve(&rows, &targets, degree)?;
    let left = (off.iter().map(|off| off * off).sum::<f64>() / crate::motor::float(off.len().max(1))).sqrt();
    Some(Response { time, coefficients, left })
}

/// The integral of (t/T)^k up to T and of 1 from then on.
fn way(t: f64, time: f64, power: usize) -> f64 {
    let u = (t / time).min(1.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "a small power")]
    let rising = time * u.powi(power as i32 + 1) / crate::motor::float(power + 1);
    rising + (t - time).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_emulator::{Emulator, EmulatorParams, MotorsParams, ResponseParams};
    use axle_schema::{Metres, MetresPerSecond, Seconds, Sides};

    /// What is asked of a motor for 12 s: steps up and down.
    fn asked(t: f64) -> f64 {
        match t {
            t if t < 0.5 => 0.0,
            t if t < 2.5 => 0.4,
            t if t < 5.0 => 0.1,
            t if t < 7.5 => -0.3,
            t if t < 10.0 => 0.5,
            _ => 0.2,
        }
    }

    type Series = Vec<(f64, f64)>;

    fn recorded(params: EmulatorParams) -> (Series, Series) {
        let mut robot = Emulator::new(params).expect("a robot");
        let (mut signals, mut counts) = (Vec::new(), Vec::new());
        for beat in 1..=2400_u32 {
            let now = f64::from(beat) * 0.005;
            robot.advance(Seconds(now), Sides::new(MetresPerSecond(asked(now)), MetresPerSecond::ZERO));
            if beat.is_multiple_of(2) {
                signals.push((now, asked(now)));
                counts.push((now, robot.encoders().left.0));
            }
        }
        (signals, counts)
    }

    #[test]
    fn what_the_emulator_was_given_is_found_in_its_recording() {
        let truth = [0.3, 2.4, -1.7, 0.0, 0.0];
        let response = ResponseParams { time: Seconds(0.6), left: truth, right: truth };
        let motors =
            MotorsParams { gain_deviation: 0.0, jitter: Metres(0.0002), response, ..MotorsParams::default() };
        let (signals, counts) = recorded(EmulatorParams { motors, ..EmulatorParams::default() });
        let found = fit(&signals, &counts, 0.6, 3).expect("a motor");
        for (t, tolerance) in [(0.1, 0.02), (0.3, 0.02), (0.6, 0.01), (2.0, 0.01)] {
            let u = (t / 0.6_f64).min(1.0);
            let real = truth[0] * u + truth[1] * u * u + truth[2] * u * u * u;
            assert!((found.speed(t) - real).abs() < tolerance, "{t} s: {} and really {real}", found.speed(t));
        }
        assert!(found.left < 0.001, "{found:?}");
    }

    #[test]
    fn a_motor_with_a_time_constant_is_a_polynomial_too_and_the_emulator_plays_it() {
        let motors = MotorsParams { gain_deviation: 0.0, lag: Seconds(0.15), ..MotorsParams::default() };
        let lagging = EmulatorParams { motors, ..EmulatorParams::default() };
        let (signals, counts) = recorded(lagging);
        let found = fit(&signals, &counts, 0.9, 5).expect("a motor");
        for t in [0.1, 0.2, 0.4, 0.8] {
            let real = 1.0 - (-t / 0.15_f64).exp();
            assert!((found.speed(t) - real).abs() < 0.05, "{t} s: {} and really {real}", found.speed(t));
        }
        let mut left = [0.0; MAX_DEGREE];
        left.copy_from_slice(&found.coefficients);
        let response = ResponseParams { time: Seconds(0.9), left, right: left };
        let motors = MotorsParams { lag: Seconds::ZERO, response, ..motors };
        let (_, played) = recorded(EmulatorParams { motors, ..EmulatorParams::default() });
        let worst = counts.iter().zip(&played).map(|(a, b)| (a.1 - b.1).abs()).fold(0.0, f64::max);
        assert!(worst < 0.012, "over 12 s and 3 m the two are {worst} m apart at most");
    }

    #[test]
    fn what_tells_nothing_is_refused() {
        let still: Vec<(f64, f64)> = (0..100_u32).map(|step| (f64::from(step) * 0.01, 0.0)).collect();
        assert_eq!(fit(&still, &still, 0.5, 3), None, "nothing was ever asked");
        assert_eq!(fit(&[], &[], 0.5, 3), None);
        let (signals, counts) = recorded(EmulatorParams::default());
        assert_eq!(fit(&signals, &counts, f64::NAN, 3), None);
        assert_eq!(fit(&signals, &counts, 0.5, 6), None);
        assert_eq!(fit(&signals, &[counts[1], counts[0]], 0.5, 2), None, "stamps go backward");
    }
}
