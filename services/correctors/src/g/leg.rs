//! A leg seen from its leading wheel (model.md 4.4, "One geometry").

use axle_schema::{Drivetrain, Plan, Sides};

/// A distance of the leading wheel, at a constant ratio of the wheel speeds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// Speeds of the wheels for a leading wheel at 1; the larger of the absolute values is 1.
    k: Sides<f64>,
    /// Whether the left wheel leads.
    left_leads: bool,
    /// Distance of the leading wheel, m.
    pub(super) s: f64,
    /// Its largest speed, m/s.
    pub(super) u_max: f64,
    /// What the wheels should have covered since the task began when the leg begins, m.
    base: Sides<f64>,
}

/// The legs of a plan that move a wheel; neighbours of the same ratio are one leg.
pub(super) fn legs(plan: &Plan, robot: &Drivetrain, effort: f64) -> Vec<Leg> {
    let mut legs: Vec<Leg> = Vec::new();
    let mut base = Sides::new(0.0, 0.0);
    for leg in &plan.legs {
        let distances = leg.geometry.wheel_distances(robot.track).map(|distance| distance.0);
        let s = distances.left.abs().max(distances.right.abs());
        if !(s > 0.0 && s.is_finite()) {
            continue;
        }
        let k = distances.map(|distance| distance / s);
        let (kv, k_omega) =
            (f64::midpoint(k.left, k.right).abs(), ((k.right - k.left) / robot.track.get()).abs());
        let v = leg.speed.map_or(robot.speed.0 * effort, |speed| speed.0.min(robot.speed.0 * effort));
        // A line has kω = 0 and a turn has kv = 0: the quotient is then infinite and limits nothing.
        let u_max = (robot.wheel_speed.0 * effort).min(v / kv).min(robot.turn_rate.0 * effort / k_omega);
        let next = Leg { k, left_leads: k.left.abs() >= k.right.abs(), s, u_max, base };
        base = base.zip(distances, |base, distance| base + distance);
        match legs.last_mut() {
            Some(last) if last.goes_on_as(&next) => last.s += s,
            _ => legs.push(next),
        }
    }
    legs
}

impl Leg {
    fn goes_on_as(&self, next: &Self) -> bool {
        let off = self.k.zip(next.k, |k, next| (k - next).abs());
        let slower = (self.u_max - next.u_max).abs();
        off.left.max(off.right).max(slower) < 1e-9
    }
    /// The leading wheel's number of a pair, and the other's.
    fn apart(&self, both: Sides<f64>) -> (f64, f64) {
        if self.left_leads { (both.left, both.right) } else { (both.right, both.left) }
    }
    fn together(&self, leading: f64, following: f64) -> Sides<f64> {
        if self.left_leads { Sides::new(leading, following) } else { Sides::new(following, leading) }
    }
    /// How far the leading wheel is on its way when the wheels have covered `real` since the task began, m.
    pub(super) fn covered(&self, real: Sides<f64>) -> f64 {
        let (real, base) = (self.apart(real).0, self.apart(self.base).0);
        (real - base) * self.apart(self.k).0.signum()
    }
    /// What the wheels should have covered when the leading one is where it is, m.
    pub(super) fn due(&self, real: Sides<f64>) -> Sides<f64> {
        let leading = self.apart(real).0;
        let following = self.apart(self.base).1 + self.apart(self.k).1 * self.covered(real);
        self.together(leading, following)
    }
    /// What the following wheel lacks, m.
    pub(super) fn error(&self, real: Sides<f64>) -> f64 {
        self.apart(self.due(real)).1 - self.apart(real).1
    }
    /// The speeds of both wheels for a leading wheel at `u` and a correction of the following one, m/s.
    pub(super) fn speeds(&self, u: f64, correction: f64) -> Sides<f64> {
        let (leading, following) = self.apart(self.k);
        self.together(leading.signum() * u, following * u + correction)
    }
    /// The distances when the following wheel is where a turn says: `turned` is the turn times the track, m.
    pub(super) fn with_turn(&self, real: Sides<f64>, turned: f64) -> Sides<f64> {
        let leading = self.apart(real).0;
        self.together(leading, if self.left_leads { leading + turned } else { leading - turned })
    }
}
