//! What a calibration knows of a robot, and what services say of it.
//!
//! A [`Calibration`] makes a robot of metal the robot that its [`Drivetrain`](crate::Drivetrain) describes: it turns the
//! speeds of the gate into signals for the motors, and what the encoders count into what the wheels have covered. It
//! travels as a message, and stands as TOML in files. `axle-calibrator` computes with it.

use crate::codec::Message;
use crate::plan::limit_list;
use crate::refusal::within;
use crate::unit::{Numbers, Ratio, deserialize_finite, finite};
use crate::{Boot, Duty, Metres, MetresPerSecond, MetresPerSecondSquared, Refusal, Seconds, Sides, Track};
use serde::{Deserialize, Serialize};

/// The most points of a [`Branch`], and the most coefficients of its curve.
pub const MAX_POINTS: usize = 16;

/// Everything that was measured of a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Calibration {
    /// Counts the calibrations of a robot; 0 has been measured by nobody.
    pub version: u32,
    /// When and by whom it was measured, in words for people, up to 128 letters.
    pub made: String,
    /// Effective distance of the wheels: by how much the robot turns when they cover different distances. `None`
    /// where it is as described.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub track: Option<Track>,
    /// What each wheel really covers when its encoder counts 1 m, 0.5 to 2.
    pub scale: Sides<Ratio>,
    /// Where the signals of the motors go.
    pub motors: Wiring,
    /// Where the counts of the encoders come from.
    pub encoders: Wiring,
    /// The signal that each wheel needs.
    pub wheels: Sides<WheelMap>,
}

/// Which of two channels belongs to which wheel, and in which direction it counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Wiring {
    /// The left channel belongs to the right wheel, and the other way round.
    pub swapped: bool,
    /// The channel of this wheel has the wrong sign. Sides are those of the wheels, not of the channels.
    pub inverted: Sides<bool>,
}

impl Wiring {
    /// From wheels to channels.
    #[must_use]
    pub fn to_channels(self, wheels: Sides<f64>) -> Sides<f64> {
        let Sides { left, right } = self.signed(wheels);
        if self.swapped { Sides::new(right, left) } else { Sides::new(left, right) }
    }
    /// From channels to wheels.
    #[must_use]
    pub fn to_wheels(self, channels: Sides<f64>) -> Sides<f64> {
        let Sides { left, right } = channels;
        self.signed(if self.swapped { Sides::new(right, left) } else { channels })
    }
    fn signed(self, wheels: Sides<f64>) -> Sides<f64> {
        wheels.zip(self.inverted, |value, inverted| if inverted { -value } else { value })
    }
}

/// The signals of one wheel, by the direction in which it runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WheelMap {
    /// Ahead.
    pub forward: Branch,
    /// Back. Signals and speeds are written without their sign.
    pub backward: Branch,
}

/// The signal s that a wheel needs to run at the speed v ≥ 0 with the acceleration a in its direction:
/// `s = ks + kv·v + c₀·v² + c₁·v³ + … + ka·a`. Where there are points, they stand for all but `ka·a`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Branch {
    /// The signal up to which a standing wheel stays at rest, 0 to 1: friction at rest is larger than in motion.
    #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
    pub dead_band: f64,
    /// What friction takes of the signal of a running wheel, 0 to 1.
    #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
    pub ks: f64,
    /// Signal for each m/s, 0.01 to 1000.
    #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
    pub kv: f64,
    /// Signal for each m/s², 0 to 100.
    #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
    pub ka: f64,
    /// Signal for each (m/s)², (m/s)³ …, where a straight line does not fit.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub curve: Vec<Ratio>,
    /// Speeds in m/s and their signals, both growing; between and beyond them it goes on straight. Two at least.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<Numbers<2>>,
}

impl Default for Calibration {
    /// A robot that nobody has measured: as described.
    fn default() -> Self {
        Self {
            version: 0,
            made: String::new(),
            track: None,
            scale: Sides::new(Ratio(1.0), Ratio(1.0)),
            motors: Wiring::default(),
            encoders: Wiring::default(),
            wheels: Sides::default(),
        }
    }
}
impl Default for Branch {
    /// A motor without friction or inertia that runs at 1.2 m/s with its full signal.
    fn default() -> Self {
        Self { dead_band: 0.0, ks: 0.0, kv: 1.0 / 1.2, ka: 0.0, curve: Vec::new(), points: Vec::new() }
    }
}

impl Calibration {
    /// Refuses what cannot be the calibration of a robot.
    ///
    /// # Errors
    /// Names the field, its value and its range.
    pub fn validate(&self) -> Result<(), Refusal> {
        limit_list("letters of made", self.made.chars().count(), 128)?;
        within("scale.left", self.scale.left.0, 0.5, 2.0)?;
        within("scale.right", self.scale.right.0, 0.5, 2.0)?;
        for (side, wheel) in [("left", &self.wheels.left), ("right", &self.wheels.right)] {
            wheel.forward.check(&format!("wheels.{side}.forward"))?;
            wheel.backward.check(&format!("wheels.{side}.backward"))?;
        }
        Ok(())
    }
}

impl Branch {
    fn check(&self, at: &str) -> Result<(), Refusal> {
        within(&format!("{at}.dead_band"), self.dead_band, 0.0, 1.0)?;
        within(&format!("{at}.ks"), self.ks, 0.0, 1.0)?;
        within(&format!("{at}.kv in s/m"), self.kv, 0.01, 1000.0)?;
        within(&format!("{at}.ka in s²/m"), self.ka, 0.0, 100.0)?;
        limit_list(&format!("coefficients of {at}.curve"), self.curve.len(), MAX_POINTS)?;
        for coefficient in &self.curve {
            within(&format!("{at}.curve"), coefficient.0, -1e6, 1e6)?;
        }
        limit_list(&format!("points of {at}"), self.points.len(), MAX_POINTS)?;
        if self.points.len() == 1 {
            return Err(Refusal::malformed(format!("{at}.points"), "give two points at least, or none"));
        }
        for Numbers([speed, signal]) in &self.points {
            within(&format!("speed of {at}.points in m/s"), *speed, 0.0, crate::dwm::MAX_WHEEL_SPEED)?;
            within(&format!("signal of {at}.points"), *signal, 0.0, 1.0)?;
        }
        // Only so there is one speed for each signal, and one signal for each speed.
        let grows =
            self.points.windows(2).all(|pair| pair[0].0[0] < pair[1].0[0] && pair[0].0[1] < pair[1].0[1]);
        if grows { Ok(()) } else { Err(Refusal::malformed(format!("{at}.points"), "both numbers must grow")) }
    }
}

impl Message for Calibration {
    const NAME: &'static str = "Calibration";
    const LIMIT: usize = 8192;
    fn check(&self) -> Result<(), Refusal> {
        self.validate()
    }
}

/// What was given to the motors at a stamp, and what the encoders counted; between two stamps both go linearly from the
/// one to the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SignalsData {
    /// Seconds since the boot of the robot process.
    pub stamp: Seconds,
    /// To the channel of the left motor.
    pub left: Duty,
    /// To the channel of the right motor.
    pub right: Duty,
    /// What the channels of the encoders have counted since boot, before any calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counted: Option<Sides<Metres>>,
}
impl Message for SignalsData {
    const NAME: &'static str = "SignalsData";
    const LIMIT: usize = 128;
}

/// Speeds of the wheels, asked for or answered by the calibrator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WheelSpeeds {
    /// Of the left wheel.
    pub left: MetresPerSecond,
    /// Of the right wheel.
    pub right: MetresPerSecond,
    /// How the speeds change; left out, they are constant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accelerations: Option<Sides<MetresPerSecondSquared>>,
}
impl Message for WheelSpeeds {
    const NAME: &'static str = "WheelSpeeds";
    const LIMIT: usize = 256;
    fn check(&self) -> Result<(), Refusal> {
        let most = crate::dwm::MAX_WHEEL_SPEED;
        within("left in m/s", self.left.0, -most, most)?;
        within("right in m/s", self.right.0, -most, most)?;
        self.accelerations.map_or(Ok(()), |accelerations| {
            within("accelerations.left in m/s²", accelerations.left.0, -1000.0, 1000.0)?;
            within("accelerations.right in m/s²", accelerations.right.0, -1000.0, 1000.0)
        })
    }
}

/// Asks the owner of the wheels to let the speeds of a lease go to the motors without the calibration, as shares of the
/// full speed. It holds as long as the lease; the gate judges every command as always.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Raw {
    /// From the lease.
    pub boot: Boot,
    /// From the lease.
    pub epoch: u32,
}
impl Message for Raw {
    const NAME: &'static str = "Raw";
    const LIMIT: usize = 128;
}

/// Gives the owner of the wheels a calibration to apply and to keep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibrate {
    /// From a lease: whoever holds the wheels may calibrate them.
    pub boot: Boot,
    /// From the lease.
    pub epoch: u32,
    /// The calibration.
    pub calibration: Calibration,
}
impl Message for Calibrate {
    const NAME: &'static str = "Calibrate";
    const LIMIT: usize = 8704;
    fn check(&self) -> Result<(), Refusal> {
        self.calibration.validate()
    }
}

/// Asks the owner of the wheels for the calibration that it applies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetCalibration {}
impl Message for GetCalibration {
    const NAME: &'static str = "GetCalibration";
    const LIMIT: usize = 64;
}

/// The calibration of an owner of wheels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibrated {
    /// What is applied.
    pub calibration: Calibration,
    /// The speed of a wheel that a full signal stands for where no calibration is applied.
    pub full_speed: MetresPerSecond,
    /// The distance of the wheels as the robot is described.
    pub track: Track,
    /// The largest speed of a wheel that the gate lets through.
    pub wheel_speed: MetresPerSecond,
    /// The largest acceleration of a wheel that the robot is described with.
    pub wheel_acceleration: MetresPerSecondSquared,
    /// Whether the signals are speeds that a board keeps by itself, so that what is measured are not its motors.
    #[serde(default, skip_serializing_if = "is_false")]
    pub keeps_speeds: bool,
}
#[allow(clippy::trivially_copy_pass_by_ref, reason = "what serde asks for")]
const fn is_false(value: &bool) -> bool {
    !*value
}
impl Message for Calibrated {
    const NAME: &'static str = "Calibrated";
    const LIMIT: usize = 8704;
    fn check(&self) -> Result<(), Refusal> {
        within("full_speed in m/s", self.full_speed.0, 1e-3, 1000.0)?;
        self.calibration.validate()
    }
}
