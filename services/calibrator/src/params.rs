//! Parameters of the calibrator: the calibration that it answers by.

use axle_schema::contract::{Bounds, Params};
use axle_schema::{Calibration, Refusal};
use serde::{Deserialize, Serialize};

/// The file of the service is a calibration, as `axle calibrate` writes it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CalibratorParams(pub Calibration);

impl Bounds for CalibratorParams {
    fn check(&self) -> Result<(), Refusal> {
        self.0.validate()
    }
}

impl Params for CalibratorParams {
    const FILE: &'static str = include_str!("../../../deploy/params/calibrator.toml");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_file_holds_every_default() {
        let file: toml::Table = toml::from_str(CalibratorParams::FILE).expect("a table");
        assert_eq!(file, toml::Table::try_from(CalibratorParams::default()).expect("a table"));
        assert!(CalibratorParams::default().check().is_ok());
    }

    /// As the shell reads a file: what it leaves out is as shipped.
    fn merge(base: &mut toml::Table, over: toml::Table) {
        for (name, value) in over {
            match (base.get_mut(&name), value) {
                (Some(toml::Value::Table(base)), toml::Value::Table(over)) => merge(base, over),
                (_, value) => drop(base.insert(name, value)),
            }
        }
    }

    #[test]
    fn what_is_no_calibration_is_refused() {
        for text in [
            "[wheels.left.forward]\nkv = 0.0",
            "[wheels.left.forward]\npoints = [[0.1, 0.1]]",
            "[wheels.right.backward]\npoints = [[0.1, 0.2], [0.2, 0.1]]",
            "[scale]\nleft = 0.1\nright = 1.0",
        ] {
            let mut table: toml::Table = toml::from_str(CalibratorParams::FILE).expect("a table");
            merge(&mut table, toml::from_str(text).expect("a table"));
            let params: CalibratorParams = table.try_into().expect("parameters");
            assert!(params.check().is_err(), "{text:?} is refused");
        }
        for text in ["track = -1.0", "tracks = 1.0", "[wheels.left.forward]\nkv = nan"] {
            assert!(toml::from_str::<CalibratorParams>(text).is_err(), "{text:?} is refused");
        }
    }
}
