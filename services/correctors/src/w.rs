//! The W-corrector: drives along a vector field (paper, III.C), in the two parts that the paper announces: a `field`
//! that says with which velocity to be where, and a `driver` that makes the robot obey it.
//!
//! Hears a [`Task<Plan>`] and poses, says one [`Dwm`](axle_schema::Dwm) at every beat. In the paper it takes the way
//! points. Here it takes the plan, and the ends of its legs are the way points: so one corrector serves points, lines,
//! arcs and every sequence of them, and it is compared with the others on the very same task. With the field of points the
//! turns of the plan are not driven before a longer leg: the field turns the robot, as in the paper. The formulas of the paper are repaired as
//! model.md says (erratum 13, 4.6): its field points away from the goal and is 0 at the start, and its driver cannot
//! leave rest.
//!
//! How parts of a plan end, and when the task fails, is as for all that steer by the pose: see `follow.rs`.

use crate::finish::Finish;
use crate::follow::{Aim, Follower, Rules, Steering, Way};
use crate::newest::Watch;
use axle_schema::contract::{Account, Bounds, Corrector, Params, Seen, Step};
use axle_schema::refusal::within;
use axle_schema::{
    Drivetrain, Metres, MetresPerSecond, PerMetre, Plan, Radians, RadiansPerSecond, Refusal, Seconds, Task,
};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

mod arrows;
mod driver;
mod field;

pub use arrows::{Arrow, MAX_ARROWS, arrows};
pub use driver::Driver;
use driver::Multiplicative;
pub use field::Field;

/// Parameters of the W-corrector: `deploy/params/w-corrector.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WParams {
    /// Time from beat to beat, 0.01 to 0.5 s.
    pub period: Seconds,
    /// How long after a measurement the wheels begin to obey the command that it led to, 0 to 1 s.
    pub lead: Seconds,
    /// Share of the robot's limits that is used, 0.05 to 1.
    pub effort: f64,
    /// What the vector field leads to.
    pub field: Field,
    /// How the field is driven.
    pub driver: Driver,
    /// A point that is not the last one of a path counts as reached within this distance, 0.001 to 1 m.
    pub arrival: Metres,
    /// What the field is at least at the start of a leg, 0.001 to 1 m/s.
    pub floor: MetresPerSecond,
    /// How strongly the field of a path leads back to it, 0.1 to 50 1/m.
    pub pull: PerMetre,
    /// Turn rate of the smooth driver for every radian between heading and field, 0.1 to 20 1/s.
    pub turning: f64,
    /// The factor of the speed in 50 ms, of the multiplicative driver, 1.01 to 3.
    pub factor: f64,
    /// The step of the turn rate in 50 ms, of the multiplicative driver, 0.001 to 5 rad/s.
    pub step: RadiansPerSecond,
    /// How far the multiplicative driver looks ahead at its heading, 0 to 3 s.
    pub foresight: Seconds,
    /// Within this angle of the field the multiplicative driver keeps its turn rate, 0 to 0.5 rad.
    pub zone: Radians,
    /// How a task ends.
    pub finish: Finish,
    /// What is believed of the measurements.
    pub watch: Watch,
    /// The robot: its limits hold for every command.
    pub robot: Drivetrain,
}

impl Default for WParams {
    /// What the tournament's search found best; the parameter file says by how much.
    fn default() -> Self {
        Self {
            period: Seconds(0.05),
            lead: Seconds(0.102),
            effort: 0.8,
            field: Field::default(),
            driver: Driver::default(),
            arrival: Metres(0.03),
            floor: MetresPerSecond(0.1),
            pull: PerMetre(6.982),
            turning: 5.714,
            factor: 1.3,
            step: RadiansPerSecond(0.3),
            foresight: Seconds(0.35),
            zone: Radians(0.01),
            finish: Finish::default(),
            watch: Watch::default(),
            robot: Drivetrain::default(),
        }
    }
}

impl WParams {
    const fn rules(&self, period: Seconds) -> Rules {
        let Self { lead, effort, finish, watch, robot, .. } = *self;
        Rules { period, lead, effort, finish, watch, robot }
    }
}

impl Bounds for WParams {
    fn check(&self) -> Result<(), Refusal> {
        self.rules(self.period).check()?;
        within("arrival in m", self.arrival.0, 1e-3, 1.0)?;
        within("floor in m/s", self.floor.0, 1e-3, 1.0)?;
        within("pull in 1/m", self.pull.0, 0.1, 50.0)?;
        within("turning in 1/s", self.turning, 0.1, 20.0)?;
        within("factor", self.factor, 1.01, 3.0)?;
        within("step in rad/s", self.step.0, 1e-3, 5.0)?;
        within("foresight in s", self.foresight.0, 0.0, 3.0)?;
        within("zone in rad", self.zone.0, 0.0, 0.5)
    }
}

impl Params for WParams {
    const FILE: &'static str = include_str!("../../../deploy/params/w-corrector.toml");
}

/// The W-corrector at work on one plan.
#[derive(Clone, Debug)]
pub struct WCorrector(Follower<FieldDriver>);

impl Corrector for WCorrector {
    type Params = WParams;
    type Plan = Plan;

    fn period(params: &WParams) -> Seconds {
        params.period
    }
    fn begin(params: &WParams, period: Seconds, task: Task<Plan>, seen: &Seen) -> Result<Self, Refusal> {
        params.check()?;
        let steering = FieldDriver { params: params.clone() };
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

/// A field, and a driver that obeys it.
#[derive(Clone, Debug)]
struct FieldDriver {
    params: WParams,
}

impl Steering for FieldDriver {
    fn steer(&mut self, way: &Way<'_>) -> Aim {
        let flow = match self.params.field {
            Field::Points => field::points::flow(&self.params, way),
            Field::Path => field::path::flow(&self.params, way),
        };
        match self.params.driver {
            Driver::Smooth => driver::smooth::drive(self.params.turning, flow, way),
            Driver::Multiplicative => Multiplicative::of(&self.params, way.rules.period).drive(flow, way),
        }
    }
    fn early(&self) -> f64 {
        match self.params.field {
            Field::Points => self.params.arrival.0,
            Field::Path => 0.0,
        }
    }
    fn longest_turn(&self) -> f64 {
        match self.params.field {
            // The end of a circle says nothing of the circle.
            Field::Points => FRAC_PI_2,
            Field::Path => f64::INFINITY,
        }
    }
    fn needs_turns(&self) -> bool {
        // A path would be left on the outside of its corners; points are turned to by the field.
        self.params.field == Field::Path
    }
}

#[cfg(test)]
mod tests;
