//! The arc-corrector: arcs to the ends of the legs, one after the other, as the warehouse robot drove.
//!
//! Hears a [`Task<Plan>`] and poses, says one [`Dwm`](axle_schema::Dwm) at every beat. The arc that leaves the robot in
//! the direction of its heading and ends at the target turns by twice the angle β between heading and target, so that
//! its curvature is 2 sin β / d, and it leads (d/2)·tan(β/2) away from the straight line (model.md, erratum 25; the
//! article takes β for the turn, and misses). Where that hump is too high, or the target lies more than a right angle
//! aside, the robot turns on the spot first, until the target is nearly ahead.
//!
//! *Sharpening.* The article raises the ratio of the wheel speeds to the ninth power, so that the robot turns to the
//! target early and then drives straight. Here the exponent is a parameter; the sign of the ratio is kept, since the
//! inner wheel must run backward on narrow arcs (errata 26 and 27).
//!
//! Arcs of the plan are divided into quarters, since the end of a circle says nothing of the circle. How parts of a
//! plan end, and when the task fails, is as for all that steer by the pose: see `follow.rs`.

use crate::finish::Finish;
use crate::follow::{Aim, Follower, Rules, Steering, Way};
use crate::newest::Watch;
use axle_schema::contract::{Account, Bounds, Corrector, Params, Seen, Step};
use axle_schema::refusal::within;
use axle_schema::{Drivetrain, Metres, Plan, Radians, Refusal, Seconds, Task};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// Parameters of the arc-corrector: `deploy/params/arc-corrector.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArcParams {
    /// Time from beat to beat, 0.01 to 0.5 s.
    pub period: Seconds,
    /// How long after a measurement the wheels begin to obey the command that it led to, 0 to 1 s.
    pub lead: Seconds,
    /// Share of the robot's limits that is used, 0.05 to 1.
    pub effort: f64,
    /// How far an arc may lead away from the straight line, 0.001 to 10 m.
    pub hump: Metres,
    /// The power to which the ratio of the wheel speeds is raised, 1 to 20.
    pub sharpening: f64,
    /// A robot that turns on the spot turns until the target is this close to straight ahead, 0.01 to 1.5 rad.
    pub aligned: Radians,
    /// A target that is not the last one of a path counts as reached within this distance, 0.001 to 1 m.
    pub arrival: Metres,
    /// How a task ends.
    pub finish: Finish,
    /// What is believed of the measurements.
    pub watch: Watch,
    /// The robot: its limits hold for every command.
    pub robot: Drivetrain,
}

impl Default for ArcParams {
    /// What the tournament's search found best; the parameter file says by how much.
    fn default() -> Self {
        Self {
            period: Seconds(0.05),
            lead: Seconds(0.093),
            effort: 0.8,
            hump: Metres(0.338),
            sharpening: 3.614,
            aligned: Radians(0.05),
            arrival: Metres(0.03),
            finish: Finish::default(),
            watch: Watch::default(),
            robot: Drivetrain::default(),
        }
    }
}

impl ArcParams {
    const fn rules(&self, period: Seconds) -> Rules {
        let Self { lead, effort, finish, watch, robot, .. } = *self;
        Rules { period, lead, effort, finish, watch, robot }
    }
}

impl Bounds for ArcParams {
    fn check(&self) -> Result<(), Refusal> {
        self.rules(self.period).check()?;
        within("hump in m", self.hump.0, 1e-3, 10.0)?;
        within("sharpening", self.sharpening, 1.0, 20.0)?;
        within("aligned in rad", self.aligned.0, 0.01, 1.5)?;
        within("arrival in m", self.arrival.0, 1e-3, 1.0)
    }
}

impl Params for ArcParams {
    const FILE: &'static str = include_str!("../../../deploy/params/arc-corrector.toml");
}

/// The arc-corrector at work on one plan.
#[derive(Clone, Debug)]
pub struct ArcCorrector(Follower<ArcToTarget>);

impl Corrector for ArcCorrector {
    type Params = ArcParams;
    type Plan = Plan;

    fn period(params: &ArcParams) -> Seconds {
        params.period
    }
    fn begin(params: &ArcParams, period: Seconds, task: Task<Plan>, seen: &Seen) -> Result<Self, Refusal> {
        params.check()?;
        let steering = ArcToTarget { params: params.clone(), rotates: false };
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
struct ArcToTarget {
    params: ArcParams,
    /// Whether the robot turns on the spot.
    rotates: bool,
}

impl Steering for ArcToTarget {
    fn steer(&mut self, way: &Way<'_>) -> Aim {
        let ArcParams { hump, sharpening, aligned, finish, robot, .. } = &self.params;
        let target = way.path.ends(way.place).1.seen_from(way.pose);
        let distance = target.x.0.hypot(target.y.0);
        let beta = target.y.0.atan2(target.x.0);
        // So near the target its direction is noise.
        let is_near = distance < finish.radius.0 / 2.0;
        let rise = distance / 2.0 * (beta / 2.0).tan().abs();
        let is_aside = beta.abs() > FRAC_PI_2 || rise > hump.0;
        self.rotates = !is_near && (is_aside || (self.rotates && beta.abs() > aligned.0));
        if self.rotates {
            return Aim { v: 0.0, omega: way.rules.turning(beta, aligned.0 / 2.0, false), off: beta };
        }
        if is_near {
            return Aim { v: way.speed, omega: 0.0, off: 0.0 };
        }
        let (share, kappa) = sharpened(2.0 * beta.sin() / distance, robot.track.get(), *sharpening);
        let v = way.speed * share;
        Aim { v, omega: v * kappa, off: beta }
    }
    fn early(&self) -> f64 {
        self.params.arrival.0
    }
    fn longest_turn(&self) -> f64 {
        FRAC_PI_2
    }
    fn needs_turns(&self) -> bool {
        false
    }
}

/// The curvature whose ratio of the inner to the outer wheel is that of `kappa`, raised to the power `n`; and the share
/// of the speed that is left when the outer wheel keeps its own.
///
/// With h = κΔ/2 the wheels run at 1 - h and 1 + h, so that the ratio is ρ = (1 - |h|) / (1 + |h|).
fn sharpened(kappa: f64, track: f64, n: f64) -> (f64, f64) {
    let h = (kappa * track / 2.0).abs();
    let ratio = (1.0 - h) / (1.0 + h);
    let raised = ratio.abs().powf(n).copysign(ratio);
    // The inner wheel never runs quite as fast backward as the outer one forward, or the robot would stand.
    let more = (1.0 - raised) / (1.0 + raised).max(0.1);
    ((1.0 + h) / (1.0 + more), (2.0 * more / track).copysign(kappa))
}

#[cfg(test)]
mod tests;
