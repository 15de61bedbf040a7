//! Every key of Axle is spelt here, and nowhere else.
//!
//! A key is `axle/<robot>/<service>/<stream>`. It is typed by what it carries, so that a pose cannot be published where
//! encoders are expected. docs/keys.md is generated from [`TABLE`] and checked by a test.
//!
//! Chunks that begin with `@` are hidden from a tap on `axle/**`: presence and status are asked for by name only.

use crate::codec::{Message, decode, schema_of};
use crate::command::{AllStop, Command, Done, Enable, GateState, Lease, LeaseAsk, Release};
use crate::differential_drive::{
    DriveDistance, DriveState, DriveStopped, EnableDrive, GetDrive, MotorPower, MotorReading, OperationBegun,
    ResetEncoders, RotateDegrees, SetDrivePower, SetDriveSpeed, StopDrive,
};
use crate::id::{ALL, Boot, RobotId};
use crate::plan::{Drive, DriveAsk, Plan, PlanAsk};
use crate::presence::{Status, StatusAsk};
use crate::task::{Accepted, Cancel, CorrectorProgress, GoAsk, PilotProgress, Task};
use crate::window::{Window, WindowAsk};
use crate::{Dwm, EncodersData, Fix, InertialData, NavigatorData, Refusal, Signals, WayTask};
use std::fmt;
use std::marker::PhantomData;

mod port;
pub use port::Port;

/// The first chunk of every key.
const ROOT: &str = "axle";

/// How important a stream is on a loaded link; each class has its own queue in Zenoh, so that no class waits for another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Urgency {
    /// Commands and stops.
    Command,
    /// What control loops read: measurements, poses, the gate's state.
    Control,
    /// Tasks and their cancellation.
    Task,
    /// What people and recorders read.
    Report,
}

/// A key that carries `M`.
pub struct Key<M> {
    text: String,
    urgency: Urgency,
    carries: PhantomData<fn() -> M>,
}

impl<M> Key<M> {
    /// The key expression.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.text
    }
    /// How important its samples are.
    #[must_use]
    pub const fn urgency(&self) -> Urgency {
        self.urgency
    }
}
impl<M> Clone for Key<M> {
    fn clone(&self) -> Self {
        Self { text: self.text.clone(), urgency: self.urgency, carries: PhantomData }
    }
}
impl<M> fmt::Debug for Key<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
impl<M> fmt::Display for Key<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// A stream that one service of every robot publishes or hears.
pub struct Stream<M> {
    service: &'static str,
    name: &'static str,
    urgency: Urgency,
    carries: PhantomData<fn() -> M>,
}

impl<M: Message> Stream<M> {
    const fn new(service: &'static str, name: &'static str, urgency: Urgency) -> Self {
        Self { service, name, urgency, carries: PhantomData }
    }
    /// The key of one robot.
    #[must_use]
    pub fn of(&self, robot: &RobotId) -> Key<M> {
        self.key(robot.as_str())
    }
    /// The keys of every robot: for subscribers only.
    #[must_use]
    pub fn of_every_robot(&self) -> Key<M> {
        self.key("*")
    }
    fn key(&self, robot: &str) -> Key<M> {
        let text = format!("{ROOT}/{robot}/{}/{}", self.service, self.name);
        Key { text, urgency: self.urgency, carries: PhantomData }
    }
    const fn entry(&self, about: &'static str) -> Entry {
        Entry {
            service: self.service,
            name: self.name,
            kind: Kind::Stream,
            carries: schema_of::<M>,
            answers: None,
            about,
            json: json::<M>,
        }
    }
}

/// A question `Q` that one service answers with `A`.
pub struct Call<Q, A> {
    service: &'static str,
    name: &'static str,
    carries: PhantomData<fn(Q) -> A>,
}

impl<Q: Message, A: Message> Call<Q, A> {
    const fn new(service: &'static str, name: &'static str) -> Self {
        Self { service, name, carries: PhantomData }
    }
    /// The name of the service that answers.
    #[must_use]
    pub const fn service(&self) -> &'static str {
        self.service
    }
    /// The key of one robot; without a robot, any instance that serves all robots answers.
    #[must_use]
    pub fn of(&self, robot: Option<&RobotId>) -> Key<Q> {
        self.key(robot.map_or(ALL, RobotId::as_str))
    }
    /// What a service that works for every robot declares.
    #[must_use]
    pub fn of_every_robot(&self) -> Key<Q> {
        self.key("*")
    }
    fn key(&self, robot: &str) -> Key<Q> {
        let text = format!("{ROOT}/{robot}/{}/{}", self.service, self.name);
        Key { text, urgency: Urgency::Task, carries: PhantomData }
    }
    const fn entry(&self, about: &'static str) -> Entry {
        Entry {
            service: self.service,
            name: self.name,
            kind: Kind::Call,
            carries: schema_of::<Q>,
            answers: Some(schema_of::<A>),
            about,
            json: json::<Q>,
        }
    }
}

/// Whether a key is published or asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Published to whoever listens.
    Stream,
    /// Asked, and answered once.
    Call,
}

/// One line of the table of keys.
#[derive(Clone, Copy)]
pub struct Entry {
    /// The service in the key.
    pub service: &'static str,
    /// The last chunk of the key.
    pub name: &'static str,
    /// Published or asked.
    pub kind: Kind,
    carries: fn() -> String,
    answers: Option<fn() -> String>,
    /// What it is, for people.
    pub about: &'static str,
    json: ToJson,
}

/// Decodes a payload and shows it as JSON.
type ToJson = fn(&[u8]) -> Result<serde_json::Value, Refusal>;

impl Entry {
    /// The schema of what is published or asked, for example `axle.Dwm.v1`.
    #[must_use]
    pub fn carries(&self) -> String {
        (self.carries)()
    }
    /// The schema of the answer.
    #[must_use]
    pub fn answers(&self) -> Option<String> {
        self.answers.map(|answers| answers())
    }
}

fn json<M: Message>(bytes: &[u8]) -> Result<serde_json::Value, Refusal> {
    serde_json::to_value(decode::<M>(bytes)?).map_err(Refusal::internal)
}

/// Wheel distances, measured by the board or the emulator.
pub const ENCODERS: Stream<EncodersData> = Stream::new("robot", "encoders", Urgency::Control);
/// Turn rate and accelerations, measured by the board or the emulator.
pub const INERTIAL: Stream<InertialData> = Stream::new("robot", "inertial", Urgency::Control);
/// Absolute positions.
pub const FIX: Stream<Fix> = Stream::new("robot", "fix", Urgency::Control);
/// Duty cycles given to the motors.
pub const SIGNALS: Stream<Signals> = Stream::new("robot", "signals", Urgency::Report);
/// The true pose of an emulated robot.
pub const TRUTH: Stream<NavigatorData> = Stream::new("emulator", "truth", Urgency::Report);
/// Movements for the wheels.
pub const COMMAND: Stream<Command> = Stream::new("gate", "command", Urgency::Command);
/// Stops the wheels.
pub const STOP: Stream<AllStop> = Stream::new("gate", "stop", Urgency::Command);
/// The gate's account.
pub const GATE_STATE: Stream<GateState> = Stream::new("gate", "state", Urgency::Control);
/// Asks for the right to command the wheels.
pub const LEASE: Call<LeaseAsk, Lease> = Call::new("gate", "lease");
/// Gives the right back.
pub const RELEASE: Call<Release, Done> = Call::new("gate", "release");
/// Allows the wheels to move again.
pub const ENABLE: Call<Enable, Done> = Call::new("gate", "enable");
/// The latest measurements.
pub const RECENT: Stream<Window> = Stream::new("source", "recent", Urgency::Control);
/// Older measurements.
pub const WINDOW: Call<WindowAsk, Window> = Call::new("source", "window");
/// The estimated pose.
pub const POSE: Stream<NavigatorData> = Stream::new("navigator", "pose", Urgency::Control);
/// Way points to geometries.
pub const PLAN: Call<PlanAsk, Plan> = Call::new("pathfinder", "plan");
/// Geometries to movements.
pub const DRIVE: Call<DriveAsk, Drive> = Call::new("pathdriver", "drive");
/// Drives a task.
pub const GO: Call<GoAsk, Accepted> = Call::new("pilot", "go");
/// Ends a task before its time.
pub const GO_CANCEL: Call<Cancel, Done> = Call::new("pilot", "cancel");
/// How far the pilot is.
pub const GO_PROGRESS: Stream<PilotProgress> = Stream::new("pilot", "progress", Urgency::Report);
/// The task that the pilot took.
pub const GO_WAY: Stream<Task<WayTask>> = Stream::new("pilot", "way", Urgency::Report);
/// The plan that the pilot drives.
pub const GO_PLAN: Stream<Task<Plan>> = Stream::new("pilot", "plan", Urgency::Report);
/// The movements that the pilot has driven.
pub const GO_DRIVE: Stream<Task<Drive>> = Stream::new("pilot", "drive", Urgency::Report);

/// Generic Differential Drive: stops and disables.
pub const DRIVE_ALL_STOP: Call<StopDrive, DriveStopped> = Call::new("drive", "all-stop");
/// Generic Differential Drive: enables or disables.
pub const DRIVE_ENABLE: Call<EnableDrive, Done> = Call::new("drive", "enable");
/// Generic Differential Drive: the powers of both wheels.
pub const DRIVE_POWER: Call<SetDrivePower, Done> = Call::new("drive", "power");
/// Generic Differential Drive: the speeds of both wheels.
pub const DRIVE_SPEED: Call<SetDriveSpeed, Done> = Call::new("drive", "speed");
/// Generic Differential Drive: a distance straight on.
pub const DRIVE_DISTANCE: Call<DriveDistance, OperationBegun> = Call::new("drive", "distance");
/// Generic Differential Drive: an angle on the spot.
pub const DRIVE_ROTATE: Call<RotateDegrees, OperationBegun> = Call::new("drive", "rotate");
/// Generic Differential Drive: the encoders of its state to zero.
pub const DRIVE_RESET: Call<ResetEncoders, Done> = Call::new("drive", "reset-encoders");
/// Generic Differential Drive: its state.
pub const DRIVE_GET: Call<GetDrive, DriveState> = Call::new("drive", "get");
/// Generic Differential Drive: its state, on change.
pub const DRIVE_UPDATE: Stream<DriveState> = Stream::new("drive", "update", Urgency::Report);
/// Generic Differential Drive: the stages of a distance.
pub const DRIVE_DISTANCE_STAGE: Stream<DriveDistance> =
    Stream::new("drive", "distance-stage", Urgency::Report);
/// Generic Differential Drive: the stages of a turn.
pub const DRIVE_ROTATE_STAGE: Stream<RotateDegrees> = Stream::new("drive", "rotate-stage", Urgency::Report);

/// Where the motor `service` hears its power.
#[must_use]
pub const fn motor_power(service: &'static str) -> Stream<MotorPower> {
    Stream::new(service, "power", Urgency::Command)
}
/// Where the motor or encoder `service` says what it measures.
#[must_use]
pub const fn motor_reading(service: &'static str) -> Stream<MotorReading> {
    Stream::new(service, "reading", Urgency::Control)
}

/// Where the corrector `service` takes its tasks of plan `P`.
#[must_use]
pub const fn corrector_task<P>(service: &'static str) -> Stream<Task<P>>
where
    Task<P>: Message,
{
    Stream::new(service, "task", Urgency::Task)
}
/// Where the corrector `service` hears that a task shall end.
#[must_use]
pub const fn corrector_cancel(service: &'static str) -> Stream<Cancel> {
    Stream::new(service, "cancel", Urgency::Task)
}
/// Where the corrector `service` says how far it is.
#[must_use]
pub const fn corrector_progress(service: &'static str) -> Stream<CorrectorProgress> {
    Stream::new(service, "progress", Urgency::Control)
}

/// There and back again: the streams of `axle bench mesh`.
pub const BENCH: (Stream<NavigatorData>, Stream<NavigatorData>) =
    (Stream::new("bench", "there", Urgency::Control), Stream::new("bench", "back", Urgency::Control));

/// Stands for the name of any corrector in [`TABLE`].
pub const ANY_CORRECTOR: &str = "<corrector>";

/// Stands for the name of any motor or encoder service in [`TABLE`].
pub const ANY_MOTOR: &str = "<motor>";

/// All keys, in the order of the way of a task.
pub const TABLE: &[Entry] = &[
    GO.entry("Take a task: plan it and drive it."),
    GO_CANCEL.entry("End a task before its time."),
    GO_PROGRESS.entry("How far the task is."),
    GO_WAY.entry("The task that was taken."),
    GO_PLAN.entry("Pathfinder's answer for the task."),
    GO_DRIVE.entry("Pathdriver's answer for the task."),
    PLAN.entry("Turn way points into geometries."),
    DRIVE.entry("Turn geometries into movements."),
    corrector_task::<Drive>(ANY_CORRECTOR)
        .entry("A task for a corrector: movements (d, ltv), or a plan, `PlanTask` (all others)."),
    corrector_cancel(ANY_CORRECTOR).entry("End a corrector's task before its time."),
    corrector_progress(ANY_CORRECTOR).entry("What the corrector does at every beat: due against real."),
    LEASE.entry("Get the right to command the wheels."),
    RELEASE.entry("Give it back."),
    COMMAND.entry("A movement for the wheels, now."),
    STOP.entry("Stop the wheels at once; latches."),
    ENABLE.entry("Allow the wheels to move after a stop or a boot."),
    GATE_STATE.entry("What the gate does, and why."),
    DRIVE_ALL_STOP.entry("Contract: stop, take the power from the wheels, disable."),
    DRIVE_ENABLE.entry("Contract: enable or disable the drive."),
    DRIVE_POWER.entry("Contract: set the powers of both wheels."),
    DRIVE_SPEED.entry("Contract: set the speeds of both wheels."),
    DRIVE_DISTANCE.entry("Contract: drive straight by a distance."),
    DRIVE_ROTATE.entry("Contract: turn on the spot by an angle."),
    DRIVE_RESET.entry("Contract: set the encoders of the drive to zero."),
    DRIVE_GET.entry("Contract: the state of the drive."),
    DRIVE_UPDATE.entry("Contract: the state of the drive, on change."),
    DRIVE_DISTANCE_STAGE.entry("Contract: a distance was started, completed or cancelled."),
    DRIVE_ROTATE_STAGE.entry("Contract: a turn was started, completed or cancelled."),
    motor_power(ANY_MOTOR).entry("The power of one motor."),
    motor_reading(ANY_MOTOR).entry("What one motor or encoder measures."),
    ENCODERS.entry("Distance of each wheel since boot."),
    INERTIAL.entry("Turn rate and accelerations."),
    FIX.entry("An absolute position."),
    SIGNALS.entry("Duty cycles of the motors."),
    TRUTH.entry("Where an emulated robot really is."),
    RECENT.entry("The newest measurements, as correctors and the navigator read them."),
    WINDOW.entry("Older measurements."),
    POSE.entry("Where the robot believes to be."),
];

/// The name of a schema, and how to show what it describes.
type Reader = (fn() -> String, ToJson);

/// Message types that may stand in an encoding, beside those of [`TABLE`].
const MORE_TYPES: &[Reader] = &[
    (schema_of::<Dwm>, json::<Dwm>),
    (schema_of::<Plan>, json::<Plan>),
    (schema_of::<Drive>, json::<Drive>),
    (schema_of::<Lease>, json::<Lease>),
    (schema_of::<Status>, json::<Status>),
    (schema_of::<StatusAsk>, json::<StatusAsk>),
    (schema_of::<DriveStopped>, json::<DriveStopped>),
    (schema_of::<OperationBegun>, json::<OperationBegun>),
];

/// What a key is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place<'a> {
    /// The robot, or `all`.
    pub robot: &'a str,
    /// The service.
    pub service: &'a str,
    /// The stream or call.
    pub name: &'a str,
}

/// Takes a concrete key apart; `None` for keys that are not of this shape.
#[must_use]
pub fn place(key: &str) -> Option<Place<'_>> {
    let mut chunks = key.split('/');
    let (root, robot, service, name) = (chunks.next()?, chunks.next()?, chunks.next()?, chunks.next()?);
    (root == ROOT && chunks.next().is_none()).then_some(Place { robot, service, name })
}

/// The line of the table that describes a concrete key.
#[must_use]
pub fn find(key: &str) -> Option<&'static Entry> {
    let place = place(key)?;
    find_port(place.service, place.name)
}

fn find_port(service: &str, name: &str) -> Option<&'static Entry> {
    TABLE.iter().find(|entry| {
        let corrector = entry.service == ANY_CORRECTOR && service.ends_with("-corrector");
        let is_motor = service.starts_with("motor-") || service.starts_with("encoder-");
        let motor = entry.service == ANY_MOTOR && is_motor;
        (corrector || motor || entry.service == service) && entry.name == name
    })
}

/// Decodes a sample into JSON by the schema that its encoding names, or else by its key.
///
/// # Errors
/// [`Refusal::Unknown`] when neither is known, and what [`decode`] refuses.
pub fn to_json(key: &str, encoding: &str, bytes: &[u8]) -> Result<serde_json::Value, Refusal> {
    let named = encoding.split_once(';').map(|(_, schema)| schema).filter(|schema| !schema.is_empty());
    let reader = match named {
        Some(schema) => TABLE
            .iter()
            .map(|entry| (entry.carries, entry.json))
            .chain(MORE_TYPES.iter().copied())
            .find(|(name, _)| name() == schema)
            .map(|(_, reader)| reader),
        None => find(key).map(|entry| entry.json),
    };
    let Some(reader) = reader else {
        let got = named
            .map_or_else(|| key.chars().take(120).collect(), |schema| schema.chars().take(120).collect());
        return Err(Refusal::Unknown { what: "message type".into(), got, known: "see docs/keys.md".into() });
    };
    reader(bytes)
}

/// The keys of one process: that it is alive, and its status.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Presence {
    /// The robot it serves, or `all`.
    pub robot: String,
    /// The catalogue name of its service.
    pub service: String,
    /// Its computer.
    pub host: String,
    /// Its process id there.
    pub pid: u32,
    /// Its run.
    pub boot: Boot,
}

impl Presence {
    /// The key of the liveliness token. It holds the boot, so that two processes never share a token.
    #[must_use]
    pub fn alive(&self) -> String {
        let Self { robot, service, host, pid, boot } = self;
        format!("{ROOT}/{robot}/@alive/{service}/{}/{pid}/{boot}", chunk(host))
    }
    /// The key at which the process answers for itself.
    #[must_use]
    pub fn status(&self) -> String {
        let Self { robot, service, boot, .. } = self;
        format!("{ROOT}/{robot}/@status/{service}/{boot}")
    }
    /// Every token.
    #[must_use]
    pub fn every_token() -> String {
        format!("{ROOT}/*/@alive/**")
    }
    /// Every status.
    #[must_use]
    pub fn every_status() -> String {
        format!("{ROOT}/*/@status/**")
    }
    /// The tokens of one service.
    #[must_use]
    pub fn tokens_of(robot: &str, service: &str) -> String {
        format!("{ROOT}/{robot}/@alive/{service}/**")
    }
    /// The statuses of one service.
    #[must_use]
    pub fn statuses_of(robot: &str, service: &str) -> String {
        format!("{ROOT}/{robot}/@status/{service}/*")
    }
    /// Reads the key of a token; `None` for keys of another shape.
    #[must_use]
    pub fn read(token: &str) -> Option<Self> {
        let chunks: Vec<&str> = token.split('/').collect();
        let [root, robot, "@alive", service, host, pid, boot] = chunks[..] else { return None };
        (root == ROOT).then_some(Self {
            robot: robot.to_owned(),
            service: service.to_owned(),
            host: host.to_owned(),
            pid: pid.parse().ok()?,
            boot: Boot(u64::from_str_radix(boot, 16).ok()?),
        })
    }
}

/// A host name made fit for a chunk of a key: how [`Presence::read`] gives it back.
#[must_use]
pub fn chunk(name: &str) -> String {
    let mut chunk: String = name
        .chars()
        .take(64)
        .map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' })
        .collect();
    if chunk.is_empty() {
        chunk.push_str("unknown");
    }
    chunk
}

/// Every key of one robot, or of all: what a tap or a recorder hears.
#[must_use]
pub fn everything(robot: Option<&RobotId>) -> String {
    robot.map_or_else(|| format!("{ROOT}/**"), |robot| format!("{ROOT}/{robot}/**"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_spelt_once_and_found_again() {
        let r1 = RobotId::new("r1").expect("a robot");
        assert_eq!(ENCODERS.of(&r1).as_str(), "axle/r1/robot/encoders");
        assert_eq!(PLAN.of_every_robot().as_str(), "axle/*/pathfinder/plan");
        assert_eq!(PLAN.of(None).as_str(), "axle/all/pathfinder/plan");
        assert_eq!(find("axle/r1/robot/encoders").expect("known").carries(), "axle.EncodersData.v1");
        assert_eq!(
            find("axle/r1/d-corrector/progress").expect("known").carries(),
            "axle.CorrectorProgress.v1"
        );
        assert!(find("axle/r1/robot/encoders/more").is_none());
        assert!(find("other/r1/robot/encoders").is_none());
    }

    #[test]
    fn a_token_is_read_back() {
        let presence = Presence {
            robot: "r1".into(),
            service: "pathfinder".into(),
            host: "lab".into(),
            pid: 7,
            boot: Boot(0xabc),
        };
        assert_eq!(Presence::read(&presence.alive()), Some(presence));
        assert_eq!(Presence::read("axle/r1/@alive/x"), None);
    }

    #[test]
    fn a_robot_with_a_slash_is_refused() {
        for name in ["a/b", "R1", "", "all", "r*", "é", &"x".repeat(33)] {
            assert!(RobotId::new(name).is_err(), "{name:?} is refused");
        }
        let text = RobotId::new("a/b").expect_err("a slash").to_string();
        assert!(text.contains("a/b") && text.contains("'/'"), "{text}");
    }
}
