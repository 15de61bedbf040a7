//! Ranges with a long tail: what the elbow of the filter is worth, on simulated robots. The value is the usual one of the
//! literature on robust estimates; it had been tried on the real log before this proof was written.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test ends at what is not as it should be, and says what it measured"
)]
#![allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers, and the very same bits"
)]

mod robot;

use axle_navigator::{EkfParams, Measurement, Method, Navigator, NavigatorParams, Range};
use axle_schema::{Metres, Radians, Seconds};
use robot::Robot;

const POINTS: [[f64; 2]; 4] = [[-5.0, -5.0], [-5.0, 5.0], [5.0, -5.0], [5.0, 5.0]];
const SD: f64 = 0.1;

fn params(range_elbow: f64) -> NavigatorParams {
    let ekf = EkfParams {
        start_sd: Metres(0.1),
        start_heading_sd: Radians(0.1),
        range_elbow,
        ..EkfParams::default()
    };
    NavigatorParams { method: Method::Ekf, ekf, ..NavigatorParams::default() }
}

/// Root of the mean square error over 100 runs of half a minute with eight ranges a second, of which a share is too long by
/// 0.3 m on average, three times the noise; without a gyro.
fn rms(elbow: f64, tail: f64) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for seed in 1..=100 {
        let mut robot = Robot::new(seed, &params(elbow));
        let mut navigator = Navigator::new(params(elbow)).expect("valid");
        let _ = navigator.take(robot.encoders());
        for step in 1..=1500_u32 {
            let (left, right) = robot.winding();
            let [encoders, _] = robot.drive(left, right);
            let _ = navigator.measure(&encoders);
            if step % 6 != 0 {
                continue;
            }
            let [x, y] = POINTS[(step / 6) as usize % 4];
            let mut distance = (robot.truth.x.0 - x).hypot(robot.truth.y.0 - y) + SD * robot.random.normal();
            // Ranges around a corner are longer, never shorter.
            if robot.random.uniform() < tail {
                distance -= 0.3 * (1.0 - robot.random.uniform()).ln();
            }
            let stamp = Seconds(robot.now());
            let (x, y, distance, sd) = (Metres(x), Metres(y), Metres(distance), Metres(SD));
            let _ = navigator.measure(&Measurement::Range(Range { stamp, x, y, distance, sd }));
            let miss = navigator.position().expect("one").map.distance(robot.truth).0;
            sum += miss * miss;
            n += 1.0;
        }
    }
    (sum / n).sqrt()
}

#[test]
fn the_elbow_costs_little_where_there_is_no_tail_and_brings_much_where_there_is_one() {
    let [without, with] = [0.0, 1.345].map(|elbow| [0.0, 0.1, 0.3].map(|tail| rms(elbow, tail)));
    println!("without an elbow {without:.4?} m, with it {with:.4?} m, at tails of 0, 10 and 30 %");
    assert!(with[0] < 1.03 * without[0], "it costs more than 3 %: {with:?}, {without:?}");
    assert!(with[1] < without[1] && with[2] < 0.95 * without[2], "{with:?}, {without:?}");
}
