//! One encoder in software that is a service of its own: it counts what the wheel does that a motor service turns.
//!
//! *Hears* the motor's [`MotorReading`], which tells its power, *says* a [`MotorReading`] that tells a distance and no power.
//! Two processes cannot hold one shaft, so this one turns a wheel of its own, described as the motor's is, by the power
//! that the motor says it has. When the motor falls silent, the wheel runs out.

use crate::{Motor, MotorParams};
use axle_schema::contract::{Bounds, Params};
use axle_schema::differential_drive::MotorReading;
use axle_schema::{Boot, Metres, MetresPerSecond, Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// Parameters of an emulated encoder: `deploy/params/encoder-left.toml` and `encoder-right.toml`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EncoderParams {
    /// As in the parameters of its motor.
    pub seed: u64,
    /// As in the parameters of its motor, 0.001 to 20 m/s.
    pub full_speed: MetresPerSecond,
    /// As in the parameters of its motor, 0.005 to 1 s.
    pub lag: Seconds,
    /// As in the parameters of its motor, 0 to 0.1.
    pub gain_deviation: f64,
    /// Distance of the rim from tick to tick, 1e-6 to 0.1 m.
    pub tick: Metres,
    /// Readings in a second, 20 to 200.
    pub rate: f64,
    /// A motor that says nothing for this long turns nothing, 0.05 to 0.5 s.
    pub silence: Seconds,
}

impl Default for EncoderParams {
    fn default() -> Self {
        let MotorParams { seed, full_speed, lag, gain_deviation, tick, rate, silence, .. } =
            MotorParams::default();
        Self { seed, full_speed, lag, gain_deviation, tick, rate, silence }
    }
}

impl EncoderParams {
    /// The motor that turns the same wheel.
    fn motor(&self) -> MotorParams {
        let Self { seed, full_speed, lag, gain_deviation, tick, rate, silence } = *self;
        let own = MotorParams {
            seed,
            full_speed,
            lag,
            gain_deviation,
            tick,
            rate,
            silence,
            ..MotorParams::default()
        };
        MotorParams { encoder: true, ..own }
    }
}

impl Bounds for EncoderParams {
    fn check(&self) -> Result<(), Refusal> {
        self.motor().check()
    }
}

impl Params for EncoderParams {
    const FILE: &'static str = include_str!("../../../deploy/params/encoder-left.toml");
}

/// The parameters file of the right encoder: the same values.
pub const RIGHT_ENCODER: &str = include_str!("../../../deploy/params/encoder-right.toml");

/// An encoder on a wheel that stands at first.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoder {
    wheel: Motor,
}

impl Encoder {
    /// The encoder number `side` (0 left, 1 right) of the robot that `params.seed` describes.
    ///
    /// # Errors
    /// Refuses parameters out of range.
    pub fn new(params: &EncoderParams, boot: Boot, side: u64) -> Result<Self, Refusal> {
        Ok(Self { wheel: Motor::new(params.motor(), boot, side)? })
    }
    /// Hears what the motor says of itself.
    pub fn hear(&mut self, now: Seconds, motor: &MotorReading) {
        if let Some(power) = motor.power {
            self.wheel.follow(now, power);
        }
    }
    /// Moves on to time `to`; a time that is not later changes nothing.
    pub fn advance(&mut self, to: Seconds) {
        self.wheel.advance(to);
    }
    /// What it measures: the last whole tick.
    #[must_use]
    pub fn reading(&self) -> MotorReading {
        MotorReading { power: None, ..self.wheel.reading() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::Duty;
    use axle_schema::Tick;
    use axle_schema::differential_drive::MotorPower;

    #[test]
    fn the_shipped_files_hold_every_default() {
        let defaults = toml::Table::try_from(EncoderParams::default()).expect("a table");
        for file in [EncoderParams::FILE, RIGHT_ENCODER] {
            assert_eq!(toml::from_str::<toml::Table>(file).expect("a table"), defaults);
        }
        assert!(EncoderParams::default().check().is_ok());
        assert!(EncoderParams { tick: Metres(0.0), ..EncoderParams::default() }.check().is_err());
    }

    #[test]
    fn it_counts_what_its_motor_turns_and_nothing_when_the_motor_is_gone() {
        let mut encoder = Encoder::new(&EncoderParams::default(), Boot(2), 1).expect("an encoder");
        let mut motor = Motor::new(MotorParams::default(), Boot(1), 1).expect("a motor");
        let power = Duty::new(-0.5).expect("a power");
        for beat in 1..=100_u32 {
            let now = Seconds(f64::from(beat) * 0.01);
            motor
                .hear(now, &MotorPower { boot: Boot(1), seq: beat, echo: Tick::of(now), power })
                .expect("obeyed");
            encoder.hear(now, &motor.reading());
        }
        let (counted, turned) = (encoder.reading(), motor.reading());
        assert_eq!((counted.distance, counted.power, counted.boot), (turned.distance, None, Boot(2)));
        assert!(counted.distance.expect("a distance").0 < -0.4, "{counted:?}");
        for beat in 1..=200_u32 {
            encoder.advance(Seconds(1.0 + f64::from(beat) * 0.01));
        }
        let out = encoder.reading();
        encoder.advance(Seconds(10.0));
        assert_eq!(encoder.reading().distance, out.distance, "it stands");
    }
}
