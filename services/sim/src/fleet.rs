//! A fleet in virtual time: ten emulated robots among the walls of the shipped warehouse, held apart by Traffic.
//!
//! Each robot has its own gate, emulator, links, navigator and corrector; the escorts do what pilots do with them.

use crate::course::Brief;
use crate::host::{Host, Stage, ToHost};
use crate::link::Link;
use crate::plans::warehouse;
use crate::robot::{Robot, ToRobot};
use crate::scenario::Scenario;
use crate::seat::Seat;
use axle_correctors::{DCorrector, GCorrector};
use axle_emulator::EmulatorParams;
use axle_maps::{Clearance, Grid, Unknown};
use axle_pathdriver::{Pathdriver, PathdriverParams, Strategy};
use axle_pathfinder::{Pathfinder, PathfinderParams};
use axle_schema::contract::Functional as _;
use axle_schema::traffic::Claim;
use axle_schema::{
    DriveAsk, Metres, PlanAsk, PlanStrategy, Pose, RobotId, Seconds, TaskId, WayPoint, WayTask,
};
use axle_traffic::{Escort, Fleet, TrafficParams};
use std::f64::consts::FRAC_PI_2;

const RADIUS: f64 = 0.25;
const PIECE: Metres = Metres(0.5);
/// From beat to beat of the robots.
const BEAT: Seconds = Seconds(0.005);
/// Traffic is asked by each robot at every so many beats.
const ASK: u32 = 40;

/// One robot of the fleet.
struct Member {
    robot: Robot,
    host: Host<'static>,
    up: Link<ToHost>,
    down: Link<ToRobot>,
    escort: Escort,
    params: PathdriverParams,
    goal: Pose,
    due: Seconds,
    period: Seconds,
    stages: u32,
    last: String,
    /// Where it stands after its task.
    parked: Option<Pose>,
}

/// Values that live as long as the test, as hosts want them.
fn forever<T>(value: T) -> &'static T {
    Box::leak(Box::new(value))
}

impl Member {
    fn new(number: usize, map: &Grid, points: &[(f64, f64)], confirm: &[u32]) -> Self {
        let seed = 100 + number as u64;
        let start = Pose::new(points[0].0, points[0].1, FRAC_PI_2);
        let way = WayTask { points: points[1..].iter().map(|&(x, y)| WayPoint::at(x, y)).collect() };
        let map = map.to_data().expect("a message");
        let strategy = Some(PlanStrategy::Map);
        let body = Some(Metres(RADIUS));
        let ask =
            PlanAsk { way, start: Some(start), strategy, body, map: Some(map.clone()), ..PlanAsk::default() };
        let plan = Pathfinder::answer(&PathfinderParams::default(), &ask).expect("a plan");
        let goal = plan.legs.iter().fold(start, |pose, leg| leg.geometry.end_from(pose));
        let name = RobotId::new(&format!("r{}", number + 1)).expect("a name");
        let escort = Escort::new(name, TaskId(seed), &plan, confirm, (Metres(RADIUS), PIECE)).expect("a way");
        // Poor motors and true encoders: a navigator of wheels alone stays true over a tour.
        let mut world = Scenario::find("motors").expect("a scenario").world(seed);
        world.robot = EmulatorParams { start, ..world.robot };
        let seat = if number.is_multiple_of(2) {
            Seat::of::<DCorrector>("d-corrector", &[])
        } else {
            Seat::of::<GCorrector>("g-corrector", &[])
        };
        let strategy = if number.is_multiple_of(3) { Strategy::Stop } else { Strategy::Continuous };
        let brief = Brief { plan, drive: axle_schema::Drive::default() };
        let period = seat.period;
        let mut host = Host::new(forever(seat), forever(brief)).expect("a host");
        host.stage = Stage::Over(Ok(()));
        Self {
            robot: Robot::new(&world).and_then(|robot| robot.among(&map)).expect("a robot"),
            host,
            up: Link::new(world.up, seed, 11).expect("a link"),
            down: Link::new(world.down, seed, 12).expect("a link"),
            escort,
            params: PathdriverParams { strategy, ..PathdriverParams::default() },
            goal,
            due: Seconds(0.001 * number as f64),
            period,
            stages: 0,
            last: String::new(),
            parked: None,
        }
    }

    /// What it tells Traffic: how far it is, and after its task only where it stands.
    fn claim(&mut self) -> Claim {
        let claim = self.escort.claim();
        if !self.escort.is_over() {
            return claim;
        }
        let at = *self.parked.get_or_insert(self.robot.truth().pose);
        Escort::parked(claim.robot, TaskId(claim.task.0 + 100), at, Metres(RADIUS))
    }

    /// A beat of the robot, and those of its host until then.
    fn beat(&mut self, next: Seconds) {
        while self.due < next {
            self.host.hear(self.due, &mut self.up);
            self.host.beat(self.due, Seconds(1000.0) + self.due, &mut self.down);
            self.due += self.period;
        }
        self.robot.beat(next, &mut self.down, &mut self.up);
        self.host.hear(next, &mut self.up);
        if let Some(seen) = self.host.pose() {
            self.escort.see(seen.pose);
            self.drive(seen.pose);
        }
    }

    /// The end of a stage, and the beginning of the next one.
    fn drive(&mut self, pose: Pose) {
        let Stage::Over(end) = &self.host.stage else { return };
        assert_eq!(*end, Ok(()), "a stage of a robot fails");
        if !self.robot.rests() {
            return;
        }
        self.escort.arrive();
        let Some(plan) = self.escort.next(pose) else { return };
        let ask = DriveAsk { legs: plan.legs.clone(), ..DriveAsk::default() };
        let drive = Pathdriver::answer(&self.params, &ask).expect("movements");
        self.last = format!("{plan:?} {:?}", drive.dwms);
        self.host.again(forever(Brief { plan, drive }));
        self.stages += 1;
    }
}

/// A tour from a bay through two of four aisles and back, one of them by a loading place; every other robot goes round
/// the other way. The bays are those of the shipped warehouse.
fn tour(number: usize) -> Vec<(f64, f64)> {
    let bay = (1.0 + 1.4 * number as f64, 0.7);
    let mut aisles = [(number % 4) as f64, ((number + 1) % 4) as f64].map(|aisle| 3.65 + 2.7 * aisle);
    if number % 2 == 1 {
        aisles.reverse();
    }
    let [out, home] = aisles;
    let place = (15.0, 4.5 + (number % 2) as f64 * 2.0);
    let mut way = vec![bay, (out, 4.2), (out, 7.0), (home, 5.6)];
    if number % 3 == 2 {
        way.insert(3, place);
    }
    way.push(bay);
    way
}

/// A line for each robot.
fn account(traffic: &Fleet) -> String {
    traffic.state().robots.iter().fold(String::new(), |text, mover| {
        let waits: Vec<String> =
            mover.waits.iter().map(|wait| format!("{}: {}", wait.robot, wait.why)).collect();
        let (x, y) = (mover.place.x.0, mover.place.y.0);
        let way = format!("{} of {} of {}", mover.passed, mover.until, mover.pieces);
        text + &format!("{} {way} at ({x:.1}, {y:.1}), {:?}, {}\n", mover.robot, mover.turn, waits.join("; "))
    })
}

#[test]
fn ten_robots_drive_tours_through_a_warehouse_without_collision_and_all_come_home() {
    let map = warehouse();
    let walls = Clearance::of(&map, Unknown::Blocked);
    // The third robot is loaded at its third point, and a person lets it go on.
    let confirm: &[u32] = &[3];
    let mut fleet: Vec<Member> = (0..10)
        .map(|number| Member::new(number, &map, &tour(number), if number == 2 { confirm } else { &[] }))
        .collect();
    let mut traffic = Fleet::new(TrafficParams::default(), Seconds::ZERO).expect("parameters");
    for (number, member) in fleet.iter().enumerate() {
        let (name, at) = (member.escort.claim().robot, member.robot.truth().pose);
        let parked = Escort::parked(name, TaskId(number as u64), at, Metres(RADIUS));
        traffic.claim(&parked, Seconds::ZERO).expect("it stands");
    }
    let (mut beats, mut nearest, mut busiest, mut loaded) = (0_u32, f64::INFINITY, 0, None);
    let mut moved = Seconds::ZERO;
    while !fleet.iter().all(|member| member.escort.is_over()) {
        beats += 1;
        let now = BEAT * f64::from(beats);
        for (number, member) in fleet.iter_mut().enumerate() {
            member.beat(now);
            if (beats + 3 * number as u32).is_multiple_of(ASK) {
                let said = traffic.claim(&member.claim(), now);
                member.escort.hear(&said);
            }
        }
        // A person comes 20 s after the robot.
        let waits = fleet[2].escort.waiting().is_some_and(|why| why.contains("a person"));
        if waits && *loaded.get_or_insert(now) + Seconds(20.0) < now {
            fleet[2].escort.confirm().expect("it waits");
        }
        let places: Vec<Pose> = fleet.iter().map(|member| member.robot.truth().pose).collect();
        for (number, place) in places.iter().enumerate() {
            for other in &places[number + 1..] {
                nearest = f64::min(nearest, place.distance(*other).0);
            }
        }
        // At 0.6 m/s a robot goes 3 mm from beat to beat.
        for place in places.iter().filter(|_| beats.is_multiple_of(4)) {
            let (u, v) = map.in_cells(place.x.0, place.y.0);
            let room = walls.at(u, v, 6.0) * map.resolution.0;
            assert!(room > RADIUS - 0.02, "a robot is {room} m from a wall at {place:?} after {now}");
        }
        let off = |member: &Member| (member.robot.truth().pose, member.last.clone());
        assert!(
            nearest >= 2.0 * RADIUS,
            "two robots meet after {now}: {nearest} m\n{}{:?}",
            account(&traffic),
            fleet.iter().map(off).collect::<Vec<_>>()
        );
        busiest = busiest.max(fleet.iter().filter(|member| member.escort.drives()).count());
        if fleet.iter().any(|member| member.escort.drives()) {
            moved = now;
        }
        assert!(now - moved < Seconds(30.0), "they wait for ever after {now}:\n{}", account(&traffic));
        assert!(now < Seconds(1800.0), "they come to no end:\n{}", account(&traffic));
    }
    for member in &fleet {
        let left = member.robot.truth().pose.distance(member.goal).0;
        assert!(left < 0.05, "{left} m from its bay after {} stages", member.stages);
    }
    assert!(busiest >= 3, "at most {busiest} drove at a time");
    assert!(loaded.is_some(), "nobody waited for a person");
}
