//! What golden files hold of the navigator.

use super::Golden;
use axle_schema::event::{Event, NavigatorEvent, Sensor, Side};
use axle_schema::{
    Boot, EncodersData, GetPosition, Metres, MetresPerSecond, NavigatorData, Numbers, Pose, Position,
    Radians, RadiansPerSecond, Range, Seconds, SetPosition, Twist,
};

pub(super) fn range() -> Range {
    Range {
        stamp: Seconds(12.25),
        x: Metres(2.0),
        y: Metres(-1.5),
        distance: Metres(2.75),
        sd: Metres(0.125),
    }
}

pub(in crate::wire) fn position() -> Position {
    let covariance = Numbers([1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 0.01]);
    Position {
        boot: Boot(7),
        wheels: EncodersData { stamp: Seconds(12.34), left: Metres(1.5), right: Metres(-0.001) },
        odom: NavigatorData {
            stamp: Seconds(12.34),
            pose: Pose::new(1.0, -0.5, 7.0),
            twist: Some(Twist { v: MetresPerSecond(0.3), omega: RadiansPerSecond(-0.1) }),
            covariance: Some(covariance),
        },
        map: Pose::new(3.0, -0.5, 7.0),
        map_covariance: covariance,
        map_to_odom: Pose::new(2.0, 0.0, 0.0),
    }
}

pub(super) fn examples(all: &mut Vec<Golden>) {
    all.push(Golden::new("", range()));
    all.push(Golden::new("", position()));
    all.push(Golden::new("", GetPosition {}));
    let set = SetPosition {
        pose: Pose::new(3.0, -0.5, 0.75),
        covariance: Some(position().map_covariance),
        stamp: Some(Seconds(12.0)),
    };
    all.push(Golden::new("", set));
    all.push(Golden::new("short", SetPosition { covariance: None, stamp: None, ..set }));
    let stamp = Seconds(12.34);
    let events = [
        Event::Kidnapped { stamp, distance: Metres(5.0), squared: 250.0, fixes: 3 },
        Event::Slip { stamp, encoders: Radians(0.25), gyro: Radians(0.125), squared: 40.0 },
        Event::Skid {
            stamp,
            encoders: MetresPerSecond(0.75),
            accelerometer: MetresPerSecond(0.25),
            change: MetresPerSecond(0.0),
            squared: 90.5,
        },
        Event::StuckEncoder {
            stamp,
            side: Side::Left,
            other: Metres(0.0625),
            encoders: Radians(0.5),
            gyro: Radians(0.0),
        },
        Event::Silent { stamp, sensor: Sensor::Gyro, since: Seconds(11.0) },
        Event::GyroScale { stamp, ratio: 57.25 },
    ];
    for event in events {
        let stop = !matches!(event, Event::Silent { .. } | Event::GyroScale { .. });
        all.push(Golden::new(event.name(), NavigatorEvent::new(event, stop)));
    }
}
