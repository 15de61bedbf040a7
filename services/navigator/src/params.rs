//! The parameters of the navigator: `deploy/params/navigator.toml`.

use axle_schema::contract::{Bounds, Params};
use axle_schema::refusal::within;
use axle_schema::way::MAX_COORDINATE;
use axle_schema::{Drivetrain, Event, Metres, Pose, Radians, Refusal, Seconds};
use serde::{Deserialize, Serialize};

/// How measurements become poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The exact arc between two encoder readings.
    #[default]
    Arc,
    /// First the whole turn, then straight on: the tutorial's equation 6.
    PointAndShoot,
    /// Half of the turn, straight on, the other half: Brown's.
    HalfTurn,
    /// The exact movement, with accelerations from the neighbouring spans.
    Accelerated,
    /// A log of ticks for each wheel, brought to an instant that both have reached.
    Ticks,
    /// A Kalman filter of encoders, gyro, accelerometer, fixes and ranges.
    Ekf,
}

impl Method {
    /// Every method, simplest first.
    pub const ALL: [Self; 6] =
        [Self::PointAndShoot, Self::HalfTurn, Self::Arc, Self::Accelerated, Self::Ticks, Self::Ekf];

    /// Its name in parameters.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Arc => "arc",
            Self::PointAndShoot => "point-and-shoot",
            Self::HalfTurn => "half-turn",
            Self::Accelerated => "accelerated",
            Self::Ticks => "ticks",
            Self::Ekf => "ekf",
        }
    }
}

/// Parameters of the navigator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NavigatorParams {
    /// How measurements become poses.
    pub method: Method,
    /// Noise of a wheel: its distance has a variance of `k` for every metre it covers, 0 to 1 m (model.md 6.1).
    pub k: Metres,
    /// How much farther than its speed allows a wheel may seem to have come between two readings, 0.001 to 10 m.
    pub jump: Metres,
    /// The distance of a wheel from tick to tick of its encoder, 0 to 0.1 m: what is less than a tick is noise.
    pub tick: Metres,
    /// Whether slip, stuck encoders and the like are looked for by every method; "ekf" always does.
    pub watch: bool,
    /// Events at which the robot is to stop, by their names; see `axle_schema::Event::name`.
    pub stop: Vec<String>,
    /// After how long without readings a sensor counts as silent, 0.05 to 60 s.
    pub silence: Seconds,
    /// Where the robot is at the first reading, in `odom` and in `map`.
    pub start: Pose,
    /// The robot: its track and its largest wheel speed.
    pub robot: Drivetrain,
    /// What only the method "ekf" uses.
    pub ekf: EkfParams,
}

/// Parameters of the method "ekf": model.md 6 with its symbols.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EkfParams {
    /// How well the start is known: standard deviation of x and of y, 0 to 1000 m.
    pub start_sd: Metres,
    /// How well the start heading is known. From 0.5 rad on it counts as unknown, and is found by driving between fixes.
    pub start_heading_sd: Radians,
    /// Noise of a wheel beside `k`, whether it turns or not: the standard deviation of its distance after 1 s, in m/√s, 0 to
    /// 1. For wheels whose speed is measured.
    pub wheel_noise: f64,
    /// Noise of the gyro's angle: its standard deviation after 1 s, in rad/√s, 1e-6 to 1.
    pub gyro_noise: f64,
    /// Standard deviation of the gyro's bias at the start, in rad/s, 0 to 1.
    pub bias_sd: f64,
    /// How the bias walks: its standard deviation after 1 s, in rad/s/√s, 0 to 1.
    pub bias_walk: f64,
    /// Standard deviation of the radius of each wheel, relative; 0 takes the radii as exact. 0 to 0.2.
    pub wheel_sd: f64,
    /// Standard deviation of the track, relative; 0 takes it as exact. 0 to 0.2.
    pub track_sd: f64,
    /// A fix or a range whose squared normalised innovation is larger is not believed; 0 believes everything. 0 to 1000.
    pub gate: f64,
    /// Noise of the accelerometer's speed: its standard deviation after 1 s, in m/s/√s, 0 to 10; 0 does not use it.
    pub accelerometer_noise: f64,
    /// Standard deviation of its bias, which tilt is part of, in m/s², 0 to 10.
    pub accelerometer_bias_sd: f64,
    /// A range that is off by more than so many standard deviations counts as if it were by so many (Huber); 0 takes every
    /// range at its word. 0 to 10.
    pub range_elbow: f64,
    /// How much longer than the distance a range reads, -10 to 10 m.
    pub range_bias: Metres,
    /// How old a measurement may be and still be applied at its own time, 0.1 to 60 s.
    pub window: Seconds,
}

impl Default for EkfParams {
    fn default() -> Self {
        Self {
            start_sd: Metres(0.0),
            start_heading_sd: Radians(0.0),
            wheel_noise: 0.0,
            gyro_noise: 1e-3,
            bias_sd: 0.01,
            bias_walk: 1e-4,
            wheel_sd: 0.0,
            track_sd: 0.0,
            gate: 13.8,
            accelerometer_noise: 0.0,
            accelerometer_bias_sd: 0.1,
            range_elbow: 1.345,
            range_bias: Metres(0.0),
            window: Seconds(2.0),
        }
    }
}

impl Default for NavigatorParams {
    fn default() -> Self {
        Self {
            method: Method::default(),
            k: Metres(1e-4),
            jump: Metres(0.05),
            tick: Metres(5e-4),
            watch: true,
            stop: ["kidnapped", "slip", "skid", "stuck-encoder", "silent-encoders"]
                .map(str::to_owned)
                .to_vec(),
            silence: Seconds(1.0),
            start: Pose::default(),
            robot: Drivetrain::default(),
            ekf: EkfParams::default(),
        }
    }
}

impl Bounds for EkfParams {
    fn check(&self) -> Result<(), Refusal> {
        within("ekf.start_sd in m", self.start_sd.0, 0.0, 1000.0)?;
        within("ekf.start_heading_sd in rad", self.start_heading_sd.0, 0.0, 10.0)?;
        within("ekf.wheel_noise in m/√s", self.wheel_noise, 0.0, 1.0)?;
        within("ekf.gyro_noise in rad/√s", self.gyro_noise, 1e-6, 1.0)?;
        within("ekf.bias_sd in rad/s", self.bias_sd, 0.0, 1.0)?;
        within("ekf.bias_walk in rad/s/√s", self.bias_walk, 0.0, 1.0)?;
        within("ekf.wheel_sd", self.wheel_sd, 0.0, 0.2)?;
        within("ekf.track_sd", self.track_sd, 0.0, 0.2)?;
        within("ekf.gate", self.gate, 0.0, 1000.0)?;
        within("ekf.accelerometer_noise in m/s/√s", self.accelerometer_noise, 0.0, 10.0)?;
        within("ekf.accelerometer_bias_sd in m/s²", self.accelerometer_bias_sd, 0.0, 10.0)?;
        within("ekf.range_elbow", self.range_elbow, 0.0, 10.0)?;
        within("ekf.range_bias in m", self.range_bias.0, -10.0, 10.0)?;
        within("ekf.window in s", self.window.0, 0.1, 60.0)
    }
}

impl Bounds for NavigatorParams {
    fn check(&self) -> Result<(), Refusal> {
        within("k in m", self.k.0, 0.0, 1.0)?;
        within("jump in m", self.jump.0, 1e-3, 10.0)?;
        within("tick in m", self.tick.0, 0.0, 0.1)?;
        within("silence in s", self.silence.0, 0.05, 60.0)?;
        if let Some(unknown) = self.stop.iter().find(|name| !Event::NAMES.contains(&name.as_str())) {
            let got = unknown.chars().take(64).collect();
            return Err(Refusal::Unknown {
                what: "event of stop".into(),
                got,
                known: Event::NAMES.join(", "),
            });
        }
        within("start.x in m", self.start.x.0, -MAX_COORDINATE, MAX_COORDINATE)?;
        within("start.y in m", self.start.y.0, -MAX_COORDINATE, MAX_COORDINATE)?;
        within("start.heading in rad", self.start.heading.0, -1e4, 1e4)?;
        self.robot.check()?;
        self.ekf.check()
    }
}

impl Params for NavigatorParams {
    const FILE: &'static str = include_str!("../../../deploy/params/navigator.toml");
}
