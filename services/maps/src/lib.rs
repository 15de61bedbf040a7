//! Maps: what is free around the robots, and how far the next obstacle is.
//!
//! Reads maps as users of ROS have them, a `map.yaml` and an image beside it ([`describe`], [`image`]), and says them as
//! [`MapData`], the answer of the map service. Planners and the emulator make a [`Clearance`] of them. Everything here
//! takes bytes and gives values: who reads files is the program.
//!
//! Files come from people and from other programs. Each fault is refused by its field; what is announced too large is
//! refused before anything of its size is allocated.

use axle_schema::contract::{Bounds, Params};
use axle_schema::map::{MAX_NAME, MAX_RUNS, UNKNOWN, check_size};
use axle_schema::refusal::within;
use axle_schema::{MapData, Message as _, Metres, Pose, Refusal};
use serde::{Deserialize, Serialize};

mod clearance;
pub mod describe;
mod draw;
pub mod image;

pub use clearance::{Clearance, Unknown};
pub use describe::{Description, Mode};
pub use draw::{Ink, areas, ascii, png};

/// Parameters of the map service: `deploy/params/map.toml`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MapParams {
    /// The `map.yaml` to serve; at most 4096 bytes. Empty: the service has no map, and says so to whoever asks.
    pub file: String,
}

impl Bounds for MapParams {
    fn check(&self) -> Result<(), Refusal> {
        #[allow(clippy::cast_precision_loss, reason = "only a small length passes")]
        within("bytes of file", self.file.len() as f64, 0.0, 4096.0)
    }
}

impl Params for MapParams {
    const FILE: &'static str = include_str!("../../../deploy/params/map.toml");
}

/// A map as its cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// What people call it.
    pub name: String,
    /// Side of a cell.
    pub resolution: Metres,
    /// The outer corner of the first cell; rows run along its heading, one above the other to its left.
    pub origin: Pose,
    width: usize,
    height: usize,
    /// Row by row from the origin: how likely each cell is occupied, 0 to 100, or [`UNKNOWN`].
    cells: Vec<u8>,
}

impl Grid {
    /// A map of `width` cells in a row, from its cells in rows, the row of the origin first.
    ///
    /// # Errors
    /// Refuses sizes and values that a [`MapData`] may not have.
    pub fn new(
        name: &str,
        resolution: Metres,
        origin: Pose,
        width: usize,
        cells: Vec<u8>,
    ) -> Result<Self, Refusal> {
        let height = cells.len().checked_div(width).unwrap_or(0);
        check_size(width as u64, height as u64)?;
        if width * height != cells.len() {
            return Err(Refusal::malformed("cells of a map", "they do not fill the last row"));
        }
        let wrong = |&&value: &&u8| value > 100 && value != UNKNOWN;
        if let Some(value) = cells.iter().find(wrong) {
            return Err(Refusal::out_of_range("value of a cell", value, "0 to 100, or 255 for unknown"));
        }
        // The name is for people; one that is too long is cut where a letter ends.
        let end = (0..=MAX_NAME.min(name.len())).rev().find(|&end| name.is_char_boundary(end)).unwrap_or(0);
        let name = name.get(..end).unwrap_or_default().to_owned();
        let grid = Self { name, resolution, origin, width, height, cells };
        grid.head().check()?;
        Ok(grid)
    }

    /// Cells of a row.
    #[must_use]
    pub const fn width(&self) -> usize {
        self.width
    }
    /// Rows.
    #[must_use]
    pub const fn height(&self) -> usize {
        self.height
    }
    /// The cells, row by row from the origin.
    #[must_use]
    pub fn cells(&self) -> &[u8] {
        &self.cells
    }
    /// The value of a cell; unknown outside the map.
    #[must_use]
    pub fn value(&self, column: usize, row: usize) -> u8 {
        if column < self.width && row < self.height {
            self.cells.get(row * self.width + column).copied().unwrap_or(UNKNOWN)
        } else {
            UNKNOWN
        }
    }
    /// A point of the plane in cells from the origin; the middle of the first cell is (0.5, 0.5).
    #[must_use]
    pub fn in_cells(&self, x: f64, y: f64) -> (f64, f64) {
        let seen = Pose::new(x, y, 0.0).seen_from(self.origin);
        (seen.x.0 / self.resolution.0, seen.y.0 / self.resolution.0)
    }
    /// The point of the plane that is so many cells from the origin.
    #[must_use]
    pub fn in_metres(&self, u: f64, v: f64) -> (f64, f64) {
        let turn = axle_schema::Radians::ZERO;
        let pose = self.origin.moved(self.resolution * u, self.resolution * v, turn);
        (pose.x.0, pose.y.0)
    }

    /// How many cells are free, occupied and unknown: below, from and beyond the share that Axle takes for occupied.
    #[must_use]
    pub fn counts(&self) -> (usize, usize, usize) {
        let unknown = self.cells.iter().filter(|&&value| value == UNKNOWN).count();
        let occupied = self.cells.iter().filter(|&&value| is_occupied(value)).count();
        (self.cells.len() - unknown - occupied, occupied, unknown)
    }

    fn head(&self) -> MapData {
        #[allow(clippy::cast_possible_truncation, reason = "sides are at most 65535")]
        let [width, height] = [self.width, self.height].map(|side| side as u32);
        MapData {
            name: self.name.clone(),
            resolution: self.resolution,
            origin: self.origin,
            width,
            height,
            content: 0,
            runs: Vec::new(),
        }
    }

    /// The map as it is sent.
    ///
    /// # Errors
    /// Refuses a map of so many small specks that it does not fit into a message.
    pub fn to_data(&self) -> Result<MapData, Refusal> {
        let mut data = self.head();
        let mut cells = self.cells.iter();
        if let Some(&first) = cells.next() {
            let (mut value, mut count) = (first, 1_u32);
            for &next in cells {
                if next == value {
                    count += 1;
                } else {
                    data.runs.extend([u32::from(value), count]);
                    (value, count) = (next, 1);
                }
            }
            data.runs.extend([u32::from(value), count]);
        }
        if data.runs.len() > MAX_RUNS {
            let what = format!("map {:?}, in runs of equal cells,", data.name);
            return Err(Refusal::TooLarge { what, got: data.runs.len() as u64, limit: MAX_RUNS as u64 });
        }
        data.content = content(&data);
        data.check()?;
        Ok(data)
    }

    /// The map that was sent.
    ///
    /// # Errors
    /// Refuses what [`MapData`] may not be, and one without cells.
    pub fn of_data(data: &MapData) -> Result<Self, Refusal> {
        data.check()?;
        if data.runs.is_empty() {
            return Err(Refusal::missing("runs of a map", "give its cells, value and count by turns"));
        }
        let mut cells = Vec::with_capacity(data.width as usize * data.height as usize);
        for run in data.runs.chunks_exact(2) {
            if let [value, count] = run {
                let value = u8::try_from(*value).unwrap_or(UNKNOWN);
                cells.resize(cells.len() + *count as usize, value);
            }
        }
        Self::new(&data.name, data.resolution, data.origin, data.width as usize, cells)
    }
}

/// Whether a cell of this value is an obstacle: from 65 on, as ROS's own `occupied_thresh` has it.
#[must_use]
pub const fn is_occupied(value: u8) -> bool {
    value >= 65 && value != UNKNOWN
}

/// Names what is in a map: FNV-1a of everything that planners look at, cut to 53 bits.
fn content(data: &MapData) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut take = |word: u64| {
        for byte in word.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    };
    let origin = data.origin;
    for number in [data.resolution.0, origin.x.0, origin.y.0, origin.heading.0] {
        take(number.to_bits());
    }
    [data.width, data.height].iter().chain(&data.runs).for_each(|&number| take(u64::from(number)));
    hash & ((1 << 53) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grid(width: usize, cells: Vec<u8>) -> Result<Grid, Refusal> {
        Grid::new("a map", Metres(0.05), Pose::new(1.0, 2.0, 0.5), width, cells)
    }

    #[test]
    fn the_parameter_file_holds_the_defaults() {
        let read: MapParams = toml::from_str(MapParams::FILE).expect("the file is valid");
        assert_eq!(read, MapParams::default());
        assert!(toml::from_str::<MapParams>("fil = \"a.yaml\"").is_err(), "a misspelt field is refused");
    }

    #[test]
    fn points_go_to_cells_and_back() {
        let grid = grid(2, vec![0; 6]).expect("a map");
        assert_eq!((grid.width(), grid.height()), (2, 3));
        let (x, y) = grid.in_metres(1.5, 2.5);
        let (u, v) = grid.in_cells(x, y);
        assert!((u - 1.5).abs() < 1e-12 && (v - 2.5).abs() < 1e-12);
        // Along the heading of the origin: 1.5 cells of 5 cm.
        let (x, y) = grid.in_metres(1.5, 0.0);
        assert!(
            (x - 1.0 - 0.075 * 0.5_f64.cos()).abs() < 1e-12
                && (y - 2.0 - 0.075 * 0.5_f64.sin()).abs() < 1e-12
        );
    }

    #[test]
    fn what_is_no_map_is_refused_by_name() {
        let check = |width, cells: Vec<u8>, words: &str| {
            let refusal = grid(width, cells).expect_err(words).to_string();
            assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
        };
        check(0, vec![0; 4], "width of a map");
        check(3, vec![0; 4], "do not fill the last row");
        check(2, vec![0, 101, 0, 0], "value of a cell is out of range: 101");
        check(4096, vec![0; 4096 * 4097], "map of 4096 x 4097 cells is too large: 16781312");
        let noise = (0..1 << 19).map(|index| if index % 2 == 0 { 0 } else { 100 }).collect();
        let refusal = grid(1 << 10, noise).expect("a map").to_data().expect_err("specks").to_string();
        assert!(refusal.contains("in runs of equal cells, is too large: 1048576"), "{refusal}");
    }

    #[test]
    fn the_content_tells_maps_apart() {
        let of = |cells: Vec<u8>| grid(2, cells).and_then(|grid| grid.to_data()).expect("a map").content;
        assert_eq!(of(vec![0, 0, 100, 0]), of(vec![0, 0, 100, 0]));
        assert_ne!(of(vec![0, 0, 100, 0]), of(vec![0, 100, 0, 0]));
        assert_ne!(of(vec![0; 4]), of(vec![0; 6]));
    }

    proptest! {
        #[test]
        fn a_map_comes_back_from_the_wire(
            width in 1_usize..40,
            cells in proptest::collection::vec(prop_oneof![0_u8..=100, Just(UNKNOWN)], 1..400),
        ) {
            let rows = cells.len().div_ceil(width);
            let mut cells = cells;
            cells.resize(rows * width, 0);
            let grid = grid(width, cells).expect("a map");
            let bytes = axle_schema::encode(&grid.to_data().expect("data")).expect("bytes");
            let data: MapData = axle_schema::decode(&bytes).expect("the message");
            prop_assert_eq!(Grid::of_data(&data).expect("the map"), grid);
        }
    }
}
