//! The room that a robot needs to be calibrated in.

use axle_schema::{Metres, Refusal, Track};
use std::str::FromStr;

/// Kept free on every side, m.
const MARGIN: f64 = 0.1;
/// The smallest square that tells something, and the largest one that is driven, m.
const SIDE: (f64, f64) = (0.25, 1.0);
/// The side of a square as a share of the way to the edge: a robot that nobody has calibrated misses its corners.
const SHARE: f64 = 0.85;

/// A free rectangle with the robot in its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Along the direction that the robot looks in.
    pub length: Metres,
    /// Across it.
    pub width: Metres,
}

impl Room {
    /// How far the middle of the robot may go from the middle of the room.
    pub(crate) fn reach(self, track: Track) -> f64 {
        self.length.min(self.width).0 / 2.0 - track.get() / 2.0 - MARGIN
    }

    /// The side of the squares that the robot drives in it.
    ///
    /// # Errors
    /// Says how much room is needed.
    pub(crate) fn side(self, track: Track) -> Result<f64, Refusal> {
        let side = SHARE * self.reach(track);
        if side >= SIDE.0 {
            return Ok(side.min(SIDE.1));
        }
        let needed = 2.0 * (SIDE.0 / SHARE + MARGIN) + track.get();
        // Rounded up, so that what is said is enough.
        let limit =
            format!("{0:.1}x{0:.1} m at least, with the robot in the middle", (needed * 10.0).ceil() / 10.0);
        Err(Refusal::out_of_range("room", self, limit))
    }
}

impl std::fmt::Display for Room {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{} m", self.length.0, self.width.0)
    }
}

impl FromStr for Room {
    type Err = Refusal;
    /// Reads `2x2`, in metres.
    fn from_str(text: &str) -> Result<Self, Refusal> {
        let wrong = || Refusal::malformed("room", "write length and width of the free floor in metres: 2x2");
        let (length, width) = text.split_once('x').ok_or_else(wrong)?;
        let side = |text: &str| {
            let metres = text.trim().parse().ok().filter(|metres| (0.1..=1000.0).contains(metres));
            metres.map(Metres).ok_or_else(wrong)
        };
        Ok(Self { length: side(length)?, width: side(width)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_is_read_and_one_that_is_too_small_is_refused() {
        let track = Track::new(Metres(0.3)).expect("a track");
        let room: Room = "2x2.5".parse().expect("a room");
        assert!((room.side(track).expect("enough") - 0.6375).abs() < 1e-12);
        for text in ["", "2", "2x", "x2", "2x-1", "2xnan", "1e9x1", "2 m x 2 m"] {
            assert!(text.parse::<Room>().is_err(), "{text:?}");
        }
        let closet: Room = "1x3".parse().expect("a room");
        let said = closet.side(track).expect_err("too small").to_string();
        assert!(said.contains("1.1x1.1 m"), "{said}");
        assert!("1.1x1.1".parse::<Room>().expect("a room").side(track).is_ok());
    }
}
