//! A functional service as a process: a queryable that answers one question after the other.

use super::Context;
use super::tracer::setting;
use crate::params::load;
use axle_pathdriver::Pathdriver;
use axle_pathfinder::Pathfinder;
use axle_schema::codec::Message;
use axle_schema::contract::Functional;
use axle_schema::key::{self, Call, Stream};
use axle_schema::trace::Answered;

/// A functional service and the key at which it answers.
pub(crate) trait Served: Functional<Ask: Clone, Answer: Clone>
where
    Answered<Self::Ask, Self::Answer>: Message,
{
    /// The key.
    const CALL: Call<Self::Ask, Self::Answer>;
    /// Where it says what it was asked and answered.
    const ANSWERED: Stream<Answered<Self::Ask, Self::Answer>>;
}
impl Served for Pathfinder {
    const CALL: Call<Self::Ask, Self::Answer> = key::PLAN;
    const ANSWERED: Stream<Answered<Self::Ask, Self::Answer>> = key::PLAN_ANSWERED;
}
impl Served for Pathdriver {
    const CALL: Call<Self::Ask, Self::Answer> = key::DRIVE;
    const ANSWERED: Stream<Answered<Self::Ask, Self::Answer>> = key::DRIVE_ANSWERED;
}

/// Answers until it is told to stop.
pub(crate) async fn run<F: Served>(mut context: Context) -> anyhow::Result<()>
where
    Answered<F::Ask, F::Answer>: Message,
{
    let params: F::Params = load(context.params.as_deref())?;
    let key = match &context.robot {
        Some(robot) => F::CALL.of(Some(robot)),
        None => F::CALL.of_every_robot(),
    };
    let server = context.mesh.server::<F::Ask, F::Answer>(&key)?;
    let _visible = context.ready()?;
    loop {
        let asked = tokio::select! {
            asked = server.next() => asked,
            () = context.stop.wait() => return Ok(()),
        };
        let span = tracing::info_span!("query", key = asked.key());
        let (robot, question) = (asked.robot(), asked.question());
        let answer =
            span.in_scope(|| question.as_ref().map_err(Clone::clone).and_then(|ask| F::answer(&params, ask)));
        // Whoever asks for no robot in particular asks from a terminal: then nobody records.
        let told = robot.zip(question.ok()).map(|(robot, ask)| (robot, ask, answer.clone()));
        asked.reply(answer);
        if let Some((robot, ask, answer)) = told {
            let (answer, refusal) =
                answer.map_or_else(|why| (None, Some(why)), |answer| (Some(answer), None));
            let answered = Answered { ask, answer, refusal, setting: setting(&params, None) };
            if let Err(refusal) = context.mesh.put_once(&F::ANSWERED.of(&robot), &answered) {
                tracing::debug!("what was answered could not be said: {refusal}");
            }
        }
    }
}
