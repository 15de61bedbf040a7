//! Whether the wheels go where they are driven: a robot before a wall is commanded and makes no progress.
//!
//! What is commanded and what is covered are both forgotten within a second or so. A wheel that has been commanded a
//! way worth mentioning, and has covered a small share of it, is blocked if that lasts: a late command, a slow motor
//! and a missed beat last less.

use crate::finish::Since;
use axle_schema::{Metres, Refusal, Seconds, Sides};

/// The time constant of forgetting, s.
const FORGET: f64 = 1.0;
/// Commands below this way are not worth mentioning, m.
const WAY: f64 = 0.02;
/// A wheel that covers less than this share of what is commanded does not follow.
const SHARE: f64 = 0.25;

/// The account of both wheels.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stall {
    asked: Sides<f64>,
    made: Sides<f64>,
    since: Sides<Since>,
}

impl Stall {
    /// Counts the ways of a beat, in m: what was asked of the wheels and what they have made.
    ///
    /// # Errors
    /// Names the wheel that has been blocked for longer than `patience`.
    pub(crate) fn count(
        &mut self,
        asked: Sides<Metres>,
        made: Sides<Metres>,
        passed: Seconds,
        stamp: Seconds,
        patience: Seconds,
    ) -> Result<(), Refusal> {
        let kept = (-passed.0.max(0.0) / FORGET).exp();
        self.asked = self.asked.zip(asked, |sum, more| sum * kept + more.0.abs());
        self.made = self.made.zip(made, |sum, more| sum * kept + more.0.abs());
        let blocked = self.asked.zip(self.made, |asked, made| asked > WAY && made < asked * SHARE);
        for (side, since, blocked) in
            [("left", &mut self.since.left, blocked.left), ("right", &mut self.since.right, blocked.right)]
        {
            if since.holds(blocked, stamp).is_some_and(|time| time > patience) {
                let why = format!(
                    "the robot is blocked: the {side} wheel does not go where it is driven for {patience}; \
                     is the drive enabled, and is the way free?"
                );
                return Err(Refusal::Failed { why });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(asked: f64, made: f64, beats: i32) -> Result<(), Refusal> {
        let mut stall = Stall::default();
        (1..=beats).try_for_each(|beat| {
            let way = |speed: f64| Metres(speed * 0.05);
            let (asked, made) = (Sides::new(way(asked), way(asked)), Sides::new(way(asked), way(made)));
            stall.count(asked, made, Seconds(0.05), Seconds(f64::from(beat) * 0.05), Seconds(1.0))
        })
    }

    #[test]
    fn a_wheel_that_stands_while_it_is_driven_is_blocked_after_the_patience() {
        assert!(drive(0.5, 0.0, 20).is_ok(), "not at once");
        let words = drive(0.5, 0.0, 40).expect_err("it stands").to_string();
        assert!(words.contains("the right wheel does not go where it is driven for 1 s"), "{words}");
        assert!(drive(-0.5, 0.0, 40).is_err(), "backward as well");
    }

    #[test]
    fn a_wheel_that_follows_badly_or_is_hardly_driven_is_not_blocked() {
        assert!(drive(0.5, 0.3, 400).is_ok(), "it slips");
        assert!(drive(0.01, 0.0, 400).is_ok(), "10 mm/s may be below what moves a motor");
        assert!(drive(0.0, 0.0, 400).is_ok(), "it rests");
    }
}
