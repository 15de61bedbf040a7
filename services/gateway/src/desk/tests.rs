//! What the desk does when browsers drive, hide, freeze, vanish and come back; time is moved by hand.

use super::*;
use proptest::prelude::*;

fn r1() -> RobotId {
    RobotId::new("r1").expect("a robot")
}
fn at(seconds: f64) -> Seconds {
    Seconds(seconds)
}
fn arrive(desk: &mut Desk, now: f64, random: u64) -> SessionId {
    desk.arrive(at(now), None, random << 11, &format!("browser {random}")).expect("a place")
}
const AHEAD: Sides<f64> = Sides { left: 0.4, right: 0.4 };

#[test]
fn powers_are_obeyed_while_they_are_fresh() {
    let mut desk = Desk::new(GatewayParams::default());
    let one = arrive(&mut desk, 0.0, 1);
    for (now, echo, is_obeyed) in
        [(1.0, 0.95, true), (1.0, 0.5, true), (1.0, 0.49, false), (1.0, 1.2, false), (1.0, f64::NAN, false)]
    {
        let held = desk.hold(at(now), one, &r1(), at(echo), AHEAD);
        assert_eq!(held.is_ok(), is_obeyed, "sent at {echo}, came at {now}: {held:?}");
    }
    for power in [f64::NAN, f64::INFINITY, 20.1, -1e300] {
        let held = desk.hold(at(1.0), one, &r1(), at(1.0), Sides::new(0.0, power));
        assert!(held.expect_err("no power").to_string().contains("right"), "{power}");
    }
}

#[test]
fn one_browser_drives_at_a_time_and_the_next_when_it_lets_go() {
    let mut desk = Desk::new(GatewayParams::default());
    let (one, two) = (arrive(&mut desk, 0.0, 1), arrive(&mut desk, 0.0, 2));
    assert!(desk.hold(at(0.1), one, &r1(), at(0.1), AHEAD).is_ok());
    let busy = desk.hold(at(0.2), two, &r1(), at(0.2), AHEAD).expect_err("one drives").to_string();
    assert!(busy.contains("browser 1") && busy.contains("by hand"), "{busy}");
    assert_eq!(desk.release(one), [Out::Rest(r1())]);
    assert_eq!(desk.release(one), [], "once");
    assert!(desk.hold(at(0.21), two, &r1(), at(0.2), AHEAD).is_ok());
    // Who falls silent loses it as well.
    assert!(desk.hold(at(0.6), one, &r1(), at(0.6), AHEAD).is_ok());
}

#[test]
fn a_stick_that_is_not_renewed_is_let_go() {
    let mut desk = Desk::new(GatewayParams::default());
    let one = arrive(&mut desk, 0.0, 1);
    assert!(desk.hold(at(1.0), one, &r1(), at(1.0), AHEAD).is_ok());
    assert_eq!(desk.beat(at(1.29)), []);
    assert_eq!(desk.beat(at(1.31)), [Out::Rest(r1())]);
    assert_eq!(desk.beat(at(1.4)), []);
    assert_eq!(desk.hand(&r1()), None);
}

#[test]
fn a_hidden_page_lets_go_of_what_it_drove_by_hand_but_not_of_its_task() {
    let mut desk = Desk::new(GatewayParams::default());
    let one = arrive(&mut desk, 0.0, 1);
    assert!(desk.hold(at(0.1), one, &r1(), at(0.1), AHEAD).is_ok());
    let (task, turn) = (Errand::Task(r1(), TaskId(1)), Errand::Operation(r1(), TaskId(2)));
    desk.begin(one, task.clone());
    desk.begin(one, turn.clone());
    assert_eq!(desk.hide(one), [Out::Rest(r1()), Out::End(turn)]);
    desk.leave(at(1.0), one);
    assert_eq!(desk.beat(at(5.0)), [Out::End(task)]);
}

#[test]
fn what_a_lost_browser_had_begun_ends_unless_it_comes_back() {
    let params = GatewayParams::default();
    let mut desk = Desk::new(params.clone());
    let one = arrive(&mut desk, 0.0, 1);
    let task = Errand::Task(r1(), TaskId(1));
    desk.begin(one, task.clone());
    assert!(desk.hold(at(0.1), one, &r1(), at(0.1), AHEAD).is_ok());
    assert_eq!(desk.leave(at(0.2), one), [Out::Rest(r1())], "the stick is let go at once");
    assert_eq!(desk.beat(at(0.2) + params.grace), []);
    // It is loaded again, and its task goes on.
    assert_eq!(desk.arrive(at(3.2), Some(one), 99 << 11, "again"), Ok(one));
    assert_eq!(desk.beat(at(3.3)), []);
    desk.leave(at(4.0), one);
    let gone = at(4.01) + params.grace;
    assert_eq!(desk.beat(gone), [Out::End(task)]);
    assert_eq!(desk.sessions(), 0);
    // A number that is no longer known is no way in, but a new session.
    assert_ne!(desk.arrive(gone, Some(one), 99 << 11, "late"), Ok(one));
    // What it had asked for meanwhile is ended as soon as it has begun.
    let late = Errand::Operation(r1(), TaskId(3));
    assert_eq!(desk.begin(one, late.clone()), [Out::End(late)]);
}

#[test]
fn a_browser_that_is_connected_but_frozen_is_lost_too() {
    let params = GatewayParams::default();
    let mut desk = Desk::new(params.clone());
    let one = arrive(&mut desk, 0.0, 1);
    desk.begin(one, Errand::Task(r1(), TaskId(1)));
    desk.hear(at(1.0), one);
    let last = at(1.0) + params.silence + params.grace;
    assert_eq!(desk.beat(last), []);
    assert!(desk.knows(one));
    assert_eq!(desk.beat(last + at(0.01)), [Out::End(Errand::Task(r1(), TaskId(1)))]);
    assert!(!desk.knows(one), "its connection is closed");
    assert!(desk.hold(last, one, &r1(), last, AHEAD).is_err(), "it is somebody else's turn");
}

#[test]
fn a_page_that_is_loaded_again_before_it_has_gone_is_not_lost() {
    let mut desk = Desk::new(GatewayParams::default());
    let one = arrive(&mut desk, 0.0, 1);
    desk.begin(one, Errand::Task(r1(), TaskId(1)));
    assert_eq!(desk.arrive(at(0.1), Some(one), 5, ""), Ok(one));
    assert_eq!(desk.leave(at(0.2), one), []);
    desk.hear(at(4.0), one);
    assert_eq!(desk.beat(at(4.5)), []);
    desk.over(&Errand::Task(r1(), TaskId(1)));
    desk.leave(at(4.5), one);
    assert_eq!(desk.beat(at(9.0)), [], "what is over need not be ended");
}

#[test]
fn a_gateway_that_ends_lets_go_of_everything() {
    let mut desk = Desk::new(GatewayParams::default());
    let one = arrive(&mut desk, 0.0, 1);
    assert!(desk.hold(at(0.1), one, &r1(), at(0.1), AHEAD).is_ok());
    desk.begin(one, Errand::Task(r1(), TaskId(1)));
    assert_eq!(desk.close(), [Out::Rest(r1()), Out::End(Errand::Task(r1(), TaskId(1)))]);
    assert_eq!((desk.close(), desk.sessions()), (Vec::new(), 0));
}

#[test]
fn there_are_so_many_places_and_no_more() {
    let mut desk = Desk::new(GatewayParams { browsers: 2, ..GatewayParams::default() });
    arrive(&mut desk, 0.0, 1);
    let two = arrive(&mut desk, 0.0, 2);
    let full = desk.arrive(at(0.0), None, 3 << 11, "").expect_err("full").to_string();
    assert!(full.contains("2 browsers"), "{full}");
    for number in 0..100 {
        desk.begin(two, Errand::Task(r1(), TaskId(number)));
    }
    desk.leave(at(0.0), two);
    assert_eq!(desk.beat(at(3.5)).len(), MAX_ERRANDS);
}

#[derive(Clone, Debug)]
enum Deed {
    Hold(usize, f64),
    Release(usize),
    Hide(usize),
    Leave(usize),
    Back(usize),
    Wait(f64),
}

fn deed() -> impl Strategy<Value = Deed> {
    prop_oneof![
        (0..3_usize, -0.1..1.0).prop_map(|(who, age)| Deed::Hold(who, age)),
        (0..3_usize).prop_map(Deed::Release),
        (0..3_usize).prop_map(Deed::Hide),
        (0..3_usize).prop_map(Deed::Leave),
        (0..3_usize).prop_map(Deed::Back),
        (0.0..2.0).prop_map(Deed::Wait),
    ]
}

proptest! {
    /// Whatever browsers do: nobody drives by powers that are old, nobody drives while another does, and within `hold`
    /// of the last power that was obeyed the drive has been told to rest.
    #[test]
    fn nobody_drives_by_old_powers_or_beside_another(deeds in prop::collection::vec(deed(), 1..60)) {
        let params = GatewayParams::default();
        let mut desk = Desk::new(params.clone());
        let mut ids = [1, 2, 3].map(|number| arrive(&mut desk, 0.0, number));
        let mut now = 0.0;
        // Who was obeyed last, and when; none since a rest.
        let mut driving: Option<(SessionId, f64)> = None;
        for deed in deeds {
            now += 0.01;
            let outs = match deed {
                Deed::Hold(who, age) => {
                    let held = desk.hold(at(now), ids[who], &r1(), at(now - age), AHEAD);
                    if held.is_ok() {
                        prop_assert!(age <= params.max_age.0 + 1e-9 && age >= -2e-3);
                        if let Some((holder, since)) = driving {
                            prop_assert!(holder == ids[who] || now - since > params.hold.0 - 1e-9);
                        }
                        driving = Some((ids[who], now));
                    }
                    Vec::new()
                }
                Deed::Release(who) => desk.release(ids[who]),
                Deed::Hide(who) => desk.hide(ids[who]),
                Deed::Leave(who) => desk.leave(at(now), ids[who]),
                Deed::Back(who) => {
                    ids[who] = desk.arrive(at(now), Some(ids[who]), (now * 1e6) as u64 * (1 << 20), "x").expect("a place");
                    Vec::new()
                }
                Deed::Wait(time) => {
                    now += time;
                    for id in ids { desk.hear(at(now), id); }
                    desk.beat(at(now))
                }
            };
            if outs.contains(&Out::Rest(r1())) {
                driving = None;
            }
            let late = desk.beat(at(now));
            if late.contains(&Out::Rest(r1())) {
                driving = None;
            }
            if let Some((_, since)) = driving {
                prop_assert!(now - since <= params.hold.0 + 1e-9, "told to rest in time");
            }
        }
    }
}
