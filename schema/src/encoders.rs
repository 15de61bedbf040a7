//! What the wheels have done: encoder readings and the spans between them.

use crate::codec::Message;
use crate::navigator::NavigatorSpan;
use crate::refusal::within;
use crate::{Dwm, Metres, Radians, Refusal, Seconds, Sides, Track, motion};
use serde::{Deserialize, Serialize};

/// The distance each wheel has covered since the robot's boot, at a stamp of the robot's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EncodersData {
    /// Seconds since the boot of the robot process.
    pub stamp: Seconds,
    /// Signed distance of the left wheel.
    pub left: Metres,
    /// Signed distance of the right wheel.
    pub right: Metres,
}

/// One wheel of [`EncodersData`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EncodersHalf {
    /// Seconds since the boot of the robot process.
    pub stamp: Seconds,
    /// Signed distance of the wheel.
    pub distance: Metres,
}

/// The distance each wheel covers in an interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EncodersSpan {
    /// Length of the interval.
    pub duration: Seconds,
    /// Signed distance of the left wheel.
    pub left: Metres,
    /// Signed distance of the right wheel.
    pub right: Metres,
}

impl EncodersData {
    /// Both distances.
    #[must_use]
    pub const fn sides(&self) -> Sides<Metres> {
        Sides::new(self.left, self.right)
    }
    /// The wheels apart.
    #[must_use]
    pub fn halves(&self) -> Sides<EncodersHalf> {
        self.sides().map(|distance| EncodersHalf { stamp: self.stamp, distance })
    }
}

impl EncodersSpan {
    /// Both distances.
    #[must_use]
    pub const fn sides(&self) -> Sides<Metres> {
        Sides::new(self.left, self.right)
    }
    /// The movement at constant speeds that covers the span: choice (a) of model.md 4.3.
    ///
    /// # Errors
    /// Refuses a span without duration that covers a distance: no finite speed does that.
    pub fn to_dwm(&self) -> Result<Dwm, Refusal> {
        if self.duration.0 > 0.0 {
            Dwm::steady(self.sides().map(|distance| distance / self.duration), self.duration)
        } else if self.left == Metres::ZERO && self.right == Metres::ZERO {
            Ok(Dwm::rest(Seconds::ZERO))
        } else {
            Err(Refusal::out_of_range(
                "duration of an encoder span that moves",
                self.duration,
                "more than 0 s",
            ))
        }
    }
    /// The displacement along the arc that constant wheel speeds drive: exact for them (model.md, 1.3).
    #[must_use]
    pub fn navigator_span(&self, track: Track) -> NavigatorSpan {
        let (x, y, heading) = motion::arc(self.left.0, self.right.0, track.get());
        NavigatorSpan { duration: self.duration, x: Metres(x), y: Metres(y), heading: Radians(heading) }
    }
}

impl Message for EncodersData {
    const NAME: &'static str = "EncodersData";
    const LIMIT: usize = 256;

    fn check(&self) -> Result<(), Refusal> {
        // No wheel turns a thousand million metres, and no robot runs for thirty years.
        within("stamp in s", self.stamp.0, -1e9, 1e9)?;
        within("distance of the left wheel in m", self.left.0, -1e9, 1e9)?;
        within("distance of the right wheel in m", self.right.0, -1e9, 1e9)
    }
}
impl Message for EncodersSpan {
    const NAME: &'static str = "EncodersSpan";
    const LIMIT: usize = 256;
}
