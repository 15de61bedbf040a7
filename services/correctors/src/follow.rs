//! What correctors have in common that steer along a plan by the pose: everything but the steering.
//!
//! A plan is driven part by part: paths without a stop, and turns on the spot between them. At every beat the pose is
//! predicted to the time at which the command will be obeyed, a [`Steering`] says with which speed and turn rate the
//! robot shall go on from there, and the limits of the robot and the end of the part decide how much of it is done.
//!
//! *The end.* Near the end of a path the robot slows down, and stands when it is within half of the tolerance along its
//! way; to the side it cannot move. After the last part it must have been there for `settle`. A robot that comes no
//! closer for `patience` is done if it is within `radius` of the goal, and has failed beyond.

use crate::body::Body;
use crate::finish::{Finish, Progress, Since, Zone};
use crate::manners::{Manners, Nearness};
use crate::newest::Watch;
use crate::path::{Limits, Path, Place, travel};
use crate::route::{self, Part};
use axle_schema::contract::{Account, Bounds as _, Seen, Step};
use axle_schema::refusal::within;
use axle_schema::{Drivetrain, Plan, Pose, Radians, Refusal, Seconds, Sides, Twist};

/// The jump of a wheel speed at a joint that is spread over this time by the wheels, s.
const JOINT: f64 = 0.08;
/// A turn before a way that is shorter than this many radii is driven, even if the steering would not need it.
const SHORT: f64 = 5.0;
/// The heading at the end of a path is left alone within this, rad: to turn back less is to hunt.
const ALIGNED: f64 = 0.13;
/// How many tolerances a turn may be off when patience is over.
const NEAR: f64 = 5.0;

/// What every such corrector has among its parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    pub(crate) period: Seconds,
    pub(crate) lead: Seconds,
    pub(crate) effort: f64,
    pub(crate) finish: Finish,
    pub(crate) watch: Watch,
    pub(crate) robot: Drivetrain,
}

impl Rules {
    /// Refuses what is out of range, by name.
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        check_period(self.period)?;
        within("lead in s", self.lead.0, 0.0, 1.0)?;
        within("effort", self.effort, 0.05, 1.0)?;
        self.finish.check()?;
        self.watch.check()?;
        self.robot.check()
    }
    /// The deceleration that is planned with, m/s².
    pub(crate) fn deceleration(&self) -> f64 {
        self.robot.wheel_acceleration.0 * self.effort
    }
    /// The largest turn rate that is planned with, rad/s.
    pub(crate) fn turn_rate(&self) -> f64 {
        self.robot.turn_rate.0.min(2.0 * self.robot.wheel_speed.0 / self.robot.track.get()) * self.effort
    }
    /// The turn rate that ends a turn of `angle`, rad/s; 0 where `zone` rests.
    pub(crate) fn turning(&self, angle: f64, tolerance: f64, stands: bool) -> f64 {
        let arm = self.robot.track.get() / 2.0;
        let slowest = self.creep(tolerance * arm) / arm;
        let zone = Zone { tolerance, slowest, stands };
        let most = self.turn_rate();
        self.finish.speed(angle, zone, self.deceleration() / arm).clamp(-most, most)
    }
    /// The slowest speed that is worth while; a beat of it must not leap over the dead zone.
    pub(crate) fn creep(&self, tolerance: f64) -> f64 {
        self.finish.creep.0.min(tolerance / 2.0 / self.period.0)
    }
}

/// Refuses a period that no corrector has.
pub(crate) fn check_period(period: Seconds) -> Result<(), Refusal> {
    within("period in s", period.0, 0.01, 0.5)
}

/// Where a robot is on its way, in the direction of travel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way<'a> {
    pub(crate) path: &'a Path,
    pub(crate) place: Place,
    pub(crate) pose: Pose,
    /// The largest speed that the path, its joints and its end allow, m/s.
    pub(crate) speed: f64,
    /// How the robot is commanded to move.
    pub(crate) twist: Twist,
    pub(crate) rules: &'a Rules,
}

/// How a robot shall go on, in the direction of travel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aim {
    /// Speed, m/s.
    pub(crate) v: f64,
    /// Turn rate, rad/s.
    pub(crate) omega: f64,
    /// How far the robot must turn to head where it shall, rad.
    pub(crate) off: f64,
}

/// A rule by which a robot keeps on a path.
pub(crate) trait Steering {
    /// The speed and turn rate with which the robot goes on.
    fn steer(&mut self, way: &Way<'_>) -> Aim;
    /// A piece of a path counts as behind this many metres before its end.
    fn early(&self) -> f64 {
        0.0
    }
    /// The longest arc that it drives as one piece, rad.
    fn longest_turn(&self) -> f64 {
        f64::INFINITY
    }
    /// Whether it needs the turns of the plan, or turns towards its path by itself.
    fn needs_turns(&self) -> bool {
        true
    }
}

/// A corrector that steers along a plan.
#[derive(Clone, Debug)]
pub(crate) struct Follower<S> {
    steering: S,
    rules: Rules,
    /// How a task ends where the encoders are good enough for it.
    finish: Finish,
    body: Body,
    parts: Vec<Part>,
    /// The part that is driven, what is left of those after it in m, and how far the robot is on it.
    part: usize,
    later: f64,
    place: Place,
    /// The heading at the end of a turn, once it has begun.
    heading: Option<f64>,
    /// Where the plan ends, and how much there was to drive, m.
    goal: Pose,
    whole: f64,
    left: f64,
    calm: Since,
    manners: Manners,
    progress: Progress,
}

/// What a part wants of a beat.
enum Want {
    /// The robot shall move.
    Move(Aim),
    /// The part is at its end.
    Rest,
}

impl<S: Steering> Follower<S> {
    /// Takes a plan.
    ///
    /// # Errors
    /// Refuses a plan that cannot be followed from where the robot is seen.
    pub(crate) fn new(steering: S, rules: Rules, plan: &Plan, seen: &Seen) -> Result<Self, Refusal> {
        rules.check()?;
        let Rules { robot, effort, .. } = rules;
        let limits = Limits { robot, effort, turn: steering.longest_turn() };
        let mut parts = route::parts(plan, &limits, robot.wheel_acceleration.0 * JOINT)?;
        let body = Body::new(robot, (rules.period, rules.lead), rules.watch, rules.finish.push, seen)?;
        if !parts.is_empty() {
            route::check_start(plan.start, body.pose())?;
        }
        let goal = plan.legs.iter().fold(plan.start, |at, leg| leg.geometry.end_from(at));
        if matches!(parts.last(), Some(Part::Way(_))) {
            // Who steers to a point may come to it from any side: what is worth mentioning is turned back.
            parts.push(Part::Turn { from: goal.heading, angle: Radians::ZERO, loose: ALIGNED });
        }
        let arm = robot.track.get() / 2.0;
        let whole = parts.iter().map(|part| length(part, arm)).sum::<f64>();
        let later = whole - parts.first().map_or(0.0, |part| length(part, arm));
        let (place, calm, progress) = (Place::default(), Since::default(), Progress::new());
        let mut follower = Self {
            steering,
            rules,
            finish: rules.finish,
            body,
            parts,
            part: 0,
            later,
            place,
            heading: None,
            goal,
            whole,
            left: whole,
            calm,
            manners: Manners::default(),
            progress,
        };
        if follower.is_skipped() {
            follower.advance();
        }
        Ok(follower)
    }

    /// One beat.
    pub(crate) fn step(&mut self, seen: &Seen) -> Step {
        self.decide(seen).unwrap_or_else(Step::Fail)
    }

    /// The robot has braked without a command, and goes on from where it is.
    pub(crate) fn resume(&mut self, seen: &Seen) {
        self.body.resume(seen);
    }

    /// What the last beat was about.
    pub(crate) fn account(&self) -> Account {
        let fraction = if self.whole > 0.0 { 1.0 - self.left / self.whole } else { 1.0 };
        self.body.account(fraction, None)
    }

    fn decide(&mut self, seen: &Seen) -> Result<Step, Refusal> {
        if self.parts.is_empty() {
            return self.body.rest(seen.at);
        }
        self.body.hear(seen)?;
        self.rules.finish = self.finish.resolved(self.body.blur(), self.rules.robot.track);
        let pose = self.body.pose_at(seen.at);
        let mut want = self.want(pose, seen.at);
        let is_last = |part: usize, parts: &[Part]| part + 1 >= parts.len();
        if matches!(want, Want::Rest) && self.body.wheels.stand() && !is_last(self.part, &self.parts) {
            self.advance();
            want = self.want(pose, seen.at);
        }
        if self.progress.wait(self.left, self.body.stamp()) > self.rules.finish.patience {
            return self.give_up(seen.at);
        }
        match want {
            Want::Move(Aim { v, omega, .. }) => {
                self.calm.holds(false, self.body.stamp());
                self.body.drive(v, omega, seen.at)
            }
            Want::Rest => {
                // Prediction brought the robot here; that it is here is for the measurements to say.
                let arrived = is_last(self.part, &self.parts) && self.has_arrived();
                let calm = self.calm.holds(arrived, self.body.stamp());
                if calm.is_some_and(|time| time >= self.rules.finish.settle) {
                    return self.end(seen.at);
                }
                self.body.drive(0.0, 0.0, seen.at)
            }
        }
    }

    /// Goes on to the next part that is to be driven.
    fn advance(&mut self) {
        let arm = self.rules.robot.track.get() / 2.0;
        loop {
            self.part += 1;
            (self.place, self.heading) = (Place::default(), None);
            self.later -= self.parts.get(self.part).map_or(0.0, |part| length(part, arm));
            if !self.is_skipped() {
                return;
            }
        }
    }

    /// Whether the part is a turn that the steering makes by itself, on the long way that follows.
    fn is_skipped(&self) -> bool {
        let long = self.rules.finish.radius.0 * SHORT;
        match (self.parts.get(self.part), self.parts.get(self.part + 1)) {
            (Some(Part::Turn { .. }), Some(Part::Way(path))) => {
                !self.steering.needs_turns() && path.length > long
            }
            _ => false,
        }
    }

    /// What the part asks for at the beat `at` when the robot is at `pose`.
    fn want(&mut self, pose: Pose, at: Seconds) -> Want {
        let stands = self.body.wheels.stand();
        let (want, left, off) = match &self.parts[self.part] {
            Part::Turn { from, angle, loose } => {
                let heading = pose.heading.0;
                let planned = || heading - (pose.heading - *from).wrapped().0 + angle.0;
                let rest = *self.heading.get_or_insert_with(planned) - heading;
                let omega = self.rules.turning(rest, self.rules.finish.heading.0.max(*loose), stands);
                let aim = Aim { v: 0.0, omega, off: rest };
                let want = if omega.abs() > 0.0 { Want::Move(aim) } else { Want::Rest };
                (want, rest.abs() * self.rules.robot.track.get() / 2.0, 0.0)
            }
            Part::Way(path) => {
                let pose = travel(pose, path.forward);
                self.place = path.place(pose, self.place, self.steering.early());
                let along = along(path, self.place, pose, self.rules.finish.radius.0);
                let last = Twist::of_wheels(self.body.wheels.speeds(), self.rules.robot.track);
                let sign = if path.forward { 1.0 } else { -1.0 };
                let twist = Twist { v: last.v * sign, ..last };
                let way = Way { path, place: self.place, pose, speed: 0.0, twist, rules: &self.rules };
                let aim = aim(&mut self.steering, way, along, stands);
                let want = aim.map_or(Want::Rest, |aim| Want::Move(Aim { v: aim.v * sign, ..aim }));
                let off = aim.map_or(0.0, |aim| aim.off.abs()) * self.rules.robot.track.get() / 2.0;
                (want, path.left(self.place).abs(), off)
            }
        };
        self.left = left + off + self.later;
        self.mannered(want, left + self.later, at)
    }

    /// The same, or rest where a wheel would run to and fro at the goal, which is `far` away, m.
    fn mannered(&mut self, want: Want, far: f64, at: Seconds) -> Want {
        let Want::Move(Aim { v, omega, .. }) = want else { return want };
        let (finish, arm) = (&self.rules.finish, self.rules.robot.track.get() / 2.0);
        let enough = finish.tolerance.0.min(finish.heading.0 * arm) * NEAR;
        let nearness = match far {
            far if far > finish.radius.0 * 2.0 => Nearness::Far,
            _ if self.left > enough => Nearness::Near,
            _ => Nearness::Enough,
        };
        let speeds = self.manners.allow(Sides::new(v - omega * arm, v + omega * arm), nearness, at);
        if speeds.left.abs() + speeds.right.abs() > 0.0 { want } else { Want::Rest }
    }

    /// Whether the measurements say that the last part is at its end.
    fn has_arrived(&self) -> bool {
        let (pose, finish) = (self.body.pose(), &self.rules.finish);
        match &self.parts[self.part] {
            Part::Turn { loose, .. } => {
                let most = finish.heading.0.max(*loose);
                self.heading.is_some_and(|heading| (heading - pose.heading.0).abs() <= most)
            }
            Part::Way(path) => {
                let along = along(path, self.place, travel(pose, path.forward), finish.radius.0);
                along.abs() <= finish.tolerance.0
            }
        }
    }

    /// The robot rests and comes no closer.
    fn give_up(&mut self, at: Seconds) -> Result<Step, Refusal> {
        let Rules { finish, .. } = self.rules;
        let pose = self.body.pose();
        let turn = self.heading.map_or(0.0, |heading| heading - pose.heading.0);
        let near = self.part + 1 == self.parts.len() && turn.abs() <= (finish.heading.0 * NEAR).max(ALIGNED);
        let far = self.goal.distance(pose);
        if near && far <= finish.radius {
            return self.body.rest(at);
        }
        let why = format!(
            "the robot makes no progress: for {} it has come no closer to its goal, {far:.3} away",
            finish.patience
        );
        Err(Refusal::Failed { why })
    }

    /// The robot stands at the end of the last part.
    fn end(&mut self, at: Seconds) -> Result<Step, Refusal> {
        let (far, radius) = (self.goal.distance(self.body.pose()), self.rules.finish.radius);
        if far > radius {
            let why = format!("the goal was missed by {far:.3}, allowed is finish.radius, {radius}");
            return Err(Refusal::Failed { why });
        }
        self.left = 0.0;
        self.body.rest(at)
    }
}

/// What is left of a path along the way of the robot, m; near its end straight ahead, where the robot can still move.
fn along(path: &Path, place: Place, pose: Pose, near: f64) -> f64 {
    let goal = path.goal();
    let left = path.left(place);
    // A circle begins where it ends.
    let is_near = left <= 2.0 * near && goal.distance(pose).0 <= near;
    if is_near { goal.seen_from(pose).x.0 } else { left }
}

/// How the robot goes on along a path; nothing at its end.
fn aim<S: Steering>(steering: &mut S, way: Way<'_>, along: f64, stands: bool) -> Option<Aim> {
    let rules = way.rules;
    let tolerance = rules.finish.tolerance.0;
    let zone = Zone { tolerance, slowest: rules.creep(tolerance), stands };
    let towards = rules.finish.speed(along, zone, rules.deceleration());
    if towards < 0.0 {
        // A bit too far: straight back.
        return Some(Aim { v: towards.max(-way.path.speed(way.place, 0.0)), omega: 0.0, off: 0.0 });
    }
    if towards <= 0.0 {
        return None;
    }
    let speed = towards.min(way.path.speed(way.place, rules.deceleration()));
    let aim = steering.steer(&Way { speed, ..way });
    // Too fast a turn slows everything down, so that the curvature stays.
    let fit = (rules.turn_rate() / aim.omega.abs()).min(1.0);
    Some(Aim { v: aim.v * fit, omega: aim.omega * fit, ..aim })
}

/// What a part costs, m: a turn as much as its wheels cover.
fn length(part: &Part, arm: f64) -> f64 {
    match part {
        Part::Turn { angle, .. } => angle.0.abs() * arm,
        Part::Way(path) => path.length,
    }
}
