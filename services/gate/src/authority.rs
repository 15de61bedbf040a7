//! Who may move the wheels: leases, AllStop and enable.

use crate::Gate;
use crate::gate::{Held, LONGEST_SILENCE, Permit, SHORTEST_SILENCE, SILENT_PERIODS};
use axle_schema::codec::Message;
use axle_schema::command::{BrakeCause, Class, Enable, Lease, LeaseAsk, Release};
use axle_schema::{Boot, Refusal, Seconds, StopId, Tick};

impl Gate {
    /// Gives somebody the right to command the wheels. A higher class takes it at once, an equal or lower one never;
    /// the holder itself may ask again, and gets a new epoch. Every grant starts from braking wheels: what an older
    /// epoch commanded ends with it. Commands renew the lease; the first one may take longer than the others.
    ///
    /// # Errors
    /// [`Refusal::Disabled`], [`Refusal::Busy`] with the name of the holder, and what [`LeaseAsk`] may not be.
    pub fn lease(&mut self, now: Seconds, ask: &LeaseAsk) -> Result<Lease, Refusal> {
        let now = self.settle(now);
        ask.check()?;
        if self.permit != Permit::Enabled {
            return Err(Refusal::Disabled { why: self.why_disabled() });
        }
        let cause = match &self.held {
            None => None,
            Some(held) if held.holder == ask.holder => Some(BrakeCause::Released),
            Some(held) if ask.class > held.class => Some(BrakeCause::Preempted),
            Some(held) => return Err(Refusal::Busy { holder: held.holder.clone() }),
        };
        let Some(epoch) = self.epoch.checked_add(1) else {
            return Err(Refusal::internal("the numbers of leases are used up; restart the robot process"));
        };
        if let Some(cause) = cause {
            self.end_lease(cause);
        }
        let silence_stop = (ask.period * SILENT_PERIODS).max(SHORTEST_SILENCE).min(LONGEST_SILENCE);
        self.epoch = epoch;
        self.seq = None;
        self.held = Some(Held { holder: ask.holder.clone(), class: ask.class, silence_stop, heard: now });
        Ok(Lease { boot: self.boot, epoch, tick: Tick::of(now), silence_stop })
    }

    /// Takes a lease back from its holder. To give back what has already ended is no fault.
    ///
    /// # Errors
    /// [`Refusal::Fenced`] for a token that is not the latest.
    pub fn release(&mut self, now: Seconds, release: &Release) -> Result<(), Refusal> {
        self.settle(now);
        self.same_boot(release.boot)?;
        if release.epoch != self.epoch {
            let why = format!("this lease is number {}, the latest is {}", release.epoch, self.epoch);
            return Err(Refusal::Fenced { why });
        }
        if self.held.is_some() {
            self.end_lease(BrakeCause::Released);
        }
        Ok(())
    }

    /// AllStop: brakes and latches, whoever drives and however often it comes. The id in the state is the receipt.
    pub fn stop(&mut self, now: Seconds, id: StopId) {
        self.settle(now);
        self.stop = Some(id);
        self.permit = Permit::Stopped;
        self.end_lease(BrakeCause::AllStop);
    }

    /// Brakes and disables the drive, for a reason of the process that owns the board: the board is lost, or another
    /// process says it is the same robot. An AllStop in force stays in force.
    pub fn disable(&mut self, now: Seconds) {
        self.settle(now);
        if self.permit == Permit::Enabled {
            self.permit = Permit::Disabled;
            self.end_lease(BrakeCause::Disabled);
        }
    }

    /// Lets the wheels move again, for whoever asks for a lease from now on. Nothing moves by itself. Where the drive
    /// is enabled already, nothing changes.
    ///
    /// # Errors
    /// [`Refusal::Fenced`] unless it quotes this boot, the latest stop (or none, where there was none) and an echo
    /// that is no older than a command's: so neither a delayed nor a replayed enable ends a stop.
    /// [`Refusal::OutOfRange`] for a program: a person lets a robot move again.
    pub fn enable(&mut self, now: Seconds, enable: &Enable) -> Result<(), Refusal> {
        let now = self.settle(now);
        enable.check()?;
        if enable.class < Class::Manual {
            let class = format!("{:?}", enable.class).to_lowercase();
            let limit = "manual or above: a person lets a robot move again, no program does";
            return Err(Refusal::out_of_range("class of an enable", class, limit));
        }
        self.same_boot(enable.boot)?;
        if enable.stop != self.stop {
            let why =
                format!("it quotes {}, but the latest is {}", stop_text(enable.stop), stop_text(self.stop));
            return Err(Refusal::Fenced { why });
        }
        let age = Tick::of(now).since(enable.echo);
        if !self.is_fresh(age) {
            let most = self.params.max_age.0 * 1000.0;
            let why = format!(
                "its echo is {age} ms old, at most {most} ms; read the gate's state and send it again"
            );
            return Err(Refusal::Fenced { why });
        }
        if self.permit != Permit::Enabled {
            self.permit = Permit::Enabled;
            self.held = None;
        }
        Ok(())
    }

    /// The AllStop in force: what has to be stored, so that it outlives the process.
    #[must_use]
    pub fn latch(&self) -> Option<StopId> {
        if self.permit == Permit::Stopped { self.stop } else { None }
    }

    /// Whether an echo of this age in milliseconds is neither from the future nor too old.
    pub(crate) fn is_fresh(&self, age: i32) -> bool {
        age >= 0 && f64::from(age) <= self.params.max_age.0 * 1000.0
    }

    fn same_boot(&self, boot: Boot) -> Result<(), Refusal> {
        if boot == self.boot {
            Ok(())
        } else {
            Err(Refusal::Fenced {
                why: format!("it is for boot {boot} of the robot process, this is {}", self.boot),
            })
        }
    }

    fn why_disabled(&self) -> String {
        let cause = match (self.permit, self.stop) {
            (Permit::Stopped, Some(id)) => format!("AllStop {id} is in force"),
            _ => "it has not been enabled since boot, or the robot process disabled it".to_owned(),
        };
        format!("{cause}; `axle enable` lets it move again")
    }
}

fn stop_text(stop: Option<StopId>) -> String {
    stop.map_or_else(|| "no stop".to_owned(), |id| format!("stop {id}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GateParams;
    use crate::rig::{BOOT, Rig, ask, drive};
    use axle_schema::Drivetrain;
    use axle_schema::command::{Motion, Reject};

    const STOP: StopId = StopId(7);

    #[test]
    fn of_two_correctors_that_ask_at_once_exactly_one_is_granted() {
        let mut rig = Rig::enabled();
        rig.lease("a", Class::Corrector);
        let refusal = rig.gate.lease(rig.now, &ask("b", Class::Corrector)).expect_err("an equal class");
        assert_eq!(refusal, Refusal::Busy { holder: "a".into() });
        assert!(rig.gate.lease(rig.now, &ask("c", Class::Background)).is_err(), "a lower class");
    }

    #[test]
    fn a_higher_class_takes_the_wheels_in_mid_movement_and_the_old_holder_is_fenced() {
        let mut rig = Rig::enabled();
        let old = rig.lease("a", Class::Corrector);
        rig.command(&old, drive(0.5, 0.5, 1.0)).expect("obeyed");
        let before = rig.beats(0.1);
        let new = rig.lease("m", Class::Manual);
        assert_eq!(new.epoch, old.epoch + 1);
        assert_eq!(rig.command(&old, drive(0.5, 0.5, 1.0)), Err(Reject::Fenced));
        let state = rig.gate.state(rig.now);
        assert_eq!((state.motion, state.cause), (Motion::Braking, Some(BrakeCause::Preempted)));
        rig.command(&new, drive(0.5, 0.5, 1.0)).expect("obeyed");
        assert!(rig.beats(0.005).left.0 >= before.left.0, "continuous, without braking in between");
    }

    #[test]
    fn the_silence_that_brakes_is_two_and_a_half_periods_within_bounds() {
        for (period, silence_stop) in [(0.01, 0.15), (0.05, 0.15), (0.1, 0.25), (0.2, 0.5), (1.0, 0.5)] {
            let ask = LeaseAsk { period: Seconds(period), ..ask("a", Class::Corrector) };
            let lease = Rig::enabled().gate.lease(Seconds::ZERO, &ask).expect("a lease");
            assert!((lease.silence_stop.0 - silence_stop).abs() < 1e-12, "{period} s: {lease:?}");
        }
        for period in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let ask = LeaseAsk { period: Seconds(period), ..ask("a", Class::Corrector) };
            assert!(Rig::enabled().gate.lease(Seconds::ZERO, &ask).is_err(), "{period} is refused");
        }
    }

    #[test]
    fn a_lease_given_back_brakes_and_is_free() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.5, 0.5, 1.0)).expect("obeyed");
        rig.beats(0.1);
        let release = Release { boot: lease.boot, epoch: lease.epoch };
        assert!(rig.gate.release(rig.now, &Release { epoch: 0, ..release }).is_err());
        assert!(rig.gate.release(rig.now, &Release { boot: Boot(1), ..release }).is_err());
        rig.gate.release(rig.now, &release).expect("given back");
        rig.gate.release(rig.now, &release).expect("given back twice");
        assert_eq!(
            (rig.gate.motion(), rig.gate.state(rig.now).cause),
            (Motion::Braking, Some(BrakeCause::Released))
        );
        rig.lease("b", Class::Background);
    }

    #[test]
    fn all_stop_needs_no_lease_latches_and_is_accepted_whatever_the_state() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.5, 0.5, 1.0)).expect("obeyed");
        let moving = rig.beats(0.2).left.0;
        rig.gate.stop(rig.now, StopId(3));
        rig.gate.stop(rig.now, STOP);
        let once = rig.gate.headline();
        rig.gate.stop(rig.now, STOP);
        assert_eq!(rig.gate.headline(), once, "the same stop again is no news");
        assert_eq!(
            (rig.gate.latch(), rig.gate.state(rig.now).cause),
            (Some(STOP), Some(BrakeCause::AllStop))
        );
        assert_eq!(rig.command(&lease, drive(0.5, 0.5, 1.0)), Err(Reject::Disabled));
        let next = rig.beats(0.005).left.0;
        assert!((moving - next - 2.0 * 0.005).abs() < 1e-12, "a bounded ramp: {moving} to {next}");
        rig.beats(0.4);
        assert_eq!(rig.gate.motion(), Motion::Standing);
        let refusal = rig.gate.lease(rig.now, &ask("m", Class::Manual)).expect_err("stopped");
        assert!(
            matches!(refusal, Refusal::Disabled { .. }) && refusal.to_string().contains('7'),
            "{refusal}"
        );
    }

    #[test]
    fn only_a_fresh_enable_that_quotes_the_latest_stop_ends_it() {
        let mut rig = Rig::enabled();
        rig.now = Seconds(5.0);
        rig.gate.stop(rig.now, STOP);
        let fine = Enable {
            stop: Some(STOP),
            boot: BOOT,
            echo: Tick(4900),
            by: "a person".into(),
            class: Class::Manual,
        };
        let wrong = [
            Enable { stop: None, ..fine.clone() },
            Enable { stop: Some(StopId(6)), ..fine.clone() },
            Enable { boot: Boot(1), ..fine.clone() },
            Enable { echo: Tick(4749), ..fine.clone() },
            Enable { echo: Tick(5001), ..fine.clone() },
        ];
        for enable in wrong {
            assert!(matches!(rig.gate.enable(rig.now, &enable), Err(Refusal::Fenced { .. })), "{enable:?}");
            assert_eq!(rig.gate.latch(), Some(STOP));
        }
        for enable in [
            Enable { class: Class::Corrector, ..fine.clone() },
            Enable { class: Class::Background, ..fine.clone() },
            Enable { by: "x".repeat(97), ..fine.clone() },
        ] {
            let refused = rig.gate.enable(rig.now, &enable);
            assert!(refused.is_err_and(|refusal| !matches!(refusal, Refusal::Fenced { .. })), "{enable:?}");
            assert_eq!(rig.gate.latch(), Some(STOP));
        }
        rig.gate.enable(rig.now, &fine).expect("enabled");
        assert_eq!((rig.gate.latch(), rig.gate.state(rig.now).holder), (None, None));
        rig.lease("a", Class::Corrector);
        rig.gate.enable(rig.now, &fine).expect("enabled already");
        assert!(rig.gate.state(rig.now).holder.is_some(), "an enable of what is enabled takes no lease away");
    }

    #[test]
    fn after_a_boot_nothing_moves_before_an_enable() {
        let robot = Drivetrain::default();
        let mut gate = Gate::new(GateParams::default(), &robot, BOOT, None).expect("a gate");
        assert!(gate.lease(Seconds(1.0), &ask("a", Class::Manual)).is_err());
        let enable =
            Enable { stop: None, boot: BOOT, echo: Tick(900), by: "a person".into(), class: Class::Manual };
        gate.enable(Seconds(1.0), &enable).expect("enabled");
        assert!(gate.lease(Seconds(1.0), &ask("a", Class::Manual)).is_ok());
    }

    #[test]
    fn a_stored_stop_outlives_the_process_even_of_a_robot_that_starts_enabled() {
        let params = GateParams { starts_enabled: true, ..GateParams::default() };
        let gate = Gate::new(params, &Drivetrain::default(), BOOT, Some(STOP)).expect("a gate");
        let state = gate.state(Seconds::ZERO);
        assert_eq!((state.enabled, state.stop, gate.latch()), (false, Some(STOP), Some(STOP)));
    }

    #[test]
    fn a_process_may_disable_the_drive_but_not_weaken_a_stop() {
        let mut rig = Rig::enabled();
        rig.lease("a", Class::Corrector);
        rig.gate.disable(rig.now);
        assert_eq!((rig.gate.latch(), rig.gate.state(rig.now).enabled), (None, false));
        rig.gate.stop(rig.now, STOP);
        rig.gate.disable(rig.now);
        assert_eq!(rig.gate.latch(), Some(STOP));
    }
}
