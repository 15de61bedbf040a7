//! Laws of every corrector under measurements that no robot makes: never a wild command, and never a panic.

use super::plant::{arc, drive, line, plan, turn};
use axle_correctors::g::Feedback;
use axle_correctors::w::{Driver, Field};
use axle_correctors::{
    ArcCorrector, ArcParams, DCorrector, DParams, GCorrector, GParams, LtvCorrector, LtvParams,
    PursuitCorrector, PursuitParams, WCorrector, WParams,
};
use axle_schema::contract::{Corrector, Params, Seen, Step};
use axle_schema::{
    Drivetrain, Dwm, EncodersData, InertialData, Metres, MetresPerSecond, NavigatorData, Plan, Pose,
    RadiansPerSecond, Refusal, Seconds, Sides, Task, TaskId,
};
use proptest::prelude::*;

/// What is seen at one beat: how much later than at the last one, and what is measured then.
#[derive(Clone, Copy, Debug)]
struct Beat {
    later: f64,
    stamp: f64,
    numbers: [f64; 6],
}

/// A number that a robot measures, and now and then one that none does.
fn number(usual: f64) -> impl Strategy<Value = f64> {
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e9, 1e-300, f64::MAX];
    prop_oneof![20 => -usual..usual, 1 => proptest::sample::select(odd.to_vec())]
}
fn beats() -> impl Strategy<Value = Vec<Beat>> {
    let beat = (number(0.1), number(0.1), prop::array::uniform6(number(0.05)));
    let beat = beat.prop_map(|(later, stamp, numbers)| Beat { later, stamp, numbers });
    proptest::collection::vec(beat, 1..60)
}

fn seen(at: f64, stamp: f64, numbers: [f64; 6]) -> Seen {
    let [left, right, gyro, x, y, heading] = numbers;
    let stamp = Seconds(stamp);
    Seen {
        at: Seconds(at),
        encoders: Some(EncodersData { stamp, left: Metres(left), right: Metres(right) }),
        inertial: Some(InertialData { stamp, gyro: RadiansPerSecond(gyro), ..InertialData::default() }),
        pose: Some(NavigatorData { stamp, pose: Pose::new(x, y, heading), ..NavigatorData::default() }),
    }
}

fn begin<C: Corrector>(params: &C::Params, plan: C::Plan, seen: &Seen) -> Result<C, Refusal> {
    C::begin(params, Seconds(0.05), Task { id: TaskId(1), plan }, seen)
}

/// Every command of a corrector with these parameters is bounded.
fn obeys<C: Corrector>(params: &C::Params, plan: C::Plan, beats: &[Beat]) {
    let corrector: C = begin(params, plan, &seen(0.0, 0.0, [0.0; 6])).expect("a plan that can be followed");
    is_bounded(corrector, beats);
}

/// Every command goes on from the last one, is finite and within the limits, until the task is over.
fn is_bounded<C: Corrector>(mut corrector: C, beats: &[Beat]) {
    let robot = Drivetrain::default();
    let mut last = Sides::<MetresPerSecond>::default();
    let (mut at, mut sums) = (0.0, [0.0; 6]);
    for (index, beat) in beats.iter().enumerate() {
        // A broken number is measured once; what is measured next goes on from before it.
        let numbers = std::array::from_fn(|n| sums[n] + beat.numbers[n]);
        let keep = |sum: f64, next: f64| if (next - sum).abs() < 1.0 { next } else { sum };
        sums = std::array::from_fn(|n| keep(sums[n], numbers[n]));
        at += if beat.later.is_finite() { beat.later.abs().min(0.1) } else { 0.05 };
        let time = if index % 7 == 6 { beat.later } else { at };
        let measured = seen(time, at + beat.stamp, numbers);
        let step = corrector.step(&measured);
        let account = corrector.account();
        assert!((0.0..=1.0).contains(&account.fraction), "{account:?}");
        let Step::Drive(dwm) = step else { return };
        let peak = dwm.peak_speed().0;
        assert!(dwm.start() == last && peak <= robot.wheel_speed.0, "{dwm:?} after {last:?}");
        for a in dwm.accelerations().both() {
            assert!(a.0.abs() <= robot.wheel_acceleration.0 * (1.0 + 1e-9), "{dwm:?}");
        }
        last = dwm.end();
    }
}

proptest! {
    // `PROPTEST_CASES=20000` looks longer; 256 are the default.
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_measurement_leads_to_a_wild_command(beats in beats()) {
        let path = plan(&[turn(0.5), line(1.0), arc(0.5, 1.5), line(-0.2)]);
        obeys::<DCorrector>(&DParams::default(), drive(&path), &beats);
        obeys::<LtvCorrector>(&LtvParams::default(), drive(&path), &beats);
        for feedback in [Feedback::Encoders, Feedback::Gyro] {
            obeys::<GCorrector>(&GParams { feedback, ..GParams::default() }, path.clone(), &beats);
        }
        for (field, driver) in [(Field::Path, Driver::Smooth), (Field::Points, Driver::Multiplicative)] {
            obeys::<WCorrector>(&WParams { field, driver, ..WParams::default() }, path.clone(), &beats);
        }
        obeys::<ArcCorrector>(&ArcParams::default(), path.clone(), &beats);
        obeys::<PursuitCorrector>(&PursuitParams::default(), path, &beats);
    }
}

/// What becomes of the numbers of some parameters: most are left or scaled, a few are what no gain should be.
fn wild() -> impl Strategy<Value = Vec<Option<Wild>>> {
    let odd = [0.0, -1.0, -1e-12, 1e-300, 1e9, f64::MAX, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    let change = prop_oneof![
        (-2.0..2.0).prop_map(|power: f64| Wild::Times(10_f64.powf(power))),
        proptest::sample::select(odd.to_vec()).prop_map(Wild::Is),
    ];
    proptest::collection::vec(proptest::option::weighted(0.15, change), 24)
}

#[derive(Clone, Copy, Debug)]
enum Wild {
    Times(f64),
    Is(f64),
}

/// Parameters with other numbers, but those of the robot, whose limits are what commands are judged by.
fn spoilt<P: Params>(wild: &[Option<Wild>]) -> Option<P> {
    fn spoil(table: &mut toml::Table, wild: &mut dyn Iterator<Item = Option<Wild>>) {
        for (name, value) in table.iter_mut() {
            match value {
                toml::Value::Float(number) => match wild.next().flatten() {
                    Some(Wild::Times(factor)) => *number *= factor,
                    Some(Wild::Is(odd)) => *number = odd,
                    None => {}
                },
                toml::Value::Table(inner) if name != "robot" => spoil(inner, wild),
                _ => {}
            }
        }
    }
    let mut table = toml::Table::try_from(P::default()).expect("parameters are a table");
    spoil(&mut table, &mut wild.iter().copied().cycle());
    table.try_into().ok()
}

/// Wild parameters are refused, or lead to commands that are bounded all the same; says whether they were refused.
fn bears<C: Corrector>(wild: &[Option<Wild>], plan: C::Plan, beats: &[Beat]) -> bool {
    let Some(params) = spoilt::<C::Params>(wild) else { return true };
    let begun: Result<C, Refusal> = begin(&params, plan, &seen(0.0, 0.0, [0.0; 6]));
    let Ok(corrector) = begun else { return true };
    is_bounded(corrector, beats);
    false
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn wild_parameters_are_refused_or_lead_to_no_wild_command(wild in wild(), beats in beats()) {
        let path = plan(&[turn(0.5), line(1.0), arc(0.5, 1.5), line(-0.2)]);
        let refused = [
            bears::<DCorrector>(&wild, drive(&path), &beats),
            bears::<LtvCorrector>(&wild, drive(&path), &beats),
            bears::<GCorrector>(&wild, path.clone(), &beats),
            bears::<WCorrector>(&wild, path.clone(), &beats),
            bears::<ArcCorrector>(&wild, path.clone(), &beats),
            bears::<PursuitCorrector>(&wild, path, &beats),
        ];
        // What is no number or below nothing is no value of any parameter.
        if wild.iter().take(8).flatten().any(|wild| matches!(wild, Wild::Is(odd) if odd.is_nan() || *odd <= -1.0)) {
            prop_assert_eq!(refused, [true; 6]);
        }
    }
}

/// What `begin` and the first beats say of a corrector that follows geometries.
fn follows_plans<C: Corrector<Plan = Plan>>(params: &C::Params) {
    let here = seen(0.0, 0.0, [0.0; 6]);
    let mut empty: C = begin(params, Plan::default(), &here).expect("nothing to drive is no fault");
    assert_eq!(empty.step(&seen(0.05, 0.05, [0.0; 6])), Step::Done);
    let elsewhere = Plan { start: Pose::new(0.6, 0.0, 0.0), ..plan(&[line(1.0)]) };
    let words = begin::<C>(params, elsewhere, &here).err().expect("0.6 m away").to_string();
    assert!(words.contains("from the start of its plan") && words.contains("0.6"), "{words}");
    let broken = begin::<C>(params, plan(&[line(f64::NAN)]), &here);
    assert!(broken.is_err(), "a line without a length");
    let blind = begin::<C>(params, plan(&[line(1.0)]), &Seen::default()).err().expect("nothing is seen");
    assert!(blind.to_string().contains("unavailable"), "{blind}");
    let nan = seen(0.0, 0.0, [f64::NAN; 6]);
    assert!(begin::<C>(params, plan(&[line(1.0)]), &nan).is_err(), "what is seen is no number");
}

#[test]
fn empty_plans_are_done_and_plans_from_elsewhere_or_without_sight_are_refused() {
    follows_plans::<GCorrector>(&GParams::default());
    follows_plans::<WCorrector>(&WParams::default());
    follows_plans::<ArcCorrector>(&ArcParams::default());
    follows_plans::<PursuitCorrector>(&PursuitParams::default());
    let here = seen(0.0, 0.0, [0.0; 6]);
    let mut empty: LtvCorrector =
        begin(&LtvParams::default(), axle_schema::Drive::default(), &here).expect("nothing to drive");
    assert_eq!(empty.step(&seen(0.05, 0.05, [0.0; 6])), Step::Done);
}

/// Drives for a second, and says why the corrector failed when it then sees what `wrong` makes of the measurements.
fn fails<C: Corrector>(params: &C::Params, plan: C::Plan, wrong: impl Fn(i32, &mut Seen)) -> String {
    let mut corrector: C = begin(params, plan, &seen(0.0, 0.0, [0.0; 6])).expect("a plan");
    let mut covered = Sides::new(0.0, 0.0);
    let mut told = Dwm::rest(Seconds(0.05));
    for beat in 1..60 {
        covered = covered.zip(told.encoders_span().sides(), |sum, more| sum + more.0);
        let at = f64::from(beat) * 0.05;
        let x = f64::midpoint(covered.left, covered.right);
        let mut measured = seen(at, at, [covered.left, covered.right, 0.0, x, 0.0, 0.0]);
        if beat > 20 {
            wrong(beat, &mut measured);
        }
        match corrector.step(&measured) {
            Step::Drive(dwm) => told = dwm,
            Step::Done => panic!("the goal is 3 m away"),
            Step::Fail(refusal) => return refusal.to_string(),
        }
    }
    panic!("it drives on");
}

/// The words with which each fault of the measurements must end a task.
fn fails_with_reasons<C: Corrector>(params: &C::Params, plan: &C::Plan)
where
    C::Plan: Clone,
{
    let check = |words: &[&str], wrong: &dyn Fn(i32, &mut Seen)| {
        let why = fails::<C>(params, plan.clone(), wrong);
        assert!(words.iter().any(|word| why.contains(word)), "{why:?} says nothing of {words:?}");
    };
    let stamps = |seen: &mut Seen, change: &dyn Fn(f64) -> f64| {
        if let (Some(encoders), Some(pose)) = (&mut seen.encoders, &mut seen.pose) {
            encoders.stamp = Seconds(change(encoders.stamp.0));
            pose.stamp = Seconds(change(pose.stamp.0));
        }
    };
    check(&["no measurement for", "silent"], &|_, seen| stamps(seen, &|_| 1.0));
    check(&["its clock went back"], &|_, seen| stamps(seen, &|stamp| stamp - 5.0));
    check(&["silent", "not follow"], &|_, seen| stamps(seen, &|_| f64::NAN));
    check(&["jumped", "not follow"], &|beat, seen| {
        if let (Some(encoders), Some(pose)) = (&mut seen.encoders, &mut seen.pose) {
            encoders.left.0 += f64::from(beat);
            pose.pose.x.0 += f64::from(beat);
        }
    });
    check(&["jumped", "not follow"], &|_, seen| {
        if let (Some(encoders), Some(pose)) = (&mut seen.encoders, &mut seen.pose) {
            encoders.right.0 = f64::NAN;
            pose.pose.heading.0 = f64::NAN;
        }
    });
}

#[test]
fn measurements_that_stop_go_back_jump_or_are_no_numbers_end_the_task_with_the_reason() {
    let path = plan(&[line(3.0)]);
    fails_with_reasons::<DCorrector>(&DParams::default(), &drive(&path));
    fails_with_reasons::<LtvCorrector>(&LtvParams::default(), &drive(&path));
    fails_with_reasons::<GCorrector>(&GParams::default(), &path);
    fails_with_reasons::<WCorrector>(&WParams::default(), &path);
    fails_with_reasons::<ArcCorrector>(&ArcParams::default(), &path);
    fails_with_reasons::<PursuitCorrector>(&PursuitParams::default(), &path);
}
