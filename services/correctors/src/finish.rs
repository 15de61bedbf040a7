//! How a task ends: slowing down towards the goal, resting there, and giving up.
//!
//! The last command before the end is rest. A dead zone keeps the wheels from hunting to and fro, which destroyed the
//! amplifiers of the authors (paper, III.D): a robot that stands within the tolerance is not moved again.

use axle_schema::contract::Bounds;
use axle_schema::refusal::within;
use axle_schema::{Metres, MetresPerSecond, Radians, Refusal, Seconds, Track};
use serde::{Deserialize, Serialize};

/// How a task ends: the table `[finish]` of the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Finish {
    /// How close to the goal the robot must come along its way, 0.0005 to 0.1 m.
    pub tolerance: Metres,
    /// How close to a heading a turn must come, 0.001 to 0.5 rad.
    pub heading: Radians,
    /// Farther than this from the goal, to whatever side, it is missed, 0.005 to 1 m.
    pub radius: Metres,
    /// For how long the robot must stay at the goal, 0 to 5 s.
    pub settle: Seconds,
    /// For how long it may come no closer, 0.5 to 60 s.
    pub patience: Seconds,
    /// Speed near the goal for every metre that is left, 0.5 to 20 1/s.
    pub approach: f64,
    /// The slowest speed that moves the wheels, 0 to 0.1 m/s.
    pub creep: MetresPerSecond,
    /// How much more a wheel is asked for at most that does not move all the same, 0 to 0.3 m/s.
    pub push: MetresPerSecond,
}

impl Default for Finish {
    fn default() -> Self {
        Self {
            tolerance: Metres(0.004),
            heading: Radians(0.01),
            radius: Metres(0.04),
            settle: Seconds(0.2),
            patience: Seconds(4.0),
            approach: 4.0,
            creep: MetresPerSecond(0.015),
            push: MetresPerSecond(0.06),
        }
    }
}

impl Bounds for Finish {
    fn check(&self) -> Result<(), Refusal> {
        within("finish.tolerance in m", self.tolerance.0, 5e-4, 0.1)?;
        within("finish.heading in rad", self.heading.0, 1e-3, 0.5)?;
        within("finish.radius in m", self.radius.0, 5e-3, 1.0)?;
        within("finish.settle in s", self.settle.0, 0.0, 5.0)?;
        within("finish.patience in s", self.patience.0, 0.5, 60.0)?;
        within("finish.approach in 1/s", self.approach, 0.5, 20.0)?;
        within("finish.creep in m/s", self.creep.0, 0.0, 0.1)?;
        within("finish.push in m/s", self.push.0, 0.0, 0.3)
    }
}

impl Finish {
    /// The same with tolerances that encoders can resolve that leave a wheel unknown by `blur`, in m: else the robot
    /// would hunt between two ticks for ever.
    pub(crate) fn resolved(self, blur: f64, track: Track) -> Self {
        let (tolerance, heading) = (self.tolerance.0.max(blur), self.heading.0.max(blur / track.get()));
        Self { tolerance: Metres(tolerance), heading: Radians(heading), ..self }
    }

    /// The speed at which what is `left` is approached: 0 in the dead zone, then at least the creeping speed, then
    /// `approach` times what is left, and farther away what brakes at `deceleration`.
    ///
    /// `left` may be any quantity of `tolerance`'s kind; `slowest` and the result are that for a second.
    pub(crate) fn speed(&self, left: f64, zone: Zone, deceleration: f64) -> f64 {
        let distance = left.abs();
        if zone.rests(distance) {
            return 0.0;
        }
        // The line and the root meet with the same slope at 2b.
        let k = self.approach;
        let b = deceleration / (2.0 * k * k);
        let braking =
            if distance <= 2.0 * b { k * distance } else { (2.0 * deceleration * (distance - b)).sqrt() };
        braking.max(zone.slowest).copysign(left)
    }
}

/// Where what is left counts as nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Zone {
    /// What is close enough.
    pub(crate) tolerance: f64,
    /// The slowest speed outside.
    pub(crate) slowest: f64,
    /// Whether the wheels stand already.
    pub(crate) stands: bool,
}

impl Zone {
    /// Wheels that run stop within half of the tolerance, and stay at rest within all of it.
    pub(crate) fn rests(&self, distance: f64) -> bool {
        distance <= self.tolerance * if self.stands { 1.0 } else { 0.5 }
    }
}

/// Since when something has held, by the stamps of the measurements.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Since(Option<Seconds>);

impl Since {
    /// For how long `holds` has been true at `stamp`; nothing while it is not.
    pub(crate) fn holds(&mut self, holds: bool, stamp: Seconds) -> Option<Seconds> {
        self.0 = if holds { self.0.or(Some(stamp)) } else { None };
        self.0.map(|since| stamp - since)
    }
}

/// Whether what is left of a task becomes less.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Progress {
    least: f64,
    since: Option<Seconds>,
}

impl Progress {
    /// Less than this is noise, m.
    const STEP: f64 = 0.005;

    pub(crate) const fn new() -> Self {
        Self { least: f64::INFINITY, since: None }
    }

    /// For how long what is `left`, in m, has not become less.
    pub(crate) fn wait(&mut self, left: f64, stamp: Seconds) -> Seconds {
        let is_closer = left < self.least - Self::STEP;
        match self.since {
            Some(since) if !is_closer => stamp - since,
            _ => {
                (self.least, self.since) = (left, Some(stamp));
                Seconds::ZERO
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ZONE: Zone = Zone { tolerance: 0.004, slowest: 0.015, stands: false };

    #[test]
    fn the_approach_brakes_then_fades_then_creeps_then_rests() {
        let finish = Finish::default();
        // 1.2 m/s² and 4 1/s: the root ends at 1.2/16 = 0.075 m, where both are 0.3 m/s.
        let table = [(0.0, 0.0), (0.002, 0.0), (0.003, 0.015), (0.05, 0.2), (0.075, 0.3), (-0.075, -0.3)];
        for (left, speed) in table {
            assert!((finish.speed(left, ZONE, 1.2) - speed).abs() < 1e-12, "{left} m");
        }
        let far = finish.speed(1.0, ZONE, 1.2);
        assert!((far * far / 2.4 - (1.0 - 0.0375)).abs() < 1e-12, "{far}");
        let standing = Zone { stands: true, ..ZONE };
        assert!(finish.speed(0.004, standing, 1.2).abs() < 1e-12, "a robot that stands is not moved again");
    }

    #[test]
    fn what_holds_is_timed_from_the_first_stamp_on() {
        let mut since = Since::default();
        assert_eq!(since.holds(false, Seconds(1.0)), None);
        assert_eq!(since.holds(true, Seconds(2.0)), Some(Seconds(0.0)));
        assert_eq!(since.holds(true, Seconds(3.0)), Some(Seconds(1.0)));
        assert_eq!(since.holds(false, Seconds(4.0)), None);
    }

    #[test]
    fn what_does_not_become_less_is_waited_for() {
        let mut progress = Progress::new();
        assert_eq!(progress.wait(1.0, Seconds(0.0)), Seconds(0.0));
        assert_eq!(progress.wait(0.999, Seconds(1.0)), Seconds(1.0));
        assert_eq!(progress.wait(0.99, Seconds(2.0)), Seconds(0.0));
        assert_eq!(progress.wait(f64::NAN, Seconds(3.0)), Seconds(1.0), "no number is no progress");
    }
}
