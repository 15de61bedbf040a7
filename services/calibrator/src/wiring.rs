//! Which channel belongs to which wheel: how to go from one to the other, and how to find out.
//!
//! Each channel of the motors is given a short push. The turn and the jolt ahead, which gyroscope and accelerometer
//! feel, tell which wheel moved and which way, since no encoder is needed for that; and so the encoders are told apart.
//! A wheel that pushes ahead on the right turns the robot to the left: jolt and turn have the same sign. On the left
//! they differ.

use axle_schema::calibration::Wiring;
use axle_schema::{Refusal, Sides};

/// What was felt while one channel of the motors was pushed ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Push {
    /// What the channels of the encoders counted, m.
    pub(crate) counted: Sides<f64>,
    /// The least that is a movement, m.
    pub(crate) least: f64,
    /// How far the robot turned, rad, where there is a gyroscope that felt it.
    pub(crate) turned: Option<f64>,
    /// By how much it got faster ahead, m/s, where there is an accelerometer that felt it.
    pub(crate) jolt: Option<f64>,
}

/// What is known of the wiring, and in words what of it is assumed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Found {
    pub(crate) motors: Wiring,
    pub(crate) encoders: Wiring,
    pub(crate) assumed: Option<&'static str>,
}

/// A wheel that moved: the right one or the left one, ahead (1) or back (-1).
type Moved = (bool, f64);

/// Tells the wiring from a push of the left channel and one of the right channel.
///
/// # Errors
/// When nothing moved, or what moved cannot be one robot.
pub(crate) fn find(pushes: Sides<Push>) -> Result<Found, Refusal> {
    let (left, right) = (pushes.left.by("left")?, pushes.right.by("right")?);
    if left.0 == right.0 {
        return Err(impossible("both motors turn the wheel of the same encoder"));
    }
    let (moved, assumed) = wheels(pushes)?;
    if moved.left.0 == moved.right.0 {
        return Err(impossible("both motors seem to turn the same wheel; does the other one slip?"));
    }
    let swapped = moved.left.0;
    let of_wheels = |channels: Sides<bool>| {
        if swapped { Sides::new(channels.right, channels.left) } else { channels }
    };
    let motors = Wiring { swapped, inverted: of_wheels(moved.map(|(_, way)| way < 0.0)) };
    // The encoder that a push moved belongs to the wheel that it moved; `left.0` says whether it is the right channel.
    let against = Sides::new(left.1 * moved.left.1 < 0.0, right.1 * moved.right.1 < 0.0);
    let encoders = Wiring { swapped: left.0 != moved.left.0, inverted: of_wheels(against) };
    Ok(Found { motors, encoders, assumed })
}

/// Which wheel each push moved.
fn wheels(pushes: Sides<Push>) -> Result<(Sides<Moved>, Option<&'static str>), Refusal> {
    let (left, right) = (pushes.left, pushes.right);
    Ok(match (left.turned.zip(right.turned), left.jolt.zip(right.jolt)) {
        (Some(turns), Some(jolts)) => {
            let moved = |turn: f64, jolt: f64| (turn * jolt > 0.0, jolt.signum());
            (Sides::new(moved(turns.0, jolts.0), moved(turns.1, jolts.1)), None)
        }
        (Some((left, right)), None) => {
            if left * right > 0.0 {
                // Pushed alike they turn alike: one motor is inverted, and which one is the same as which is left.
                return Err(impossible(
                    "one motor is inverted, and without an accelerometer nobody can tell which",
                ));
            }
            // Pushes that turn as they should are those of a robot that is wired right, or of one whose front is its back.
            let swapped = left > 0.0;
            let assumed = "that the front of the robot is its front: there is no accelerometer that felt it";
            (Sides::new((swapped, 1.0), (!swapped, 1.0)), Some(assumed))
        }
        _ => {
            let assumed = "that the motors are wired right: there is no gyroscope that felt it";
            (Sides::new((false, 1.0), (true, 1.0)), Some(assumed))
        }
    })
}

impl Push {
    /// The channel of the encoders that a push moved.
    fn by(&self, channel: &str) -> Result<Moved, Refusal> {
        let Sides { left, right } = self.counted.map(f64::abs);
        if left.max(right) < self.least {
            let why = format!("the {channel} motor was given a signal and no encoder has counted anything");
            return Err(impossible(&why));
        }
        if left.min(right) > left.max(right) / 2.0 {
            return Err(impossible(&format!(
                "the {channel} motor was given a signal and both encoders count"
            )));
        }
        let is_right = right > left;
        Ok((is_right, if is_right { self.counted.right } else { self.counted.left }.signum()))
    }
}

fn impossible(why: &str) -> Refusal {
    Refusal::Failed { why: format!("{why}; look at motors, encoders and their cables") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a robot that is wired like this feels when a channel of its motors is pushed.
    fn push(motors: Wiring, encoders: Wiring, channel: Sides<f64>) -> Push {
        let wheels = motors.to_wheels(channel);
        Push {
            counted: encoders.to_channels(wheels),
            least: 0.01,
            turned: Some(wheels.right - wheels.left),
            jolt: Some(wheels.left + wheels.right),
        }
    }
    fn every() -> Vec<Wiring> {
        let flags = [false, true];
        flags
            .iter()
            .flat_map(|&swapped| {
                flags.iter().flat_map(move |&left| {
                    flags.map(move |right| Wiring { swapped, inverted: Sides::new(left, right) })
                })
            })
            .collect()
    }
    fn pushes(motors: Wiring, encoders: Wiring) -> Sides<Push> {
        Sides::new(push(motors, encoders, Sides::new(0.2, 0.0)), push(motors, encoders, Sides::new(0.0, 0.2)))
    }

    #[test]
    fn every_wiring_of_motors_and_encoders_is_found() {
        for motors in every() {
            for encoders in every() {
                let found = find(pushes(motors, encoders)).expect("a robot");
                assert_eq!((found.motors, found.encoders, found.assumed), (motors, encoders, None));
            }
        }
    }

    #[test]
    fn wheels_and_channels_are_inverse() {
        for wiring in every() {
            let wheels = Sides::new(1.0, 2.0);
            assert_eq!(wiring.to_wheels(wiring.to_channels(wheels)), wheels);
        }
    }

    #[test]
    fn what_cannot_be_felt_is_assumed_and_said_or_refused() {
        let blind = |push: Push| Push { turned: None, jolt: None, ..push };
        let numb = |push: Push| Push { jolt: None, ..push };
        let crossed = Wiring { swapped: true, ..Wiring::default() };
        let found = find(pushes(Wiring::default(), crossed).map(blind)).expect("a robot");
        assert!(found.encoders == crossed && found.assumed.is_some());
        let found = find(pushes(crossed, Wiring::default()).map(numb)).expect("a robot");
        assert!(found.motors == crossed && found.assumed.is_some());
        let one = Wiring { swapped: false, inverted: Sides::new(true, false) };
        assert!(find(pushes(one, crossed).map(numb)).is_err(), "nobody can tell which one");
    }

    #[test]
    fn a_dead_motor_or_encoder_is_named() {
        let fine = pushes(Wiring::default(), Wiring::default());
        let dead = Push { counted: Sides::new(0.0, 0.001), ..fine.left };
        let said = find(Sides::new(dead, fine.right)).expect_err("a dead motor").to_string();
        assert!(said.contains("left motor"), "{said}");
        let both = Push { counted: Sides::new(0.2, 0.2), ..fine.left };
        assert!(find(Sides::new(both, fine.right)).is_err());
        assert!(find(Sides::new(fine.left, fine.left)).is_err());
    }
}
