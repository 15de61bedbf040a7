//! Scenarios: what is wrong with the robot and its links. All of them stand in one table.
//!
//! Each is the clean robot with one fault, so that what a fault does can be told; the last one has all of them, milder.

use crate::link::LinkParams;
use axle_emulator::{
    AccelerometersParams, BatteryParams, EmulatorParams, EncodersParams, GyroParams, MotorsParams, Random,
    SlipParams,
};
use axle_schema::{Metres, MetresPerSecond, MetresPerSecondSquared, RadiansPerSecond, Seconds, Sides};

/// A robot and its links.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct World {
    /// The robot.
    pub robot: EmulatorParams,
    /// From the robot to the computer of the corrector.
    pub up: LinkParams,
    /// From there to the robot.
    pub down: LinkParams,
}

/// One scenario.
#[derive(Clone, Copy, Debug)]
pub struct Scenario {
    /// Its name.
    pub name: &'static str,
    /// What is wrong, in a few words.
    pub about: &'static str,
    spoil: fn(&mut World, &mut Random),
}

/// All scenarios.
pub const SCENARIOS: &[Scenario] = &[
    Scenario { name: "clean", about: "nothing: a perfect robot on a cable of 1 to 2 ms", spoil: |_, _| {} },
    Scenario {
        name: "ticks",
        about: "encoders with a tick of 5 mm",
        spoil: |world, _| world.robot.encoders.tick = Metres(0.005),
    },
    Scenario {
        name: "gyro-bias",
        about: "a gyroscope that is 0.05 rad/s off, noisy by 0.01 rad/s, and drifts",
        spoil: |world, random| {
            let bias = RadiansPerSecond(side(random) * 0.05);
            let (noise_deviation, drift) = (RadiansPerSecond(0.01), RadiansPerSecond(0.005));
            world.robot.gyro =
                GyroParams { bias, noise_deviation, drift, bias_deviation: RadiansPerSecond::ZERO };
        },
    },
    Scenario {
        name: "unequal-wheels",
        about: "wheels that run 1.5 % faster and 1.5 % slower than asked: 3 % apart",
        spoil: |world, random| world.robot.motors.gain = apart(0.015 * side(random)),
    },
    Scenario {
        name: "slip",
        about: "each wheel slips once in 2 m, for 5 cm, by half",
        spoil: |world, _| world.robot.slip = SlipParams { rate: 0.5, ..SlipParams::default() },
    },
    Scenario {
        name: "motors",
        about: "motors with a dead band of 2 cm/s, a lag of 80 ms, and a battery that sags by 5 %",
        spoil: |world, _| {
            world.robot.motors.dead_band = MetresPerSecond(0.02);
            world.robot.motors.lag = Seconds(0.08);
            world.robot.battery.sag = 0.05;
        },
    },
    Scenario {
        name: "latency",
        about: "commands that take up to 0 to 200 ms, another bound in every run; half of it is jitter",
        spoil: |world, random| {
            let half = Seconds(0.1 * random.uniform());
            (world.down.delay, world.down.jitter) = (half, half);
        },
    },
    Scenario {
        name: "dropped",
        about: "2 % of the commands and 5 % of the measurements are lost",
        spoil: |world, _| (world.down.loss, world.up.loss) = (0.02, 0.05),
    },
    Scenario {
        name: "everything",
        about: "a plain robot over Wi-Fi: all of the above, milder",
        spoil: |world, random| {
            let robot = EmulatorParams::default();
            world.robot = EmulatorParams { seed: world.robot.seed, ..robot };
            world.robot.motors = MotorsParams {
                gain: apart(0.01 * side(random)),
                dead_band: MetresPerSecond(0.005),
                lag: Seconds(0.03),
                ..robot.motors
            };
            world.robot.battery = BatteryParams { sag: 0.02, drain: 0.0 };
            world.robot.slip = SlipParams { rate: 0.1, length: Metres(0.03), share: 0.5 };
            world.robot.encoders =
                EncodersParams { tick: Metres(0.001), noise: Metres(0.0002), ..robot.encoders };
            let wireless = Seconds(0.02);
            world.up = LinkParams { delay: Seconds(0.003), jitter: wireless, loss: 0.01, ..world.up };
            world.down = LinkParams { delay: Seconds(0.003), jitter: wireless, loss: 0.002, ..world.down };
        },
    },
];

/// What a search for gains has its robots meet beside the scenarios, so that what it finds does not only fit those: each
/// robot lies somewhere between the best and the worst one that a corrector must do with. Gains that are quick on a good
/// robot and let a slow one hunt to and fro at its goal are found out here.
pub const TRIALS: &[Scenario] = &[
    Scenario {
        name: "any-robot",
        about: "up to 80 ms of delay in sum, motors with a lag of up to 60 ms, each wheel up to 3 % off",
        spoil: |world, random| {
            let gains =
                Sides::new(random.uniform(), random.uniform()).map(|share| 1.0 + 0.06 * (share - 0.5));
            slow(world, random.uniform(), random.uniform(), gains);
        },
    },
    Scenario {
        name: "worst-robot",
        about: "80 ms of delay in sum, motors with a lag of 60 ms, wheels 3 % off to either side or both",
        spoil: |world, random| {
            let gains = Sides::new(side(random), side(random)).map(|side| 1.0 + 0.03 * side);
            slow(world, 1.0, 1.0, gains);
        },
    },
    Scenario {
        name: "slow-link",
        about: "100 to 160 ms there and back, on links that do not vary",
        spoil: |world, random| {
            let more = 0.03 * random.uniform();
            (world.up.delay, world.down.delay) = (Seconds(0.04 + more), Seconds(0.06 + more));
        },
    },
];

/// A robot that is slow in several ways at once, with the encoders that most have. With more delay than this beats are
/// steered that are two periods old, and the correctors are not made for it.
fn slow(world: &mut World, delay: f64, lag: f64, gain: Sides<f64>) {
    (world.up.delay, world.down.delay) = (Seconds(0.02 * delay), Seconds(0.06 * delay));
    world.robot.motors.lag = Seconds(0.06 * lag);
    world.robot.motors.gain = gain;
    world.robot.encoders.tick = Metres(5e-4);
    world.robot.encoders.noise = Metres(2e-4);
}

/// To the left or to the right, by chance.
fn side(random: &mut Random) -> f64 {
    if random.uniform() > 0.5 { 1.0 } else { -1.0 }
}

/// Gains that are so far from 1.
const fn apart(share: f64) -> Sides<f64> {
    Sides::new(1.0 + share, 1.0 - share)
}

impl World {
    /// A robot that does as it is told and knows what it does.
    #[must_use]
    pub fn clean(seed: u64) -> Self {
        let robot = EmulatorParams {
            seed,
            motors: MotorsParams { gain_deviation: 0.0, jitter: Metres::ZERO, ..MotorsParams::default() },
            encoders: EncodersParams { tick: Metres(1e-5), ..EncodersParams::default() },
            gyro: GyroParams {
                bias_deviation: RadiansPerSecond::ZERO,
                noise_deviation: RadiansPerSecond::ZERO,
                ..GyroParams::default()
            },
            accelerometers: AccelerometersParams {
                bias_deviation: MetresPerSecondSquared::ZERO,
                noise_deviation: MetresPerSecondSquared::ZERO,
            },
            ..EmulatorParams::default()
        };
        Self { robot, up: LinkParams::default(), down: LinkParams::default() }
    }
}

impl Scenario {
    /// The scenario or trial of this name.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        SCENARIOS.iter().chain(TRIALS).find(|scenario| scenario.name == name)
    }

    /// The robot and its links in a run with this seed.
    #[must_use]
    pub fn world(&self, seed: u64) -> World {
        let mut world = World::clean(seed);
        (self.spoil)(&mut world, &mut Random::new(seed, 21));
        world
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_emulator::Emulator;
    use axle_schema::contract::Bounds as _;

    #[test]
    fn every_scenario_is_a_world_that_can_be_and_one_of_its_own() {
        let mut worlds: Vec<World> = Vec::new();
        for scenario in SCENARIOS.iter().chain(TRIALS) {
            for seed in [1, 2, 3] {
                let world = scenario.world(seed);
                assert!(Emulator::new(world.robot).is_ok(), "{}", scenario.name);
                assert!(world.up.check().is_ok() && world.down.check().is_ok(), "{}", scenario.name);
            }
            assert!(!worlds.contains(&scenario.world(1)), "{} is another one", scenario.name);
            worlds.push(scenario.world(1));
        }
    }
}
