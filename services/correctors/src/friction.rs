//! What a motor needs beyond the speed that is asked of it before its wheel turns.
//!
//! Near its goal a robot creeps, and a motor with friction does not creep: it stands. What a slow wheel lacks of what it
//! was asked is summed up, so that it is driven harder until it turns as it shall, up to a bound; a wheel that still
//! stands then is blocked, which `stall.rs` sees. What is learned stays, and shrinks when a wheel does more than it was
//! asked. At higher speeds other things matter more, and nothing is learned.

use axle_schema::{Seconds, Sides};

/// What is learned in a second, as a share of the speed that is lacking, 1/s.
const RATE: f64 = 2.0;
/// The largest speed that is taken for lacking, and for too much, m/s: a late command lacks everything for a moment, and
/// a tick that comes at last makes up for many beats.
const LACK: (f64, f64) = (0.015, 0.15);
/// A wheel that is asked to run faster than this teaches nothing while it turns, m/s: it lags, and is not held back.
const SLOW: f64 = 0.03;
/// And nothing at all above this, m/s.
const FAST: f64 = 0.1;
/// A wheel hardly moves that makes less than this share of what it is asked; one that makes more is only uneven.
const HARDLY: f64 = 0.3;
/// Ways are remembered for this long, since a tick of an encoder comes all at once, s.
const FORGET: f64 = 0.2;
/// What is asked shows this much later, s.
const LATER: f64 = 0.5;

/// The speed that each wheel is asked for beyond its own, m/s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Friction {
    speeds: Sides<f64>,
    most: f64,
    /// What the wheels were asked and what they made lately, m, and in which time, s.
    asked: Sides<f64>,
    made: Sides<f64>,
    time: f64,
    /// For how long each wheel has been asked to creep, or has stood although it was driven, s.
    crept: Sides<f64>,
}

impl Friction {
    /// Nothing yet, and never more than `most`, m/s.
    pub(crate) const fn new(most: f64) -> Self {
        let nothing = Sides::new(0.0, 0.0);
        Self { speeds: nothing, most, asked: nothing, made: nothing, time: 0.0, crept: nothing }
    }

    /// Learns from the ways of a time, in m: those that were `asked` of the wheels, and those that they `made`.
    pub(crate) fn learn(&mut self, asked: Sides<f64>, made: Sides<f64>, passed: Seconds) {
        let time = passed.0;
        // No time teaches nothing, and what is no time even less.
        if !(time > 0.0 && time.is_finite()) {
            return;
        }
        if !(asked.left + asked.right + made.left + made.right).is_finite() {
            return;
        }
        let kept = (-time / FORGET).exp();
        self.time = self.time * kept + time;
        let whole = self.time;
        self.asked = self.asked.zip(asked, |sum, more| sum * kept + more);
        self.made = self.made.zip(made, |sum, more| sum * kept + more);
        let asks = self.asked.map(|asked| asked.abs() / whole);
        let makes = self.asked.zip(self.made, |asked, made| made * asked.signum() / whole);
        let creeps = asks.zip(makes, |asked, made| asked <= SLOW || (asked <= FAST && made < asked * HARDLY));
        // A wheel that rests as long as it creeps is corrected by pulses, and has no time to show anything.
        let crept =
            self.crept.zip(
                asked,
                |crept, asked| {
                    if asked.abs() > 0.0 { crept + time } else { (crept - time).max(0.0) }
                },
            );
        self.crept = crept.zip(creeps, |crept, creeps| if creeps { crept } else { 0.0 });
        let counts = asked.zip(self.crept, |asked, crept| asked.abs() > 0.0 && crept > LATER);
        let lacks = asks.zip(makes, |asked, made| {
            let uneven = asked * HARDLY <= made && made <= asked;
            if uneven { 0.0 } else { (asked - made).clamp(-LACK.1, LACK.0) }
        });
        let lacks = lacks.zip(counts, |lack, counts| if counts { lack } else { 0.0 });
        let most = self.most;
        self.speeds = self.speeds.zip(lacks, |speed, lack| (speed + RATE * time * lack).clamp(0.0, most));
    }

    /// What a wheel has to be told so that it runs at these speeds, m/s. Rest stays rest.
    pub(crate) fn overcome(&self, speeds: Sides<f64>) -> Sides<f64> {
        speeds.zip(
            self.speeds,
            |speed, more| if speed.abs() > 0.0 { speed + more.copysign(speed) } else { speed },
        )
    }

    /// How fast the wheels run that are told these speeds, m/s.
    pub(crate) fn felt(&self, speeds: Sides<f64>) -> Sides<f64> {
        speeds.zip(self.speeds, |speed, less| {
            if less > 0.0 { (speed.abs() - less).max(0.0).copysign(speed) } else { speed }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(asked: f64, made: f64, beats: i32) -> f64 {
        let mut friction = Friction::new(0.06);
        for _ in 0..beats {
            friction.learn(Sides::new(asked * 0.05, 0.0), Sides::new(made * 0.05, 0.0), Seconds(0.05));
        }
        assert!(friction.speeds.right.abs() <= 0.0, "a wheel that is not driven teaches nothing");
        friction.speeds.left
    }

    #[test]
    fn a_wheel_that_does_not_creep_is_driven_harder_within_the_bound() {
        // 0.015 m/s are lacking: 0.03 m/s in a second, after the first ten beats.
        assert!((after(0.015, 0.0, 30) - 0.03).abs() < 0.002);
        assert!((after(-0.015, 0.0, 30) - 0.03).abs() < 0.002, "backward as well");
        assert!((after(0.015, 0.0, 400) - 0.06).abs() < 1e-12, "not beyond the bound");
        // Of a faster one that stands at most 0.015 m/s are taken for lacking.
        assert!((after(0.08, 0.0, 30) - 0.03).abs() < 0.002);
    }

    #[test]
    fn a_wheel_that_obeys_runs_fast_or_is_not_seen_teaches_nothing() {
        for (asked, made) in
            [(0.015, 0.015), (0.5, 0.0), (0.08, 0.05), (0.015, f64::NAN), (f64::NAN, 0.0), (0.01, 0.02)]
        {
            assert!(after(asked, made, 40).abs() <= 0.0, "{asked} {made}");
        }
    }

    #[test]
    fn what_is_told_is_what_is_felt_and_rest_is_rest() {
        let friction = Friction { speeds: Sides::new(0.02, 0.01), ..Friction::new(0.06) };
        let told = friction.overcome(Sides::new(-0.1, 0.0));
        assert!((told.left + 0.12).abs() < 1e-12 && told.right.abs() <= 0.0);
        let felt = friction.felt(told);
        assert!((felt.left + 0.1).abs() < 1e-12 && felt.right.abs() <= 0.0);
        assert!(friction.felt(Sides::new(0.015, 0.0)).left.abs() <= 0.0, "too little to turn at all");
    }
}
