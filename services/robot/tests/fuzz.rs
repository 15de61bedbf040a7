//! Any bytes to both ends of every line: nothing panics, nothing grows, and nothing but finite numbers comes out.
//!
//! A short run is part of every test run. A long one, with the same cases every time:
//! `PROPTEST_CASES=80000 PROPTEST_RNG_SEED=1 cargo test --locked -p axle-robot --test fuzz`.
//! `.ci/run fuzz` runs one seed after the other for a minute.

use axle_robot::firmware::{Body, Quirks, firmware};
use axle_robot::{BoardKind, Bridge, Dialect, RobotParams, RoombaParams};
use axle_schema::{MetresPerSecond, Seconds, Sides};
use proptest::prelude::*;

/// Every board, by speeds and by powers, and the dialects of the Open Interface.
fn all() -> Vec<(BoardKind, RobotParams)> {
    let dialect = |dialect| RobotParams {
        roomba: RoombaParams { dialect, ..Default::default() },
        ..Default::default()
    };
    let mut all: Vec<_> = BoardKind::ALL.map(|kind| (kind, RobotParams::default())).to_vec();
    all.push((BoardKind::Roomba, dialect(Dialect::Create1)));
    all.push((BoardKind::Roomba, dialect(Dialect::Roomba400)));
    all.extend(BoardKind::ALL.map(|kind| (kind, told_powers())));
    all
}

/// Boards that are told powers, and whose motors give the speeds that they shall.
fn told_powers() -> RobotParams {
    let mut params = RobotParams::default();
    params.arduino.powers = true;
    params.roomba.powers = true;
    params.eddie.powers = true;
    params.dwm_text.powers = true;
    params.robot.wheel_speed = MetresPerSecond(0.5);
    params
}

/// Bytes as they might come: noise, and pieces of what real boards say.
fn any_bytes() -> impl Strategy<Value = Vec<u8>> {
    let words = [
        "\r\n",
        "57600\r\n",
        "OK\r\n",
        "1 2\r\n",
        "000A\r",
        "DIST",
        "V1.2\n",
        "L40\n",
        "SR01P\n",
        "M 1 2 3 4 5 6 7 8*",
    ];
    prop_oneof![
        prop::collection::vec(any::<u8>(), 0..200),
        prop::collection::vec(prop::sample::select(&[19_u8, 33, 7, 9, 12, 35, 43, 44, 0, 255][..]), 0..200),
        prop::collection::vec(prop::sample::select(words.to_vec()), 0..20)
            .prop_map(|words| words.concat().into_bytes()),
    ]
}

proptest! {
    #[test]
    fn any_bytes_leave_every_bridge_whole(
        pieces in prop::collection::vec((any_bytes(), 0.0..0.3, -1e3..1e3_f64), 1..30), which in 0_usize..12,
    ) {
        let (kind, params) = all().swap_remove(which);
        let mut bridge = Bridge::new(&params, kind, "port").expect("parameters");
        let mut now = Seconds(0.0);
        let mut out = Vec::new();
        bridge.opened(now, &mut out);
        for (bytes, span, speed) in pieces {
            now += Seconds(span);
            bridge.hear(now, &bytes);
            out.clear();
            bridge.beat(now, Sides::new(MetresPerSecond(speed), MetresPerSecond(f64::NAN)), &mut out);
            // What is said in one beat is less than a line holds in one.
            prop_assert!(out.len() < 128, "{}", out.len());
            if let Some(encoders) = bridge.news().encoders {
                prop_assert!(encoders.left.is_finite() && encoders.right.is_finite());
            }
            if let Some(why) = bridge.hangs_up() {
                bridge.closed(why);
                bridge.opened(now, &mut out);
            }
            let _ = bridge.health(now);
            prop_assert!(bridge.state(now).version.is_none_or(|version| version.len() <= 96));
        }
    }

    #[test]
    fn any_bytes_leave_every_firmware_whole(
        pieces in prop::collection::vec((any_bytes(), 0.0..0.3), 1..30), which in 0_usize..12,
    ) {
        let (kind, params) = all().swap_remove(which);
        let mut board = firmware(kind, &params, Quirks { old_scale: true, ..Quirks::default() });
        let (mut now, mut out) = (Seconds(0.0), Vec::new());
        for (bytes, span) in pieces {
            now += Seconds(span);
            out.clear();
            board.hear(now, &bytes, &mut out);
            let asked = board.beat(now, &Body { voltage: 1e9, ..Body::default() }, &mut out);
            prop_assert!(asked.left.0.abs() <= 1e6 && asked.right.0.abs() <= 1e6, "{asked:?}");
            prop_assert!(out.len() < 20_000);
        }
    }
}
