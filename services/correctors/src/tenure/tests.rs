//! When wheels are held, lost, regained, and given up.

use super::*;
use axle_schema::command::Motion;
use axle_schema::{Boot, Sides, StopId};
use std::collections::BTreeMap;

const PERIOD: Seconds = Seconds(0.05);

fn lease(epoch: u32) -> Lease {
    Lease { boot: Boot(7), epoch, tick: Tick(100), silence_stop: Seconds(0.15) }
}
/// The account of a gate that brakes for this cause and has no holder.
fn state(epoch: u32, cause: Option<BrakeCause>) -> GateState {
    GateState {
        boot: Boot(7),
        tick: Tick(0),
        epoch,
        holder: None,
        enabled: true,
        stop: None,
        stored: false,
        motion: Motion::Braking,
        cause,
        wheels: Sides::default(),
        accepted: 0,
        rejected: BTreeMap::new(),
    }
}
/// A lease under which some commands have been sent, one at each beat; and the time of the next beat.
fn under_way() -> (Tenure, Seconds) {
    let mut tenure = Tenure::new(lease(3), PERIOD, Seconds::ZERO);
    for beat in 0..3 {
        assert_eq!(tenure.look(None, PERIOD * f64::from(beat)), Hold::Held);
        tenure.command(&Seen::default(), Dwm::rest(PERIOD));
    }
    (tenure, PERIOD * 3.0)
}

#[test]
fn a_command_names_the_lease_and_what_its_sender_saw() {
    let mut tenure = Tenure::new(lease(3), PERIOD, Seconds::ZERO);
    let first = tenure.command(&Seen::default(), Dwm::rest(PERIOD));
    assert_eq!(
        (first.boot, first.epoch, first.seq, first.echo, first.ttl_ms),
        (Boot(7), 3, 1, Tick(100), 150)
    );
    let encoders = axle_schema::EncodersData { stamp: Seconds(1.5), ..axle_schema::EncodersData::default() };
    let seen = Seen { encoders: Some(encoders), ..Seen::default() };
    let second = tenure.command(&seen, Dwm::rest(PERIOD));
    assert_eq!((second.seq, second.echo), (2, Tick(1500)));
}

#[test]
fn lost_commands_let_the_wheels_slip_and_they_are_regained_a_few_times() {
    for cause in [BrakeCause::Silence, BrakeCause::Expired] {
        let (mut tenure, mut at) = under_way();
        for epoch in 3..3 + u32::from(REGAINS) {
            assert_eq!(tenure.look(Some(&state(epoch, Some(cause))), at), Hold::Slipped);
            at += Seconds(0.1);
            let pause = tenure.regain(lease(epoch + 1), at);
            assert!((pause.0 - 0.1).abs() < 1e-12, "{pause}");
            assert_eq!(tenure.look(Some(&state(epoch, Some(cause))), at), Hold::Held, "an old account");
            for _ in 0..2 {
                tenure.command(&Seen::default(), Dwm::rest(PERIOD));
                at += PERIOD;
                assert_eq!(tenure.look(None, at), Hold::Held);
            }
        }
        let end = tenure.look(Some(&state(3 + u32::from(REGAINS), Some(cause))), at);
        assert!(matches!(end, Hold::Lost(Refusal::Fenced { .. })), "{end:?}");
    }
}

#[test]
fn what_somebody_wants_or_what_nobody_understands_ends_the_task() {
    let lost = |change: &dyn Fn(&mut GateState)| {
        let (mut tenure, at) = under_way();
        let mut state = state(3, Some(BrakeCause::Silence));
        change(&mut state);
        match tenure.look(Some(&state), at) {
            Hold::Lost(refusal) => refusal.to_string(),
            held => panic!("{held:?}"),
        }
    };
    assert!(lost(&|state| state.cause = Some(BrakeCause::Released)).contains("took the wheels back"));
    assert!(lost(&|state| state.cause = None).contains("took the wheels back"));
    assert!(lost(&|state| state.boot = Boot(8)).contains("restarted"));
    assert!(lost(&|state| (state.epoch, state.holder) = (4, Some("anna".into()))).contains("anna has taken"));
    let stopped = |state: &mut GateState| (state.enabled, state.stop) = (false, Some(StopId::from_random(9)));
    assert!(lost(&stopped).contains("stopped by AllStop"));
    assert!(lost(&|state| state.enabled = false).contains("axle enable"));
}

#[test]
fn who_was_away_does_not_go_on() {
    let (mut tenure, at) = under_way();
    assert_eq!(tenure.look(None, at + AWAY), Hold::Held, "the first beat after a freeze knows nothing yet");
    let late = tenure.look(Some(&state(3, Some(BrakeCause::Silence))), at + AWAY + PERIOD);
    assert!(matches!(late, Hold::Lost(_)), "{late:?}");
}

#[test]
fn the_account_of_before_the_first_command_says_nothing() {
    let mut tenure = Tenure::new(lease(3), PERIOD, Seconds::ZERO);
    tenure.command(&Seen::default(), Dwm::rest(PERIOD));
    assert_eq!(tenure.look(Some(&state(3, Some(BrakeCause::Silence))), PERIOD), Hold::Held);
}

#[test]
fn a_gate_that_does_not_answer_is_not_waited_for_long() {
    let (mut tenure, at) = under_way();
    assert!(tenure.wait(at).is_ok(), "nobody waits");
    assert_eq!(tenure.look(Some(&state(3, Some(BrakeCause::Silence))), at), Hold::Slipped);
    assert!(tenure.wait(at + Seconds(0.9)).is_ok());
    let words = tenure.wait(at + Seconds(1.1)).expect_err("it has had its time").to_string();
    assert!(words.contains("took the wheels back") && words.contains("within 1 s"), "{words}");
}
