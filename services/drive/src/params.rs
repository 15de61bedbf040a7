//! What of the drive may be chosen.

use axle_schema::contract::{Bounds, Params};
use axle_schema::differential_drive::MAX_HOLD;
use axle_schema::refusal::within;
use axle_schema::{Drivetrain, Metres, MetresPerSecond, MetresPerSecondSquared, Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// Parameters of the drive: `deploy/params/drive.toml`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DriveParams {
    /// Time from beat to beat, 0.02 to 0.2 s.
    pub period: Seconds,
    /// How long a power or a speed holds that does not say so itself, 0.05 to 5 s.
    pub hold: Seconds,
    /// The share of `robot.wheel_speed` that a power of 1 asks for, 0.05 to 1; the rest is room for corrections.
    pub full_power: f64,
    /// Deceleration when a power or a speed ends, 0.25 to 20 m/s².
    pub braking: MetresPerSecondSquared,
    /// How close to their distances the wheels must come at the end of an operation, 0.0001 to 0.1 m.
    pub tolerance: Metres,
    /// A wheel that is this far from where it should be is blocked, 0.01 to 10 m.
    pub lost: Metres,
    /// Without a new measurement for this long the drive stops, 0.1 to 5 s.
    pub silence: Seconds,
    /// The robot.
    pub robot: Drivetrain,
}

impl Default for DriveParams {
    fn default() -> Self {
        Self {
            period: Seconds(0.05),
            hold: Seconds(1.0),
            full_power: 0.8,
            braking: MetresPerSecondSquared(2.0),
            tolerance: Metres(0.001),
            lost: Metres(0.3),
            silence: Seconds(0.5),
            robot: Drivetrain::default(),
        }
    }
}

impl Bounds for DriveParams {
    fn check(&self) -> Result<(), Refusal> {
        within("period in s", self.period.0, 0.02, 0.2)?;
        within("hold in s", self.hold.0, 0.05, MAX_HOLD)?;
        within("full_power", self.full_power, 0.05, 1.0)?;
        within("braking in m/s²", self.braking.0, 0.25, 20.0)?;
        within("tolerance in m", self.tolerance.0, 1e-4, 0.1)?;
        within("lost in m", self.lost.0, 0.01, 10.0)?;
        within("silence in s", self.silence.0, 0.1, 5.0)?;
        self.robot.check()
    }
}

impl Params for DriveParams {
    const FILE: &'static str = include_str!("../../../deploy/params/drive.toml");
}

impl DriveParams {
    /// The wheel speed that a power of 1 asks for.
    #[must_use]
    pub fn full_speed(&self) -> MetresPerSecond {
        self.robot.wheel_speed * self.full_power
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_file_holds_every_default() {
        let file: toml::Table = toml::from_str(DriveParams::FILE).expect("a table");
        assert_eq!(file, toml::Table::try_from(DriveParams::default()).expect("a table"));
        assert!(DriveParams::default().check().is_ok());
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        for (text, words) in [
            ("period = 0.01", "period in s"),
            ("hold = 6.0", "hold in s"),
            ("full_power = 1.1", "full_power"),
            ("braking = 0.0", "braking"),
            ("tolerance = 0.0", "tolerance"),
            ("lost = 0.0", "lost"),
            ("silence = 0.0", "silence"),
            ("[robot]\nwheel_speed = 0.0", "robot.wheel_speed"),
        ] {
            let params: DriveParams = toml::from_str(text).expect("parameters");
            let refusal = params.check().expect_err(text).to_string();
            assert!(refusal.contains(words), "{refusal:?} names {words:?}");
        }
        assert!(toml::from_str::<DriveParams>("holds = 1.0").is_err(), "an unknown field");
    }
}
