//! What the gate remembers, and its beat. Who may move the wheels is in `authority`, which commands are obeyed in
//! `check`, what the gate says of itself in `account`.

use crate::GateParams;
use crate::jerk::{Limits, Setpoint};
use crate::wheels::{at_rest, braked, toward};
use axle_schema::command::{BrakeCause, Class, Reject};
use axle_schema::{Boot, Drivetrain, Dwm, MetresPerSecond, Refusal, Seconds, Sides, StopId};
use std::collections::BTreeMap;

/// The longest time from beat to beat that a change of speed is computed for. After a longer pause of the process the
/// wheels go on from where they were told to be, instead of catching up with a jump.
pub const MAX_BEAT: Seconds = Seconds(0.05);

/// How many commands the gate reads from one beat to the next; what comes beyond is counted unread, so that a flood
/// costs bounded time. At beats of 5 ms it is 100 000 in a second, twice the flood of the fault matrix (row 27).
pub const COMMANDS_PER_BEAT: u32 = 512;

/// The gate: a state machine without a clock, a thread or a wire.
#[derive(Clone, Debug, PartialEq)]
pub struct Gate {
    pub(crate) params: GateParams,
    /// The largest speed of a wheel.
    pub(crate) wheel_speed: MetresPerSecond,
    pub(crate) boot: Boot,
    /// The latest time that the gate has heard of.
    now: Seconds,
    /// The time of the latest beat.
    beaten: Option<Seconds>,
    pub(crate) permit: Permit,
    /// The latest AllStop, in force or not.
    pub(crate) stop: Option<StopId>,
    /// Number of the latest grant.
    pub(crate) epoch: u32,
    /// The sequence number of the latest command that was obeyed in this epoch.
    pub(crate) seq: Option<u32>,
    pub(crate) held: Option<Held>,
    pub(crate) course: Option<Course>,
    /// The setpoint of the latest beat.
    pub(crate) wheels: Sides<MetresPerSecond>,
    /// The acceleration of each wheel at the latest beat, m/s²; only where the jerk is limited.
    pub(crate) accelerations: Sides<f64>,
    pub(crate) cause: Option<BrakeCause>,
    pub(crate) accepted: u64,
    pub(crate) rejected: BTreeMap<Reject, u64>,
    /// Commands since the latest beat.
    pub(crate) arrived: u32,
}

/// Whether anybody may move the wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Permit {
    /// Who holds the lease may.
    Enabled,
    /// Nobody may, since the boot or because the process disabled the drive.
    Disabled,
    /// Nobody may until an enable quotes the latest AllStop.
    Stopped,
}

/// A lease in force.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Held {
    pub(crate) holder: String,
    pub(crate) class: Class,
    pub(crate) silence_stop: Seconds,
    /// The grant, or the latest command that was obeyed.
    pub(crate) heard: Seconds,
}

/// The movement that the wheels obey; it belongs to the holder of the current epoch.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Course {
    pub(crate) dwm: Dwm,
    /// When it was accepted, and so began.
    pub(crate) since: Seconds,
    /// How much of it counts: its duration, or less when its sender said so.
    pub(crate) lasts: Seconds,
    /// From when on it moves nothing more.
    pub(crate) until: Seconds,
}

/// Periods of silence after which the wheels brake (fault model, 3.5: 2.5 periods, within 150 to 500 ms).
pub(crate) const SILENT_PERIODS: f64 = 2.5;
pub(crate) const SHORTEST_SILENCE: Seconds = Seconds(0.15);
pub(crate) const LONGEST_SILENCE: Seconds = Seconds(0.5);

impl Gate {
    /// The gate of a robot after a boot, with standing wheels and without a holder.
    ///
    /// `latch` is the AllStop that was in force when the process ended ([`Gate::latch`]); it is in force again.
    ///
    /// # Errors
    /// Refuses parameters out of range, or that would refuse what the planners of this robot ask for.
    pub fn new(
        params: GateParams,
        robot: &Drivetrain,
        boot: Boot,
        latch: Option<StopId>,
    ) -> Result<Self, Refusal> {
        params.fits(robot)?;
        let permit = match latch {
            Some(_) => Permit::Stopped,
            None if params.starts_enabled => Permit::Enabled,
            None => Permit::Disabled,
        };
        Ok(Self {
            params,
            wheel_speed: robot.wheel_speed,
            boot,
            now: Seconds::ZERO,
            beaten: None,
            permit,
            stop: latch,
            epoch: 0,
            seq: None,
            held: None,
            course: None,
            wheels: Sides::default(),
            accelerations: Sides::default(),
            cause: None,
            accepted: 0,
            rejected: BTreeMap::new(),
            arrived: 0,
        })
    }

    /// One beat: the setpoint of the wheels for this instant. Beats come 5 to 20 ms apart, also when nothing moves.
    pub fn beat(&mut self, now: Seconds) -> Sides<MetresPerSecond> {
        let now = self.settle(now);
        let span = (now - self.beaten.unwrap_or(now)).max(Seconds::ZERO).min(MAX_BEAT);
        self.beaten = Some(now);
        self.arrived = 0;
        // The end of a movement is judged here and not at every event, so that a next command that comes in time for
        // the beat finds the last one still running.
        if self.course.as_ref().is_some_and(|course| now >= course.until) {
            self.course = None;
            if !at_rest(self.wheels) {
                self.cause = Some(BrakeCause::Expired);
            }
        }
        self.wheels = match (self.params.jerk, &self.course) {
            (Some(jerk), _) => self.smoothed(now, span, jerk),
            (None, Some(course)) => toward(self.wheels, course.speeds_at(now), self.params.a_max * span),
            (None, None) => braked(self.wheels, self.params.a_stop * span),
        };
        self.wheels
    }

    /// The setpoint where the jerk is limited.
    fn smoothed(&mut self, now: Seconds, span: Seconds, jerk: f64) -> Sides<MetresPerSecond> {
        let (targets, steepest) = match &self.course {
            Some(course) => (course.setpoints_at(now), self.params.a_max),
            None => (Sides::default(), self.params.a_stop),
        };
        let limits = Limits { speed: self.wheel_speed.0, acceleration: steepest.0, jerk };
        let setpoints = self
            .wheels
            .zip(self.accelerations, |speed, acceleration| Setpoint { speed: speed.0, acceleration })
            .zip(targets, |setpoint, target| setpoint.toward(target, limits, span));
        self.accelerations = setpoints.map(|setpoint| setpoint.acceleration);
        setpoints.map(|setpoint| MetresPerSecond(setpoint.speed))
    }

    /// Takes the time of an event and ends what has run out by then; returns the time that the gate goes by.
    ///
    /// A clock that goes backwards stands still for the gate, and one that is no number runs: so timers run out.
    pub(crate) fn settle(&mut self, now: Seconds) -> Seconds {
        self.now = if now.is_finite() { self.now.max(now) } else { self.now + MAX_BEAT };
        let alive = |held: &Held| self.now < held.heard + self.patience(held.silence_stop);
        if self.held.as_ref().is_some_and(|held| !alive(held)) {
            self.end_lease(BrakeCause::Silence);
        }
        self.now
    }

    /// For how long a holder may be silent whose lease says `silence_stop`.
    ///
    /// The first command may take longer, for its way is longer: the grant has to reach the holder, and from there the
    /// command comes back after the next beat. On a link over which commands can be obeyed at all, both ways together
    /// take at most `max_age`. Nothing moves in that time: after a grant the wheels brake or rest until the first
    /// command.
    fn patience(&self, silence_stop: Seconds) -> Seconds {
        let period = silence_stop * (1.0 / SILENT_PERIODS);
        if self.seq.is_some() { silence_stop } else { silence_stop.max(self.params.max_age + period) }
    }

    /// Until when a movement moves the wheels that is obeyed now, lasts so long, and was asked for on news of this age:
    /// through the time that its last speed is held, but no longer than that news may be echoed (fault matrix, row 8).
    ///
    /// Otherwise a command on news that is all but too old would drive on when all of it is. A holder who may be silent for
    /// longer than the shortest silence comes less often; the news that moves the wheels may be older by as much.
    pub(crate) fn until(&self, now: Seconds, lasts: Seconds, age: Seconds, silence_stop: Seconds) -> Seconds {
        let news = self.params.max_age + (silence_stop - SHORTEST_SILENCE) - age;
        now + (lasts + self.params.grace).min(news)
    }

    /// Ends the lease and the movement that it gave; the beats brake from now on.
    pub(crate) fn end_lease(&mut self, cause: BrakeCause) {
        self.held = None;
        self.course = None;
        self.cause = Some(cause);
    }
}

impl Course {
    /// The speeds that it asks for; the last ones of what counts are held.
    fn speeds_at(&self, now: Seconds) -> Sides<MetresPerSecond> {
        self.dwm.speeds_at((now - self.since).min(self.lasts))
    }
    /// The same with their accelerations.
    fn setpoints_at(&self, now: Seconds) -> Sides<Setpoint> {
        let is_held = now - self.since >= self.lasts;
        let gains = self.dwm.start().zip(self.dwm.end(), |v0, v1| (v1 - v0).0 / self.dwm.duration().0);
        self.speeds_at(now).zip(gains, |speed, gain| Setpoint {
            speed: speed.0,
            acceleration: if is_held { 0.0 } else { gain },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{Rig, ask, drive};
    use axle_schema::Tick;
    use axle_schema::command::{Command, LeaseAsk, Motion};

    #[test]
    fn a_movement_runs_from_its_acceptance_and_brakes_when_no_next_one_comes() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.0, 0.16, 0.08)).expect("obeyed");
        // 2 m/s² for 80 ms, below the 2.5 m/s² of the gate: the setpoint is the movement itself.
        let speeds = rig.beats(0.04);
        assert!((speeds.left.0 - 0.08).abs() < 1e-9, "half of the way to 0.16 m/s: {speeds:?}");
        let speeds = rig.beats(0.085);
        assert!((speeds.left.0 - 0.16).abs() < 1e-9, "the end speed is held for 50 ms: {speeds:?}");
        assert_eq!(rig.gate.motion(), Motion::Driving);
        rig.beats(0.01);
        assert_eq!(
            (rig.gate.motion(), rig.gate.state(rig.now).cause),
            (Motion::Braking, Some(BrakeCause::Expired))
        );
        // 0.16 m/s at 2 m/s² takes 80 ms.
        assert_eq!(rig.beats(0.085), Sides::default());
        assert_eq!(rig.gate.motion(), Motion::Standing);
    }

    #[test]
    fn a_sender_can_shorten_a_movement() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        let mut command = rig.next(&lease, drive(0.0, 0.2, 0.1));
        command.ttl_ms = 20;
        rig.gate.obey(rig.now, &command).expect("obeyed");
        // A fifth of the way to 0.2 m/s, then held for 50 ms, then braked.
        assert!((rig.beats(0.06).left.0 - 0.04).abs() < 1e-9);
        rig.beats(0.015);
        assert_eq!(rig.gate.motion(), Motion::Braking);
    }

    #[test]
    fn news_drives_no_longer_than_it_may_be_echoed() {
        // A command may come 250 ms after what it echoes. Who comes every 200 ms may be silent for 500 ms instead of 150.
        for (period, age, drives) in
            [(0.05, 0.1, 0.1), (0.05, 0.2, 0.05), (0.05, 0.249, 0.001), (0.2, 0.2, 0.25)]
        {
            let mut rig = Rig::enabled();
            rig.now = Seconds(1.0);
            let ask = LeaseAsk { period: Seconds(period), ..ask("a", Class::Corrector) };
            let lease = rig.gate.lease(rig.now, &ask).expect("a lease");
            let echo = Tick::of(rig.now);
            rig.now += Seconds(age);
            let command = Command { echo, ..rig.next(&lease, drive(0.2, 0.2, period)) };
            rig.gate.obey(rig.now, &command).expect("obeyed");
            let from = rig.now;
            for ms in 0..500_u32 {
                rig.now = from + Seconds(f64::from(ms) / 1000.0);
                rig.gate.beat(rig.now);
                if rig.gate.motion() != Motion::Driving {
                    break;
                }
            }
            let drove = rig.now - from;
            assert!(
                (drove.0 - drives).abs() < 2e-3,
                "news of {age} s ago drove for {drove}, not for {drives} s"
            );
            // Wheels that have not begun to turn need no braking.
            let cause = (drives > 0.01).then_some(BrakeCause::Expired);
            assert_eq!(rig.gate.state(rig.now).cause, cause, "news of {age} s ago");
        }
    }

    #[test]
    fn silence_ends_the_lease_even_of_a_long_movement() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.5, 0.5, 10.0)).expect("obeyed");
        rig.beats(0.145);
        assert_eq!(rig.gate.motion(), Motion::Driving);
        rig.beats(0.01);
        let state = rig.gate.state(rig.now);
        assert_eq!(
            (state.motion, state.cause, state.holder),
            (Motion::Braking, Some(BrakeCause::Silence), None)
        );
        assert_eq!(rig.command(&lease, drive(0.0, 0.2, 1.0)), Err(Reject::Fenced));
    }

    #[test]
    fn the_first_command_may_take_as_long_as_its_way_and_that_of_the_grant() {
        // 250 ms for both ways, and a period of 60 ms at most between them.
        for (waits, obeyed) in [(0.3, true), (0.305, true), (0.32, false)] {
            let mut rig = Rig::enabled();
            let lease = rig.lease("a", Class::Corrector);
            assert_eq!(rig.beats(waits), Sides::default(), "nothing moves by a grant");
            assert_eq!(rig.command(&lease, drive(0.0, 0.1, 1.0)).is_ok(), obeyed, "after {waits} s");
            // From then on silence is what the lease says.
            rig.beats(0.145);
            assert_eq!(rig.gate.held.is_some(), obeyed, "after {waits} s");
            rig.beats(0.01);
            assert_eq!(rig.gate.held, None);
        }
        let ask = LeaseAsk { period: Seconds(0.2), ..ask("a", Class::Corrector) };
        let mut rig = Rig::enabled();
        rig.gate.lease(rig.now, &ask).expect("a lease");
        rig.beats(0.49);
        assert!(rig.gate.held.is_some(), "500 ms are enough for anybody");
        rig.beats(0.02);
        assert_eq!(rig.gate.held, None);
    }

    #[test]
    fn a_grant_over_moving_wheels_brakes_them_however_long_the_first_command_takes() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.5, 0.5, 10.0)).expect("obeyed");
        assert!(rig.beats(0.14).left.0 > 0.3);
        rig.lease("m", Class::Manual);
        let before = rig.gate.wheels.left.0;
        let after = rig.beats(0.1).left.0;
        assert!((before - after - 0.2).abs() < 1e-9, "2 m/s² from the grant on: {before} to {after}");
    }

    #[test]
    fn a_command_during_braking_resumes_smoothly() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.2, 0.2, 0.05)).expect("obeyed");
        let slow = rig.beats(0.12).left.0;
        assert!(slow > 0.05 && slow < 0.2, "braking: {slow}");
        rig.command(&lease, drive(0.2, 0.2, 0.05)).expect("obeyed");
        let next = rig.beats(0.005).left.0;
        assert!((next - slow - 2.5 * 0.005).abs() < 1e-9, "from {slow} up by 12.5 mm/s: {next}");
    }

    #[test]
    fn after_a_pause_of_the_process_the_wheels_do_not_jump() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        rig.gate.beat(rig.now);
        rig.now += Seconds(0.1);
        rig.command(&lease, drive(1.0, 1.0, 5.0)).expect("obeyed");
        let speeds = rig.gate.beat(rig.now);
        assert!((speeds.left.0 - 2.5 * MAX_BEAT.0).abs() < 1e-12, "as after 50 ms: {speeds:?}");
    }

    #[test]
    fn with_a_jerk_limit_silence_ends_in_a_softer_braking_to_standstill() {
        let params = GateParams { starts_enabled: true, jerk: Some(20.0), ..GateParams::default() };
        let mut gate = Gate::new(params, &Drivetrain::default(), crate::rig::BOOT, None).expect("a gate");
        let mut rig = Rig { gate: gate.clone(), ..Rig::enabled() };
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.8, 0.8, 5.0)).expect("obeyed");
        gate = rig.gate;
        let (mut speeds, mut steepest, mut rate) = (vec![0.0], 0.0_f64, 0.0);
        for beat in 1..=240_u32 {
            let speed = gate.beat(Seconds(f64::from(beat) * 0.005)).left.0;
            let acceleration = (speed - speeds[speeds.len() - 1]) / 0.005;
            assert!((acceleration - rate).abs() <= 20.0 * 0.007 + 1e-9, "{rate} to {acceleration} m/s²");
            (steepest, rate) = (steepest.max(acceleration.abs()), acceleration);
            speeds.push(speed);
        }
        assert!(steepest <= 2.5 + 1e-9 && speeds.iter().copied().fold(0.0, f64::max) > 0.2);
        assert_eq!((gate.motion(), speeds[240]), (Motion::Standing, 0.0));
    }

    #[test]
    fn a_clock_that_jumps_ahead_brakes_and_one_that_jumps_back_stands_still() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.5, 0.5, 5.0)).expect("obeyed");
        let speed = rig.beats(0.14).left;
        let waiting = rig.next(&lease, drive(0.5, 0.5, 5.0));
        let back = rig.gate.beat(rig.now - Seconds(10.0));
        assert_eq!((back.left, rig.gate.motion()), (speed, Motion::Driving), "no time has passed");
        rig.now += Seconds(3600.0);
        let ahead = rig.gate.beat(rig.now).left;
        assert!((speed - ahead).0 <= 2.0 * MAX_BEAT.0 + 1e-12 && ahead < speed, "{speed} to {ahead}");
        assert_eq!(rig.gate.state(rig.now).cause, Some(BrakeCause::Silence));
        let lease = rig.lease("a", Class::Corrector);
        let waiting = Command { epoch: lease.epoch, ..waiting };
        assert_eq!(rig.gate.obey(rig.now, &waiting), Err(Reject::Stale), "what was said before the jump");
    }

    #[test]
    fn a_clock_that_is_no_number_brakes() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.5, 0.5, 5.0)).expect("obeyed");
        rig.beats(0.1);
        for _ in 0..10 {
            rig.gate.beat(Seconds(f64::NAN));
        }
        assert_eq!(rig.gate.motion(), Motion::Standing);
    }
}
