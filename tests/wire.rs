//! The wire: what bytes Axle writes, and what it makes of the bytes of others.

mod examples;
mod golden;
mod hostile;
mod laws;
