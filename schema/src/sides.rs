//! Symmetric data: what the left and the right wheel have each. Left comes before right, always.

use crate::Refusal;
use serde::{Deserialize, Serialize};

/// A value for the left wheel and one for the right wheel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sides<T> {
    /// Of the left wheel.
    pub left: T,
    /// Of the right wheel.
    pub right: T,
}

impl<T> Sides<T> {
    /// Left, then right.
    pub const fn new(left: T, right: T) -> Self {
        Self { left, right }
    }
    /// The same function of each side.
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> Sides<U> {
        Sides { left: f(self.left), right: f(self.right) }
    }
    /// A function of each side and the same side of another pair.
    pub fn zip<U, V>(self, other: Sides<U>, mut f: impl FnMut(T, U) -> V) -> Sides<V> {
        Sides { left: f(self.left, other.left), right: f(self.right, other.right) }
    }
    /// References to both.
    pub const fn as_ref(&self) -> Sides<&T> {
        Sides { left: &self.left, right: &self.right }
    }
    /// Both, left first.
    pub fn both(self) -> [T; 2] {
        [self.left, self.right]
    }
}

/// What can be divided into a left and a right part (the paper's symmetric data, section I.B).
///
/// `join` after `split` is the identity.
pub trait Symmetric: Sized {
    /// What one wheel has of it.
    type Half;
    /// The wheels apart.
    fn split(self) -> Sides<Self::Half>;
    /// Two wheels together.
    ///
    /// # Errors
    /// Refuses halves of different times, and what no value of this type may hold.
    fn join(halves: Sides<Self::Half>) -> Result<Self, Refusal>;
}

/// The time that both halves of one datum carry.
pub(crate) fn same_time(what: &str, left: crate::Seconds, right: crate::Seconds) -> Result<(), Refusal> {
    #[allow(clippy::float_cmp, reason = "the halves of one datum carry the very same number")]
    if left.0 == right.0 {
        Ok(())
    } else {
        Err(Refusal::out_of_range(
            format!("{what} of two halves"),
            format!("{left} and {right}"),
            format!("the same {what}"),
        ))
    }
}
