//! Navigator as a process: hears the newest measurements, says where the robot is.

use super::Context;
use crate::params::load;
use axle_navigator::{Measurement, Navigator, NavigatorParams};
use axle_schema::key;
use axle_schema::meta::Cause;

/// Integrates until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: NavigatorParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    // Each window repeats the measurements of the last moments, so that a lost one is made up for by the next.
    let recent = context.mesh.inbox(&key::RECENT.of(&robot), 16)?;
    let pose = context.mesh.publisher(&key::POSE.of(&robot))?;
    let _visible = context.ready()?;
    let mut navigator = Navigator::new(params)?;
    loop {
        let heard = tokio::select! {
            heard = recent.next() => heard,
            () = context.stop.wait() => return Ok(()),
        };
        let cause = heard.meta.map(|meta| Cause { source: meta.source, seq: meta.seq });
        let window = heard.message;
        // What a window repeats is known by its stamp, and counts once.
        let others = window.inertial.into_iter().map(Measurement::Inertial);
        for measurement in others.chain(window.fixes.into_iter().map(Measurement::Fix)) {
            let _ = navigator.measure(&measurement);
        }
        let newest = window.encoders.into_iter().filter_map(|datum| navigator.take(datum)).last();
        for event in navigator.events() {
            tracing::warn!("{event}");
        }
        drop(navigator.innovations());
        if let Some(data) = newest
            && let Err(refusal) = pose.put(&data, cause)
        {
            tracing::warn!("the pose could not be said: {refusal}");
        }
    }
}
