//! The Zenoh router of Axle.
