//! Maps: what is free, what is occupied and what nobody knows, in square cells.
//!
//! A map says of every cell how likely it is occupied, as the occupancy grids of ROS do: 0 to 100, or unknown. On the
//! wire it is written in runs of equal cells, which is short for what people build, and bounded for everything else.

use crate::codec::Message;
use crate::plan::limit_list;
use crate::refusal::within;
use crate::{Metres, Pose, Refusal};
use serde::{Deserialize, Serialize};

/// What stands for a cell that nobody knows anything of.
pub const UNKNOWN: u8 = 255;
/// The most cells of a map: 4096 x 4096, or the same in another shape.
pub const MAX_CELLS: usize = 1 << 24;
/// The most numbers of the runs of a map.
pub const MAX_RUNS: usize = 1 << 18;
/// The most letters of a map's name.
pub const MAX_NAME: usize = 96;

/// Asks the map service for its map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MapAsk {
    /// The content of the map that the asker has already: if it is still this one, it is not sent again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub have: Option<u64>,
}
impl Message for MapAsk {
    const NAME: &'static str = "MapAsk";
    const LIMIT: usize = 64;
}

/// A map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapData {
    /// What people call it.
    pub name: String,
    /// Side of a cell, 0.001 to 10 m.
    pub resolution: Metres,
    /// The outer corner of the first cell; the rows run along its heading.
    pub origin: Pose,
    /// Cells of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Names what is in the map: maps of one content are the same. Below 2^53, so that JavaScript reads it exactly.
    pub content: u64,
    /// The cells, row by row from the one of the origin: how likely they are occupied, 0 to 100 or 255 for unknown, and
    /// how many cells follow with this value, by turns. None when the asker has this content already.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub runs: Vec<u32>,
}

impl Message for MapData {
    const NAME: &'static str = "MapData";
    const LIMIT: usize = 1024 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("letters of a map's name", self.name.len(), MAX_NAME)?;
        within("resolution of a map in m", self.resolution.0, 1e-3, 10.0)?;
        for (axis, value) in [("x", self.origin.x), ("y", self.origin.y)] {
            within(&format!("{axis} of the origin of a map in m"), value.0, -1e5, 1e5)?;
        }
        within("heading of the origin of a map in rad", self.origin.heading.0, -10.0, 10.0)?;
        check_size(u64::from(self.width), u64::from(self.height))?;
        limit_list("runs of a map", self.runs.len(), MAX_RUNS)?;
        if self.runs.is_empty() {
            return Ok(());
        }
        let mut cells = 0_u64;
        for run in self.runs.chunks(2) {
            let [value, count] = run else {
                return Err(Refusal::malformed("runs of a map", "the last value has no count"));
            };
            if *value > 100 && *value != u32::from(UNKNOWN) {
                return Err(Refusal::out_of_range("value of a cell", value, "0 to 100, or 255 for unknown"));
            }
            cells += u64::from(*count);
        }
        let expected = u64::from(self.width) * u64::from(self.height);
        if cells == expected {
            Ok(())
        } else {
            Err(Refusal::malformed("runs of a map", format_args!("they have {cells} cells, not {expected}")))
        }
    }
}

/// Refuses a map that has no cells, or too many: before anything of its size is allocated.
///
/// # Errors
/// [`Refusal::OutOfRange`] or [`Refusal::TooLarge`].
pub fn check_size(width: u64, height: u64) -> Result<(), Refusal> {
    for (what, side) in [("width", width), ("height", height)] {
        if side == 0 || side > 65_535 {
            return Err(Refusal::out_of_range(format!("{what} of a map in cells"), side, "1 to 65535"));
        }
    }
    let (got, limit) = (width * height, MAX_CELLS as u64);
    if got <= limit {
        return Ok(());
    }
    Err(Refusal::TooLarge { what: format!("map of {width} x {height} cells"), got, limit })
}
