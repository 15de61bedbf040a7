//! The table of all keys: what is generated from keys, and what reads them, goes through it.

use super::*;
use std::collections::HashMap;
use std::sync::LazyLock;

/// All keys, in the order of the way of a task.
pub const TABLE: &[Entry] = &[
    GO.entry("Take a task: plan it and drive it."),
    GO_CANCEL.entry("End a task before its time."),
    CONFIRM.entry("A person confirms that the robot may drive on."),
    GO_PROGRESS.entry("How far the task is."),
    GO_WAY.entry("The task that was taken."),
    GO_PLAN.entry("Pathfinder's answer for the task."),
    GO_DRIVE.entry("Pathdriver's answer for the task."),
    PLAN.entry("Turn way points into geometries."),
    PLAN_ANSWERED.entry("What Pathfinder was asked, and what it answered."),
    PLAN_PROGRESS.entry("How far a long search for a plan is."),
    PLAN_CANCEL.entry("End a search for a plan."),
    MAP.entry("The map that robots share."),
    DRIVE.entry("Turn geometries into movements."),
    CLAIM.entry("Say what of a way is behind, and hear how far a robot of a fleet may drive."),
    TRAFFIC.entry("Who of a fleet waits for whom, and in which order they go."),
    DRIVE_ANSWERED.entry("What Pathdriver was asked, and what it answered."),
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
    RANGE.entry("The distance to a known point."),
    SIGNALS.entry("Duty cycles of the motors."),
    board::BOARD_ENTRY,
    board::CONTACTS_ENTRY,
    board::BATTERY_ENTRY,
    board::SERVO_ENTRIES[0],
    board::SERVO_ENTRIES[1],
    board::SERVO_ENTRIES[2],
    board::SERVO_ENTRIES[3],
    MOTORS.entry("Duty cycles with stamps, and counts before any calibration."),
    CALIBRATION.entry("The calibration that is applied."),
    CALIBRATE.entry("Apply a calibration and keep it; for whoever holds the wheels, while they stand."),
    RAW.entry("Drive the motors without the calibration, for as long as a lease."),
    TO_SIGNALS.entry("Speeds to signals."),
    TO_SPEEDS.entry("Signals to speeds."),
    TRUTH.entry("Where an emulated robot really is."),
    RECENT.entry("The newest measurements, as correctors and the navigator read them."),
    WINDOW.entry("Older measurements."),
    POSE.entry("Where the robot believes to be, in `odom`."),
    POSITION.entry("Where the robot believes to be, in `odom` and in `map`: ten times a second, and when a fix moves it."),
    NAVIGATOR_EVENT.entry("Kidnapped, slip, stuck or silent sensor: what was noticed, and whether to stop."),
    GET_POSITION.entry("Where the robot believes to be, now."),
    SET_POSITION.entry("Tell it where it is: uncertainty restarts, earlier measurements are obsolete."),
    log_of(ANY_SERVICE).entry("What the service logs."),
    trace(ANY_SERVICE).entry("What a corrector, source or navigator worked from when it spoke: for replay."),
];

/// Message types that may stand in an encoding, beside those of [`TABLE`].
const MORE_TYPES: &[Reader] = &[
    (schema_of::<Dwm>, json::<Dwm>),
    (schema_of::<Plan>, json::<Plan>),
    (schema_of::<Drive>, json::<Drive>),
    (schema_of::<MapData>, json::<MapData>),
    (schema_of::<Lease>, json::<Lease>),
    (schema_of::<Calibrated>, json::<Calibrated>),
    (schema_of::<Status>, json::<Status>),
    (schema_of::<StatusAsk>, json::<StatusAsk>),
    (schema_of::<DriveStopped>, json::<DriveStopped>),
    (schema_of::<OperationBegun>, json::<OperationBegun>),
    (schema_of::<SetLog>, json::<SetLog>),
];

/// Every schema that this program reads, and how. Taps look into it for every sample, so its names are made once.
pub(super) static READERS: LazyLock<HashMap<String, ToJson>> = LazyLock::new(|| {
    let of_keys = TABLE.iter().map(|entry| (entry.carries, entry.json));
    of_keys.chain(MORE_TYPES.iter().copied()).map(|(name, reader)| (name(), reader)).collect()
});
