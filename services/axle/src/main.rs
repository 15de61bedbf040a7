//! The one command of Axle.
fn main() {}
