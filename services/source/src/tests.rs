//! Source, sample by sample.

use super::*;
use axle_schema::{Metres, MetresPerSecondSquared, Numbers, Pose, Radians, RadiansPerSecond};
use proptest::prelude::*;

fn source() -> Source {
    Source::new(&SourceParams::default()).expect("the defaults are within their ranges")
}
fn meta(boot: u64, seq: u64) -> Option<Meta> {
    Some(Meta { seq, source: Boot(boot), stamp: 0.0, cause: None })
}
fn wheels(stamp: f64) -> EncodersData {
    EncodersData { stamp: Seconds(stamp), ..EncodersData::default() }
}
fn gyro(stamp: f64) -> InertialData {
    InertialData { stamp: Seconds(stamp), ..InertialData::default() }
}
fn fix(stamp: f64, x: f64) -> Fix {
    let covariance = Numbers([1e-4, 0.0, 0.0, 1e-4]);
    Fix { stamp: Seconds(stamp), x: Metres(x), y: Metres(0.0), covariance, heading: None }
}
fn all(source: &Source) -> Window {
    source.window(&WindowAsk::default()).expect("a window")
}
fn stamps(window: &Window) -> Vec<f64> {
    window.encoders.iter().map(|datum| datum.stamp.0).collect()
}

#[test]
fn the_parameter_file_holds_the_defaults() {
    let read: SourceParams = toml::from_str(SourceParams::FILE).expect("the file is valid");
    assert_eq!(read, SourceParams::default());
    let written = toml::Table::try_from(SourceParams::default()).expect("parameters are a table");
    let table: toml::Table = toml::from_str(SourceParams::FILE).expect("the file is a table");
    assert_eq!(table, written, "the file lists every field");
    for fixes in [0, 4097] {
        let wrong = SourceParams { fixes, ..SourceParams::default() };
        assert!(Source::new(&wrong).expect_err("no such buffer").to_string().contains("fixes"));
    }
}

#[test]
fn measurements_are_sorted_by_stamp_and_repeated_ones_dropped() {
    let mut source = source();
    for stamp in [0.2, 0.4, 0.1, 0.3, 0.3, 0.1] {
        source.take_encoders(None, wheels(stamp));
    }
    assert_eq!(stamps(&all(&source)), [0.1, 0.2, 0.3, 0.4]);
    for datum in [fix(0.3, 1.0), fix(0.3, 2.0), fix(0.3, 1.0)] {
        source.take_fix(None, datum);
    }
    assert_eq!(all(&source).fixes, [fix(0.3, 1.0), fix(0.3, 2.0)], "two beacons at one stamp are both kept");
}

#[test]
fn the_oldest_give_way_when_a_buffer_is_full() {
    let mut source = Source::new(&SourceParams { encoders: 3, ..SourceParams::default() }).expect("valid");
    for stamp in [0.5, 0.6, 0.7, 0.9, 0.8, 0.1] {
        source.take_encoders(None, wheels(stamp));
    }
    assert_eq!(stamps(&all(&source)), [0.7, 0.8, 0.9]);
}

#[test]
fn gaps_in_the_sequence_are_losses_until_the_late_ones_come() {
    let mut source = source();
    let mut take = |seq: u32| {
        source.take_encoders(meta(1, u64::from(seq)), wheels(f64::from(seq) * 0.02));
        all(&source).dropped
    };
    // The first sample tells nothing; 11 and 12 are missing; 12 comes late; then 10 again, which repeats a stamp.
    assert_eq!([10, 13, 12, 10, 14].map(&mut take), [0, 2, 1, 1, 1]);
}

#[test]
fn a_window_counts_back_from_the_newest_measurement_of_any_kind() {
    let mut source = source();
    for n in 0..10 {
        source.take_encoders(None, wheels(f64::from(n) * 0.1));
    }
    source.take_inertial(None, gyro(1.0));
    assert_eq!(stamps(&source.recent(Seconds(0.25))), [0.8, 0.9]);
    assert_eq!(source.recent(Seconds(0.25)).inertial.len(), 1);
    let asked = source.window(&WindowAsk { since: Some(Seconds(0.45)) }).expect("a window");
    assert_eq!(stamps(&asked), [0.6000000000000001, 0.7000000000000001, 0.8, 0.9]);
    for wrong in [-1.0, f64::NAN] {
        assert!(source.window(&WindowAsk { since: Some(Seconds(wrong)) }).is_err(), "{wrong} is refused");
    }
    assert_eq!(self::source().recent(Seconds(0.2)), Window::default());
}

#[test]
fn a_restarted_robot_is_remembered_from_its_new_boot_only() {
    let mut source = source();
    source.take_encoders(meta(1, 5), wheels(50.0));
    source.take_encoders(meta(1, 9), wheels(50.1));
    source.take_inertial(meta(1, 0), gyro(50.1));
    source.take_fix(meta(7, 3), fix(50.0, 1.0));
    assert_eq!((all(&source).boot, all(&source).dropped), (Boot(1), 3));
    // The gyro of the new run is ahead of its wheels; the last sample of the old run comes behind them.
    source.take_inertial(meta(2, 0), gyro(60.0));
    source.take_encoders(meta(2, 0), wheels(60.0));
    source.take_encoders(meta(1, 10), wheels(50.2));
    let window = all(&source);
    assert_eq!((window.boot, window.dropped), (Boot(2), 0));
    assert_eq!((stamps(&window), window.inertial.len(), window.fixes.len()), (vec![60.0], 1, 0));
}

#[test]
fn a_clock_that_goes_back_clears_what_it_has_stamped() {
    let mut source = source();
    source.take_encoders(None, wheels(50.0));
    source.take_inertial(None, gyro(50.0));
    source.take_fix(None, fix(50.0, 1.0));
    source.take_encoders(None, wheels(49.5));
    assert_eq!(stamps(&all(&source)), [49.5, 50.0], "half a second is only late");
    source.take_encoders(None, wheels(0.1));
    let window = all(&source);
    assert_eq!((stamps(&window), window.inertial.len(), window.fixes.len()), (vec![0.1], 0, 0));
}

#[test]
fn a_late_fix_is_put_where_it_belongs() {
    let mut source = source();
    source.take_fix(None, fix(20.0, 1.0));
    source.take_fix(None, fix(17.0, 2.0));
    assert_eq!(all(&source).fixes, [fix(17.0, 2.0), fix(20.0, 1.0)]);
}

#[test]
fn the_newest_position_is_given_to_whoever_asks_in_the_same_run_of_the_robot() {
    let mut source = source();
    let position =
        |boot, x| Position { boot: Boot(boot), map: Pose::new(x, 0.0, 0.0), ..Position::default() };
    source.take_encoders(meta(1, 0), wheels(0.1));
    assert_eq!(all(&source).position, None);
    source.take_position(position(1, 1.0));
    source.take_position(position(1, 2.0));
    source.take_position(position(1, f64::NAN));
    assert_eq!(all(&source).position, Some(position(1, 2.0)));
    assert_eq!(source.recent(Seconds(1.0)).position, None, "what is said again and again stays small");
    source.take_encoders(meta(2, 0), wheels(0.1));
    assert_eq!(all(&source).position, None, "nobody knows where the robot was when it began anew");
}

#[test]
fn the_largest_window_may_be_sent() {
    let params = SourceParams {
        encoders: MAX_WINDOW,
        inertial: MAX_WINDOW,
        fixes: MAX_WINDOW,
        ranges: MAX_WINDOW,
        recent: Seconds(1.0),
    };
    let mut source = Source::new(&params).expect("valid");
    for n in 0..=MAX_WINDOW {
        #[allow(clippy::cast_precision_loss, reason = "a small number")]
        let stamp = 1234.567 + n as f64 * 0.0123;
        let (stamp, odd) = (Seconds(stamp), 0.123_456_789);
        source
            .take_encoders(meta(1, n as u64), EncodersData { stamp, left: Metres(odd), right: Metres(-odd) });
        let acceleration = Some(MetresPerSecondSquared(odd));
        let gyro = RadiansPerSecond(odd);
        source.take_inertial(
            meta(1, n as u64),
            InertialData { stamp, gyro, ax: acceleration, ay: acceleration },
        );
        let heading = Some(axle_schema::HeadingFix { angle: Radians(odd), variance: odd });
        let covariance = Numbers([odd; 4]);
        let (x, y) = (Metres(odd), Metres(odd));
        source.take_fix(None, Fix { stamp, x, y, covariance, heading });
        source.take_range(None, Range { stamp, x, y, distance: x, sd: x });
    }
    let window = all(&source);
    assert!(window.check().is_ok());
    assert_eq!((window.fixes.len(), window.ranges.len()), (MAX_WINDOW, MAX_WINDOW));
    let size = axle_schema::encode(&window).expect("a window that can be written").len();
    assert!(size < Window::LIMIT, "{size} bytes");
}

proptest! {
    #[test]
    fn every_window_is_sorted_bounded_and_finite(
        samples in proptest::collection::vec((any::<f64>(), 0.0..3.0, proptest::option::of((0..3_u64, any::<u64>()))), 0..200),
    ) {
        let mut source = Source::new(&SourceParams { encoders: 16, ..SourceParams::default() }).expect("valid");
        for (any, stamp, meta) in samples {
            let meta = meta.and_then(|(boot, seq)| self::meta(boot, seq));
            source.take_encoders(meta, wheels(stamp));
            source.take_encoders(meta, wheels(any));
            let window = all(&source);
            prop_assert!(window.encoders.len() <= 16);
            prop_assert!(stamps(&window).is_sorted() && stamps(&window).iter().all(|stamp| stamp.is_finite()));
        }
    }
}
