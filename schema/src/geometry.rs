//! Geometries: the shape of a path, without its speeds.
//!
//! These are the three that the paper has (section I.A). What a plan carries is a [`Geometry`], because Pathdriver and
//! the G-corrector rest on the constant ratio of the wheel speeds that all three have (model.md, 4.4). The curves
//! beyond the paper, for which a wheel must accelerate against the other, are a type of their own,
//! [`Curve`](crate::Curve): a plan with a leg that no service can drive cannot be written down.

use crate::navigator::{NavigatorSpan, Pose};
use crate::{Dwm, Metres, MetresPerSecond, Radians, Refusal, Seconds, Sides, Track, motion};
use serde::{Deserialize, Serialize};

/// A piece of a path that a differential-wheeled robot drives with a constant ratio of its wheel speeds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Geometry {
    /// Straight; a negative length drives backward.
    Line {
        /// Signed length.
        length: Metres,
    },
    /// On the spot.
    Turn {
        /// Positive to the left.
        angle: Radians,
    },
    /// Along a circle.
    Arc {
        /// Signed: the centre is on the left for positive, on the right for negative.
        radius: Metres,
        /// The turn, signed; `radius * angle` is the signed distance, negative = backward.
        angle: Radians,
    },
}

impl Geometry {
    /// An arc given by its radius and the signed distance driven by the middle of the axle.
    ///
    /// # Errors
    /// Refuses a radius of 0, along which no distance can be driven, and numbers that are not finite.
    pub fn arc_by_distance(radius: Metres, distance: Metres) -> Result<Self, Refusal> {
        if !(radius.is_finite() && radius.0.abs() > 0.0) {
            return Err(Refusal::out_of_range(
                "radius of an arc given by distance",
                radius,
                "finite, not 0 m",
            ));
        }
        if !distance.is_finite() {
            return Err(Refusal::out_of_range("distance of an arc", distance, "finite numbers"));
        }
        Ok(Self::Arc { radius, angle: Radians(distance / radius) })
    }

    /// The distances of both wheels when the geometry is driven once.
    #[must_use]
    pub fn wheel_distances(&self, track: Track) -> Sides<Metres> {
        let half = track.get() / 2.0;
        match *self {
            Self::Line { length } => Sides::new(length, length),
            Self::Turn { angle } => Sides::new(Metres(-angle.0 * half), Metres(angle.0 * half)),
            Self::Arc { radius, angle } => {
                Sides::new(Metres(angle.0 * (radius.0 - half)), Metres(angle.0 * (radius.0 + half)))
            }
        }
    }

    /// The displacement of the whole geometry.
    #[must_use]
    pub fn navigator_span(&self) -> NavigatorSpan {
        let (x, y, heading) = match *self {
            Self::Line { length } => (length.0, 0.0, 0.0),
            Self::Turn { angle } => (0.0, 0.0, angle.0),
            Self::Arc { radius, angle } => {
                let (x, y) = motion::chord(radius.0 * angle.0, angle.0);
                (x, y, angle.0)
            }
        };
        NavigatorSpan { duration: Seconds::ZERO, x: Metres(x), y: Metres(y), heading: Radians(heading) }
    }

    /// The pose after the geometry, when it starts at `from`.
    #[must_use]
    pub fn end_from(&self, from: Pose) -> Pose {
        let span = self.navigator_span();
        from.moved(span.x, span.y, span.heading)
    }

    /// The path of the middle of the axle; 0 for a turn on the spot.
    #[must_use]
    pub fn length(&self) -> Metres {
        match *self {
            Self::Line { length } => length.abs(),
            Self::Turn { .. } => Metres::ZERO,
            Self::Arc { radius, angle } => Metres((radius.0 * angle.0).abs()),
        }
    }

    /// The movement without acceleration whose faster wheel has speed 1: for drawing only (paper, I.B; model.md, 4.1).
    /// [`Curve::poses`](crate::Curve::poses) draws it.
    ///
    /// # Errors
    /// Refuses numbers that are not finite.
    pub fn normalized_dwm(&self, track: Track) -> Result<Dwm, Refusal> {
        let distances = self.wheel_distances(track);
        let duration = distances.left.abs().max(distances.right.abs());
        if duration.0 > 0.0 {
            Dwm::steady(distances.map(|distance| MetresPerSecond(distance / duration)), Seconds(duration.0))
        } else {
            Ok(Dwm::rest(Seconds::ZERO))
        }
    }

    /// Refuses numbers that no robot can drive: not finite, or beyond 1e6 m or 1e6 rad.
    ///
    /// # Errors
    /// [`Refusal::OutOfRange`] with the name of the number.
    pub fn check(&self) -> Result<(), Refusal> {
        let far = 1e6;
        match *self {
            Self::Line { length } => crate::refusal::within("length of a line", length.0, -far, far),
            Self::Turn { angle } => crate::refusal::within("angle of a turn", angle.0, -far, far),
            Self::Arc { radius, angle } => {
                crate::refusal::within("radius of an arc", radius.0, -far, far)?;
                crate::refusal::within("angle of an arc", angle.0, -far, far)
            }
        }
    }
}
