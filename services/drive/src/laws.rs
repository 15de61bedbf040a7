//! Laws: what holds whatever is asked, in whatever order.

use crate::rig::{Rig, distance, enable, holding, power, rotate, speed, stop};
use crate::{Out, Request};
use axle_schema::Seconds;
use axle_schema::differential_drive::DriveStage;
use proptest::prelude::*;
use std::collections::BTreeMap;

/// A request, or the end of the stop that is in force.
#[derive(Clone, Debug)]
enum Act {
    Ask(Request),
    EnableAgain,
}

fn act() -> impl Strategy<Value = Act> {
    let share = || prop_oneof![-1.0..=1.0, Just(0.0)];
    prop_oneof![
        4 => (share(), share()).prop_map(|(l, r)| power(l, r)),
        2 => (share(), share(), 0.05..1.0).prop_map(|(l, r, hold)| holding(l, r, hold)),
        2 => (-1.2..1.2, -1.2..1.2).prop_map(|(l, r)| speed(l, r)),
        4 => (0.0..0.5, share()).prop_map(|(d, p)| distance(d, p)),
        4 => (-90.0..90.0, share()).prop_map(|(d, p)| rotate(d, p)),
        1 => Just(stop()),
        1 => Just(enable(false, None)),
        1 => Just(enable(true, None)),
        1 => Just(Request::Reset),
        1 => Just(Request::Get),
    ]
    .prop_map(Act::Ask)
    .boxed()
    .prop_union(Just(Act::EnableAgain).boxed())
}

/// Operations overlap never, and end exactly once after they have started.
fn stages_are_in_order(rig: &Rig) -> Result<(), TestCaseError> {
    let mut running = None;
    let mut over = BTreeMap::new();
    for (id, stage, _) in rig.stages() {
        match stage {
            DriveStage::Started => {
                prop_assert_eq!(running, None, "two operations");
                prop_assert!(!over.contains_key(&id), "started twice");
                running = Some(id);
            }
            DriveStage::Completed | DriveStage::Canceled => {
                prop_assert_eq!(running, Some(id), "an end without a start");
                running = None;
                prop_assert!(over.insert(id, stage).is_none(), "it ended twice");
            }
            DriveStage::InitialRequest => prop_assert!(false, "no notification is a request"),
        }
    }
    prop_assert_eq!(running, None, "everything ends");
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn whatever_is_asked_one_operation_runs_at_a_time_and_all_ends_at_rest(
        acts in prop::collection::vec((act(), 0.0..0.8), 1..25),
        seed in 1_u64..5,
    ) {
        let mut rig = Rig::new(seed);
        let mut tickets = Vec::new();
        // From when to when the drive was stopped, by its own words.
        let mut stopped: Option<Seconds> = None;
        for (act, pause) in acts {
            let request = match act {
                Act::Ask(request) => request,
                Act::EnableAgain => enable(true, rig.gate.state(rig.now()).stop),
            };
            if matches!(&request, Request::Stop(_)) || request == enable(false, None) {
                stopped = stopped.or(Some(rig.now()));
            }
            let before = rig.said.len();
            tickets.push(rig.ask(request));
            rig.run(pause);
            if let Some(since) = stopped {
                let enabled = rig.gate.state(rig.now()).enabled;
                let commanded = rig.said[before..].iter().any(|(_, out)| matches!(out, Out::Command(_)));
                prop_assert!(enabled || !commanded, "stopped at {}, and still commanding", since);
                if enabled {
                    stopped = None;
                }
            }
        }
        // The longest operation, the longest hold, and the time to come to rest.
        rig.run(1.0);
        rig.run_until("rest", |rig| rig.is_at_rest() && rig.has_given_back());
        stages_are_in_order(&rig)?;
        for ticket in tickets {
            let answers = rig.said.iter().filter(|(_, out)| matches!(out, Out::Answer(of, _) if *of == ticket));
            prop_assert_eq!(answers.count(), 1, "every request is answered once");
        }
        for (_, command) in rig.commands() {
            let change = command.dwm.accelerations();
            prop_assert!(change.left.abs().0 <= 2.0 + 1e-9 && change.right.abs().0 <= 2.0 + 1e-9);
            prop_assert!(command.dwm.peak_speed().0 <= 1.0 + 1e-9);
        }
        for pair in rig.commands().windows(2).filter(|pair| pair[0].1.epoch == pair[1].1.epoch) {
            prop_assert_eq!(pair[0].1.dwm.end(), pair[1].1.dwm.start(), "no jump, whatever comes after whatever");
        }
        let rejected = rig.gate.state(rig.now()).rejected;
        prop_assert!(rejected.keys().all(|why| matches!(why, axle_schema::command::Reject::Fenced
            | axle_schema::command::Reject::Disabled)), "the gate obeys what the drive says: {:?}", rejected);
    }
}
