//! The G-corrector: each leg is a distance of its leading wheel, driven at a constant ratio of the wheel speeds
//! (paper, III.B).
//!
//! Hears a [`Task<Plan>`] and [`EncodersData`], says one [`Dwm`](axle_schema::Dwm) at every beat. A line, a turn on the
//! spot and an arc have a ratio that does not change (1, -1, another); the faster wheel leads, since the other may have
//! to stand (model.md, erratum 12). The leading wheel runs as fast as the limits allow and slows down before its
//! distance is covered; the other wheel follows at the ratio, and a PID holds the ratio.
//!
//! *Feedback.* With `encoders` the ratio is that of the distances of both wheels. With `gyro`, the variant that the
//! paper announces, it is that of the leading wheel and the measured turn: what the other wheel slips does not count.
//! The gyroscope is first listened to at rest for `still`, to learn its bias.
//!
//! *Legs* are counted from where the last one should have ended, so that errors do not add up; the robot rests between
//! two legs of different ratios. Distances are predicted to the time at which a command will be obeyed.
//!
//! *Failure.* The task fails with a reason when measurements stop, jump or go back, when the robot is blocked, when the
//! wheels are `lost`, and when the goal comes no closer.

use crate::finish::{Finish, Progress, Since, Zone};
use crate::follow::{Rules, check_period};
use crate::friction::Friction;
use crate::grain::Grain;
use crate::manners::{Manners, Nearness};
use crate::newest::{Newest, Watch};
use crate::route;
use crate::stall::Stall;
use crate::wheels::Wheels;
use axle_schema::contract::{Account, Bounds, Corrector, Params, Seen, Step};
use axle_schema::refusal::within;
use axle_schema::series::Datum as _;
use axle_schema::{
    Drivetrain, EncodersData, Message as _, Metres, MetresPerSecond, Plan, Refusal, Seconds, Sides, Task,
};
use serde::{Deserialize, Serialize};

mod leg;
mod turned;
use leg::Leg;
use turned::Turned;

/// When patience is over, the goal counts as reached within this many tolerances, and as missed beyond.
const NEAR: f64 = 5.0;

/// What the ratio of the wheel speeds is measured by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Feedback {
    /// The distances of both wheels.
    #[default]
    Encoders,
    /// The distance of the leading wheel, and the turn by the gyroscope.
    Gyro,
}

/// The PID of the ratio: the table `[ratio]`. Its errors count as speeds of the wheel that follows, so that nothing is
/// divided by a wheel that stands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ratio {
    /// Of the error of the speed, 0 to 2.
    pub proportional: f64,
    /// Of its sum, which is the error of the distance, 0.01 to 20 1/s.
    pub integral: f64,
    /// Of its change, 0 to 1 s.
    pub derivative: f64,
}

impl Default for Ratio {
    fn default() -> Self {
        Self { proportional: 0.104, integral: 7.278, derivative: 0.0 }
    }
}

/// Parameters of the G-corrector: `deploy/params/g-corrector.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GParams {
    /// Time from beat to beat, 0.01 to 0.5 s.
    pub period: Seconds,
    /// How long after a measurement the wheels begin to obey the command that it led to, 0 to 1 s.
    pub lead: Seconds,
    /// Share of the robot's limits that is used, 0.05 to 1.
    pub effort: f64,
    /// What the ratio is measured by.
    pub feedback: Feedback,
    /// How long the robot rests first to learn the bias of its gyroscope, 0 to 10 s.
    pub still: Seconds,
    /// A wheel that is this far from where the other one says does not follow, 0.01 to 10 m.
    pub lost: Metres,
    /// The PID of the ratio.
    pub ratio: Ratio,
    /// How a task ends; the tolerance is that of a wheel.
    pub finish: Finish,
    /// What is believed of the measurements.
    pub watch: Watch,
    /// The robot: its limits hold for every command.
    pub robot: Drivetrain,
}

impl Default for GParams {
    /// What the tournament's search found best; the parameter file says by how much.
    fn default() -> Self {
        Self {
            period: Seconds(0.05),
            lead: Seconds(0.062),
            effort: 0.8,
            feedback: Feedback::default(),
            still: Seconds(0.5),
            lost: Metres(0.3),
            ratio: Ratio::default(),
            finish: Finish { tolerance: Metres(0.002), ..Finish::default() },
            watch: Watch::default(),
            robot: Drivetrain::default(),
        }
    }
}

impl GParams {
    const fn rules(&self, period: Seconds) -> Rules {
        let Self { lead, effort, finish, watch, robot, .. } = *self;
        Rules { period, lead, effort, finish, watch, robot }
    }
}

impl Bounds for GParams {
    fn check(&self) -> Result<(), Refusal> {
        self.rules(self.period).check()?;
        within("still in s", self.still.0, 0.0, 10.0)?;
        within("lost in m", self.lost.0, 0.01, 10.0)?;
        within("ratio.proportional", self.ratio.proportional, 0.0, 2.0)?;
        within("ratio.integral in 1/s", self.ratio.integral, 0.01, 20.0)?;
        within("ratio.derivative in s", self.ratio.derivative, 0.0, 1.0)
    }
}

impl Params for GParams {
    const FILE: &'static str = include_str!("../../../deploy/params/g-corrector.toml");
}

/// The G-corrector at work on one plan.
#[derive(Clone, Debug)]
pub struct GCorrector {
    params: GParams,
    rules: Rules,
    legs: Vec<Leg>,
    leg: usize,
    begin: EncodersData,
    newest: Newest<EncodersData>,
    turned: Option<Turned>,
    wheels: Wheels,
    stall: Stall,
    grain: Grain,
    /// The error of the following wheel, m, and of its speed, m/s, at the newest measurement.
    error: f64,
    rate: f64,
    change: f64,
    counted: Seconds,
    calm: Since,
    manners: Manners,
    progress: Progress,
}

impl Corrector for GCorrector {
    type Params = GParams;
    type Plan = Plan;

    fn period(params: &GParams) -> Seconds {
        params.period
    }

    fn begin(params: &GParams, period: Seconds, task: Task<Plan>, seen: &Seen) -> Result<Self, Refusal> {
        params.check()?;
        check_period(period)?;
        task.plan.check()?;
        let GParams { watch, robot, effort, .. } = *params;
        let legs = leg::legs(&task.plan, &robot, effort);
        let newest = Newest::new(seen.encoders, seen.at, watch, robot)?;
        // Wheels know no place; where a pose is known, it must be that of the plan.
        if let Some(data) = seen.pose.filter(|_| !legs.is_empty()) {
            route::check_start(task.plan.start, data.pose)?;
        }
        let turned = match params.feedback {
            Feedback::Encoders => None,
            Feedback::Gyro => Some(Turned::new(seen, watch, robot, params.still)?),
        };
        Ok(Self {
            params: params.clone(),
            rules: params.rules(period),
            legs,
            leg: 0,
            begin: *newest.value(),
            newest,
            turned,
            wheels: Wheels::new(robot, period, Friction::new(params.finish.push.0)),
            stall: Stall::default(),
            grain: Grain::default(),
            error: 0.0,
            rate: 0.0,
            change: 0.0,
            counted: seen.at,
            calm: Since::default(),
            manners: Manners::default(),
            progress: Progress::new(),
        })
    }

    fn step(&mut self, seen: &Seen) -> Step {
        // An empty plan has no goal to settle at.
        if self.legs.is_empty() {
            return Step::Done;
        }
        self.decide(seen).unwrap_or_else(Step::Fail)
    }

    fn resume(&mut self, seen: &Seen, _: Seconds) {
        // What is wrong with the measurement fails the step that follows.
        if let Some(turned) = &mut self.turned {
            drop(turned.hear(seen));
        }
        drop(self.newest.hear(seen.encoders, seen.at));
        self.wheels.rest();
        self.stall = Stall::default();
        self.counted = seen.at;
    }

    fn account(&self) -> Account {
        let real = self.real();
        let whole: f64 = self.legs.iter().map(|leg| leg.s).sum();
        let behind = self.legs.iter().take(self.leg).map(|leg| leg.s).sum::<f64>()
            + self.legs.get(self.leg).map_or(0.0, |leg| leg.covered(real));
        let due = self.legs.get(self.leg).map(|leg| leg.due(real));
        Account {
            stamp: self.newest.value().stamp,
            elapsed: self.newest.elapsed(),
            fraction: if whole > 0.0 { (behind / whole).clamp(0.0, 1.0) } else { 1.0 },
            due: due.map(|due| due.map(Metres)),
            real: Some(real.map(Metres)),
        }
    }
}

impl GCorrector {
    fn decide(&mut self, seen: &Seen) -> Result<Step, Refusal> {
        self.hear(seen)?;
        if self.turned.as_mut().is_some_and(|turned| !turned.is_ready(self.newest.elapsed())) {
            return self.command(Sides::new(0.0, 0.0), seen.at);
        }
        let (now, age) = (seen.at, self.newest.age(seen.at));
        let later = self.wheels.covered(now - age - self.rules.lead, now);
        let mut at = self.real().zip(later, |real, later| real + later);
        let mut speeds = self.speeds(at);
        if speeds.left.abs() + speeds.right.abs() <= 0.0
            && self.wheels.stand()
            && self.leg + 1 < self.legs.len()
        {
            self.leg += 1;
            (self.error, self.rate, self.change) = (0.0, 0.0, 0.0);
            at = self.real().zip(later, |real, later| real + later);
            speeds = self.speeds(at);
        }
        let speeds = self.manners.allow(speeds, self.nearness(at), now);
        let rests = speeds.left.abs() + speeds.right.abs() <= 0.0;
        self.end(rests, at).unwrap_or_else(|| self.command(speeds, now))
    }

    /// Takes the newest measurements.
    fn hear(&mut self, seen: &Seen) -> Result<(), Refusal> {
        if let Some(turned) = &mut self.turned {
            turned.hear(seen)?;
        }
        let Some(before) = self.newest.hear(seen.encoders, seen.at)? else { return Ok(()) };
        let stamp = self.newest.value().stamp;
        let span = before.span_to(self.newest.value());
        let (from, to) = (self.counted - self.rules.lead, seen.at - self.rules.lead);
        self.counted = seen.at;
        let asked = self.wheels.covered(from, to);
        let asked = self.wheels.learn(asked, span.sides().map(|way| way.0), to - from).map(Metres);
        self.grain.take(&before, self.newest.value());
        self.stall.count(asked, span.sides(), to - from, stamp, self.params.watch.blocked)?;
        let real = self.real();
        let error = self.legs.get(self.leg).map_or(0.0, |leg| leg.error(real));
        // An error that is not a number is no better than a large one.
        if !(0.0..=self.params.lost.0).contains(&error.abs()) {
            let why = format!(
                "the wheels do not keep their ratio: one is {error:.3} m from where the other says; \
                 is the drive enabled, and do both turn freely?"
            );
            return Err(Refusal::Failed { why });
        }
        let rate = (error - self.error) / span.duration.0.max(1e-3);
        self.change = (rate - self.rate) / span.duration.0.max(1e-3);
        (self.error, self.rate) = (error, rate);
        Ok(())
    }

    /// What the wheels have covered since the task began, m; the following wheel by the feedback.
    fn real(&self) -> Sides<f64> {
        let newest = self.newest.value();
        let real = self.begin.span_to(newest).sides().map(|distance| distance.0);
        match (&self.turned, self.legs.get(self.leg)) {
            (Some(turned), Some(leg)) => {
                leg.with_turn(real, turned.angle(newest.stamp) * self.params.robot.track.get())
            }
            _ => real,
        }
    }

    /// How a task ends, with tolerances that the encoders can resolve.
    fn finish(&self) -> Finish {
        self.params.finish.resolved(self.grain.blur(), self.params.robot.track)
    }

    /// How far the worse wheel is from its end of the leg, if it has come to `at`, m.
    fn worst(&self, at: Sides<f64>) -> f64 {
        self.legs.get(self.leg).map_or(0.0, |leg| (leg.s - leg.covered(at)).abs().max(leg.error(at).abs()))
    }

    /// How near the end of the plan is from there.
    fn nearness(&self, at: Sides<f64>) -> Nearness {
        let (finish, worst) = (self.finish(), self.worst(at));
        let is_last = self.leg + 1 == self.legs.len();
        match worst {
            worst if is_last && worst <= finish.tolerance.0 * NEAR => Nearness::Enough,
            worst if is_last && worst <= finish.radius.0 => Nearness::Near,
            _ => Nearness::Far,
        }
    }

    /// The wheel speeds of the next command, for distances `at` which it will be obeyed, m/s.
    fn speeds(&self, at: Sides<f64>) -> Sides<f64> {
        let Some(leg) = self.legs.get(self.leg) else { return Sides::new(0.0, 0.0) };
        let (finish, ratio) = (self.finish(), &self.params.ratio);
        let tolerance = finish.tolerance.0;
        let zone = Zone { tolerance, slowest: self.rules.creep(tolerance), stands: self.wheels.stand() };
        let deceleration = self.rules.deceleration();
        let u = finish.speed(leg.s - leg.covered(at), zone, deceleration).clamp(-leg.u_max, leg.u_max);
        let error = leg.error(at);
        let follow = if u.abs() > 0.0 {
            // The PID of the ratio, times the speed of the leading wheel.
            ratio.proportional * self.rate + ratio.integral * error + ratio.derivative * self.change
        } else {
            finish.speed(error, zone, deceleration)
        };
        leg.speeds(u, follow.clamp(-leg.u_max, leg.u_max))
    }

    /// The end of the task, if it is there.
    fn end(&mut self, rests: bool, at: Sides<f64>) -> Option<Result<Step, Refusal>> {
        let (finish, real, stamp) = (self.finish(), self.real(), self.newest.value().stamp);
        let later: f64 = self.legs.iter().skip(self.leg + 1).map(|leg| leg.s).sum();
        let is_last = self.leg + 1 == self.legs.len();
        let arrived = rests && is_last && self.worst(real) <= finish.tolerance.0;
        let settled = self.calm.holds(arrived, stamp).is_some_and(|time| time >= finish.settle);
        let stuck = self.progress.wait(later + self.worst(at), stamp) > finish.patience;
        if !(settled || stuck) {
            return None;
        }
        if stuck && !(is_last && self.worst(real) <= finish.tolerance.0 * NEAR) {
            let (left, patience) = (self.worst(real), finish.patience);
            let why = format!(
                "the robot makes no progress: for {patience} its wheels have come no closer to the end of leg {} \
                 of {}, {left:.3} m away",
                self.leg + 1,
                self.legs.len()
            );
            return Some(Err(Refusal::Failed { why }));
        }
        if self.wheels.last().peak_speed() <= MetresPerSecond::ZERO {
            return Some(Ok(Step::Done));
        }
        None
    }

    fn command(&mut self, speeds: Sides<f64>, at: Seconds) -> Result<Step, Refusal> {
        self.wheels.command(speeds.map(MetresPerSecond), at).map(Step::Drive)
    }
}

#[cfg(test)]
mod tests;
