//! Pilot: sees a task through.
//!
//! Hears: `pilot/go`, `pilot/cancel`, the pose, the corrector's progress. Says: `pilot/progress`, the plan and the
//! movements it drives, the corrector's task. Paper: the user's side of Figure 2.
//!
//! A [`Journey`] is the account of one task: a pure value that is told what happened and says where the task stands.
//! The process around it asks Pathfinder and Pathdriver and hands the plan to the corrector. When the corrector falls
//! silent, or ends somewhere else than at the last way point, the journey fails with the reason.

use axle_schema::contract::{Bounds, Params};
use axle_schema::refusal::within;
use axle_schema::task::{CorrectorProgress, Phase, PilotProgress};
use axle_schema::{Drivetrain, Metres, Pose, Refusal, Seconds, TaskId, WayTask};
use serde::{Deserialize, Serialize};

/// Parameters of the pilot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PilotParams {
    /// The corrector that drives when the task names none.
    pub corrector: String,
    /// A way point counts as reached within this distance, 1 mm to 1 m.
    pub arrival: Metres,
    /// A planner has this long to answer, 0.1 to 60 s.
    pub deadline: Seconds,
    /// The corrector may be silent this long, 0.2 to 10 s.
    pub silence: Seconds,
    /// Whether the robot is one of a fleet: it drives only where Traffic lets it.
    pub traffic: bool,
    /// The circle around the middle of the axle that the robot and its load never leave, 0.01 to 5 m. Pathfinder is
    /// asked for ways with this much room, and Traffic needs it.
    pub radius: Metres,
    /// What Traffic gives and takes back at once, 0.1 to 10 m.
    pub piece: Metres,
    /// The robot that plans are made for.
    pub robot: Drivetrain,
}

impl Default for PilotParams {
    fn default() -> Self {
        Self {
            corrector: "d-corrector".into(),
            arrival: Metres(0.05),
            deadline: Seconds(5.0),
            silence: Seconds(1.5),
            traffic: false,
            radius: Drivetrain::BODY,
            piece: Metres(0.5),
            robot: Drivetrain::default(),
        }
    }
}

impl Bounds for PilotParams {
    fn check(&self) -> Result<(), Refusal> {
        within("arrival in m", self.arrival.0, 1e-3, 1.0)?;
        within("deadline in s", self.deadline.0, 0.1, 60.0)?;
        within("silence in s", self.silence.0, 0.2, 10.0)?;
        within("radius in m", self.radius.0, 0.01, 5.0)?;
        within("piece in m", self.piece.0, 0.1, 10.0)?;
        self.robot.check()
    }
}

impl Params for PilotParams {
    const FILE: &'static str = include_str!("../../../deploy/params/pilot.toml");
}

/// The account of one task, from its acceptance to its end.
#[derive(Clone, Debug)]
pub struct Journey {
    task: TaskId,
    way: WayTask,
    corrector: String,
    phase: Phase,
    reached: usize,
    fraction: f64,
    pose: Pose,
    accepted: Seconds,
    heard: Seconds,
    ended: Option<Seconds>,
    waiting: Option<String>,
}

impl Journey {
    /// A task that was accepted at `at` (the pilot's clock), with the robot at `pose`.
    #[must_use]
    pub fn begin(task: TaskId, way: WayTask, corrector: String, pose: Pose, at: Seconds) -> Self {
        Self {
            task,
            way,
            corrector,
            phase: Phase::Planning,
            reached: 0,
            fraction: 0.0,
            pose,
            accepted: at,
            heard: at,
            ended: None,
            waiting: None,
        }
    }
    /// Names the task.
    #[must_use]
    pub const fn task(&self) -> TaskId {
        self.task
    }
    /// The corrector that drives it.
    #[must_use]
    pub fn corrector(&self) -> &str {
        &self.corrector
    }
    /// Where it stands.
    #[must_use]
    pub const fn phase(&self) -> &Phase {
        &self.phase
    }

    /// The plan is with the corrector now.
    pub fn drive(&mut self, at: Seconds) {
        if self.phase == Phase::Planning {
            self.phase = Phase::Running;
            self.heard = at;
        }
    }

    /// The robot stands between two stages, for a reason that is known; the corrector has nothing to say.
    pub fn stand(&mut self, waiting: Option<String>, at: Seconds) {
        self.heard = at;
        self.waiting = waiting;
    }

    /// The robot is believed to be here. Points are reached in their order; one pose may reach several.
    pub fn see(&mut self, params: &PilotParams, pose: Pose) {
        self.pose = pose;
        if self.phase != Phase::Running {
            return;
        }
        while let Some(next) = self.way.points.get(self.reached) {
            let is_near = next.distance(pose) <= params.arrival;
            if !is_near {
                break;
            }
            self.reached += 1;
        }
    }

    /// The corrector said something, at `at` of the pilot's clock.
    pub fn hear(&mut self, params: &PilotParams, said: &CorrectorProgress, at: Seconds) {
        if said.task != self.task || self.phase.is_over() {
            return;
        }
        (self.heard, self.waiting) = (at, None);
        self.fraction = said.fraction.clamp(self.fraction, 1.0);
        match &said.phase {
            Phase::Planning => {}
            Phase::Running => self.phase = Phase::Running,
            Phase::Done => {
                self.phase = Phase::Running;
                self.see(params, self.pose);
                let end = self.verdict(params);
                self.end(end, at);
            }
            over => self.end(over.clone(), at),
        }
    }

    /// Looks at the clock: a corrector that says nothing for too long has failed the task.
    pub fn wait(&mut self, params: &PilotParams, at: Seconds) {
        let is_silent = at - self.heard > params.silence;
        if self.phase == Phase::Running && is_silent {
            let what = self.corrector.clone();
            let hint = format!("it said nothing for {:.1} s; is `axle run {what}` up?", (at - self.heard).0);
            self.end(Phase::Failed(Refusal::unavailable(what, hint)), at);
        }
    }

    /// Ends the task; a task that is over stays as it is.
    pub fn end(&mut self, phase: Phase, at: Seconds) {
        if !self.phase.is_over() {
            self.phase = phase;
            self.ended = Some(at);
        }
    }

    /// The account, for everybody.
    #[must_use]
    pub fn progress(&self, at: Seconds) -> PilotProgress {
        let count = |number: usize| u32::try_from(number).unwrap_or(u32::MAX);
        PilotProgress {
            task: self.task,
            phase: self.phase.clone(),
            corrector: self.corrector.clone(),
            reached: count(self.reached),
            points: count(self.way.points.len()),
            distance_left: self.distance_left(),
            fraction: if self.phase == Phase::Done { 1.0 } else { self.fraction },
            elapsed: self.ended.unwrap_or(at) - self.accepted,
            waiting: self.waiting.clone().filter(|_| !self.phase.is_over()),
        }
    }

    fn distance_left(&self) -> Metres {
        self.way.points.last().map_or(Metres::ZERO, |last| last.distance(self.pose))
    }

    /// The corrector believes to be done: is the robot there?
    fn verdict(&self, params: &PilotParams) -> Phase {
        let left = self.distance_left();
        if left <= params.arrival && self.reached == self.way.points.len() {
            Phase::Done
        } else if left <= params.arrival {
            let why = format!(
                "{} of {} way points were passed within {}",
                self.reached,
                self.way.points.len(),
                params.arrival
            );
            Phase::Failed(Refusal::Failed { why })
        } else {
            let why = format!(
                "{} ended {left:.3} from the last way point, allowed is {}",
                self.corrector, params.arrival
            );
            Phase::Failed(Refusal::Failed { why })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn journey() -> Journey {
        let way = WayTask::parse("0,0 1,0 1,1").expect("a way");
        let mut journey =
            Journey::begin(TaskId(7), way, "d-corrector".into(), Pose::default(), Seconds(10.0));
        journey.drive(Seconds(10.1));
        journey
    }
    fn said(phase: Phase, fraction: f64) -> CorrectorProgress {
        CorrectorProgress {
            task: TaskId(7),
            phase,
            stamp: Seconds(1.0),
            elapsed: Seconds(1.0),
            fraction,
            due: None,
            real: None,
        }
    }

    #[test]
    fn points_are_reached_in_their_order() {
        let (params, mut journey) = (PilotParams::default(), journey());
        journey.see(&params, Pose::new(1.0, 1.0, 0.0));
        assert_eq!(
            journey.progress(Seconds(11.0)).reached,
            0,
            "the last point does not count before the first"
        );
        for (pose, reached) in [((0.0, 0.0), 1), ((0.5, 0.0), 1), ((0.97, 0.0), 2), ((1.0, 0.96), 3)] {
            journey.see(&params, Pose::new(pose.0, pose.1, 0.0));
            assert_eq!(journey.progress(Seconds(11.0)).reached, reached, "at {pose:?}");
        }
        journey.hear(&params, &said(Phase::Done, 1.0), Seconds(12.0));
        assert_eq!(*journey.phase(), Phase::Done);
        assert_eq!(
            journey.progress(Seconds(99.0)).elapsed,
            Seconds(2.0),
            "the clock of a task stops with it"
        );
    }

    #[test]
    fn a_corrector_that_is_done_elsewhere_has_failed() {
        let (params, mut journey) = (PilotParams::default(), journey());
        journey.see(&params, Pose::new(0.5, 0.5, 0.0));
        journey.hear(&params, &said(Phase::Done, 1.0), Seconds(12.0));
        let Phase::Failed(why) = journey.phase() else { panic!("{:?}", journey.phase()) };
        assert!(why.to_string().contains("0.707 m from the last way point"), "{why}");
    }

    #[test]
    fn a_silent_corrector_fails_the_task_by_name() {
        let (params, mut journey) = (PilotParams::default(), journey());
        journey.wait(&params, Seconds(11.0));
        assert_eq!(*journey.phase(), Phase::Running);
        journey.wait(&params, Seconds(11.7));
        assert!(
            matches!(journey.phase(), Phase::Failed(Refusal::Unavailable { what, .. }) if what == "d-corrector")
        );
        journey.hear(&params, &said(Phase::Running, 0.5), Seconds(11.8));
        assert!(journey.phase().is_over(), "a task ends once");
    }

    #[test]
    fn a_robot_that_stands_for_a_reason_is_waited_for_and_says_it() {
        let (params, mut journey) = (PilotParams::default(), journey());
        let why = Some("for r5: it holds the way".to_owned());
        journey.stand(why.clone(), Seconds(60.0));
        journey.wait(&params, Seconds(61.0));
        assert_eq!((journey.phase(), journey.progress(Seconds(61.0)).waiting), (&Phase::Running, why));
        journey.hear(&params, &said(Phase::Running, 0.5), Seconds(61.1));
        assert_eq!(journey.progress(Seconds(61.2)).waiting, None, "it drives");
    }

    #[test]
    fn another_task_is_not_heard() {
        let (params, mut journey) = (PilotParams::default(), journey());
        let other = CorrectorProgress { task: TaskId(8), ..said(Phase::Done, 1.0) };
        journey.hear(&params, &other, Seconds(11.0));
        assert_eq!(*journey.phase(), Phase::Running);
    }

    #[test]
    fn the_shipped_parameters_are_the_defaults() {
        let file: PilotParams = toml::from_str(PilotParams::FILE).expect("the shipped file");
        assert_eq!(file, PilotParams::default());
        file.check().expect("within its ranges");
    }
}
