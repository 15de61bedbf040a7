//! The motors: from the speed that a wheel is asked for to the speed that its rim has.

use crate::params::{BatteryParams, EmulatorParams, MotorsParams};
use crate::response::Memory;
use axle_schema::{MetresPerSecond, Seconds, Sides};

/// The least share of its speed that an empty battery leaves to a wheel.
const LAST: f64 = 0.1;

/// What a wheel is slower or faster than its target by, in m/s, when it has reached it.
const NOTHING: f64 = 1e-9;

/// A wheel that is slower than this, in m/s, stands as far as friction at rest is concerned.
const STANDING: f64 = 1e-4;

/// Two motors on one battery.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Motors {
    params: MotorsParams,
    battery: BatteryParams,
    /// What the battery gives now, as a share of what it gives when it is full and nobody drives.
    power: f64,
    /// The speed at which the sag of the battery is told.
    full: MetresPerSecond,
    /// How much faster than asked each wheel drives: the same all its life.
    gains: Sides<f64>,
    /// Where the rims are heading to: what they would run at without lag.
    target: Sides<MetresPerSecond>,
    /// How fast they run.
    rim: Sides<MetresPerSecond>,
    /// What motors remember whose response is a polynomial.
    memory: Sides<Memory>,
}

/// What the rims do in an interval.
pub(crate) struct Turned {
    /// Speeds at its beginning and at its end.
    pub(crate) start: Sides<MetresPerSecond>,
    pub(crate) end: Sides<MetresPerSecond>,
    /// How much the mean speed is above the middle of the two.
    pub(crate) bulge: Sides<MetresPerSecond>,
}

impl Motors {
    /// Motors that stand, with these gains.
    pub(crate) fn new(params: &EmulatorParams, gains: Sides<f64>) -> Self {
        Self {
            params: params.motors,
            battery: params.battery,
            power: 1.0,
            full: params.robot.wheel_speed,
            gains,
            target: Sides::default(),
            rim: Sides::default(),
            memory: Sides::default(),
        }
    }

    /// How fast the rims run.
    pub(crate) const fn rim(&self) -> Sides<MetresPerSecond> {
        self.rim
    }

    /// What the battery gives now, as a share of what it gives when it is full and nobody drives.
    pub(crate) const fn power(&self) -> f64 {
        self.power
    }

    /// Moves on by `duration`, until the time `now` since boot; what is asked goes linearly to `asked`.
    ///
    /// The lag is that of first order, solved exactly for a target u that changes linearly: with the time constant τ
    /// and a = u̇, v(t) = u(t) - aτ + (v(0) - u(0) + aτ)·e^(-t/τ).
    pub(crate) fn turn(&mut self, asked: Sides<MetresPerSecond>, duration: Seconds, now: Seconds) -> Turned {
        let (start, from) = (self.rim, self.target);
        self.target = self.targets(asked, now);
        let response = self.params.response;
        if response.time > Seconds::ZERO {
            let change = self.target.zip(from, |to, from| (to - from).0);
            let asked = change.zip(response.sides(), |change, coefficients| (change, coefficients));
            let turned = |memory: &mut Memory, (change, coefficients): (f64, [f64; 5])| {
                MetresPerSecond(memory.turn(change, duration.0, response.time.0, &coefficients))
            };
            let Sides { left, right } = &mut self.memory;
            self.rim = Sides::new(turned(left, asked.left), turned(right, asked.right));
            // Beats are short beside the response: the mean speed of one is the middle of its ends.
            return Turned { start, end: self.rim, bulge: Sides::default() };
        }
        let (lag, time) = (self.params.lag.0, duration.0);
        if lag > 0.0 {
            let decay = (-time / lag).exp();
            let bend = |u0: MetresPerSecond, u1: MetresPerSecond| (u1.0 - u0.0) / time * lag;
            let behind = start.zip(from, |v, u| v.0 - u.0).zip(from.zip(self.target, bend), |d, b| d + b);
            // Else a wheel would come to rest never, only ever nearer.
            let behind = behind.map(|speed| if speed.abs() > NOTHING { speed } else { 0.0 });
            let tail = self.target.zip(from.zip(self.target, bend), |u, b| u.0 - b);
            self.rim = tail.zip(behind, |t, d| MetresPerSecond(t + d * decay));
            let mean = from.zip(self.target, |u0, u1| f64::midpoint(u0.0, u1.0) - bend(u0, u1));
            let mean = mean.zip(behind, |m, d| m + d * lag / time * (1.0 - decay));
            let middle = start.zip(self.rim, |v0, v1| f64::midpoint(v0.0, v1.0));
            let bulge = mean.zip(middle, |mean, middle| MetresPerSecond(mean - middle));
            return Turned { start, end: self.rim, bulge };
        }
        self.rim = self.target;
        Turned { start, end: self.rim, bulge: Sides::default() }
    }

    /// What the rims would run at in the long run.
    fn targets(&mut self, asked: Sides<MetresPerSecond>, now: Seconds) -> Sides<MetresPerSecond> {
        let stuck = self.rim.zip(self.target, |rim, target| rim.0.abs() < STANDING && target.0 == 0.0);
        let loose =
            asked.zip(stuck.zip(self.params.breakaway, |s, b| (s, b)), |speed, (stuck, breakaway)| {
                if stuck && speed.abs() < breakaway { MetresPerSecond::ZERO } else { self.rubbed(speed) }
            });
        let gains = self.gains.zip(self.params.backward, |gain, backward| (gain, backward));
        let free = loose.zip(gains, |speed, (gain, backward)| {
            // A product with 1 is exact.
            speed * (gain * if speed.0 < 0.0 { backward } else { 1.0 })
        });
        let BatteryParams { sag, drain } = self.battery;
        let load = (free.left.0.abs() + free.right.0.abs()) / (2.0 * self.full.0);
        let power = ((1.0 - sag * load) * (1.0 - drain * now.0 / 3600.0)).max(LAST);
        self.power = power;
        let top = self.params.saturation.0;
        // A product with 1 is exact: without a battery that tires, nothing here changes a bit.
        free.map(|speed| MetresPerSecond((speed.0 * power).clamp(-top, top)))
    }

    /// The speed less the friction.
    fn rubbed(&self, speed: MetresPerSecond) -> MetresPerSecond {
        let band = self.params.dead_band.0;
        if band > 0.0 { MetresPerSecond((speed.0.abs() - band).max(0.0).copysign(speed.0)) } else { speed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motors(change: impl FnOnce(&mut EmulatorParams)) -> Motors {
        let mut params = EmulatorParams::default();
        change(&mut params);
        Motors::new(&params, Sides::new(1.0, 1.0))
    }
    fn both(speed: f64) -> Sides<MetresPerSecond> {
        Sides::new(MetresPerSecond(speed), MetresPerSecond(speed))
    }

    #[test]
    fn after_the_time_constant_63_percent_of_a_step_are_done_in_steps_of_any_length() {
        for steps in [1, 7, 1000] {
            let mut motors = motors(|params| params.motors.lag = Seconds(0.1));
            // A step: the target is there before time goes on.
            motors.target = both(1.0);
            let step = 0.1 / f64::from(steps);
            let mut covered = 0.0;
            for _ in 0..steps {
                let Turned { start, end, bulge } = motors.turn(both(1.0), Seconds(step), Seconds::ZERO);
                covered += (f64::midpoint(start.left.0, end.left.0) + bulge.left.0) * step;
            }
            let e = (-1.0_f64).exp();
            assert!((motors.rim().left.0 - (1.0 - e)).abs() < 1e-12, "{steps} steps: {:?}", motors.rim());
            // The integral of 1 - e^(-t/τ) up to τ is τ/e.
            assert!((covered - 0.1 * e).abs() < 1e-12, "{steps} steps: {covered} m");
        }
    }

    #[test]
    fn a_ramp_is_followed_one_time_constant_behind() {
        let mut motors = motors(|params| params.motors.lag = Seconds(0.05));
        for step in 1..=1000_u32 {
            let time = f64::from(step) * 0.001;
            motors.turn(both(time), Seconds(0.001), Seconds(time));
        }
        assert!((motors.rim().right.0 - 0.95).abs() < 1e-6, "{:?}", motors.rim());
    }

    #[test]
    fn a_standing_wheel_breaks_loose_later_than_a_running_one_stops() {
        let mut motors = motors(|params| {
            params.motors.dead_band = MetresPerSecond(0.02);
            params.motors.breakaway = Sides::new(MetresPerSecond(0.05), MetresPerSecond(0.01));
            params.motors.backward = Sides::new(1.0, 0.5);
        });
        let mut left = Vec::new();
        for asked in [0.04, 0.06, 0.04, 0.01, 0.04] {
            motors.turn(both(asked), Seconds(0.01), Seconds::ZERO);
            left.push((motors.rim().left.0 * 1000.0).round());
        }
        assert_eq!(left, [0.0, 40.0, 20.0, 0.0, 0.0]);
        motors.turn(both(-0.06), Seconds(0.01), Seconds::ZERO);
        assert!((motors.rim().right.0 + 0.02).abs() < 1e-12, "half as fast backward: {:?}", motors.rim());
    }

    #[test]
    fn friction_saturation_and_an_empty_battery_take_their_share() {
        let rim = |change: fn(&mut EmulatorParams), asked: f64, now: f64| {
            let mut motors = motors(change);
            motors.turn(both(asked), Seconds(0.01), Seconds(now));
            motors.rim().left.0
        };
        let band: fn(&mut EmulatorParams) = |params| params.motors.dead_band = MetresPerSecond(0.02);
        for (asked, runs) in [(0.01, 0.0), (-0.02, 0.0), (0.05, 0.03), (-0.05, -0.03)] {
            assert!((rim(band, asked, 0.0) - runs).abs() < 1e-15, "asked for {asked}");
        }
        let top = rim(|params| params.motors.saturation = MetresPerSecond(0.4), -0.7, 0.0);
        assert!((top + 0.4).abs() < 1e-15, "{top}");
        // 10 % at 1 m/s are 5 % at 0.5 m/s.
        assert!((rim(|params| params.battery.sag = 0.1, 0.5, 0.0) - 0.475).abs() < 1e-15);
        assert!((rim(|params| params.battery.drain = 0.5, 0.5, 1800.0) - 0.375).abs() < 1e-15);
        assert!((rim(|params| params.battery.drain = 1.0, 0.5, 1e6) - 0.05).abs() < 1e-15, "never nothing");
    }
}
