//! What was heard of the robot while it moved, by its own clock.
//!
//! The channels are set right when they are heard, as far as the wiring is known by then. Lists are bounded: a stage of
//! the procedure is short, and what comes beyond is not kept.

use axle_schema::calibration::Wiring;
use axle_schema::{EncodersData, InertialData, Sides, SignalsData};

/// The most readings of each kind: 200 in a second for a minute.
const MOST: usize = 12_000;
/// A gyroscope that was silent for longer than this has not felt what happened meanwhile, s.
const GAP: f64 = 0.25;

/// Both wheels at a time.
pub(crate) type Reading = (f64, Sides<f64>);

/// Turn rate and forward acceleration, the means since the reading before.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Felt {
    pub(crate) stamp: f64,
    pub(crate) rate: f64,
    pub(crate) ahead: Option<f64>,
}

/// The readings of one stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    pub(crate) signals: Vec<Reading>,
    pub(crate) counts: Vec<Reading>,
    pub(crate) felt: Vec<Felt>,
    pub(crate) motors: Wiring,
    pub(crate) encoders: Wiring,
}

impl Log {
    pub(crate) fn signals(&mut self, data: &SignalsData) {
        let wheels = self.motors.to_wheels(Sides::new(data.left.get(), data.right.get()));
        push(&mut self.signals, data.stamp.0, wheels);
    }
    pub(crate) fn counts(&mut self, data: &EncodersData) {
        let wheels = self.encoders.to_wheels(Sides::new(data.left.0, data.right.0));
        push(&mut self.counts, data.stamp.0, wheels);
    }
    pub(crate) fn feel(&mut self, data: &InertialData) {
        let is_newer = self.felt.last().is_none_or(|last| data.stamp.0 > last.stamp);
        if is_newer && self.felt.len() < MOST {
            let ahead = data.ax.map(|ax| ax.0);
            self.felt.push(Felt { stamp: data.stamp.0, rate: data.gyro.0, ahead });
        }
    }
    /// Forgets all but the last of each kind, so that nothing is missing between two stages.
    pub(crate) fn clear(&mut self) {
        let keep = |length: usize| length.saturating_sub(1);
        self.signals.drain(..keep(self.signals.len()));
        self.counts.drain(..keep(self.counts.len()));
        self.felt.drain(..keep(self.felt.len()));
    }
    /// Keeps the newest readings only, as what they are now that the wiring is known.
    pub(crate) fn rewire(&mut self, motors: Wiring, encoders: Wiring) {
        self.clear();
        for (_, signals) in &mut self.signals {
            *signals = motors.to_wheels(self.motors.to_channels(*signals));
        }
        for (_, counts) in &mut self.counts {
            *counts = encoders.to_wheels(self.encoders.to_channels(*counts));
        }
        (self.motors, self.encoders) = (motors, encoders);
    }
    /// The newest stamp of the encoders: the clock that everything goes by.
    pub(crate) fn now(&self) -> Option<f64> {
        self.counts.last().map(|(stamp, _)| *stamp)
    }

    /// What the wheels have counted between two times.
    pub(crate) fn counted(&self, from: f64, to: f64) -> Option<Sides<f64>> {
        Some(at(&self.counts, to)?.zip(at(&self.counts, from)?, |end, start| end - start))
    }

    /// The integral of the signals between two times.
    pub(crate) fn impulse(&self, from: f64, to: f64) -> Option<Sides<f64>> {
        let mut sum = Sides::new(0.0, 0.0);
        let mut last = (from, at(&self.signals, from)?);
        let inside = self.signals.iter().copied().filter(|(stamp, _)| *stamp > from && *stamp < to);
        for next in inside.chain([(to, at(&self.signals, to)?)]) {
            let area = last.1.zip(next.1, |a, b| f64::midpoint(a, b) * (next.0 - last.0));
            sum = sum.zip(area, |sum, area| sum + area);
            last = next;
        }
        Some(sum)
    }

    /// How far the robot turned between two times, with a bias taken off; `None` where the gyroscope was silent.
    pub(crate) fn turned(&self, from: f64, to: f64, bias: f64) -> Option<f64> {
        self.sum(from, to, |felt| Some(felt.rate - bias))
    }
    /// How much faster ahead it got.
    pub(crate) fn sped_up(&self, from: f64, to: f64, bias: f64) -> Option<f64> {
        self.sum(from, to, |felt| felt.ahead.map(|ahead| ahead - bias))
    }
    /// The means of turn rate and forward acceleration between two times, over how long.
    pub(crate) fn rest(&self, from: f64, to: f64) -> Option<(f64, Option<f64>)> {
        let span = to - from;
        (span > 0.0).then_some(())?;
        let rate = self.turned(from, to, 0.0)? / span;
        Some((rate, self.sped_up(from, to, 0.0).map(|sum| sum / span)))
    }

    fn sum(&self, from: f64, to: f64, value: impl Fn(&Felt) -> Option<f64>) -> Option<f64> {
        let (mut sum, mut covered) = (0.0, from);
        for pair in self.felt.windows(2) {
            let (begin, end) = (pair[0].stamp.max(from), pair[1].stamp.min(to));
            if end > begin {
                // A reading is the mean since the one before.
                (begin <= covered + 1e-9 && pair[1].stamp - pair[0].stamp <= GAP).then_some(())?;
                sum += value(&pair[1])? * (end - begin);
                covered = end;
            }
        }
        (covered >= to - 1e-9).then_some(sum)
    }

    /// The spans in which the signals stayed the same and not nothing, for as long as `least` at least.
    pub(crate) fn plateaus(&self, least: f64) -> Vec<(f64, f64)> {
        let mut found: Vec<(f64, f64)> = Vec::new();
        let mut begin: Option<Reading> = None;
        let close = |begin: Option<Reading>, end: f64, found: &mut Vec<(f64, f64)>| {
            if let Some((from, level)) = begin
                && end - from >= least
                && level.both().iter().any(|signal| signal.abs() > 1e-6)
            {
                found.push((from, end));
            }
        };
        for pair in self.signals.windows(2) {
            let same = pair[0].1.zip(pair[1].1, |a, b| (a - b).abs() < 1e-6);
            if same.left && same.right {
                begin = begin.or(Some(pair[0]));
            } else {
                close(begin.take(), pair[0].0, &mut found);
            }
        }
        if let Some((end, _)) = self.signals.last() {
            close(begin, *end, &mut found);
        }
        found
    }
}

fn push(list: &mut Vec<Reading>, stamp: f64, wheels: Sides<f64>) {
    if list.len() < MOST && list.last().is_none_or(|(last, _)| stamp > *last) {
        list.push((stamp, wheels));
    }
}

/// The value at a time, along straight lines between readings; `None` before the first and beyond the last one.
fn at(list: &[Reading], time: f64) -> Option<Sides<f64>> {
    let after = list.partition_point(|(stamp, _)| *stamp < time);
    let (to, high) = *list.get(after)?;
    #[allow(clippy::float_cmp, reason = "a reading of this very time")]
    if to == time {
        return Some(high);
    }
    let (from, low) = *list.get(after.checked_sub(1)?)?;
    Some(low.zip(high, |low, high| low + (high - low) * ((time - from) / (to - from))))
}

/// Distance, speed and acceleration of a wheel in the middle of a span, by a parabola through its readings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Local {
    pub(crate) time: f64,
    pub(crate) distance: f64,
    pub(crate) speed: f64,
    pub(crate) acceleration: f64,
}

impl Log {
    /// The parabola of one wheel between two times.
    pub(crate) fn local(&self, from: f64, to: f64, wheel: impl Fn(Sides<f64>) -> f64) -> Option<Local> {
        let time = f64::midpoint(from, to);
        let (mut rows, mut targets) = (Vec::new(), Vec::new());
        let origin = wheel(at(&self.counts, time)?);
        for (stamp, counts) in self.counts.iter().filter(|(stamp, _)| (from..=to).contains(stamp)) {
            let t = stamp - time;
            rows.push([1.0, t, t * t / 2.0]);
            targets.push(wheel(*counts) - origin);
        }
        let ([offset, speed, acceleration], _) = crate::statistics::least_squares(&rows, &targets)?;
        Some(Local { time, distance: origin + offset, speed, acceleration })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Duty, Metres, RadiansPerSecond, Seconds};

    fn filled() -> Log {
        let mut log = Log::default();
        for step in 0..=100_u32 {
            let stamp = Seconds(f64::from(step) * 0.02);
            // Up within 0.4 s, the same for 1.2 s, down.
            let level = (stamp.0 / 0.4).min(1.0).min((2.0 - stamp.0) / 0.4) * 0.5;
            let duty = Duty::new(level.clamp(0.0, 1.0)).expect("a share");
            log.signals(&SignalsData { stamp, left: duty, ..SignalsData::default() });
            log.counts(&EncodersData { stamp, left: Metres(stamp.0 * stamp.0), right: Metres(-stamp.0) });
            log.feel(&InertialData { stamp, gyro: RadiansPerSecond(0.5), ax: None, ay: None });
        }
        log
    }

    #[test]
    fn integrals_go_along_the_lines_between_readings() {
        let log = filled();
        let impulse = log.impulse(0.1, 1.01).expect("signals");
        let exact = 0.5 * (0.61 + 0.3 * f64::midpoint(0.25, 1.0));
        assert!((impulse.left - exact).abs() < 1e-12, "{impulse:?}");
        assert!((log.turned(0.1, 1.01, 0.1).expect("a gyroscope") - 0.4 * 0.91).abs() < 1e-12);
        assert_eq!(log.sped_up(0.1, 1.0, 0.0), None, "there is no accelerometer");
        assert_eq!(log.turned(0.1, 2.5, 0.0), None, "nothing was felt after 2 s");
        let plateaus = log.plateaus(0.5);
        assert!(
            plateaus.len() == 1 && (plateaus[0].0 - 0.4).abs() < 0.021 && (plateaus[0].1 - 1.6).abs() < 0.021
        );
    }

    #[test]
    fn a_parabola_gives_speed_and_acceleration() {
        let local = filled().local(0.5, 1.0, |wheels| wheels.left).expect("readings");
        assert!((local.speed - 1.5).abs() < 1e-9 && (local.acceleration - 2.0).abs() < 1e-9, "{local:?}");
    }
}
