//! The pursuit-corrector: regulated pure pursuit, what people use today for following a path.
//!
//! Hears a [`Task<Plan>`] and poses, says one [`Dwm`](axle_schema::Dwm) at every beat. The robot drives the arc to a
//! point of its path that is a lookahead away: κ = 2y/(x² + y²) for the point (x, y) in the frame of the robot
//! (Coulter 1992). The lookahead grows with the speed, and the speed is regulated: slower on narrow arcs, and near the
//! end (Macenski et al., "Regulated Pure Pursuit for Robot Path Tracking", 2023, as in Nav2). It is a yardstick: the
//! paper's correctors are measured against it.
//!
//! How parts of a plan end, and when the task fails, is as for all that steer by the pose: see `follow.rs`.

use crate::finish::Finish;
use crate::follow::{Aim, Follower, Rules, Steering, Way};
use crate::newest::Watch;
use axle_schema::contract::{Account, Bounds, Corrector, Params, Seen, Step};
use axle_schema::refusal::within;
use axle_schema::{Drivetrain, Metres, Plan, Radians, Refusal, Seconds, Task};
use serde::{Deserialize, Serialize};

/// Parameters of the pursuit-corrector: `deploy/params/pursuit-corrector.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PursuitParams {
    /// Time from beat to beat, 0.01 to 0.5 s.
    pub period: Seconds,
    /// How long after a measurement the wheels begin to obey the command that it led to, 0 to 1 s.
    pub lead: Seconds,
    /// Share of the robot's limits that is used, 0.05 to 1.
    pub effort: f64,
    /// How far ahead the pursued point is, in time at the speed of the robot, 0 to 5 s.
    pub lookahead: Seconds,
    /// It is at least this far ahead, 0.02 to 10 m.
    pub nearest: Metres,
    /// And at most this far, 0.02 to 10 m.
    pub farthest: Metres,
    /// On arcs narrower than this the robot slows down in proportion, 0 to 10 m.
    pub radius: Metres,
    /// A point that is farther than this to the side is turned to on the spot first, 0.1 to 3.1 rad.
    pub rotate: Radians,
    /// How a task ends.
    pub finish: Finish,
    /// What is believed of the measurements.
    pub watch: Watch,
    /// The robot: its limits hold for every command.
    pub robot: Drivetrain,
}

impl Default for PursuitParams {
    /// What the tournament's search found best; the parameter file says by how much.
    fn default() -> Self {
        Self {
            period: Seconds(0.05),
            lead: Seconds(0.06),
            effort: 0.8,
            lookahead: Seconds(0.348),
            nearest: Metres(0.137),
            farthest: Metres(0.6),
            radius: Metres(0.3),
            rotate: Radians(0.8),
            finish: Finish::default(),
            watch: Watch::default(),
            robot: Drivetrain::default(),
        }
    }
}

impl PursuitParams {
    const fn rules(&self, period: Seconds) -> Rules {
        let Self { lead, effort, finish, watch, robot, .. } = *self;
        Rules { period, lead, effort, finish, watch, robot }
    }
}

impl Bounds for PursuitParams {
    fn check(&self) -> Result<(), Refusal> {
        self.rules(self.period).check()?;
        within("lookahead in s", self.lookahead.0, 0.0, 5.0)?;
        within("nearest in m", self.nearest.0, 0.02, 10.0)?;
        within("farthest in m", self.farthest.0, self.nearest.0, 10.0)?;
        within("radius in m", self.radius.0, 0.0, 10.0)?;
        within("rotate in rad", self.rotate.0, 0.1, 3.1)
    }
}

impl Params for PursuitParams {
    const FILE: &'static str = include_str!("../../../deploy/params/pursuit-corrector.toml");
}

/// The pursuit-corrector at work on one plan.
#[derive(Clone, Debug)]
pub struct PursuitCorrector(Follower<Pursuit>);

impl Corrector for PursuitCorrector {
    type Params = PursuitParams;
    type Plan = Plan;

    fn period(params: &PursuitParams) -> Seconds {
        params.period
    }
    fn begin(
        params: &PursuitParams,
        period: Seconds,
        task: Task<Plan>,
        seen: &Seen,
    ) -> Result<Self, Refusal> {
        params.check()?;
        let steering = Pursuit { params: params.clone(), rotates: false };
        Follower::new(steering, params.rules(period), &task.plan, seen).map(Self)
    }
    fn step(&mut self, seen: &Seen) -> Step {
        self.0.step(seen)
    }
    fn resume(&mut self, seen: &Seen, _: Seconds) {
        self.0.resume(seen);
    }
    fn account(&self) -> Account {
        self.0.account()
    }
}

/// The rule.
#[derive(Clone, Debug)]
struct Pursuit {
    params: PursuitParams,
    /// Whether the robot turns on the spot.
    rotates: bool,
}

impl Steering for Pursuit {
    fn steer(&mut self, way: &Way<'_>) -> Aim {
        let PursuitParams { lookahead, nearest, farthest, radius, rotate, .. } = self.params;
        let distance = (way.twist.v * lookahead).0.clamp(nearest.0, farthest.0);
        let point = way.path.ahead(way.place, distance).0.seen_from(way.pose);
        let (x, y) = (point.x.0, point.y.0);
        let off = y.atan2(x);
        // Once it turns on the spot, it turns until the point is ahead.
        self.rotates = off.abs() > if self.rotates { rotate.0 / 4.0 } else { rotate.0 };
        if self.rotates {
            return Aim { v: 0.0, omega: way.rules.turning(off, 1e-3, false), off };
        }
        let kappa = 2.0 * y / (x * x + y * y).max(1e-6);
        let regulated = (1.0 / (kappa.abs() * radius.0)).min(1.0);
        let v = way.speed * regulated;
        Aim { v, omega: v * kappa, off }
    }
}

#[cfg(test)]
mod tests;
