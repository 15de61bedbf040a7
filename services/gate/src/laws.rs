//! Laws of the gate under random histories.

use crate::gate::MAX_BEAT;
use crate::rig::{BOOT, ask};
use crate::{Gate, GateParams};
use axle_schema::command::{Class, Command, Enable, Lease, Motion, Release};
use axle_schema::{Boot, Drivetrain, Dwm, MetresPerSecond, Seconds, Sides, StopId, Tick, encode};
use proptest::prelude::*;

/// What somebody does, with small numbers in place of what a history knows better.
#[derive(Clone, Debug)]
enum Act {
    Lease { holder: u8, class: Class },
    Release { lease: usize },
    Drive { lease: usize, speeds: [f64; 4], duration: f64, late_ms: u32, seq_back: u32, as_bytes: bool },
    Garbage(Vec<u8>),
    Stop(u64),
    Enable { stop_back: u64 },
    Disable,
}

fn act() -> impl Strategy<Value = Act> {
    let class = prop_oneof![
        3 => Just(Class::Corrector),
        1 => Just(Class::Background),
        1 => Just(Class::Manual),
        1 => Just(Class::StopOnly),
    ];
    // Mostly what a healthy commander sends, and now and then what the fault matrix is about.
    let speed = prop_oneof![8 => -1.0..1.0, 1 => Just(0.0), 1 => -2.0..2.0];
    let drive = (
        0_usize..3,
        prop::array::uniform4(speed),
        0.01..2.0,
        prop_oneof![4 => Just(0_u32), 1 => 0_u32..600],
        prop_oneof![9 => Just(0_u32), 1 => 0_u32..3],
        any::<bool>(),
    )
        .prop_map(|(lease, speeds, duration, late_ms, seq_back, as_bytes)| Act::Drive {
            lease,
            speeds,
            duration,
            late_ms,
            seq_back,
            as_bytes,
        });
    prop_oneof![
        3 => (0_u8..3, class).prop_map(|(holder, class)| Act::Lease { holder, class }),
        1 => (0_usize..3).prop_map(|lease| Act::Release { lease }),
        12 => drive,
        1 => prop::collection::vec(any::<u8>(), 0..600).prop_map(Act::Garbage),
        1 => (1_u64..4).prop_map(Act::Stop),
        3 => (0_u64..2).prop_map(|stop_back| Act::Enable { stop_back }),
        1 => Just(Act::Disable),
    ]
}

/// A gate, and what a checker remembers of its history.
struct History {
    gate: Gate,
    now: Seconds,
    leases: Vec<Lease>,
    seq: u32,
    /// Epoch, sequence number and time of the latest command that was obeyed.
    obeyed: Option<(u32, u32, Seconds)>,
    /// The time of the robot that it echoes.
    news: Seconds,
    stop: Option<StopId>,
    /// Since when nobody may move the wheels.
    forbidden: Option<Seconds>,
    speeds: Sides<MetresPerSecond>,
}

impl History {
    fn new() -> Self {
        let params = GateParams { starts_enabled: true, ..GateParams::default() };
        Self {
            gate: Gate::new(params, &Drivetrain::default(), BOOT, None).expect("a gate"),
            now: Seconds::ZERO,
            leases: Vec::new(),
            seq: 0,
            obeyed: None,
            news: Seconds::ZERO,
            stop: None,
            forbidden: None,
            speeds: Sides::default(),
        }
    }

    fn happens(&mut self, act: Act) {
        match act {
            Act::Lease { holder, class } => {
                if let Ok(lease) = self.gate.lease(self.now, &ask(&format!("h{holder}"), class)) {
                    let older = self.leases.last().map_or(0, |lease| lease.epoch);
                    assert!(lease.epoch > older && self.forbidden.is_none(), "{lease:?} after {older}");
                    self.leases.push(lease);
                }
            }
            Act::Release { lease } => {
                if let Some(&Lease { boot, epoch, .. }) = self.leases.iter().rev().nth(lease) {
                    let result = self.gate.release(self.now, &Release { boot, epoch });
                    assert_eq!(result.is_ok(), lease == 0, "only the latest lease can be given back");
                }
            }
            Act::Drive { lease, speeds, duration, late_ms, seq_back, as_bytes } => {
                let Some(&lease) = self.leases.iter().rev().nth(lease) else { return };
                self.drives(lease, speeds, duration, late_ms, seq_back, as_bytes);
            }
            Act::Garbage(bytes) => {
                let before = self.gate.state(self.now).accepted;
                self.gate.command(self.now, "", &bytes).expect_err("garbage");
                assert_eq!(self.gate.state(self.now).accepted, before);
            }
            Act::Stop(id) => {
                self.gate.stop(self.now, StopId(id));
                self.stop = Some(StopId(id));
                self.forbidden.get_or_insert(self.now);
                assert_eq!(self.gate.latch(), self.stop, "accepted always, and the last id wins");
            }
            Act::Enable { stop_back } => {
                let quoted = self.stop.map(|StopId(id)| StopId(id - stop_back));
                let enable = Enable {
                    stop: quoted,
                    boot: BOOT,
                    echo: Tick::of(self.now),
                    by: "a test".into(),
                    class: Class::Manual,
                };
                let result = self.gate.enable(self.now, &enable);
                assert_eq!(result.is_ok(), quoted == self.stop, "it must quote the latest stop");
                if result.is_ok() {
                    self.forbidden = None;
                }
            }
            Act::Disable => {
                self.gate.disable(self.now);
                self.forbidden.get_or_insert(self.now);
            }
        }
    }

    fn drives(
        &mut self,
        lease: Lease,
        speeds: [f64; 4],
        duration: f64,
        late_ms: u32,
        seq_back: u32,
        as_bytes: bool,
    ) {
        self.seq += 1;
        let [v0l, v0r, v1l, v1r] = speeds.map(MetresPerSecond);
        let command = Command {
            boot: lease.boot,
            epoch: lease.epoch,
            seq: self.seq.saturating_sub(seq_back),
            echo: Tick(Tick::of(self.now).0.wrapping_sub(late_ms)),
            ttl_ms: 1000,
            dwm: Dwm::new(Sides::new(v0l, v0r), Sides::new(v1l, v1r), Seconds(duration)).expect("finite"),
        };
        let verdict = if as_bytes {
            self.gate.command(self.now, "", &encode(&command).expect("bytes"))
        } else {
            self.gate.obey(self.now, &command)
        };
        if verdict.is_ok() {
            assert!(self.forbidden.is_none() && late_ms <= 250, "obeyed {command:?}");
            assert_eq!(Some(lease.epoch), self.leases.last().map(|lease| lease.epoch), "two holders");
            if let Some((epoch, seq, _)) = self.obeyed {
                assert!(epoch < command.epoch || seq < command.seq, "sequence numbers grow");
            }
            self.obeyed = Some((command.epoch, command.seq, self.now));
            self.news = self.now - Seconds(f64::from(late_ms) / 1000.0);
        }
    }

    fn beats(&mut self, span: Seconds) {
        self.now += span;
        let speeds = self.gate.beat(self.now);
        // The larger limit of the two, 2.5 m/s², and the largest wheel speed, 1 m/s.
        for (new, old) in speeds.both().into_iter().zip(self.speeds.both()) {
            assert!((new - old).abs().0 <= 2.5 * span.0 + 1e-12, "{old} to {new} within {span}");
            assert!(new.abs().0 <= 1.0 + 1e-6);
        }
        self.speeds = speeds;
        // The echo counts in milliseconds.
        let news = self.now - self.news;
        assert!(self.gate.motion() != Motion::Driving || news.0 < 0.251, "driven by news of {news} ago");
        // Braking from 1 m/s at 2 m/s² takes 0.5 s; a beat may come late by the longest beat.
        let braked = |since: Seconds| (self.now - since).0 > 0.5 + MAX_BEAT.0 + 1e-9;
        if self.forbidden.is_some_and(braked) {
            assert_eq!(self.gate.motion(), Motion::Standing, "latched or disabled");
        }
        let silent = |(_, _, at): (u32, u32, Seconds)| braked(at + Seconds(0.15));
        if self.obeyed.is_none_or(silent) {
            assert_eq!(speeds, Sides::default(), "silence means standstill");
        }
    }
}

proptest! {
    #[test]
    fn whatever_happens_the_wheels_stay_within_their_limits(
        steps in prop::collection::vec((0.0..0.05, prop::collection::vec(act(), 0..3)), 1..150),
    ) {
        let mut history = History::new();
        history.gate.beat(history.now);
        for (span, acts) in steps {
            for act in acts {
                history.happens(act);
            }
            history.beats(Seconds(span));
        }
    }

    #[test]
    fn no_bytes_panic_or_move_a_wheel(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        let mut history = History::new();
        history.happens(Act::Lease { holder: 0, class: Class::Corrector });
        history.happens(Act::Garbage(bytes));
    }

    #[test]
    fn a_command_with_a_wrong_byte_is_never_another_command_of_another_lease(
        at in any::<prop::sample::Index>(), byte in any::<u8>(),
    ) {
        let mut history = History::new();
        history.happens(Act::Lease { holder: 0, class: Class::Corrector });
        let Lease { epoch, tick, .. } = history.leases[0];
        let dwm = Dwm::rest(Seconds(0.1));
        let command = Command { boot: Boot(7), epoch, seq: 1, echo: tick, ttl_ms: 100, dwm };
        let mut bytes = encode(&command).expect("bytes");
        let at = at.index(bytes.len());
        bytes[at] = byte;
        // Boot 7 is not 42, and only the very byte that holds it can make it so.
        let verdict = history.gate.command(history.now, "", &bytes);
        prop_assert!(verdict.is_err() || byte == 42);
    }
}
