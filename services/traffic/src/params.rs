//! What of Traffic may be chosen.

use axle_schema::contract::{Bounds, Params};
use axle_schema::refusal::within;
use axle_schema::{Metres, Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// Parameters of Traffic: `deploy/params/traffic.toml`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrafficParams {
    /// Edge of the squares of the floor, 0.02 to 1 m.
    pub cell: Metres,
    /// Added to the radius of every robot: how far it may be beside its way, 0 to 1 m.
    pub margin: Metres,
    /// How much way is given to a robot at once, 0.2 to 100 m.
    pub ahead: Metres,
    /// After its start it gives nothing for so long, until robots that drive have told what they hold, 0 to 60 s.
    pub listen: Seconds,
}

impl Default for TrafficParams {
    fn default() -> Self {
        Self { cell: Metres(0.1), margin: Metres(0.05), ahead: Metres(4.0), listen: Seconds(2.0) }
    }
}

impl Bounds for TrafficParams {
    fn check(&self) -> Result<(), Refusal> {
        within("cell in m", self.cell.0, 0.02, 1.0)?;
        within("margin in m", self.margin.0, 0.0, 1.0)?;
        within("ahead in m", self.ahead.0, 0.2, 100.0)?;
        within("listen in s", self.listen.0, 0.0, 60.0)
    }
}

impl Params for TrafficParams {
    const FILE: &'static str = include_str!("../../../deploy/params/traffic.toml");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parameter_file_holds_the_defaults() {
        let file: toml::Table = toml::from_str(TrafficParams::FILE).expect("a table");
        assert_eq!(file, toml::Table::try_from(TrafficParams::default()).expect("a table"));
        let params: TrafficParams = toml::from_str(TrafficParams::FILE).expect("parameters");
        assert_eq!(params, TrafficParams::default());
        params.check().expect("within their ranges");
        for text in ["cell = 0.0", "margin = -1.0", "ahead = 0.0"] {
            assert!(toml::from_str::<TrafficParams>(text).expect("numbers").check().is_err(), "{text}");
        }
        assert!(toml::from_str::<TrafficParams>("haed = 1.0").is_err(), "a misspelt field is refused");
    }
}
