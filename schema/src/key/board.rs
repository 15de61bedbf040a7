//! The streams of a real board, beside those that an emulated robot has too.

use super::{Entry, Stream, Urgency};
use crate::board::{BatteryData, BoardState, ContactsData, ServoAngle};

/// The bridge's account of its board.
pub const BOARD: Stream<BoardState> = Stream::new("robot", "board", Urgency::Report);
/// What the robot touches.
pub const CONTACTS: Stream<ContactsData> = Stream::new("robot", "contacts", Urgency::Control);
/// What the battery gives.
pub const BATTERY: Stream<BatteryData> = Stream::new("robot", "battery", Urgency::Report);
/// Where each servo shall turn to, by its number.
pub const SERVOS: [Stream<ServoAngle>; 4] = [
    Stream::new("robot", "servo-0", Urgency::Command),
    Stream::new("robot", "servo-1", Urgency::Command),
    Stream::new("robot", "servo-2", Urgency::Command),
    Stream::new("robot", "servo-3", Urgency::Command),
];

pub(super) const BOARD_ENTRY: Entry =
    BOARD.entry("How the line to a real board is, and what was wrong with its bytes.");
pub(super) const CONTACTS_ENTRY: Entry =
    CONTACTS.entry("What a real robot touches: bumpers, cliffs, lifted wheels.");
pub(super) const BATTERY_ENTRY: Entry = BATTERY.entry("Voltage, current and charge of a real robot.");
pub(super) const SERVO_ENTRIES: [Entry; 4] = [
    SERVOS[0].entry("Turn the first servo."),
    SERVOS[1].entry("Turn the second servo."),
    SERVOS[2].entry("Turn the third servo."),
    SERVOS[3].entry("Turn the fourth servo."),
];
