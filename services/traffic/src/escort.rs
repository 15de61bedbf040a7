//! The escort: the side of one robot. It knows the way in pieces, claims them, and says which stage may be driven.
//!
//! A stage goes from where the robot stands to the end of what it may drive, or to the next loading point. There the
//! robot rests, and a loading point is left when a person has confirmed. Each stage is aimed anew from where the robot
//! really is, so that its errors do not add up. Without Traffic an escort gives everything to itself.

use crate::piece::{aim, cut, join, pieces};
use axle_schema::traffic::{Claim, ClaimedWay, Clearance, Wait};
use axle_schema::{Geometry, Leg, Metres, Plan, Pose, Refusal, RobotId, TaskId};
use std::ops::Range;

/// A robot farther than this from the end of a piece has not passed it, m.
const NEAR: f64 = 1.0;

/// The way of one robot with one task.
#[derive(Clone, Debug)]
pub struct Escort {
    robot: RobotId,
    task: TaskId,
    radius: Metres,
    legs: Vec<Leg>,
    ranges: Vec<Range<usize>>,
    /// Where the pieces end; the first is where the way begins.
    ends: Vec<Pose>,
    /// The pieces, from 1, behind which a person must confirm; 0 is the beginning.
    stops: Vec<usize>,
    confirmed: bool,
    told: bool,
    passed: usize,
    until: usize,
    /// The piece at which the stage ends that is being driven.
    stage: Option<usize>,
    waits: Vec<Wait>,
}

impl Escort {
    /// The way of a plan, in pieces of at most `longest`; `confirm` are the numbers, from 1, of its loading points.
    ///
    /// # Errors
    /// Refuses a way of too many pieces.
    pub fn new(
        robot: RobotId,
        task: TaskId,
        plan: &Plan,
        confirm: &[u32],
        (radius, longest): (Metres, Metres),
    ) -> Result<Self, Refusal> {
        let legs = cut(&plan.legs, longest)?;
        let ranges = pieces(&legs);
        let mut ends = vec![plan.start];
        let mut at = plan.start;
        for range in &ranges {
            at = legs[range.clone()].iter().fold(at, |pose, leg| leg.geometry.end_from(pose));
            ends.push(at);
        }
        // A point that needs no leg of its own is reached with the one before it.
        let after = |point: u32| {
            ranges.iter().rposition(|range| legs[range.end - 1].point < point).map_or(0, |index| index + 1)
        };
        let mut stops: Vec<usize> = confirm.iter().map(|&point| after(point)).collect();
        stops.sort_unstable();
        stops.dedup();
        Ok(Self {
            robot,
            task,
            radius,
            legs,
            ranges,
            ends,
            stops,
            confirmed: false,
            told: false,
            passed: 0,
            until: 0,
            stage: None,
            waits: Vec::new(),
        })
    }

    /// A robot that only stands somewhere, and is not to be driven into.
    #[must_use]
    pub const fn parked(robot: RobotId, task: TaskId, at: Pose, radius: Metres) -> Claim {
        let way = Some(ClaimedWay { start: at, legs: Vec::new(), radius });
        Claim { robot, task, passed: 0, until: 0, way }
    }

    /// There is no Traffic: the whole way is free.
    pub fn set_free(&mut self) {
        self.told = true;
        self.until = self.ranges.len();
    }

    /// What Traffic is told now.
    #[must_use]
    pub fn claim(&self) -> Claim {
        let number = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        let way = (!self.told).then(|| ClaimedWay {
            start: self.ends[0],
            legs: self.legs.clone(),
            radius: self.radius,
        });
        let (robot, task) = (self.robot.clone(), self.task);
        Claim { robot, task, passed: number(self.passed), until: number(self.until), way }
    }

    /// What Traffic answered.
    pub fn hear(&mut self, said: &Result<Clearance, Refusal>) {
        match said {
            Ok(clearance) if clearance.task == self.task => {
                self.told = true;
                self.until = self.until.max((clearance.until as usize).min(self.ranges.len()));
                self.waits.clone_from(&clearance.waits);
            }
            // It was started anew, and knows no way.
            Err(Refusal::Unknown { .. }) => self.told = false,
            _ => {}
        }
    }

    /// The robot is here: what is behind it is given back.
    pub fn see(&mut self, pose: Pose) {
        let Some(stage) = self.stage else { return };
        // The end of a stage is passed when the robot rests there.
        while self.passed + 1 < stage {
            let ahead = (self.passed + 1..stage).take(2).rev().find(|&piece| self.is_behind(piece, pose));
            let Some(piece) = ahead else { return };
            self.passed = piece;
        }
    }

    fn is_behind(&self, piece: usize, pose: Pose) -> bool {
        let end = self.ends[piece];
        let (sin, cos) = end.heading.0.sin_cos();
        let ahead = (pose.x - end.x).0 * cos + (pose.y - end.y).0 * sin;
        let backward = match self.legs[self.ranges[piece - 1].end - 1].geometry {
            Geometry::Line { length } => length.0 < 0.0,
            Geometry::Arc { radius, angle } => radius.0 * angle.0 < 0.0,
            Geometry::Turn { .. } => return false,
        };
        end.distance(pose).0 < NEAR && (if backward { -ahead } else { ahead }) >= 0.0
    }

    /// The next stage, for a robot that rests at `pose`; none while it must wait or drives.
    pub fn next(&mut self, pose: Pose) -> Option<Plan> {
        let free = self.until > self.passed && self.stage.is_none();
        if !free || self.waits_for_person() {
            return None;
        }
        self.confirmed = false;
        let stop = self.stops.iter().copied().find(|&stop| stop > self.passed);
        let stage = stop.map_or(self.until, |stop| stop.min(self.until));
        self.stage = Some(stage);
        let (from, to) = (self.ranges[self.passed].start, self.ranges[stage - 1].end);
        // Joined first: the end of a long line is aimed at, not that of its first piece.
        let legs = aim(pose, self.ends[self.passed], &join(&self.legs[from..to]));
        let length = legs.iter().map(|leg| leg.geometry.length()).sum();
        Some(Plan { start: pose, legs, length, ..Plan::default() })
    }

    /// The robot rests at the end of its stage.
    pub fn arrive(&mut self) {
        if let Some(stage) = self.stage.take() {
            self.passed = stage;
            self.confirmed = false;
        }
    }

    /// A person says that the robot may drive on.
    ///
    /// # Errors
    /// [`Refusal::Unavailable`] where nobody is asked.
    pub fn confirm(&mut self) -> Result<(), Refusal> {
        if !self.waits_for_person() {
            let hint = "it is at no loading point, or is confirmed already";
            return Err(Refusal::unavailable(format!("a question of {} to a person", self.robot), hint));
        }
        self.confirmed = true;
        Ok(())
    }

    fn waits_for_person(&self) -> bool {
        self.stage.is_none() && !self.confirmed && self.stops.contains(&self.passed)
    }

    /// Whether the whole way is behind, and nobody needs to confirm any more.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.stage.is_none() && self.passed == self.ranges.len() && !self.waits_for_person()
    }

    /// Whether a stage is being driven.
    #[must_use]
    pub const fn drives(&self) -> bool {
        self.stage.is_some()
    }

    /// For whom or what the robot stands; none while it drives.
    #[must_use]
    pub fn waiting(&self) -> Option<String> {
        if self.stage.is_some() || self.is_over() {
            return None;
        }
        if self.waits_for_person() {
            return Some(format!("for a person at a loading point: axle confirm --robot {}", self.robot));
        }
        let reasons: Vec<String> =
            self.waits.iter().map(|wait| format!("for {}: {}", wait.robot, wait.why)).collect();
        if !reasons.is_empty() {
            return Some(reasons.join("; "));
        }
        (self.until == self.passed).then(|| "for the answer of Traffic".to_owned())
    }

    /// The share of the way that is behind, when `share` of the present stage is.
    #[must_use]
    pub fn fraction(&self, share: f64) -> f64 {
        if self.ranges.is_empty() {
            return 1.0;
        }
        let stage = self.stage.map_or(0.0, |stage| (stage - self.passed) as f64 * share.clamp(0.0, 1.0));
        ((self.passed as f64 + stage) / self.ranges.len() as f64).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Radians, Seconds};

    fn plan() -> Plan {
        let leg = |geometry, point| Leg { geometry, point, speed: None };
        let legs = vec![
            leg(Geometry::Line { length: Metres(1.0) }, 0),
            leg(Geometry::Turn { angle: Radians(1.0) }, 1),
            leg(Geometry::Line { length: Metres(1.0) }, 1),
        ];
        Plan { legs, length: Metres(2.0), ..Plan::default() }
    }
    fn escort(confirm: &[u32]) -> Escort {
        let robot = RobotId::new("r2").expect("a name");
        Escort::new(robot, TaskId(1), &plan(), confirm, (Metres(0.25), Metres(0.5))).expect("a way")
    }
    fn until(until: u32) -> Result<Clearance, Refusal> {
        Ok(Clearance { task: TaskId(1), until, pieces: 4, waits: Vec::new() })
    }

    #[test]
    fn a_stage_is_what_may_be_driven_and_gives_back_what_is_behind() {
        let mut escort = escort(&[]);
        assert!(escort.claim().way.is_some() && escort.next(Pose::default()).is_none());
        escort.hear(&until(2));
        assert!(escort.claim().way.is_none(), "the way is told once");
        let stage = escort.next(Pose::default()).expect("a stage");
        assert_eq!((stage.legs.len(), stage.length), (1, Metres(1.0)), "cut pieces are one line again");
        assert!(escort.next(Pose::default()).is_none(), "it drives already");
        for (x, passed) in [(0.3, 0), (0.51, 1), (0.99, 1), (1.2, 1)] {
            escort.see(Pose::new(x, 0.0, 0.0));
            assert_eq!(escort.claim().passed, passed, "at {x} m");
        }
        escort.arrive();
        assert_eq!(escort.claim().passed, 2);
        escort.hear(&Err(Refusal::Unknown { what: "task".into(), got: "1".into(), known: "none".into() }));
        let again = escort.claim();
        assert!(again.way.is_some() && again.until == 2, "a new Traffic hears all of it");
        escort.hear(&until(4));
        assert!(escort.next(Pose::new(1.0, 0.0, 0.0)).is_some());
        escort.arrive();
        assert!(escort.is_over() && escort.fraction(0.0) >= 1.0);
    }

    #[test]
    fn a_loading_point_is_left_when_a_person_says_so() {
        let mut escort = escort(&[1, 2]);
        escort.set_free();
        assert!(escort.confirm().is_err(), "nobody is asked yet");
        assert_eq!(escort.next(Pose::default()).expect("a stage").length, Metres(1.0));
        assert!(escort.confirm().is_err(), "not before it is there");
        escort.arrive();
        assert!(escort.waiting().expect("it waits").contains("axle confirm --robot r2"));
        assert!(escort.next(Pose::new(1.0, 0.0, 0.0)).is_none());
        escort.confirm().expect("it was asked");
        assert!(escort.next(Pose::new(1.0, 0.0, 0.0)).is_some() && escort.waiting().is_none());
        escort.arrive();
        assert!(!escort.is_over(), "the last point is a loading point, too");
        escort.confirm().expect("it was asked");
        assert!(escort.is_over());
    }

    #[test]
    fn who_waits_says_for_whom() {
        let mut escort = escort(&[]);
        assert!(escort.waiting().expect("no answer yet").contains("answer of Traffic"));
        let wait = Wait { robot: RobotId::new("r5").expect("a name"), why: "it holds the way".into() };
        escort.hear(&Ok(Clearance { task: TaskId(1), until: 0, pieces: 4, waits: vec![wait] }));
        assert_eq!(escort.waiting().as_deref(), Some("for r5: it holds the way"));
        let fleet = crate::Fleet::new(crate::TrafficParams::default(), Seconds::ZERO).map(drop);
        assert!(fleet.is_ok());
    }
}
