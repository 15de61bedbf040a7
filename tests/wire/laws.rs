//! What holds for all bytes and all values.

use super::{examples, golden::Golden};
use axle_schema::command::{Class, Command, LeaseAsk};
use axle_schema::meta::{Cause, Meta};
use axle_schema::way::MAX_POINTS;
use axle_schema::window::{MAX_WINDOW, Window};
use axle_schema::{
    Boot, Drive, DriveAsk, Dwm, EncodersData, Fix, Geometry, HeadingFix, InertialData, Leg, Message, Metres,
    MetresPerSecond, MetresPerSecondSquared, NavigatorData, Numbers, Plan, PlanAsk, Pose, Radians,
    RadiansPerSecond, Range, Refusal, Seconds, Sides, Task, TaskId, Tick, Twist, WayPoint, WayTask, decode,
    encode,
};
use proptest::prelude::*;
use std::fmt::Debug;
use std::sync::LazyLock;

/// Name, bytes and decoder of every golden file; a `Golden` itself cannot be shared between threads.
static GOLDENS: LazyLock<Vec<(String, Vec<u8>, super::golden::Again)>> = LazyLock::new(|| {
    examples::all().into_iter().map(|Golden { stem, bytes, again, .. }| (stem, bytes, again)).collect()
});

fn comes_back<M: Message + PartialEq + Debug>(message: &M) -> Result<(), TestCaseError> {
    let bytes = encode(message).map_err(|why| TestCaseError::fail(why.to_string()))?;
    prop_assert_eq!(&decode::<M>(&bytes).map_err(|why| TestCaseError::fail(why.to_string()))?, message);
    Ok(())
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>().prop_filter("finite", |x| x.is_finite()),
        -10.0..10.0,
        Just(0.0),
        Just(-0.0),
        Just(1.0)
    ]
}

/// A number that a measurement may have: no robot goes farther, or runs for longer.
fn measured() -> impl Strategy<Value = f64> {
    prop_oneof![-1e9..=1e9, -10.0..10.0, Just(0.0), Just(-0.0), Just(1.0), Just(1e9), Just(f64::MIN_POSITIVE)]
}

fn speeds() -> impl Strategy<Value = Sides<MetresPerSecond>> {
    (-20.0..=20.0, -20.0..=20.0).prop_map(|(l, r)| Sides::new(MetresPerSecond(l), MetresPerSecond(r)))
}

fn dwm() -> impl Strategy<Value = Dwm> {
    (speeds(), speeds(), 1e-6..3600.0)
        .prop_map(|(start, end, duration)| Dwm::new(start, end, Seconds(duration)).expect("finite"))
}

fn leg() -> impl Strategy<Value = Leg> {
    let far = -1e6..1e6;
    let geometry = prop_oneof![
        far.clone().prop_map(|length| Geometry::Line { length: Metres(length) }),
        far.clone().prop_map(|angle| Geometry::Turn { angle: Radians(angle) }),
        (far.clone(), far).prop_map(|(r, a)| Geometry::Arc { radius: Metres(r), angle: Radians(a) }),
    ];
    let speed = proptest::option::of((1e-3..20.0).prop_map(MetresPerSecond));
    (geometry, any::<u32>(), speed).prop_map(|(geometry, point, speed)| Leg { geometry, point, speed })
}

fn pose() -> impl Strategy<Value = Pose> {
    (measured(), measured(), measured()).prop_map(|(x, y, heading)| Pose::new(x, y, heading))
}

/// Changes of bytes that keep most of them: flips, cuts, insertions and doublings.
fn mutated() -> impl Strategy<Value = (usize, Vec<u8>)> {
    let edit = (any::<prop::sample::Index>(), 0_u8..5, any::<u8>());
    (0..GOLDENS.len(), proptest::collection::vec(edit, 1..6)).prop_map(|(which, edits)| {
        let mut bytes = GOLDENS[which].1.clone();
        for (index, kind, byte) in edits {
            if bytes.is_empty() {
                break;
            }
            let at = index.index(bytes.len());
            match kind {
                0 => bytes[at] ^= 1 << (byte % 8),
                1 => bytes[at] = byte,
                2 => bytes.insert(at, byte),
                3 => drop(bytes.remove(at)),
                _ => {
                    let piece: Vec<u8> = bytes[at..].iter().copied().take(usize::from(byte % 16)).collect();
                    bytes.splice(at..at, piece);
                }
            }
        }
        (which, bytes)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn any_bytes_are_answered(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        for (_, _, again) in GOLDENS.iter() {
            again(&bytes).ok();
        }
    }

    #[test]
    fn changed_bytes_are_answered(change in mutated()) {
        let (which, bytes) = change;
        let (_, _, again) = &GOLDENS[which];
        if let Err(refusal) = again(&bytes) {
            prop_assert!(!refusal.to_string().contains(char::is_control), "{:?}", refusal);
        }
    }

    #[test]
    fn bytes_of_one_message_are_answered_by_every_other(which in 0..GOLDENS.len()) {
        for (_, _, again) in GOLDENS.iter() {
            again(&GOLDENS[which].1).ok();
        }
    }
}

proptest! {
    #[test]
    fn measurements_come_back(
        (stamp, left, right) in (measured(), measured(), measured()),
        pose in pose(),
        twist in proptest::option::of((number(), number())),
        covariance in proptest::option::of(proptest::array::uniform9(0.0..f64::MAX)),
    ) {
        comes_back(&EncodersData { stamp: Seconds(stamp), left: Metres(left), right: Metres(right) })?;
        let twist = twist.map(|(v, omega)| Twist { v: MetresPerSecond(v), omega: RadiansPerSecond(omega) });
        comes_back(&NavigatorData { stamp: Seconds(stamp), pose, twist, covariance: covariance.map(Numbers) })?;
    }

    #[test]
    fn commands_come_back(
        (boot, epoch, seq, echo, ttl_ms) in any::<(u64, u32, u32, u32, u16)>(),
        dwm in dwm(),
        holder in ".{0,24}",
        period in 1e-3..1.0,
        (stamp, cause) in (number(), proptest::option::of(any::<(u64, u64)>())),
    ) {
        comes_back(&Command { boot: Boot(boot), epoch, seq, echo: Tick(echo), ttl_ms, dwm })?;
        comes_back(&LeaseAsk { holder, class: Class::Manual, period: Seconds(period) })?;
        let cause = cause.map(|(source, seq)| Cause { source: Boot(source), seq });
        comes_back(&Meta { seq: boot, source: Boot(boot), stamp, cause })?;
    }

    #[test]
    fn plans_come_back(
        legs in proptest::collection::vec(leg(), 0..40),
        dwms in proptest::collection::vec(dwm(), 0..40),
        start in pose(),
        notes in proptest::collection::vec(".{0,40}", 0..16),
        id in any::<u64>(),
        speeds in proptest::option::of(speeds()),
    ) {
        let plan = Plan { start, legs: legs.clone(), length: Metres(start.x.0), notes, ..Plan::default() };
        comes_back(&plan)?;
        comes_back(&Task { id: TaskId(id), plan })?;
        comes_back(&DriveAsk { legs, speeds, robot: None, manner: None })?;
        let (jump, duration) = (MetresPerSecond(0.0), Seconds(1.0));
        comes_back(&Drive { dwms, counts: vec![3, 2, 1], jump, offset: None, duration })?;
    }
}

/// A number that takes all nine bytes.
const LONG: f64 = 0.1;

fn fits<M: Message + PartialEq + Debug>(message: &M) {
    let bytes = encode(message).unwrap_or_else(|why: Refusal| panic!("{}: {why}", M::NAME));
    assert!(decode::<M>(&bytes).as_ref() == Ok(message), "{} comes back", M::NAME);
}

#[test]
fn the_longest_lists_fit_into_their_messages() {
    let (heading, speed) = (Some(Radians(LONG)), Some(MetresPerSecond(LONG)));
    let way = WayTask { points: vec![WayPoint { heading, speed, ..WayPoint::at(LONG, LONG) }; MAX_POINTS] };
    fits(&way);
    fits(&PlanAsk { way: way.clone(), start: Some(Pose::new(LONG, LONG, LONG)), ..PlanAsk::default() });
    fits(&axle_schema::task::GoAsk {
        way: way.clone(),
        corrector: Some("x".repeat(64)),
        confirm: Vec::new(),
    });
    fits(&Task { id: TaskId(u64::MAX), plan: way });
    let geometry = Geometry::Arc { radius: Metres(LONG), angle: Radians(LONG) };
    let legs = vec![Leg { geometry, point: u32::MAX, speed }; axle_schema::plan::MAX_LEGS];
    let notes = vec!["n".repeat(400); axle_schema::plan::MAX_NOTES];
    let plan = Plan {
        start: Pose::new(LONG, LONG, LONG),
        legs: legs.clone(),
        length: Metres(LONG),
        notes,
        ..Plan::default()
    };
    fits(&plan);
    fits(&Task { id: TaskId(u64::MAX), plan });
    fits(&DriveAsk { legs, speeds: None, robot: Some(axle_schema::Drivetrain::default()), manner: None });
    let speeds = Sides::new(MetresPerSecond(LONG), MetresPerSecond(LONG));
    let dwms = vec![Dwm::steady(speeds, Seconds(LONG)).expect("finite"); axle_schema::plan::MAX_DWMS];
    let counts = vec![u32::MAX; axle_schema::plan::MAX_LEGS];
    let drive = Drive {
        dwms,
        counts,
        jump: MetresPerSecond(LONG),
        offset: Some(Metres(LONG)),
        duration: Seconds(LONG),
    };
    fits(&drive);
    fits(&Task { id: TaskId(u64::MAX), plan: drive });
}

#[test]
fn the_fullest_window_fits() {
    let acceleration = Some(MetresPerSecondSquared(LONG));
    let heading = Some(HeadingFix { angle: Radians(LONG), variance: LONG });
    let (stamp, x, y) = (Seconds(LONG), Metres(LONG), Metres(LONG));
    fits(&Window {
        boot: Boot(u64::MAX),
        encoders: vec![EncodersData { stamp, left: x, right: y }; MAX_WINDOW],
        inertial: vec![
            InertialData {
                stamp,
                gyro: RadiansPerSecond(LONG),
                ax: acceleration,
                ay: acceleration
            };
            MAX_WINDOW
        ],
        fixes: vec![Fix { stamp, x, y, covariance: Numbers([LONG; 4]), heading }; MAX_WINDOW],
        ranges: vec![Range { stamp, x, y, distance: x, sd: x }; MAX_WINDOW],
        dropped: u64::MAX,
        position: Some(examples::position()),
    });
}
