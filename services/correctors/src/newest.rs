//! The newest measurement of a kind, and whether it can be believed.
//!
//! A corrector has two clocks: that of its beats, `seen.at`, and that of the robot, which stamps the measurements.
//! Here they meet: a measurement is as old as the beats that have passed since it was first seen. Measurements that
//! stop, that come from a robot that has restarted, or that no robot can have made end the task with a reason; a single
//! wrong one is passed over.

use axle_schema::contract::Bounds;
use axle_schema::refusal::within;
use axle_schema::series::Datum as _;
use axle_schema::{Drivetrain, EncodersData, Metres, NavigatorData, Refusal, Seconds, Track};
use serde::{Deserialize, Serialize};

/// A stamp that is off by more than this, in s, is of a robot that has restarted or of a broken clock.
const RESTART: f64 = 1.0;
/// How many times its largest speed a wheel is believed, since a description of a robot is never exact.
const BELIEF: f64 = 1.5;
/// This many measurements in a row that no robot can have made are not passed over any more.
const DOUBTS: u8 = 3;

/// What a corrector believes of the measurements: the table `[watch]` of its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Watch {
    /// Without a new measurement for this long the task fails, 0.1 to 5 s.
    pub silence: Seconds,
    /// How much farther than its speed allows a wheel may seem to have come between two measurements, 0.001 to 10 m.
    pub jump: Metres,
    /// A robot that does not go where it is driven for this long is blocked, and the task fails, 0.1 to 60 s.
    pub blocked: Seconds,
}

impl Default for Watch {
    fn default() -> Self {
        Self { silence: Seconds(0.5), jump: Metres(0.05), blocked: Seconds(1.0) }
    }
}

impl Bounds for Watch {
    fn check(&self) -> Result<(), Refusal> {
        within("watch.silence in s", self.silence.0, 0.1, 5.0)?;
        within("watch.jump in m", self.jump.0, 1e-3, 10.0)?;
        within("watch.blocked in s", self.blocked.0, 0.1, 60.0)
    }
}

/// What can be measured again and again.
pub(crate) trait Measured: Copy {
    /// Its name in messages.
    const NAME: &'static str;
    /// When it was measured, by the robot's clock.
    fn stamp(&self) -> Seconds;
    /// How far a wheel must at least have come from here to `next`, m; not a number if either is broken.
    fn way_to(&self, next: &Self, track: Track) -> f64;
}

impl Measured for EncodersData {
    const NAME: &'static str = "the distances of the wheels";
    fn stamp(&self) -> Seconds {
        self.stamp
    }
    fn way_to(&self, next: &Self, _: Track) -> f64 {
        let span = self.span_to(next);
        // A sum of squares stays NaN, where a maximum would lose it.
        span.left.0.hypot(span.right.0) / std::f64::consts::SQRT_2
    }
}

impl Measured for NavigatorData {
    const NAME: &'static str = "the pose";
    fn stamp(&self) -> Seconds {
        self.stamp
    }
    fn way_to(&self, next: &Self, track: Track) -> f64 {
        let turn = (next.pose.heading - self.pose.heading).wrapped();
        self.pose.distance(next.pose).0.max(turn.0.abs() * track.get() / 2.0)
            // The maximum passes over one number that is none; this does not.
            + 0.0 * (next.pose.x.0 + next.pose.y.0 + next.pose.heading.0)
    }
}

/// The newest measurement that is believed.
#[derive(Clone, Debug)]
pub(crate) struct Newest<M> {
    value: M,
    /// The stamp of the first one.
    begin: Seconds,
    /// The beat at which it was first seen.
    heard: Seconds,
    /// How many have not been believed since, and the stamp of the last of them.
    doubts: u8,
    doubted: Option<Seconds>,
    watch: Watch,
    robot: Drivetrain,
}

impl<M: Measured> Newest<M> {
    /// Begins with the first measurement, seen at the beat `at`.
    ///
    /// # Errors
    /// Refuses a measurement that is missing or broken, with what to do.
    pub(crate) fn new(
        first: Option<M>,
        at: Seconds,
        watch: Watch,
        robot: Drivetrain,
    ) -> Result<Self, Refusal> {
        let whole = |first: &M| first.stamp().is_finite() && first.way_to(first, robot.track).is_finite();
        let Some(value) = first.filter(whole) else {
            let hint = "start the robot or the emulator, source and navigator, and look whether they speak";
            return Err(Refusal::unavailable(M::NAME, hint));
        };
        let begin = value.stamp();
        Ok(Self { value, begin, heard: at, doubts: 0, doubted: None, watch, robot })
    }

    /// Takes what is seen at the beat `at`; says the measurement before it if it is new and believed.
    ///
    /// # Errors
    /// Fails after a silence, a restart of the robot, and when measurements jump again and again.
    pub(crate) fn hear(&mut self, seen: Option<M>, at: Seconds) -> Result<Option<M>, Refusal> {
        let before = match seen {
            Some(next) => self.consider(next, at)?,
            None => None,
        };
        let age = self.age(at);
        // No time is no better than a long one.
        if (0.0..=self.watch.silence.0).contains(&age.0) {
            return Ok(before);
        }
        let why = format!("no measurement for {age:.2} of {}, the robot or the link is silent", M::NAME);
        Err(Refusal::Failed { why })
    }

    fn consider(&mut self, next: M, at: Seconds) -> Result<Option<M>, Refusal> {
        let since = next.stamp() - self.value.stamp();
        if since.0 < -RESTART {
            let (was, is) = (self.value.stamp(), next.stamp());
            let why = format!("the robot restarted: its clock went back from {was:.3} to {is:.3}");
            return Err(Refusal::Failed { why });
        }
        let is_same = |doubted: Seconds| doubted.0.to_bits() == next.stamp().0.to_bits();
        let is_new = since.0 > 0.0 && !self.doubted.is_some_and(is_same);
        if !is_new {
            return Ok(None);
        }
        let way = self.value.way_to(&next, self.robot.track);
        let reach = BELIEF * self.robot.wheel_speed.0 * since.0 + self.watch.jump.0;
        if (0.0..=reach).contains(&way) && since.0 <= self.age(at).0 + RESTART {
            let before = std::mem::replace(&mut self.value, next);
            self.heard = at;
            (self.doubts, self.doubted) = (0, None);
            return Ok(Some(before));
        }
        self.doubts += 1;
        self.doubted = Some(next.stamp());
        if self.doubts < DOUBTS {
            return Ok(None);
        }
        let why = format!(
            "measurements of {} cannot be believed: they jumped by {way:.3} m in {since:.3}, allowed is {reach:.3} m",
            M::NAME
        );
        Err(Refusal::Failed { why })
    }

    /// The measurement.
    pub(crate) const fn value(&self) -> &M {
        &self.value
    }
    /// Time since the first measurement, by the robot's clock.
    pub(crate) fn elapsed(&self) -> Seconds {
        self.value.stamp() - self.begin
    }
    /// Time since the measurement was first seen, by the beats.
    pub(crate) fn age(&self, at: Seconds) -> Seconds {
        at - self.heard
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(stamp: f64, left: f64) -> Option<EncodersData> {
        Some(EncodersData { stamp: Seconds(stamp), left: Metres(left), right: Metres(0.0) })
    }
    fn newest() -> Newest<EncodersData> {
        let (watch, robot) = (Watch::default(), Drivetrain::default());
        Newest::new(at(5.0, 0.0), Seconds(0.0), watch, robot).expect("a first measurement")
    }

    #[test]
    fn a_single_wrong_measurement_is_passed_over_and_a_third_one_in_a_row_is_too_much() {
        for wrong in [at(5.1, 3.0), at(5.1, f64::NAN), at(1e9, 0.0), at(f64::INFINITY, 0.0)] {
            let mut newest = newest();
            for beat in [0.1, 0.15, 0.2] {
                assert_eq!(newest.hear(wrong, Seconds(beat)), Ok(None), "{wrong:?} is seen at three beats");
            }
            let next = newest.hear(at(5.25, 0.1), Seconds(0.25)).expect("it is good");
            assert!(next.is_some() && (newest.elapsed().0 - 0.25).abs() < 1e-12, "{wrong:?}");
        }
        let mut newest = newest();
        assert!(
            newest.hear(at(5.1, 3.0), Seconds(0.1)).is_ok()
                && newest.hear(at(5.2, 4.0), Seconds(0.2)).is_ok()
        );
        let words = newest.hear(at(5.3, 3.0), Seconds(0.3)).expect_err("three").to_string();
        assert!(
            words.contains("of the distances of the wheels cannot be believed: they jumped by 2.121 m"),
            "{words}"
        );
    }

    #[test]
    fn silence_and_time_that_is_none_fail() {
        assert!(newest().hear(at(5.0, 0.0), Seconds(0.5)).is_ok());
        for (seen, beat) in [(at(5.0, 0.0), 0.51), (None, 0.51), (None, f64::NAN), (at(4.5, 0.0), -1.0)] {
            let words = newest().hear(seen, Seconds(beat)).expect_err("silence").to_string();
            assert!(words.contains("silent"), "{words}");
        }
        let back = newest().hear(at(3.9, 0.0), Seconds(0.1)).expect_err("a restart").to_string();
        assert!(back.contains("its clock went back from 5.000 s to 3.900 s"), "{back}");
    }
}
