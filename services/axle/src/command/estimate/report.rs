//! How far an estimate is from the truth, and whether it knows that.

use super::log::Truth;
use axle_navigator::{Counts, Innovation, Navigator};
use axle_schema::{Pose, Radians, Seconds};
use serde_json::{Value, json};

/// The error at one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Error {
    pub(super) stamp: f64,
    /// Of the position, in m.
    pub(super) distance: f64,
    /// Of the heading, in rad, where the truth has one.
    pub(super) heading: Option<f64>,
    /// What the estimate thinks of its heading, in rad.
    pub(super) heading_sd: f64,
}

/// Errors over a log.
#[derive(Clone, Debug, Default)]
pub(super) struct Report {
    pub(super) errors: Vec<Error>,
    /// Squared normalised errors of the position, of 2 degrees of freedom each.
    nees: (f64, f64),
    /// Squared normalised innovations, and their degrees of freedom.
    nis: (f64, f64),
    pub(super) counts: Counts,
    pub(super) events: u64,
}

impl Report {
    pub(super) const HEADER: [&str; 9] =
        ["method", "truths", "rmse m", "max m", "end m", "heading rad", "NEES/2", "NIS/dof", "rejected"];

    /// Compares the pose in `map` at the stamp of the truth.
    pub(super) fn judge(&mut self, navigator: &Navigator, truth: &Truth) {
        let Some(position) = navigator.position() else { return };
        let Some((_, map)) = navigator.poses_at(Seconds(truth.stamp)) else { return };
        let distance = map.distance(Pose::new(truth.x, truth.y, 0.0)).0;
        let heading = truth.heading.map(|heading| Radians(map.heading.0 - heading).wrapped().0);
        let p = position.map_covariance.0;
        self.errors.push(Error { stamp: truth.stamp, distance, heading, heading_sd: p[8].max(0.0).sqrt() });
        let (dx, dy, det) = (map.x.0 - truth.x, map.y.0 - truth.y, p[0] * p[4] - p[1] * p[3]);
        // A pose that is said to be exact has no normalised error.
        if det > 1e-20 {
            self.nees.0 += (dx * dx * p[4] - dx * dy * (p[1] + p[3]) + dy * dy * p[0]) / det;
            self.nees.1 += 2.0;
        }
    }

    pub(super) fn innovation(&mut self, innovation: Innovation) {
        self.nis.0 += innovation.squared;
        self.nis.1 += if innovation.degrees == 2 { 2.0 } else { 1.0 };
    }

    /// Root of the mean square, largest and last error of the position, and root of the mean square of the heading's.
    fn figures(&self) -> [Option<f64>; 4] {
        let rms = |squares: &mut dyn Iterator<Item = f64>| {
            let (sum, n) = squares.fold((0.0, 0.0), |(sum, n), square| (sum + square, n + 1.0));
            (n > 0.0).then(|| f64::sqrt(sum / n))
        };
        [
            rms(&mut self.errors.iter().map(|error| error.distance * error.distance)),
            self.errors.iter().map(|error| error.distance).reduce(f64::max),
            self.errors.last().map(|error| error.distance),
            rms(&mut self.errors.iter().filter_map(|error| error.heading).map(|turn| turn * turn)),
        ]
    }

    fn means(&self) -> [Option<f64>; 2] {
        [self.nees, self.nis].map(|(sum, degrees)| (degrees > 0.0).then(|| sum / degrees))
    }

    pub(super) fn row(&self, method: &str) -> Vec<String> {
        let text = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.4}"));
        let mut row = vec![method.to_owned(), self.errors.len().to_string()];
        row.extend(self.figures().map(text));
        row.extend(self.means().map(text));
        row.push(self.counts.rejected.to_string());
        row
    }

    pub(super) fn json(&self, method: &str) -> Value {
        let ([rmse, max, end, heading_rmse], [nees, nis], counts) =
            (self.figures(), self.means(), self.counts);
        json!({
            "method": method, "truths": self.errors.len(), "rmse": rmse, "max": max, "end": end,
            "heading_rmse": heading_rmse, "nees": nees, "nis": nis, "rejected": counts.rejected, "late": counts.late,
            "stale": counts.stale, "jumps": counts.jumps, "restarts": counts.restarts, "events": self.events,
        })
    }
}
