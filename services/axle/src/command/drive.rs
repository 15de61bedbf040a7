//! `axle drive …`: the Generic Differential Drive contract from the shell.

mod operation;
mod teleop;
mod watch;

use crate::cli::drive::Drive;
use crate::out::{data, note, table};
use crate::settings::Settings;
use axle_mesh::{Mesh, Retry};
use axle_schema::codec::Message;
use axle_schema::command::Done;
use axle_schema::differential_drive::{
    DriveDistance, DriveStage, DriveState, EnableDrive, GetDrive, ResetEncoders, RotateDegrees,
    SetDrivePower, SetDriveSpeed,
};
use axle_schema::key::Call;
use axle_schema::{Duty, Metres, MetresPerSecond, Refusal, RobotId, Seconds, key};
use operation::Way;
use std::time::Duration;
use tokio::time::{Instant, sleep_until};

/// The drive has this long to answer; it waits for the gate for up to 2 s.
const PATIENCE: Duration = Duration::from_millis(2500);
/// Powers and speeds are renewed at this pace, and hold for so long: a drive that hears nothing more brakes soon.
const RENEWED: (Duration, Seconds) = (Duration::from_millis(150), Seconds(0.5));

/// Does what the command line says.
pub(super) async fn drive(settings: &Settings, args: Drive) -> anyhow::Result<()> {
    // Looked at before anything else: without a terminal there are no keys.
    if let Drive::Teleop { .. } = args {
        teleop::needs_a_terminal()?;
    }
    let robot = settings.one_robot()?;
    let mesh = settings.join("drive-client").await?;
    let client = Client { mesh, robot };
    match args {
        Drive::Power { left, right, time } => {
            let (left, right) = (Duty::new(left)?, Duty::new(right)?);
            let hold = Some(RENEWED.1);
            client.renew(&key::DRIVE_POWER, &SetDrivePower { left, right, hold }, time.seconds).await?;
        }
        Drive::Speed { left, right, time } => {
            let (left, right) = (MetresPerSecond(left), MetresPerSecond(right));
            let hold = Some(RENEWED.1);
            client.renew(&key::DRIVE_SPEED, &SetDriveSpeed { left, right, hold }, time.seconds).await?;
        }
        Drive::Distance { metres, power, json } => {
            let (distance, power, stage) = (Metres(metres), Duty::new(power)?, DriveStage::InitialRequest);
            let request = DriveDistance { distance, power, stage, operation: None, why: None };
            operation::run(&client, Way::Distance(request), json).await?;
        }
        Drive::Rotate { degrees, power, json } => {
            let (power, stage) = (Duty::new(power)?, DriveStage::InitialRequest);
            let request = RotateDegrees { degrees, power, stage, operation: None, why: None };
            operation::run(&client, Way::Rotate(request), json).await?;
        }
        Drive::Reset => {
            let Done {} = client.ask(&key::DRIVE_RESET, &ResetEncoders {}).await?;
            note("the encoders of the drive are at zero");
        }
        Drive::State { json } => show(&client.state().await?, json)?,
        Drive::Watch { json, count } => watch::watch(&client, json, count).await?,
        Drive::Enable => {
            let stop = client.state().await?.stop;
            let Done {} = client.ask(&key::DRIVE_ENABLE, &EnableDrive { enable: true, stop }).await?;
            note(&format!("{} may move", client.robot));
        }
        Drive::Disable => {
            let Done {} = client.ask(&key::DRIVE_ENABLE, &EnableDrive { enable: false, stop: None }).await?;
            note(&format!(
                "{} is stopped and disabled; `axle drive enable` lets it move again",
                client.robot
            ));
        }
        Drive::Teleop { power } => teleop::teleop(&client, power).await?,
    }
    client.mesh.leave().await;
    Ok(())
}

/// A client of the drive of one robot.
struct Client {
    mesh: Mesh,
    robot: RobotId,
}

impl Client {
    async fn ask<Q: Message, A: Message>(&self, call: &Call<Q, A>, question: &Q) -> Result<A, Refusal> {
        // What the drive would refuse is refused here already, in the same words.
        question.check()?;
        self.mesh.ask(call, Some(&self.robot), question, PATIENCE, Retry::Never).await
    }
    async fn state(&self) -> Result<DriveState, Refusal> {
        let patience = Duration::from_secs(3);
        self.mesh.ask(&key::DRIVE_GET, Some(&self.robot), &GetDrive {}, patience, Retry::Idempotent).await
    }
    /// Powers of zero: the end of whatever goes on.
    async fn rest(&self) -> Result<(), Refusal> {
        let Done {} = self.ask(&key::DRIVE_POWER, &SetDrivePower::default()).await?;
        Ok(())
    }
    /// Asks the same again and again for a while, then for rest. Ctrl-C ends it before its time.
    async fn renew<Q: Message>(
        &self,
        call: &Call<Q, Done>,
        question: &Q,
        seconds: f64,
    ) -> anyhow::Result<()> {
        let mut stop = crate::signal::stop()?;
        let end = Instant::now() + Duration::from_secs_f64(seconds);
        while Instant::now() < end && !stop.is_due() {
            let next = (Instant::now() + RENEWED.0).min(end);
            let Done {} = self.ask(call, question).await?;
            tokio::select! {
                () = sleep_until(next) => {}
                () = stop.wait() => {}
            }
        }
        self.rest().await?;
        note("the wheels brake");
        Ok(())
    }
}

fn show(state: &DriveState, json: bool) -> anyhow::Result<()> {
    if json {
        return Ok(data(&serde_json::to_string(state)?)?);
    }
    let sides = [("left", state.wheels.left), ("right", state.wheels.right)];
    let rows = sides.map(|(side, wheel)| {
        vec![
            side.to_owned(),
            format!("{:.2}", wheel.power.get()),
            format!("{:.3}", wheel.speed.0),
            format!("{:.4}", wheel.distance.0),
        ]
    });
    table(&["wheel", "power", "speed m/s", "distance m"], rows)?;
    let enabled = match (state.enabled, state.stop) {
        (true, _) => "enabled".to_owned(),
        (false, Some(stop)) => format!("disabled by AllStop {stop}"),
        (false, None) => "disabled".to_owned(),
    };
    Ok(data(&format!("{enabled}; {}; the wheels are {}", word(&state.operation)?, word(&state.motion)?))?)
}

/// How an enumeration is called on the wire.
fn word(value: &impl serde::Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_value(value)?.as_str().unwrap_or_default().to_owned())
}
