//! How the setpoint of both wheels changes from beat to beat: bounded, and along a straight line in the plane of the
//! two speeds, so that the path bends as little as possible while a limit holds.

use axle_schema::{MetresPerSecond, Sides};

/// The speeds after moving from `speeds` toward `target`, where no wheel changes by more than `change`.
///
/// Both wheels go the same share of their way, so that they arrive together.
pub(crate) fn toward(
    speeds: Sides<MetresPerSecond>,
    target: Sides<MetresPerSecond>,
    change: MetresPerSecond,
) -> Sides<MetresPerSecond> {
    let way = speeds.zip(target, |from, to| to - from);
    if way.both().iter().all(|way| way.abs().0 <= change.0) {
        return target;
    }
    let share = change / way.left.abs().max(way.right.abs());
    // Whatever is no number moves nothing.
    if (0.0..=1.0).contains(&share) && way.both().iter().all(|way| way.is_finite()) {
        speeds.zip(way, |from, way| from + way * share)
    } else {
        speeds
    }
}

/// The speeds after braking, where the faster wheel loses `change` and the other as much as keeps their ratio, and
/// with it the curvature of the path. Ends at exactly 0.
pub(crate) fn braked(speeds: Sides<MetresPerSecond>, change: MetresPerSecond) -> Sides<MetresPerSecond> {
    toward(speeds, Sides::default(), change)
}

/// Whether both wheels are at rest.
pub(crate) fn at_rest(speeds: Sides<MetresPerSecond>) -> bool {
    speeds.both().iter().all(|speed| *speed == MetresPerSecond::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn speeds(left: f64, right: f64) -> Sides<MetresPerSecond> {
        Sides::new(MetresPerSecond(left), MetresPerSecond(right))
    }

    #[test]
    fn both_wheels_go_the_same_share_of_their_way() {
        // The longest way is 0.8, a quarter of it is allowed: 0.2 and a quarter of 0.4.
        let next = toward(speeds(0.0, 0.2), speeds(0.4, 1.0), MetresPerSecond(0.2));
        assert!((next.left.0 - 0.1).abs() < 1e-15 && (next.right.0 - 0.4).abs() < 1e-15, "{next:?}");
        assert_eq!(toward(next, speeds(0.4, 1.0), MetresPerSecond(0.7)), speeds(0.4, 1.0));
    }

    #[test]
    fn braking_keeps_the_ratio_and_ends_at_exactly_zero() {
        let mut now = speeds(-0.3, 0.9);
        let mut beats = 0;
        while !at_rest(now) {
            assert!((now.left.0 * 3.0 + now.right.0).abs() < 1e-12, "the ratio is kept: {now:?}");
            now = braked(now, MetresPerSecond(0.01));
            beats += 1;
        }
        assert_eq!(beats, 90);
    }

    #[test]
    fn what_is_no_number_moves_nothing() {
        for change in [f64::NAN, -1.0] {
            assert_eq!(toward(speeds(0.1, 0.2), speeds(1.0, 1.0), MetresPerSecond(change)), speeds(0.1, 0.2));
        }
        for target in [f64::NAN, f64::INFINITY] {
            assert_eq!(toward(speeds(0.1, 0.2), speeds(target, 0.2), MetresPerSecond(0.1)), speeds(0.1, 0.2));
        }
    }
}
