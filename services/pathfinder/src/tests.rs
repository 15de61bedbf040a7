//! What holds for every strategy.

use super::*;
use axle_schema::{Geometry, MapData, Radians, WayTask};
use proptest::prelude::*;

/// Parameters that choose a strategy.
pub(crate) fn given(strategy: PlanStrategy) -> PathfinderParams {
    PathfinderParams { strategy, ..PathfinderParams::default() }
}
/// The plan from the origin.
pub(crate) fn planned(params: &PathfinderParams, way: &str) -> Plan {
    let way = WayTask::parse(way).expect("a way");
    Pathfinder::answer(params, &PlanAsk { way, ..PlanAsk::default() }).expect("a plan")
}
/// Where a plan ends.
pub(crate) fn end(plan: &Plan) -> Pose {
    plan.legs.iter().fold(plan.start, |pose, leg| leg.geometry.end_from(pose))
}

/// A free map of 2 m by 1 m.
fn small() -> MapData {
    let resolution = Metres(0.5);
    MapData { width: 4, height: 2, resolution, runs: vec![0, 8], ..MapData::default() }
}

fn refused(ask: &PlanAsk, words: &str) {
    let refusal = Pathfinder::answer(&PathfinderParams::default(), ask).expect_err(words).to_string();
    assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
}

#[test]
fn the_parameter_file_holds_the_defaults() {
    let read: PathfinderParams = toml::from_str(PathfinderParams::FILE).expect("the file is valid");
    assert_eq!(read, PathfinderParams::default());
    let written = toml::Table::try_from(PathfinderParams::default()).expect("parameters are a table");
    let table: toml::Table = toml::from_str(PathfinderParams::FILE).expect("the file is a table");
    assert_eq!(table, written, "the file lists every field");
    assert!(toml::from_str::<PathfinderParams>("merg = 0.1").is_err(), "a misspelt field is refused");
}

#[test]
fn a_parameter_out_of_its_range_is_refused_by_name() {
    type Set = fn(&mut PathfinderParams, f64);
    let broken: [(&str, Set); 11] = [
        ("merge in m", |params, value| params.merge = Metres(value)),
        ("radius in m", |params, value| params.radius = Metres(value)),
        ("corridor in m", |params, value| params.corridor = Metres(value)),
        ("hump in m", |params, value| params.hump = Metres(value)),
        ("blend", |params, value| params.blend = value),
        ("curvature_step in 1/m", |params, value| params.curvature_step = value),
        ("body in m", |params, value| params.body = Metres(value)),
        ("margin in m", |params, value| params.margin = Metres(value)),
        ("comfort in m", |params, value| params.comfort = Metres(value)),
        ("clearance_weight", |params, value| params.clearance_weight = value),
        ("deadline in s", |params, value| params.deadline = Seconds(value)),
    ];
    for (name, set) in broken {
        for value in [-1.0, 1e3, f64::NAN, f64::INFINITY] {
            let mut params = PathfinderParams::default();
            set(&mut params, value);
            let refusal = params.check().expect_err(name).to_string();
            assert!(refusal.contains(name), "{refusal:?} does not name {name:?}");
        }
    }
    let zero = Drivetrain { speed: axle_schema::MetresPerSecond(0.0), ..Drivetrain::default() };
    let ask = PlanAsk { robot: Some(zero), way: WayTask::parse("1,0").expect("a way"), ..PlanAsk::default() };
    refused(&ask, "robot.speed in m/s is out of range: 0");
}

#[test]
fn a_bad_question_is_refused_by_the_name_of_its_fault() {
    let ask = |points: Vec<WayPoint>| PlanAsk { way: WayTask { points }, ..PlanAsk::default() };
    refused(&ask(vec![]), "at least one point");
    refused(&ask(vec![WayPoint::at(f64::NAN, 0.0)]), "x of way point 1 is out of range: NaN");
    refused(&ask(vec![WayPoint::at(0.0, 0.0); 1_000_000]), "way points is too large: 1000000");
    let from = |start| PlanAsk { start: Some(start), ..ask(vec![WayPoint::at(1.0, 0.0)]) };
    refused(&from(Pose::new(f64::INFINITY, 0.0, 0.0)), "x of the start in m is out of range: inf");
    refused(&from(Pose::new(0.0, -1e6, 0.0)), "y of the start in m is out of range: -1000000");
    refused(&from(Pose::new(0.0, 0.0, f64::NAN)), "heading of the start in rad is out of range: NaN");
    let map = PlanAsk { strategy: Some(PlanStrategy::Map), ..ask(vec![WayPoint::at(1.0, 0.0)]) };
    refused(&map, "map is missing: the strategy map needs one");
    // Two runs announce it all, and nothing of that size is ever made.
    let huge = MapData { width: 20_000, height: 20_000, runs: vec![0, 399_999_999, 100, 1], ..small() };
    let on = |huge: MapData| PlanAsk { map: Some(huge), ..map.clone() };
    refused(&on(huge), "map of 20000 x 20000 cells is too large: 400000000");
    refused(&on(MapData { runs: vec![0, 5], ..small() }), "runs of a map");
    refused(&on(MapData { resolution: Metres(0.0), ..small() }), "resolution of a map");
    refused(&on(MapData { runs: vec![], ..small() }), "runs of a map is missing");
    let many = vec![WayPoint::at(1.0, 0.5); MOST_ON_MAP + 1];
    let many = PlanAsk { way: WayTask { points: many }, reorder: true, ..on(small()) };
    refused(&many, "way points to reorder on a map is too large: 65, at most 64");
}

#[test]
fn a_rounded_corner_keeps_its_radius_its_corridor_and_its_room() {
    let corner = |params: &PathfinderParams, way: &str| {
        let plan = planned(params, way);
        let arc = plan.legs.iter().find_map(|leg| match leg.geometry {
            Geometry::Arc { radius, angle } => Some((radius.0, angle.0)),
            _ => None,
        });
        (arc, plan)
    };
    let mut params = given(PlanStrategy::Rounded);
    let quarter = std::f64::consts::FRAC_PI_2;
    // The corridor: an arc round a right corner passes it at R (√2 - 1); 0.2 m allows 0.4828 m.
    let (arc, plan) = corner(&params, "2,0 2,2");
    let (radius, angle) = arc.expect("an arc");
    assert!(
        (radius - 0.2 / (2.0_f64.sqrt() - 1.0)).abs() < 1e-9 && (angle - quarter).abs() < 1e-12,
        "{plan:?}"
    );
    assert!((plan.length.0 - (4.0 - 2.0 * radius + quarter * radius)).abs() < 1e-9);
    // The radius.
    params.corridor = Metres(5.0);
    assert!((corner(&params, "2,0 2,2").0.expect("an arc").0 - 0.5).abs() < 1e-12);
    // The room: the shorter way on both sides, 0.3 m.
    assert!((corner(&params, "2,0 2,-0.3").0.expect("an arc").0 + 0.3).abs() < 1e-9);
    // No room for half the track: turned on the spot, and said.
    let (arc, plan) = corner(&params, "2,0 2,0.1 3,0.1");
    assert!(arc.is_none() && plan.notes[0].contains("2 corners have no room"), "{plan:?}");
    // A point with a heading is visited exactly.
    let plan = planned(&params, "2,0,1 2,2");
    assert!(matches!(plan.legs[1].geometry, Geometry::Turn { .. }), "{plan:?}");
}

#[test]
fn the_speed_of_a_point_is_that_of_the_legs_to_it() {
    for strategy in PlanStrategy::ALL.into_iter().filter(|&strategy| strategy != PlanStrategy::Map) {
        let mut way = WayTask::parse("1,0 1,1 2,2").expect("a way");
        way.points[2].speed = Some(axle_schema::MetresPerSecond(0.2));
        let plan =
            Pathfinder::answer(&given(strategy), &PlanAsk { way, ..PlanAsk::default() }).expect("a plan");
        assert!(plan.legs.iter().all(|leg| (leg.point == 2) == leg.speed.is_some()), "{strategy}: {plan:?}");
        assert!(plan.time.expect("an estimate").0 > plan.length.0 / 0.6, "{strategy}: {plan:?}");
        assert_eq!(plan.strategy, Some(strategy));
    }
}

#[test]
fn an_order_is_shorter_and_says_which_point_is_which() {
    let way = WayTask::parse("5,0 1,0 4,0 2,0 3,0").expect("a way");
    let ask = PlanAsk { way, reorder: true, ..PlanAsk::default() };
    let plan = Pathfinder::answer(&PathfinderParams::default(), &ask).expect("a plan");
    assert_eq!(plan.order, [1, 3, 4, 2, 0]);
    assert_eq!(plan.legs.iter().map(|leg| leg.point).collect::<Vec<_>>(), [1, 3, 4, 2, 0]);
    assert!((plan.length.0 - 5.0).abs() < 1e-12);
}

/// Every strategy that needs no map.
fn without_map() -> impl Strategy<Value = PlanStrategy> {
    prop::sample::select(&PlanStrategy::ALL[..5])
}

proptest! {
    #[test]
    fn every_plan_ends_at_the_last_point_with_its_heading(
        strategy in without_map(),
        coordinates in prop::collection::vec((-20.0..20.0, -20.0..20.0, prop::option::of(-7.0..7.0)), 1..30),
        start in (-20.0..20.0, -20.0..20.0, -10.0..10.0),
        (radius, corridor, hump) in (0.02..3.0, 0.0..2.0, 0.0..2.0),
    ) {
        let points: Vec<WayPoint> = coordinates
            .into_iter()
            .map(|(x, y, heading)| WayPoint { heading: heading.map(Radians), ..WayPoint::at(x, y) })
            .collect();
        let last = points[points.len() - 1];
        let mut params = given(strategy);
        (params.radius, params.corridor, params.hump) = (Metres(radius), Metres(corridor), Metres(hump));
        params.merge = Metres(0.0);
        let start = Pose::new(start.0, start.1, start.2);
        let ask = PlanAsk { way: WayTask { points }, start: Some(start), ..PlanAsk::default() };
        let plan = Pathfinder::answer(&params, &ask).expect("a plan");
        let end = end(&plan);
        prop_assert!(last.distance(end).0 < 1e-8, "{strategy} ends at {end:?}");
        if let Some(heading) = last.heading {
            let off = Radians(end.heading.0 - heading.0).wrapped().0;
            prop_assert!(off.abs() < 1e-8, "{strategy} ends at {end:?}");
        }
        prop_assert!(plan.legs.iter().all(|leg| leg.geometry.check().is_ok()));
        prop_assert!(plan.time.expect("an estimate").0.is_finite() && plan.check().is_ok());
        let sum: Metres = plan.legs.iter().map(|leg| leg.geometry.length()).sum();
        prop_assert!((sum - plan.length).abs().0 < 1e-9);
    }

    #[test]
    fn rounding_passes_every_corner_within_its_corridor_and_is_no_longer(
        smooth in any::<bool>(),
        coordinates in prop::collection::vec((-9.0..9.0, -9.0..9.0), 2..12),
        (radius, corridor) in (0.2..3.0, 0.01..1.0),
    ) {
        let points: Vec<WayPoint> = coordinates.iter().map(|&(x, y)| WayPoint::at(x, y)).collect();
        let mut params = given(if smooth { PlanStrategy::Smooth } else { PlanStrategy::Rounded });
        (params.radius, params.corridor, params.merge) = (Metres(radius), Metres(corridor), Metres(0.0));
        let ask = PlanAsk { way: WayTask { points: points.clone() }, ..PlanAsk::default() };
        let round = Pathfinder::answer(&params, &ask).expect("a plan");
        let straight = Pathfinder::answer(&given(PlanStrategy::TurnAndGo), &ask).expect("a plan");
        prop_assert!(round.length.0 <= straight.length.0 + 1e-9);
        // Poses along the plan; an arc is looked at in eight parts.
        let mut at = round.start;
        let mut nearest = vec![f64::INFINITY; points.len()];
        for leg in &round.legs {
            for part in 0..=8 {
                let share = f64::from(part) / 8.0;
                let part = match leg.geometry {
                    Geometry::Line { length } => Geometry::Line { length: length * share },
                    Geometry::Turn { angle } => Geometry::Turn { angle: angle * share },
                    Geometry::Arc { radius, angle } => Geometry::Arc { radius, angle: angle * share },
                };
                let pose = part.end_from(at);
                for (nearest, point) in nearest.iter_mut().zip(&points) {
                    *nearest = nearest.min(point.distance(pose).0);
                }
            }
            at = leg.geometry.end_from(at);
        }
        for (nearest, point) in nearest.iter().zip(&points) {
            // The eighths of a wide arc may miss the very point that is nearest.
            prop_assert!(*nearest <= corridor + 0.02 * radius, "{nearest} m from {point:?}");
        }
    }
}
