//! Vector fields: with which velocity the robot shall be at a place.

use serde::{Deserialize, Serialize};

pub(crate) mod path;
pub(crate) mod points;

/// What the vector field leads to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Field {
    /// To the ends of the legs, one after the other.
    Points,
    /// Onto the lines and arcs of the plan, and along them.
    #[default]
    Path,
}

/// The field at the place of the robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flow {
    /// The length of the vector, m/s.
    pub(crate) w: f64,
    /// Its direction, rad.
    pub(crate) psi: f64,
    /// How much the direction turns for every metre along it, 1/m.
    pub(crate) bend: f64,
}
