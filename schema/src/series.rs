//! The series language: measurements to spans and back (paper, section I.C).
//!
//! ```
//! use axle_schema::{EncodersData, Metres, Seconds, series::{Accumulate as _, Spread as _}};
//! let at = |stamp, left, right| EncodersData { stamp: Seconds(stamp), left: Metres(left), right: Metres(right) };
//! let readings = [at(0.0, 0.0, 0.0), at(0.1, 0.02, 0.03), at(0.2, 0.05, 0.05)];
//! let spans: Vec<_> = readings.into_iter().spread().collect();
//! let again: Vec<_> = spans.into_iter().accumulate(readings[0]).collect();
//! assert_eq!(again.len(), 3);
//! ```

use crate::{EncodersData, EncodersSpan, NavigatorData, NavigatorSpan};

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
