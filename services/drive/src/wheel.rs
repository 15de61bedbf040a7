//! One wheel that is driven by power: feed-forward, and a PI controller on the speed that its encoder measures.
//!
//! Symbols: v the speed asked for, m the measured one, u the power. u = v/full + kp (v - m) + ki ∫(v - m) dt, within
//! full power; the integral waits while the power is at its limit (anti-windup), and ends when the wheel shall rest and
//! does.

use axle_schema::{Duty, Metres, MetresPerSecond, Seconds};
use std::collections::VecDeque;

/// The measured speed is a mean over so much of the motor's time.
const WINDOW: Seconds = Seconds(0.05);
/// The most readings that are kept.
const MOST: usize = 32;
/// A wheel that is slower than this when it shall rest is given no power, m/s.
const REST: f64 = 0.02;

/// How a wheel is controlled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelGains {
    /// The speed at full power.
    pub full_speed: MetresPerSecond,
    /// Power for each m/s of error.
    pub kp: f64,
    /// Power for each metre of accumulated error.
    pub ki: f64,
}

/// The controller of one wheel.
#[derive(Clone, Debug)]
pub struct Wheel {
    gains: WheelGains,
    readings: VecDeque<(Seconds, Metres)>,
    integral: f64,
    now: Option<Seconds>,
}

impl Wheel {
    /// A wheel at rest.
    #[must_use]
    pub const fn new(gains: WheelGains) -> Self {
        Self { gains, readings: VecDeque::new(), integral: 0.0, now: None }
    }
    /// Hears what the encoder has counted at its own time `stamp`; what is not newer changes nothing.
    pub fn hear(&mut self, stamp: Seconds, distance: Metres) {
        if self.readings.back().is_some_and(|(newest, _)| stamp <= *newest) {
            return;
        }
        self.readings.push_back((stamp, distance));
        while self.readings.len() > MOST
            || self.readings.get(1).is_some_and(|(second, _)| stamp - *second >= WINDOW)
        {
            self.readings.pop_front();
        }
    }
    /// Forgets everything: another run of the motor's process counts anew.
    pub fn restart(&mut self) {
        *self = Self::new(self.gains);
    }
    /// The measured speed.
    #[must_use]
    pub fn speed(&self) -> MetresPerSecond {
        match (self.readings.front(), self.readings.back()) {
            (Some((from, first)), Some((to, last))) if to > from => (*last - *first) / (*to - *from),
            _ => MetresPerSecond::ZERO,
        }
    }
    /// The power for this instant.
    pub fn power(&mut self, now: Seconds, asked: MetresPerSecond) -> Duty {
        let span = self.now.map_or(0.0, |last| (now - last).0.clamp(0.0, 0.05));
        self.now = Some(now);
        let (v, m) = (asked.0, self.speed().0);
        if v.abs() <= 0.0 && m.abs() < REST {
            self.integral = 0.0;
            return Duty::default();
        }
        let WheelGains { full_speed, kp, ki } = self.gains;
        let (error, integral) = (v - m, self.integral + (v - m) * span);
        let wanted = v / full_speed.0 + kp * error + ki * integral;
        let power = wanted.clamp(-1.0, 1.0);
        // The integral may still shrink at the limit.
        if (wanted - power).abs() <= 0.0 || integral.abs() < self.integral.abs() {
            self.integral = integral;
        }
        Duty::new(power).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motor with a lag, whose full speed is `full`, followed for `seconds` with readings every 10 ms.
    fn follow(wheel: &mut Wheel, motor: &mut (f64, f64, f64), full: f64, asked: f64, seconds: f64) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few hundred beats")]
        for _ in 0..(seconds / 0.01).round() as u32 {
            let (now, speed, distance) = motor;
            let stamp = Seconds(*now);
            // The encoder counts half millimetres.
            wheel.hear(stamp, Metres((*distance / 0.0005).floor() * 0.0005));
            let u = wheel.power(stamp, MetresPerSecond(asked)).get() * full;
            *now += 0.01;
            *speed += (u - *speed) * 0.01 / 0.05;
            *distance += *speed * 0.01;
        }
    }

    #[test]
    fn a_wheel_reaches_its_speed_whatever_its_motor_is_like() {
        for full in [1.0, 1.2, 1.4] {
            for asked in [0.05, 0.5, -0.8] {
                let mut wheel = Wheel::new(WheelGains { full_speed: MetresPerSecond(1.2), kp: 0.4, ki: 2.0 });
                let mut motor = (0.0, 0.0, 0.0);
                follow(&mut wheel, &mut motor, full, asked, 2.0);
                let from = motor.2;
                follow(&mut wheel, &mut motor, full, asked, 1.0);
                assert!(
                    (motor.2 - from - asked).abs() < 0.02 * asked.abs() + 0.004,
                    "{asked} m/s, {full}: {motor:?}"
                );
                follow(&mut wheel, &mut motor, full, 0.0, 1.0);
                assert!(motor.1.abs() < 1e-3, "it comes to rest: {motor:?}");
            }
        }
    }

    #[test]
    fn a_blocked_wheel_does_not_wind_up() {
        let mut wheel = Wheel::new(WheelGains { full_speed: MetresPerSecond(1.2), kp: 0.4, ki: 2.0 });
        for beat in 0..1000 {
            let now = Seconds(f64::from(beat) * 0.01);
            wheel.hear(now, Metres::ZERO);
            assert!(wheel.power(now, MetresPerSecond(0.5)).get() <= 1.0);
        }
        assert!(wheel.integral < 0.5, "{}", wheel.integral);
        assert_eq!(wheel.power(Seconds(10.0), MetresPerSecond::ZERO), Duty::default());
    }
}
