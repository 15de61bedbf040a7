//! Pathfinder: way points to geometries.
//!
//! Hears [`PlanAsk`] (the points, and where the robot is), says [`Plan`] (turns and lines, one after the other). It is
//! the functional service between the user's task and Pathdriver (paper, section II). It plans in the frame of the
//! points and knows nothing of speeds, wheels or obstacles.
//!
//! What cannot be planned is refused with the number of the point and the name of the field; nothing is dropped in
//! silence. Each strategy is one file; a new one is that file, a variant of [`Strategy`] and a line in `answer`.

use axle_schema::contract::{Bounds, Functional, Params};
use axle_schema::refusal::within;
use axle_schema::way::MAX_COORDINATE;
use axle_schema::{Message as _, Metres, Plan, PlanAsk, Pose, Refusal};
use serde::{Deserialize, Serialize};

mod turn_and_go;

/// How the way is made of geometries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Turn on the spot towards the next point, then go straight to it: the simplest way of the paper.
    #[default]
    TurnAndGo,
}

/// Parameters of Pathfinder: `deploy/params/pathfinder.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PathfinderParams {
    /// How the way is made of geometries.
    pub strategy: Strategy,
    /// A point closer than this to where the robot already is counts as visited without moving; 0 to 1 m.
    pub merge: Metres,
}

impl Default for PathfinderParams {
    fn default() -> Self {
        Self { strategy: Strategy::default(), merge: Metres(1e-3) }
    }
}

impl Bounds for PathfinderParams {
    fn check(&self) -> Result<(), Refusal> {
        within("merge in m", self.merge.0, 0.0, 1.0)
    }
}

impl Params for PathfinderParams {
    const FILE: &'static str = include_str!("../../../deploy/params/pathfinder.toml");
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
        let start = ask.start.unwrap_or_default();
        check_start(start)?;
        Ok(match params.strategy {
            Strategy::TurnAndGo => turn_and_go::plan(params.merge, start, &ask.way.points),
        })
    }
}

/// The start obeys the limits of a way point, so that every line of the plan is one that [`Plan`] may carry.
fn check_start(start: Pose) -> Result<(), Refusal> {
    within("x of the start in m", start.x.0, -MAX_COORDINATE, MAX_COORDINATE)?;
    within("y of the start in m", start.y.0, -MAX_COORDINATE, MAX_COORDINATE)?;
    within("heading of the start in rad", start.heading.0, -1e4, 1e4)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{WayPoint, WayTask};

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
        for merge in [-1.0, 2.0, f64::NAN] {
            let params = PathfinderParams { merge: Metres(merge), ..PathfinderParams::default() };
            assert!(params.check().expect_err("merge is wrong").to_string().contains("merge in m"));
        }
    }

    #[test]
    fn a_bad_question_is_refused_by_the_name_of_its_fault() {
        let ask = |points: Vec<WayPoint>| PlanAsk { way: WayTask { points }, start: None };
        refused(&ask(vec![]), "at least one point");
        refused(&ask(vec![WayPoint::at(f64::NAN, 0.0)]), "x of way point 1 is out of range: NaN");
        refused(&ask(vec![WayPoint::at(0.0, 0.0); 4097]), "way points is too large: 4097");
        let from = |start| PlanAsk { start: Some(start), ..ask(vec![WayPoint::at(1.0, 0.0)]) };
        refused(&from(Pose::new(f64::INFINITY, 0.0, 0.0)), "x of the start in m is out of range: inf");
        refused(&from(Pose::new(0.0, -1e6, 0.0)), "y of the start in m is out of range: -1000000");
        refused(&from(Pose::new(0.0, 0.0, f64::NAN)), "heading of the start in rad is out of range: NaN");
    }
}
