//! The procedure: what the robot is asked to do, one stage after the other, and what follows from what it did.
//!
//! It is a value in virtual time. Its host gives it everything that the robot measures, asks it at every beat what the
//! wheels shall do, and sends that to the gate. It goes by the robot's own stamps wherever it computes, so that neither
//! the delay of the network nor the clock of the host is in any number.
//!
//! The stages: listening at rest; a push of each motor, which tells the wiring; a slow ramp each way, for about where the
//! wheels begin to move; then, in every pass, the three speeds of each direction, slow ramps from just below the dead
//! band, turns on the spot and a square each way. In between the robot goes back to the middle of its room.
//!
//! *When it fails*: a robot that falls silent, leaves its room, or does not move ends it with a refusal; wheels brake by
//! the gate as soon as nobody commands them.

mod outcome;
mod stage;

use crate::band::{Bracket, TICKS};
use crate::by_hand::{Driven, Question};
use crate::geometry::Leg;
use crate::log::Log;
use crate::motion::{Motion, Wish};
use crate::motor::Pass;
use crate::wiring::Push;
use crate::{Report, Room};
use axle_schema::calibration::{Branch, WheelMap, Wiring};
use axle_schema::{
    Calibration, Dwm, EncodersData, InertialData, Metres, MetresPerSecond, MetresPerSecondSquared, Refusal,
    Seconds, Sides, SignalsData, Track,
};
use stage::Stage;
use std::collections::VecDeque;

/// Nothing heard from the encoders for so long, s: the robot is gone.
const SILENT: f64 = 0.5;
/// The procedure gives up after this time, s.
const LONGEST: f64 = 3600.0;

/// The robot that is calibrated, and how thoroughly.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// Its track as described.
    pub track: Track,
    /// The largest speed of a wheel that its gate lets through.
    pub wheel_speed: MetresPerSecond,
    /// The largest acceleration of a wheel that it is described with.
    pub wheel_acceleration: MetresPerSecondSquared,
    /// The speed that a full signal stands for while nothing is calibrated.
    pub full_speed: MetresPerSecond,
    /// The free floor around it.
    pub room: Room,
    /// How often everything is measured, 2 to 20: intervals come from how passes differ.
    pub passes: u32,
    /// From beat to beat.
    pub period: Seconds,
    /// The number of the calibration that this one follows.
    pub version: u32,
    /// Whether a person measures where the squares end, and not the gyroscope.
    pub by_hand: bool,
    /// Whether its signals are speeds that a board keeps by itself.
    pub keeps_speeds: bool,
}

/// What the host shall do at a beat.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Have the wheels make this movement until the next beat.
    Drive(Dwm),
    /// It is over, and the robot stands.
    Done(Box<(Calibration, Report)>),
    /// It cannot go on.
    Fail(Refusal),
}

/// A calibration that is under way.
#[derive(Clone, Debug)]
pub struct Procedure {
    subject: Subject,
    /// The side of the squares.
    side: f64,
    plan: VecDeque<Stage>,
    stages: usize,
    stage: Option<Stage>,
    motions: VecDeque<Motion>,
    /// The motion that goes on, when it began by the host's clock, and what had been counted.
    motion: Option<(Motion, f64, Sides<f64>)>,
    log: Log,
    /// The stamps at which the robot came to rest.
    marks: Vec<f64>,
    /// The setpoints of the end of the last movement, of the channels.
    last: Sides<f64>,
    begun: Option<(f64, f64)>,
    heard: Option<f64>,
    now: f64,
    pose: Pose,
    found: Found,
    /// What a person has answered to the question of the stage.
    answer: Option<(f64, f64)>,
}

/// Where the robot has come to since the beginning, by gyroscope and counts; good enough to stay in the room.
#[derive(Clone, Copy, Debug, Default)]
struct Pose {
    x: f64,
    y: f64,
    heading: f64,
    counted: Option<Sides<f64>>,
    stamp: Option<f64>,
}

/// What is known so far.
#[derive(Clone, Debug, Default)]
struct Found {
    /// The distance of a tick, and the least that is a movement, m.
    tick: f64,
    least: f64,
    has_gyro: bool,
    /// Turn rate and acceleration that the sensors say at rest.
    bias: (f64, Option<f64>),
    pushes: Sides<Option<Push>>,
    /// How fast the faster wheel ran at a push, as a share of its setpoint.
    gain: f64,
    motors: Wiring,
    encoders: Wiring,
    findings: Vec<String>,
    /// By direction, ahead and back: the setpoints at which wheels began to move.
    start: [Sides<f64>; 2],
    /// By direction.
    runs: [Sides<Vec<Pass>>; 2],
    brackets: [Sides<Vec<Bracket>>; 2],
    /// The legs of each pass, and the rests of each: what the gyroscope added up, over how long.
    legs: Vec<Vec<Leg>>,
    rests: Vec<(f64, f64)>,
    /// The squares whose ends a person measures.
    driven: Vec<Driven>,
}

impl Procedure {
    /// A procedure for a robot that stands in the middle of its room.
    ///
    /// # Errors
    /// Refuses a room that is too small, and numbers out of range.
    pub fn new(subject: Subject) -> Result<Self, Refusal> {
        use axle_schema::refusal::within;
        within("passes", f64::from(subject.passes), 2.0, 20.0)?;
        within("wheel_speed in m/s", subject.wheel_speed.0, 1e-3, 20.0)?;
        within("wheel_acceleration in m/s²", subject.wheel_acceleration.0, 1e-3, 100.0)?;
        within("full_speed in m/s", subject.full_speed.0, subject.wheel_speed.0, 1000.0)?;
        within("period in s", subject.period.0, 0.01, 0.2)?;
        let side = subject.room.side(subject.track)?;
        let plan: VecDeque<Stage> = stage::plan(subject.passes, subject.by_hand).into();
        Ok(Self {
            subject,
            side,
            stages: plan.len(),
            plan,
            stage: None,
            motions: VecDeque::new(),
            motion: None,
            log: Log::default(),
            marks: Vec::new(),
            last: Sides::default(),
            begun: None,
            heard: None,
            now: 0.0,
            pose: Pose::default(),
            found: Found::default(),
            answer: None,
        })
    }

    /// What a person is to be asked now. The robot stands until it is answered.
    #[must_use]
    pub fn question(&self) -> Option<Question> {
        match self.stage {
            Some(Stage::Mark(left)) if self.answer.is_none() => Some(Question::Mark { left }),
            Some(Stage::Tell(left)) if self.answer.is_none() => Some(Question::End { left }),
            _ => None,
        }
    }

    /// The answer to it: how far ahead and to the left of its mark the robot stands. Without a question it is left out.
    ///
    /// # Errors
    /// Refuses a place that is not in the room.
    pub fn answer(&mut self, ahead: Metres, left: Metres) -> Result<(), Refusal> {
        let Some(question) = self.question() else { return Ok(()) };
        let Room { length, width } = self.subject.room;
        if matches!(question, Question::End { .. }) {
            axle_schema::refusal::within("ahead in m", ahead.0, -length.0, length.0)?;
            axle_schema::refusal::within("to the left in m", left.0, -width.0, width.0)?;
        }
        self.answer = Some((ahead.0, left.0));
        Ok(())
    }

    /// Hears what was given to the motors, and what the encoders counted, where that is said with it.
    pub fn hear_signals(&mut self, data: &SignalsData) {
        self.log.signals(data);
        if let Some(Sides { left, right }) = data.counted {
            self.hear_encoders(&EncodersData { stamp: data.stamp, left, right });
        }
    }

    /// Hears what the wheels have covered, as the owner of the wheels says it without a calibration.
    pub fn hear_encoders(&mut self, data: &EncodersData) {
        self.log.counts(data);
        self.heard = Some(self.now);
        let Some((_, counts)) = self.log.counts.last() else { return };
        let before = self.pose.counted.replace(*counts).unwrap_or(*counts);
        let way = counts.zip(before, |now, before| now - before);
        let ahead = f64::midpoint(way.left, way.right);
        if !self.found.has_gyro {
            self.pose.heading += (way.right - way.left) / self.subject.track.get();
        }
        self.pose.x += ahead * self.pose.heading.cos();
        self.pose.y += ahead * self.pose.heading.sin();
    }

    /// Hears what gyroscope and accelerometers feel.
    pub fn hear_inertial(&mut self, data: &InertialData) {
        self.log.feel(data);
        let span = data.stamp.0 - self.pose.stamp.replace(data.stamp.0).unwrap_or(data.stamp.0);
        if self.found.has_gyro && (0.0..0.5).contains(&span) {
            self.pose.heading += (data.gyro.0 - self.found.bias.0) * span;
        }
    }

    /// How far it is, 0 to 1, and what it does now.
    #[must_use]
    pub fn progress(&self) -> (f64, &'static str) {
        let left = self.plan.len() + usize::from(self.stage.is_some());
        let share =
            1.0 - crate::motor::float(left.min(self.stages)) / crate::motor::float(self.stages.max(1));
        (share, self.stage.map_or("over", Stage::words))
    }

    /// One beat, at this time of the host's clock.
    pub fn beat(&mut self, now: Seconds) -> Action {
        let now = if now.0.is_finite() { now.0.max(self.now) } else { self.now };
        self.now = now;
        // What was heard before the first beat was heard by no clock: a host that took long to begin has missed nothing.
        if self.begun.is_none() {
            self.heard = None;
        }
        let (begun, _) = *self.begun.get_or_insert((now, self.log.now().unwrap_or(0.0)));
        if now - self.heard.unwrap_or(begun) > SILENT {
            let hint = "its owner may have ended, or its board measures nothing, as orfa does";
            return Action::Fail(Refusal::unavailable("the encoders of the robot", hint));
        }
        if now - begun > LONGEST {
            return Action::Fail(Refusal::Failed { why: "the calibration takes more than an hour".into() });
        }
        if let Err(refusal) = self.stays_in_the_room() {
            return Action::Fail(refusal);
        }
        match self.wish(now) {
            Ok(Some(wish)) => self.drive(wish),
            Ok(None) => match self.outcome() {
                Ok(outcome) => Action::Done(Box::new(outcome)),
                Err(refusal) => Action::Fail(refusal),
            },
            Err(refusal) => Action::Fail(refusal),
        }
    }

    fn stays_in_the_room(&self) -> Result<(), Refusal> {
        // A robot that a person carries goes nowhere by itself.
        if matches!(self.stage, Some(Stage::Mark(_) | Stage::Tell(_))) {
            return Ok(());
        }
        let room = self.subject.room;
        let half = self.subject.track.get() / 2.0;
        let inside = |place: f64, side: f64| place.abs() <= (side / 2.0 - half).max(0.0);
        if inside(self.pose.x, room.length.0) && inside(self.pose.y, room.width.0) {
            return Ok(());
        }
        let place = format!("{:.2} m ahead and {:.2} m to the left", self.pose.x, self.pose.y);
        Err(Refusal::Failed {
            why: format!("the robot has come to the edge of its room: {place} of the middle"),
        })
    }

    /// What goes on at this time; none when everything is over.
    fn wish(&mut self, now: f64) -> Result<Option<Wish>, Refusal> {
        // As many motions may be over at once as there are.
        for _ in 0..64 {
            if let Some((motion, begun, from)) = &self.motion {
                let counted = self.log.counts.last().map_or(*from, |(_, counts)| *counts);
                let since = now - begun + self.subject.period.0;
                match motion.at(since, counted.zip(*from, |now, from| now - from)) {
                    Wish::Over => {
                        if matches!(motion, Motion::Rest(_)) {
                            self.marks.extend(self.log.now());
                        }
                        self.motion = None;
                    }
                    wish => return Ok(Some(wish)),
                }
            }
            if let Some(next) = self.motions.pop_front() {
                let from = self.log.counts.last().map(|(_, counts)| *counts).unwrap_or_default();
                self.motion = Some((self.begun_now(next), now, from));
                continue;
            }
            if self.question().is_some() {
                // However long it takes: nothing that is heard meanwhile is needed.
                self.log.clear();
                return Ok(Some(Wish::Setpoints(Sides::default())));
            }
            if let Some(stage) = self.stage.take() {
                self.conclude(stage)?;
            }
            let Some(next) = self.plan.pop_front() else { return Ok(None) };
            self.log.clear();
            self.marks.clear();
            self.marks.extend(self.log.now());
            self.motions = self.script(next)?.into();
            self.stage = Some(next);
        }
        Err(Refusal::internal("the calibration makes no progress"))
    }

    /// The movement of the next period.
    fn drive(&mut self, wish: Wish) -> Action {
        let channels = match wish {
            Wish::Setpoints(wheels) => self.found.motors.to_channels(wheels),
            Wish::Speeds(speeds) => {
                let wheels = self.wheels();
                let signals = Sides::new(
                    crate::map::signal(&wheels.left, speeds.left, 0.0),
                    crate::map::signal(&wheels.right, speeds.right, 0.0),
                );
                self.found.motors.to_channels(signals.map(|signal| signal * self.subject.full_speed.0))
            }
            Wish::Over => Sides::default(),
        };
        let (most, change) =
            (self.subject.wheel_speed.0, self.subject.wheel_acceleration.0 * self.subject.period.0);
        let start = self.last;
        let end =
            start.zip(channels, |from, to| (from + (to - from).clamp(-change, change)).clamp(-most, most));
        self.last = end;
        match Dwm::new(start.map(MetresPerSecond), end.map(MetresPerSecond), self.subject.period) {
            Ok(dwm) => Action::Drive(dwm),
            Err(refusal) => Action::Fail(refusal),
        }
    }

    /// What is known of the motors so far: means of the passes, and a straight line through nothing before.
    fn wheels(&self) -> Sides<WheelMap> {
        let branch = |direction: usize, pick: fn(&Sides<Vec<Pass>>) -> &Vec<Pass>| {
            let nominal = Branch { kv: 1.0 / self.subject.full_speed.0, ..Branch::default() };
            crate::motor::branch(pick(&self.found.runs[direction])).unwrap_or(nominal)
        };
        let wheel = |pick: fn(&Sides<Vec<Pass>>) -> &Vec<Pass>| WheelMap {
            forward: branch(0, pick),
            backward: branch(1, pick),
        };
        Sides::new(wheel(|passes| &passes.left), wheel(|passes| &passes.right))
    }

    /// The least that is a movement, m.
    fn least(&self) -> f64 {
        (TICKS * self.found.tick).max(self.found.least).max(1e-6)
    }
}
