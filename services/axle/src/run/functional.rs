//! A functional service as a process: a queryable that answers one question after the other.

use super::Context;
use crate::params::load;
use axle_pathdriver::Pathdriver;
use axle_pathfinder::Pathfinder;
use axle_schema::contract::Functional;
use axle_schema::key::{self, Call};

/// A functional service and the key at which it answers.
pub(crate) trait Served: Functional {
    /// The key.
    const CALL: Call<Self::Ask, Self::Answer>;
}
impl Served for Pathfinder {
    const CALL: Call<Self::Ask, Self::Answer> = key::PLAN;
}
impl Served for Pathdriver {
    const CALL: Call<Self::Ask, Self::Answer> = key::DRIVE;
}

/// Answers until it is told to stop.
pub(crate) async fn run<F: Served>(mut context: Context) -> anyhow::Result<()> {
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
        let answer = asked.question().and_then(|question| F::answer(&params, &question));
        asked.reply(answer);
    }
}
