//! Every corrector on every course.

use super::plant::{Course, IDEAL, Plant, REAL, courses, drive, obeys_limits, run};
use axle_correctors::w::{Driver, Field};
use axle_correctors::{
    ArcCorrector, ArcParams, DCorrector, DParams, LtvCorrector, LtvParams, PursuitCorrector, PursuitParams,
    WCorrector, WParams,
};
use axle_schema::contract::Corrector;
use axle_schema::{Plan, Seconds};

/// A corrector with its parameters, whatever kind of plan it takes.
struct Runner {
    name: &'static str,
    period: Seconds,
    drive: Box<dyn Fn(Plant, &Plan) -> Course>,
    /// How far from its goal it may end with an ideal robot and with a real one, m; and how far astray on the way, m.
    ends: (f64, f64),
    astray: f64,
}

fn on_plans<C: Corrector<Plan = Plan>>(
    name: &'static str,
    params: C::Params,
    ends: (f64, f64),
    astray: f64,
) -> Runner {
    let period = C::period(&params);
    let drive = Box::new(move |plant, path: &Plan| run::<C>(&params, plant, path, path));
    Runner { name, period, drive, ends, astray }
}
fn on_drives<C: Corrector<Plan = axle_schema::Drive>>(
    name: &'static str,
    params: C::Params,
    ends: (f64, f64),
    astray: f64,
) -> Runner {
    let period = C::period(&params);
    let drive = Box::new(move |plant, path: &Plan| run::<C>(&params, plant, path, &drive(path)));
    Runner { name, period, drive, ends, astray }
}

fn runners() -> Vec<Runner> {
    let w = |field, driver| WParams { field, driver, ..WParams::default() };
    vec![
        on_plans::<WCorrector>("w path smooth", w(Field::Path, Driver::Smooth), (0.006, 0.015), 0.05),
        on_plans::<WCorrector>(
            "w path multiplicative",
            w(Field::Path, Driver::Multiplicative),
            (0.03, 0.03),
            0.1,
        ),
        on_plans::<WCorrector>("w points smooth", w(Field::Points, Driver::Smooth), (0.02, 0.02), 0.2),
        on_plans::<WCorrector>(
            "w points multiplicative",
            w(Field::Points, Driver::Multiplicative),
            (0.02, 0.02),
            0.2,
        ),
        on_plans::<ArcCorrector>("arc-corrector", ArcParams::default(), (0.01, 0.02), 0.2),
        on_drives::<LtvCorrector>("ltv-corrector", LtvParams::default(), (0.01, 0.02), 0.05),
        on_drives::<DCorrector>("d-corrector", DParams::default(), (0.01, 0.1), 0.1),
        on_plans::<PursuitCorrector>("pursuit-corrector", PursuitParams::default(), (0.006, 0.015), 0.05),
    ]
}

#[test]
fn every_corrector_reaches_the_goal_of_every_course() {
    let mut faults = String::new();
    for runner in runners() {
        for (name, path) in courses() {
            for (robot, plant, end) in [("ideal", IDEAL, runner.ends.0), ("real", REAL, runner.ends.1)] {
                let course = (runner.drive)(plant, &path);
                let what = format!(
                    "{} on {name}, {robot}: {:?}, {:.1} mm and {:.3} rad off, {:.1} mm astray, {} reversals, {:.2} s\n",
                    runner.name,
                    course.result,
                    course.missed_by() * 1e3,
                    course.miss.heading.0,
                    course.astray * 1e3,
                    course.reversals,
                    course.time
                );

                let reached = course.result.is_ok() && course.missed_by() <= end && course.reversals <= 1;
                if !(reached && course.astray <= runner.astray) {
                    faults += &what;
                }
                obeys_limits(&course, runner.period);
            }
        }
    }
    assert!(faults.is_empty(), "{faults}");
}
