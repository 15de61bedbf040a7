//! Drivers: how a robot that cannot move to the side obeys a vector field.

use serde::{Deserialize, Serialize};

mod multiplicative;
pub(crate) mod smooth;

pub(crate) use multiplicative::Multiplicative;

/// How the field is driven.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Driver {
    /// Turns in proportion to the angle between heading and field.
    #[default]
    Smooth,
    /// Changes speed by a factor and turn rate by a step at every beat: the paper's.
    Multiplicative,
}
