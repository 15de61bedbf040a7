//! Examples of the messages of a real board.

use super::Golden;
use axle_schema::board::{
    Amperes, BatteryData, BoardState, ContactsData, LineFaults, LinkState, ServoAngle, Share,
};
use axle_schema::{Radians, Refusal, Seconds, Sides};

pub(super) fn examples(all: &mut Vec<Golden>) {
    let up = BoardState {
        stamp: Seconds(12.5),
        board: "roomba".into(),
        port: "ttyUSB0".into(),
        link: LinkState::Up,
        version: Some("Open Interface, create2, safe mode".into()),
        why: None,
        opened: 2,
        restarts: 1,
        faults: LineFaults {
            garbage: 3,
            overlong: 1,
            checksum: 4,
            half: 1,
            absurd: 5,
            refused: 9,
            unanswered: 2,
            missed: 6,
            flooded: 7,
        },
    };
    all.push(Golden::new("", up.clone()));
    for (variant, link) in
        [("absent", LinkState::Absent), ("greeting", LinkState::Greeting), ("halted", LinkState::Halted)]
    {
        let why = Some(Refusal::unavailable("the port ttyUSB0", "it was unplugged"));
        all.push(Golden::new(variant, BoardState { link, version: None, why, ..up.clone() }));
    }
    all.push(Golden::new(
        "",
        ContactsData {
            stamp: Seconds(1.5),
            bump: Sides::new(true, false),
            drop: Sides::new(false, false),
            cliff: Sides::new(false, true),
        },
    ));
    let battery = BatteryData {
        stamp: Seconds(2.5),
        voltage: 14.25,
        current: Some(Amperes(-0.3)),
        left: Some(Share(0.75)),
    };
    all.push(Golden::new("", battery));
    all.push(Golden::new("short", BatteryData { current: None, left: None, ..battery }));
    all.push(Golden::new("", ServoAngle { angle: Radians(-0.5) }));
}
