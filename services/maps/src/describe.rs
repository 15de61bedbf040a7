//! `map.yaml`: how an image becomes a map, as ROS's map_server has it.
//!
//! The files that map savers write are flat: a name and a value on each line, the origin in brackets. That is the part
//! of YAML that is read here; anchors, nested lists and the like are refused by their line and not guessed at. Unknown
//! names are refused too: a misspelt threshold must not be taken for the default.

use axle_schema::map::{UNKNOWN, check_size};
use axle_schema::refusal::within;
use axle_schema::{Metres, Pose, Refusal};

use crate::Grid;
use crate::image::Image;

/// The most bytes of a description.
pub const MAX_BYTES: usize = 64 * 1024;

/// How the lightness of a pixel becomes the value of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Free, occupied, or unknown.
    #[default]
    Trinary,
    /// Between the thresholds in proportion, 1 to 99; where the image is transparent, unknown.
    Scale,
    /// The lightness itself, 0 to 100; all others are unknown.
    Raw,
}

/// What a `map.yaml` says.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Path of the image, relative to the file.
    pub image: String,
    /// Side of a pixel.
    pub resolution: Metres,
    /// Pose of the lower left corner of the image.
    pub origin: Pose,
    /// Whether white is occupied, and not black.
    pub negate: bool,
    /// A pixel that is darker than this share is occupied, 0 to 1.
    pub occupied_thresh: f64,
    /// A pixel that is lighter than this share is free, 0 to 1.
    pub free_thresh: f64,
    /// How lightness becomes a value.
    pub mode: Mode,
}

impl Description {
    /// Reads a `map.yaml`.
    ///
    /// # Errors
    /// Names the line and the field.
    pub fn read(bytes: &[u8]) -> Result<Self, Refusal> {
        if bytes.len() > MAX_BYTES {
            let what = "map.yaml in bytes".into();
            return Err(Refusal::TooLarge { what, got: bytes.len() as u64, limit: MAX_BYTES as u64 });
        }
        let text = std::str::from_utf8(bytes).map_err(|_| Refusal::malformed("map.yaml", "it is no text"))?;
        let mut found = Found::default();
        for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            found
                .take(line)
                .map_err(|why| Refusal::malformed("map.yaml", format_args!("line {}: {why}", number + 1)))?;
        }
        found.description()
    }

    /// The map that the description makes of an image.
    ///
    /// # Errors
    /// Refuses an image that is too large for a map.
    pub fn grid(&self, name: &str, image: &Image) -> Result<Grid, Refusal> {
        check_size(image.width as u64, image.height as u64)?;
        let mut cells = Vec::with_capacity(image.width * image.height);
        // The first row of an image is its uppermost one, the first row of a map the one of its origin.
        for row in image.pixels.chunks_exact(image.width).rev() {
            cells.extend(row.iter().map(|&(light, opaque)| self.value(light, opaque)));
        }
        Grid::new(name, self.resolution, self.origin, image.width, cells)
    }

    /// The value of a cell, from its lightness and opacity, each 0 to 255.
    fn value(&self, light: u8, opaque: u8) -> u8 {
        let dark = if self.negate { light } else { 255 - light };
        let share = f64::from(dark) / 255.0;
        match self.mode {
            Mode::Raw if light <= 100 => light,
            Mode::Raw => UNKNOWN,
            // map_server looks at the transparency in this mode only.
            Mode::Scale if opaque == 0 => UNKNOWN,
            _ if share > self.occupied_thresh => 100,
            _ if share < self.free_thresh => 0,
            Mode::Trinary => UNKNOWN,
            Mode::Scale => {
                let between = (share - self.free_thresh) / (self.occupied_thresh - self.free_thresh);
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 99")]
                let value = (1.0 + 98.0 * between).clamp(1.0, 99.0) as u8;
                value
            }
        }
    }

    /// The text of a `map.yaml` that says the same.
    #[must_use]
    pub fn write(&self) -> String {
        let Self { image, resolution, origin, occupied_thresh, free_thresh, .. } = self;
        let mode = match self.mode {
            Mode::Trinary => "trinary",
            Mode::Scale => "scale",
            Mode::Raw => "raw",
        };
        format!(
            "image: {image}\nmode: {mode}\nresolution: {:?}\norigin: [{:?}, {:?}, {:?}]\nnegate: {}\n\
             occupied_thresh: {occupied_thresh:?}\nfree_thresh: {free_thresh:?}\n",
            resolution.0,
            origin.x.0,
            origin.y.0,
            origin.heading.0,
            u8::from(self.negate),
        )
    }
}

/// What the lines of a file have said so far.
#[derive(Default)]
struct Found {
    image: Option<String>,
    resolution: Option<f64>,
    origin: Option<[f64; 3]>,
    negate: Option<bool>,
    occupied: Option<f64>,
    free: Option<f64>,
    mode: Option<Mode>,
}

impl Found {
    fn take(&mut self, line: &str) -> Result<(), String> {
        let line = without_comment(line).trim_end();
        if line.trim().is_empty() || line == "---" || line == "..." {
            return Ok(());
        }
        if line.starts_with([' ', '\t', '-']) {
            return Err("it begins with a blank or a dash; write \"name: value\", one a line".into());
        }
        let (name, value) =
            line.split_once(':').ok_or_else(|| format!("{:?} is no \"name: value\"", shown(line)))?;
        let value = value.trim();
        match name.trim() {
            "image" => put(&mut self.image, name, path(value)?),
            "resolution" => put(&mut self.resolution, name, number(value)?),
            "origin" => put(&mut self.origin, name, origin(value)?),
            "negate" => put(&mut self.negate, name, truth(value)?),
            "occupied_thresh" => put(&mut self.occupied, name, number(value)?),
            "free_thresh" => put(&mut self.free, name, number(value)?),
            "mode" => put(&mut self.mode, name, mode(value)?),
            other => Err(format!(
                "unknown name {:?}; known: image, resolution, origin, negate, occupied_thresh, free_thresh, mode",
                shown(other)
            )),
        }
    }

    fn description(self) -> Result<Description, Refusal> {
        let missing = |what: &str, hint: &str| Refusal::missing(format!("{what} of map.yaml"), hint);
        let origin = self
            .origin
            .ok_or_else(|| missing("origin", "where the lower left corner is, \"origin: [x, y, yaw]\""))?;
        let description = Description {
            image: self.image.ok_or_else(|| missing("image", "the path of the image, \"image: map.pgm\""))?,
            resolution: Metres(
                self.resolution
                    .ok_or_else(|| missing("resolution", "metres in a pixel, \"resolution: 0.05\""))?,
            ),
            origin: Pose::new(origin[0], origin[1], origin[2]),
            negate: self.negate.unwrap_or(false),
            occupied_thresh: self.occupied.unwrap_or(0.65),
            free_thresh: self.free.unwrap_or(0.196),
            mode: self.mode.unwrap_or_default(),
        };
        within("resolution of map.yaml in m", description.resolution.0, 1e-3, 10.0)?;
        within("x of the origin of map.yaml in m", origin[0], -1e5, 1e5)?;
        within("y of the origin of map.yaml in m", origin[1], -1e5, 1e5)?;
        within("yaw of the origin of map.yaml in rad", origin[2], -10.0, 10.0)?;
        within("occupied_thresh of map.yaml", description.occupied_thresh, 0.0, 1.0)?;
        within("free_thresh of map.yaml", description.free_thresh, 0.0, 1.0)?;
        if description.free_thresh >= description.occupied_thresh {
            let limit = format!("below occupied_thresh, {}", description.occupied_thresh);
            return Err(Refusal::out_of_range("free_thresh of map.yaml", description.free_thresh, limit));
        }
        Ok(description)
    }
}

fn put<T>(place: &mut Option<T>, name: &str, value: T) -> Result<(), String> {
    if place.replace(value).is_some() { Err(format!("{} stands there twice", shown(name))) } else { Ok(()) }
}

/// A comment begins with # at the beginning of a line or behind a blank, and not in quotes.
fn without_comment(line: &str) -> &str {
    let mut quote = None;
    let mut before = ' ';
    for (index, c) in line.char_indices() {
        match (quote, c) {
            (Some(open), c) if open == c => quote = None,
            (Some(_), _) => {}
            (None, '"' | '\'') => quote = Some(c),
            (None, '#') if before.is_whitespace() => return line.get(..index).unwrap_or_default(),
            (None, _) => {}
        }
        before = c;
    }
    line
}

fn path(value: &str) -> Result<String, String> {
    let bare = ['"', '\''].into_iter().find_map(|quote| value.strip_prefix(quote)?.strip_suffix(quote));
    let path = bare.unwrap_or(value);
    let is_fine = !path.is_empty() && path.len() <= 4096 && !path.contains(['"', '\'', '\\', '\0']);
    if is_fine && !path.starts_with(['&', '*', '!', '|', '>', '[', '{']) {
        Ok(path.to_owned())
    } else {
        Err(format!("{:?} is no path; write it plain or in quotes", shown(value)))
    }
}

fn number(value: &str) -> Result<f64, String> {
    value.parse().map_err(|_| format!("{:?} is not a number", shown(value)))
}

fn origin(value: &str) -> Result<[f64; 3], String> {
    let wrong = || format!("{:?} is no origin; write [x, y, yaw]", shown(value));
    let inner = value.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).ok_or_else(wrong)?;
    let mut numbers = inner.split(',');
    let mut next = || numbers.next().map(str::trim).ok_or_else(wrong).and_then(number);
    let origin = [next()?, next()?, next()?];
    if numbers.next().is_some() { Err(wrong()) } else { Ok(origin) }
}

fn truth(value: &str) -> Result<bool, String> {
    match value {
        "0" | "false" | "False" => Ok(false),
        "1" | "true" | "True" => Ok(true),
        _ => Err(format!("{:?} is neither 0 nor 1", shown(value))),
    }
}

fn mode(value: &str) -> Result<Mode, String> {
    match value {
        "trinary" => Ok(Mode::Trinary),
        "scale" => Ok(Mode::Scale),
        "raw" => Ok(Mode::Raw),
        _ => Err(format!("unknown mode {:?}; known: trinary, scale, raw", shown(value))),
    }
}

/// The beginning of what somebody else wrote, without what a terminal would obey.
fn shown(text: &str) -> String {
    text.trim().chars().take(40).filter(|c| !c.is_control()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As ROS's map_saver writes it.
    const SAVED: &str = "image: testmap.png\nmode: trinary\nresolution: 0.1\norigin: [2.0, 3.0, 1.0]\n\
                         negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";

    #[test]
    fn what_map_savers_write_is_read_and_written_again() {
        let read = Description::read(SAVED.as_bytes()).expect("a description");
        assert_eq!(
            (read.image.as_str(), read.resolution, read.mode),
            ("testmap.png", Metres(0.1), Mode::Trinary)
        );
        assert_eq!((read.origin, read.negate), (Pose::new(2.0, 3.0, 1.0), false));
        assert_eq!(Description::read(read.write().as_bytes()), Ok(read));
        let short =
            "# a comment\nimage: 'a b.pgm' # another\n\nresolution: 5e-2\norigin: [-1,0,0]\nnegate: 1\n";
        let read = Description::read(short.as_bytes()).expect("a description");
        assert_eq!((read.image.as_str(), read.negate), ("a b.pgm", true));
        assert!((read.occupied_thresh - 0.65).abs() < 1e-12 && (read.free_thresh - 0.196).abs() < 1e-12);
    }

    #[test]
    fn a_wrong_description_is_refused_by_line_and_field() {
        let check = |from: &str, to: &str, words: &str| {
            let text = SAVED.replacen(from, to, 1);
            assert_ne!(text, SAVED, "{from:?} stands there");
            let refusal = Description::read(text.as_bytes()).expect_err(words).to_string();
            assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
        };
        check("resolution: 0.1", "resolution: 0", "resolution of map.yaml in m is out of range: 0");
        check("resolution: 0.1", "resolution: nan", "out of range: NaN");
        check("resolution: 0.1", "resolution: 0,1", "line 3: \"0,1\" is not a number");
        check("resolution: 0.1\n", "", "resolution of map.yaml is missing");
        check("image: testmap.png\n", "", "image of map.yaml is missing");
        check("origin: [2.0, 3.0, 1.0]", "origin: [2.0, 3.0]", "line 4: \"[2.0, 3.0]\" is no origin");
        check("origin: [2.0, 3.0, 1.0]", "origin: [2.0, 3.0, inf]", "yaw of the origin");
        check("origin: [2.0, 3.0, 1.0]", "origin:\n- 2.0", "line 4: \"\" is no origin");
        check("negate: 0", "negate: maybe", "\"maybe\" is neither 0 nor 1");
        check("occupied_thresh: 0.65", "occupied_tresh: 0.65", "unknown name \"occupied_tresh\"");
        check("occupied_thresh: 0.65", "occupied_thresh: 0.1", "free_thresh of map.yaml is out of range");
        check("mode: trinary", "mode: binary", "unknown mode \"binary\"; known: trinary, scale, raw");
        check("mode: trinary", "image: b.png", "line 2: image stands there twice");
        check("mode: trinary", "  mode: trinary", "line 2: it begins with a blank");
        assert!(
            Description::read(&[0xff; 8]).is_err() && Description::read(&vec![b'#'; MAX_BYTES + 1]).is_err()
        );
    }

    #[test]
    fn lightness_becomes_what_map_server_makes_of_it() {
        let of = |mode, negate| {
            let read = Description::read(SAVED.as_bytes()).expect("a description");
            Description { mode, negate, ..read }
        };
        // 205 is the grey that map savers write for unknown; 254 and 0 are their free and occupied.
        let trinary = of(Mode::Trinary, false);
        assert_eq!([254, 205, 0].map(|light| trinary.value(light, 255)), [0, 255, 100]);
        assert_eq!([254, 205, 0].map(|light| of(Mode::Trinary, true).value(light, 255)), [100, 100, 0]);
        let scale = of(Mode::Scale, false);
        // 1 + 98 · (0.5 - 0.196) / (0.65 - 0.196) with 0.5 = 1 - 127.5/255; 127 is a little darker.
        assert_eq!([254, 127, 0].map(|light| scale.value(light, 255)), [0, 67, 100]);
        assert_eq!(scale.value(0, 0), UNKNOWN, "transparent");
        let raw = of(Mode::Raw, true);
        assert_eq!([0, 100, 101, 255].map(|light| raw.value(light, 255)), [0, 100, 255, 255]);
    }

    #[test]
    fn the_lowest_row_of_the_image_is_the_first_of_the_map() {
        let image =
            Image { width: 2, height: 2, pixels: [0, 254, 254, 205].map(|light| (light, 255)).to_vec() };
        let grid =
            Description::read(SAVED.as_bytes()).and_then(|read| read.grid("m", &image)).expect("a map");
        assert_eq!(grid.cells(), [0, 255, 100, 0]);
    }
}
