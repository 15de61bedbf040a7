//! The heading from motion between fixes, where nothing else tells it.
//!
//! A fix has no heading (model.md 6.5), and a filter that knows no heading at all cannot be linear about one. So the
//! positions of some fixes are laid on the dead-reckoned positions of the same instants by the rotation that fits best;
//! its variance is `1 / Σ|p|²/σ²` with the positions `p` about their mean. While the robot stands, that is infinite:
//! the heading is unobservable, and no number of fixes changes it.

use axle_schema::Pose;
use nalgebra::Matrix3;

/// The most fixes that are kept: beyond these every second one is forgotten.
const MOST: usize = 64;
/// What dead reckoning between the fixes adds to their variance, as a factor.
const DRIFT: f64 = 1.5;
/// The heading is found when its standard deviation, in rad, is below this: the filter is linear enough then.
const FOUND: f64 = 0.12;
/// Residuals beyond this, squared and normalised for each fix, belong to other places.
const MISFIT: f64 = 9.0;

/// Fixes, each with the dead-reckoned pose of its instant and its variance in m².
#[derive(Clone, Debug, Default)]
pub(super) struct Seed {
    pairs: Vec<(Pose, [f64; 2], f64)>,
}

/// What was found.
pub(super) struct Found {
    pub(super) pose: Pose,
    pub(super) covariance: Matrix3<f64>,
}

impl Seed {
    pub(super) fn take(&mut self, odom: Pose, z: [f64; 2], variance: f64) {
        if self.pairs.len() == MOST {
            let mut odd = false;
            self.pairs.retain(|_| {
                odd = !odd;
                odd
            });
        }
        self.pairs.push((odom, z, variance));
    }

    /// Whether the last `n` fixes are as far from each other as the robot says it has come, whatever its heading is.
    pub(super) fn agree(&self, n: usize) -> bool {
        let from = self.pairs.len().saturating_sub(n);
        let last = &self.pairs[from..];
        last.len() >= n
            && last.windows(2).all(|two| {
                let [(p, z, v), (q, w, u)] = [two[0], two[1]];
                let fixes = (z[0] - w[0]).hypot(z[1] - w[1]);
                (fixes - p.distance(q).0).abs() <= 3.0 * (v + u).sqrt()
            })
    }

    /// Forgets all but the last `n`.
    pub(super) fn keep(&mut self, n: usize) {
        let from = self.pairs.len().saturating_sub(n);
        drop(self.pairs.drain(..from));
    }

    pub(super) fn clear(&mut self) {
        self.pairs.clear();
    }

    /// The pose in `map` of a robot that is at `now` in `odom`, once the heading can be told.
    pub(super) fn find(&mut self, now: Pose) -> Option<Found> {
        let found = self.fit(now);
        // One wild fix must not block the others for ever: the oldest is given up.
        if found.is_none() && self.pairs.len() > 8 && self.baseline() > 1.0 / (FOUND * FOUND) {
            self.pairs.remove(0);
        }
        found
    }

    fn weights(&self) -> impl Iterator<Item = (Pose, [f64; 2], f64)> + '_ {
        self.pairs.iter().map(|&(p, z, variance)| (p, z, 1.0 / (DRIFT * variance)))
    }

    fn means(&self) -> Option<([f64; 2], [f64; 2], f64)> {
        let total: f64 = self.weights().map(|(_, _, w)| w).sum();
        let mean = |pick: fn(Pose, [f64; 2]) -> f64| {
            self.weights().map(|(p, z, w)| w * pick(p, z)).sum::<f64>() / total
        };
        (total > 0.0).then(|| {
            ([mean(|p, _| p.x.0), mean(|p, _| p.y.0)], [mean(|_, z| z[0]), mean(|_, z| z[1])], total)
        })
    }

    /// `Σ|p|²/σ²`.
    fn baseline(&self) -> f64 {
        let Some((mp, _, _)) = self.means() else { return 0.0 };
        self.weights().map(|(p, _, w)| w * ((p.x.0 - mp[0]).powi(2) + (p.y.0 - mp[1]).powi(2))).sum()
    }

    fn fit(&self, now: Pose) -> Option<Found> {
        let (mp, mz, total) = self.means()?;
        let baseline = self.baseline();
        if baseline < 1.0 / (FOUND * FOUND) {
            return None;
        }
        let (mut along, mut across, mut spread) = (0.0, 0.0, 0.0);
        for (p, z, w) in self.weights() {
            let (px, py, zx, zy) = (p.x.0 - mp[0], p.y.0 - mp[1], z[0] - mz[0], z[1] - mz[1]);
            along += w * (px * zx + py * zy);
            across += w * (px * zy - py * zx);
            spread += w * (zx * zx + zy * zy);
        }
        // Σ w |z − R p|² of the best rotation.
        let misfit = spread + baseline - 2.0 * along.hypot(across);
        #[allow(clippy::cast_precision_loss, reason = "at most 64")]
        if misfit > MISFIT * self.pairs.len() as f64 {
            return None;
        }
        let alpha = across.atan2(along);
        let (sin, cos) = alpha.sin_cos();
        let (dx, dy) = (now.x.0 - mp[0], now.y.0 - mp[1]);
        let lever = [cos * dx - sin * dy, sin * dx + cos * dy];
        let pose = Pose::new(mz[0] + lever[0], mz[1] + lever[1], now.heading.0 + alpha);
        let turn = 1.0 / baseline;
        let by_turn = nalgebra::Vector3::new(-lever[1], lever[0], 1.0);
        let mut covariance = by_turn * by_turn.transpose() * turn;
        covariance[(0, 0)] += 1.0 / total;
        covariance[(1, 1)] += 1.0 / total;
        Some(Found { pose, covariance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Metres, Radians};

    #[test]
    fn a_robot_that_stands_learns_no_heading_and_one_that_drives_does() {
        let mut seed = Seed::default();
        for n in 0..50 {
            let wobble = 0.01 * f64::from(n % 3 - 1);
            seed.take(Pose::default(), [2.0 + wobble, 1.0 - wobble], 1e-4);
        }
        assert!(seed.find(Pose::default()).is_none(), "standing tells nothing");
        // Then it drives 1 m; in `map` it heads for 2.5 rad.
        let there = Pose::new(1.0, 0.0, 0.2);
        let origin = Pose::new(2.0, 1.0, 2.5);
        let truth = origin.moved(Metres(1.0), Metres(0.0), Radians(0.2));
        seed.take(there, [truth.x.0, truth.y.0], 1e-4);
        let found = seed.find(there).expect("a heading");
        assert!((found.pose.heading.0 - 2.7).abs() < 0.02, "{:?}", found.pose);
        assert!(found.pose.distance(truth).0 < 0.02);
        let sd = found.covariance[(2, 2)].sqrt();
        assert!((0.009..0.02).contains(&sd), "√1.5·σ/L is 0.012 rad, not {sd}");
    }

    #[test]
    fn fixes_of_different_places_do_not_agree() {
        let mut seed = Seed::default();
        for z in [[0.0, 0.0], [3.0, 1.0], [2.0, 4.0]] {
            seed.take(Pose::default(), z, 0.01);
        }
        assert!(!seed.agree(3) && !seed.agree(4));
        seed.keep(0);
        for n in 0..3 {
            seed.take(Pose::new(f64::from(n), 0.0, 0.0), [5.0, f64::from(n)], 0.01);
        }
        assert!(seed.agree(3));
    }
}
