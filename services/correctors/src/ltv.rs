//! The LTV-corrector: a linear time-varying regulator of the unicycle, a yardstick from outside.
//!
//! Hears a [`Task<Drive>`] and poses, says one [`Dwm`](axle_schema::Dwm) at every beat. The plan says where the robot
//! should be at every time; the error of the pose, in the frame of the robot, is fed back with the gains of a linear
//! quadratic regulator for the speed of the moment, as WPILib's LTV unicycle controller does. The gains follow from the
//! tolerable errors and corrections (Bryson's rule).
//!
//! *Time.* As with the D-corrector, the plan begins when the first command is obeyed, by the robot's clock; the pose is
//! predicted to the time at which the command of a beat will be obeyed, and compared with the pose due then. The frame
//! of the plan is where the robot is seen when the task begins.
//!
//! *The end.* After the last movement what is left along the way and of the heading is corrected; a robot that stands
//! cannot move to the side. *Failure.* Poses that stop, jump or go back, a blocked robot, one that is `lost`, and a goal
//! that is missed end the task with a reason.

use crate::body::Body;
use crate::due::Due;
use crate::finish::{Finish, Since, Zone};
use crate::follow::{Rules, check_period};
use crate::manners::{LATE, Manners, Nearness};
use crate::newest::Watch;
use axle_schema::contract::{Account, Bounds, Corrector, Params, Seen, Step};
use axle_schema::refusal::within;
use axle_schema::{
    Drive, Drivetrain, Message as _, Metres, MetresPerSecond, Pose, Radians, RadiansPerSecond, Refusal,
    Seconds, Sides, Task, Twist,
};
use serde::{Deserialize, Serialize};

mod gains;
use gains::Gains;

/// When patience is over, a heading within this many tolerances counts as reached.
const NEAR: f64 = 5.0;

/// Parameters of the LTV-corrector: `deploy/params/ltv-corrector.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LtvParams {
    /// Time from beat to beat, 0.01 to 0.5 s.
    pub period: Seconds,
    /// How long after a measurement the wheels begin to obey the command that it led to, 0 to 1 s.
    pub lead: Seconds,
    /// Largest tolerable error along the way, 0.001 to 10 m.
    pub along: Metres,
    /// The same to the side, 0.001 to 10 m.
    pub aside: Metres,
    /// The same of the heading, 0.001 to 10 rad.
    pub heading: Radians,
    /// Largest tolerable correction of the speed, 0.001 to 10 m/s.
    pub speed: MetresPerSecond,
    /// The same of the turn rate, 0.001 to 10 rad/s.
    pub turn_rate: RadiansPerSecond,
    /// A robot that is this far from where it should be does not follow, 0.01 to 10 m.
    pub lost: Metres,
    /// How a task ends.
    pub finish: Finish,
    /// What is believed of the measurements.
    pub watch: Watch,
    /// The robot: its limits hold for every command.
    pub robot: Drivetrain,
}

impl Default for LtvParams {
    /// What the tournament's search found best; the parameter file says by how much.
    fn default() -> Self {
        Self {
            period: Seconds(0.05),
            lead: Seconds(0.094),
            along: Metres(0.075),
            aside: Metres(0.016),
            heading: Radians(0.404),
            speed: MetresPerSecond(0.2),
            turn_rate: RadiansPerSecond(1.0),
            lost: Metres(0.5),
            // Its errors grow until the wheels move.
            finish: Finish { push: MetresPerSecond(0.0), ..Finish::default() },
            watch: Watch::default(),
            robot: Drivetrain::default(),
        }
    }
}

impl LtvParams {
    const fn rules(&self, period: Seconds) -> Rules {
        let Self { lead, finish, watch, robot, .. } = *self;
        Rules { period, lead, effort: 1.0, finish, watch, robot }
    }
}

impl Bounds for LtvParams {
    fn check(&self) -> Result<(), Refusal> {
        self.rules(self.period).check()?;
        within("along in m", self.along.0, 1e-3, 10.0)?;
        within("aside in m", self.aside.0, 1e-3, 10.0)?;
        within("heading in rad", self.heading.0, 1e-3, 10.0)?;
        within("speed in m/s", self.speed.0, 1e-3, 10.0)?;
        within("turn_rate in rad/s", self.turn_rate.0, 1e-3, 10.0)?;
        within("lost in m", self.lost.0, 0.01, 10.0)
    }
}

impl Params for LtvParams {
    const FILE: &'static str = include_str!("../../../deploy/params/ltv-corrector.toml");
}

/// The LTV-corrector at work on one drive.
#[derive(Clone, Debug)]
pub struct LtvCorrector {
    params: LtvParams,
    rules: Rules,
    due: Due,
    gains: Gains,
    body: Body,
    /// The robot time at which the plan begins; known from the first beat on.
    zero: Option<Seconds>,
    calm: Since,
    manners: Manners,
    /// Whether a wheel is left alone after the last movement.
    rests: Sides<bool>,
}

impl Corrector for LtvCorrector {
    type Params = LtvParams;
    type Plan = Drive;

    fn period(params: &LtvParams) -> Seconds {
        params.period
    }

    fn begin(params: &LtvParams, period: Seconds, task: Task<Drive>, seen: &Seen) -> Result<Self, Refusal> {
        params.check()?;
        check_period(period)?;
        task.plan.check()?;
        let mut due = Due::new(task.plan, &params.robot)?;
        let body = Body::new(params.robot, (period, params.lead), params.watch, params.finish.push, seen)?;
        due.place(body.pose(), params.robot.track);
        let (gains, rules) = (Gains::new(params, period), params.rules(period));
        Ok(Self {
            params: params.clone(),
            rules,
            due,
            gains,
            body,
            zero: None,
            calm: Since::default(),
            manners: Manners::default(),
            rests: Sides::new(true, true),
        })
    }

    fn step(&mut self, seen: &Seen) -> Step {
        // An empty plan has no goal to settle at.
        if self.due.total() <= 0.0 {
            return Step::Done;
        }
        self.decide(seen).unwrap_or_else(Step::Fail)
    }

    fn resume(&mut self, seen: &Seen, pause: Seconds) {
        self.body.resume(seen);
        // The plan has waited for the wheels.
        self.zero = self.zero.map(|zero| zero + pause);
    }

    fn account(&self) -> Account {
        let planned = self.zero.map_or(0.0, |zero| (self.body.elapsed() - zero).0);
        let fraction = if self.due.total() > 0.0 { planned / self.due.total() } else { 1.0 };
        self.body.account(fraction, Some(self.due.distances(planned)))
    }
}

impl LtvCorrector {
    fn decide(&mut self, seen: &Seen) -> Result<Step, Refusal> {
        self.body.hear(seen)?;
        let obeyed = self.body.obeyed(seen.at);
        let zero = *self.zero.get_or_insert(obeyed);
        let now = (obeyed - zero).0;
        let pose = self.body.pose_at(seen.at);
        // The error of the model: where the robot should be, as it sees it.
        let error = self.due.pose(now, self.params.robot.track).seen_from(pose);
        let far = error.x.0.hypot(error.y.0);
        if !(0.0..=self.params.lost.0).contains(&far) {
            let how = "is the drive enabled, and is the way free?";
            let why = format!("the robot does not follow: it is {far:.3} m from where it should be; {how}");
            return Err(Refusal::Failed { why });
        }
        if now >= self.due.total() {
            return self.finish(error, now, seen.at);
        }
        let track = self.params.robot.track;
        let twist = Twist::of_wheels(self.due.speeds(now + self.rules.period.0), track);
        let here = Twist::of_wheels(self.due.speeds(now), track);
        let (v, omega) = self.gains.correction(here.v.0, error);
        let corrected =
            Twist { v: twist.v + MetresPerSecond(v), omega: twist.omega + RadiansPerSecond(omega) };
        let mut speeds = corrected.wheel_speeds(track).map(|speed| speed.0);
        if self.due.total() - now <= LATE {
            // What is too far shortly before the end is not taken back before it: that would be once more.
            let due = twist.wheel_speeds(track);
            speeds = due.zip(speeds, |due, speed| if due.0 * speed < 0.0 { 0.0 } else { speed });
        }
        self.manners.allow(speeds, Nearness::Far, seen.at);
        let Twist { v, omega } = Twist::of_wheels(speeds.map(MetresPerSecond), track);
        self.body.drive(v.0, omega.0, seen.at)
    }

    /// What happens after the last movement of the plan, `now` by its clock; `error` is how the goal is seen.
    fn finish(&mut self, error: Pose, now: f64, at: Seconds) -> Result<Step, Refusal> {
        let blur = self.body.blur();
        let finish = self.rules.finish.resolved(blur, self.params.robot.track);
        // What is left shows when the robot stands: corrected sooner, the wheels would run to and fro.
        if now < self.due.total() + (self.rules.lead + self.rules.period * 2.0).0 {
            return self.body.drive(0.0, 0.0, at);
        }
        // Each wheel has its own way to go, so that none runs to and fro for the sake of the other.
        let arm = self.params.robot.track.get() / 2.0;
        let turn = error.heading.0 * arm;
        let tolerance = finish.tolerance.0.min(finish.heading.0 * arm).max(blur);
        let zone = Zone { tolerance, slowest: self.rules.creep(tolerance), stands: false };
        let deceleration = self.rules.deceleration();
        let left = Sides::new(error.x.0 - turn, error.x.0 + turn);
        let near = left.left.abs().max(left.right.abs()) <= tolerance * NEAR;
        let speeds = left
            // What the plan has brought within the tolerance is not touched again.
            .zip(self.rests, |left, stands| finish.speed(left, Zone { stands, ..zone }, deceleration));
        let nearness = if near { Nearness::Enough } else { Nearness::Near };
        let speeds = self.manners.allow(speeds, nearness, at);
        self.rests = speeds.map(|speed| speed.abs() <= 0.0);
        let goal = self.due.pose(self.due.total(), self.params.robot.track);
        let real = goal.seen_from(self.body.pose());
        let here = real.x.abs() <= finish.tolerance && real.heading.abs() <= finish.heading;
        let calm = self.calm.holds(here && self.rests.left && self.rests.right, self.body.stamp());
        let settled = calm.is_some_and(|time| time >= finish.settle);
        let impatient = now - self.due.total() >= finish.patience.0;
        if !(settled || impatient) {
            let Twist { v, omega } = Twist::of_wheels(speeds.map(MetresPerSecond), self.params.robot.track);
            return self.body.drive(v.0, omega.0, at);
        }
        let far = goal.distance(self.body.pose());
        if far > finish.radius || real.heading.0.abs() > finish.heading.0 * NEAR {
            let turned = real.heading.abs();
            let why = format!(
                "the goal was missed by {far:.3} and {turned:.3}, allowed is finish.radius, {}",
                finish.radius
            );
            return Err(Refusal::Failed { why });
        }
        self.body.rest(at)
    }
}

#[cfg(test)]
mod tests;
