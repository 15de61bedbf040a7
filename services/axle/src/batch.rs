//! Many movements at once, on every core.

use axle_schema::Dwm;
use axle_schema::Track;
use axle_schema::motion::Motion;
use std::num::NonZero;

/// Where each movement ends, in the frame of its start, computed on all cores.
///
/// The one list of results is all that is allocated, but for the threads themselves: each thread fills its own part.
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

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{MetresPerSecond, Seconds, Sides};

    #[test]
    fn a_batch_is_what_each_movement_is() {
        let track = Track::new(axle_schema::Metres(0.3)).unwrap();
        for count in [0, 1, 2, 3, 101] {
            let movements: Vec<_> = (0..count)
                .map(|k| {
                    let v = f64::from(k) / 100.0;
                    let speeds = Sides::new(MetresPerSecond(v), MetresPerSecond(0.5 - v));
                    Dwm::new(speeds, speeds.map(|speed| speed * 0.5), Seconds(1.0 + v)).unwrap()
                })
                .collect();
            let expected: Vec<_> = movements.iter().map(|dwm| dwm.motion_at(track, dwm.duration())).collect();
            assert_eq!(ends(&movements, track), expected);
        }
    }
}
