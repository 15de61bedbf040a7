//! JSON lines: read one by one with their numbers, and the data that stand in them.
//!
//! A line is bounded; one that is too long, or no JSON, is a fault of its own, and the next line is read all the same.

use axle_schema::{Curve, Metres, Refusal, Track};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::io::{self, BufRead as _, BufReader, Read};

/// The longest line that is read, in bytes: no datum of the map needs a tenth of it.
const LONGEST: u64 = 64 * 1024;

/// The lines of a file or of a stream.
pub(crate) struct Lines<R> {
    input: BufReader<R>,
    line: Vec<u8>,
    number: u64,
}

impl<R: Read> Lines<R> {
    /// From the beginning of the input.
    pub(crate) fn new(input: R) -> Self {
        Self { input: BufReader::new(input), line: Vec::new(), number: 0 }
    }

    /// The number of the last line that was read, from 1.
    pub(crate) const fn number(&self) -> u64 {
        self.number
    }

    /// Whether the next line has not come yet, as far as is known without waiting for it.
    pub(crate) fn waits(&self) -> bool {
        self.input.buffer().is_empty()
    }

    /// The value of the next line, or why it has none; `None` at the end. Blank lines separate nothing and mean nothing.
    pub(crate) fn read(&mut self) -> io::Result<Option<Result<Value, String>>> {
        self.read_as()
    }

    /// As [`Lines::read`], without a value between line and datum.
    pub(crate) fn read_as<T: DeserializeOwned>(&mut self) -> io::Result<Option<Result<T, String>>> {
        loop {
            self.line.clear();
            if self.input.by_ref().take(LONGEST).read_until(b'\n', &mut self.line)? == 0 {
                return Ok(None);
            }
            self.number += 1;
            if self.line.len() as u64 == LONGEST && self.line.last() != Some(&b'\n') {
                self.skip_rest()?;
                return Ok(Some(Err(format!("longer than {LONGEST} bytes"))));
            }
            if !self.line.trim_ascii().is_empty() {
                return Ok(Some(serde_json::from_slice(&self.line).map_err(|fault| fault.to_string())));
            }
        }
    }

    fn skip_rest(&mut self) -> io::Result<()> {
        loop {
            self.line.clear();
            let read = self.input.by_ref().take(LONGEST).read_until(b'\n', &mut self.line)?;
            if read == 0 || self.line.last() == Some(&b'\n') {
                return Ok(());
            }
        }
    }
}

/// The datum that a value stands for.
pub(crate) fn read<T: DeserializeOwned>(value: &Value) -> Result<T, String> {
    T::deserialize(value).map_err(|fault| fault.to_string())
}

/// A datum as a line; numbers are the shortest decimals that read back as the same `f64`.
pub(crate) fn write<T: Serialize>(value: &T) -> Result<String, String> {
    serde_json::to_string(value).map_err(|fault| fault.to_string())
}

/// The track of the robot: the one of the line, or the one of the command line.
pub(crate) fn track(value: &Value, otherwise: Option<f64>) -> Result<Track, String> {
    match (value.get("track"), otherwise) {
        (Some(track), _) => read(track).map_err(|why| format!("track: {why}")),
        (None, Some(track)) => Track::new(Metres(track)).map_err(words),
        (None, None) => Err("missing field `track`; write it into the line or give --track".into()),
    }
}

/// A geometry. The track, which is about the robot, may stand beside it.
pub(crate) fn curve(value: &Value) -> Result<Curve, String> {
    let mut value = value.clone();
    if let Value::Object(fields) = &mut value {
        fields.remove("track");
    }
    let curve: Curve = read(&value)?;
    curve.check().map_err(words)?;
    Ok(curve)
}

/// A refusal in words.
#[allow(clippy::needless_pass_by_value, reason = "it stands in map_err")]
pub(crate) fn words(refusal: Refusal) -> String {
    refusal.to_string()
}
