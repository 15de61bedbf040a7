//! Traffic as a process: one fleet, asked by all its pilots.

use super::Context;
use crate::params::load;
use axle_schema::key;
use axle_schema::traffic::{Claim, Clearance, TrafficAsk, TrafficState};
use axle_traffic::{Fleet, TrafficParams};

/// Answers until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: TrafficParams = load(context.params.as_deref())?;
    let mesh = &context.mesh;
    let mut fleet = Fleet::new(params, mesh.clock().now())?;
    let claims = mesh.server::<Claim, Clearance>(&key::CLAIM.of_every_robot())?;
    let states = mesh.server::<TrafficAsk, TrafficState>(&key::TRAFFIC.of_every_robot())?;
    let _visible = context.ready()?;
    loop {
        tokio::select! {
            asked = claims.next() => {
                let now = context.mesh.clock().now();
                let answer = asked.question().and_then(|claim| fleet.claim(&claim, now));
                asked.reply(answer);
            }
            asked = states.next() => {
                let answer = asked.question().map(|TrafficAsk {}| fleet.state());
                asked.reply(answer);
            }
            () = context.stop.wait() => return Ok(()),
        }
    }
}
