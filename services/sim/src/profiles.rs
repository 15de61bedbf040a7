//! Continuous drives in the emulator: what Pathdriver allows at joints, the correctors make up for.

use crate::run::{Ending, run};
use crate::seat::Seat;
use crate::{COURSES, Scenario, World};
use axle_correctors::{DCorrector, GCorrector};
use axle_pathdriver::{Joints, PathdriverParams, Strategy};
use axle_schema::{Metres, MetresPerSecond};

fn manners() -> Vec<PathdriverParams> {
    let continuous = PathdriverParams { strategy: Strategy::Continuous, ..PathdriverParams::default() };
    vec![
        continuous.clone(),
        PathdriverParams { jump: MetresPerSecond(0.15), ..continuous.clone() },
        PathdriverParams { joints: Joints::Blend, ..continuous.clone() },
        PathdriverParams { joints: Joints::Blend, offset: Metres(0.003), ..continuous },
    ]
}

/// Distance of a point from the path of a brief.
fn aside(brief: &crate::Brief, (x, y): (f64, f64)) -> f64 {
    let mut nearest = f64::INFINITY;
    let mut pose = brief.plan.start;
    for leg in &brief.plan.legs {
        let parts = (leg.geometry.length().0 / 0.005).ceil().max(1.0);
        let span = axle_traffic::cut(&[*leg], leg.geometry.length() / parts).expect("few parts");
        for part in span {
            pose = part.geometry.end_from(pose);
            nearest = nearest.min((pose.x.0 - x).hypot(pose.y.0 - y));
        }
    }
    nearest.min((brief.plan.start.x.0 - x).hypot(brief.plan.start.y.0 - y))
}

#[test]
fn continuous_drives_are_driven_within_five_centimetres() {
    let seats = [Seat::of::<DCorrector>("d-corrector", &[]), Seat::of::<GCorrector>("g-corrector", &[])];
    let worlds = [World::clean(5), Scenario::find("motors").expect("a scenario").world(5)];
    for params in manners() {
        for course in COURSES {
            let brief = course.brief_with(5, &params).expect(course.name);
            for (seat, world) in seats.iter().flat_map(|seat| worlds.iter().map(move |world| (seat, world))) {
                let run = run(seat, &brief, world).expect("a run");
                let what = format!("{} on {}, {params:?}", seat.name, course.name);
                assert_eq!(run.ending, Ending::Done, "{what}");
                let goal = brief.goal();
                let end = run.path.last().expect("it was somewhere");
                let left = (end.0 - goal.x.0).hypot(end.1 - goal.y.0);
                assert!(left < 0.05, "{what}: ends {left} m away");
                let farthest = run.path.iter().map(|&at| aside(&brief, at)).fold(0.0, f64::max);
                assert!(farthest < 0.05, "{what}: {farthest} m beside the path");
            }
        }
    }
}

#[test]
fn a_continuous_drive_is_faster_where_there_are_joints() {
    let seat = Seat::of::<DCorrector>("d-corrector", &[]);
    let time = |params: &PathdriverParams| {
        let brief = crate::Course::find("slalom").expect("a course").brief_with(1, params).expect("a plan");
        run(&seat, &brief, &World::clean(1)).expect("a run").virtual_time.0
    };
    let stop = time(&PathdriverParams::default());
    for params in manners() {
        let fast = time(&params);
        assert!(fast < 0.95 * stop, "{fast} s, and {stop} s with stops: {params:?}");
    }
}
