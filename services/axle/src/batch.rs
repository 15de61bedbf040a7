//! Many movements at once, on every core.

use axle_schema::Dwm;
use axle_schema::Track;
use axle_schema::motion::Motion;
use std::num::NonZero;

/// Where each movement ends, in the frame of its start, computed on all cores.
///
/// The one list of results is all that is allocated, but for the threads themselves: each thread fills its own part.
/// `bench/motion.rs` proves it, since this file is also looked at by a bench of the schema, which has no tests.
pub(crate) fn ends(movements: &[Dwm], track: Track) -> Vec<Motion> {
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let mut ends = vec![Motion::default(); movements.len()];
    let part = movements.len().div_ceil(cores).max(1);
    std::thread::scope(|scope| {
        for (movements, ends) in movements.chunks(part).zip(ends.chunks_mut(part)) {
            scope.spawn(move || axle_schema::dwm::fill_ends(movements, track, ends));
        }
    });
    ends
}
