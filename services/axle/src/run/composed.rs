//! The owner of wheels that are services of their own: the gate of a robot that is composed of two motors and two
//! encoders, as the reference implementation of the Generic Differential Drive contract is.
//!
//! Hears the partners' readings, and at every beat says to each motor the power that keeps its wheel at the speed of the
//! gate's setpoint. A partner that falls silent or restarts disables the drive, and the motors stop by themselves when
//! this process dies: what comes late they refuse by their own clocks.

use super::Context;
use super::board::{Paced, Wheels, own};
use super::latch::Latch;
use crate::params::load;
use axle_drive::{Wheel, WheelGains};
use axle_gate::{Gate, GateParams};
use axle_mesh::{Inbox, Mesh, Publisher};
use axle_schema::contract::{Bounds, Params};
use axle_schema::differential_drive::{MotorPower, MotorReading};
use axle_schema::meta::Cause;
use axle_schema::refusal::within;
use axle_schema::{
    Boot, Drivetrain, Duty, EncodersData, Metres, MetresPerSecond, Refusal, RobotId, Seconds, Sides, Signals,
    Tick, key,
};
use serde::{Deserialize, Serialize};

/// Parameters of a composed robot: `deploy/params/composed.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct ComposedParams {
    /// Time from beat to beat, 0.005 to 0.02 s.
    beat: Seconds,
    /// Encoder readings of the robot in a second, 1 to 100.
    encoders_hz: f64,
    /// A partner that says nothing for this long is lost, 0.05 to 1 s.
    silence: Seconds,
    /// Speed of a wheel at full power.
    full_speed: MetresPerSecond,
    /// Power for each m/s of error, 0 to 10.
    kp: f64,
    /// Power for each metre of accumulated error, 0 to 100.
    ki: f64,
    /// The motor services.
    pub(crate) motors: Sides<String>,
    /// The encoder services.
    pub(crate) encoders: Sides<String>,
    /// The body of the robot.
    robot: Drivetrain,
    /// The gate.
    gate: GateParams,
}

impl Default for ComposedParams {
    fn default() -> Self {
        let motors = Sides::new("motor-left".to_owned(), "motor-right".to_owned());
        Self {
            beat: Seconds(0.01),
            encoders_hz: 50.0,
            silence: Seconds(0.25),
            full_speed: MetresPerSecond(1.2),
            kp: 0.4,
            ki: 2.0,
            encoders: motors.clone(),
            motors,
            robot: Drivetrain::default(),
            gate: GateParams::default(),
        }
    }
}

impl Bounds for ComposedParams {
    fn check(&self) -> Result<(), Refusal> {
        within("beat in s", self.beat.0, 0.005, 0.02)?;
        within("encoders_hz", self.encoders_hz, 1.0, 100.0)?;
        within("silence in s", self.silence.0, 0.05, 1.0)?;
        within("full_speed in m/s", self.full_speed.0, 1e-3, 20.0)?;
        within("kp", self.kp, 0.0, 10.0)?;
        within("ki", self.ki, 0.0, 100.0)?;
        for (what, names, kinds) in [
            ("motors", &self.motors, &["motor-"][..]),
            ("encoders", &self.encoders, &["motor-", "encoder-"][..]),
        ] {
            for name in [&names.left, &names.right] {
                let is_name = name.len() <= 32 && RobotId::new(name).is_ok();
                if !(is_name && kinds.iter().any(|kind| name.starts_with(kind))) {
                    let shown: String = name.chars().take(40).collect();
                    let limit = format!("a service whose name begins with {}", kinds.join(" or "));
                    return Err(Refusal::out_of_range(what, format!("{shown:?}"), limit));
                }
            }
            if names.left == names.right {
                let limit = "a service of its own for each side";
                return Err(Refusal::out_of_range(what, format!("twice {:?}", names.left), limit));
            }
        }
        self.robot.check()?;
        self.gate.fits(&self.robot)
    }
}

impl Params for ComposedParams {
    const FILE: &'static str = include_str!("../../../../deploy/params/composed.toml");
}

/// Owns the wheels until it is told to stop; begins when both motors and both encoders speak.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let params: ComposedParams = load(context.params.as_deref())?;
    let robot = context.one_robot()?;
    let mesh = context.mesh.clone();
    let mut composed = Composed::new(&mesh, &robot, &params)?;
    let mut look = mesh.beat(Seconds(0.05));
    let mut told = Seconds(3.0);
    while let Err(refusal) = composed.hear(mesh.clock().now()) {
        if mesh.clock().now() >= told {
            told = mesh.clock().now() + Seconds(60.0);
            tracing::warn!("waiting for the partners: {refusal}");
        }
        tokio::select! {
            _ = look.next() => {}
            () = context.stop.wait() => return Ok(()),
        }
    }
    let latch = Latch::open(&context.state, &robot)?;
    let gate = Gate::new(params.gate, &params.robot, mesh.boot(), latch.kept())?;
    own(context, &robot, (gate, latch), composed, params.beat).await
}

/// A service that speaks, and when it did so last.
struct Partner {
    name: &'static str,
    readings: Inbox<MotorReading>,
    newest: Option<(MotorReading, Seconds)>,
}

impl Partner {
    fn new(mesh: &Mesh, robot: &RobotId, name: &'static str) -> anyhow::Result<Self> {
        let readings = mesh.inbox(&key::motor_reading(name).of(robot), 1)?;
        Ok(Self { name, readings, newest: None })
    }
    /// Its newest reading, and whether that is from another run of its process than the last one.
    fn hear(&mut self, now: Seconds, silence: Seconds) -> Result<(MotorReading, bool), Refusal> {
        let before = self.newest.map(|(reading, _)| reading.boot);
        if let Some(heard) = self.readings.latest() {
            self.newest = Some((heard.message, now));
        }
        match self.newest {
            Some((reading, at)) if now - at <= silence => {
                Ok((reading, before.is_some_and(|boot| boot != reading.boot)))
            }
            _ => {
                let hint = format!("it says nothing; is `axle run {}` up?", self.name);
                Err(Refusal::unavailable(self.name, hint))
            }
        }
    }
}

/// One side: a motor, its encoder, and the control between them.
struct Side {
    motor: Partner,
    /// None where the motor is its own encoder.
    encoder: Option<Partner>,
    powers: Publisher<MotorPower>,
    wheel: Wheel,
    seq: u32,
    /// The motor that powers are for, and its newest tick.
    turned: Option<(Boot, Tick)>,
    /// What the wheel had covered before the encoder restarted, and what the encoder shows.
    covered: (Metres, Metres),
    power: Duty,
}

impl Side {
    fn new(
        mesh: &Mesh,
        robot: &RobotId,
        gains: WheelGains,
        motor: &str,
        encoder: &str,
    ) -> anyhow::Result<Self> {
        // Keys are made of names that live as long as the process, and so do these few.
        let name = |name: &str| -> &'static str { Box::leak(name.to_owned().into_boxed_str()) };
        let motor_name = name(motor);
        let encoder = if encoder == motor { None } else { Some(Partner::new(mesh, robot, name(encoder))?) };
        Ok(Self {
            motor: Partner::new(mesh, robot, motor_name)?,
            encoder,
            powers: mesh.publisher(&key::motor_power(motor_name).of(robot))?,
            wheel: Wheel::new(gains),
            seq: 0,
            turned: None,
            covered: (Metres::ZERO, Metres::ZERO),
            power: Duty::default(),
        })
    }

    fn hear(&mut self, now: Seconds, silence: Seconds) -> Result<(), Refusal> {
        let restarted = |name| Refusal::Failed { why: format!("{name} has restarted") };
        let (motor, is_new) = self.motor.hear(now, silence)?;
        self.turned = Some((motor.boot, Tick::of(motor.stamp)));
        let (reading, is_other) = match &mut self.encoder {
            Some(encoder) => encoder.hear(now, silence)?,
            None => (motor, is_new),
        };
        let name = self.encoder.as_ref().map_or(self.motor.name, |encoder| encoder.name);
        let Some(distance) = reading.distance else {
            return Err(Refusal::missing(format!("the distance of {name}"), "it is no encoder"));
        };
        if is_other {
            self.covered = (self.covered.0 + self.covered.1, Metres::ZERO);
            self.wheel.restart();
        }
        self.covered.1 = distance;
        self.wheel.hear(reading.stamp, distance);
        if is_new || is_other { Err(restarted(name)) } else { Ok(()) }
    }

    fn turn(&mut self, now: Seconds, speed: MetresPerSecond) -> Result<(), Refusal> {
        self.power = self.wheel.power(now, speed);
        let Some((boot, echo)) = self.turned else { return Ok(()) };
        self.seq = self.seq.wrapping_add(1);
        self.powers.put(&MotorPower { boot, seq: self.seq, echo, power: self.power }, None).map(drop)
    }
}

/// Two sides, and what they say together as one robot.
struct Composed {
    silence: Seconds,
    sides: Sides<Side>,
    encoders: Paced<EncodersData>,
    signals: Paced<Signals>,
    /// When both sides were heard last: the stamp of their distances.
    heard: Option<Seconds>,
}

impl Composed {
    fn new(mesh: &Mesh, robot: &RobotId, params: &ComposedParams) -> anyhow::Result<Self> {
        let gains = WheelGains { full_speed: params.full_speed, kp: params.kp, ki: params.ki };
        let (motors, encoders) = (&params.motors, &params.encoders);
        let left = Side::new(mesh, robot, gains, &motors.left, &encoders.left)?;
        let right = Side::new(mesh, robot, gains, &motors.right, &encoders.right)?;
        Ok(Self {
            silence: params.silence,
            sides: Sides::new(left, right),
            encoders: Paced::new(mesh.publisher(&key::ENCODERS.of(robot))?, params.encoders_hz),
            signals: Paced::new(mesh.publisher(&key::SIGNALS.of(robot))?, 10.0),
            heard: None,
        })
    }
}

impl Wheels for Composed {
    fn hear(&mut self, now: Seconds) -> Result<(), Refusal> {
        // Both are heard, whatever is wrong with one of them.
        let Sides { left, right } = &mut self.sides;
        let heard = (left.hear(now, self.silence), right.hear(now, self.silence));
        heard.0.and(heard.1)?;
        self.heard = Some(now);
        Ok(())
    }
    fn advance(&mut self, now: Seconds, speeds: Sides<MetresPerSecond>) {
        let Sides { left, right } = &mut self.sides;
        for (side, speed) in [(left, speeds.left), (right, speeds.right)] {
            if let Err(refusal) = side.turn(now, speed) {
                tracing::warn!("a power could not be said: {refusal}");
            }
        }
    }
    fn say(&mut self, now: Seconds, cause: Option<Cause>) {
        let Self { sides, encoders, signals, heard, .. } = self;
        let covered = |side: &Side| side.covered.0 + side.covered.1;
        // What was not measured is not said: who drives finds the robot silent.
        if *heard == Some(now) {
            encoders.put(now, cause, || EncodersData {
                stamp: now,
                left: covered(&sides.left),
                right: covered(&sides.right),
            });
        }
        signals.put(now, cause, || Signals { left: sides.left.power, right: sides.right.power });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_file_holds_every_default() {
        let file: toml::Table = toml::from_str(ComposedParams::FILE).expect("a table");
        assert_eq!(file, toml::Table::try_from(ComposedParams::default()).expect("a table"));
        assert!(ComposedParams::default().check().is_ok());
    }

    #[test]
    fn partners_with_wrong_names_are_refused() {
        for text in [
            "[motors]\nleft = \"wheel\"\nright = \"motor-right\"",
            "[motors]\nleft = \"motor-a\"\nright = \"motor-a\"",
            "[encoders]\nleft = \"motor-/\"\nright = \"motor-b\"",
            "[encoders]\nleft = \"gate\"\nright = \"encoder-b\"",
        ] {
            let params: ComposedParams = toml::from_str(text).expect("parameters");
            assert!(params.check().is_err(), "{text:?} is refused");
        }
        let own = "[motors]\nleft = \"motor-a\"\nright = \"motor-b\"\n[encoders]\nleft = \"encoder-a\"\nright = \"motor-b\"";
        assert!(toml::from_str::<ComposedParams>(own).expect("parameters").check().is_ok());
    }
}
