//! A client of the contract that knows nothing of the drive but its keys.

use axle_mesh::{Inbox, Mesh, Retry};
use axle_schema::codec::{Message, encode};
use axle_schema::command::{Done, Motion};
use axle_schema::differential_drive::{
    DriveDistance, DriveStage, DriveState, DriveStopped, EnableDrive, GetDrive, OperationBegun,
    ResetEncoders, RotateDegrees, SetDrivePower, SetDriveSpeed, StopDrive,
};
use axle_schema::{Duty, Metres, MetresPerSecond, Refusal, RobotId, Sides, TaskId, key};
use std::time::Duration;
use tokio::time::{Instant, sleep};

/// A drive has this long to answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// What a drive shall do at all, it does within this time.
pub(super) const SOON: Duration = Duration::from_secs(2);
/// How often the state is asked for while something is awaited.
const LOOK: Duration = Duration::from_millis(40);

/// A notification of a controlled motion.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stage {
    pub(super) operation: Option<TaskId>,
    pub(super) stage: DriveStage,
    pub(super) why: Option<Refusal>,
}

/// Asks one drive, and hears its notifications.
pub(super) struct Client {
    mesh: Mesh,
    robot: RobotId,
    /// The wheel speed that a power of 1 asks for, m/s, as the drive says.
    full_speed: f64,
    pub(super) updates: Inbox<DriveState>,
    distances: Inbox<DriveDistance>,
    turns: Inbox<RotateDegrees>,
    /// The notifications since the clause began, in the order in which they came, as far as that can be known: each
    /// kind has a key of its own.
    pub(super) stages: Vec<Stage>,
}

/// A power, from -1 to 1.
pub(super) fn duty(power: f64) -> Duty {
    Duty::new(power.clamp(-1.0, 1.0)).unwrap_or_default()
}

impl Client {
    pub(super) fn new(mesh: &Mesh, robot: &RobotId) -> anyhow::Result<Self> {
        Ok(Self {
            mesh: mesh.clone(),
            robot: robot.clone(),
            full_speed: 1.0,
            updates: mesh.inbox(&key::DRIVE_UPDATE.of(robot), 256)?,
            distances: mesh.inbox(&key::DRIVE_DISTANCE_STAGE.of(robot), 64)?,
            turns: mesh.inbox(&key::DRIVE_ROTATE_STAGE.of(robot), 64)?,
            stages: Vec::new(),
        })
    }

    /// How long a wheel may take for a way, m, with a power: twice as long as at full speed, and 3 s for the rest.
    pub(super) fn time_for(&self, way: f64, power: f64) -> Duration {
        let seconds = 3.0 + 2.0 * way.abs() / (power.abs() * self.full_speed).max(0.01);
        Duration::from_secs_f64(seconds.min(60.0))
    }
    async fn ask<Q: Message, A: Message>(&self, call: &key::Call<Q, A>, ask: Q) -> Result<A, Refusal> {
        self.mesh.ask(call, Some(&self.robot), &ask, PATIENCE, Retry::Never).await
    }
    pub(super) async fn get(&self) -> Result<DriveState, Refusal> {
        self.ask(&key::DRIVE_GET, GetDrive {}).await
    }
    pub(super) async fn stop(&self) -> Result<DriveStopped, Refusal> {
        self.ask(&key::DRIVE_ALL_STOP, StopDrive { by: "axle conform".into() }).await
    }
    pub(super) async fn enable(&self, enable: EnableDrive) -> Result<Done, Refusal> {
        self.ask(&key::DRIVE_ENABLE, enable).await
    }
    pub(super) async fn power(&self, left: f64, right: f64) -> Result<Done, Refusal> {
        self.ask(&key::DRIVE_POWER, SetDrivePower { left: duty(left), right: duty(right), hold: None }).await
    }
    pub(super) async fn speed(&self, left: f64, right: f64) -> Result<Done, Refusal> {
        let (left, right) = (MetresPerSecond(left), MetresPerSecond(right));
        self.ask(&key::DRIVE_SPEED, SetDriveSpeed { left, right, hold: None }).await
    }
    pub(super) async fn distance(&self, metres: f64, power: f64) -> Result<OperationBegun, Refusal> {
        let (distance, power, stage) = (Metres(metres), duty(power), DriveStage::InitialRequest);
        self.ask(&key::DRIVE_DISTANCE, DriveDistance { distance, power, stage, operation: None, why: None })
            .await
    }
    /// A request that no typed client would send: the number `fine` in it is replaced by `odd`.
    pub(super) async fn odd<Q: Message, A: Message>(
        &self,
        call: &key::Call<Q, A>,
        ask: &Q,
        fine: f64,
        odd: f64,
    ) -> Result<A, Refusal> {
        let mut bytes = encode(ask)?;
        let fine = fine.to_be_bytes();
        let at = bytes.windows(8).position(|window| window == fine);
        let at = at.ok_or_else(|| Refusal::internal("the number is not in the request"))?;
        bytes[at..at + 8].copy_from_slice(&odd.to_be_bytes());
        self.mesh.ask_bytes(call, Some(&self.robot), &bytes, PATIENCE).await
    }
    pub(super) async fn rotate(&self, degrees: f64, power: f64) -> Result<OperationBegun, Refusal> {
        let (power, stage) = (duty(power), DriveStage::InitialRequest);
        self.ask(&key::DRIVE_ROTATE, RotateDegrees { degrees, power, stage, operation: None, why: None })
            .await
    }
    pub(super) async fn reset(&self) -> Result<Done, Refusal> {
        self.ask(&key::DRIVE_RESET, ResetEncoders {}).await
    }

    /// Brings the drive to rest, enabled, with nothing said that has not been heard.
    pub(super) async fn settle(&mut self) -> Result<(), Refusal> {
        let state = self.get().await?;
        if state.full_speed.0 > 0.0 {
            self.full_speed = state.full_speed.0;
        }
        if !state.enabled {
            self.enable(EnableDrive { enable: true, stop: state.stop }).await?;
        }
        self.power(0.0, 0.0).await?;
        self.until(SOON, |state| state.enabled && state.motion == Motion::Standing).await?;
        self.hear();
        while self.updates.take().is_some() {}
        self.stages.clear();
        Ok(())
    }

    /// Asks for the state until it is so; the last one in any case, and whether it came to be so.
    pub(super) async fn look(
        &mut self,
        patience: Duration,
        is_so: impl Fn(&DriveState) -> bool,
    ) -> Result<(DriveState, bool), Refusal> {
        let end = Instant::now() + patience;
        loop {
            self.hear();
            let state = self.get().await?;
            let is_so = is_so(&state);
            if is_so || Instant::now() >= end {
                return Ok((state, is_so));
            }
            sleep(LOOK).await;
        }
    }

    /// The same, where it must come to be so.
    pub(super) async fn until(
        &mut self,
        patience: Duration,
        is_so: impl Fn(&DriveState) -> bool,
    ) -> Result<DriveState, Refusal> {
        match self.look(patience, is_so).await? {
            (state, true) => Ok(state),
            (state, false) => {
                let (operation, motion) = (state.operation, state.motion);
                let why =
                    format!("after {patience:?} it is {operation:?}, {motion:?}, enabled: {}", state.enabled);
                Err(Refusal::Failed { why })
            }
        }
    }

    /// Waits for a stage of an operation.
    pub(super) async fn stage(&mut self, operation: TaskId, stage: DriveStage, patience: Duration) -> bool {
        let end = Instant::now() + patience;
        loop {
            self.hear();
            if self.position(operation, stage).is_some() {
                return true;
            }
            if Instant::now() >= end {
                return false;
            }
            sleep(LOOK).await;
        }
    }
    /// Where a notification stands among those that came.
    pub(super) fn position(&self, operation: TaskId, stage: DriveStage) -> Option<usize> {
        self.stages.iter().position(|said| said.operation == Some(operation) && said.stage == stage)
    }
    /// The stages of one operation, in their order.
    pub(super) fn stages_of(&self, operation: TaskId) -> Vec<DriveStage> {
        let own = self.stages.iter().filter(|said| said.operation == Some(operation));
        own.map(|said| said.stage).collect()
    }

    /// How far both wheels go while `moving` is awaited, by the encoders of the state.
    pub(super) async fn wheels(&self) -> Result<Sides<f64>, Refusal> {
        Ok(self.get().await?.wheels.map(|wheel| wheel.distance.0))
    }

    pub(super) fn hear(&mut self) {
        while let Some(heard) = self.distances.take() {
            let DriveDistance { operation, stage, why, .. } = heard.message;
            self.stages.push(Stage { operation, stage, why });
        }
        while let Some(heard) = self.turns.take() {
            let RotateDegrees { operation, stage, why, .. } = heard.message;
            self.stages.push(Stage { operation, stage, why });
        }
    }
}
