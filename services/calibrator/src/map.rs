//! The map between what the robot is described as and what it is: speeds to signals, counts to distances, and back.
//!
//! A robot with an effective track b that is described with b₀ turns b₀/b as far as everybody believes. So the map
//! stretches the difference of its wheels by b/b₀ on the way to the motors, and shrinks it on the way back: the robot
//! behaves as described, and nobody else has to be told. Where the description has the measured track, this is nothing.

use axle_schema::calibration::{Branch, WheelMap};
use axle_schema::unit::Numbers;
use axle_schema::{
    Calibration, Duty, Metres, MetresPerSecond, MetresPerSecondSquared, Refusal, Sides, Signals, Track,
};

/// Below this speed, in m/s, friction is made up for in proportion, so that a wheel that shall rest is not shaken.
const CREEP: f64 = 0.005;
/// No wheel is faster, m/s.
const FASTEST: f64 = axle_schema::dwm::MAX_WHEEL_SPEED;

/// A calibration that can be applied.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    calibration: Calibration,
    /// The measured track as a share of the described one.
    stretch: f64,
}

impl Map {
    /// The map of a robot that is described with this track.
    ///
    /// # Errors
    /// Refuses a calibration with numbers out of range, and one whose track is less than half or more than twice the
    /// described one: it is of another robot.
    pub fn new(calibration: Calibration, described: Track) -> Result<Self, Refusal> {
        calibration.validate()?;
        let stretch = calibration.track.map_or(1.0, |track| track.get() / described.get());
        axle_schema::refusal::within(
            "track of the calibration as a share of robot.track",
            stretch,
            0.5,
            2.0,
        )?;
        Ok(Self { calibration, stretch })
    }

    /// What it was made from.
    #[must_use]
    pub const fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The signals that give these speeds, with these accelerations, to the wheels of the described robot; within full
    /// power.
    #[must_use]
    pub fn signals(
        &self,
        speeds: Sides<MetresPerSecond>,
        accelerations: Sides<MetresPerSecondSquared>,
    ) -> Signals {
        let speeds = stretched(speeds.map(|speed| speed.0), self.stretch);
        let accelerations = stretched(accelerations.map(|acceleration| acceleration.0), self.stretch);
        let wheels = &self.calibration.wheels;
        let signals = Sides::new(
            signal(&wheels.left, speeds.left, accelerations.left),
            signal(&wheels.right, speeds.right, accelerations.right),
        );
        let Sides { left, right } = self.calibration.motors.to_channels(signals).map(duty);
        Signals { left, right }
    }

    /// The speeds that these signals give to the wheels of the described robot in the long run.
    #[must_use]
    pub fn speeds(&self, signals: Signals) -> Sides<MetresPerSecond> {
        let channels = Sides::new(signals.left.get(), signals.right.get());
        let signals = self.calibration.motors.to_wheels(channels);
        let wheels = &self.calibration.wheels;
        let speeds = Sides::new(speed(&wheels.left, signals.left), speed(&wheels.right, signals.right));
        stretched(speeds, 1.0 / self.stretch).map(MetresPerSecond)
    }

    /// What the wheels of the described robot have covered when the channels of the encoders have counted this.
    #[must_use]
    pub fn distances(&self, counted: Sides<Metres>) -> Sides<Metres> {
        let wheels = self.calibration.encoders.to_wheels(counted.map(|distance| distance.0));
        let covered = wheels.zip(self.calibration.scale, |counted, scale| counted * scale.0);
        stretched(covered, 1.0 / self.stretch).map(Metres)
    }
}

/// Both numbers with so many times the difference, and the same mean.
fn stretched(both: Sides<f64>, times: f64) -> Sides<f64> {
    // Two roundings that a robot as described can do without.
    #[allow(clippy::float_cmp, reason = "exactly 1 where nothing was measured")]
    if times == 1.0 {
        return both;
    }
    let (mean, half) = (f64::midpoint(both.left, both.right), (both.right - both.left) / 2.0 * times);
    Sides::new(mean - half, mean + half)
}

/// The nearest signal that a motor can be given; none where it is no number.
fn duty(signal: f64) -> Duty {
    Duty::new(signal.clamp(-1.0, 1.0)).unwrap_or_default()
}

fn branch(wheel: &WheelMap, ahead: bool) -> &Branch {
    if ahead { &wheel.forward } else { &wheel.backward }
}

/// The signal of one wheel.
pub(crate) fn signal(wheel: &WheelMap, speed: f64, acceleration: f64) -> f64 {
    if speed == 0.0 && acceleration == 0.0 {
        return 0.0;
    }
    let direction = if speed == 0.0 { acceleration.signum() } else { speed.signum() };
    let branch = branch(wheel, direction > 0.0);
    let magnitude = speed.abs();
    let steady = if magnitude < CREEP {
        steady(branch, CREEP) * (magnitude / CREEP)
    } else {
        steady(branch, magnitude)
    };
    direction * steady + branch.ka * acceleration
}

/// The signal that keeps a speed.
fn steady(branch: &Branch, v: f64) -> f64 {
    if let Some(along) = along(&branch.points, 0, v) {
        return along;
    }
    let bent = branch.curve.iter().rev().fold(0.0, |sum, c| sum * v + c.0) * v * v;
    branch.ks + branch.kv * v + bent
}

/// The speed of one wheel in the long run, from rest.
pub(crate) fn speed(wheel: &WheelMap, signal: f64) -> f64 {
    let branch = branch(wheel, signal > 0.0);
    let magnitude = signal.abs();
    if magnitude <= branch.dead_band {
        return 0.0;
    }
    let speed = match along(&branch.points, 1, magnitude) {
        Some(speed) => speed.max(0.0),
        None if branch.curve.is_empty() => ((magnitude - branch.ks) / branch.kv).max(0.0),
        None => crossing(branch, magnitude),
    };
    speed.min(FASTEST).copysign(signal)
}

/// The least speed that needs this signal, by bisection.
fn crossing(branch: &Branch, signal: f64) -> f64 {
    let (mut low, mut high) = (0.0, FASTEST);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if steady(branch, middle) < signal { low = middle } else { high = middle }
    }
    high
}

/// The other number of a pair whose number `of` is `value`, along straight lines between the points and beyond them.
fn along(points: &[Numbers<2>], of: usize, value: f64) -> Option<f64> {
    let last = points.len().checked_sub(2)?;
    let place = points.iter().skip(1).take(last).take_while(|point| point.0[of] < value).count();
    let (from, to) = (points[place].0, points[place + 1].0);
    let other = 1 - of;
    Some(from[other] + (value - from[of]) / (to[of] - from[of]) * (to[other] - from[other]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::calibration::Wiring;
    use axle_schema::unit::Ratio;
    use proptest::prelude::*;

    fn speeds(left: f64, right: f64) -> Sides<MetresPerSecond> {
        Sides::new(MetresPerSecond(left), MetresPerSecond(right))
    }
    const STEADY: Sides<MetresPerSecondSquared> =
        Sides::new(MetresPerSecondSquared(0.0), MetresPerSecondSquared(0.0));

    /// A robot with everything wrong: other motors in each direction, a bent one, one of points, channels crossed.
    fn crooked() -> Calibration {
        let branch = |ks: f64, kv: f64| Branch { dead_band: ks, ks, kv, ka: 0.05, ..Branch::default() };
        let bent = Branch { curve: vec![Ratio(0.1), Ratio(0.02)], ..branch(0.02, 0.7) };
        let points = [[0.0, 0.03], [0.3, 0.2], [0.6, 0.5]].map(Numbers).to_vec();
        Calibration {
            track: Some(Track::new(Metres(0.33)).expect("a track")),
            scale: Sides::new(Ratio(1.1), Ratio(0.9)),
            motors: Wiring { swapped: true, inverted: Sides::new(true, false) },
            encoders: Wiring { swapped: false, inverted: Sides::new(false, true) },
            wheels: Sides::new(
                WheelMap { forward: branch(0.05, 0.9), backward: bent },
                WheelMap { forward: Branch { points, ..branch(0.0, 1.0) }, backward: branch(0.1, 0.8) },
            ),
            ..Calibration::default()
        }
    }
    fn map(calibration: Calibration) -> Map {
        Map::new(calibration, Track::new(Metres(0.3)).expect("a track")).expect("a map")
    }

    #[test]
    fn an_unmeasured_robot_is_as_described() {
        let map = map(Calibration::default());
        let signals = map.signals(speeds(0.6, -0.3), STEADY);
        assert!((signals.left.get() - 0.5).abs() < 1e-15 && (signals.right.get() + 0.25).abs() < 1e-15);
        let counted = Sides::new(Metres(1.25), Metres(-0.5));
        assert_eq!(map.distances(counted), counted);
    }

    #[test]
    fn channels_and_the_track_are_set_right() {
        let map = map(crooked());
        // Straight on the track does not matter; the left wheel hears the inverted right channel.
        let signals = map.signals(speeds(0.3, 0.3), STEADY);
        assert!((signals.right.get() + (0.05 + 0.27)).abs() < 1e-12, "{signals:?}");
        assert!((signals.left.get() - 0.2).abs() < 1e-12, "{signals:?}");
        let covered = map.distances(Sides::new(Metres(1.0), Metres(-1.0)));
        // The wheels have covered 1.1 and 0.9 m; half of their difference shrinks by 0.3/0.33.
        assert!((covered.left.0 - (1.0 + 0.1 / 1.1)).abs() < 1e-12, "{covered:?}");
        assert!((covered.right.0 - (1.0 - 0.1 / 1.1)).abs() < 1e-12, "{covered:?}");
    }

    #[test]
    fn inertia_takes_its_signal_and_full_power_is_the_most() {
        let map = map(Calibration { wheels: crooked().wheels, ..Calibration::default() });
        let faster = Sides::new(MetresPerSecondSquared(1.0), MetresPerSecondSquared(-1.0));
        let signals = map.signals(speeds(0.3, -0.3), faster);
        assert!((signals.left.get() - 0.37).abs() < 1e-12 && (signals.right.get() + 0.39).abs() < 1e-12);
        let signals = map.signals(speeds(20.0, f64::NAN), STEADY);
        assert_eq!((signals.left.get(), signals.right.get()), (1.0, 0.0));
        assert_eq!(map.signals(speeds(0.0, 0.0), STEADY), Signals::default());
    }

    #[test]
    fn the_calibration_of_another_robot_is_refused() {
        let other = Calibration { track: Some(Track::new(Metres(1.0)).expect("a track")), ..crooked() };
        assert!(Map::new(other, Track::new(Metres(0.3)).expect("a track")).is_err());
    }

    proptest! {
        #[test]
        fn signals_and_speeds_are_inverse(left in -0.8..0.8_f64, right in -0.5..0.5_f64) {
            let map = map(crooked());
            let asked = speeds(left, right);
            let physical = stretched(Sides::new(left, right), map.stretch);
            prop_assume!(physical.both().iter().all(|speed| speed.abs() > CREEP));
            let signals = map.signals(asked, STEADY);
            prop_assume!(signals.left.get().abs() < 1.0 && signals.right.get().abs() < 1.0);
            let back = map.speeds(signals);
            prop_assert!((back.left - asked.left).0.abs() < 1e-9 && (back.right - asked.right).0.abs() < 1e-9, "{back:?}");
        }
    }
}
