//! Simpson's rule for the same integral: what the exact routine is measured against, and nothing that Axle uses.

use super::Wheels;

/// The most intervals that [`intervals`] tries.
const MOST: u32 = 200_000;

/// The displacement `t` seconds after the start, by Simpson's rule with `n` intervals, an even number above 0.
#[must_use]
pub fn simpson(w: &Wheels, t: f64, n: u32) -> (f64, f64) {
    let (mut x, mut y) = (0.0, 0.0);
    let (v0, n0) = ((w.v0l + w.v0r) / 2.0, w.v0r - w.v0l);
    let (dv, dn) = ((w.v1l + w.v1r) / 2.0 - v0, w.v1r - w.v1l - n0);
    for k in 0..=n {
        let time = t * f64::from(k) / f64::from(n);
        let share = time / w.duration;
        let (sin, cos) = ((n0 + dn * share / 2.0) * time / w.track).sin_cos();
        let weight = if k == 0 || k == n { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
        let v = weight * (v0 + dv * share);
        x += v * cos;
        y += v * sin;
    }
    let size = t / f64::from(n) / 3.0;
    (x * size, y * size)
}

/// The fewest intervals, to a factor of about 1.2, with which Simpson's rule is no farther than `error` metres from the
/// true displacement; none where 200 000 are not enough.
#[must_use]
pub fn intervals(w: &Wheels, t: f64, (x, y): (f64, f64), error: f64) -> Option<u32> {
    let mut n = 2;
    while n < MOST {
        let found = simpson(w, t, n);
        if (found.0 - x).hypot(found.1 - y) <= error {
            return Some(n);
        }
        n = (n + n / 5 + 2) & !1;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_times_the_intervals_miss_by_a_256th() {
        let w = Wheels { v0l: 0.2, v0r: 0.5, v1l: 1.0, v1r: 0.6, duration: 2.0, track: 0.3 };
        let end = w.end();
        let miss = |n| {
            let (x, y) = simpson(&w, 2.0, n);
            (x - end.x).hypot(y - end.y)
        };
        assert!((miss(20) / miss(80) / 256.0 - 1.0).abs() < 0.05, "{:e} {:e}", miss(20), miss(80));
    }

    #[test]
    fn the_intervals_found_are_enough_and_hardly_more() {
        let w = Wheels { v0l: 0.2, v0r: 0.5, v1l: 1.0, v1r: 0.6, duration: 2.0, track: 0.3 };
        let (end, error) = (w.end(), 1e-12);
        let n = intervals(&w, 2.0, (end.x, end.y), error).expect("a smooth movement");
        let miss = |n| {
            let (x, y) = simpson(&w, 2.0, n);
            (x - end.x).hypot(y - end.y)
        };
        assert!(miss(n) <= error && miss((n * 3 / 4) & !1) > error, "{n}");
        assert_eq!(intervals(&w, 2.0, (end.x, end.y), -1.0), None);
    }
}
