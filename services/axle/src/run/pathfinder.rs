//! Pathfinder as a process: many clients ask, and a long search keeps nobody else waiting.
//!
//! Questions are told apart by their content: one that was answered is answered again at once, and one that is being
//! answered is not searched twice, for an asker who hears nothing for two seconds asks again. Searches run beside the
//! loop, two at a time; each says how far it is where its question has an id, and ends at its deadline or when it is
//! cancelled. Everything that is kept has a bound.

use super::Context;
use super::tracer::setting;
use crate::params::load;
use axle_mesh::clock::Clock;
use axle_mesh::{Mesh, Publisher, Retry};
use axle_pathfinder::{PathfinderParams, Terrain, Watch, plan};
use axle_schema::trace::Answered;
use axle_schema::{
    MapAsk, MapData, Message as _, Plan, PlanAsk, PlanProgress, PlanStrategy, Refusal, RobotId, Seconds,
    TaskId, encode, key,
};
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::{Semaphore, mpsc};

/// Searches that run at a time, and those that may run or wait for it.
const AT_A_TIME: usize = 2;
const WAITING: usize = 64;
/// Askers of one question that may wait for its answer.
const ASKERS: usize = 64;
/// How often a search says how far it is, s.
const PACE: f64 = 0.2;
/// What the answers that are kept may weigh: the bytes of the question, and this much for every leg of the plan.
const KEPT: usize = 32 << 20;
const LEG: usize = 64;
/// Maps that are kept ready.
const MAPS: usize = 4;

type Asked = axle_mesh::Asked<PlanAsk, Plan>;
type Answer = Result<Plan, Refusal>;

/// Answers until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: PathfinderParams = load(context.params.as_deref())?;
    let mesh = context.mesh.clone();
    let (call, cancels, progress) = match &context.robot {
        Some(robot) => (key::PLAN.of(Some(robot)), key::PLAN_CANCEL.of(robot), key::PLAN_PROGRESS.of(robot)),
        None => (
            key::PLAN.of_every_robot(),
            key::PLAN_CANCEL.of_every_robot(),
            key::PLAN_PROGRESS.of_all_robots(),
        ),
    };
    let questions = mesh.server::<PlanAsk, Plan>(&call)?;
    let cancels = mesh.inbox(&cancels, 32)?;
    let (finished, mut answers) = mpsc::channel(WAITING);
    let common = Arc::new(Common {
        mesh: mesh.clone(),
        robot: context.robot.clone(),
        params,
        progress: mesh.publisher(&progress)?,
        maps: Mutex::default(),
        kept: Mutex::default(),
        turns: Semaphore::new(AT_A_TIME),
    });
    let mut desk = Desk { common, finished, searches: BTreeMap::new() };
    let _visible = context.ready()?;
    loop {
        tokio::select! {
            asked = questions.next() => desk.ask(asked),
            Some((key, answer)) = answers.recv() => desk.finish(&key, &answer),
            heard = cancels.next() => desk.cancel(heard.message.id),
            () = context.stop.wait() => break,
        }
    }
    // Nobody waits for a search whose process ends.
    desk.searches.values().for_each(|search| search.ended.store(true, Relaxed));
    Ok(())
}

/// What searches have in common.
struct Common {
    mesh: Mesh,
    robot: Option<RobotId>,
    params: PathfinderParams,
    progress: Publisher<PlanProgress>,
    maps: Mutex<VecDeque<(MapData, Arc<Terrain>)>>,
    kept: Mutex<Kept>,
    turns: Semaphore,
}

/// A question that is being answered.
struct Search {
    question: PlanAsk,
    askers: Vec<Asked>,
    id: Option<TaskId>,
    ended: Arc<AtomicBool>,
}

/// Where questions come in and answers go out.
struct Desk {
    common: Arc<Common>,
    finished: mpsc::Sender<(Vec<u8>, Answer)>,
    /// By the bytes of the question.
    searches: BTreeMap<Vec<u8>, Search>,
}

impl Desk {
    fn ask(&mut self, asked: Asked) {
        let read = asked.question().and_then(|question| {
            let nameless = PlanAsk { id: None, deadline: None, ..question.clone() };
            Ok((encode(&question)?, encode(&nameless)?, question))
        });
        let (key, content, question) = match read {
            Ok(read) => read,
            Err(refusal) => return asked.reply(Err(refusal)),
        };
        // The map of the service may be another one by now; whoever searches asks for it first.
        if !self.common.needs_map(&question)
            && let Some(plan) = self.common.known(&content, None)
        {
            self.common.say(asked.robot(), &question, &Ok(plan.clone()));
            return asked.reply(Ok(plan));
        }
        let busy = || Refusal::Busy { holder: "many questions are waiting for Pathfinder; it".into() };
        if let Some(search) = self.searches.get_mut(&key) {
            if search.askers.len() < ASKERS {
                search.askers.push(asked)
            } else {
                asked.reply(Err(busy()))
            }
            return;
        }
        if self.searches.len() >= WAITING {
            return asked.reply(Err(busy()));
        }
        let ended = Arc::new(AtomicBool::new(false));
        let (id, ended_too) = (question.id, Arc::clone(&ended));
        let search = Search { question: question.clone(), askers: vec![asked], id, ended: ended_too };
        self.searches.insert(key.clone(), search);
        let (common, finished) = (Arc::clone(&self.common), self.finished.clone());
        tokio::spawn(async move {
            let answer = common.answer(question, content, ended).await;
            // The desk that no longer listens has stopped.
            drop(finished.send((key, answer)).await);
        });
    }

    fn finish(&mut self, key: &[u8], answer: &Answer) {
        let Some(search) = self.searches.remove(key) else { return };
        for asked in search.askers {
            self.common.say(asked.robot(), &search.question, answer);
            asked.reply(answer.clone());
        }
    }

    fn cancel(&self, id: TaskId) {
        for search in self.searches.values().filter(|search| search.id == Some(id)) {
            search.ended.store(true, Relaxed);
        }
    }
}

impl Common {
    /// Says what was asked and answered, for a replay. One of another map than the question's cannot be replayed, and
    /// whoever asks for no robot in particular asks from a terminal: then nobody records.
    fn say(&self, robot: Option<RobotId>, question: &PlanAsk, answer: &Answer) {
        let Some(robot) = robot.filter(|_| !self.needs_map(question)) else { return };
        let (plan, refusal) = match answer {
            Ok(plan) => (Some(plan.clone()), None),
            Err(refusal) => (None, Some(refusal.clone())),
        };
        let setting = setting(&self.params, None);
        let answered = Answered { ask: question.clone(), answer: plan, refusal, setting };
        if let Err(refusal) = self.mesh.put_once(&key::PLAN_ANSWERED.of(&robot), &answered) {
            tracing::debug!("what was answered could not be said: {refusal}");
        }
    }
    /// Whether a question is answered on the map of the service.
    fn needs_map(&self, question: &PlanAsk) -> bool {
        question.map.is_none() && self.params.strategy(question) == PlanStrategy::Map
    }
    /// The answer to a question that was answered before, on the same map.
    fn known(&self, content: &[u8], map: Option<u64>) -> Option<Plan> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).find(content, map)
    }

    /// Searches, with the map of the service where the question has none and needs one.
    async fn answer(self: Arc<Self>, question: PlanAsk, content: Vec<u8>, ended: Arc<AtomicBool>) -> Answer {
        let clock = Clock::start();
        let deadline = question.deadline.unwrap_or(self.params.deadline);
        let late = || Refusal::TimedOut { what: "pathfinder".into(), seconds: deadline.0 };
        let turn = tokio::time::timeout(Duration::from_secs_f64(deadline.0), self.turns.acquire());
        let _turn = turn.await.map_err(|_| late())?.map_err(Refusal::internal)?;
        let mut map = question.map.clone();
        if self.needs_map(&question) {
            let left = Duration::from_secs_f64((deadline - clock.now()).0.max(0.001));
            let told = self.ask_map(left).await?;
            if let Some(plan) = self.known(&content, Some(told.content)) {
                return Ok(plan);
            }
            map = Some(told);
        }
        let on = map.as_ref().filter(|_| question.map.is_none()).map(|map| map.content);
        let common = Arc::clone(&self);
        let found = tokio::task::spawn_blocking(move || {
            common.search(&question, map.as_ref(), clock, deadline, &ended)
        });
        let plan = found.await.map_err(Refusal::internal)??;
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).keep(content, on, &plan);
        Ok(plan)
    }

    /// The map of the service; one that is known already is not sent again.
    async fn ask_map(&self, patience: Duration) -> Result<MapData, Refusal> {
        let newest = self.ready().front().map(|(map, _)| map.clone());
        let have = newest.as_ref().map(|map| map.content);
        let ask = |have| MapAsk { have };
        let robot = self.robot.as_ref();
        let told = self.mesh.ask(&key::MAP, robot, &ask(have), patience, Retry::Idempotent).await?;
        match newest {
            Some(known) if told.runs.is_empty() && told.content == known.content => Ok(known),
            _ if told.runs.is_empty() => {
                self.mesh.ask(&key::MAP, robot, &ask(None), patience, Retry::Idempotent).await
            }
            _ => Ok(told),
        }
    }

    fn ready(&self) -> std::sync::MutexGuard<'_, VecDeque<(MapData, Arc<Terrain>)>> {
        // Whoever panicked while holding it has left whole values behind.
        self.maps.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A map made ready. What a map says of its own content is not believed: another one may say the same.
    fn terrain(&self, map: &MapData, watch: Watch<'_>) -> Result<Arc<Terrain>, Refusal> {
        let known =
            self.ready().iter().find(|(known, _)| known == map).map(|(_, terrain)| Arc::clone(terrain));
        if let Some(terrain) = known {
            return Ok(terrain);
        }
        let terrain = Arc::new(Terrain::watched(map, self.params.unknown(), watch)?);
        let mut ready = self.ready();
        ready.push_front((map.clone(), Arc::clone(&terrain)));
        ready.truncate(MAPS);
        Ok(terrain)
    }

    fn search(
        &self,
        question: &PlanAsk,
        map: Option<&MapData>,
        clock: Clock,
        deadline: Seconds,
        ended: &AtomicBool,
    ) -> Answer {
        let mut said = 0.0;
        let mut watch = |fraction: f64| {
            if ended.load(Relaxed) {
                return Err(Refusal::Failed { why: "the search was cancelled".into() });
            }
            let elapsed = clock.now();
            if elapsed > deadline {
                return Err(Refusal::TimedOut { what: "pathfinder".into(), seconds: deadline.0 });
            }
            if let Some(id) = question.id
                && elapsed.0 - said >= PACE
            {
                said = elapsed.0;
                let progress = PlanProgress { id, fraction: fraction.clamp(0.0, 1.0), elapsed };
                if let Err(refusal) = self.progress.put(&progress, None) {
                    tracing::warn!("progress could not be said: {refusal}");
                }
            }
            Ok(())
        };
        watch(0.0)?;
        let terrain = map.map(|map| self.terrain(map, &mut watch)).transpose()?;
        watch(0.0)?;
        let plan = plan(&self.params, question, terrain.as_deref(), &mut watch)?;
        plan.check()?;
        Ok(plan)
    }
}

/// Answers that are kept, the newest first.
#[derive(Default)]
struct Kept {
    answers: VecDeque<(Vec<u8>, Option<u64>, Plan)>,
    weight: usize,
}

impl Kept {
    fn find(&self, content: &[u8], map: Option<u64>) -> Option<Plan> {
        let found = self.answers.iter().find(|(known, on, _)| *on == map && known == content);
        found.map(|(_, _, plan)| plan.clone())
    }

    fn keep(&mut self, content: Vec<u8>, map: Option<u64>, plan: &Plan) {
        if self.find(&content, map).is_some() {
            return;
        }
        self.weight += weight(&content, plan);
        self.answers.push_front((content, map, plan.clone()));
        while self.weight > KEPT {
            let Some((content, _, plan)) = self.answers.pop_back() else { return };
            self.weight -= weight(&content, &plan);
        }
    }
}

fn weight(content: &[u8], plan: &Plan) -> usize {
    content.len() + plan.legs.len() * LEG
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_kept_by_their_question_and_within_their_weight() {
        let mut kept = Kept::default();
        let plan = |length: f64| Plan { length: axle_schema::Metres(length), ..Plan::default() };
        kept.keep(vec![1], None, &plan(1.0));
        kept.keep(vec![1], Some(7), &plan(7.0));
        kept.keep(vec![1], None, &plan(3.0));
        assert_eq!(kept.find(&[1], None), Some(plan(1.0)), "what was answered first stays");
        assert_eq!((kept.find(&[1], Some(7)), kept.find(&[1], Some(8))), (Some(plan(7.0)), None));
        for question in 0..100_u8 {
            kept.keep(vec![question; KEPT / 10], None, &plan(0.0));
        }
        assert!(kept.weight <= KEPT && kept.answers.len() <= 10, "{} answers", kept.answers.len());
        assert_eq!(kept.find(&[1], None), None, "the oldest are forgotten first");
        let sum: usize = kept.answers.iter().map(|(content, _, plan)| weight(content, plan)).sum();
        assert_eq!(sum, kept.weight);
    }
}
