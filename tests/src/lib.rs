//! Whole-system proofs of Axle.
