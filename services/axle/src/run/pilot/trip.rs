//! A task in stages: for a robot of a fleet, which drives as far as Traffic lets it, and for one with loading points,
//! at which it waits until a person confirms.
//!
//! The [`Escort`] knows the way; here it is asked at every beat what to do. A stage is a task of its own for the
//! corrector, planned from where the robot stands. When Traffic does not answer, the robot stands at the end of its
//! stage: silence gives nothing.

use super::{Event, Order, PACE, Pilot, Planned, stands};
use axle_mesh::{Retry, random_bits};
use axle_schema::command::Done;
use axle_schema::task::{CorrectorProgress, Phase};
use axle_schema::traffic::{Claim, Clearance, Confirm};
use axle_schema::{DriveAsk, Metres, Plan, Refusal, Seconds, Task, TaskId, key};
use axle_traffic::Escort;
use std::time::Duration;

/// Traffic is asked at this pace, and again when it has not answered for so long.
const ASK: Seconds = Seconds(0.2);
/// It has this long to answer.
const PATIENCE: Duration = Duration::from_secs(1);
/// A robot that was moved so far stands elsewhere.
const MOVED: Metres = Metres(0.05);

/// A task in stages.
pub(super) struct Trip {
    task: TaskId,
    escort: Escort,
    /// The corrector's task, while a stage is planned or driven.
    pub(super) stage: Option<TaskId>,
}

impl Pilot {
    /// Begins a task that is driven in stages.
    pub(super) fn set_out(&mut self, task: TaskId, plan: Plan, now: Seconds) {
        let sizes = (self.params.radius, self.params.piece);
        match Escort::new(self.robot.clone(), task, &plan, &self.confirm, sizes) {
            Ok(mut escort) => {
                if !self.params.traffic {
                    escort.set_free();
                }
                self.parked = None;
                self.trip = Some(Trip { task, escort, stage: None });
                self.cause = self.say("the plan", self.plans.put(&Task { id: task, plan }, self.cause));
                self.see_to_trip(now);
                self.say_progress(now);
            }
            Err(refusal) => self.end(Phase::Failed(refusal), now),
        }
    }

    /// What a beat has to do for a trip: ask Traffic, begin the next stage, end.
    pub(super) fn see_to_trip(&mut self, now: Seconds) {
        self.ask_traffic(now);
        let (Some(trip), Some(seen), Some(journey)) = (&mut self.trip, self.pose, &mut self.journey) else {
            return;
        };
        trip.escort.see(seen.pose);
        if self.planning.is_some() {
            return journey.stand(None, now);
        }
        if trip.stage.is_some() {
            return;
        }
        if trip.escort.is_over() {
            let done = CorrectorProgress {
                task: trip.task,
                phase: Phase::Done,
                stamp: seen.stamp,
                elapsed: Seconds::ZERO,
                fraction: 1.0,
                due: None,
                real: None,
            };
            journey.hear(&self.params, &done, now);
            if journey.phase().is_over() {
                self.dismiss();
            }
            // Its end: the beat says no more of a task that is over.
            self.say_progress(now);
            return;
        }
        journey.stand(trip.escort.waiting(), now);
        if stands(&seen)
            && let Some(plan) = trip.escort.next(seen.pose)
        {
            let stage = TaskId::from_random(random_bits());
            trip.stage = Some(stage);
            self.plan_stage(stage, plan);
        }
    }

    /// Has Pathdriver plan a stage, beside the loop.
    fn plan_stage(&mut self, stage: TaskId, plan: Plan) {
        let (mesh, robot, params) = (self.mesh.clone(), self.robot.clone(), self.params.clone());
        let answers = self.answers.clone();
        let deadline = Duration::from_secs_f64(params.deadline.0);
        self.planning = Some(tokio::spawn(async move {
            let ask = DriveAsk { legs: plan.legs.clone(), robot: Some(params.robot), ..DriveAsk::default() };
            let drive = mesh.ask(&key::DRIVE, Some(&robot), &ask, deadline, Retry::Idempotent).await;
            // The pilot that no longer listens has stopped.
            drop(answers.send(Event::Staged(stage, drive.map(|drive| Planned { plan, drive }))).await);
        }));
    }

    /// Hands a planned stage to the corrector.
    pub(super) fn drive_stage(&mut self, stage: TaskId, planned: Result<Planned, Refusal>, now: Seconds) {
        if self.trip.as_ref().and_then(|trip| trip.stage) != Some(stage) {
            return;
        }
        self.planning = None;
        match planned {
            Ok(Planned { plan, drive }) => {
                if let Some(journey) = &mut self.journey {
                    journey.stand(None, now);
                }
                let order = Order { plan: Task { id: stage, plan }, drive: Task { id: stage, plan: drive } };
                self.cause = self.say("the movements", self.drives.put(&order.drive, self.cause));
                self.order = Some(order);
                self.repeat_order();
            }
            Err(refusal) => self.end(Phase::Failed(refusal), now),
        }
    }

    /// What a corrector says of a stage, as a word about the task; none where it is told otherwise.
    pub(super) fn of_task(&mut self, said: CorrectorProgress, now: Seconds) -> Option<CorrectorProgress> {
        let Some(trip) = &mut self.trip else { return Some(said) };
        if trip.stage != Some(said.task) {
            return None;
        }
        if said.phase == Phase::Done {
            trip.stage = None;
            trip.escort.arrive();
            self.claim_due = now;
            self.see_to_trip(now);
            return None;
        }
        let fraction = trip.escort.fraction(said.fraction);
        Some(CorrectorProgress { task: trip.task, fraction, ..said })
    }

    /// A person says that the robot may drive on.
    pub(super) fn confirm(&mut self, confirm: &Confirm) -> Result<Done, Refusal> {
        let Some(trip) = &mut self.trip else {
            let what = format!("a question of {} to a person", self.robot);
            return Err(Refusal::unavailable(what, "it drives no task with loading points"));
        };
        trip.escort.confirm()?;
        tracing::info!(by = %confirm.by, "confirmed");
        Ok(Done {})
    }

    /// Tells Traffic where the robot is, and asks how far it may drive.
    fn ask_traffic(&mut self, now: Seconds) {
        if !self.params.traffic || now < self.claim_due {
            return;
        }
        let claim = match (&self.trip, self.pose) {
            (Some(trip), _) => trip.escort.claim(),
            (None, Some(seen)) if stands(&seen) => {
                let there = self.parked.filter(|(_, at)| at.distance(seen.pose) <= MOVED);
                let (task, at) = there.unwrap_or_else(|| (TaskId::from_random(random_bits()), seen.pose));
                self.parked = Some((task, at));
                Escort::parked(self.robot.clone(), task, at, self.params.radius)
            }
            _ => return,
        };
        // Until the answer comes; a lost one is asked for again.
        self.claim_due = now + ASK.max(PACE);
        let (mesh, robot, answers) = (self.mesh.clone(), self.robot.clone(), self.answers.clone());
        tokio::spawn(async move {
            let Claim { task, .. } = claim;
            let said: Result<Clearance, Refusal> =
                mesh.ask(&key::CLAIM, Some(&robot), &claim, PATIENCE, Retry::Never).await;
            drop(answers.send(Event::Cleared(task, said)).await);
        });
    }

    /// What Traffic answered.
    pub(super) fn hear_traffic(&mut self, task: TaskId, said: &Result<Clearance, Refusal>) {
        if let Some(trip) = self.trip.as_mut().filter(|trip| trip.task == task) {
            trip.escort.hear(said);
        }
        if let Err(refusal) = said {
            tracing::warn!(robot = %self.robot, "Traffic: {refusal}");
        }
    }
}
