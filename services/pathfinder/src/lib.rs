//! Pathfinder: way points to geometries.
//!
//! Hears [`PlanAsk`] (the points, where the robot is, how the way shall be made, perhaps a map), says [`Plan`] (turns,
//! lines and arcs, one after the other, with their length, an estimate of the time, and the clearance on the map). It is
//! the functional service between the user's task and Pathdriver (paper, section II). It plans in the frame of the
//! points and knows nothing of wheel speeds.
//!
//! What cannot be planned is refused with the number of the point and the reason; nothing is dropped in silence. Each
//! strategy is one file; a new one is that file, a variant of [`PlanStrategy`] and a line in [`plan`].

use axle_maps::Unknown;
use axle_schema::contract::{Bounds, Functional, Params};
use axle_schema::refusal::within;
use axle_schema::way::MAX_COORDINATE;
use axle_schema::{
    Drivetrain, Message as _, Metres, Plan, PlanAsk, PlanStrategy, Pose, Refusal, Seconds, WayPoint,
};
use serde::{Deserialize, Serialize};

mod arcs;
mod cells;
mod corner;
mod dubins;
mod estimate;
mod map;
mod order;
mod rounded;
mod search;
mod smooth;
mod terrain;
mod turn_and_go;
mod way;

pub use order::EXACT;
pub use search::Watch;
pub use terrain::Terrain;
use way::Way;

/// The most points that may be reordered on a map: each pair of them is a search.
pub const MOST_ON_MAP: usize = 64;

/// Parameters of Pathfinder: `deploy/params/pathfinder.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathfinderParams {
    /// How the way is made of geometries, where the question does not say.
    pub strategy: PlanStrategy,
    /// A point closer than this to where the robot already is counts as visited without moving; 0 to 1 m.
    pub merge: Metres,
    /// Largest radius of a rounded corner, and the radius of every curve of `dubins`; 0.01 to 100 m.
    pub radius: Metres,
    /// How far a rounded corner may stay away from its way point; 0 to 100 m.
    pub corridor: Metres,
    /// How far an arc to a point may swing out from the straight line; 0 to 100 m.
    pub hump: Metres,
    /// The share of a corner of `smooth` that is clothoid; 0.05 to 1.
    pub blend: f64,
    /// The largest step of curvature along a corner of `smooth`; 0.05 to 100 /m.
    pub curvature_step: f64,
    /// Radius of the circle around the middle of the axle that holds the whole robot, where the question does not say;
    /// 0 to 10 m. The pilot says its own `radius` with every question.
    pub body: Metres,
    /// Room that a way on a map leaves beside the robot where it can; 0 to 10 m.
    pub margin: Metres,
    /// Closer to an obstacle than this a way on a map costs more; 0 to 10 m beside the robot.
    pub comfort: Metres,
    /// How much more, in lengths of way, right at an obstacle; 0 to 100. 0 finds the shortest way.
    pub clearance_weight: f64,
    /// Whether the robot may drive where nobody knows what is there.
    pub unknown_is_free: bool,
    /// How long an answer may take, where the question does not say; 0.001 to 60 s.
    pub deadline: Seconds,
    /// The robot that drives, where the question does not describe it.
    pub robot: Drivetrain,
}

impl Default for PathfinderParams {
    fn default() -> Self {
        Self {
            strategy: PlanStrategy::default(),
            merge: Metres(1e-3),
            radius: Metres(0.5),
            corridor: Metres(0.2),
            hump: Metres(0.2),
            blend: 0.6,
            curvature_step: 0.5,
            body: Drivetrain::BODY,
            margin: Metres(0.05),
            comfort: Metres(0.3),
            clearance_weight: 1.0,
            unknown_is_free: false,
            deadline: Seconds(2.5),
            robot: Drivetrain::default(),
        }
    }
}

impl Bounds for PathfinderParams {
    fn check(&self) -> Result<(), Refusal> {
        within("merge in m", self.merge.0, 0.0, 1.0)?;
        within("radius in m", self.radius.0, 0.01, 100.0)?;
        within("corridor in m", self.corridor.0, 0.0, 100.0)?;
        within("hump in m", self.hump.0, 0.0, 100.0)?;
        within("blend", self.blend, 0.05, 1.0)?;
        within("curvature_step in 1/m", self.curvature_step, 0.05, 100.0)?;
        within("body in m", self.body.0, 0.0, 10.0)?;
        within("margin in m", self.margin.0, 0.0, 10.0)?;
        within("comfort in m", self.comfort.0, 0.0, 10.0)?;
        within("clearance_weight", self.clearance_weight, 0.0, 100.0)?;
        within("deadline in s", self.deadline.0, 1e-3, 60.0)?;
        self.robot.check()
    }
}

impl Params for PathfinderParams {
    const FILE: &'static str = include_str!("../../../deploy/params/pathfinder.toml");
}

impl PathfinderParams {
    /// What cells are that nobody knows anything of.
    #[must_use]
    pub const fn unknown(&self) -> Unknown {
        if self.unknown_is_free { Unknown::Free } else { Unknown::Blocked }
    }
    /// How a question shall be answered.
    #[must_use]
    pub fn strategy(&self, ask: &PlanAsk) -> PlanStrategy {
        ask.strategy.unwrap_or(self.strategy)
    }
}

/// The service that finds a path.
#[derive(Clone, Copy, Debug)]
pub struct Pathfinder;

impl Functional for Pathfinder {
    type Params = PathfinderParams;
    type Ask = PlanAsk;
    type Answer = Plan;

    fn answer(params: &PathfinderParams, ask: &PlanAsk) -> Result<Plan, Refusal> {
        params.check()?;
        ask.check()?;
        let terrain = ask.map.as_ref().map(|map| Terrain::of(map, params.unknown())).transpose()?;
        plan(params, ask, terrain.as_ref(), &mut |_| Ok(()))
    }
}

/// What the strategies are given.
pub(crate) struct Task<'a> {
    params: &'a PathfinderParams,
    robot: Drivetrain,
    body: Metres,
}

/// Answers one question, on a map that was made ready before; `watch` hears how far a long search is, and may end it.
///
/// # Errors
/// A [`Refusal`] that says what is wrong with the question, why there is no way, or what `watch` ended it with.
pub fn plan(
    params: &PathfinderParams,
    ask: &PlanAsk,
    terrain: Option<&Terrain>,
    watch: Watch<'_>,
) -> Result<Plan, Refusal> {
    params.check()?;
    ask.check()?;
    let start = ask.start.unwrap_or_default();
    check_start(start)?;
    let (robot, body) = (ask.robot.unwrap_or(params.robot), ask.body.unwrap_or(params.body));
    let task = Task { params, robot, body };
    let strategy = params.strategy(ask);
    let mut points: Vec<(usize, WayPoint)> = ask.way.points.iter().copied().enumerate().collect();
    let map = || {
        terrain.ok_or_else(|| {
            let hint = "the strategy map needs one: give it with the question, or start `axle run map`";
            Refusal::missing("map", hint)
        })
    };
    let mut order = Vec::new();
    if ask.reorder {
        let on = if strategy == PlanStrategy::Map { Some(map()?) } else { None };
        points = reordered(&task, on, start, &points, watch)?;
        #[allow(clippy::cast_possible_truncation, reason = "at most MAX_POINTS points")]
        order.extend(points.iter().map(|(index, _)| *index as u32));
    }
    let mut way = Way::new(start);
    match strategy {
        PlanStrategy::TurnAndGo => turn_and_go::plan(&mut way, params.merge, &points),
        PlanStrategy::Rounded => rounded::plan(&mut way, &task, &points),
        PlanStrategy::Arcs => arcs::plan(&mut way, &task, &points),
        PlanStrategy::Smooth => smooth::plan(&mut way, &task, &points),
        PlanStrategy::Dubins => dubins::plan(&mut way, &task, &points),
        PlanStrategy::Map => map::plan(&mut way, &task, map()?, &points, watch)?,
    }
    let clearance =
        terrain.map(|terrain| map::clearance(terrain, start, way.legs(), body, watch)).transpose()?;
    let time = Some(estimate::time(way.legs(), &robot));
    Ok(Plan { strategy: Some(strategy), time, clearance, order, ..way.into_plan() })
}

/// The points in a short order: by their distances on the map, or straight.
fn reordered(
    task: &Task<'_>,
    terrain: Option<&Terrain>,
    start: Pose,
    points: &[(usize, WayPoint)],
    watch: Watch<'_>,
) -> Result<Vec<(usize, WayPoint)>, Refusal> {
    let order = if let Some(terrain) = terrain {
        if points.len() > MOST_ON_MAP {
            let what = "way points to reorder on a map".into();
            return Err(Refusal::TooLarge { what, got: points.len() as u64, limit: MOST_ON_MAP as u64 });
        }
        let table = map::distances(task, terrain, start, points, watch)?;
        let between = |a: usize, b: usize| table.get(a).and_then(|row| row.get(b)).copied().unwrap_or(0.0);
        order::order(points.len(), between, watch)?
    } else {
        let places: Vec<Pose> = std::iter::once(start)
            .chain(points.iter().map(|(_, point)| Pose { x: point.x, y: point.y, ..start }))
            .collect();
        let between = |a: usize, b: usize| match (places.get(a), places.get(b)) {
            (Some(a), Some(b)) => a.distance(*b).0,
            _ => 0.0,
        };
        order::order(points.len(), between, watch)?
    };
    Ok(order.into_iter().filter_map(|index| points.get(index).copied()).collect())
}

/// The start obeys the limits of a way point, so that every line of the plan is one that [`Plan`] may carry.
fn check_start(start: Pose) -> Result<(), Refusal> {
    within("x of the start in m", start.x.0, -MAX_COORDINATE, MAX_COORDINATE)?;
    within("y of the start in m", start.y.0, -MAX_COORDINATE, MAX_COORDINATE)?;
    within("heading of the start in rad", start.heading.0, -1e4, 1e4)
}

#[cfg(test)]
mod tests;
