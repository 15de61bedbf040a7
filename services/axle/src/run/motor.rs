//! An emulated motor with its encoder as a process: one wheel of a robot that is composed of services.
//!
//! A service for a real motor board hears and says the same two streams; nothing else of Axle has to know it.

use super::Context;
use super::board::Paced;
use crate::params::load;
use axle_emulator::{Motor, MotorParams};
use axle_schema::{Seconds, key};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Time from beat to beat.
const BEAT: Seconds = Seconds(0.005);
/// Powers that wait for a beat.
const WAITING: usize = 8;

/// Turns a wheel until it is told to stop; `side` is 0 for the left one, 1 for the right one.
pub(crate) async fn run(mut context: Context, side: u64) -> anyhow::Result<()> {
    let params: MotorParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = context.mesh.clone();
    let mut motor = Motor::new(params, mesh.boot(), side)?;
    let powers = mesh.inbox(&key::motor_power(context.service).of(&robot), WAITING)?;
    let mut readings =
        Paced::new(mesh.publisher(&key::motor_reading(context.service).of(&robot))?, params.rate);
    let counters = mesh.shared_counters();
    let stopping = Arc::new(AtomicBool::new(false));
    let is_stopping = Arc::clone(&stopping);
    let thread = mesh.beat_on_own_thread("motor", BEAT, move |now| {
        while let Some(heard) = powers.take() {
            if let Err(reject) = motor.hear(now, &heard.message) {
                counters.count_refused();
                tracing::debug!("power refused: {reject:?}");
            }
        }
        motor.advance(now);
        let is_stopping = is_stopping.load(Relaxed);
        if is_stopping {
            motor.stop();
        }
        readings.put(now, None, || motor.reading());
        !is_stopping
    })?;
    let _visible = context.ready()?;
    context.stop.wait().await;
    stopping.store(true, Relaxed);
    tokio::task::spawn_blocking(move || drop(thread.join())).await?;
    Ok(())
}
