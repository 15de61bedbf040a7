//! The watch: compares, while the robot does its work, what it does with what its calibration says, and proposes a better
//! one. It sends nothing, and changes nothing by itself.
//!
//! What is heard is cut into windows of a second. In each, a wheel that ran in one direction all the time tells by how
//! much its motor is stronger or weaker than the map; a turn that the gyroscope felt tells the track, and a straight way
//! the ratio of the wheels. A proposal needs so many windows that the interval of a number leaves out what is in force,
//! and a difference that matters.

use crate::log::Log;
use crate::statistics::{Estimate, of_passes};
use crate::{Map, map};
use axle_schema::calibration::{Branch, WheelMap};
use axle_schema::unit::{Numbers, Ratio};
use axle_schema::{
    Calibration, EncodersData, InertialData, Metres, Refusal, Seconds, Sides, SignalsData, Track,
};
use std::collections::VecDeque;

/// The length of a window, s.
const WINDOW: f64 = 1.0;
/// So many windows are needed, and so many are remembered.
const LEAST: usize = 10;
const MOST: usize = 120;
/// A number that is off by less than this share is good enough.
const MATTERS: f64 = 0.01;
const MATTERS_OF_BODY: f64 = 0.003;
/// A window tells something of a motor when its wheel covers so much, m; of the ratio of the wheels, when the robot goes
/// so far without turning by more than this; and of the track, when it turns by more than that, rad.
const WAY: f64 = 0.08;
const STRAIGHT: (f64, f64) = (0.15, 0.05);
const TURN: f64 = 0.3;

/// The windows of one number: by which factor it is off.
type Windows = VecDeque<f64>;

/// A comparison that is under way.
#[derive(Clone, Debug)]
pub struct Watch {
    calibration: Calibration,
    described: Track,
    log: Log,
    bias: Option<f64>,
    /// By wheel, then ahead and back.
    motors: Sides<[Windows; 2]>,
    track: Windows,
    ratio: Windows,
}

/// What should be changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The names of the numbers, and by which factor they are off, with intervals of 95 %.
    pub changes: Vec<(String, Estimate)>,
    /// The calibration with these changes.
    pub calibration: Calibration,
}

impl Watch {
    /// Watches a robot with this calibration, that is described with this track.
    ///
    /// # Errors
    /// As [`Map::new`].
    pub fn new(calibration: Calibration, described: Track) -> Result<Self, Refusal> {
        let map = Map::new(calibration, described)?;
        let calibration = map.calibration().clone();
        let log = Log { motors: calibration.motors, encoders: calibration.encoders, ..Log::default() };
        let motors = Sides::default();
        let (track, ratio) = (Windows::new(), Windows::new());
        Ok(Self { calibration, described, log, bias: None, motors, track, ratio })
    }

    /// Hears what was given to the motors and what the encoders counted.
    pub fn hear_signals(&mut self, data: &SignalsData) {
        self.log.signals(data);
        if let Some(Sides { left, right }) = data.counted {
            self.log.counts(&EncodersData { stamp: data.stamp, left, right });
        }
        let span = |list: &[crate::log::Reading]| Some((list.first()?.0, list.last()?.0));
        if let Some((from, to)) = span(&self.log.signals)
            && to - from >= WINDOW
        {
            self.compare(from, to);
            self.log.clear();
        }
    }
    /// Hears what the gyroscope feels.
    pub fn hear_inertial(&mut self, data: &InertialData) {
        self.log.feel(data);
    }

    fn compare(&mut self, from: f64, to: f64) {
        // A gap in what was heard is no window.
        if to - from > 2.0 * WINDOW {
            return;
        }
        let Some(counted) = self.log.counted(from, to) else { return };
        let way = counted.zip(self.calibration.scale, |counted, scale| counted * scale.0);
        let (wheels, scale) = (self.calibration.wheels.clone(), self.calibration.scale);
        let left = self.motor(&wheels.left, scale.left.0, |both| both.left);
        let right = self.motor(&wheels.right, scale.right.0, |both| both.right);
        for (found, windows) in [(left, &mut self.motors.left), (right, &mut self.motors.right)] {
            if let Some((ahead, factor)) = found {
                remember(&mut windows[usize::from(!ahead)], factor);
            }
        }
        // The gyroscope may be a reading behind: its window ends where its readings do.
        let Some(felt) = self.log.felt.last().map(|felt| felt.stamp.min(to)) else { return };
        let begin = self.log.felt.first().map_or(from, |felt| felt.stamp.max(from));
        let (Some(raw), Some(meant)) = (self.log.turned(begin, felt, 0.0), self.log.counted(begin, felt))
        else {
            return;
        };
        if way.both().iter().all(|way| way.abs() < 1e-9) {
            let rate = raw / (felt - begin).max(0.1);
            self.bias = Some(self.bias.map_or(rate, |bias| bias + 0.2 * (rate - bias)));
            return;
        }
        let Some(bias) = self.bias else { return };
        let turned = raw - bias * (felt - begin);
        let meant = meant.zip(self.calibration.scale, |counted, scale| counted * scale.0);
        let track = self.calibration.track.unwrap_or(self.described).get();
        let (turn, ahead) = ((meant.right - meant.left) / track, f64::midpoint(meant.left, meant.right));
        if turn.abs() > TURN {
            remember(&mut self.track, turn / turned);
        } else if ahead.abs() > STRAIGHT.0 && turn.abs() < STRAIGHT.1 {
            remember(&mut self.ratio, 1.0 + (turned - turn) * track / ahead);
        }
    }

    /// The direction of a wheel, and by which factor it needs more signal for its speed than the map says.
    fn motor(&self, wheel: &WheelMap, scale: f64, pick: fn(Sides<f64>) -> f64) -> Option<(bool, f64)> {
        let ahead = pick(self.log.signals.first()?.1) > 0.0;
        let branch: &Branch = if ahead { &wheel.forward } else { &wheel.backward };
        // Near rest friction decides, of which the map knows too little.
        let least = 1.1 * branch.dead_band.max(branch.ks) + 0.01;
        let runs = |signal: f64| (signal > 0.0) == ahead && signal.abs() > least;
        self.log.signals.iter().all(|(_, signals)| runs(pick(*signals))).then_some(())?;
        let speeds = |(stamp, signals): &crate::log::Reading| (*stamp, map::speed(wheel, pick(*signals)));
        let meant: f64 = self
            .log
            .signals
            .windows(2)
            .map(|pair| {
                let (from, to) = (speeds(&pair[0]), speeds(&pair[1]));
                f64::midpoint(from.1, to.1) * (to.0 - from.0)
            })
            .sum();
        let (begin, end) = (self.log.signals.first()?.0, self.log.signals.last()?.0);
        let slope = |from: f64, to: f64| Some(self.log.local(from, to, pick)?.speed * scale);
        let gained = slope(end - 0.2, end)? - slope(begin, begin + 0.2)?;
        let way = pick(self.log.counted(begin, end)?) * scale;
        // By its inertia the wheel is behind what is meant, by its time constant.
        let due = meant - branch.ka / branch.kv * gained;
        (way.abs() > WAY && due * way > 0.0).then(|| (ahead, due / way))
    }

    /// What should be changed, if anything should.
    #[must_use]
    pub fn proposal(&self) -> Option<Proposal> {
        let mut changes = Vec::new();
        let mut calibration =
            Calibration { version: self.calibration.version.saturating_add(1), ..self.calibration.clone() };
        let mut says = |name: String, windows: &Windows, matters: f64| -> Option<f64> {
            let passes: Vec<f64> = windows.iter().copied().collect();
            let estimate = of_passes(&passes, 0.0).filter(|_| passes.len() >= LEAST)?;
            let is_news = !estimate.holds(1.0) && (estimate.value - 1.0).abs() > matters;
            is_news.then(|| {
                changes.push((name, estimate));
                estimate.value
            })
        };
        for (side, windows, wheel) in [
            ("left", &self.motors.left, &mut calibration.wheels.left),
            ("right", &self.motors.right, &mut calibration.wheels.right),
        ] {
            let ways = [
                ("forward", &windows[0], &mut wheel.forward),
                ("backward", &windows[1], &mut wheel.backward),
            ];
            for (way, windows, branch) in ways {
                if let Some(factor) = says(format!("{side} {way} kv"), windows, MATTERS) {
                    branch.kv *= factor;
                    branch.ka *= factor;
                    branch.points =
                        branch.points.iter().map(|Numbers([v, s])| Numbers([v / factor, *s])).collect();
                }
            }
        }
        if let Some(factor) = says("track".into(), &self.track, MATTERS_OF_BODY) {
            let track = self.calibration.track.unwrap_or(self.described).get();
            calibration.track = Track::new(Metres(track * factor)).ok();
        }
        if let Some(factor) = says("wheel ratio".into(), &self.ratio, MATTERS_OF_BODY) {
            // The mean stays what it is: no turn can tell the length of a metre.
            let Sides { left, right } = self.calibration.scale.map(|scale| scale.0);
            let mean = (left + right) / (left + right * factor);
            calibration.scale = Sides::new(Ratio(left * mean), Ratio(right * factor * mean));
        }
        (!changes.is_empty() && calibration.validate().is_ok()).then_some(Proposal { changes, calibration })
    }

    /// Goes on with another calibration: what was seen of the one before is forgotten.
    ///
    /// # Errors
    /// As [`Map::new`].
    pub fn adopt(&mut self, calibration: Calibration) -> Result<(), Refusal> {
        let bias = self.bias;
        *self = Self { bias, ..Self::new(calibration, self.described)? };
        Ok(())
    }

    /// How many windows of a second told something.
    #[must_use]
    pub fn windows(&self) -> usize {
        let of = |windows: &[Windows; 2]| windows[0].len() + windows[1].len();
        of(&self.motors.left) + of(&self.motors.right) + self.track.len() + self.ratio.len()
    }

    /// The newest stamp that was heard.
    #[must_use]
    pub fn now(&self) -> Option<Seconds> {
        self.log.now().map(Seconds)
    }
}

fn remember(windows: &mut Windows, factor: f64) {
    // A wheel that is stuck, lifted or slips tells nothing of a calibration.
    if (0.5..2.0).contains(&factor) {
        if windows.len() >= MOST {
            windows.pop_front();
        }
        windows.push_back(factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Rig;
    use axle_emulator::{EmulatorParams, WheelsParams};
    use axle_schema::{Dwm, MetresPerSecond};

    /// Drives to and fro and round about for a while, under watch.
    fn watched(params: EmulatorParams, calibration: &Calibration) -> Watch {
        let mut rig = Rig::new(params, Some(calibration.clone()));
        let mut watch = Watch::new(calibration.clone(), params.robot.track).expect("a watch");
        let mut last = Sides::new(0.0, 0.0);
        for beat in 0..9000_u32 {
            if beat.is_multiple_of(4) {
                watch.hear_inertial(&rig.robot.inertial());
                let counted = rig.robot.encoders().sides();
                watch.hear_signals(&SignalsData { counted: Some(counted), ..rig.signals });
            }
            if beat.is_multiple_of(10) {
                let wish = match (beat / 600) % 5 {
                    0 => Sides::new(0.0, 0.0),
                    1 => Sides::new(0.4, 0.4),
                    2 => Sides::new(-0.3, 0.3),
                    3 => Sides::new(-0.35, -0.35),
                    _ => Sides::new(0.3, -0.3),
                };
                let next = last.zip(wish, |from: f64, to: f64| from + (to - from).clamp(-0.05, 0.05));
                let ends = [last, next].map(|both| both.map(MetresPerSecond));
                rig.command(Dwm::new(ends[0], ends[1], Seconds(0.05)).expect("finite"));
                last = next;
            }
            rig.beat();
        }
        watch
    }

    #[test]
    fn a_robot_that_is_as_calibrated_gives_no_proposal() {
        let params = EmulatorParams::default();
        let mut calibration = Calibration::default();
        // What the seed has drawn for its gains is what the calibration knows.
        let first = watched(params, &calibration);
        if let Some(proposal) = first.proposal() {
            calibration = proposal.calibration;
        }
        let watch = watched(params, &calibration);
        assert!(watch.windows() > 50);
        let off = watch.proposal().map(|proposal| proposal.changes).unwrap_or_default();
        assert!(off.iter().all(|(_, factor)| (factor.value - 1.0).abs() < 0.012), "{off:?}");
    }

    #[test]
    fn a_weaker_motor_and_a_wider_track_are_proposed() {
        let mut params = EmulatorParams::default();
        params.motors.gain_deviation = 0.0;
        params.motors.gain.right = 0.9;
        params.wheels = WheelsParams { track: 1.05, ..params.wheels };
        let calibration = Calibration::default();
        let proposal = watched(params, &calibration).proposal().expect("a proposal");
        let of =
            |name: &str| proposal.changes.iter().find(|(is, _)| is == name).map(|(_, factor)| factor.value);
        assert!((of("right forward kv").expect("weaker") - 1.0 / 0.9).abs() < 0.01, "{proposal:?}");
        assert!((of("right backward kv").expect("weaker") - 1.0 / 0.9).abs() < 0.01, "{proposal:?}");
        assert_eq!(of("left forward kv"), None, "{proposal:?}");
        assert!((of("track").expect("wider") - 1.05).abs() < 0.004, "{proposal:?}");
        assert_eq!(proposal.calibration.version, 1);
        let mut watch = watched(params, &proposal.calibration);
        let left = watch.proposal().map(|proposal| proposal.changes).unwrap_or_default();
        assert!(left.iter().all(|(_, factor)| (factor.value - 1.0).abs() < 0.012), "{left:?}");
        watch.adopt(proposal.calibration).expect("adopted");
        assert_eq!(watch.windows(), 0);
    }
}
