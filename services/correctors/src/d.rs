//! The D-corrector: keeps both wheels at the distances that a drive asks for (paper, III.A).
//!
//! Hears a [`Task<Drive>`] and [`EncodersData`], says one [`Dwm`] at every beat. The paper's rule rings: its formula
//! has a pole at -1 for every gain (model.md 4.5, erratum 11). The law `damped` is that of the model, with both poles
//! at the parameter `pole`, around the speeds of the plan. The law `paper` is the paper's own PID and recurrence,
//! repaired in their signs only, so that the ringing can be seen: it is for comparison, not for robots.
//!
//! *Time.* Due and real distances are compared at the robot's own clock: the state that was due at the stamp of a
//! measurement against the state that was measured then. So the age of a measurement is no error. Commands do arrive
//! later: the plan begins `lead` after the first beat, when the first command reaches the wheels, and every command is
//! made for the time at which it will be obeyed. Between measurements the plan goes on by `seen.at`.
//!
//! *The end.* After the last movement the rest of the error is corrected until both wheels are within `tolerance` for
//! `settle`, or `patience` is over. A dead zone of half the tolerance keeps the wheels from hunting to and fro, which
//! destroyed the amplifiers of the authors (paper, III.D). The last command before `Done` is rest.
//!
//! *Failure.* The task fails with a reason when a wheel is `lost`, when no new measurement comes for `silence`, when
//! the robot's clock goes back, and when the goal is missed grossly. Silence then makes the gate brake.

use crate::due::Due;
use crate::grain::Grain;
use crate::manners::{LATE, Manners, Nearness};
use crate::newest::{Newest, Watch};
use axle_schema::contract::{Account, Bounds, Corrector, Params, Seen, Step};
use axle_schema::refusal::within;
use axle_schema::series::Datum as _;
use axle_schema::{
    Drive, Drivetrain, Dwm, EncodersData, Message as _, Metres, MetresPerSecond, Refusal, Seconds, Sides,
    Task,
};
use serde::{Deserialize, Serialize};

/// When patience is over, the goal counts as reached within this many tolerances, and as missed beyond.
const NEAR: f64 = 5.0;

/// The beat from which on the pole is that of one beat: delays do not become shorter with the beats. s.
const POLE_BEAT: f64 = 0.05;

/// The law by which errors become speeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// A double pole around the speeds of the plan (model.md 4.5).
    #[default]
    Damped,
    /// The paper's PID and recurrence (III.A), with the signs of model.md, erratum 11.
    Paper,
}

/// The gains of the paper's law: the table `[gains]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gains {
    /// gP, of the error, 0.01 to 2.
    pub proportional: f64,
    /// gI, of its sum over time, 0 to 20 1/s.
    pub integral: f64,
    /// gD, of its change, 0 to 1 s.
    pub derivative: f64,
}

impl Default for Gains {
    fn default() -> Self {
        Self { proportional: 0.3, integral: 0.0, derivative: 0.0 }
    }
}

/// Parameters of the D-corrector: `deploy/params/d-corrector.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DParams {
    /// Time from beat to beat, 0.01 to 0.5 s.
    pub period: Seconds,
    /// The law by which errors become speeds.
    pub law: Law,
    /// The double pole of the damped law, 0 to 0.95: the share of an error that is left after a beat (model.md 4.5), or
    /// after 50 ms where beats are shorter.
    pub pole: f64,
    /// The gains of the paper's law.
    pub gains: Gains,
    /// How long after a measurement the wheels begin to obey the command that it led to, 0 to 1 s.
    pub lead: Seconds,
    /// How close to their distances both wheels must come, 0.0001 to 0.1 m.
    pub tolerance: Metres,
    /// For how long they must stay that close, 0 to 5 s.
    pub settle: Seconds,
    /// How long after the end of the plan the rest is corrected, 0 to 60 s.
    pub patience: Seconds,
    /// A wheel that is this far from where it should be does not follow, 0.01 to 10 m.
    pub lost: Metres,
    /// Without a new measurement for this long the task fails, 0.1 to 5 s.
    pub silence: Seconds,
    /// The robot: its wheel speed and acceleration limit every command.
    pub robot: Drivetrain,
}

impl Default for DParams {
    /// What the tournament's search found best; the parameter file says by how much.
    fn default() -> Self {
        Self {
            period: Seconds(0.05),
            law: Law::default(),
            pole: 0.6,
            gains: Gains::default(),
            lead: Seconds(0.095),
            tolerance: Metres(0.002),
            settle: Seconds(0.2),
            patience: Seconds(3.0),
            lost: Metres(0.3),
            silence: Seconds(0.5),
            robot: Drivetrain::default(),
        }
    }
}

impl Bounds for DParams {
    fn check(&self) -> Result<(), Refusal> {
        within("period in s", self.period.0, 0.01, 0.5)?;
        within("pole", self.pole, 0.0, 0.95)?;
        within("gains.proportional", self.gains.proportional, 0.01, 2.0)?;
        within("gains.integral in 1/s", self.gains.integral, 0.0, 20.0)?;
        within("gains.derivative in s", self.gains.derivative, 0.0, 1.0)?;
        within("lead in s", self.lead.0, 0.0, 1.0)?;
        within("tolerance in m", self.tolerance.0, 1e-4, 0.1)?;
        within("settle in s", self.settle.0, 0.0, 5.0)?;
        within("patience in s", self.patience.0, 0.0, 60.0)?;
        within("lost in m", self.lost.0, 0.01, 10.0)?;
        within("silence in s", self.silence.0, 0.1, 5.0)?;
        self.robot.check()
    }
}

impl Params for DParams {
    const FILE: &'static str = include_str!("../../../deploy/params/d-corrector.toml");
}

/// The D-corrector at work on one drive.
#[derive(Clone, Debug)]
pub struct DCorrector {
    params: DParams,
    period: Seconds,
    due: Due,
    /// The measurement at the beginning of the task, from which distances and robot time count.
    begin: EncodersData,
    /// The robot time at which the plan begins; known from the first beat on.
    zero: Option<Seconds>,
    newest: Newest<EncodersData>,
    grain: Grain,
    /// The movement that was commanded last.
    last: Dwm,
    /// The stamp since which both wheels are within the tolerance of the goal.
    calm: Option<Seconds>,
    manners: Manners,
    /// For the paper's law: the sum of the errors over time, m·s, the last ones, m, and whether a limit held.
    sum: Sides<f64>,
    before: Sides<f64>,
    is_limited: bool,
}

impl Corrector for DCorrector {
    type Params = DParams;
    type Plan = Drive;

    fn period(params: &DParams) -> Seconds {
        params.period
    }

    fn begin(params: &DParams, period: Seconds, task: Task<Drive>, seen: &Seen) -> Result<Self, Refusal> {
        params.check()?;
        within("period in s", period.0, 0.01, 0.5)?;
        task.plan.check()?;
        let due = Due::new(task.plan, &params.robot)?;
        // A wheel may be where it should not be by `lost`; a measurement that is farther off is none.
        let watch = Watch { silence: params.silence, jump: params.lost, ..Watch::default() };
        let newest = Newest::new(seen.encoders, seen.at, watch, params.robot)?;
        let last = Dwm::steady(due.speeds(0.0), Seconds::ZERO)?;
        let (params, begin) = (params.clone(), *newest.value());
        let (zero, calm, nothing) = (None, None, Sides::new(0.0, 0.0));
        let (sum, before, is_limited) = (nothing, nothing, false);
        let (grain, manners) = (Grain::default(), Manners::default());
        Ok(Self {
            params,
            period,
            due,
            begin,
            zero,
            newest,
            grain,
            last,
            calm,
            manners,
            sum,
            before,
            is_limited,
        })
    }

    fn step(&mut self, seen: &Seen) -> Step {
        // An empty plan has no goal to settle at.
        if self.due.total() <= 0.0 {
            return Step::Done;
        }
        match self.decide(seen) {
            Ok(step) => step,
            Err(refusal) => Step::Fail(refusal),
        }
    }

    fn resume(&mut self, seen: &Seen, _: Seconds) {
        // What is wrong with the measurement fails the step that follows.
        drop(self.newest.hear(seen.encoders, seen.at));
        // The plan has waited for the wheels. For how long only they know: the gate had braked before it said so.
        let obeyed = self.newest.elapsed() + self.newest.age(seen.at) + self.params.lead;
        let waits = self.due.was_at(self.real(), self.planned());
        self.zero = self.zero.map(|_| obeyed - Seconds(waits));
        self.last = Dwm::rest(Seconds::ZERO);
    }

    fn account(&self) -> Account {
        let planned = self.planned();
        let fraction =
            if self.due.total() > 0.0 { (planned / self.due.total()).clamp(0.0, 1.0) } else { 1.0 };
        Account {
            stamp: self.newest.value().stamp,
            elapsed: self.newest.elapsed(),
            fraction,
            due: Some(self.due.distances(planned)),
            real: Some(self.real()),
        }
    }
}

impl DCorrector {
    fn decide(&mut self, seen: &Seen) -> Result<Step, Refusal> {
        if let Some(before) = self.newest.hear(seen.encoders, seen.at)? {
            self.grain.take(&before, self.newest.value());
        }
        // The robot time at which the command of this beat will be obeyed.
        let obeyed = self.newest.elapsed() + self.newest.age(seen.at) + self.params.lead;
        let zero = *self.zero.get_or_insert(obeyed);
        let error = self.due.distances(self.planned()).zip(self.real(), |due, real| due - real);
        self.check_lost(error)?;
        if self.planned() < self.due.total() {
            let now = (obeyed - zero).0;
            let target = self.corrected(now, error).map(|speed| speed.0);
            let (target, nearness) = match self.due.total() - now {
                left if left <= 0.0 => (target, Nearness::Near),
                // What is too far shortly before the end is not taken back before it: that would be once more.
                left if left <= LATE => (self.with_the_plan(now, target), Nearness::Far),
                _ => (target, Nearness::Far),
            };
            let speeds = self.manners.allow(target, nearness, seen.at);
            self.command(speeds.map(MetresPerSecond))
        } else {
            self.finish(error, seen.at)
        }
    }

    fn check_lost(&self, error: Sides<Metres>) -> Result<(), Refusal> {
        for (side, error) in [("left", error.left), ("right", error.right)] {
            // An error that is not a number is no better than a large one.
            if !(0.0..=self.params.lost.0).contains(&error.0.abs()) {
                let how = "is the drive enabled, and do the wheels turn freely?";
                let why = format!(
                    "the {side} wheel does not follow: it is {error:.3} from its due distance; {how}"
                );
                return Err(Refusal::Failed { why });
            }
        }
        Ok(())
    }

    /// The time of the plan at the newest measurement, s; negative before the first command reaches the wheels.
    fn planned(&self) -> f64 {
        self.zero.map_or(0.0, |zero| (self.newest.elapsed() - zero).0)
    }

    fn real(&self) -> Sides<Metres> {
        self.begin.span_to(self.newest.value()).sides()
    }

    /// The wheel speeds at the end of the next command, which is obeyed from the time `now` of the plan on, in s.
    fn corrected(&mut self, now: f64, error: Sides<Metres>) -> Sides<MetresPerSecond> {
        match self.params.law {
            Law::Damped => self.damped(now, error),
            Law::Paper => self.paper(now, error),
        }
    }

    /// The speeds that are not against the direction in which the plan has the wheels run at the end of a beat, m/s.
    fn with_the_plan(&self, now: f64, target: Sides<f64>) -> Sides<f64> {
        self.due.speeds(now + self.period.0).zip(
            target,
            |due, target| {
                if due.0 * target < 0.0 { 0.0 } else { target }
            },
        )
    }

    /// model.md 4.5, with its symbols: e error, w speed beyond that of the plan, ΔT period, p pole.
    /// w' = α e/ΔT - β w, α = (1-p)², β = (1-2p-p²)/2; w is that of the command as it was limited (anti-windup).
    fn damped(&self, now: f64, error: Sides<Metres>) -> Sides<MetresPerSecond> {
        let p = self.params.pole.powf((self.period.0 / POLE_BEAT).min(1.0));
        let alpha = (1.0 - p) * (1.0 - p);
        let beta = (1.0 - 2.0 * p - p * p) / 2.0;
        let w = self.last.end().zip(self.due.speeds(now), |commanded, due| commanded - due);
        let next = w.zip(error, |w, e| e / self.period * alpha - w * beta);
        next.zip(self.due.speeds(now + self.period.0), |w, due| due + w)
    }

    /// The paper, III.A, with its symbols and the repairs of model.md, erratum 11: c is what the wheels shall cover in
    /// the next period, the increment of the plan and gP·e + gI·Σe·ΔT + gD·(e - e')/ΔT; v' = 2c/ΔT - v.
    ///
    /// The sum stands while a limit holds the wheels back (anti-windup).
    fn paper(&mut self, now: f64, error: Sides<Metres>) -> Sides<MetresPerSecond> {
        let (Gains { proportional, integral, derivative }, t) = (self.params.gains, self.period.0);
        let e = error.map(|error| error.0);
        if !self.is_limited {
            self.sum = self.sum.zip(e, |sum, e| sum + e * t);
        }
        let change = e.zip(self.before, |e, before| (e - before) / t);
        self.before = e;
        let terms = e.zip(self.sum, |e, sum| proportional * e + integral * sum);
        let terms = terms.zip(change, |terms, change| terms + derivative * change);
        let increment = self.due.distances(now + t).zip(self.due.distances(now), |then, now| (then - now).0);
        let c = increment.zip(terms, |increment, terms| increment + terms);
        c.zip(self.last.end(), |c, v| MetresPerSecond(2.0 * c / t) - v)
    }

    /// What happens after the last movement of the plan, by the stamps: without measurements nothing settles.
    fn finish(&mut self, error: Sides<Metres>, at: Seconds) -> Result<Step, Refusal> {
        let DParams { tolerance, settle, patience, .. } = self.params;
        // Nobody can stand more exactly than is measured.
        let tolerance = tolerance.max(Metres(self.grain.blur()));
        let worst = error.left.abs().max(error.right.abs());
        let stamp = self.newest.value().stamp;
        self.calm = if worst <= tolerance { self.calm.or(Some(stamp)) } else { None };
        let settled = self.calm.is_some_and(|calm| stamp - calm >= settle);
        let impatient = self.planned() - self.due.total() >= patience.0;
        if impatient && worst > tolerance * NEAR {
            let why = format!(
                "the wheels are still {worst:.4} from their goal {patience} after the end of the plan"
            );
            return Err(Refusal::Failed { why });
        }
        if !(settled || impatient) {
            let resting = error.zip(self.last.end(), |error, commanded| {
                let stands = commanded.abs() <= MetresPerSecond::ZERO;
                error.abs() <= tolerance * 0.5 || (stands && error.abs() <= tolerance)
            });
            let target = self.corrected(self.due.total(), error);
            let speeds = resting.zip(target, |rests, speed| if rests { 0.0 } else { speed.0 });
            let speeds = self.manners.allow(speeds, Nearness::Near, at);
            return self.command(speeds.map(MetresPerSecond));
        }
        if self.last.peak_speed() <= MetresPerSecond::ZERO {
            return Ok(Step::Done);
        }
        self.command(Sides::default())
    }

    /// The command towards `target`, within the limits of the robot.
    fn command(&mut self, target: Sides<MetresPerSecond>) -> Result<Step, Refusal> {
        let robot = &self.params.robot;
        let most = robot.wheel_acceleration.0 * self.period.0;
        let end = self.last.end().zip(target, |from, to| {
            let to = to.0.clamp(-robot.wheel_speed.0, robot.wheel_speed.0);
            MetresPerSecond(to.clamp(from.0 - most, from.0 + most))
        });
        let held = end.zip(target, |end, target| (end - target).0.abs());
        self.is_limited = held.left.max(held.right) > 0.0;
        self.last = Dwm::new(self.last.end(), end, self.period)?;
        Ok(Step::Drive(self.last))
    }
}

#[cfg(test)]
mod tests;
