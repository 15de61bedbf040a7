//! Names and numbers that identify robots, tasks and processes.

use crate::Refusal;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;
use std::str::FromStr;

/// The name of a robot, as it stands in every key: lower-case letters, digits and hyphens, 1 to 32 of them.
///
/// The name `all` is reserved for services that work for every robot.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct RobotId(String);

/// The place of a robot's name that a service shared by all robots takes.
pub const ALL: &str = "all";

impl RobotId {
    /// A checked name.
    ///
    /// # Errors
    /// Refuses anything but 1 to 32 of `a-z`, `0-9` and `-`, and the reserved name `all`.
    pub fn new(name: &str) -> Result<Self, Refusal> {
        let shape = "1 to 32 of a-z, 0-9 and -, and not \"all\"; for example r1";
        let shown: String = name.chars().take(40).collect();
        if name.is_empty() || name.len() > 32 || name == ALL {
            return Err(Refusal::out_of_range("robot id", format_args!("{shown:?}"), shape));
        }
        if let Some(wrong) = name.chars().find(|c| !matches!(c, 'a'..='z' | '0'..='9' | '-')) {
            return Err(Refusal::out_of_range(
                "robot id",
                format_args!("{shown:?} (it has {wrong:?})"),
                shape,
            ));
        }
        Ok(Self(name.to_owned()))
    }
    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}
impl FromStr for RobotId {
    type Err = Refusal;
    fn from_str(name: &str) -> Result<Self, Refusal> {
        Self::new(name)
    }
}
impl fmt::Display for RobotId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
impl<'de> Deserialize<'de> for RobotId {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Self::new(&String::deserialize(from)?).map_err(D::Error::custom)
    }
}

macro_rules! numbers {
    ($($(#[$doc:meta])* $name:ident;)*) => {$(
        $(#[$doc])*
        ///
        /// A random whole number below 2^53, so that a JavaScript client reads it exactly.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub u64);
        impl $name {
            /// The identity made of 64 random bits.
            #[must_use]
            pub const fn from_random(bits: u64) -> Self { Self(bits >> 11) }
        }
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result { write!(f, "{:x}", self.0) }
        }
    )*};
}

numbers! {
    /// One run of a process. For the process that owns the wheels it is the `boot` of every lease and command.
    Boot;
    /// One task given to a corrector or to the pilot.
    TaskId;
    /// One AllStop.
    StopId;
}

/// The milliseconds of the robot's own clock since its boot, as commands echo them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Tick(pub u32);

impl Tick {
    /// The tick of a stamp of the robot's clock; it wraps after 49 days.
    #[must_use]
    pub fn of(stamp: crate::Seconds) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a tick wraps by design")]
        Self((stamp.0.max(0.0) * 1000.0) as u64 as u32)
    }
    /// Milliseconds from `earlier` to this tick, as a signed number that survives the wrap.
    #[must_use]
    pub const fn since(self, earlier: Self) -> i32 {
        self.0.wrapping_sub(earlier.0).cast_signed()
    }
}
