//! How badly the motors obey, what the battery gives, and how the wheels hold on to the ground.

use axle_schema::calibration::Wiring;
use axle_schema::contract::Bounds;
use axle_schema::dwm::MAX_WHEEL_SPEED;
use axle_schema::refusal::within;
use axle_schema::{Metres, MetresPerSecond, Refusal, Seconds, Sides};
use serde::{Deserialize, Serialize};

/// How badly the motors obey.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotorsParams {
    /// How fast each wheel runs when it is asked for 1 m/s, 0.5 to 1.5: motors or wheels that differ.
    pub gain: Sides<f64>,
    /// Standard deviation of the constant gain of each wheel around `gain`, 0 to 0.1. The gains are drawn once, from
    /// the seed, within three deviations.
    pub gain_deviation: f64,
    /// Standard deviation of the distance of a wheel after 1 m, in m, 0 to 0.05: noise in the control. It grows with
    /// the square root of the distance, so that the length of the beats does not matter, and a wheel at rest rests.
    pub jitter: Metres,
    /// What each wheel keeps of its gain when it runs backward, 0.5 to 1.5.
    pub backward: Sides<f64>,
    /// What friction takes of every speed, 0 to 0.5 m/s: a wheel that is asked for less than this stands.
    pub dead_band: MetresPerSecond,
    /// What a standing wheel must be asked for before it breaks loose, 0 to 0.5 m/s; less than `dead_band` is nothing.
    pub breakaway: Sides<MetresPerSecond>,
    /// Time constant of the motors, 0 to 1 s: after it, 63 % of a step are done.
    pub lag: Seconds,
    /// The fastest that a wheel can run, 0.001 to 20 m/s.
    pub saturation: MetresPerSecond,
    /// How the motors are connected.
    pub wiring: Wiring,
    /// What the motors do after a step, where that is no time constant.
    pub response: ResponseParams,
}

/// What the motors do after a step of what they are asked for: a polynomial of the time since, as it is fitted from
/// recordings. It stands for the lag.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ResponseParams {
    /// After this time T the wheels have reached their speed, 0 to 2 s; with 0 there is no polynomial.
    pub time: Seconds,
    /// Of the left wheel: the coefficients of t/T, (t/T)² … (t/T)⁵, each -100 to 100; their sum is the share of what is
    /// asked for that is reached.
    pub left: [f64; 5],
    /// Of the right wheel.
    pub right: [f64; 5],
}

impl ResponseParams {
    /// The coefficients of both wheels.
    pub(crate) const fn sides(&self) -> Sides<[f64; 5]> {
        Sides::new(self.left, self.right)
    }
}

/// How the wheels differ from what everybody believes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WheelsParams {
    /// The effective distance of the wheels as a share of `robot.track`, 0.8 to 1.25.
    pub track: f64,
    /// What each wheel really covers when its encoder counts 1 m, 0.8 to 1.25.
    pub size: Sides<f64>,
}

/// What the battery gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BatteryParams {
    /// The share of their speed that the wheels lose when both run at `robot.wheel_speed`, 0 to 0.9; at lower speeds
    /// in proportion.
    pub sag: f64,
    /// The share of their speed that the wheels lose in every hour since boot, 0 to 1. The last tenth is never lost.
    pub drain: f64,
}

/// How the wheels slip: what the rim covers is then more than what the robot covers, and no encoder knows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SlipParams {
    /// How often a wheel begins to slip in every metre of its rim, on average, 0 to 10.
    pub rate: f64,
    /// How much of its rim runs by until it grips again, 0.001 to 1 m.
    pub length: Metres,
    /// The share of its way that it loses meanwhile, 0 to 1.
    pub share: f64,
}

/// Whether the walls of the map that the map service says stand in the way of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WallsParams {
    /// Whether there are any. If so, the emulator asks for the map when it begins, and cannot begin without.
    pub solid: bool,
    /// Radius of the circle around the middle of the axle that holds the robot, 0.01 to 10 m.
    pub body: Metres,
}

impl Default for MotorsParams {
    fn default() -> Self {
        Self {
            gain: Sides::new(1.0, 1.0),
            gain_deviation: 0.01,
            jitter: Metres(0.001),
            backward: Sides::new(1.0, 1.0),
            dead_band: MetresPerSecond::ZERO,
            breakaway: Sides::default(),
            lag: Seconds::ZERO,
            saturation: MetresPerSecond(MAX_WHEEL_SPEED),
            wiring: Wiring::default(),
            response: ResponseParams::default(),
        }
    }
}
impl Default for WheelsParams {
    fn default() -> Self {
        Self { track: 1.0, size: Sides::new(1.0, 1.0) }
    }
}
impl Default for SlipParams {
    /// Wheels that hold; if they slipped, it would be by half for 5 cm.
    fn default() -> Self {
        Self { rate: 0.0, length: Metres(0.05), share: 0.5 }
    }
}

impl Default for WallsParams {
    /// A robot in the open, which would be round and 40 cm wide.
    fn default() -> Self {
        Self { solid: false, body: Metres(0.2) }
    }
}

impl Bounds for WallsParams {
    fn check(&self) -> Result<(), Refusal> {
        within("walls.body in m", self.body.0, 0.01, 10.0)
    }
}
impl Bounds for MotorsParams {
    fn check(&self) -> Result<(), Refusal> {
        within("motors.gain.left", self.gain.left, 0.5, 1.5)?;
        within("motors.gain.right", self.gain.right, 0.5, 1.5)?;
        within("motors.gain_deviation", self.gain_deviation, 0.0, 0.1)?;
        within("motors.jitter in m", self.jitter.0, 0.0, 0.05)?;
        within("motors.backward.left", self.backward.left, 0.5, 1.5)?;
        within("motors.backward.right", self.backward.right, 0.5, 1.5)?;
        within("motors.breakaway.left in m/s", self.breakaway.left.0, 0.0, 0.5)?;
        within("motors.breakaway.right in m/s", self.breakaway.right.0, 0.0, 0.5)?;
        within("motors.dead_band in m/s", self.dead_band.0, 0.0, 0.5)?;
        within("motors.lag in s", self.lag.0, 0.0, 1.0)?;
        within("motors.saturation in m/s", self.saturation.0, 1e-3, MAX_WHEEL_SPEED)?;
        within("motors.response.time in s", self.response.time.0, 0.0, 2.0)?;
        for coefficient in self.response.left.into_iter().chain(self.response.right) {
            within("motors.response", coefficient, -100.0, 100.0)?;
        }
        Ok(())
    }
}
impl Bounds for WheelsParams {
    fn check(&self) -> Result<(), Refusal> {
        within("wheels.track", self.track, 0.8, 1.25)?;
        within("wheels.size.left", self.size.left, 0.8, 1.25)?;
        within("wheels.size.right", self.size.right, 0.8, 1.25)
    }
}
impl Bounds for BatteryParams {
    fn check(&self) -> Result<(), Refusal> {
        within("battery.sag", self.sag, 0.0, 0.9)?;
        within("battery.drain", self.drain, 0.0, 1.0)
    }
}
impl Bounds for SlipParams {
    fn check(&self) -> Result<(), Refusal> {
        within("slip.rate in 1/m", self.rate, 0.0, 10.0)?;
        within("slip.length in m", self.length.0, 1e-3, 1.0)?;
        within("slip.share", self.share, 0.0, 1.0)
    }
}
