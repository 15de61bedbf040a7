//! What the functional services are asked and answer: from way points to geometries to movements.

use crate::codec::Message;
use crate::contract::Bounds as _;
use crate::drivetrain::Drivetrain;
use crate::dwm::MAX_WHEEL_SPEED;
use crate::id::TaskId;
use crate::map::MapData;
use crate::refusal::within;
use crate::way::MAX_POINTS;
use crate::{Dwm, Geometry, Metres, MetresPerSecond, Pose, Refusal, Seconds, Sides, WayTask};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The most geometries a plan may have: a turn, a line and a final turn for every way point.
pub const MAX_LEGS: usize = 3 * MAX_POINTS;
/// The most movements a drive may have: speeding up, cruising and braking on every leg.
pub const MAX_DWMS: usize = 3 * MAX_LEGS;
/// The most remarks a plan may carry, and the most letters of one.
pub const MAX_NOTES: usize = 16;

/// How a way is made of geometries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlanStrategy {
    /// Turn on the spot towards the next point, then go straight to it: the simplest way of the paper.
    #[default]
    TurnAndGo,
    /// Corners become arcs (Lucas, "Rounding a Corner").
    Rounded,
    /// An arc to every point, as long as it does not swing too far from the straight line (the warehouse's way).
    Arcs,
    /// Corners become clothoids: the curvature grows and falls in small steps.
    Smooth,
    /// The shortest way with a smallest radius and a heading at every point (Dubins).
    Dubins,
    /// Around the obstacles of a map.
    Map,
}

impl PlanStrategy {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::TurnAndGo, Self::Rounded, Self::Arcs, Self::Smooth, Self::Dubins, Self::Map];

    /// Its name in questions, parameters and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::TurnAndGo => "turn-and-go",
            Self::Rounded => "rounded",
            Self::Arcs => "arcs",
            Self::Smooth => "smooth",
            Self::Dubins => "dubins",
            Self::Map => "map",
        }
    }

    /// The strategy of that name.
    ///
    /// # Errors
    /// [`Refusal::Unknown`], with the names that there are.
    pub fn of_name(name: &str) -> Result<Self, Refusal> {
        Self::ALL.into_iter().find(|strategy| strategy.name() == name).ok_or_else(|| Refusal::Unknown {
            what: "strategy of Pathfinder".into(),
            got: name.chars().take(40).collect(),
            known: Self::ALL.map(Self::name).join(", "),
        })
    }
}
impl fmt::Display for PlanStrategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Asks Pathfinder for a plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlanAsk {
    /// The points to visit.
    pub way: WayTask,
    /// Where the robot is; left out, it is where odometry begins: (0, 0), heading 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<Pose>,
    /// How the way is made of geometries; left out, as Pathfinder's parameters say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strategy: Option<PlanStrategy>,
    /// Whether the points may be visited in another order, to make the way short.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reorder: bool,
    /// The map to plan on; left out, the one of the map service where the strategy needs one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapData>,
    /// The robot that will drive; left out, the one of Pathfinder's own parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<Drivetrain>,
    /// Radius of the circle around the middle of the axle that holds the whole robot, 0 to 10 m; left out, as
    /// Pathfinder's parameters say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<Metres>,
    /// Pathfinder gives up after this time, 0.001 to 60 s; left out, as its parameters say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deadline: Option<Seconds>,
    /// Names the question in its progress and its cancellation; left out, there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<TaskId>,
}

/// How far a search is that takes long, a few times a second.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanProgress {
    /// The question.
    pub id: TaskId,
    /// The share of the way that has been found, 0 to 1; it need not grow evenly.
    #[serde(serialize_with = "crate::unit::finite", deserialize_with = "crate::unit::deserialize_finite")]
    pub fraction: f64,
    /// Time since the question came.
    pub elapsed: Seconds,
}
impl Message for PlanProgress {
    const NAME: &'static str = "PlanProgress";
    const LIMIT: usize = 128;
    fn check(&self) -> Result<(), Refusal> {
        within("fraction", self.fraction, 0.0, 1.0)
    }
}

/// Pathfinder's answer: the geometries to drive, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Where the first leg begins.
    pub start: Pose,
    /// The pieces of the path; none when there is nothing to drive.
    pub legs: Vec<Leg>,
    /// Path of the middle of the axle.
    pub length: Metres,
    /// How the way was made of geometries.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strategy: Option<PlanStrategy>,
    /// How long the robot will need, estimated: within its limits, at rest only where it must be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<Seconds>,
    /// How much room is left between the robot and the obstacles of the map where it is narrowest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clearance: Option<Metres>,
    /// The numbers of the way points, counted from 0, as they are visited, where the question left the order open.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub order: Vec<u32>,
    /// What the asker should know, in sentences: a repeated point, for example.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// One piece of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Leg {
    /// Its shape.
    pub geometry: Geometry,
    /// The way point it leads to, counted from 0.
    pub point: u32,
    /// The largest speed of the middle of the axle on this leg, if the way point gave one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed: Option<MetresPerSecond>,
}

/// How the speeds of a plan are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Rest after every leg: exact, no jump of a wheel speed, slow (model.md 4.4, P1).
    #[default]
    Stop,
    /// Go on from leg to leg as fast as the limits allow; [`Joints`] says how legs of different curvature meet.
    Continuous,
}

/// How legs of different curvature meet without a rest; wheel speeds cannot be continuous there (model.md 4.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Joints {
    /// By a jump of the wheel speeds that has a bound; the path is kept (P2).
    #[default]
    Jump,
    /// By a clothoid, in whose course the wheels change their speeds at their largest acceleration; the path is left
    /// by an offset that has a bound (P3).
    Blend,
}

/// How a plan shall be driven; what is left out is as in Pathdriver's own parameters. Closed, as parameters are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manner {
    /// How the speeds are chosen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strategy: Option<Strategy>,
    /// How legs of different curvature meet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joints: Option<Joints>,
    /// The most that a wheel speed may jump, 0 to 1 m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jump: Option<MetresPerSecond>,
    /// The most that one blend may move the rest of the path aside, 0 to 0.1 m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<Metres>,
}

impl Manner {
    /// The largest jump that may be asked for, m/s.
    pub const MAX_JUMP: f64 = 1.0;
    /// The largest offset that may be asked for, m.
    pub const MAX_OFFSET: f64 = 0.1;

    fn check(&self) -> Result<(), Refusal> {
        within("manner.jump in m/s", self.jump.unwrap_or_default().0, 0.0, Self::MAX_JUMP)?;
        within("manner.offset in m", self.offset.unwrap_or_default().0, 0.0, Self::MAX_OFFSET)
    }
}

/// Asks Pathdriver for movements.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveAsk {
    /// The pieces of the path.
    pub legs: Vec<Leg>,
    /// Wheel speeds at the beginning; left out, the robot stands.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speeds: Option<Sides<MetresPerSecond>>,
    /// The robot that will drive; left out, the one of Pathdriver's own parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<Drivetrain>,
    /// How it shall be driven; left out, as Pathdriver's own parameters say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub manner: Option<Manner>,
}

/// Pathdriver's answer: the movements to make, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Drive {
    /// The movements; the last one ends at rest.
    pub dwms: Vec<Dwm>,
    /// How many movements each leg was made into, in the order of the legs.
    pub counts: Vec<u32>,
    /// The largest jump of a wheel speed between two movements; 0 where the answer allows none.
    pub jump: MetresPerSecond,
    /// The farthest that blends have moved the path aside of the plan's own; left out where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<Metres>,
    /// Duration of all movements.
    pub duration: Seconds,
}

fn check_legs(legs: &[Leg]) -> Result<(), Refusal> {
    limit_list("legs of a plan", legs.len(), MAX_LEGS)?;
    for leg in legs {
        leg.geometry.check()?;
        if let Some(speed) = leg.speed {
            within("speed of a leg", speed.0, 1e-3, MAX_WHEEL_SPEED)?;
        }
    }
    Ok(())
}

/// Refuses a list that is longer than `limit`.
pub(crate) fn limit_list(what: &str, length: usize, limit: usize) -> Result<(), Refusal> {
    if length <= limit {
        Ok(())
    } else {
        Err(Refusal::TooLarge { what: what.into(), got: length as u64, limit: limit as u64 })
    }
}

impl Message for PlanAsk {
    const NAME: &'static str = "PlanAsk";
    const LIMIT: usize = 256 * 1024 + MapData::LIMIT;
    fn check(&self) -> Result<(), Refusal> {
        self.robot.map_or(Ok(()), |robot| robot.check())?;
        self.map.as_ref().map_or(Ok(()), Message::check)?;
        self.body.map_or(Ok(()), |body| within("body in m", body.0, 0.0, 10.0))?;
        self.deadline.map_or(Ok(()), |deadline| within("deadline in s", deadline.0, 1e-3, 60.0))?;
        self.way.check()
    }
}
impl Message for Plan {
    const NAME: &'static str = "Plan";
    const LIMIT: usize = 1024 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("notes of a plan", self.notes.len(), MAX_NOTES)?;
        limit_list("order of a plan", self.order.len(), MAX_POINTS)?;
        check_legs(&self.legs)
    }
}
impl Message for DriveAsk {
    const NAME: &'static str = "DriveAsk";
    const LIMIT: usize = 1024 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        self.robot.map_or(Ok(()), |robot| robot.check())?;
        self.manner.map_or(Ok(()), |manner| manner.check())?;
        let speeds = self.speeds.unwrap_or_default();
        for (side, speed) in [("left", speeds.left), ("right", speeds.right)] {
            let what = format!("{side} wheel speed at the beginning in m/s");
            within(&what, speed.0, -MAX_WHEEL_SPEED, MAX_WHEEL_SPEED)?;
        }
        check_legs(&self.legs)
    }
}
impl Message for Drive {
    const NAME: &'static str = "Drive";
    const LIMIT: usize = 4 * 1024 * 1024;
    fn check(&self) -> Result<(), Refusal> {
        limit_list("movements of a drive", self.dwms.len(), MAX_DWMS)?;
        for dwm in &self.dwms {
            within("wheel speed of a movement in m/s", dwm.peak_speed().0, 0.0, MAX_WHEEL_SPEED)?;
        }
        limit_list("legs of a drive", self.counts.len(), MAX_LEGS)
    }
}
