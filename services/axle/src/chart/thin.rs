//! Points that can be drawn, and no more of them than can be seen.

/// The most points of one line.
const MAX_POINTS: usize = 3000;
/// Farther than this nothing is drawn: it would only hide the rest.
const FAR: f64 = 1e7;

/// Whether a point can be drawn at all.
pub(super) fn is_fine(&(x, y): &(f64, f64)) -> bool {
    // Written so that NaN fails.
    x.abs() <= FAR && y.abs() <= FAR
}

/// The points that can be told apart when a pixel is `pixel` wide and high; first and last are kept.
pub(super) fn thin(points: &[(f64, f64)], pixel: (f64, f64)) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    let mut last = None;
    for &point in points.iter().filter(|point| is_fine(point)) {
        let near = kept.last().is_some_and(|&(x, y): &(f64, f64)| {
            ((point.0 - x) / pixel.0).hypot((point.1 - y) / pixel.1) < 0.5
        });
        if !near {
            kept.push(point);
        }
        last = Some(point);
    }
    if kept.len() > MAX_POINTS {
        kept = kept.iter().copied().step_by(kept.len().div_ceil(MAX_POINTS)).collect();
    }
    if kept.last() != last.as_ref() {
        kept.extend(last);
    }
    kept
}

/// Lowest and highest of both coordinates; `None` without points.
pub(super) fn bounds(points: impl Iterator<Item = (f64, f64)>) -> Option<[(f64, f64); 2]> {
    points.filter(is_fine).fold(None, |bounds, (x, y)| {
        let [(left, right), (low, high)] = bounds.unwrap_or([(x, x), (y, y)]);
        Some([(left.min(x), right.max(x)), (low.min(y), high.max(y))])
    })
}
