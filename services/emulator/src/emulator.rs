//! The body of the emulated robot, and its sensors.

use crate::EmulatorParams;
use crate::ground::Ground;
use crate::motors::{Motors, Turned};
use crate::random::Random;
use crate::sensors::Sensors;
use crate::walls::Walls;
use axle_schema::contract::Bounds as _;
use axle_schema::dwm::MAX_WHEEL_SPEED;
use axle_schema::{
    Dwm, EncodersData, InertialData, MapData, Metres, MetresPerSecond, NavigatorData, Pose, RadiansPerSecond,
    Refusal, Seconds, Sides, Track, Twist,
};

/// A robot in software, which stands at first.
#[derive(Clone, Debug, PartialEq)]
pub struct Emulator {
    params: EmulatorParams,
    /// How far apart its wheels really are.
    track: Track,
    motors: Motors,
    ground: Ground,
    walls: Option<Walls>,
    sensors: Sensors,
    jitter: Random,
    now: Seconds,
    pose: Pose,
    /// What the rims of the wheels have really covered.
    distances: Sides<Metres>,
    /// How fast the wheels move the robot now, but for the jitter.
    speeds: Sides<MetresPerSecond>,
    /// On which side of its front a wall holds it.
    bump: Sides<bool>,
}

impl Emulator {
    /// A robot with the imperfections that `params.seed` gives it, at time 0 of its clock.
    ///
    /// # Errors
    /// Refuses parameters out of range.
    pub fn new(params: EmulatorParams) -> Result<Self, Refusal> {
        params.check()?;
        let seed = params.seed;
        // Each imperfection has its own stream: how often a sensor is read does not change how the robot drives.
        let mut body = Random::new(seed, 0);
        let gains = params
            .motors
            .gain
            .map(|gain| gain + params.motors.gain_deviation * body.normal().clamp(-3.0, 3.0));
        let gyro_bias = params.gyro.bias + params.gyro.bias_deviation * body.normal();
        Ok(Self {
            track: Track::new(Metres(params.robot.track.get() * params.wheels.track))?,
            params,
            motors: Motors::new(&params, gains),
            ground: Ground::new(params.slip, seed),
            walls: None,
            sensors: Sensors::new(&params, gyro_bias, params.start),
            jitter: Random::new(seed, 1),
            now: Seconds::ZERO,
            pose: params.start,
            distances: Sides::default(),
            speeds: Sides::default(),
            bump: Sides::default(),
        })
    }

    /// The same robot among the walls of a map. It stands where its parameters say, and that is not looked at.
    ///
    /// # Errors
    /// Refuses what is no map.
    pub fn among(self, map: &MapData) -> Result<Self, Refusal> {
        let walls = Some(Walls::of(map, self.params.walls)?);
        Ok(Self { walls, ..self })
    }

    /// Moves on to time `to`; the setpoints of the wheels go linearly from the last ones to `speeds`.
    ///
    /// A time that is not later changes nothing. A speed that is no number is taken for rest, and one beyond
    /// 20 m/s for that: no wheel does more.
    pub fn advance(&mut self, to: Seconds, speeds: Sides<MetresPerSecond>) {
        let duration = to - self.now;
        // The shortest interval is one in which no speed becomes infinite; the next call covers a shorter one.
        if !(duration.is_finite() && duration.0 > 1e-9) {
            return;
        }
        let channels = speeds.map(|speed| possible(speed).0);
        let asked = self.params.motors.wiring.to_wheels(channels).map(MetresPerSecond);
        let Turned { start, end, bulge } = self.motors.turn(asked, duration, to);
        let jitter = start.zip(end, |v0, v1| self.jitters((v0 + v1) / 2.0 * duration) / duration);
        let extra = jitter.zip(bulge, |jitter, bulge| jitter + bulge);
        let (start, rim) = (start.zip(extra, |v, e| v + e), end.zip(extra, |v, e| v + e));
        let covered = start.zip(rim, |v0, v1| (v0 + v1) / 2.0 * duration);
        let (start, over_ground) = self.ground.holds(start, rim, covered);
        let Ok(moved) = Dwm::new(start, over_ground, duration) else { return };
        let to_pose = moved.pose_at(self.pose, self.track, duration);
        let held = self.walls.as_ref().map(|walls| walls.hold(self.pose, to_pose));
        let is_held = held.is_some_and(|held| held != to_pose);
        self.bump = match &self.walls {
            Some(walls) if is_held => walls.sides(self.pose, to_pose),
            _ => Sides::default(),
        };
        self.pose = held.unwrap_or(to_pose);
        self.distances = self.distances.zip(covered, |sum, span| sum + span);
        // The jitter is no speed: it is what chance adds to the distance.
        self.speeds = over_ground.zip(extra, |v, e| v - e);
        if is_held {
            // Its wheels spin, and at most it turns.
            let half = (self.speeds.right - self.speeds.left) / 2.0;
            self.speeds = Sides::new(-half, half);
        }
        self.now = to;
    }

    /// The distance that a wheel covers too much, by chance, over `distance`.
    fn jitters(&mut self, distance: Metres) -> Metres {
        self.params.motors.jitter * (distance.0.abs().sqrt() * self.jitter.normal())
    }

    /// The clock of the robot.
    #[must_use]
    pub const fn now(&self) -> Seconds {
        self.now
    }

    /// What the encoders count since boot: the last whole tick of each wheel, less than a tick below the truth, but
    /// for their noise.
    #[must_use]
    pub fn encoders(&mut self) -> EncodersData {
        let counted = self.distances.zip(self.params.wheels.size, |distance, size| distance / size);
        self.sensors.encoders(self.now, counted)
    }

    /// What gyroscope and accelerometers measure: the means since their latest reading, with bias and noise.
    #[must_use]
    pub fn inertial(&mut self) -> InertialData {
        let truth = self.truth();
        self.sensors.inertial(&truth)
    }

    /// Where it runs against a wall with its front.
    #[must_use]
    pub const fn bump(&self) -> Sides<bool> {
        self.bump
    }

    /// What its battery gives now, as a share of what it gives when it is full and nobody drives.
    #[must_use]
    pub const fn battery(&self) -> f64 {
        self.motors.power()
    }

    /// The speed that a wheel is asked for by a full signal: a fifth more than its gate lets through, so that what friction
    /// and weak motors take can be made up for.
    #[must_use]
    pub fn full_speed(&self) -> MetresPerSecond {
        self.params.robot.wheel_speed * 1.2
    }

    /// Where the robot really is. The speeds leave the jitter out.
    #[must_use]
    pub fn truth(&self) -> NavigatorData {
        NavigatorData { stamp: self.now, pose: self.pose, twist: Some(self.twist()), covariance: None }
    }

    /// How fast the rims of the wheels run, but for the jitter.
    #[must_use]
    pub const fn rim_speeds(&self) -> Sides<MetresPerSecond> {
        self.motors.rim()
    }

    fn twist(&self) -> Twist {
        let Sides { left, right } = self.speeds;
        let omega = RadiansPerSecond((right - left).0 / self.track.get());
        Twist { v: (left + right) / 2.0, omega }
    }
}

/// The nearest speed that a wheel can be asked for.
const fn possible(speed: MetresPerSecond) -> MetresPerSecond {
    if speed.is_finite() {
        MetresPerSecond(speed.0.clamp(-MAX_WHEEL_SPEED, MAX_WHEEL_SPEED))
    } else {
        MetresPerSecond::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AccelerometersParams, EncodersParams, GyroParams, MotorsParams, SlipParams, WheelsParams};
    use axle_schema::MetresPerSecondSquared;
    use axle_schema::calibration::Wiring;
    use proptest::prelude::*;

    fn speeds(left: f64, right: f64) -> Sides<MetresPerSecond> {
        Sides::new(MetresPerSecond(left), MetresPerSecond(right))
    }

    /// A robot that does as it is told and knows what it does.
    fn perfect() -> Emulator {
        let params = EmulatorParams {
            motors: MotorsParams { gain_deviation: 0.0, jitter: Metres::ZERO, ..MotorsParams::default() },
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
        Emulator::new(params).expect("a robot")
    }

    #[test]
    fn without_noise_it_drives_what_it_is_told() {
        let mut robot = perfect();
        // From 0 to 0.5 m/s in 2 s, straight: 0.5 m.
        robot.advance(Seconds(2.0), speeds(0.5, 0.5));
        let truth = robot.truth();
        assert!((truth.pose.x.0 - 0.5).abs() < 1e-12 && truth.pose.y.0.abs() < 1e-12, "{truth:?}");
        assert_eq!(truth.twist.map(|twist| twist.v), Some(MetresPerSecond(0.5)));
        // Then the right wheel comes to 1.1 m/s in 1 s: it covers 0.3 m more, with a track of 0.3 m: 1 rad.
        let _ = robot.inertial();
        robot.advance(Seconds(3.0), speeds(0.5, 1.1));
        assert!((robot.truth().pose.heading.0 - 1.0).abs() < 1e-12);
        assert!((robot.inertial().gyro.0 - 1.0).abs() < 1e-12, "the mean turn rate");
        assert!((robot.inertial().gyro.0 - 2.0).abs() < 1e-12, "the turn rate of an instant");
    }

    #[test]
    fn what_makes_no_sense_moves_nothing() {
        let mut robot = perfect();
        robot.advance(Seconds(1.0), speeds(0.5, 0.5));
        let before = robot.clone();
        for to in [1.0, 0.5, -1.0, f64::NAN, f64::INFINITY] {
            robot.advance(Seconds(to), speeds(0.1, 0.2));
            assert_eq!(robot, before, "time {to}");
        }
        robot.advance(Seconds(2.0), speeds(f64::NAN, f64::INFINITY));
        let twist = robot.truth().twist.expect("a twist");
        assert_eq!((twist.v, twist.omega), (MetresPerSecond::ZERO, RadiansPerSecond::ZERO));
    }

    #[test]
    fn a_standing_robot_stands() {
        let mut robot =
            Emulator::new(EmulatorParams { seed: 3, ..EmulatorParams::default() }).expect("a robot");
        for beat in 1..1000 {
            robot.advance(Seconds(f64::from(beat) * 0.005), Sides::default());
        }
        let counted = robot.encoders().left;
        assert_eq!((robot.truth().pose, counted), (Pose::default(), Metres::ZERO));
        assert_ne!(robot.inertial().gyro, RadiansPerSecond::ZERO, "but its gyroscope says otherwise");
    }

    #[test]
    fn how_often_sensors_are_read_does_not_change_how_it_drives() {
        let mut read =
            Emulator::new(EmulatorParams { seed: 3, ..EmulatorParams::default() }).expect("a robot");
        let mut unread = read.clone();
        for beat in 1..100 {
            for robot in [&mut read, &mut unread] {
                robot.advance(Seconds(f64::from(beat) * 0.005), speeds(0.3, 0.4));
            }
            let _ = read.inertial();
        }
        assert_eq!(read.truth(), unread.truth());
    }

    #[test]
    fn accelerometers_feel_the_start_and_the_bend() {
        let mut robot = perfect();
        robot.advance(Seconds(1.0), speeds(0.5, 0.5));
        let felt = robot.inertial();
        let [ax, ay] = [felt.ax, felt.ay].map(|a| a.expect("it is measured").0);
        assert!((ax - 0.5).abs() < 1e-12 && ay.abs() < 1e-12, "0.5 m/s in 1 s: {ax}, {ay}");
        robot.advance(Seconds(1.001), speeds(0.35, 0.65));
        let _ = robot.inertial();
        robot.advance(Seconds(2.001), speeds(0.35, 0.65));
        let felt = robot.inertial();
        let [ax, ay] = [felt.ax, felt.ay].map(|a| a.expect("it is measured").0);
        assert!(ax.abs() < 1e-12 && (ay - 0.5).abs() < 1e-12, "0.5 m/s at 1 rad/s to the left: {ax}, {ay}");
    }

    #[test]
    fn wheels_of_another_size_and_crossed_cables_are_what_a_calibration_finds() {
        let crossed = Wiring { swapped: true, inverted: Sides::new(false, true) };
        let params = EmulatorParams {
            wheels: WheelsParams { track: 1.1, size: Sides::new(1.25, 0.8) },
            encoders: EncodersParams { wiring: crossed, ..EncodersParams::default() },
            motors: MotorsParams { wiring: crossed, ..perfect().params.motors },
            ..perfect().params
        };
        let mut robot = Emulator::new(params).expect("a robot");
        // The left channel drives the right wheel, backward.
        for beat in 1..=1000_u32 {
            robot.advance(Seconds(f64::from(beat) * 0.001), speeds(-0.5, 0.2));
        }
        let truth = robot.truth();
        assert!((truth.pose.heading.0 - 0.3 / 0.33).abs() < 1e-3, "{truth:?}");
        let counted = robot.encoders();
        assert!((counted.left.0 + 0.5 / 0.8).abs() < 0.002 && (counted.right.0 - 0.2 / 1.25).abs() < 0.002);
    }

    #[test]
    fn a_slip_moves_the_robot_less_than_its_encoders_say() {
        let slip = SlipParams { rate: 1.0, ..SlipParams::default() };
        let mut robot = Emulator::new(EmulatorParams { slip, ..perfect().params }).expect("a robot");
        for beat in 1..=5000_u32 {
            robot.advance(Seconds(f64::from(beat) * 0.001), speeds(0.5, 0.5));
        }
        let counted = robot.encoders();
        assert!((counted.left.0 - 2.4998).abs() < 0.001, "{counted:?}");
        let pose = robot.truth().pose;
        assert!(pose.x.0 < 2.49 && pose.heading.0.abs() > 1e-3, "{pose:?}");
    }

    #[test]
    fn an_encoder_whose_cable_comes_off_shows_its_last_reading() {
        let stuck = Sides::new(Metres(0.5), Metres::ZERO);
        let noise = Metres(0.001);
        let encoders = EncodersParams { stuck, noise, ..perfect().params.encoders };
        let mut robot = Emulator::new(EmulatorParams { encoders, ..perfect().params }).expect("a robot");
        let mut counted = robot.encoders();
        for beat in 1..=200_u32 {
            robot.advance(Seconds(f64::from(beat) * 0.01), speeds(-0.4, -0.4));
            counted = robot.encoders();
        }
        assert!((counted.left.0 + 0.5).abs() < 0.005 && (counted.right.0 + 0.8).abs() < 0.005, "{counted:?}");
        assert_eq!(robot.encoders().left, counted.left, "not even its noise is read");
        assert!(robot.truth().pose.heading.0.abs() < 1e-9, "only what is counted differs");
    }

    #[test]
    fn a_wall_stops_the_robot_and_not_its_wheels() {
        // A room of 3 m, with the robot in its middle.
        let cells = vec![0; 900];
        let grid = axle_maps::Grid::new("room", Metres(0.1), Pose::new(-1.5, -1.5, 0.0), 30, cells);
        let map = grid.and_then(|grid| grid.to_data()).expect("a map");
        let mut robot = perfect().among(&map).expect("a robot");
        let mut time = 0.0;
        let mut drive = |robot: &mut Emulator, seconds: u32, left: f64, right: f64| {
            for _ in 0..seconds * 200 {
                time += 0.005;
                robot.advance(Seconds(time), speeds(left, right));
            }
        };
        drive(&mut robot, 5, 0.5, 0.5);
        let truth = robot.truth();
        // The wall is 1.5 m ahead, the body reaches 0.2 m: it stands at 1.3 m, and its encoders say 2.5 m.
        assert!((truth.pose.x.0 - 1.3).abs() < 0.003, "{truth:?}");
        assert!(robot.encoders().left.0 > 2.4 && truth.twist.expect("a twist").v.0.abs() < 1e-12);
        assert_eq!(robot.bump(), Sides::new(true, true), "straight before it");
        drive(&mut robot, 1, -0.3, 0.3);
        assert_eq!(robot.bump(), Sides::default(), "on the spot it pushes nothing");
        assert!(robot.truth().pose.heading.0 > 1.5, "it can turn: {:?}", robot.truth());
        drive(&mut robot, 1, 0.0, 0.0);
        drive(&mut robot, 2, 0.4, 0.4);
        let away = robot.truth().pose;
        assert!(away.x.0 < 1.05 && away.y.0 > 0.5, "and leave: {away:?}");
    }

    #[test]
    fn noisy_encoders_and_a_drifting_gyroscope_leave_the_truth_alone() {
        let encoders = EncodersParams { noise: Metres(0.01), ..EncodersParams::default() };
        let gyro = GyroParams { drift: RadiansPerSecond(0.1), ..perfect().params.gyro };
        let mut noisy =
            Emulator::new(EmulatorParams { encoders, gyro, ..perfect().params }).expect("a robot");
        let mut quiet = perfect();
        let (mut spread, mut rate) = (0.0, 0.0);
        for beat in 1..=1000_u32 {
            for robot in [&mut noisy, &mut quiet] {
                robot.advance(Seconds(f64::from(beat) * 0.01), Sides::default());
            }
            spread += noisy.encoders().left.0.powi(2) / 1000.0;
            rate = noisy.inertial().gyro.0;
        }
        assert!((0.008..0.012).contains(&spread.sqrt()), "{spread}");
        assert!(
            rate.abs() > 0.01 && rate.abs() < 1.5,
            "after 10 s it has drifted by about 0.3 rad/s: {rate}"
        );
        assert_eq!(noisy.truth(), quiet.truth());
    }

    /// Setpoints at growing times.
    fn drive() -> impl Strategy<Value = Vec<(f64, f64, f64)>> {
        prop::collection::vec((0.005..1.0, -1.0..1.0, -1.0..1.0), 1..20)
    }

    proptest! {
        #[test]
        fn slices_of_time_add_up(drive in drive(), slices in 1_u32..8) {
            let (mut whole, mut sliced) = (perfect(), perfect());
            let (mut time, mut last) = (0.0, speeds(0.0, 0.0));
            for (span, left, right) in drive {
                let next = speeds(left, right);
                for slice in 1..=slices {
                    let share = f64::from(slice) / f64::from(slices);
                    sliced.advance(Seconds(time + span * share), last.zip(next, |v0, v1| v0 + (v1 - v0) * share));
                }
                time += span;
                whole.advance(Seconds(time), next);
                last = next;
            }
            let (a, b) = (whole.truth().pose, sliced.truth().pose);
            prop_assert!(a.distance(b).0 < 1e-12 && (a.heading - b.heading).abs().0 < 1e-12, "{a:?} {b:?}");
        }

        #[test]
        fn the_same_seed_gives_the_same_bits(drive in drive(), seed in any::<u64>()) {
            let run = || {
                let mut robot = Emulator::new(EmulatorParams { seed, ..EmulatorParams::default() }).expect("a robot");
                let mut time = 0.0;
                let seen: Vec<_> = drive
                    .iter()
                    .map(|&(span, left, right)| {
                        time += span;
                        robot.advance(Seconds(time), speeds(left, right));
                        (robot.truth(), robot.encoders(), robot.inertial())
                    })
                    .collect();
                format!("{seen:?}")
            };
            prop_assert_eq!(run(), run());
        }

        #[test]
        fn encoders_are_never_off_by_more_than_a_tick(drive in drive(), seed in any::<u64>()) {
            let mut robot = Emulator::new(EmulatorParams { seed, ..EmulatorParams::default() }).expect("a robot");
            let mut time = 0.0;
            for (span, left, right) in drive {
                time += span;
                robot.advance(Seconds(time), speeds(left, right));
                let counted = robot.encoders().sides().zip(robot.distances, |count, truth| (truth - count).0);
                for missing in counted.both() {
                    prop_assert!((-1e-12..=0.0005 + 1e-12).contains(&missing), "{missing}");
                }
            }
        }
    }
}
