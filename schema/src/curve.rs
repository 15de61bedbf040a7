//! Curves: what one differential wheeled movement can draw, spirals and clothoids included.
//!
//! The paper leaves spirals and clothoids out, "because they are hard to define" (section I.A). Each has a short
//! definition in the quantity that is linear along it, and is then exactly one movement of constant wheel
//! accelerations:
//!
//! * along a **spiral** (an involute of a circle) the radius is linear in the heading: constant turning rate, linear
//!   speed;
//! * along a **clothoid** the curvature is linear in the length: constant speed, linear turning rate.
//!
//! A general movement is neither: it is a circle plus a clothoid (model.md, 1.4). [`Dwm::curve`] says which curve a
//! movement is within a tolerance, if any.

use crate::geometry::Geometry;
use crate::motion::Wheels;
use crate::navigator::{NavigatorData, NavigatorSpan, Pose};
use crate::refusal::within;
use crate::{Dwm, Metres, MetresPerSecond, PerMetre, Radians, Refusal, Seconds, Sides, Track};
use serde::{Deserialize, Serialize};

/// A piece of a path that one [`Dwm`] can draw.
///
/// In JSON the three steady ones are written as a [`Geometry`] is, so that every geometry can be read as a curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "CurveWire", into = "CurveWire")]
pub enum Curve {
    /// With a constant ratio of the wheel speeds.
    Steady(Geometry),
    /// The radius is linear in the heading. Where it changes its sign, the robot goes over from forward to backward.
    Spiral {
        /// Signed radius at the start: the centre is on the left for positive, on the right for negative.
        start_radius: Metres,
        /// Signed radius at the end.
        end_radius: Metres,
        /// The turn, signed; `radius * angle` has the sign of the direction of driving, as for an arc.
        angle: Radians,
    },
    /// The curvature is linear in the length: Euler's spiral.
    Clothoid {
        /// Curvature at the start, to the left positive (for a robot that drives forward along it).
        start_curvature: PerMetre,
        /// Curvature at the end.
        end_curvature: PerMetre,
        /// Signed length; negative = backward.
        length: Metres,
    },
}

/// A curve as it is written: one level, by name.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum CurveWire {
    Line { length: Metres },
    Turn { angle: Radians },
    Arc { radius: Metres, angle: Radians },
    Spiral { start_radius: Metres, end_radius: Metres, angle: Radians },
    Clothoid { start_curvature: PerMetre, end_curvature: PerMetre, length: Metres },
}

impl From<CurveWire> for Curve {
    fn from(wire: CurveWire) -> Self {
        match wire {
            CurveWire::Line { length } => Self::Steady(Geometry::Line { length }),
            CurveWire::Turn { angle } => Self::Steady(Geometry::Turn { angle }),
            CurveWire::Arc { radius, angle } => Self::Steady(Geometry::Arc { radius, angle }),
            CurveWire::Spiral { start_radius, end_radius, angle } => {
                Self::Spiral { start_radius, end_radius, angle }
            }
            CurveWire::Clothoid { start_curvature, end_curvature, length } => {
                Self::Clothoid { start_curvature, end_curvature, length }
            }
        }
    }
}
impl From<Curve> for CurveWire {
    fn from(curve: Curve) -> Self {
        match curve {
            Curve::Steady(Geometry::Line { length }) => Self::Line { length },
            Curve::Steady(Geometry::Turn { angle }) => Self::Turn { angle },
            Curve::Steady(Geometry::Arc { radius, angle }) => Self::Arc { radius, angle },
            Curve::Spiral { start_radius, end_radius, angle } => {
                Self::Spiral { start_radius, end_radius, angle }
            }
            Curve::Clothoid { start_curvature, end_curvature, length } => {
                Self::Clothoid { start_curvature, end_curvature, length }
            }
        }
    }
}

impl From<Geometry> for Curve {
    fn from(geometry: Geometry) -> Self {
        Self::Steady(geometry)
    }
}
impl TryFrom<Curve> for Geometry {
    type Error = Refusal;
    /// Refuses spirals and clothoids by name: whoever takes geometries drives with a constant ratio of wheel speeds.
    fn try_from(curve: Curve) -> Result<Self, Refusal> {
        match curve {
            Curve::Steady(geometry) => Ok(geometry),
            Curve::Spiral { .. } | Curve::Clothoid { .. } => Err(Refusal::Unknown {
                what: "geometry with a constant ratio of the wheel speeds".into(),
                got: curve.name().into(),
                known: "line, turn, arc".into(),
            }),
        }
    }
}

impl Curve {
    /// What it is called: line, turn, arc, spiral or clothoid.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Steady(Geometry::Line { .. }) => "line",
            Self::Steady(Geometry::Turn { .. }) => "turn",
            Self::Steady(Geometry::Arc { .. }) => "arc",
            Self::Spiral { .. } => "spiral",
            Self::Clothoid { .. } => "clothoid",
        }
    }

    /// A movement along the curve whose largest wheel speed is 1: for drawing only (model.md, 4.1, extended).
    ///
    /// Along a steady curve it has no acceleration, as the paper wants it of a normalized movement (section I.B);
    /// along a spiral both wheels have the same, along a clothoid opposite ones, for no movement without acceleration
    /// draws them.
    ///
    /// # Errors
    /// Refuses numbers that are not finite.
    pub fn normalized_dwm(&self, track: Track) -> Result<Dwm, Refusal> {
        let half = track.get() / 2.0;
        let (start, end, duration) = match *self {
            Self::Steady(geometry) => return geometry.normalized_dwm(track),
            Self::Spiral { start_radius, end_radius, angle } => {
                let largest = start_radius.0.abs().max(end_radius.0.abs()) + half;
                let sign = angle.0.signum();
                let speeds = |radius: Metres| {
                    Sides::new(sign * (radius.0 - half) / largest, sign * (radius.0 + half) / largest)
                };
                (speeds(start_radius), speeds(end_radius), angle.0.abs() * largest)
            }
            Self::Clothoid { start_curvature, end_curvature, length } => {
                let largest = 1.0 + start_curvature.0.abs().max(end_curvature.0.abs()) * half;
                let sign = length.0.signum();
                let speeds = |curvature: PerMetre| {
                    let turning = curvature.0 * half;
                    Sides::new(sign * (1.0 - turning) / largest, sign * (1.0 + turning) / largest)
                };
                (speeds(start_curvature), speeds(end_curvature), length.0.abs() * largest)
            }
        };
        if duration == 0.0 {
            return Ok(Dwm::rest(Seconds::ZERO));
        }
        Dwm::new(start.map(MetresPerSecond), end.map(MetresPerSecond), Seconds(duration))
    }

    /// The displacement of the whole curve; exact, whatever robot drives it.
    #[must_use]
    pub fn navigator_span(&self) -> NavigatorSpan {
        // Every track gives the same curve. This one makes the outer wheel twice as fast as the middle of the axle
        // where the curve is tightest or widest, so that no digit of the turning rate is lost in the difference of
        // two wheel speeds.
        let (middle, turning, duration, heading) = match *self {
            Self::Steady(geometry) => return geometry.navigator_span(),
            Self::Spiral { start_radius, end_radius, angle } => {
                let sign = angle.0.signum();
                ([start_radius.0 * sign, end_radius.0 * sign], [sign, sign], angle.0.abs(), angle.0)
            }
            Self::Clothoid { start_curvature, end_curvature, length } => {
                let sign = length.0.signum();
                let mean = f64::midpoint(start_curvature.0, end_curvature.0);
                let turning = [start_curvature.0 * sign, end_curvature.0 * sign];
                ([sign, sign], turning, length.0.abs(), mean * length.0)
            }
        };
        let fastest = middle[0].abs().max(middle[1].abs());
        let quickest = turning[0].abs().max(turning[1].abs());
        // Below 1e-300/m a curve is straight in every digit, and its own track would not be finite.
        let half = if fastest > 0.0 && quickest > 0.0 { (fastest / quickest).min(1e300) } else { 1.0 };
        let motion = Wheels {
            v0l: middle[0] - turning[0] * half,
            v0r: middle[0] + turning[0] * half,
            v1l: middle[1] - turning[1] * half,
            v1r: middle[1] + turning[1] * half,
            duration,
            track: 2.0 * half,
        }
        .end();
        NavigatorSpan {
            duration: Seconds::ZERO,
            x: Metres(motion.x),
            y: Metres(motion.y),
            heading: Radians(heading),
        }
    }

    /// The states along the curve, for a chart: those of its normalized movement (see [`Dwm::poses`]), so that the
    /// stamps count the metres of the faster wheel from 0, and `step` is in these metres too. For a geometry:
    /// `Curve::from(geometry)`.
    ///
    /// # Errors
    /// Refuses numbers that are not finite.
    pub fn poses(
        &self,
        from: Pose,
        track: Track,
        step: Seconds,
    ) -> Result<impl Iterator<Item = NavigatorData> + use<>, Refusal> {
        let from = NavigatorData { pose: from, ..NavigatorData::default() };
        Ok(self.normalized_dwm(track)?.poses(from, track, step))
    }

    /// Refuses numbers that no robot can drive: not finite, or beyond 1e6 m, 1e6 rad or 1e6/m.
    ///
    /// # Errors
    /// [`Refusal::OutOfRange`] with the name of the number.
    pub fn check(&self) -> Result<(), Refusal> {
        let far = 1e6;
        match *self {
            Self::Steady(geometry) => geometry.check(),
            Self::Spiral { start_radius, end_radius, angle } => {
                within("start radius of a spiral", start_radius.0, -far, far)?;
                within("end radius of a spiral", end_radius.0, -far, far)?;
                within("angle of a spiral", angle.0, -far, far)
            }
            Self::Clothoid { start_curvature, end_curvature, length } => {
                within("start curvature of a clothoid", start_curvature.0, -far, far)?;
                within("end curvature of a clothoid", end_curvature.0, -far, far)?;
                within("length of a clothoid", length.0, -far, far)
            }
        }
    }
}
