//! Courses: what the robot shall drive. All of them stand in one table.

use axle_emulator::Random;
use axle_pathdriver::{Pathdriver, PathdriverParams};
use axle_pathfinder::{Pathfinder, PathfinderParams};
use axle_schema::contract::Functional as _;
use axle_schema::{
    Drive, DriveAsk, Geometry, Leg, Metres, Plan, PlanAsk, Pose, Radians, Refusal, WayPoint, WayTask,
};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI, TAU};

/// One course.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// Its name.
    pub name: &'static str,
    /// What it looks like, in a few words.
    pub about: &'static str,
    way: Way,
}

/// How a course is told.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// By points that Pathfinder plans, as a person types them.
    Points(&'static str),
    /// By the geometries themselves.
    Legs(&'static [Geometry]),
    /// By points that are drawn from the seed of the run.
    Random,
}

/// All courses.
pub const COURSES: &[Course] = &[
    Course { name: "straight", about: "3 m straight on", way: Way::Points("3,0") },
    Course { name: "turn", about: "150° on the spot", way: Way::Legs(&[turn(PI * 5.0 / 6.0)]) },
    Course {
        name: "arc",
        about: "a quarter of a circle of 1 m to the left",
        way: Way::Legs(&[arc(1.0, FRAC_PI_2)]),
    },
    Course {
        name: "square",
        about: "1 m by 1 m, on the spot at the corners",
        way: Way::Points("1,0 1,1 0,1 0,0"),
    },
    Course {
        name: "slalom",
        about: "five arcs of 0.6 m, left and right",
        way: Way::Legs(&[
            arc(0.6, FRAC_PI_3),
            arc(-0.6, -2.0 * FRAC_PI_3),
            arc(0.6, 2.0 * FRAC_PI_3),
            arc(-0.6, -2.0 * FRAC_PI_3),
            arc(0.6, FRAC_PI_3),
        ]),
    },
    Course {
        name: "eight",
        about: "a circle of 0.5 m to the left, and one to the right",
        way: Way::Legs(&[arc(0.5, TAU), arc(-0.5, -TAU)]),
    },
    Course {
        name: "aisle",
        about: "5 m down a warehouse aisle, over to the next, and 5 m back",
        way: Way::Points("5,0 5,1.2 0,1.2"),
    },
    Course { name: "random", about: "five points in 3 m by 3 m, others in every run", way: Way::Random },
];

const fn turn(angle: f64) -> Geometry {
    Geometry::Turn { angle: Radians(angle) }
}
const fn arc(radius: f64, angle: f64) -> Geometry {
    Geometry::Arc { radius: Metres(radius), angle: Radians(angle) }
}

/// A course as the services are told it.
#[derive(Clone, Debug, PartialEq)]
pub struct Brief {
    /// Its geometries.
    pub plan: Plan,
    /// Its movements.
    pub drive: Drive,
}

impl Course {
    /// The course of this name.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        COURSES.iter().find(|course| course.name == name)
    }

    /// Plans the course with Pathfinder and Pathdriver and their default parameters; `seed` is that of the run.
    ///
    /// # Errors
    /// What the planners refuse.
    pub fn brief(&self, seed: u64) -> Result<Brief, Refusal> {
        self.brief_with(seed, &PathdriverParams::default())
    }

    /// The same, driven in another manner.
    ///
    /// # Errors
    /// What the planners refuse.
    pub fn brief_with(&self, seed: u64, params: &PathdriverParams) -> Result<Brief, Refusal> {
        let plan = match self.way {
            Way::Points(way) => return Brief::along(WayTask::parse(way)?, params),
            Way::Random => {
                let way = WayTask { points: scattered(&mut Random::new(seed, 20)) };
                return Brief::along(way, params);
            }
            Way::Legs(geometries) => {
                let leg = |geometry: &Geometry| Leg { geometry: *geometry, point: 0, speed: None };
                let legs: Vec<Leg> = geometries.iter().map(leg).collect();
                let length = legs.iter().map(|leg| leg.geometry.length()).sum();
                Plan { legs, length, ..Plan::default() }
            }
        };
        Brief::of(plan, params)
    }
}

impl Brief {
    /// Plans a way from the origin with Pathfinder and its default parameters, and Pathdriver.
    ///
    /// # Errors
    /// What the planners refuse.
    pub fn along(way: WayTask, params: &PathdriverParams) -> Result<Self, Refusal> {
        Self::of(
            Pathfinder::answer(&PathfinderParams::default(), &PlanAsk { way, ..PlanAsk::default() })?,
            params,
        )
    }

    /// The movements for a plan.
    pub(crate) fn of(plan: Plan, params: &PathdriverParams) -> Result<Self, Refusal> {
        let ask = DriveAsk { legs: plan.legs.clone(), ..DriveAsk::default() };
        Ok(Self { drive: Pathdriver::answer(params, &ask)?, plan })
    }

    /// Where the course ends.
    #[must_use]
    pub fn goal(&self) -> Pose {
        self.plan.legs.iter().fold(self.plan.start, |pose, leg| leg.geometry.end_from(pose))
    }
}

/// Five points, each at least half a metre from the one before.
fn scattered(random: &mut Random) -> Vec<WayPoint> {
    let mut at = WayPoint::at(0.0, 0.0);
    let mut next = || loop {
        let point = WayPoint::at(3.0 * random.uniform() - 1.5, 3.0 * random.uniform() - 1.5);
        if (point.x - at.x).0.hypot((point.y - at.y).0) >= 0.5 {
            at = point;
            break point;
        }
    };
    (0..5).map(|_| next()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_course_is_planned_and_its_movements_end_where_its_geometries_end() {
        let track = axle_schema::Drivetrain::default().track;
        for course in COURSES {
            let brief = course.brief(5).expect(course.name);
            let moved = |pose: Pose, dwm: &axle_schema::Dwm| dwm.pose_at(pose, track, dwm.duration());
            let end = brief.drive.dwms.iter().fold(brief.plan.start, moved);
            let goal = brief.goal();
            assert!(end.distance(goal).0 < 1e-9, "{}: {end:?}, not {goal:?}", course.name);
            assert!((end.heading - goal.heading).0.abs() < 1e-9, "{}: {end:?}, not {goal:?}", course.name);
            assert_eq!(Course::find(course.name), Some(course));
        }
    }

    #[test]
    fn a_random_course_is_another_one_for_another_seed() {
        let course = Course::find("random").expect("a course");
        let plan = |seed| course.brief(seed).expect("a plan").plan;
        assert_eq!(plan(1), plan(1));
        assert_ne!(plan(1), plan(2));
    }
}
