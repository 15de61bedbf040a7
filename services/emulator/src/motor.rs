//! One motor with its encoder in software: a wheel that is a service of its own.
//!
//! *Hears* [`MotorPower`], *says* [`MotorReading`]. It is a small gate of its own, for the same reasons as the gate of a
//! robot: a power counts for this boot only, in order, if it echoes the motor's clock of at most `max_age` ago, and only
//! until nothing has come for `silence`. So neither a burst of old powers nor a sender that died turns the wheel.
//!
//! The motor runs after its power with a lag of first order, and a constant share faster or slower than it should.

use crate::random::Random;
use axle_schema::command::Reject;
use axle_schema::contract::{Bounds, Params};
use axle_schema::differential_drive::{MotorPower, MotorReading};
use axle_schema::refusal::within;
use axle_schema::{Boot, Duty, Metres, MetresPerSecond, Refusal, Seconds, Tick};
use serde::{Deserialize, Serialize};

/// Parameters of an emulated motor: `deploy/params/motor-left.toml` and `motor-right.toml`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotorParams {
    /// Where its gain is drawn from; the two sides draw different ones from the same seed.
    pub seed: u64,
    /// Speed of the rim at full power, 0.001 to 20 m/s.
    pub full_speed: MetresPerSecond,
    /// Time in which 63 % of a change of speed is done, 0.005 to 1 s.
    pub lag: Seconds,
    /// Standard deviation of the gain around 1, 0 to 0.1.
    pub gain_deviation: f64,
    /// Whether it has an encoder; without one, a service `encoder-…` has to say what the wheel does.
    pub encoder: bool,
    /// Distance of the rim from tick to tick of the encoder, 1e-6 to 0.1 m.
    pub tick: Metres,
    /// Readings in a second, 20 to 200.
    pub rate: f64,
    /// The oldest echo that a power may carry, 0.05 to 1 s.
    pub max_age: Seconds,
    /// Without a power for this long the motor stops, 0.05 to 0.5 s.
    pub silence: Seconds,
}

impl Default for MotorParams {
    fn default() -> Self {
        Self {
            seed: 1,
            full_speed: MetresPerSecond(1.2),
            lag: Seconds(0.05),
            gain_deviation: 0.03,
            encoder: true,
            tick: Metres(0.0005),
            rate: 100.0,
            max_age: Seconds(0.25),
            silence: Seconds(0.2),
        }
    }
}

impl Bounds for MotorParams {
    fn check(&self) -> Result<(), Refusal> {
        within("full_speed in m/s", self.full_speed.0, 1e-3, 20.0)?;
        within("lag in s", self.lag.0, 0.005, 1.0)?;
        within("gain_deviation", self.gain_deviation, 0.0, 0.1)?;
        within("tick in m", self.tick.0, 1e-6, 0.1)?;
        within("rate", self.rate, 20.0, 200.0)?;
        within("max_age in s", self.max_age.0, 0.05, 1.0)?;
        within("silence in s", self.silence.0, 0.05, 0.5)
    }
}

impl Params for MotorParams {
    const FILE: &'static str = include_str!("../../../deploy/params/motor-left.toml");
}

/// The parameters file of the right motor: the same values.
pub const RIGHT_MOTOR: &str = include_str!("../../../deploy/params/motor-right.toml");

/// A motor that stands at first.
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    params: MotorParams,
    boot: Boot,
    gain: f64,
    now: Seconds,
    power: Duty,
    speed: f64,
    distance: f64,
    /// When the newest power was accepted, its number, and its echo. The echo stays when the power has run out.
    heard: Option<(Seconds, u32)>,
    echo: Option<Tick>,
}

impl Motor {
    /// The motor number `side` (0 left, 1 right) of the robot that `params.seed` describes.
    ///
    /// # Errors
    /// Refuses parameters out of range.
    pub fn new(params: MotorParams, boot: Boot, side: u64) -> Result<Self, Refusal> {
        params.check()?;
        let gain = 1.0 + params.gain_deviation * Random::new(params.seed, side).normal().clamp(-3.0, 3.0);
        Ok(Self {
            params,
            boot,
            gain,
            now: Seconds::ZERO,
            power: Duty::default(),
            speed: 0.0,
            distance: 0.0,
            heard: None,
            echo: None,
        })
    }

    /// Takes a power.
    ///
    /// # Errors
    /// Why it is not obeyed.
    pub fn hear(&mut self, now: Seconds, order: &MotorPower) -> Result<(), Reject> {
        self.advance(now);
        if order.boot != self.boot {
            return Err(Reject::Boot);
        }
        if self.heard.is_some_and(|(_, seq)| order.seq <= seq) {
            return Err(Reject::Sequence);
        }
        let age = Tick::of(self.now).since(order.echo);
        if age < 0 {
            return Err(Reject::Future);
        }
        // After a silence numbers begin anew, but nothing that was said before it counts.
        let is_replayed = self.heard.is_none() && self.echo.is_some_and(|echo| order.echo.since(echo) <= 0);
        if is_replayed || f64::from(age) > self.params.max_age.0 * 1000.0 {
            return Err(Reject::Stale);
        }
        self.power = order.power;
        self.heard = Some((self.now, order.seq));
        self.echo = Some(order.echo);
        Ok(())
    }

    /// Turns with this power from now on, whoever gives it: the shaft of a motor that another process drives.
    pub(crate) fn follow(&mut self, now: Seconds, power: Duty) {
        self.advance(now);
        self.power = power;
        self.heard = Some((self.now, 0));
    }

    /// Takes the power away, for whoever ends the process.
    pub fn stop(&mut self) {
        self.power = Duty::default();
        self.heard = None;
    }

    /// Moves on to time `to`; a time that is not later changes nothing.
    pub fn advance(&mut self, to: Seconds) {
        let span = (to - self.now).0;
        if !(span.is_finite() && span > 0.0) {
            return;
        }
        // The power counts until the silence is over, also when that lies between two calls.
        let silent = self.heard.map(|(heard, _)| (heard + self.params.silence - self.now).0);
        match silent {
            Some(left) if left < span => {
                self.turn(left.max(0.0));
                self.stop();
                self.turn(span - left.max(0.0));
            }
            _ => self.turn(span),
        }
        self.now = to;
    }

    /// Turns for a while: v the speed, u what the power asks for, τ the lag: v(t) = u + (v - u) exp(-t/τ), and the
    /// distance is its integral.
    fn turn(&mut self, t: f64) {
        let (tau, u) = (self.params.lag.0, self.gain * self.params.full_speed.0 * self.power.get());
        let left = (-t / tau).exp();
        self.distance += u * t + (self.speed - u) * tau * (1.0 - left);
        self.speed = u + (self.speed - u) * left;
    }

    /// What the motor says of itself: its power, and the last whole tick of its encoder.
    #[must_use]
    pub fn reading(&self) -> MotorReading {
        let tick = self.params.tick.0;
        MotorReading {
            boot: self.boot,
            stamp: self.now,
            power: Some(self.power),
            distance: self.params.encoder.then(|| Metres(tick * (self.distance / tick).floor())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOOT: Boot = Boot(7);

    fn motor() -> Motor {
        let params = MotorParams { gain_deviation: 0.0, ..MotorParams::default() };
        Motor::new(params, BOOT, 0).expect("a motor")
    }
    fn order(seq: u32, echo: f64, power: f64) -> MotorPower {
        let power = Duty::new(power).expect("within full power");
        MotorPower { boot: BOOT, seq, echo: Tick::of(Seconds(echo)), power }
    }
    fn distance(motor: &Motor) -> f64 {
        motor.reading().distance.expect("an encoder").0
    }

    #[test]
    fn the_shipped_files_hold_every_default() {
        let defaults = toml::Table::try_from(MotorParams::default()).expect("a table");
        for file in [MotorParams::FILE, RIGHT_MOTOR] {
            assert_eq!(toml::from_str::<toml::Table>(file).expect("a table"), defaults);
        }
        assert!(MotorParams::default().check().is_ok());
    }

    #[test]
    fn a_power_turns_the_wheel_until_nothing_comes_any_more() {
        let mut motor = motor();
        for beat in 0..100 {
            let now = f64::from(beat) * 0.01;
            motor.hear(Seconds(now), &order(beat + 1, now, 0.5)).expect("obeyed");
        }
        motor.advance(Seconds(1.0));
        // 0.6 m/s for 1 s, less the lag.
        assert!((distance(&motor) - 0.6 * (1.0 - 0.05)).abs() < 0.001, "{}", distance(&motor));
        motor.advance(Seconds(2.0));
        // 0.19 s more of it, and the lag.
        let rest = distance(&motor);
        assert!((rest - 0.6 * 1.19).abs() < 0.001, "{rest}");
        assert_eq!(motor.reading().power, Some(Duty::default()));
        motor.advance(Seconds(60.0));
        assert!(
            (distance(&motor) - rest).abs() < 0.000_501,
            "it stands, but for a tick that it was close to"
        );
    }

    #[test]
    fn what_is_old_replayed_foreign_or_from_the_future_turns_nothing() {
        let mut motor = motor();
        motor.advance(Seconds(1.0));
        let mut refuses = |order: MotorPower, why| assert_eq!(motor.hear(Seconds(1.0), &order), Err(why));
        refuses(order(1, 0.7, 1.0), Reject::Stale);
        refuses(order(1, 1.1, 1.0), Reject::Future);
        refuses(MotorPower { boot: Boot(8), ..order(1, 1.0, 1.0) }, Reject::Boot);
        assert_eq!(motor.hear(Seconds(1.0), &order(5, 0.99, 1.0)), Ok(()));
        assert_eq!(motor.hear(Seconds(1.05), &order(5, 1.0, 1.0)), Err(Reject::Sequence));
        // After the silence the same words are too old, though their age would be right.
        assert_eq!(motor.hear(Seconds(1.21), &order(5, 0.99, 1.0)), Err(Reject::Stale));
        assert_eq!(motor.hear(Seconds(1.22), &order(1, 1.2, 0.1)), Ok(()), "a new sender counts anew");
    }

    #[test]
    fn a_motor_without_an_encoder_says_no_distance() {
        let params = MotorParams { encoder: false, ..MotorParams::default() };
        let reading = Motor::new(params, BOOT, 0).expect("a motor").reading();
        assert_eq!((reading.distance, reading.power), (None, Some(Duty::default())));
    }

    #[test]
    fn the_two_sides_differ() {
        let side = |side| Motor::new(MotorParams::default(), BOOT, side).expect("a motor").gain;
        assert!((side(0) - side(1)).abs() > 1e-6);
    }
}
