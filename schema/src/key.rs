//! Every key of Axle is spelt here, and nowhere else.
//!
//! A key is `axle/<robot>/<service>/<stream>`. It is typed by what it carries, so that a pose cannot be published where
//! encoders are expected. docs/keys.md is generated from [`TABLE`] and checked by a test.
//!
//! Chunks that begin with `@` are hidden from a tap on `axle/**`: presence and status are asked for by name only.

use crate::calibration::{Calibrate, Calibrated, GetCalibration, Raw, SignalsData, WheelSpeeds};
use crate::codec::{Message, decode, schema_of};
use crate::command::{AllStop, Command, Done, Enable, GateState, Lease, LeaseAsk, Release};
use crate::differential_drive::{
    DriveDistance, DriveState, DriveStopped, EnableDrive, GetDrive, MotorPower, MotorReading, OperationBegun,
    ResetEncoders, RotateDegrees, SetDrivePower, SetDriveSpeed, StopDrive,
};
use crate::id::{ALL, Boot, RobotId};
use crate::log::{LogLine, SetLog};
use crate::map::{MapAsk, MapData};
use crate::plan::{Drive, DriveAsk, Plan, PlanAsk, PlanProgress};
use crate::presence::{Status, StatusAsk};
use crate::task::{Accepted, Cancel, CorrectorProgress, GoAsk, PilotProgress, Task};
use crate::trace::{Answered, Trace};
use crate::traffic::{Claim, Clearance, Confirm, TrafficAsk, TrafficState};
use crate::window::{Window, WindowAsk};
use crate::{
    Dwm, EncodersData, Fix, GetPosition, InertialData, NavigatorData, NavigatorEvent, Position, Range,
    Refusal, SetPosition, Signals, WayTask,
};
use std::fmt;
use std::marker::PhantomData;

mod board;
mod port;
mod table;
pub use board::{BATTERY, BOARD, CONTACTS, SERVOS};
pub use port::Port;
use table::READERS;
pub use table::TABLE;

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
    /// The key of a service that works for every robot.
    #[must_use]
    pub fn of_all_robots(&self) -> Key<M> {
        self.key(ALL)
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

/// Decodes a payload and writes it as JSON.
type ToJson = fn(&[u8]) -> Result<String, Refusal>;

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

fn json<M: Message>(bytes: &[u8]) -> Result<String, Refusal> {
    serde_json::to_string(&decode::<M>(bytes)?).map_err(Refusal::internal)
}

/// Wheel distances, measured by the board or the emulator.
pub const ENCODERS: Stream<EncodersData> = Stream::new("robot", "encoders", Urgency::Control);
/// Turn rate and accelerations, measured by the board or the emulator.
pub const INERTIAL: Stream<InertialData> = Stream::new("robot", "inertial", Urgency::Control);
/// Absolute positions.
pub const FIX: Stream<Fix> = Stream::new("robot", "fix", Urgency::Control);
/// Distances to known points.
pub const RANGE: Stream<Range> = Stream::new("robot", "range", Urgency::Control);
/// Duty cycles given to the motors.
pub const SIGNALS: Stream<Signals> = Stream::new("robot", "signals", Urgency::Report);
/// Duty cycles with their stamps, and what the encoders counted before any calibration.
pub const MOTORS: Stream<SignalsData> = Stream::new("robot", "motors", Urgency::Report);
/// The calibration that the owner of the wheels applies.
pub const CALIBRATION: Call<GetCalibration, Calibrated> = Call::new("robot", "calibration");
/// Has a calibration applied and kept.
pub const CALIBRATE: Call<Calibrate, Done> = Call::new("robot", "calibrate");
/// Lets the speeds of a lease go to the motors without the calibration.
pub const RAW: Call<Raw, Done> = Call::new("robot", "raw");
/// Speeds to signals.
pub const TO_SIGNALS: Call<WheelSpeeds, Signals> = Call::new("calibrator", "signals");
/// Signals to speeds.
pub const TO_SPEEDS: Call<Signals, WheelSpeeds> = Call::new("calibrator", "speeds");
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
/// The estimated pose in both frames, and how `odom` lies in `map`.
pub const POSITION: Stream<Position> = Stream::new("navigator", "position", Urgency::Control);
/// What is not as it should be.
pub const NAVIGATOR_EVENT: Stream<NavigatorEvent> = Stream::new("navigator", "event", Urgency::Task);
/// Where the robot is.
pub const GET_POSITION: Call<GetPosition, Position> = Call::new("navigator", "get-position");
/// An absolute reference.
pub const SET_POSITION: Call<SetPosition, Position> = Call::new("navigator", "set-position");
/// Way points to geometries.
pub const PLAN: Call<PlanAsk, Plan> = Call::new("pathfinder", "plan");
/// How far a search for a plan is.
pub const PLAN_PROGRESS: Stream<PlanProgress> = Stream::new("pathfinder", "progress", Urgency::Report);
/// Ends a search for a plan.
pub const PLAN_CANCEL: Stream<Cancel> = Stream::new("pathfinder", "cancel", Urgency::Task);
/// The map that robots share.
pub const MAP: Call<MapAsk, MapData> = Call::new("map", "get");
/// Geometries to movements.
pub const DRIVE: Call<DriveAsk, Drive> = Call::new("pathdriver", "drive");
/// Drives a task.
pub const GO: Call<GoAsk, Accepted> = Call::new("pilot", "go");
/// A person's word that the robot may drive on.
pub const CONFIRM: Call<Confirm, Done> = Call::new("pilot", "confirm");
/// Where a robot of a fleet is, and how far it may drive.
pub const CLAIM: Call<Claim, Clearance> = Call::new("traffic", "claim");
/// Who waits for whom.
pub const TRAFFIC: Call<TrafficAsk, TrafficState> = Call::new("traffic", "state");
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

/// What the service `service` logs.
#[must_use]
pub const fn log_of(service: &'static str) -> Stream<LogLine> {
    Stream::new(service, "log", Urgency::Report)
}
/// What every service of a robot logs, or of all of them: for subscribers only.
#[must_use]
pub fn every_log(robot: Option<&RobotId>) -> Key<LogLine> {
    log_of("*").key(robot.map_or("*", RobotId::as_str))
}
/// What the service `service` worked from.
#[must_use]
pub const fn trace(service: &'static str) -> Stream<Trace> {
    Stream::new(service, "trace", Urgency::Report)
}
/// What Pathfinder was asked and answered.
pub const PLAN_ANSWERED: Stream<Answered<PlanAsk, Plan>> =
    Stream::new("pathfinder", "answered", Urgency::Report);
/// What Pathdriver was asked and answered.
pub const DRIVE_ANSWERED: Stream<Answered<DriveAsk, Drive>> =
    Stream::new("pathdriver", "answered", Urgency::Report);

/// There and back again: the streams of `axle bench mesh`.
pub const BENCH: (Stream<NavigatorData>, Stream<NavigatorData>) =
    (Stream::new("bench", "there", Urgency::Control), Stream::new("bench", "back", Urgency::Control));

/// Stands for the name of any corrector in [`TABLE`].
pub const ANY_CORRECTOR: &str = "<corrector>";

/// Stands for the name of any motor or encoder service in [`TABLE`].
pub const ANY_MOTOR: &str = "<motor>";

/// Stands for the name of any service in [`TABLE`].
pub const ANY_SERVICE: &str = "<service>";

/// The name of a schema, and how to show what it describes.
type Reader = (fn() -> String, ToJson);

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

/// A key of this shape for another robot; others stay as they are.
#[must_use]
pub fn moved(key: &str, robot: &RobotId) -> String {
    match place(key) {
        Some(Place { service, name, .. }) => format!("{ROOT}/{robot}/{service}/{name}"),
        None => key.to_owned(),
    }
}

/// The line of the table that describes a concrete key.
#[must_use]
pub fn find(key: &str) -> Option<&'static Entry> {
    let place = place(key)?;
    find_port(place.service, place.name)
}

/// The line of the table that describes the last two chunks of a key, for example `navigator/pose`.
#[must_use]
pub fn find_stream(port: &str) -> Option<&'static Entry> {
    let (service, name) = port.split_once('/')?;
    find_port(service, name)
}

fn find_port(service: &str, name: &str) -> Option<&'static Entry> {
    TABLE.iter().find(|entry| {
        let corrector = entry.service == ANY_CORRECTOR && service.ends_with("-corrector");
        let is_motor = service.starts_with("motor-") || service.starts_with("encoder-");
        let motor = entry.service == ANY_MOTOR && is_motor;
        let any = corrector || motor || entry.service == ANY_SERVICE;
        (any || entry.service == service) && entry.name == name
    })
}

/// Whether this program reads samples of this schema, for example `axle.Dwm.v1`.
#[must_use]
pub fn knows(schema: &str) -> bool {
    READERS.contains_key(schema)
}

/// Decodes a sample and writes it as JSON, by the schema that its encoding names, or else by its key.
///
/// # Errors
/// [`Refusal::Unknown`] when neither is known, and what [`decode`] refuses.
pub fn to_json(key: &str, encoding: &str, bytes: &[u8]) -> Result<String, Refusal> {
    let named = encoding.split_once(';').map(|(_, schema)| schema).filter(|schema| !schema.is_empty());
    let reader = match named {
        Some(schema) => READERS.get(schema).copied(),
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
    /// The key at which the process is told how much to log.
    #[must_use]
    pub fn log_level(&self) -> Key<SetLog> {
        let Self { robot, service, boot, .. } = self;
        let text = format!("{ROOT}/{robot}/@log/{service}/{boot}");
        Key { text, urgency: Urgency::Report, carries: PhantomData }
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
    /// The tokens of one service; the robot may be `*`.
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
