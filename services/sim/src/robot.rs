//! The computer on the robot: the gate, and the emulated robot behind it, beat by beat as their process does it.

use crate::host::ToHost;
use crate::link::Link;
use crate::scenario::World;
use axle_emulator::{Emulator, EmulatorParams};
use axle_gate::{Gate, Headline};
use axle_schema::codec::encoding_of;
use axle_schema::command::{Command, LeaseAsk, Motion, Release};
use axle_schema::{Boot, MetresPerSecond, NavigatorData, Refusal, Seconds, Sides};

/// The step of the physics, s.
const STEP: f64 = 0.001;
/// The gate's state is said at least this often.
const STATE_PERIOD: Seconds = Seconds(1.0);
/// The run of the robot process; which one does not matter.
pub(crate) const BOOT: Boot = Boot(77);

/// What is said to the robot.
#[derive(Clone, Debug)]
pub(crate) enum ToRobot {
    /// Asks for the wheels.
    Lease(LeaseAsk),
    /// Gives them back.
    Release(Release),
    /// The bytes of a command.
    Command(Vec<u8>),
}

/// The robot.
pub(crate) struct Robot {
    pub(crate) gate: Gate,
    emulator: Emulator,
    params: EmulatorParams,
    /// The encoding of commands, as it travels with them.
    encoding: String,
    /// The setpoints of the latest beat.
    wheels: Sides<MetresPerSecond>,
    encoders_due: Seconds,
    inertial_due: Seconds,
    said: Option<(Headline, Seconds)>,
}

impl Robot {
    pub(crate) fn new(world: &World) -> Result<Self, Refusal> {
        let params = world.robot;
        Ok(Self {
            gate: Gate::new(params.gate, &params.robot, BOOT, None)?,
            emulator: Emulator::new(params)?,
            params,
            encoding: encoding_of::<Command>(),
            wheels: Sides::default(),
            encoders_due: Seconds::ZERO,
            inertial_due: Seconds::ZERO,
            said: None,
        })
    }

    /// The same robot among the walls of a map.
    #[cfg(test)]
    pub(crate) fn among(self, map: &axle_schema::MapData) -> Result<Self, Refusal> {
        Ok(Self { emulator: self.emulator.among(map)?, ..self })
    }

    /// One beat: what has arrived is heard, the wheels turn, and what was measured is sent.
    pub(crate) fn beat(&mut self, now: Seconds, down: &mut Link<ToRobot>, up: &mut Link<ToHost>) {
        while let Some(heard) = down.receive(now) {
            match heard {
                ToRobot::Lease(ask) => up.send_surely(now, ToHost::Lease(self.gate.lease(now, &ask))),
                // A release that comes too late releases nothing.
                ToRobot::Release(release) => drop(self.gate.release(now, &release)),
                // The gate counts what it refuses, and the host hears of a lost lease by the gate's state.
                ToRobot::Command(bytes) => drop(self.gate.command(now, &self.encoding, &bytes)),
            }
        }
        let wheels = self.gate.beat(now);
        self.advance(now, wheels);
        let headline = self.gate.headline();
        if self.said.is_none_or(|(said, at)| said != headline || now - at >= STATE_PERIOD) {
            self.said = Some((headline, now));
            up.send(now, ToHost::State(Box::new(self.gate.state(now))));
        }
        // Inertia first: encoders set the pace of what is said further on.
        if now >= self.inertial_due {
            self.inertial_due += Seconds(1.0 / self.params.rates.inertial_hz);
            up.send(now, ToHost::Inertial(self.emulator.inertial()));
        }
        if now >= self.encoders_due {
            self.encoders_due += Seconds(1.0 / self.params.rates.encoders_hz);
            up.send(now, ToHost::Encoders(self.emulator.encoders()));
        }
    }

    /// Turns the wheels until `now`, in steps of a millisecond; the setpoints go linearly to `wheels`.
    fn advance(&mut self, now: Seconds, wheels: Sides<MetresPerSecond>) {
        let begin = self.emulator.now();
        let span = (now - begin).0;
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a beat has at most 20 ms"
        )]
        let steps = (span / STEP).round().clamp(1.0, 100.0) as u32;
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            let to = if step == steps { now } else { begin + Seconds(span * share) };
            self.emulator.advance(to, self.wheels.zip(wheels, |from, to| from + (to - from) * share));
        }
        self.wheels = wheels;
    }

    /// Whether the gate asks for rest and the rims run no more.
    pub(crate) fn rests(&self) -> bool {
        let still = self.emulator.rim_speeds().both().iter().all(|speed| speed.0.abs() < 1e-4);
        self.gate.motion() == Motion::Standing && still
    }

    /// Where it really is.
    pub(crate) fn truth(&self) -> NavigatorData {
        self.emulator.truth()
    }

    /// How fast the rims run.
    pub(crate) const fn rims(&self) -> Sides<MetresPerSecond> {
        self.emulator.rim_speeds()
    }

    /// What the gate asks of the wheels.
    pub(crate) const fn setpoints(&self) -> Sides<MetresPerSecond> {
        self.wheels
    }

    /// From beat to beat.
    pub(crate) const fn period(&self) -> Seconds {
        self.params.rates.beat
    }
}
