//! The robot as a corrector that works with poses knows it: where it is, where it will be, what it was told.

use crate::friction::Friction;
use crate::grain::Grain;
use crate::newest::{Newest, Watch};
use crate::stall::Stall;
use crate::wheels::Wheels;
use axle_schema::contract::{Account, Seen, Step};
use axle_schema::{
    Drivetrain, EncodersData, Metres, MetresPerSecond, NavigatorData, Pose, Radians, RadiansPerSecond,
    Refusal, Seconds, Sides, Twist,
};

/// Where a robot is, and what moves it.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    robot: Drivetrain,
    lead: Seconds,
    watch: Watch,
    newest: Newest<NavigatorData>,
    /// The heading of the newest pose, counted on from the first one, whether the poses count turns or not.
    heading: Radians,
    /// The distances of the wheels at the beginning and now, where they are seen.
    encoders: Option<(EncodersData, EncodersData)>,
    grain: Grain,
    pub(crate) wheels: Wheels,
    stall: Stall,
    /// The beat of the pose before the newest one.
    counted: Seconds,
}

impl Body {
    /// A robot at rest where it is seen. `lead` is the time from a measurement to the obedience to what it led to, `push`
    /// is what a wheel that does not move is asked for more.
    ///
    /// # Errors
    /// Refuses when no pose is seen, with what to start.
    pub(crate) fn new(
        robot: Drivetrain,
        (period, lead): (Seconds, Seconds),
        watch: Watch,
        push: MetresPerSecond,
        seen: &Seen,
    ) -> Result<Self, Refusal> {
        let newest = Newest::new(seen.pose, seen.at, watch, robot)?;
        let heading = newest.value().pose.heading;
        Ok(Self {
            robot,
            lead,
            watch,
            newest,
            heading,
            encoders: seen.encoders.map(|first| (first, first)),
            grain: Grain::default(),
            wheels: Wheels::new(robot, period, Friction::new(push.0)),
            stall: Stall::default(),
            counted: seen.at,
        })
    }

    /// Takes what is seen at a beat.
    ///
    /// # Errors
    /// Fails when poses stop, jump or go back in time, and when the robot is blocked.
    pub(crate) fn hear(&mut self, seen: &Seen) -> Result<(), Refusal> {
        if let Some((before, turn)) = self.take(seen)? {
            let value = self.newest.value();
            let made = ways(before.pose, value.pose, turn, self.robot);
            let (from, to) = (self.counted - self.lead, seen.at - self.lead);
            let asked = self.wheels.covered(from, to);
            let asked = self.wheels.learn(asked, made.map(|way| way.0), to - from).map(Metres);
            self.counted = seen.at;
            self.stall.count(asked, made, to - from, value.stamp, self.watch.blocked)?;
        }
        Ok(())
    }

    /// Takes what is seen; says the pose before the newest one, if that is new, and how far the robot has turned since.
    fn take(&mut self, seen: &Seen) -> Result<Option<(NavigatorData, Radians)>, Refusal> {
        if let (Some((_, newest)), Some(encoders)) = (&mut self.encoders, seen.encoders) {
            self.grain.take(newest, &encoders);
            *newest = encoders;
        }
        let before = self.newest.hear(seen.pose, seen.at)?;
        Ok(before.map(|before| {
            let turn = (self.newest.value().pose.heading - before.pose.heading).wrapped();
            self.heading += turn;
            (before, turn)
        }))
    }

    /// The robot has braked without a command: what it did meanwhile tells nothing of how its wheels obey.
    pub(crate) fn resume(&mut self, seen: &Seen) {
        // What is wrong with the measurement fails the step that follows.
        drop(self.take(seen));
        self.wheels.rest();
        self.stall = Stall::default();
        self.counted = seen.at;
    }

    /// Where the robot was at the newest measurement.
    pub(crate) fn pose(&self) -> Pose {
        Pose { heading: self.heading, ..self.newest.value().pose }
    }

    /// Where it will be when it obeys the command of the beat `at`.
    pub(crate) fn pose_at(&self, at: Seconds) -> Pose {
        self.wheels.pose_after(self.pose(), at - self.newest.age(at) - self.lead, at)
    }

    /// The stamp of the newest measurement, by the robot's clock.
    pub(crate) const fn stamp(&self) -> Seconds {
        self.newest.value().stamp
    }

    /// What coarse encoders leave unknown, m.
    pub(crate) fn blur(&self) -> f64 {
        self.grain.blur()
    }

    /// Time since the task began, by the robot's clock at the newest measurement.
    pub(crate) fn elapsed(&self) -> Seconds {
        self.newest.elapsed()
    }

    /// The same when the command of the beat `at` will be obeyed.
    pub(crate) fn obeyed(&self, at: Seconds) -> Seconds {
        self.newest.elapsed() + self.newest.age(at) + self.lead
    }

    /// Drives with a speed in m/s and a turn rate in rad/s, as far as the limits allow.
    ///
    /// # Errors
    /// Refuses speeds that are not finite.
    pub(crate) fn drive(&mut self, v: f64, omega: f64, at: Seconds) -> Result<Step, Refusal> {
        let twist = Twist { v: MetresPerSecond(v), omega: RadiansPerSecond(omega) };
        let target = twist.wheel_speeds(self.robot.track);
        self.wheels.command(target, at).map(Step::Drive)
    }

    /// Brakes, and says that the task is done once that was commanded.
    ///
    /// # Errors
    /// None in fact: rest is finite.
    pub(crate) fn rest(&mut self, at: Seconds) -> Result<Step, Refusal> {
        if self.wheels.last().peak_speed() <= MetresPerSecond::ZERO {
            return Ok(Step::Done);
        }
        self.drive(0.0, 0.0, at)
    }

    /// What the last beat was about.
    pub(crate) fn account(&self, fraction: f64, due: Option<Sides<Metres>>) -> Account {
        let real = self
            .encoders
            .map(|(begin, now)| now.sides().zip(begin.sides(), |now, begin| now - begin))
            .filter(|real| real.left.is_finite() && real.right.is_finite());
        Account {
            stamp: self.stamp(),
            elapsed: self.elapsed(),
            fraction: fraction.clamp(0.0, 1.0),
            due,
            real,
        }
    }
}

/// What the wheels have covered between two poses, along the arc between them (model.md 1.3, the other way round).
fn ways(from: Pose, to: Pose, turn: Radians, robot: Drivetrain) -> Sides<Metres> {
    let step = to.seen_from(from);
    let way = step.x.0.hypot(step.y.0).copysign(step.x.0);
    let half = turn.0 * robot.track.get() / 2.0;
    Sides::new(Metres(way - half), Metres(way + half))
}
