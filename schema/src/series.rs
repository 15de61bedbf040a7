//! The series language: every conversion of the map, on iterators and (in [`stream`]) on asynchronous streams.
//!
//! The paper extends LINQ for its data (section I.C); here the extensions are traits on [`Iterator`], and what LINQ does
//! besides, `std` does. An associated type says what a method makes of the items, so that `spread` gives encoder spans
//! for encoder data and displacements for poses: the paper's `ISpannableDeviceData` is [`Datum`], and every type that
//! implements it gets `spread` and `accumulate` too.
//!
//! ```
//! use axle_schema::series::{Accumulate as _, Convert as _, Spread as _, Symmetry as _};
//! use axle_schema::{EncodersData, Metres, MetresPerSecond, NavigatorData, NavigatorSpan, Pose, Refusal, Seconds, Track};
//!
//! # fn main() -> Result<(), Refusal> {
//! let track = Track::new(Metres(0.3))?;
//! let reading = |stamp, left, right| EncodersData { stamp: Seconds(stamp), left: Metres(left), right: Metres(right) };
//! let enc_data = [reading(0.0, 0.0, 0.0), reading(0.1, 0.02, 0.03), reading(0.2, 0.05, 0.05)];
//!
//! // encSpans.ToDWM().ToNavigatorDataSpans()
//! let enc_spans = enc_data.into_iter().spread();
//! let spans: Vec<NavigatorSpan> = enc_spans.to_dwm().to_navigator_spans(track).collect::<Result<_, _>>()?;
//! assert_eq!(spans.len(), 2);
//!
//! // navData.Spread().Accumulate(newBasis)
//! let basis = NavigatorData { pose: Pose::new(1.0, 2.0, 0.5), ..NavigatorData::default() };
//! let nav_data: Vec<NavigatorData> = spans.into_iter().accumulate(NavigatorData::default()).collect();
//! let shifted: Vec<NavigatorData> = nav_data.iter().copied().spread().accumulate(basis).collect();
//! assert_eq!(shifted.len(), 3);
//! assert_eq!(shifted[0].pose, basis.pose);
//!
//! // encData.Lefts() and dwms.Lefts()
//! let left_states: Vec<Metres> = enc_data.into_iter().lefts().map(|half| half.distance).collect();
//! assert_eq!(left_states, [Metres(0.0), Metres(0.02), Metres(0.05)]);
//! let dwms = enc_data.into_iter().spread().to_dwm().collect::<Result<Vec<_>, _>>()?;
//! let left_commands: Vec<MetresPerSecond> = dwms.into_iter().lefts().map(|half| half.v0).collect();
//! assert_eq!(left_commands.len(), 2);
//!
//! // encSpans.Lefts().Select(spanHalf => spanHalf.Distance).Sum()
//! let total: Metres = enc_data.into_iter().spread().lefts().map(|half| half.distance).sum();
//! assert!((total.0 - 0.05).abs() < 1e-15);
//! # Ok(())
//! # }
//! ```

use crate::{
    Curve, Dwm, EncodersData, EncodersSpan, Geometry, NavigatorData, NavigatorSpan, Refusal, Symmetric, Track,
};

pub mod stream;

/// A measurement at a stamp, between two of which there is a span.
pub trait Datum: Copy {
    /// What lies between two of them.
    type Span: Copy;
    /// The span from this measurement to a later one.
    fn span_to(&self, later: &Self) -> Self::Span;
    /// The measurement a span later.
    #[must_use]
    fn after(&self, span: &Self::Span) -> Self;
}

impl Datum for EncodersData {
    type Span = EncodersSpan;
    fn span_to(&self, later: &Self) -> EncodersSpan {
        EncodersSpan {
            duration: later.stamp - self.stamp,
            left: later.left - self.left,
            right: later.right - self.right,
        }
    }
    fn after(&self, span: &EncodersSpan) -> Self {
        Self {
            stamp: self.stamp + span.duration,
            left: self.left + span.left,
            right: self.right + span.right,
        }
    }
}

impl Datum for NavigatorData {
    type Span = NavigatorSpan;
    /// The displacement of the later pose in the frame of this one (model.md, 7); the heading is not wrapped.
    fn span_to(&self, later: &Self) -> NavigatorSpan {
        let seen = later.pose.seen_from(self.pose);
        NavigatorSpan { duration: later.stamp - self.stamp, x: seen.x, y: seen.y, heading: seen.heading }
    }
    fn after(&self, span: &NavigatorSpan) -> Self {
        Self {
            stamp: self.stamp + span.duration,
            pose: self.pose.moved(span.x, span.y, span.heading),
            twist: None,
            covariance: None,
        }
    }
}

/// What becomes a displacement when a robot of some track does it.
///
/// A `Result` of such a thing becomes a `Result` of a displacement, so that a chain of conversions may carry refusals to
/// its end, where `collect` joins them.
pub trait ToNavigatorSpan {
    /// [`NavigatorSpan`], or a `Result` of it.
    type Span;
    /// The displacement.
    fn to_navigator_span(self, track: Track) -> Self::Span;
}
impl ToNavigatorSpan for Dwm {
    type Span = NavigatorSpan;
    fn to_navigator_span(self, track: Track) -> NavigatorSpan {
        self.navigator_span(track)
    }
}
impl ToNavigatorSpan for EncodersSpan {
    type Span = NavigatorSpan;
    fn to_navigator_span(self, track: Track) -> NavigatorSpan {
        self.navigator_span(track)
    }
}
impl ToNavigatorSpan for Geometry {
    type Span = NavigatorSpan;
    fn to_navigator_span(self, _: Track) -> NavigatorSpan {
        self.navigator_span()
    }
}
impl ToNavigatorSpan for Curve {
    type Span = NavigatorSpan;
    fn to_navigator_span(self, _: Track) -> NavigatorSpan {
        self.navigator_span()
    }
}
impl<T: ToNavigatorSpan, E> ToNavigatorSpan for Result<T, E> {
    type Span = Result<T::Span, E>;
    fn to_navigator_span(self, track: Track) -> Self::Span {
        self.map(|item| item.to_navigator_span(track))
    }
}

/// What encoders would count.
pub trait ToEncodersSpan {
    /// [`EncodersSpan`], or a `Result` of it.
    type Span;
    /// The distances of both wheels.
    fn to_encoders_span(self) -> Self::Span;
}
impl ToEncodersSpan for Dwm {
    type Span = EncodersSpan;
    fn to_encoders_span(self) -> EncodersSpan {
        self.encoders_span()
    }
}
impl<T: ToEncodersSpan, E> ToEncodersSpan for Result<T, E> {
    type Span = Result<T::Span, E>;
    fn to_encoders_span(self) -> Self::Span {
        self.map(ToEncodersSpan::to_encoders_span)
    }
}

/// Remembers two spans, because the acceleration within one comes from those before and after it.
#[derive(Clone, Copy, Debug, Default)]
struct Neighbours {
    before: Option<EncodersSpan>,
    here: Option<EncodersSpan>,
}

impl Neighbours {
    /// Takes the next span, or none at the end, and gives the movement of the one before it.
    fn take(&mut self, after: Option<EncodersSpan>) -> Option<Result<Dwm, Refusal>> {
        let here = std::mem::replace(&mut self.here, after);
        let before = std::mem::replace(&mut self.before, here);
        here.map(|here| here.to_accelerated_dwm(before.as_ref(), after.as_ref()))
    }
}

/// Measurements to the spans between them.
pub trait Spread: Iterator<Item: Datum> + Sized {
    /// One span for each pair of neighbours.
    fn spread(self) -> impl Iterator<Item = <Self::Item as Datum>::Span> {
        let mut last = None;
        self.filter_map(move |datum| last.replace(datum).map(|last: Self::Item| last.span_to(&datum)))
    }
}
impl<I: Iterator<Item: Datum>> Spread for I {}

/// A first measurement and spans to all measurements.
pub trait Accumulate<D: Datum>: Iterator<Item = D::Span> + Sized {
    /// `first`, and a measurement after each span.
    fn accumulate(self, first: D) -> impl Iterator<Item = D> {
        std::iter::once(first).chain(self.scan(first, |last, span| {
            *last = last.after(&span);
            Some(*last)
        }))
    }
}
impl<D: Datum, I: Iterator<Item = D::Span>> Accumulate<D> for I {}

/// Symmetric data to what one wheel has of it.
pub trait Symmetry: Iterator<Item: Symmetric> + Sized {
    /// The left halves.
    fn lefts(self) -> impl Iterator<Item = <Self::Item as Symmetric>::Half> {
        self.map(|item| item.split().left)
    }
    /// The right halves.
    fn rights(self) -> impl Iterator<Item = <Self::Item as Symmetric>::Half> {
        self.map(|item| item.split().right)
    }
}
impl<I: Iterator<Item: Symmetric>> Symmetry for I {}

/// Data of one type to data of another.
pub trait Convert: Iterator + Sized {
    /// Spans to movements at constant speeds: [`EncodersSpan::to_dwm`].
    fn to_dwm(self) -> impl Iterator<Item = Result<Dwm, Refusal>>
    where
        Self: Iterator<Item = EncodersSpan>,
    {
        self.map(|span| span.to_dwm())
    }
    /// Spans to movements with the accelerations that their neighbours let expect:
    /// [`EncodersSpan::to_accelerated_dwm`]. Each movement comes when the span after it is known.
    fn to_accelerated_dwms(self) -> impl Iterator<Item = Result<Dwm, Refusal>>
    where
        Self: Iterator<Item = EncodersSpan>,
    {
        let mut neighbours = Neighbours::default();
        self.map(Some).chain(std::iter::once(None)).filter_map(move |span| neighbours.take(span))
    }
    /// Movements to what encoders would count.
    fn to_encoders_spans(self) -> impl Iterator<Item = <Self::Item as ToEncodersSpan>::Span>
    where
        Self::Item: ToEncodersSpan,
    {
        self.map(ToEncodersSpan::to_encoders_span)
    }
    /// Movements, encoder spans, geometries and curves to displacements.
    fn to_navigator_spans(self, track: Track) -> impl Iterator<Item = <Self::Item as ToNavigatorSpan>::Span>
    where
        Self::Item: ToNavigatorSpan,
    {
        self.map(move |item| item.to_navigator_span(track))
    }
}
impl<I: Iterator> Convert for I {}
