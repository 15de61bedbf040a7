//! The series language on asynchronous streams: the same words as on iterators.
//!
//! A stream of Axle is endless and slow: readings come when the robot says them. These adaptors hold one or two items at
//! most, wait for nothing but the stream, and compose with those of `futures` and `tokio`.
//!
//! ```
//! use axle_schema::series::stream::{Accumulate as _, Convert as _, Spread as _, Symmetry as _};
//! use axle_schema::{EncodersData, Metres, NavigatorData, Refusal, Seconds, Track};
//! use futures_util::{FutureExt as _, StreamExt as _, TryStreamExt as _, stream};
//!
//! # fn main() -> Result<(), Refusal> {
//! let track = Track::new(Metres(0.3))?;
//! let reading = |stamp, left, right| EncodersData { stamp: Seconds(stamp), left: Metres(left), right: Metres(right) };
//! let enc_data = || stream::iter([reading(0.0, 0.0, 0.0), reading(0.1, 0.02, 0.03), reading(0.2, 0.05, 0.05)]);
//!
//! let spans = enc_data().spread().to_dwm().to_navigator_spans(track).try_collect::<Vec<_>>();
//! let spans = spans.now_or_never().expect("every reading is there already")?;
//!
//! let poses = stream::iter(spans).accumulate(NavigatorData::default()).take(2).collect::<Vec<_>>();
//! assert_eq!(poses.now_or_never().map(|poses| poses.len()), Some(2));
//!
//! let total = enc_data().spread().lefts().fold(0.0, |sum, half| std::future::ready(sum + half.distance.0));
//! assert!((total.now_or_never().expect("every reading is there already") - 0.05).abs() < 1e-15);
//! # Ok(())
//! # }
//! ```

use super::{Datum, Neighbours, ToEncodersSpan, ToNavigatorSpan};
use crate::{Dwm, EncodersSpan, Refusal, Symmetric, Track};
use futures_util::{Stream, StreamExt as _, stream};
use std::future::ready;

/// Measurements to the spans between them.
pub trait Spread: Stream<Item: Datum> + Sized {
    /// One span for each pair of neighbours.
    fn spread(self) -> impl Stream<Item = <Self::Item as Datum>::Span> {
        let mut last = None;
        self.filter_map(move |datum| ready(last.replace(datum).map(|last: Self::Item| last.span_to(&datum))))
    }
}
impl<S: Stream<Item: Datum>> Spread for S {}

/// A first measurement and spans to all measurements.
pub trait Accumulate<D: Datum>: Stream<Item = D::Span> + Sized {
    /// `first` at once, and a measurement after each span.
    fn accumulate(self, first: D) -> impl Stream<Item = D> {
        let mut last = first;
        stream::once(ready(first)).chain(self.map(move |span| {
            last = last.after(&span);
            last
        }))
    }
}
impl<D: Datum, S: Stream<Item = D::Span>> Accumulate<D> for S {}

/// Symmetric data to what one wheel has of it.
pub trait Symmetry: Stream<Item: Symmetric> + Sized {
    /// The left halves.
    fn lefts(self) -> impl Stream<Item = <Self::Item as Symmetric>::Half> {
        self.map(|item| item.split().left)
    }
    /// The right halves.
    fn rights(self) -> impl Stream<Item = <Self::Item as Symmetric>::Half> {
        self.map(|item| item.split().right)
    }
}
impl<S: Stream<Item: Symmetric>> Symmetry for S {}

/// Data of one type to data of another.
pub trait Convert: Stream + Sized {
    /// Spans to movements at constant speeds: [`EncodersSpan::to_dwm`].
    fn to_dwm(self) -> impl Stream<Item = Result<Dwm, Refusal>>
    where
        Self: Stream<Item = EncodersSpan>,
    {
        self.map(|span| span.to_dwm())
    }
    /// Spans to movements with the accelerations that their neighbours let expect:
    /// [`EncodersSpan::to_accelerated_dwm`]. Each movement comes one span late, the last at the end of the stream.
    fn to_accelerated_dwms(self) -> impl Stream<Item = Result<Dwm, Refusal>>
    where
        Self: Stream<Item = EncodersSpan>,
    {
        let mut neighbours = Neighbours::default();
        self.map(Some).chain(stream::once(ready(None))).filter_map(move |span| ready(neighbours.take(span)))
    }
    /// Movements to what encoders would count.
    fn to_encoders_spans(self) -> impl Stream<Item = <Self::Item as ToEncodersSpan>::Span>
    where
        Self::Item: ToEncodersSpan,
    {
        self.map(ToEncodersSpan::to_encoders_span)
    }
    /// Movements, encoder spans, geometries and curves to displacements.
    fn to_navigator_spans(self, track: Track) -> impl Stream<Item = <Self::Item as ToNavigatorSpan>::Span>
    where
        Self::Item: ToNavigatorSpan,
    {
        self.map(move |item| item.to_navigator_span(track))
    }
}
impl<S: Stream> Convert for S {}
