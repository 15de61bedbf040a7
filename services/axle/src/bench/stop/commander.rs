//! The process that is killed, frozen and cut off: it takes the wheels and drives a circle, as a corrector would.

use crate::settings::{Settings, join};
use crate::signal;
use axle_mesh::{Patience, Retry};
use axle_schema::command::{Class, Command, Lease, LeaseAsk};
use axle_schema::{Dwm, MetresPerSecond, Seconds, Sides, Tick, key};
use std::time::Duration;

/// The pace of commands: that of the correctors.
pub(super) const PERIOD: Seconds = Seconds(0.05);
/// What the wheels gain from command to command, in m/s: 1 m/s².
const GAIN: f64 = 0.05;
/// The speeds that they come to.
const CIRCLE: Sides<MetresPerSecond> = Sides::new(MetresPerSecond(0.4), MetresPerSecond(0.6));

/// Commands until it is told to stop; a lease that is lost is not asked for again.
pub(crate) async fn command(settings: &Settings) -> anyhow::Result<()> {
    let robot = settings.one_robot()?;
    let mesh = join(settings.mesh("bench-commander", Some(&robot))?, Patience::Forever).await?;
    let encoders = mesh.inbox(&key::ENCODERS.of(&robot), 1)?;
    let commands = mesh.publisher(&key::COMMAND.of(&robot))?;
    let ask = LeaseAsk { holder: mesh.name(), class: Class::Corrector, period: PERIOD };
    let lease: Lease =
        mesh.ask(&key::LEASE, Some(&robot), &ask, Duration::from_secs(5), Retry::Idempotent).await?;
    let mut stop = signal::stop()?;
    let mut beat = mesh.beat(PERIOD);
    let (mut speeds, mut seq, mut echo) = (Sides::default(), 0, lease.tick);
    loop {
        tokio::select! {
            _ = beat.next() => {}
            () = stop.wait() => return Ok(()),
        }
        if let Some(heard) = encoders.latest() {
            echo = Tick::of(heard.message.stamp);
        }
        let next = speeds.zip(CIRCLE, |now: MetresPerSecond, most| (now + MetresPerSecond(GAIN)).min(most));
        let dwm = Dwm::new(speeds, next, PERIOD)?;
        (speeds, seq) = (next, seq + 1);
        let Lease { boot, epoch, .. } = lease;
        commands.put(&Command { boot, epoch, seq, echo, ttl_ms: 150, dwm }, None)?;
    }
}
