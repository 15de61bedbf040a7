//! Plans of every strategy of Pathfinder, driven: in the open, and in the warehouse whose walls stand in the way.

use crate::course::Brief;
use crate::metrics::METRICS;
use crate::run::{Ending, Mill, run};
use crate::seat::Seat;
use crate::{Scenario, World};
use axle_correctors::{DCorrector, GCorrector};
use axle_emulator::EmulatorParams;
use axle_maps::{Clearance, Description, Grid, Unknown, image};
use axle_pathdriver::{Joints, PathdriverParams, Strategy};
use axle_pathfinder::{Pathfinder, PathfinderParams};
use axle_schema::contract::Functional as _;
use axle_schema::{PlanAsk, PlanStrategy, Pose, Seconds, WayTask};

/// The warehouse that is shipped.
pub(crate) fn warehouse() -> Grid {
    let image = image::read(include_bytes!("../../../deploy/maps/warehouse.png")).expect("an image");
    let description = Description::read(include_bytes!("../../../deploy/maps/warehouse.yaml"));
    description.and_then(|it| it.grid("warehouse", &image)).expect("a map")
}

/// The place of this measure in a run.
fn measure(name: &str) -> usize {
    METRICS.iter().position(|metric| metric.name == name).expect("a measure")
}

fn seats() -> [Seat; 2] {
    [Seat::of::<DCorrector>("d-corrector", &[]), Seat::of::<GCorrector>("g-corrector", &[])]
}

fn manners() -> [PathdriverParams; 3] {
    let stop = PathdriverParams::default();
    let jump = PathdriverParams { strategy: Strategy::Continuous, ..stop.clone() };
    let blend = PathdriverParams { joints: Joints::Blend, ..jump.clone() };
    [stop, jump, blend]
}

/// A robot with unequal motors that jitter, and one with a dead band, a lag and a battery that sags.
fn worlds(seed: u64, start: Pose) -> [World; 2] {
    let plain = World { robot: EmulatorParams { seed, ..EmulatorParams::default() }, ..World::clean(seed) };
    let motors = Scenario::find("motors").expect("a scenario").world(seed);
    [plain, motors].map(|world| World { robot: EmulatorParams { start, ..world.robot }, ..world })
}

#[test]
fn plans_of_every_strategy_are_driven_within_five_centimetres() {
    let (error, aside) = (measure("final_error_m"), measure("cross_track_max_m"));
    for strategy in PlanStrategy::ALL.into_iter().filter(|&strategy| strategy != PlanStrategy::Map) {
        let way = WayTask::parse("1.5,0 1.5,1.5 0.2,1.8,3.0 -0.8,0.4").expect("a way");
        let params = PathfinderParams { strategy, ..PathfinderParams::default() };
        let plan = Pathfinder::answer(&params, &PlanAsk { way, ..PlanAsk::default() }).expect("a plan");
        for params in manners() {
            let brief = Brief::of(plan.clone(), &params).expect("movements");
            for seat in seats() {
                // It follows geometries at speeds of its own: one manner is as good as another.
                if seat.name == "g-corrector" && params.strategy != Strategy::Stop {
                    continue;
                }
                for world in worlds(11, plan.start) {
                    let run = run(&seat, &brief, &world).expect("a run");
                    let what = format!("{} with {strategy}, {:?}", seat.name, params.strategy);
                    assert_eq!(run.ending, Ending::Done, "{what}");
                    let [error, aside] = [error, aside].map(|place| run.values[place]);
                    assert!(error < 0.05 && aside < 0.05, "{what}: {error} m from the end, {aside} m beside");
                }
            }
        }
    }
}

#[test]
fn a_tour_of_the_warehouse_is_driven_within_five_centimetres_and_touches_nothing() {
    let grid = warehouse();
    let (map, clearance) = (grid.to_data().expect("a message"), Clearance::of(&grid, Unknown::Blocked));
    let start = Pose::new(1.0, 0.7, std::f64::consts::FRAC_PI_2);
    let way = WayTask::parse("6.3,5.5 15,4.5 11.7,5.5 1.0,0.7").expect("a way");
    let params = PathfinderParams { strategy: PlanStrategy::Map, ..PathfinderParams::default() };
    let ask =
        PlanAsk { way, start: Some(start), map: Some(map.clone()), reorder: false, ..PlanAsk::default() };
    let plan = Pathfinder::answer(&params, &ask).expect("a plan");
    assert!(plan.clearance.expect("on a map").0 > 0.1, "{:?} m beside the robot", plan.clearance);
    let manner = PathdriverParams { strategy: Strategy::Continuous, ..PathdriverParams::default() };
    let brief = Brief::of(plan, &manner).expect("movements");
    for seat in seats() {
        for world in worlds(7, start) {
            let mut mill = Mill::new(&seat, &brief, &world).expect("a mill");
            mill.robot = mill.robot.among(&map).expect("walls");
            let (mut nearest, mut beats) = (f64::INFINITY, 0_u32);
            while !matches!(mill.host.stage, crate::host::Stage::Over(_)) {
                mill.beat();
                beats += 1;
                if beats.is_multiple_of(4) {
                    let at = mill.robot.truth().pose;
                    let (u, v) = grid.in_cells(at.x.0, at.y.0);
                    nearest = nearest.min(clearance.at(u, v, 12.0) * grid.resolution.0);
                }
                assert!(mill.now < Seconds(600.0), "{} comes to no end", seat.name);
            }
            let crate::host::Stage::Over(end) = &mill.host.stage else { panic!("it is over") };
            assert_eq!(end, &Ok(()), "{}", seat.name);
            let left = mill.robot.truth().pose.distance(brief.goal()).0;
            let promised = params.body + brief.plan.clearance.expect("on a map");
            assert!(left < 0.05, "{}: {left} m from the end", seat.name);
            assert!(nearest > promised.0 - 0.05, "{}: {nearest} m from a wall", seat.name);
        }
    }
}
