//! What golden files hold of calibrations.

use super::Golden;
use axle_schema::calibration::{
    Branch, Calibrate, Calibrated, GetCalibration, Raw, SignalsData, WheelMap, WheelSpeeds, Wiring,
};
use axle_schema::unit::{Numbers, Ratio};
use axle_schema::{
    Boot, Calibration, Duty, Metres, MetresPerSecond, MetresPerSecondSquared, Seconds, Sides, Track,
};

fn duty(value: f64) -> Duty {
    Duty::new(value).expect("within full power")
}

fn calibration() -> Calibration {
    let line = Branch { dead_band: 0.05, ks: 0.02, kv: 0.85, ka: 0.04, ..Branch::default() };
    let bent = Branch { curve: vec![Ratio(0.1), Ratio(-0.02)], ..line.clone() };
    let points = vec![Numbers([0.1, 0.12]), Numbers([0.5, 0.45])];
    Calibration {
        version: 3,
        made: "by calibrate@lab/12".into(),
        track: Some(Track::new(Metres(0.31)).expect("a track")),
        scale: Sides::new(Ratio(1.01), Ratio(0.99)),
        motors: Wiring { swapped: true, inverted: Sides::new(false, true) },
        encoders: Wiring::default(),
        wheels: Sides::new(
            WheelMap { forward: line.clone(), backward: bent },
            WheelMap { forward: Branch { points, ..line.clone() }, backward: line },
        ),
    }
}

pub(super) fn examples(all: &mut Vec<Golden>) {
    all.push(Golden::new("", calibration()));
    all.push(Golden::new("none", Calibration::default()));
    all.push(Golden::new("", Calibrate { boot: Boot(7), epoch: 2, calibration: calibration() }));
    all.push(Golden::new("", GetCalibration {}));
    let track = Track::new(Metres(0.3)).expect("a track");
    let calibrated = Calibrated {
        calibration: Calibration::default(),
        full_speed: MetresPerSecond(1.2),
        track,
        wheel_speed: MetresPerSecond(1.0),
        wheel_acceleration: MetresPerSecondSquared(1.5),
        keeps_speeds: false,
    };
    all.push(Golden::new("speeds", Calibrated { keeps_speeds: true, ..calibrated.clone() }));
    all.push(Golden::new("", calibrated));
    all.push(Golden::new("", Raw { boot: Boot(7), epoch: 2 }));
    let signals = SignalsData {
        stamp: Seconds(12.34),
        left: duty(0.25),
        right: duty(-0.5),
        counted: Some(Sides::new(Metres(1.5), Metres(-0.25))),
    };
    all.push(Golden::new("", signals));
    all.push(Golden::new("short", SignalsData { counted: None, ..signals }));
    let accelerations = Some(Sides::new(MetresPerSecondSquared(0.5), MetresPerSecondSquared(-0.5)));
    let speeds = WheelSpeeds { left: MetresPerSecond(0.3), right: MetresPerSecond(-0.1), accelerations };
    all.push(Golden::new("", speeds));
    all.push(Golden::new("short", WheelSpeeds { accelerations: None, ..speeds }));
}
