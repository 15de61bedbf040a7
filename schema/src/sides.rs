//! Symmetric data: what the left and the right wheel have each. Left comes before right, always.

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
    /// Both, left first.
    pub fn both(self) -> [T; 2] {
        [self.left, self.right]
    }
}
