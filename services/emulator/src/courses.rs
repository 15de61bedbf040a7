//! Courses in virtual time: the gate before the robot, blind and with feedback.

use crate::{Emulator, EmulatorParams};
use axle_gate::Gate;
use axle_schema::command::{BrakeCause, Class, Command, LeaseAsk};
use axle_schema::{Boot, Dwm, Metres, MetresPerSecond, Pose, Seconds, Sides, Tick};

/// 2 m straight on: up to 0.5 m/s within 1 s, 3 s steady, down within 1 s.
fn due(time: f64) -> (Metres, MetresPerSecond) {
    let (up, steady) = (time.clamp(0.0, 1.0), (time - 1.0).clamp(0.0, 3.0));
    let down = (time - 4.0).clamp(0.0, 1.0);
    let distance = 0.25 * up * up + 0.5 * steady + 0.5 * down - 0.25 * down * down;
    (Metres(distance), MetresPerSecond(0.5 * (up - down)))
}

/// Drives 2 m through the gate with 20 commands in a second; `feedback` is the speed in m/s for each metre that the
/// encoders are behind. Gives the true pose at rest.
fn drives(seed: u64, feedback: f64) -> Pose {
    let params = EmulatorParams::default();
    let mut robot = Emulator::new(EmulatorParams { seed, ..params }).expect("a robot");
    let mut gate = Gate::new(params.gate, &params.robot, Boot(1), None).expect("a gate");
    let ask = LeaseAsk { holder: "course".into(), class: Class::Corrector, period: Seconds(0.05) };
    let lease = gate.lease(Seconds::ZERO, &ask).expect("a lease");
    for beat in 0..1400_u32 {
        let now = Seconds(f64::from(beat) * params.rates.beat.0);
        if beat.is_multiple_of(10) && beat < 1200 {
            let dwm = movement(now.0, &mut robot, feedback);
            let (boot, epoch, echo) = (lease.boot, lease.epoch, Tick::of(now));
            let command = Command { boot, epoch, seq: beat, echo, ttl_ms: 100, dwm };
            gate.obey(now, &command).expect("obeyed");
        }
        let speeds = gate.beat(now);
        robot.advance(now, speeds);
    }
    let truth = robot.truth();
    assert_eq!(truth.twist.map(|twist| twist.v), Some(MetresPerSecond::ZERO), "at rest");
    truth.pose
}

/// The movement of the next 50 ms.
fn movement(time: f64, robot: &mut Emulator, feedback: f64) -> Dwm {
    let (distance, speed) = due(time);
    let (_, next) = due(time + 0.05);
    let correction = robot.encoders().sides().map(|real| MetresPerSecond((distance - real).0 * feedback));
    Dwm::new(correction.map(|c| speed + c), correction.map(|c| next + c), Seconds(0.05)).expect("finite")
}

#[test]
fn a_robot_with_feedback_reaches_its_goal_and_a_blind_one_misses_it() {
    let goal = Pose::new(2.0, 0.0, 0.0);
    let misses = |feedback| (0..20).map(|seed| drives(seed, feedback).distance(goal).0).collect::<Vec<_>>();
    let (blind, corrected) = (misses(0.0), misses(8.0));
    let mean = |misses: &[f64]| misses.iter().sum::<f64>() / 20.0;
    // Gains that differ by 1.4 % turn the robot by 0.09 rad over 2 m, which is 9 cm to the side; on average it is 6.
    assert!(mean(&blind) > 0.05, "blind: {blind:?}");
    // A tick that comes early on one side turns by 1.7 mrad, up to 3 mm to the side over the rest of the way.
    assert!(corrected.iter().all(|miss| *miss < 0.01), "corrected: {corrected:?}");
    assert!(mean(&blind) > 10.0 * mean(&corrected), "{} against {}", mean(&blind), mean(&corrected));
}

#[test]
fn a_robot_whose_commander_dies_stops_by_itself_and_soon() {
    let params = EmulatorParams::default();
    let mut robot = Emulator::new(params).expect("a robot");
    let mut gate = Gate::new(params.gate, &params.robot, Boot(1), None).expect("a gate");
    let ask = LeaseAsk { holder: "course".into(), class: Class::Corrector, period: Seconds(0.05) };
    let lease = gate.lease(Seconds::ZERO, &ask).expect("a lease");
    let speed = MetresPerSecond(0.5);
    let dwm = Dwm::steady(Sides::new(speed, speed), Seconds(1.0)).expect("finite");
    let mut last = Pose::default();
    for beat in 0..300_u32 {
        let now = Seconds(f64::from(beat) * params.rates.beat.0);
        if beat.is_multiple_of(10) && beat <= 100 {
            let (boot, epoch, echo) = (lease.boot, lease.epoch, Tick::of(now));
            gate.obey(now, &Command { boot, epoch, seq: beat, echo, ttl_ms: 1000, dwm }).expect("obeyed");
            last = robot.truth().pose;
        }
        let speeds = gate.beat(now);
        robot.advance(now, speeds);
    }
    // 150 ms of silence at 0.5 m/s, braking at 2 m/s², and 5 mm for a beat and wheels that are a bit too fast.
    let distance = robot.truth().pose.distance(last).0;
    assert!(distance < 0.5 * 0.15 + 0.5 * 0.5 / 4.0 + 0.005, "{distance} m");
    assert_eq!(gate.state(Seconds(1.5)).cause, Some(BrakeCause::Silence));
}
