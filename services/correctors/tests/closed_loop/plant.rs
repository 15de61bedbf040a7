//! A small robot for closed loops in virtual time, and what a run with it was like: for every corrector the same.
//!
//! Between a command and its measurement lie links, motors, wheels and encoders; poses come from the real navigator.
//! Everything is a function of the plant and the plan: the same again gives the same again.

use axle_navigator::{Navigator, NavigatorParams};
use axle_pathdriver::{Pathdriver, PathdriverParams};
use axle_pathfinder::{Pathfinder, PathfinderParams};
use axle_schema::contract::{Corrector, Functional as _, Seen, Step};
use axle_schema::{
    Drive, DriveAsk, Drivetrain, Dwm, EncodersData, EncodersSpan, Geometry, InertialData, Leg, Metres,
    NavigatorData, Plan, PlanAsk, Pose, Radians, RadiansPerSecond, Refusal, Seconds, Sides, Task, TaskId,
    WayTask,
};
use std::collections::VecDeque;

/// The step of the virtual time, s; encoders are read at every fourth.
pub(crate) const STEP: f64 = 0.005;
/// No course of these tests takes longer, s.
const LONGEST: f64 = 180.0;

/// A robot: what lies between a command and its measurement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plant {
    /// Of a measurement on its way to the corrector, and of a command on its way back, in steps of 5 ms.
    pub(crate) up: usize,
    pub(crate) down: usize,
    /// How fast the wheels really run for a speed of 1.
    pub(crate) gain: Sides<f64>,
    /// Time constant of the motors, s.
    pub(crate) motor: f64,
    /// Below this speed a motor does not move, m/s.
    pub(crate) dead: f64,
    /// Noise of a reading beside the tick, m.
    pub(crate) noise: f64,
    /// The distance of one tick of the encoders, m.
    pub(crate) tick: f64,
    /// Bias of the gyroscope, rad/s.
    pub(crate) bias: f64,
    /// Between which times no measurement comes, s.
    pub(crate) mute: (f64, f64),
    /// One beat in so many does not come; 0 for none.
    pub(crate) missed: usize,
    /// From this time on no wheel turns any more, s.
    pub(crate) wall: f64,
}

pub(crate) const IDEAL: Plant = Plant {
    up: 0,
    down: 0,
    gain: Sides::new(1.0, 1.0),
    motor: 0.0,
    dead: 0.0,
    noise: 0.0,
    tick: 0.0,
    bias: 0.0,
    mute: (0.0, 0.0),
    missed: 0,
    wall: f64::INFINITY,
};
/// Delay of a period in sum, ticks of 0.5 mm, gain errors of 3 % to both sides, noise.
pub(crate) const REAL: Plant = Plant {
    up: 4,
    down: 6,
    gain: Sides::new(1.03, 0.97),
    motor: 0.02,
    noise: 2e-4,
    tick: 5e-4,
    bias: 0.004,
    ..IDEAL
};

/// What a run was like.
#[derive(Debug)]
pub(crate) struct Course {
    pub(crate) result: Result<(), Refusal>,
    /// Where the robot really is at the end, in the frame of its goal.
    pub(crate) miss: Pose,
    /// The largest difference between due and real distances, where the corrector says them; and the last, m.
    pub(crate) worst: f64,
    pub(crate) end: f64,
    /// The largest real distance from the path, m.
    pub(crate) astray: f64,
    /// How often the real wheels changed their direction in the last second; the worse of the two.
    pub(crate) reversals: usize,
    /// Duration by the robot's clock, s.
    pub(crate) time: f64,
    /// All commands, in their order.
    pub(crate) commands: Vec<Dwm>,
}

impl Course {
    pub(crate) fn missed_by(&self) -> f64 {
        self.miss.x.0.hypot(self.miss.y.0)
    }
}

/// A plan from (0, 0) along these geometries.
pub(crate) fn plan(geometries: &[Geometry]) -> Plan {
    let legs = geometries.iter().map(|&geometry| Leg { geometry, point: 0, speed: None }).collect();
    Plan { legs, ..Plan::default() }
}
pub(crate) fn line(length: f64) -> Geometry {
    Geometry::Line { length: Metres(length) }
}
pub(crate) fn turn(angle: f64) -> Geometry {
    Geometry::Turn { angle: Radians(angle) }
}
pub(crate) fn arc(radius: f64, angle: f64) -> Geometry {
    Geometry::Arc { radius: Metres(radius), angle: Radians(angle) }
}

/// The plan of a typed way, by the service that makes it.
pub(crate) fn way(way: &str) -> Plan {
    let way = WayTask::parse(way).expect("a way");
    Pathfinder::answer(&PathfinderParams::default(), &PlanAsk { way, ..PlanAsk::default() }).expect("a plan")
}

/// The drive of a plan, by the service that makes it.
pub(crate) fn drive(plan: &Plan) -> Drive {
    let ask = DriveAsk { legs: plan.legs.clone(), speeds: None, robot: None, manner: None };
    Pathdriver::answer(&PathdriverParams::default(), &ask).expect("a drive")
}

/// The courses that every corrector must master, by name.
pub(crate) fn courses() -> Vec<(&'static str, Plan)> {
    use std::f64::consts::{FRAC_PI_2, TAU};
    let slalom = [arc(0.6, 0.8), arc(-0.6, -1.6), arc(0.6, 1.6), arc(-0.6, -1.6), arc(0.6, 0.8)];
    vec![
        ("straight", way("1.3,0")),
        ("turn", plan(&[turn(2.5)])),
        ("arc", plan(&[arc(0.5, FRAC_PI_2)])),
        ("square", way("1,0 1,1 0,1 0,0")),
        ("slalom", plan(&slalom)),
        ("eight", plan(&[arc(0.5, TAU), arc(-0.5, -TAU)])),
        ("backward", plan(&[line(-0.5), turn(-1.0), arc(-0.6, 1.0)])),
    ]
}

/// A robot at work: its wheels, and what is on its way to and from it.
struct Robot {
    plant: Plant,
    random: u64,
    speed: Sides<f64>,
    covered: Sides<f64>,
    pose: Pose,
    navigator: Navigator,
    readings: VecDeque<(usize, EncodersData, InertialData, Option<NavigatorData>)>,
    orders: VecDeque<(usize, Dwm)>,
    playing: Option<(usize, Dwm)>,
}

impl Robot {
    fn new(plant: Plant, start: Pose) -> Self {
        let params = NavigatorParams { start, ..NavigatorParams::default() };
        Self {
            plant,
            random: 12345,
            speed: Sides::new(0.0, 0.0),
            covered: Sides::new(0.3, -0.2),
            pose: start,
            navigator: Navigator::new(params).expect("a navigator"),
            readings: VecDeque::new(),
            orders: VecDeque::new(),
            playing: None,
        }
    }

    /// Evenly spread between plus and minus 1.
    fn noise(&mut self) -> f64 {
        self.random =
            self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from((self.random >> 33) as u32) / f64::from(1_u32 << 30) - 1.0
    }

    /// Measures, and hands out the newest measurements that have arrived.
    fn sense(&mut self, n: usize, seen: &mut Seen) {
        let (time, Plant { mute, tick, noise, bias, .. }) = (n as f64 * STEP, self.plant);
        if n.is_multiple_of(4) && !(mute.0 < time && time < mute.1) {
            let stamp = Seconds(7.0 + time);
            let [left, right] = self.covered.both().map(|distance| {
                let distance = distance + noise * self.noise();
                Metres(if tick > 0.0 { (distance / tick).floor() * tick } else { distance })
            });
            let datum = EncodersData { stamp, left, right };
            let omega = (self.speed.right - self.speed.left) / Drivetrain::default().track.get();
            let gyro = RadiansPerSecond(omega + bias + noise * 10.0 * self.noise());
            let inertial = InertialData { stamp, gyro, ..InertialData::default() };
            let pose = self.navigator.take(datum);
            self.readings.push_back((n + self.plant.up, datum, inertial, pose));
        }
        while self.readings.front().is_some_and(|&(due, ..)| due <= n) {
            if let Some((_, encoders, inertial, pose)) = self.readings.pop_front() {
                (seen.encoders, seen.inertial) = (Some(encoders), Some(inertial));
                seen.pose = pose.or(seen.pose);
            }
        }
    }

    /// Moves the wheels by one step.
    fn act(&mut self, n: usize) {
        while self.orders.front().is_some_and(|&(due, _)| due <= n) {
            self.playing = self.orders.pop_front();
        }
        let Some((begin, dwm)) = self.playing else { return };
        let asked = dwm.speeds_at(Seconds(((n - begin) as f64 + 0.5) * STEP));
        let share = STEP / (STEP + self.plant.motor);
        let asked = asked.map(|asked| if asked.0.abs() < self.plant.dead { 0.0 } else { asked.0 });
        let asked = asked.zip(self.plant.gain, |asked, gain| asked * gain);
        self.speed = self.speed.zip(asked, |is, asked| is + (asked - is) * share);
        if n as f64 * STEP >= self.plant.wall {
            self.speed = Sides::new(0.0, 0.0);
        }
        let step = self.speed.map(|speed| Metres(speed * STEP));
        self.covered = self.covered.zip(step, |distance, step| distance + step.0);
        let span = EncodersSpan { duration: Seconds(STEP), left: step.left, right: step.right };
        let moved = span.navigator_span(Drivetrain::default().track);
        self.pose = self.pose.moved(moved.x, moved.y, moved.heading);
    }
}

/// Drives `plan`, which is `path` in the words of the corrector, to its end, with a beat of `period`.
pub(crate) fn run<C: Corrector<Plan: Clone>>(
    params: &C::Params,
    period: Seconds,
    plant: Plant,
    path: &Plan,
    plan: &C::Plan,
) -> Course {
    let beat = (period.0 / STEP).round() as usize;
    let goal = path.legs.iter().fold(path.start, |at, leg| leg.geometry.end_from(at));
    let line = points(path);
    let mut robot = Robot::new(plant, path.start);
    let mut seen = Seen::default();
    let mut running: Option<C> = None;
    let mut speeds: Vec<Sides<f64>> = Vec::new();
    let mut course = Course {
        result: Ok(()),
        miss: Pose::default(),
        worst: 0.0,
        end: 0.0,
        astray: 0.0,
        reversals: 0,
        time: 0.0,
        commands: vec![],
    };
    let mut over = None;
    for n in 0_usize.. {
        robot.sense(n, &mut seen);
        let missed = plant.missed > 0 && (n / beat).is_multiple_of(plant.missed);
        // Beats do not keep step with the encoders.
        if n % beat == 3 % beat && !missed && seen.pose.is_some() && over.is_none() {
            seen.at = Seconds(100.0 + n as f64 * STEP);
            if let Some(corrector) = &mut running {
                match beat_once(corrector, &seen, &mut course) {
                    Some(dwm) => robot.orders.push_back((n + plant.down, dwm)),
                    None => over = Some(n),
                }
            } else {
                let task = Task { id: TaskId(1), plan: plan.clone() };
                match C::begin(params, period, task, &seen) {
                    Ok(begun) => running = Some(begun),
                    Err(refusal) => {
                        course.result = Err(refusal);
                        break;
                    }
                }
            }
        }
        robot.act(n);
        if over.is_none() {
            speeds.push(robot.speed);
        }
        if n.is_multiple_of(4) {
            let near = line.iter().map(|&point| robot.pose.distance(point).0).fold(f64::INFINITY, f64::min);
            course.astray = course.astray.max(near);
        }
        assert!((n as f64) * STEP < LONGEST, "no end after {LONGEST} s, {:?} from {goal:?}", robot.pose);
        // What the last command still does on its way counts.
        if over.is_some_and(|over| n > over + 100) {
            break;
        }
    }
    course.miss = robot.pose.seen_from(goal);
    course.reversals = reversals(&speeds, |speed| speed.left).max(reversals(&speeds, |speed| speed.right));
    course
}

/// Points along a plan, at most 1 cm apart.
fn points(path: &Plan) -> Vec<Pose> {
    let mut at = path.start;
    let mut points = vec![at];
    let track = Drivetrain::default().track;
    for leg in &path.legs {
        // The normalised movement runs at a metre a second, by its faster wheel.
        let movement = leg.geometry.normalized_dwm(track).expect("a leg");
        let from = NavigatorData { pose: at, ..NavigatorData::default() };
        points.extend(movement.poses(from, track, Seconds(0.01)).map(|data| data.pose));
        at = leg.geometry.end_from(at);
    }
    points
}

/// One beat, and what it says of the course; nothing when it was the last one.
fn beat_once<C: Corrector>(corrector: &mut C, seen: &Seen, course: &mut Course) -> Option<Dwm> {
    let step = corrector.step(seen);
    let account = corrector.account();
    assert!((0.0..=1.0).contains(&account.fraction), "{account:?}");
    if let (Some(due), Some(real)) = (account.due, account.real) {
        let errors = due.zip(real, |due, real| (due - real).abs().0);
        course.end = errors.left.max(errors.right);
        course.worst = course.worst.max(course.end);
    }
    course.time = account.elapsed.0;
    match step {
        Step::Drive(dwm) => {
            course.commands.push(dwm);
            Some(dwm)
        }
        Step::Done => None,
        Step::Fail(refusal) => {
            course.result = Err(refusal);
            None
        }
    }
}

/// How often a wheel changed its direction in the last second.
fn reversals(speeds: &[Sides<f64>], side: fn(&Sides<f64>) -> f64) -> usize {
    let last = &speeds[speeds.len().saturating_sub(200)..];
    let forward: Vec<bool> = last.iter().map(side).filter(|v| v.abs() > 1e-4).map(|v| v > 0.0).collect();
    forward.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

/// Every command goes on from the last one within the limits of the default robot, and the last one is rest.
pub(crate) fn obeys_limits(course: &Course, period: Seconds) {
    let robot = Drivetrain::default();
    let mut last = Sides::default();
    for dwm in &course.commands {
        assert_eq!(dwm.start(), last, "{dwm:?} jumps");
        assert!(
            (dwm.duration() - period).0.abs() < 1e-15 && dwm.peak_speed() <= robot.wheel_speed,
            "{dwm:?}"
        );
        for a in dwm.accelerations().both() {
            assert!(a.0.abs() <= robot.wheel_acceleration.0 * (1.0 + 1e-9), "{dwm:?} accelerates by {a}");
        }
        last = dwm.end();
    }
    let rest = course.commands.last().expect("a command");
    assert!(course.result.is_err() || rest.peak_speed().0 <= 0.0, "{rest:?} is not rest");
}
