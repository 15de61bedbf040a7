//! The service as a value: checks what it hears, and asks the method.

mod reference;

use crate::dead::Dead;
use crate::ekf::Ekf;
use crate::measurement::{Counts, Measurement};
use crate::params::{Method, NavigatorParams};
use crate::silence::Silence;
use axle_schema::contract::Bounds as _;
use axle_schema::event::{Event, Sensor};
use axle_schema::series::Datum as _;
use axle_schema::window::Window;
use axle_schema::{
    Boot, EncodersData, EncodersSpan, InertialData, Message as _, NavigatorData, Pose, Position,
    RadiansPerSecond, Refusal, Seconds, Twist,
};
use reference::covariance;

/// A stamp that goes back by more than this, in s, is of a robot that has restarted; by less, of an old reading.
const RESTART: f64 = 1.0;
/// A stamp that jumps ahead by more than this, in s, is of another clock.
const LEAP: f64 = 600.0;
/// Readings of a gyro so long before a position may be about the time after it.
const OVERLAP: Seconds = Seconds(0.5);
/// How many times its largest speed a wheel is believed, since a description of a robot is never exact.
const BELIEF: f64 = 1.5;

#[derive(Clone, Debug)]
enum Keeper {
    Dead(Box<Dead>),
    Ekf(Box<Ekf>),
}

/// What a fix or a range thought of the pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Of the measurement.
    pub stamp: Seconds,
    /// `ν'S⁻¹ν`: of mean `degrees` for an honest covariance.
    pub squared: f64,
    /// Degrees of freedom: 2 of a fix, 1 of a range.
    pub degrees: usize,
}

/// The service that knows where the robot is.
#[derive(Clone, Debug)]
pub struct Navigator {
    params: NavigatorParams,
    keeper: Keeper,
    /// Beside dead reckoning: a filter that only watches, as soon as there is a gyro.
    guard: Option<Box<Ekf>>,
    last: Option<EncodersData>,
    /// The run of the robot whose windows were heard.
    boot: Option<Boot>,
    /// Whether the next reading is of another run of the robot.
    anew: bool,
    silence: Silence,
    noticed: Vec<Event>,
    counts: Counts,
}

impl Navigator {
    /// A navigator that waits for its first reading.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(params: NavigatorParams) -> Result<Self, Refusal> {
        params.check()?;
        let keeper = if params.method == Method::Ekf {
            Keeper::Ekf(Box::new(Ekf::new(&params)))
        } else {
            Keeper::Dead(Box::new(Dead::new(&params)))
        };
        Ok(Self {
            params,
            keeper,
            guard: None,
            last: None,
            boot: None,
            anew: false,
            silence: Silence::default(),
            noticed: Vec::new(),
            counts: Counts::default(),
        })
    }

    /// A navigator that goes on from where another one was, which ended in the same run of the robot, with what was measured
    /// since then. What the wheels have covered before the first reading of it is the first span.
    ///
    /// # Errors
    /// As [`Navigator::new`]; and for a position that no navigator has said.
    pub fn resume(params: NavigatorParams, from: &Position, since: &Window) -> Result<Self, Refusal> {
        from.check()?;
        covariance(&from.map_covariance)?;
        from.odom.covariance.as_ref().map_or(Ok(()), |p| covariance(p).map(drop))?;
        let mut navigator = Self { boot: Some(from.boot), ..Self::new(params)? };
        match &mut navigator.keeper {
            Keeper::Dead(dead) => dead.resume(&navigator.params, from),
            Keeper::Ekf(ekf) => ekf.resume(from),
        }
        let _ = navigator.take(from.wheels);
        // What is older has been counted. A gyro's reading reaches into the time after the position.
        let begin = from.wheels.stamp;
        let mut since = since.clone();
        since.encoders.retain(|datum| datum.stamp > begin);
        since.inertial.retain(|datum| datum.stamp > begin - OVERLAP);
        since.fixes.retain(|datum| datum.stamp > begin);
        since.ranges.retain(|datum| datum.stamp > begin);
        let _ = navigator.hear(&since);
        Ok(navigator)
    }

    /// Takes all measurements of a window; says the newest pose, if it says anything new. What a window repeats is known by
    /// its stamp, and counts once. In another run of the robot motion counts from the first reading.
    pub fn hear(&mut self, window: &Window) -> Option<NavigatorData> {
        self.anew |= self.boot.replace(window.boot).is_some_and(|boot| boot != window.boot);
        let inertial = window.inertial.iter().copied().map(Measurement::Inertial);
        let fixes = window.fixes.iter().copied().map(Measurement::Fix);
        let ranges = window.ranges.iter().copied().map(Measurement::Range);
        for measurement in inertial.chain(fixes).chain(ranges) {
            let _ = self.measure(&measurement);
        }
        // Beside a reading of now an old one is old, however old it is, and no restart.
        let newest = window.encoders.iter().map(|datum| datum.stamp.0).fold(f64::NEG_INFINITY, f64::max);
        let oldest = self.last.map(|last| last.stamp - Seconds(RESTART));
        let oldest = oldest.filter(|oldest| !self.anew && newest > oldest.0);
        let fresh = window.encoders.iter().filter(|datum| oldest.is_none_or(|oldest| datum.stamp > oldest));
        fresh.filter_map(|&datum| self.take(datum)).last()
    }

    /// Takes the next measurement; says the pose after encoder readings, or nothing for whatever is dropped or waits.
    ///
    /// Dead reckoning has no use for a gyro and for ranges; of fixes it takes none but "ticks", which a fix resets.
    pub fn measure(&mut self, measurement: &Measurement) -> Option<NavigatorData> {
        if !measurement.is_sound() {
            self.counts.stale += 1;
            return None;
        }
        match (measurement, &mut self.keeper) {
            (Measurement::Encoders(datum), _) => return self.take(*datum),
            (Measurement::Inertial(data), _) => self.feel(data),
            (Measurement::Fix(fix), Keeper::Ekf(ekf)) => ekf.fix(fix, &mut self.counts),
            (Measurement::Range(range), Keeper::Ekf(ekf)) => ekf.range(range, &mut self.counts),
            (Measurement::Fix(fix), Keeper::Dead(_)) if self.params.method == Method::Ticks => {
                self.reset(fix)
            }
            (_, Keeper::Dead(_)) => {}
        }
        None
    }

    fn feel(&mut self, data: &InertialData) {
        let missed = self.silence.hear(Sensor::Gyro, data.stamp.0, self.params.silence.0);
        self.noticed.extend(missed);
        match &mut self.keeper {
            Keeper::Ekf(ekf) => ekf.inertial(data, &mut self.counts),
            Keeper::Dead(_) if self.params.watch => {
                let guard = self.guard.get_or_insert_with(|| Box::new(Ekf::new(&self.params)));
                guard.inertial(data, &mut Counts::default());
            }
            Keeper::Dead(_) => {}
        }
    }

    /// Takes the next reading; says the pose at its stamp, or nothing for a reading that is dropped.
    ///
    /// The first reading is the anchor: the robot is then at `start`, whatever the wheels have covered before.
    pub fn take(&mut self, datum: EncodersData) -> Option<NavigatorData> {
        if !Measurement::Encoders(datum).is_sound() {
            self.counts.stale += 1;
            return None;
        }
        let since = self.last.map(|last| last.span_to(&datum));
        let restart = match &self.keeper {
            Keeper::Dead(_) => RESTART,
            Keeper::Ekf(_) => RESTART.max(self.params.ekf.window.0),
        };
        let leaps =
            since.is_some_and(|span| self.anew || span.duration.0 < -restart || span.duration.0 > LEAP);
        self.anew = false;
        self.counts.restarts += u64::from(leaps);
        if leaps {
            self.silence.restart();
        }
        let missed = self.silence.hear(Sensor::Encoders, datum.stamp.0, self.params.silence.0);
        self.noticed.extend(missed);
        if let Some(guard) = &mut self.guard {
            if leaps {
                guard.restart(&datum);
            } else {
                let _ = guard.encoders(&datum, &mut Counts::default());
            }
        }
        match &mut self.keeper {
            Keeper::Ekf(ekf) => {
                if leaps {
                    ekf.restart(&datum);
                } else if !ekf.encoders(&datum, &mut self.counts) {
                    self.counts.stale += 1;
                    return None;
                }
                let is_newest = leaps || since.is_none_or(|span| span.duration.0 > 0.0);
                self.last = if is_newest { Some(datum) } else { self.last };
                ekf.data()
            }
            Keeper::Dead(dead) => {
                match (self.last, since) {
                    (Some(last), Some(span)) if !leaps => {
                        if span.duration.0 <= 0.0 {
                            self.counts.stale += 1;
                            return None;
                        }
                        if believes(&self.params, &span) {
                            dead.advance(&last, &datum, twist(&self.params, &span));
                        } else {
                            self.counts.jumps += 1;
                            dead.anchor(&datum);
                        }
                    }
                    _ => dead.anchor(&datum),
                }
                self.last = Some(datum);
                dead.data()
            }
        }
    }

    /// Nothing was heard for `elapsed` of whatever clock; the encoders, which set the pace, may be missed.
    pub fn wait(&mut self, elapsed: Seconds) {
        let missed = self.silence.wait(elapsed.0, self.params.silence.0);
        self.noticed.extend(missed);
    }

    /// Where the robot is in both frames; nothing before the first reading.
    #[must_use]
    pub fn position(&self) -> Option<Position> {
        let position = match &self.keeper {
            Keeper::Dead(dead) => dead.position(),
            Keeper::Ekf(ekf) => ekf.position(),
        };
        position.map(|position| Position { boot: self.boot.unwrap_or_default(), ..position })
    }

    /// Where the robot was in `odom` and in `map`, at a stamp of the last seconds; before them and after them it is where it
    /// was at their end.
    #[must_use]
    pub fn poses_at(&self, stamp: Seconds) -> Option<(Pose, Pose)> {
        match &self.keeper {
            Keeper::Dead(dead) => dead.poses_at(stamp.0),
            Keeper::Ekf(ekf) => ekf.poses_at(stamp.0),
        }
    }

    /// What was noticed since the last call.
    pub fn events(&mut self) -> Vec<Event> {
        let mut events = std::mem::take(&mut self.noticed);
        if let Keeper::Ekf(ekf) = &mut self.keeper {
            events.append(&mut ekf.events());
        }
        if let Some(guard) = &mut self.guard {
            events.append(&mut guard.events());
        }
        events
    }

    /// What the fixes and ranges since the last call thought of the pose.
    pub fn innovations(&mut self) -> Vec<Innovation> {
        match &mut self.keeper {
            Keeper::Dead(_) => Vec::new(),
            Keeper::Ekf(ekf) => ekf.innovations(),
        }
    }

    /// The gyro's bias in rad/s, and the relative errors of left radius, right radius and track, as far as they are known.
    #[must_use]
    pub fn measures(&self) -> Option<[f64; 4]> {
        match &self.keeper {
            Keeper::Dead(_) => None,
            Keeper::Ekf(ekf) => ekf.measures(),
        }
    }

    /// Whether the robot is to stop at this event.
    #[must_use]
    pub fn stops(&self, event: &Event) -> bool {
        self.params.stop.iter().any(|name| name == event.name())
    }

    /// The newest stamp of the encoders.
    #[must_use]
    pub fn newest(&self) -> Option<Seconds> {
        self.last.map(|last| last.stamp)
    }

    /// How often a measurement was not simply the next one.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }
}

/// Whether both wheels can have come that far.
fn believes(params: &NavigatorParams, span: &EncodersSpan) -> bool {
    let reach = BELIEF * params.robot.wheel_speed.0 * span.duration.0 + params.jump.0;
    span.left.0.abs() <= reach && span.right.0.abs() <= reach
}

/// The mean twist of the span; none where the interval is too short to tell.
fn twist(params: &NavigatorParams, span: &EncodersSpan) -> Option<Twist> {
    let [left, right] = span.sides().map(|distance| distance / span.duration).both();
    let v = (left + right) / 2.0;
    let omega = RadiansPerSecond((right - left).0 / params.robot.track.get());
    (v.is_finite() && omega.is_finite()).then_some(Twist { v, omega })
}

#[cfg(test)]
mod tests;
