//! One run: a task driven from its beginning to standstill, in virtual time.

use crate::course::Brief;
use crate::host::{Host, Stage, ToHost};
use crate::link::Link;
use crate::metrics::{METRICS, Watch};
use crate::robot::{Robot, ToRobot};
use crate::scenario::World;
use crate::seat::Seat;
use axle_emulator::Random;
use axle_schema::contract::Seen;
use axle_schema::{Refusal, Seconds};

/// The host's clock at the boot of the robot, s: no clocks agree, and none need to.
const EPOCH: Seconds = Seconds(1000.0);
/// How many times its plan a task may take, and how much longer, s.
const PATIENCE: (f64, f64) = (2.0, 20.0);
/// How long the wheels may take to come to rest after the end, s.
const REST: Seconds = Seconds(3.0);
/// Where the robot is, is looked at in every fourth beat: at 50 Hz.
const LOOK: u32 = 4;

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// The corrector said that the task is done.
    Done,
    /// It said that it cannot be done, or the gate took the wheels back.
    Failed(Refusal),
    /// It came to no end.
    Late,
}

/// What a run was like.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// How it ended.
    pub ending: Ending,
    /// The measures, in the order of [`METRICS`].
    pub values: [f64; METRICS.len()],
    /// How often the worse wheel changed its direction in the last second, and until it stood: more than once is hunting.
    pub hunting: usize,
    /// Where the robot really was, 50 times in a second.
    pub path: Vec<(f64, f64)>,
    /// The time that it took, standstill at both ends included.
    pub virtual_time: Seconds,
}

/// Drives a course.
///
/// # Errors
/// Refuses a robot or links that cannot be. What goes wrong on the way is a result and no error.
pub fn run(seat: &Seat, brief: &Brief, world: &World) -> Result<Run, Refusal> {
    let mut mill = Mill::new(seat, brief, world)?;
    let longest = longest(brief);
    let mut begun = None;
    while !matches!(mill.host.stage, Stage::Over(_)) && mill.now < longest {
        mill.beat();
        if begun.is_none() && matches!(mill.host.stage, Stage::Driving { .. }) {
            begun = Some(mill.now);
        }
    }
    let time = mill.now - begun.unwrap_or(mill.now);
    let over = mill.now;
    while !mill.robot.rests() && mill.now - over < REST {
        mill.beat();
    }
    let ending = match mill.host.stage {
        Stage::Over(Ok(())) => Ending::Done,
        Stage::Over(Err(refusal)) => Ending::Failed(refusal),
        _ => Ending::Late,
    };
    let hunting = mill.watch.hunting(over);
    let (values, path) = mill.watch.end(mill.robot.truth().pose, time, ending == Ending::Done);
    Ok(Run { ending, values, hunting, path, virtual_time: mill.now })
}

/// What a corrector sees on a course, beat by beat from the beginning of its task on, so that its steps can be measured
/// without the simulator around them.
///
/// # Errors
/// As [`run`].
pub fn sights(seat: &Seat, brief: &Brief, world: &World) -> Result<Vec<Seen>, Refusal> {
    let mut mill = Mill::new(seat, brief, world)?;
    let longest = longest(brief);
    let mut sights: Vec<Seen> = Vec::new();
    while !matches!(mill.host.stage, Stage::Over(_)) && mill.now < longest {
        mill.beat();
        let seen = mill.host.seen();
        if matches!(mill.host.stage, Stage::Driving { .. })
            && sights.last().is_none_or(|last| seen.at > last.at)
        {
            sights.push(*seen);
        }
    }
    Ok(sights)
}

/// How long a task may take.
fn longest(brief: &Brief) -> Seconds {
    Seconds(brief.drive.duration.0 * PATIENCE.0 + PATIENCE.1)
}

/// Everything that takes part, and the one time that goes by.
pub(crate) struct Mill<'a> {
    pub(crate) now: Seconds,
    pub(crate) robot: Robot,
    pub(crate) host: Host<'a>,
    pub(crate) up: Link<ToHost>,
    pub(crate) down: Link<ToRobot>,
    watch: Watch<'a>,
    /// How many beats the robot has had.
    beats: u32,
    /// When the corrector's next beat is.
    due: Seconds,
    period: Seconds,
}

impl<'a> Mill<'a> {
    pub(crate) fn new(seat: &'a Seat, brief: &'a Brief, world: &World) -> Result<Self, Refusal> {
        let seed = world.robot.seed;
        // Beats of two computers do not keep step.
        let phase = Random::new(seed, 10).uniform();
        Ok(Self {
            now: Seconds::ZERO,
            robot: Robot::new(world)?,
            host: Host::new(seat, brief)?,
            up: Link::new(world.up, seed, 11)?,
            down: Link::new(world.down, seed, 12)?,
            watch: Watch::new(brief),
            beats: 0,
            due: seat.period * phase,
            period: seat.period,
        })
    }

    /// The next beat of the robot, and those of the host until then.
    pub(crate) fn beat(&mut self) {
        self.beats += 1;
        let next = self.robot.period() * f64::from(self.beats);
        while self.due < next {
            let at = self.due;
            self.host.hear(at, &mut self.up);
            self.host.beat(at, EPOCH + at, &mut self.down);
            self.due = at + self.period;
        }
        self.now = next;
        self.robot.beat(next, &mut self.down, &mut self.up);
        self.host.hear(next, &mut self.up);
        self.watch.look(&self.robot, self.beats.is_multiple_of(LOOK));
    }
}
