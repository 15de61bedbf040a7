//! The functional service: speeds to signals, and back.

use crate::{CalibratorParams, Map};
use axle_schema::calibration::WheelSpeeds;
use axle_schema::contract::Functional;
use axle_schema::{Metres, Refusal, Sides, Signals, Track};

/// Speeds to signals.
#[derive(Debug)]
pub struct ToSignals;

/// Signals to speeds.
#[derive(Debug)]
pub struct ToSpeeds;

/// The robot as it was measured: its track is its own, so that nothing is stretched.
fn map(params: &CalibratorParams) -> Result<Map, Refusal> {
    let track = params.0.track.map_or_else(|| Track::new(Metres(1.0)), Ok)?;
    Map::new(params.0.clone(), track)
}

impl Functional for ToSignals {
    type Params = CalibratorParams;
    type Ask = WheelSpeeds;
    type Answer = Signals;
    fn answer(params: &Self::Params, ask: &Self::Ask) -> Result<Self::Answer, Refusal> {
        Ok(map(params)?.signals(Sides::new(ask.left, ask.right), ask.accelerations.unwrap_or_default()))
    }
}

impl Functional for ToSpeeds {
    type Params = CalibratorParams;
    type Ask = Signals;
    type Answer = WheelSpeeds;
    fn answer(params: &Self::Params, ask: &Self::Ask) -> Result<Self::Answer, Refusal> {
        let Sides { left, right } = map(params)?.speeds(*ask);
        Ok(WheelSpeeds { left, right, accelerations: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::MetresPerSecond;

    #[test]
    fn the_answer_of_one_is_the_question_of_the_other() {
        let params = CalibratorParams::default();
        let ask =
            WheelSpeeds { left: MetresPerSecond(0.6), right: MetresPerSecond(-0.3), accelerations: None };
        let signals = ToSignals::answer(&params, &ask).expect("signals");
        let back = ToSpeeds::answer(&params, &signals).expect("speeds");
        assert!((back.left - ask.left).0.abs() < 1e-12 && (back.right - ask.right).0.abs() < 1e-12);
    }
}
