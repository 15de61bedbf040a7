//! What a navigator notices beside the pose: each event says what it was concluded from.

use crate::codec::Message;
use crate::unit::{deserialize_finite, finite};
use crate::{Metres, MetresPerSecond, Radians, Seconds};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

/// A sensor that speaks all the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sensor {
    /// The encoders of both wheels.
    Encoders,
    /// The gyro.
    Gyro,
}

/// Something that is not as it should be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// Several fixes in a row, which agree with each other, say that the robot is elsewhere.
    Kidnapped {
        /// Of the last of them.
        stamp: Seconds,
        /// How far from where the robot believed to be.
        distance: Metres,
        /// Its squared normalised innovation.
        #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
        squared: f64,
        /// How many fixes.
        fixes: u32,
    },
    /// The wheels turned the robot otherwise than the gyro says.
    Slip {
        /// At its beginning.
        stamp: Seconds,
        /// The turn of a span by the encoders.
        encoders: Radians,
        /// The turn of the same span by the gyro, without its bias.
        gyro: Radians,
        /// The squared normalised difference.
        #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
        squared: f64,
    },
    /// Both wheels turned faster or slower than the accelerometer says.
    Skid {
        /// At its beginning.
        stamp: Seconds,
        /// The speed by the encoders.
        encoders: MetresPerSecond,
        /// The speed by the accelerometer.
        accelerometer: MetresPerSecond,
        /// By what the accelerometer says that the speed has changed since the reading before.
        change: MetresPerSecond,
        /// The squared normalised difference.
        #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
        squared: f64,
    },
    /// A wheel's reading stays, while the gyro says that the wheel moves.
    StuckEncoder {
        /// When it was noticed.
        stamp: Seconds,
        /// The wheel whose reading stays.
        side: Side,
        /// What the other wheel covered meanwhile.
        other: Metres,
        /// What the encoders would have turned the robot by.
        encoders: Radians,
        /// What the gyro says.
        gyro: Radians,
    },
    /// A sensor that spoke before says nothing.
    Silent {
        /// The newest stamp of any sensor.
        stamp: Seconds,
        /// Which one.
        sensor: Sensor,
        /// Its last stamp.
        since: Seconds,
    },
    /// The gyro is not in rad/s, or is mounted upside down: it is left out.
    GyroScale {
        /// When it was noticed.
        stamp: Seconds,
        /// What the gyro says for each rad/s of the wheels.
        #[serde(serialize_with = "finite", deserialize_with = "deserialize_finite")]
        ratio: f64,
    },
}

impl Event {
    /// Its name in parameters, where a silent sensor is told by which one it is.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Kidnapped { .. } => "kidnapped",
            Self::Slip { .. } => "slip",
            Self::Skid { .. } => "skid",
            Self::StuckEncoder { .. } => "stuck-encoder",
            Self::Silent { sensor: Sensor::Encoders, .. } => "silent-encoders",
            Self::Silent { sensor: Sensor::Gyro, .. } => "silent-gyro",
            Self::GyroScale { .. } => "gyro-scale",
        }
    }

    /// Every name.
    pub const NAMES: [&'static str; 7] =
        ["kidnapped", "slip", "skid", "stuck-encoder", "silent-encoders", "silent-gyro", "gyro-scale"];
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Kidnapped { stamp, distance, squared, fixes } => write!(
                f,
                "at {stamp}: {fixes} fixes in a row put the robot {:.2} m from where it believed to be (squared \
                 normalised innovation {squared:.0}); it begins anew there, and its heading is unknown until it has driven",
                distance.0
            ),
            Self::Slip { stamp, encoders, gyro, squared } => write!(
                f,
                "at {stamp}: the wheels turned by {:.4} rad and the robot by {:.4} rad (squared normalised difference \
                 {squared:.0}): a wheel slips",
                encoders.0, gyro.0
            ),
            Self::Skid { stamp, encoders, accelerometer, squared, .. } => write!(
                f,
                "at {stamp}: the wheels run at {:.3} m/s and the robot at {:.3} m/s, by its accelerometer (squared \
                 normalised difference {squared:.0}): both wheels slip",
                encoders.0, accelerometer.0
            ),
            Self::StuckEncoder { stamp, side, other, encoders, gyro } => write!(
                f,
                "at {stamp}: the {side:?} encoder stays while the other wheel covers {:.3} m; encoders say a turn of {:.3} \
                 rad, the gyro {:.3} rad: check the encoder's cable",
                other.0, encoders.0, gyro.0
            ),
            Self::Silent { stamp, sensor, since } => {
                write!(
                    f,
                    "at {stamp}: the {sensor:?} said nothing since {since}: check its cable and its process"
                )
            }
            Self::GyroScale { stamp, ratio } => {
                let what = if (30.0..90.0).contains(&ratio) {
                    "it is in degrees a second: convert it to rad/s"
                } else if ratio < 0.0 {
                    "it is mounted upside down: negate it"
                } else {
                    "its scale is wrong"
                };
                write!(
                    f,
                    "at {stamp}: the gyro says {ratio:.2} for each rad/s of the wheels; {what}. It is left out"
                )
            }
        }
    }
}

/// An event, as the navigator says it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NavigatorEvent {
    /// What was noticed.
    pub event: Event,
    /// Whether the robot is to stop: whoever drives a task ends it.
    pub stop: bool,
    /// The event in words.
    pub why: String,
}

impl NavigatorEvent {
    /// With its words; a number that became infinite on the way is as large as any.
    #[must_use]
    pub fn new(mut event: Event, stop: bool) -> Self {
        match &mut event {
            Event::Kidnapped { squared: number, .. }
            | Event::Slip { squared: number, .. }
            | Event::Skid { squared: number, .. }
            | Event::GyroScale { ratio: number, .. }
                if !number.is_finite() =>
            {
                *number = 1e12;
            }
            _ => {}
        }
        Self { event, stop, why: event.to_string() }
    }
}

impl Message for NavigatorEvent {
    const NAME: &'static str = "NavigatorEvent";
    const LIMIT: usize = 1024;
}
