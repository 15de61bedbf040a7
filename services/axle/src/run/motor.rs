//! An emulated motor, or the encoder beside it, as a process: one wheel of a robot that is composed of services.
//!
//! A service for a real motor board hears and says the same streams; nothing else of Axle has to know it.

use super::Context;
use super::board::Paced;
use crate::params::load;
use axle_emulator::{Encoder, EncoderParams, Motor, MotorParams};
use axle_mesh::Alarm;
use axle_schema::{Seconds, key};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Time from beat to beat.
const BEAT: Seconds = Seconds(0.005);
/// Powers, and readings of a motor, that wait for a beat.
const WAITING: usize = 8;

/// Turns a wheel until it is told to stop; `side` is 0 for the left one, 1 for the right one.
pub(crate) async fn run(context: Context, side: u64) -> anyhow::Result<()> {
    let params: MotorParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = context.mesh.clone();
    let mut motor = Motor::new(params, mesh.boot(), side)?;
    let powers = mesh.inbox(&key::motor_power(context.service).of(&robot), WAITING)?;
    let mut readings =
        Paced::new(mesh.publisher(&key::motor_reading(context.service).of(&robot))?, params.rate);
    let counters = mesh.shared_counters();
    beat(context, move |now, is_stopping| {
        while let Some(heard) = powers.take() {
            if let Err(reject) = motor.hear(now, &heard.message) {
                counters.count_refused();
                tracing::debug!("power refused: {reject:?}");
            }
        }
        motor.advance(now);
        if is_stopping {
            motor.stop();
        }
        readings.put(now, None, || motor.reading());
    })
    .await
}

/// Counts what the motor service of the same side turns, until it is told to stop.
pub(crate) async fn encode(context: Context, side: u64) -> anyhow::Result<()> {
    let params: EncoderParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = context.mesh.clone();
    let motor = if side == 0 { "motor-left" } else { "motor-right" };
    let mut encoder = Encoder::new(&params, mesh.boot(), side)?;
    let motors = mesh.inbox(&key::motor_reading(motor).of(&robot), WAITING)?;
    let mut readings =
        Paced::new(mesh.publisher(&key::motor_reading(context.service).of(&robot))?, params.rate);
    beat(context, move |now, _| {
        while let Some(heard) = motors.take() {
            encoder.hear(now, &heard.message);
        }
        encoder.advance(now);
        readings.put(now, None, || encoder.reading());
    })
    .await
}

/// Acts at every beat until the process is told to stop, and then once more.
async fn beat(
    mut context: Context,
    mut act: impl FnMut(Seconds, bool) + Send + 'static,
) -> anyhow::Result<()> {
    let stopping = Arc::new(AtomicBool::new(false));
    let is_stopping = Arc::clone(&stopping);
    let thread = context.mesh.beat_on_own_thread("wheel", BEAT, Alarm::default(), move |now| {
        let is_stopping = is_stopping.load(Relaxed);
        act(now, is_stopping);
        !is_stopping
    })?;
    let _visible = context.ready()?;
    context.stop.wait().await;
    stopping.store(true, Relaxed);
    tokio::task::spawn_blocking(move || drop(thread.join())).await?;
    Ok(())
}
