//! Courses in virtual time: the contract, clause by clause, through a gate and an emulated robot.

use crate::rig::{Rig, distance, enable, holding, power, rotate, speed, stop};
use crate::{Out, Reply, Request};
use axle_correctors::{DCorrector, DParams};
use axle_schema::command::{BrakeCause, Class, Motion};
use axle_schema::differential_drive::{DriveOperation, DriveStage, DriveState};
use axle_schema::{Metres, Refusal, Seconds, StopId};

fn state(rig: &mut Rig) -> DriveState {
    match rig.asked(Request::Get) {
        Ok(Reply::State(state)) => *state,
        other => panic!("no state: {other:?}"),
    }
}

#[test]
fn a_distance_ends_within_a_centimetre_by_the_truth() {
    for seed in 1..=4 {
        for (way, share) in [(1.5, 0.4), (1.0, 1.0), (0.5, -0.5), (0.05, 0.3), (0.003, 0.2)] {
            let mut rig = Rig::new(seed);
            let from = rig.truth().pose;
            assert_eq!(rig.ends(distance(way, share)), (DriveStage::Completed, None));
            rig.run_until("rest", Rig::is_at_rest);
            let moved = from.distance(rig.truth().pose).0;
            assert!((moved - way).abs() < 0.01, "{way} m at {share} with seed {seed}: {moved}");
            assert_eq!(rig.truth().pose.x.0 > 0.0, share > 0.0, "the sign of the power is the direction");
            rig.run_until("the wheels are given back", Rig::has_given_back);
        }
    }
}

#[test]
fn a_turn_ends_within_a_degree_by_the_truth() {
    for seed in 1..=4 {
        for (degrees, share) in
            [(90.0, 0.3), (-90.0, 0.3), (180.0, -0.5), (-45.0, 0.1), (720.0, 1.0), (2.0, 0.2)]
        {
            let mut rig = Rig::new(seed);
            assert_eq!(rig.ends(rotate(degrees, share)), (DriveStage::Completed, None));
            rig.run_until("rest", Rig::is_at_rest);
            let turned = rig.truth().pose.heading.0.to_degrees();
            assert!((turned - degrees).abs() < 1.0, "{degrees}° at {share} with seed {seed}: {turned}");
        }
    }
}

#[test]
fn nothing_to_do_is_completed_at_once_without_the_wheels() {
    let mut rig = Rig::new(1);
    for request in [distance(0.0, 0.0), rotate(0.0, 0.7)] {
        let id = rig.ask(request);
        assert!(matches!(rig.answer(id), Some(Ok(Reply::Begun(_)))));
    }
    let stages: Vec<_> = rig.stages().into_iter().map(|(_, stage, _)| stage).collect();
    let once = [DriveStage::Started, DriveStage::Completed];
    assert_eq!(stages, [once, once].concat());
    assert!(!rig.said.iter().any(|(_, out)| matches!(out, Out::AskLease(_))));
}

#[test]
fn any_motion_request_cancels_the_running_operation_before_it_starts_itself() {
    for request in [power(0.2, 0.2), power(0.0, 0.0), speed(0.1, 0.1), distance(0.1, 0.3), rotate(10.0, 0.3)]
    {
        let mut rig = Rig::new(1);
        let id = rig.begins(distance(2.0, 0.5));
        rig.run(1.0);
        assert!(rig.asked(request.clone()).is_ok());
        assert_eq!(rig.end_of(id), Some((DriveStage::Canceled, None)), "{request:?}");
        let stages = rig.stages();
        assert_eq!((stages[0].1, stages[1].1), (DriveStage::Started, DriveStage::Canceled));
        rig.run(8.0);
        assert!(rig.is_at_rest() && rig.has_given_back(), "{request:?}");
        assert!(
            rig.stages().iter().skip(2).all(|(_, stage, _)| *stage != DriveStage::Canceled),
            "{request:?}"
        );
    }
}

#[test]
fn a_request_that_is_refused_cancels_nothing() {
    let mut rig = Rig::new(1);
    let id = rig.begins(distance(0.6, 0.5));
    rig.run(0.5);
    for (request, words) in
        [(distance(1.0, 0.0), "power"), (rotate(90.0, 0.0), "power"), (speed(1.5, 0.0), "left")]
    {
        let refusal = rig.asked(request).expect_err(words).to_string();
        assert!(refusal.contains(words), "{refusal}");
    }
    rig.run_until("the end", |rig| rig.end_of(id).is_some());
    assert_eq!(rig.end_of(id), Some((DriveStage::Completed, None)));
}

#[test]
fn powers_supersede_each_other_within_the_acceleration_limit() {
    let mut rig = Rig::new(1);
    assert_eq!(rig.asked(power(0.5, 0.25)), Ok(Reply::Done));
    rig.run(0.8);
    let driving = state(&mut rig);
    assert_eq!((driving.operation, driving.motion), (DriveOperation::Power, Motion::Driving));
    assert!(
        (driving.wheels.left.power.get() - 0.5).abs() < 1e-9
            && (driving.wheels.left.speed.0 - 0.4).abs() < 0.03
    );
    assert_eq!(rig.asked(power(-0.5, -0.25)), Ok(Reply::Done));
    rig.run(0.8);
    assert!((state(&mut rig).wheels.right.power.get() + 0.25).abs() < 1e-9);
    let commands = rig.commands();
    for pair in commands.windows(2) {
        assert_eq!(pair[0].1.dwm.end(), pair[1].1.dwm.start(), "without a jump");
        let change = pair[1].1.dwm.accelerations();
        assert!(change.left.abs().0 <= 1.5 + 1e-9 && change.right.abs().0 <= 1.5 + 1e-9, "{change:?}");
    }
}

#[test]
fn a_power_that_is_not_renewed_ends_by_braking() {
    let mut rig = Rig::new(1);
    rig.asked(holding(0.5, 0.5, 0.4)).expect("followed");
    let begun = rig.now();
    rig.run(0.35);
    assert_eq!(state(&mut rig).operation, DriveOperation::Power);
    rig.run_until("it is over", |rig| rig.is_at_rest() && rig.has_given_back());
    // 0.4 s of power, 0.4 m/s braked with 2 m/s², and two beats.
    let took = (rig.now() - begun).0;
    assert!((0.4..0.4 + 0.2 + 0.2).contains(&took), "{took} s");
    // One that is renewed goes on.
    for _ in 0..10 {
        rig.asked(holding(0.5, 0.5, 0.4)).expect("followed");
        rig.run(0.3);
        assert!(!rig.is_at_rest());
    }
}

#[test]
fn zero_stops_also_what_somebody_else_drives() {
    let mut rig = Rig::new(1);
    rig.takes("d-corrector", Class::Corrector, 0.4).expect("a lease");
    rig.run(0.3);
    assert!(!rig.is_at_rest());
    assert_eq!(rig.asked(power(0.0, 0.0)), Ok(Reply::Done));
    rig.run(0.6);
    assert!(rig.is_at_rest() && rig.has_given_back());
}

#[test]
fn a_stopped_drive_refuses_to_move_until_the_stop_is_quoted() {
    let mut rig = Rig::new(1);
    let id = rig.begins(distance(3.0, 0.8));
    rig.run(1.0);
    let Ok(Reply::Stopped(latch)) = rig.asked(stop()) else { panic!("no receipt") };
    let (stage, why) = rig.end_of(id).expect("it is over");
    assert!(stage == DriveStage::Canceled && matches!(why, Some(Refusal::Disabled { .. })), "{why:?}");
    assert_eq!(rig.gate.state(rig.now()).cause, Some(BrakeCause::AllStop));
    rig.run(1.0);
    assert!(rig.is_at_rest());
    for request in [power(0.1, 0.1), power(0.0, 0.0), speed(0.1, 0.1), distance(0.0, 0.1), rotate(9.0, 0.1)] {
        let refusal = rig.asked(request.clone()).expect_err("a fault");
        assert!(matches!(refusal, Refusal::Disabled { .. }), "{request:?}: {refusal}");
    }
    for quoted in [None, Some(StopId(1))] {
        let refusal = rig.asked(enable(true, quoted)).expect_err("the stop is not quoted").to_string();
        assert!(refusal.contains(&format!("AllStop {latch}")), "{refusal}");
    }
    assert!(!state(&mut rig).enabled && state(&mut rig).stop == Some(latch));
    assert_eq!(rig.asked(enable(true, Some(latch))), Ok(Reply::Done));
    assert!(state(&mut rig).enabled, "at once");
    assert_eq!(rig.ends(distance(0.1, 0.5)).0, DriveStage::Completed);
}

#[test]
fn a_request_that_waits_for_the_wheels_does_not_survive_a_stop() {
    let mut rig = Rig::new(1);
    let (powers, way) = (rig.ask(power(0.3, 0.3)), rig.ask(distance(1.0, 0.3)));
    assert_eq!((rig.answer(powers), rig.answer(way)), (None, None), "the gate has not answered yet");
    rig.asked(stop()).expect("acknowledged");
    for ticket in [powers, way] {
        assert!(matches!(rig.answer(ticket), Some(Err(Refusal::Disabled { .. }))));
    }
    rig.run(1.0);
    assert!(rig.commands().is_empty() && rig.stages().is_empty() && rig.has_given_back());
}

#[test]
fn an_operation_begins_from_rest() {
    let mut rig = Rig::new(1);
    rig.asked(power(0.6, 0.6)).expect("followed");
    rig.run(0.6);
    rig.begins(rotate(90.0, 0.3));
    rig.run_until("it turns", |rig| rig.truth().pose.heading.0 > 0.1);
    let from = rig.truth().pose;
    rig.run_until("the end", |rig| rig.is_at_rest());
    assert!(rig.truth().pose.distance(from).0 < 0.02, "on the spot");
    assert!((rig.truth().pose.heading.0.to_degrees() - 90.0).abs() < 1.5, "{:?}", rig.truth().pose);
}

#[test]
fn disabling_stops_at_once_and_everybody() {
    let mut rig = Rig::new(1);
    rig.asked(power(0.5, 0.5)).expect("followed");
    rig.run(0.5);
    assert_eq!(rig.asked(enable(false, None)), Ok(Reply::Done));
    assert!(rig.takes("d-corrector", Class::Corrector, 0.4).is_err(), "nobody may move");
    let latch = state(&mut rig).stop;
    assert_eq!(rig.asked(enable(true, latch)), Ok(Reply::Done));
    assert_eq!(rig.asked(enable(true, None)), Ok(Reply::Done), "enabled already");
}

#[test]
fn a_wheel_that_is_blocked_cancels_the_operation_with_the_reason() {
    let mut rig = Rig::new(1);
    rig.blocks_left = true;
    let (stage, why) = rig.ends(distance(2.0, 0.5));
    let why = why.map(|why| why.to_string()).unwrap_or_default();
    assert!(stage == DriveStage::Canceled && why.contains("left wheel does not follow"), "{why}");
    rig.run(1.0);
    assert!(rig.is_at_rest() && rig.has_given_back());
}

#[test]
fn a_robot_that_falls_silent_cancels_the_operation_with_the_reason() {
    let mut rig = Rig::new(1);
    let id = rig.begins(distance(2.0, 0.5));
    rig.run(0.5);
    rig.is_silent = true;
    rig.run(1.0);
    let (_, why) = rig.end_of(id).expect("it is over");
    assert!(why.expect("a reason").to_string().contains("no measurement for"));
    rig.run(3.0);
    let refusal = rig.asked(power(0.1, 0.1)).expect_err("nobody knows what the robot does");
    assert!(matches!(refusal, Refusal::Unavailable { .. }), "{refusal}");
}

#[test]
fn wheels_that_are_taken_away_cancel_the_operation_with_the_reason() {
    let mut rig = Rig::new(1);
    let id = rig.begins(distance(2.0, 0.5));
    rig.run(0.5);
    rig.takes("a person", Class::StopOnly, 0.0).expect("a higher class");
    rig.run(0.2);
    let (_, why) = rig.end_of(id).expect("it is over");
    assert!(why.expect("a reason").to_string().contains("a person has taken the wheels"));
    assert_eq!(rig.asked(power(0.1, 0.1)), Err(Refusal::Busy { holder: "a person".into() }), "a fault");
}

#[test]
fn a_stop_that_no_gate_acknowledges_is_repeated_and_then_said() {
    let mut rig = Rig::new(1);
    rig.is_deaf = true;
    let refusal = rig.asked(stop()).expect_err("nobody acknowledged it").to_string();
    assert!(refusal.contains("may still move"), "{refusal}");
    let stops = rig.said.iter().filter(|(_, out)| matches!(out, Out::Stop(_))).count();
    assert!(stops > 30, "{stops} in two seconds");
}

#[test]
fn a_request_at_the_start_waits_for_the_first_word_of_the_gate() {
    let rig = Rig::new(1);
    let (params, name) = (crate::DriveParams::default(), "drive".to_owned());
    let mut facade = crate::Facade::<DCorrector>::new(params, DParams::default(), name).expect("a drive");
    facade.ask(Seconds(10.0), 1, 0, Request::Get);
    facade.beat(Seconds(11.0));
    assert_eq!(facade.outs(), [], "it waits");
    facade.hear_gate(Seconds(11.1), rig.gate.state(rig.now()));
    let outs = facade.outs();
    assert!(outs.iter().any(|out| matches!(out, Out::Answer(1, Ok(Reply::State(_))))), "{outs:?}");

    let (params, name) = (crate::DriveParams::default(), "drive".to_owned());
    let mut facade = crate::Facade::<DCorrector>::new(params, DParams::default(), name).expect("a drive");
    facade.ask(Seconds(10.0), 1, 0, power(0.1, 0.1));
    facade.beat(Seconds(11.6));
    let outs = facade.outs();
    assert!(
        matches!(&outs[..], [Out::Answer(1, Err(Refusal::Unavailable { .. }))]),
        "there is none: {outs:?}"
    );
}

#[test]
fn the_encoders_count_from_their_reset() {
    let mut rig = Rig::new(1);
    rig.ends(distance(0.3, 0.5));
    assert!((state(&mut rig).wheels.left.distance.0 - 0.3).abs() < 0.005);
    assert_eq!(rig.asked(Request::Reset), Ok(Reply::Done));
    assert_eq!(state(&mut rig).wheels.map(|wheel| wheel.distance).both(), [Metres::ZERO; 2]);
    assert!(rig.emulator.encoders().left.0 > 0.29, "the robot's own ones go on");
    rig.ends(distance(0.1, -0.5));
    assert!((state(&mut rig).wheels.right.distance.0 + 0.1).abs() < 0.005);
}

#[test]
fn the_state_is_said_on_change_and_once_a_second() {
    let mut rig = Rig::new(1);
    let updates = |rig: &Rig| -> Vec<f64> {
        let is_update = |(at, out): &(_, Out)| matches!(out, Out::Update(_)).then_some(*at);
        rig.said.iter().filter_map(is_update).map(|at: Seconds| at.0).collect()
    };
    rig.run(5.0);
    let idle = updates(&rig);
    assert!(idle.len() >= 5 && idle.len() <= 7, "{idle:?}");
    rig.asked(power(0.2, 0.2)).expect("followed");
    let after = updates(&rig);
    assert!(after.len() > idle.len(), "a change is said at once");
}
