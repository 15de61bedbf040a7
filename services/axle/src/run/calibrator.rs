//! The calibrator as a process: speeds to signals and back, by the calibration in its parameters.

use super::Context;
use crate::params::load;
use axle_calibrator::{CalibratorParams, ToSignals, ToSpeeds};
use axle_schema::contract::Functional as _;
use axle_schema::key;

/// Answers until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: CalibratorParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let signals = context.mesh.server(&key::TO_SIGNALS.of(Some(&robot)))?;
    let speeds = context.mesh.server(&key::TO_SPEEDS.of(Some(&robot)))?;
    let _visible = context.ready()?;
    loop {
        tokio::select! {
            asked = signals.next() => {
                let answer = asked.question().and_then(|ask| ToSignals::answer(&params, &ask));
                asked.reply(answer);
            }
            asked = speeds.next() => {
                let answer = asked.question().and_then(|ask| ToSpeeds::answer(&params, &ask));
                asked.reply(answer);
            }
            () = context.stop.wait() => return Ok(()),
        }
    }
}
