//! Which commands are obeyed. The checks run in a fixed order (fault model, 3.3), and each refusal is counted by its
//! first reason.

use crate::Gate;
use crate::gate::{COMMANDS_PER_BEAT, Course, Permit};
use axle_schema::codec::{Message, decode, decode_as};
use axle_schema::command::{Class, Command, Reject};
use axle_schema::{Boot, Dwm, MetresPerSecond, Refusal, Seconds, Tick};
use serde::{Deserialize, Serialize};

/// Planners that work at a limit miss it by rounding; so much more is let through.
const ROUNDING: f64 = 1e-6;

impl Gate {
    /// Takes the bytes of a command as they came, with their encoding ("" where there is none).
    ///
    /// # Errors
    /// The reason why it is not obeyed, which is also counted.
    pub fn command(&mut self, now: Seconds, encoding: &str, bytes: &[u8]) -> Result<(), Reject> {
        let now = self.settle(now);
        let verdict = self
            .admit()
            .and_then(|()| read(encoding, bytes))
            .and_then(|command| self.judge(now, &command).map(|()| self.follow(now, &command)));
        self.account(verdict)
    }

    /// Takes a command that is decoded already.
    ///
    /// # Errors
    /// As [`Gate::command`].
    pub fn obey(&mut self, now: Seconds, command: &Command) -> Result<(), Reject> {
        let now = self.settle(now);
        let verdict =
            self.admit().and_then(|()| self.judge(now, command)).map(|()| self.follow(now, command));
        self.account(verdict)
    }

    /// Bounds the time that commands cost between two beats.
    fn admit(&mut self) -> Result<(), Reject> {
        if self.arrived >= COMMANDS_PER_BEAT {
            return Err(Reject::Flood);
        }
        self.arrived += 1;
        Ok(())
    }

    fn judge(&self, now: Seconds, command: &Command) -> Result<(), Reject> {
        if command.check().is_err() || command.ttl_ms == 0 || !self.is_within_limits(&command.dwm) {
            return Err(Reject::Limit);
        }
        if command.boot != self.boot {
            return Err(Reject::Boot);
        }
        if command.epoch != self.epoch {
            return Err(Reject::Fenced);
        }
        if self.seq.is_some_and(|seq| command.seq <= seq) {
            return Err(Reject::Sequence);
        }
        let age = Tick::of(now).since(command.echo);
        if age < 0 {
            return Err(Reject::Future);
        }
        if !self.is_fresh(age) {
            return Err(Reject::Stale);
        }
        if self.permit != Permit::Enabled {
            return Err(Reject::Disabled);
        }
        match &self.held {
            // The latest grant has ended, and nobody else has asked yet.
            None => Err(Reject::Fenced),
            // The speed limit of those who may stop but not drive is 0; by commanding rest they keep the lease.
            Some(held)
                if held.class == Class::StopOnly && command.dwm.peak_speed() != MetresPerSecond::ZERO =>
            {
                Err(Reject::Limit)
            }
            Some(_) => Ok(()),
        }
    }

    /// Refused and not clamped: who asks for more than the robot can do has a wrong idea of it.
    fn is_within_limits(&self, dwm: &Dwm) -> bool {
        let most = self.params.a_max * dwm.duration();
        let change = dwm.start().zip(dwm.end(), |v0, v1| (v1 - v0).abs());
        dwm.peak_speed().0 <= self.wheel_speed.0 * (1.0 + ROUNDING)
            && change.both().iter().all(|change| change.0 <= most.0 * (1.0 + ROUNDING) + ROUNDING)
    }

    fn follow(&mut self, now: Seconds, command: &Command) {
        self.seq = Some(command.seq);
        let Some(held) = &mut self.held else { return };
        held.heard = now;
        let silence_stop = held.silence_stop;
        let lasts = command.dwm.duration().min(Seconds(f64::from(command.ttl_ms) / 1000.0));
        let age = Seconds(f64::from(Tick::of(now).since(command.echo)) / 1000.0);
        let until = self.until(now, lasts, age, silence_stop);
        self.course = Some(Course { dwm: command.dwm, since: now, lasts, until });
    }
}

/// Decodes a command; what is not one is told apart by whether its shape or only its numbers are wrong.
fn read(encoding: &str, bytes: &[u8]) -> Result<Command, Reject> {
    if bytes.len() > Command::LIMIT {
        return Err(Reject::Oversize);
    }
    decode_as(encoding, bytes).map_err(|refusal| match refusal {
        Refusal::OutOfRange { .. } => Reject::Limit,
        Refusal::Malformed { .. } if decode::<Shape>(bytes).is_ok() => Reject::Limit,
        _ => Reject::Malformed,
    })
}

/// The shape of a [`Command`] with any numbers in it. Only for the reason of a refusal, never obeyed.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Shape {
    boot: Boot,
    epoch: u32,
    seq: u32,
    echo: Tick,
    ttl_ms: u16,
    dwm: DwmShape,
}
impl Message for Shape {
    const NAME: &'static str = Command::NAME;
    const LIMIT: usize = Command::LIMIT;
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DwmShape {
    v0l: Number,
    v0r: Number,
    v1l: Number,
    v1r: Number,
    #[serde(rename = "T")]
    duration: Number,
}

/// A number, finite or not; "untagged" also takes an integer for a float, as the units of the schema do.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Number {
    Any(f64),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{Rig, drive, patched};
    use axle_schema::encode;

    /// What becomes of a command when one thing of it is changed.
    fn verdict(change: impl FnOnce(&mut Command)) -> Result<(), Reject> {
        let mut rig = Rig::enabled();
        rig.now = Seconds(10.0);
        let lease = rig.lease("a", Class::Corrector);
        rig.command(&lease, drive(0.1, 0.1, 0.1)).expect("obeyed");
        let mut command = rig.next(&lease, drive(0.1, 0.1, 0.1));
        change(&mut command);
        let before = rig.gate.clone();
        let verdict = rig.gate.obey(rig.now, &command);
        let state = rig.gate.state(rig.now);
        match verdict {
            Ok(()) => assert_eq!((state.accepted, state.rejected.len()), (2, 0)),
            Err(reject) => {
                assert_eq!((state.accepted, state.rejected[&reject]), (1, 1));
                assert_eq!(rig.gate.course, before.course, "the last command is unaffected");
            }
        }
        verdict
    }

    #[test]
    fn each_wrong_field_has_its_own_reason() {
        assert_eq!(verdict(|_| {}), Ok(()));
        assert_eq!(verdict(|command| command.boot = Boot(1)), Err(Reject::Boot));
        assert_eq!(verdict(|command| command.epoch += 1), Err(Reject::Fenced));
        assert_eq!(verdict(|command| command.epoch -= 1), Err(Reject::Fenced));
        assert_eq!(verdict(|command| command.seq -= 1), Err(Reject::Sequence));
        assert_eq!(verdict(|command| command.seq = 0), Err(Reject::Sequence));
        assert_eq!(verdict(|command| command.echo = Tick(9750)), Ok(()));
        assert_eq!(verdict(|command| command.echo = Tick(9749)), Err(Reject::Stale));
        assert_eq!(verdict(|command| command.echo = Tick(10_000)), Ok(()));
        assert_eq!(verdict(|command| command.echo = Tick(10_001)), Err(Reject::Future));
        assert_eq!(verdict(|command| command.ttl_ms = 0), Err(Reject::Limit));
    }

    #[test]
    fn what_the_robot_cannot_do_is_refused_and_not_clamped() {
        let limited = [
            (drive(1.0, 1.0, 0.1), Ok(())),
            (drive(1.0 + 1e-9, -1.0 - 1e-9, 1.0), Ok(())),
            (drive(1.001, 1.001, 0.1), Err(Reject::Limit)),
            (drive(0.0, -1.001, 1.0), Err(Reject::Limit)),
            (drive(1e308, 0.0, 0.1), Err(Reject::Limit)),
            (drive(5e-324, 0.0, 0.1), Ok(())),
            (drive(0.0, 0.25, 0.1), Ok(())),
            (drive(0.0, 0.26, 0.1), Err(Reject::Limit)),
            (drive(0.1, 0.1, 0.0), Err(Reject::Limit)),
            (drive(0.1, 0.1, 3600.0), Ok(())),
            (drive(0.1, 0.1, 1e9), Err(Reject::Limit)),
        ];
        for (dwm, expected) in limited {
            assert_eq!(verdict(|command| command.dwm = dwm), expected, "{dwm:?}");
        }
    }

    #[test]
    fn an_echo_survives_the_wrap_of_the_tick() {
        let mut rig = Rig::enabled();
        // The tick wraps after 2^32 ms.
        rig.now = Seconds(4_294_967.396);
        let lease = rig.lease("a", Class::Corrector);
        let command = Command { echo: Tick(u32::MAX - 99), ..rig.next(&lease, drive(0.1, 0.1, 0.1)) };
        assert_eq!(rig.gate.obey(rig.now, &command), Ok(()), "200 ms old");
        let command = Command { echo: Tick(u32::MAX - 200), seq: 9, ..command };
        assert_eq!(rig.gate.obey(rig.now, &command), Err(Reject::Stale), "300 ms old");
    }

    #[test]
    fn bytes_are_obeyed_or_counted_by_their_reason() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Corrector);
        let fine = encode(&rig.next(&lease, drive(0.1, 0.1, 0.11))).expect("bytes");
        assert!(decode::<Shape>(&fine).is_ok(), "the shape is that of a command");
        let long = [fine.as_slice(), &[0; 512]].concat();
        let trailing = [fine.as_slice(), &[0]].concat();
        let renamed: Vec<u8> = fine.iter().map(|&byte| if byte == b'T' { b'U' } else { byte }).collect();
        let table: [(&[u8], Reject); 8] = [
            (&long, Reject::Oversize),
            (&trailing, Reject::Malformed),
            (&renamed, Reject::Malformed),
            (&fine[..fine.len() - 1], Reject::Malformed),
            (b"", Reject::Malformed),
            (&patched(&fine, 0.11, f64::NAN), Reject::Limit),
            (&patched(&fine, 0.11, f64::NEG_INFINITY), Reject::Limit),
            (&patched(&fine, 0.11, -0.11), Reject::Limit),
        ];
        for (bytes, reject) in table {
            assert_eq!(rig.gate.command(rig.now, "", bytes), Err(reject), "{bytes:?}");
        }
        let other = "application/cbor;axle.Command.v2";
        assert_eq!(rig.gate.command(rig.now, other, &fine), Err(Reject::Malformed), "another version");
        assert_eq!(rig.gate.command(rig.now, "application/cbor;axle.Command.v1", &fine), Ok(()));
        assert_eq!(rig.gate.command(rig.now, "", &fine), Err(Reject::Sequence), "a duplicate");
    }

    #[test]
    fn after_an_outage_none_of_the_burst_is_obeyed_and_the_next_fresh_command_is() {
        let mut rig = Rig::enabled();
        let lease = rig.lease("a", Class::Manual);
        let burst: Vec<Command> = (0..160)
            .map(|_| {
                rig.now += Seconds(0.05);
                rig.next(&lease, drive(0.1, 0.1, 0.1))
            })
            .collect();
        rig.now += Seconds(0.3);
        for command in &burst {
            assert!(rig.gate.obey(rig.now, command).is_err());
        }
        assert_eq!(rig.gate.state(rig.now).accepted, 0);
        let lease = rig.lease("a", Class::Manual);
        assert_eq!(rig.command(&lease, drive(0.1, 0.1, 0.1)), Ok(()));
    }

    #[test]
    fn who_may_only_stop_keeps_others_out_but_cannot_drive() {
        let mut rig = Rig::enabled();
        rig.lease("m", Class::Manual);
        let lease = rig.lease("s", Class::StopOnly);
        assert_eq!(rig.command(&lease, drive(0.1, 0.1, 0.1)), Err(Reject::Limit));
        for _ in 0..10 {
            rig.beats(0.1);
            assert_eq!(rig.command(&lease, drive(0.0, 0.0, 0.1)), Ok(()), "rest renews the lease");
        }
        assert!(rig.gate.lease(rig.now, &crate::rig::ask("m", Class::Manual)).is_err());
    }
}
