//! The page without a browser: its door, its live connection, its numbers, and the logs that it shows.
//!
//! `.ci/run page` drives it in a real browser.

mod foxglove;
mod gateway;
mod log;
