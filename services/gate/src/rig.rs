//! A gate in virtual time, for tests: time moves by hand.

use crate::{Gate, GateParams};
use axle_schema::command::{Class, Command, Lease, LeaseAsk, Reject};
use axle_schema::{Boot, Drivetrain, Dwm, MetresPerSecond, Seconds, Sides, Tick};

pub(crate) const BOOT: Boot = Boot(42);
/// The time between the beats of [`Rig::beats`].
pub(crate) const BEAT: f64 = 0.005;

pub(crate) struct Rig {
    pub(crate) gate: Gate,
    pub(crate) now: Seconds,
    pub(crate) seq: u32,
}

impl Rig {
    /// A gate that starts enabled, with the default limits: 1 m/s, 2.5 m/s², braking with 2 m/s².
    pub(crate) fn enabled() -> Self {
        let params = GateParams { starts_enabled: true, ..GateParams::default() };
        let gate = Gate::new(params, &Drivetrain::default(), BOOT, None).expect("a gate");
        Self { gate, now: Seconds::ZERO, seq: 0 }
    }
    /// Beats for a while; the last setpoint.
    pub(crate) fn beats(&mut self, duration: f64) -> Sides<MetresPerSecond> {
        let mut speeds = self.gate.beat(self.now);
        let from = self.now.0;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few hundred beats")]
        for beat in 1..=(duration / BEAT).round() as u32 {
            self.now = Seconds(from + BEAT * f64::from(beat));
            speeds = self.gate.beat(self.now);
        }
        speeds
    }
    pub(crate) fn lease(&mut self, holder: &str, class: Class) -> Lease {
        self.gate.lease(self.now, &ask(holder, class)).expect("a lease")
    }
    /// The next command of a lease, with a fresh echo.
    pub(crate) fn next(&mut self, lease: &Lease, dwm: Dwm) -> Command {
        self.seq += 1;
        let Lease { boot, epoch, .. } = *lease;
        Command { boot, epoch, seq: self.seq, echo: Tick::of(self.now), ttl_ms: 60_000, dwm }
    }
    pub(crate) fn command(&mut self, lease: &Lease, dwm: Dwm) -> Result<(), Reject> {
        let command = self.next(lease, dwm);
        self.gate.obey(self.now, &command)
    }
}

/// Somebody who sends 20 commands in a second.
pub(crate) fn ask(holder: &str, class: Class) -> LeaseAsk {
    LeaseAsk { holder: holder.into(), class, period: Seconds(0.05) }
}

/// Straight on from speed `v0` to `v1`.
pub(crate) fn drive(v0: f64, v1: f64, duration: f64) -> Dwm {
    let both = |v| Sides::new(MetresPerSecond(v), MetresPerSecond(v));
    Dwm::new(both(v0), both(v1), Seconds(duration)).expect("a movement")
}

/// CBOR in which the 64-bit float `old` is replaced by `new`.
pub(crate) fn patched(bytes: &[u8], old: f64, new: f64) -> Vec<u8> {
    let old = old.to_be_bytes();
    let at = bytes.windows(8).position(|window| window == old).expect("the number is there");
    let mut bytes = bytes.to_vec();
    bytes[at..at + 8].copy_from_slice(&new.to_be_bytes());
    bytes
}
