//! The stages: what each asks of the robot, and what is learnt from it.

use super::Procedure;
use crate::band::bracket;
use crate::by_hand::Driven;
use crate::geometry::{Leg, Part};
use crate::motion::Motion;
use crate::wiring::{Push, find};
use axle_schema::{Refusal, Sides};

/// One stage. A direction is 0 ahead, 1 back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// At rest: what the sensors say of nothing.
    Listen,
    /// A push of one channel: 0 left, 1 right.
    Push(usize),
    /// A ramp from nothing, for about where the wheels begin to move.
    Coarse(usize),
    /// Three speeds.
    Run(usize),
    /// A slow ramp from just below the dead band.
    Fine(usize),
    /// Back to the middle, looking ahead.
    Home,
    /// A turn to the left and one to the right.
    Spin,
    /// A square, to the left or to the right.
    Square(bool),
    /// A person puts the robot into the middle and marks where it stands, before a square to the left or to the right.
    Mark(bool),
    /// A person tells where the square has ended.
    Tell(bool),
}

/// In how many passes the dead band is looked for.
const FINE_PASSES: u32 = 2;
/// Rest between movements, and the part of it in which the robot still shakes, s.
const REST: f64 = 0.7;
const SHAKE: f64 = 0.4;
/// The setpoint of a push as a share of the largest one.
const PUSH: f64 = 0.3;
/// Growth of the setpoint in a coarse and in a fine ramp, 1/s of the largest one, and how far below a fine one begins.
const COARSE: f64 = 0.1;
const FINE: f64 = 0.01;
const BELOW: f64 = 0.05;
/// Share of the way to the edge of the room that a run may take, if the robot were as described.
const RUN: f64 = 0.7;
/// How long each speed of a run is kept, s.
const KEPT: f64 = 0.85;
/// About how long the readings of one speed are, s.
pub(super) const WINDOW: f64 = 0.5;
/// The speeds of a run, between where wheels begin to move and the largest setpoint.
const LEVELS: [f64; 3] = [0.35, 1.0, 0.7];
/// Golden section: no two passes have the same speeds.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// All stages.
pub(super) fn plan(passes: u32, by_hand: bool) -> Vec<Stage> {
    let mut plan = vec![Stage::Listen, Stage::Push(0), Stage::Push(1), Stage::Coarse(0), Stage::Coarse(1)];
    for pass in 0..passes {
        plan.extend([Stage::Run(0), Stage::Run(1)]);
        if pass < FINE_PASSES {
            plan.extend([Stage::Fine(0), Stage::Fine(1)]);
        }
        if by_hand {
            plan.push(Stage::Home);
            continue;
        }
        plan.extend([
            Stage::Home,
            Stage::Spin,
            Stage::Square(true),
            Stage::Home,
            Stage::Square(false),
            Stage::Home,
        ]);
    }
    // A person has better things to do than to wait for the motors in between.
    if by_hand {
        for left in [true, false].into_iter().cycle().take(2 * passes as usize) {
            plan.extend([Stage::Mark(left), Stage::Square(left), Stage::Tell(left)]);
        }
    }
    plan
}

impl Stage {
    /// What people read beside the progress bar.
    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Listen => "listening",
            Self::Push(_) => "which motor is which",
            Self::Coarse(_) | Self::Fine(_) => "dead bands",
            Self::Mark(_) | Self::Tell(_) => "waiting for you",
            Self::Run(_) => "motors",
            Self::Home => "back to the middle",
            Self::Spin => "turns on the spot",
            Self::Square(_) => "squares",
        }
    }
}

const fn sign(direction: usize) -> f64 {
    if direction == 0 { 1.0 } else { -1.0 }
}

impl Procedure {
    /// The movements of a stage.
    pub(super) fn script(&self, stage: Stage) -> Result<Vec<Motion>, Refusal> {
        let most = self.subject.wheel_speed.0;
        Ok(match stage {
            Stage::Listen => vec![Motion::Rest(1.5)],
            Stage::Push(channel) => {
                let level = PUSH * most;
                let at = |level: f64| {
                    let channels = if channel == 0 { Sides::new(level, 0.0) } else { Sides::new(0.0, level) };
                    // Nothing is known yet, and so channels and wheels are the same.
                    self.found.motors.to_wheels(channels)
                };
                let push = |level: f64| {
                    let up = level.abs() / self.rise();
                    let points = [(0.0, 0.0), (up, level), (up + 0.4, level), (2.0 * up + 0.4, 0.0)];
                    Motion::Lines(points.map(|(time, level)| (time, at(level))).to_vec())
                };
                vec![push(level), Motion::Rest(REST), push(-level), Motion::Rest(REST)]
            }
            Stage::Coarse(direction) => vec![
                Motion::Ramp {
                    from: Sides::default(),
                    rate: COARSE * most,
                    direction: sign(direction),
                    least: self.least(),
                    most: 0.7 * most,
                },
                Motion::Rest(REST),
            ],
            Stage::Fine(direction) => {
                let from = self.found.start[direction].map(|start| (start - BELOW * most).max(0.0));
                let highest = self.found.start[direction].left.max(self.found.start[direction].right);
                let ramp = Motion::Ramp {
                    from,
                    rate: FINE * most,
                    direction: sign(direction),
                    least: self.least(),
                    most: highest + 0.02 * most,
                };
                vec![Motion::Rest(REST), ramp, Motion::Rest(REST)]
            }
            Stage::Run(direction) => vec![self.run(direction)?, Motion::Rest(REST)],
            Stage::Home => self.home(),
            Stage::Mark(_) | Stage::Tell(_) => Vec::new(),
            Stage::Spin => {
                let around = std::f64::consts::TAU;
                vec![self.turn(around), Motion::Rest(REST), self.turn(-around), Motion::Rest(REST)]
            }
            Stage::Square(left) => {
                let corner = if left { 1.0 } else { -1.0 } * std::f64::consts::FRAC_PI_2;
                // Corners are taken by the gyroscope, so that a robot with unequal wheels stays in its room.
                let legs = [1.0, 2.0, 3.0, 4.0].map(|legs| Motion::Face(self.pose.heading + legs * corner));
                legs.into_iter()
                    .flat_map(|face| [self.ahead(self.side), Motion::Rest(REST), face, Motion::Rest(REST)])
                    .collect()
            }
        })
    }

    /// How fast setpoints grow, m/s².
    fn rise(&self) -> f64 {
        0.6 * self.subject.wheel_acceleration.0
    }

    /// Three speeds one after the other, as fast as the room allows.
    fn run(&self, direction: usize) -> Result<Motion, Refusal> {
        let start = self.found.start[direction];
        let (base, rise) = (start.left.max(start.right), self.rise());
        let done = self.found.runs[direction].left.len();
        let dither = 0.9 + 0.1 * (crate::motor::float(done) * GOLDEN).fract();
        let reach = RUN * self.subject.room.reach(self.subject.track) / self.found.gain.clamp(0.5, 2.0);
        let points = |top: f64| {
            let mut points = vec![(0.0, 0.0)];
            let mut now = (0.0, 0.0);
            for level in LEVELS.map(|level| (base + (top - base) * level) * dither).into_iter().chain([0.0]) {
                now = (now.0 + (level - now.1).abs() / rise, level);
                points.push(now);
                if level > 0.0 {
                    now.0 += KEPT;
                    points.push(now);
                }
            }
            points
        };
        let way = |points: &[(f64, f64)]| -> f64 {
            points.windows(2).map(|pair| (pair[1].0 - pair[0].0) * f64::midpoint(pair[0].1, pair[1].1)).sum()
        };
        let mut top = 0.7 * self.subject.wheel_speed.0;
        while way(&points(top)) > reach {
            top *= 0.95;
            if top < base * 1.3 || top < 0.02 * self.subject.wheel_speed.0 {
                let why = format!(
                    "the room is too small for this robot: its wheels begin to move at {base:.2} m/s of their signal, \
                     and there is no way to measure faster ones"
                );
                return Err(Refusal::Failed { why });
            }
        }
        let both = |level: f64| Sides::new(level, level).map(|level| level * sign(direction));
        Ok(Motion::Lines(points(top).into_iter().map(|(time, level)| (time, both(level))).collect()))
    }

    /// Speed and acceleration of movements under control.
    fn pace(&self) -> (f64, f64) {
        (0.4 * self.subject.wheel_speed.0, 0.5 * self.subject.wheel_acceleration.0)
    }
    fn ahead(&self, way: f64) -> Motion {
        let (speed, acceleration) = self.pace();
        Motion::Go { distances: Sides::new(way, way), speed, acceleration }
    }
    fn turn(&self, angle: f64) -> Motion {
        let (speed, acceleration) = self.pace();
        let way = angle * self.subject.track.get() / 2.0;
        Motion::Go { distances: Sides::new(-way, way), speed, acceleration }
    }

    /// Back to the middle by the shorter way, ahead or backward, and looking ahead again.
    fn home(&self) -> Vec<Motion> {
        use axle_schema::Radians;
        use std::f64::consts::TAU;
        let wrapped = |angle: f64| Radians(angle).wrapped().0;
        let (x, y, heading) = (self.pose.x, self.pose.y, self.pose.heading);
        let way = x.hypot(y);
        let mut motions = Vec::new();
        if way > 0.02 {
            let ahead = wrapped((-y).atan2(-x) - heading);
            let (turn, way) = if ahead.abs() <= std::f64::consts::FRAC_PI_2 {
                (ahead, way)
            } else {
                (wrapped(ahead + std::f64::consts::PI), -way)
            };
            let looks = heading + turn;
            motions.extend([Motion::Face(looks), Motion::Rest(REST), self.ahead(way), Motion::Rest(REST)]);
        }
        motions.extend([Motion::Face((heading / TAU).round() * TAU), Motion::Rest(REST)]);
        motions
    }

    /// A movement as it is when it begins.
    pub(super) fn begun_now(&self, motion: Motion) -> Motion {
        match motion {
            Motion::Face(heading) => self.turn(heading - self.pose.heading),
            other => other,
        }
    }

    /// Learns from a stage that is over.
    pub(super) fn conclude(&mut self, stage: Stage) -> Result<(), Refusal> {
        self.look_for_ticks();
        match stage {
            Stage::Listen => self.listened(),
            Stage::Push(channel) => self.pushed(channel)?,
            Stage::Coarse(direction) => self.began_to_move(direction)?,
            Stage::Run(direction) => {
                let way = sign(direction);
                let left = crate::motor::pass(&self.log, way, |wheels| wheels.left);
                let right = crate::motor::pass(&self.log, way, |wheels| wheels.right);
                let passes = &mut self.found.runs[direction];
                passes.left.push(left.ok_or_else(|| no_motor("the left"))?);
                passes.right.push(right.ok_or_else(|| no_motor("the right"))?);
            }
            Stage::Fine(direction) => self.crept(direction),
            Stage::Home => self.rested(),
            Stage::Spin => {
                self.found.legs.push(Vec::new());
                self.walked(Part::Turn);
            }
            Stage::Square(left) if self.subject.by_hand => self.drove(left),
            Stage::Square(left) => self.walked(if left { Part::Left } else { Part::Right }),
            Stage::Mark(_) => {
                self.answer = None;
                let counted = self.pose.counted;
                self.pose = super::Pose { counted, stamp: self.pose.stamp, ..super::Pose::default() };
            }
            Stage::Tell(_) => {
                if let (Some(driven), Some(place)) = (self.found.driven.last_mut(), self.answer.take()) {
                    driven.place = place;
                }
            }
        }
        Ok(())
    }

    /// The least step of the counts is a tick.
    fn look_for_ticks(&mut self) {
        let steps =
            self.log.counts.windows(2).flat_map(|pair| {
                pair[1].1.zip(pair[0].1, |now, before| (now - before).abs()).both().into_iter()
            });
        let least = steps.filter(|step| *step > 1e-7).fold(f64::INFINITY, f64::min);
        if least.is_finite() {
            self.found.tick = if self.found.tick > 0.0 { self.found.tick.min(least) } else { least };
        }
    }

    fn listened(&mut self) {
        let (Some(from), Some(to)) =
            (self.log.felt.first().map(|felt| felt.stamp), self.log.felt.last().map(|felt| felt.stamp))
        else {
            self.leave_geometry_out("no gyroscope is heard");
            return;
        };
        // What shakes at rest is no movement.
        let (mut low, mut high) =
            (Sides::new(f64::INFINITY, f64::INFINITY), Sides::new(f64::NEG_INFINITY, f64::NEG_INFINITY));
        for (_, counts) in &self.log.counts {
            low = low.zip(*counts, f64::min);
            high = high.zip(*counts, f64::max);
        }
        let shaking = high.zip(low, |high, low| if high > low { high - low } else { 0.0 });
        self.found.least = 2.0 * shaking.left.max(shaking.right);
        if let Some(bias) = self.log.rest(from, to) {
            self.found.bias = bias;
            self.found.has_gyro = true;
        } else {
            self.leave_geometry_out("the gyroscope falls silent");
        }
    }

    /// Without a gyroscope only a person can tell how far the robot turned.
    fn leave_geometry_out(&mut self, why: &str) {
        if self.subject.by_hand {
            return;
        }
        let finding =
            "sizes of wheels and track were not measured; with --by-hand you measure them with a ruler";
        self.found.findings.push(format!("{why}: {finding}"));
        self.plan.retain(|stage| !matches!(stage, Stage::Spin | Stage::Square(_)));
    }

    fn pushed(&mut self, channel: usize) -> Result<(), Refusal> {
        // Felt is the first push; the second one only goes back.
        let (Some(begin), Some(rest)) = (self.marks.first().copied(), self.marks.get(1).copied()) else {
            return Err(Refusal::internal("a push has no end"));
        };
        let end = (rest - REST).max(begin);
        let bias = self.found.bias;
        let middle = begin + self.subject.wheel_speed.0 * PUSH / self.rise() + 0.25;
        let push = Push {
            counted: self.log.counted(begin, rest).unwrap_or_default(),
            least: (4.0 * self.found.tick).max(self.found.least).max(1e-4),
            turned: self
                .log
                .turned(begin, rest, bias.0)
                .filter(|turned| self.found.has_gyro && turned.abs() > 0.01),
            jolt: bias
                .1
                .and_then(|bias| self.log.sped_up(begin, middle.min(end), bias))
                .filter(|jolt| jolt.abs() > 0.01),
        };
        if channel == 0 {
            self.found.pushes.left = Some(push);
            return Ok(());
        }
        let left =
            self.found.pushes.left.ok_or_else(|| Refusal::internal("the left motor was not pushed"))?;
        let wiring = find(Sides::new(left, push))?;
        self.found.pushes.right = Some(push);
        (self.found.motors, self.found.encoders) = (wiring.motors, wiring.encoders);
        // What a push would have covered at its setpoint: a ramp up, 0.4 s, a ramp down.
        let level = PUSH * self.subject.wheel_speed.0;
        let nominal = level * (level / self.rise() + 0.4);
        let farthest = [left, push].map(|push| push.counted.left.abs().max(push.counted.right.abs()));
        self.found.gain = farthest[0].max(farthest[1]) / nominal;
        for (what, wiring) in [("motors", wiring.motors), ("encoders", wiring.encoders)] {
            if wiring.swapped {
                self.found.findings.push(format!("the {what} are swapped"));
            }
            for (side, _) in [("left", wiring.inverted.left), ("right", wiring.inverted.right)]
                .iter()
                .filter(|(_, is)| *is)
            {
                self.found.findings.push(format!("of the {what}, that of the {side} wheel is inverted"));
            }
        }
        self.found.findings.extend(wiring.assumed.map(|assumed| format!("it was assumed {assumed}")));
        self.log.rewire(wiring.motors, wiring.encoders);
        // The counts go on with the right signs; the robot stands about where it stood.
        self.pose = super::Pose::default();
        Ok(())
    }

    fn began_to_move(&mut self, direction: usize) -> Result<(), Refusal> {
        let least = self.least();
        let start = |wheel: fn(Sides<f64>) -> f64| {
            let full = self.subject.full_speed.0;
            bracket(&self.log, (least, self.found.tick), (1.0 / full, 0.0), wheel)
                .map(|bracket| bracket.high * full)
        };
        let (left, right) = (start(|wheels| wheels.left), start(|wheels| wheels.right));
        self.found.start[direction] = Sides::new(
            left.ok_or_else(|| no_motor("the left"))?,
            right.ok_or_else(|| no_motor("the right"))?,
        );
        Ok(())
    }

    fn crept(&mut self, direction: usize) {
        let least = self.least();
        let of = |passes: &[crate::motor::Pass]| {
            passes
                .last()
                .map_or((1.0 / self.subject.full_speed.0, 0.0), |pass| (pass.numbers[1], pass.numbers[2]))
        };
        let numbers = (of(&self.found.runs[direction].left), of(&self.found.runs[direction].right));
        let left = bracket(&self.log, (least, self.found.tick), numbers.0, |wheels| wheels.left);
        let right = bracket(&self.log, (least, self.found.tick), numbers.1, |wheels| wheels.right);
        self.found.brackets[direction].left.extend(left);
        self.found.brackets[direction].right.extend(right);
    }

    /// Adds up what the gyroscope says at rest.
    fn rested(&mut self) {
        let Some(rests) = self.found.rests.last_mut() else { return };
        for mark in &self.marks {
            let (from, to) = (mark - REST + SHAKE, *mark);
            if let Some(turned) = self.log.turned(from, to, 0.0) {
                rests.0 += turned;
                rests.1 += to - from;
            }
        }
    }

    /// Takes the legs of a square whose end a person measures.
    fn drove(&mut self, left: bool) {
        let legs = self.marks.windows(2).filter_map(|pair| self.log.counted(pair[0], pair[1])).collect();
        self.found.driven.push(Driven { left, legs, place: (0.0, 0.0) });
    }

    /// Takes the legs between the rests.
    fn walked(&mut self, part: Part) {
        if part == Part::Turn {
            self.found.rests.push((0.0, 0.0));
        }
        self.rested();
        let Some(legs) = self.found.legs.last_mut() else { return };
        for pair in self.marks.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            if let (Some(counted), Some(turned)) =
                (self.log.counted(from, to), self.log.turned(from, to, 0.0))
            {
                legs.push(Leg { part, counted, turned, span: to - from });
            }
        }
    }
}

pub(super) fn no_motor(which: &str) -> Refusal {
    let why =
        format!("{which} wheel does not follow its signal: it stands, slips, or its encoder does not count");
    Refusal::Failed { why }
}
