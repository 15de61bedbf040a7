//! What of a robot with a real board may be chosen.

use crate::arduino::Arduino;
use crate::board::Board;
use crate::dwm_text::DwmText;
use crate::eddie::Eddie;
use crate::orfa::Orfa;
use crate::roomba::Roomba;
use axle_gate::GateParams;
use axle_schema::contract::{Bounds, Params};
use axle_schema::refusal::within;
use axle_schema::{
    Drivetrain, Metres, MetresPerSecond, MetresPerSecondSquared, Radians, RadiansPerSecond, Refusal, Seconds,
    Sides, Track,
};
use serde::{Deserialize, Serialize};

/// Servos that one robot may have: as many as there are keys for them.
const MOST_SERVOS: usize = 4;

/// The kinds of boards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoardKind {
    /// An Arduino with ROSArduinoBridge.
    Arduino,
    /// iRobot Create or Roomba, by the Open Interface.
    Roomba,
    /// Parallax Eddie.
    Eddie,
    /// An Open Robotics board, by the serial gate of its ORFA firmware.
    Orfa,
    /// A board that takes movements as text: the firmware of the paper.
    DwmText,
}

impl BoardKind {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Arduino, Self::Roomba, Self::Eddie, Self::Orfa, Self::DwmText];

    /// Its name in commands and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Arduino => "arduino",
            Self::Roomba => "roomba",
            Self::Eddie => "eddie",
            Self::Orfa => "orfa",
            Self::DwmText => "dwm-text",
        }
    }
    /// The kind of that name.
    ///
    /// # Errors
    /// [`Refusal::Unknown`] with all names.
    pub fn parse(name: &str) -> Result<Self, Refusal> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| Refusal::Unknown {
            what: "board".into(),
            got: name.chars().take(40).collect(),
            known: Self::ALL.map(Self::name).join(", "),
        })
    }
    /// The body of a usual robot with this board, with limits that it can keep.
    #[must_use]
    pub fn body(self) -> Drivetrain {
        let (track, wheel_speed, speed) = match self {
            Self::Roomba => (0.235, 0.5, 0.3),
            Self::Eddie => (0.39, 1.0, 0.5),
            Self::Arduino | Self::Orfa | Self::DwmText => return Drivetrain::default(),
        };
        Drivetrain {
            track: Track::new(Metres(track)).unwrap_or(Drivetrain::default().track),
            wheel_speed: MetresPerSecond(wheel_speed),
            wheel_acceleration: MetresPerSecondSquared(1.0),
            speed: MetresPerSecond(speed),
            turn_rate: RadiansPerSecond(1.5),
        }
    }
    /// Whether a board of this kind measures what its wheels do.
    #[must_use]
    pub const fn has_encoders(self) -> bool {
        !matches!(self, Self::Orfa)
    }
}

/// Parameters of a robot with a real board: `deploy/params/robot.toml`. Of the tables of boards, that of the board that
/// is there counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotParams {
    /// Time from beat to beat of the gate, 0.005 to 0.02 s.
    pub beat: Seconds,
    /// Without a measurement for this long the wheels are given up, 0.05 to 1 s.
    pub silence: Seconds,
    /// How long a board may take to answer the greeting, 0.5 to 30 s: many restart when their port is opened.
    pub greeting: Seconds,
    /// Whether the calibration that is kept for this robot is applied.
    pub calibrated: bool,
    /// The servos, at most four, in the order of their keys.
    pub servos: Vec<ServoParams>,
    /// The body of the robot.
    pub robot: Drivetrain,
    /// The gate.
    pub gate: GateParams,
    /// How motors and encoders are wired.
    pub mount: Mount,
    /// For `--board arduino`.
    pub arduino: ArduinoParams,
    /// For `--board roomba`.
    pub roomba: RoombaParams,
    /// For `--board eddie`.
    pub eddie: EddieParams,
    /// For `--board orfa`.
    pub orfa: OrfaParams,
    /// For `--board dwm-text`.
    pub dwm_text: DwmTextParams,
}

/// How motors and encoders are wired. Everything that is said of sides elsewhere is meant after this.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mount {
    /// The board's left motor turns the right wheel.
    pub swapped_motors: bool,
    /// The board's left encoder counts the right wheel.
    pub swapped_encoders: bool,
    /// The motor runs backward when it shall run forward.
    pub inverted_motors: Sides<bool>,
    /// The encoder counts down when the wheel runs forward.
    pub inverted_encoders: Sides<bool>,
}

/// A servo.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ServoParams {
    /// Its number or pin on the board, 0 to 63.
    pub pin: u8,
    /// The smallest angle, -3.2 to 3.2 rad; 0 is its middle.
    pub min: Radians,
    /// The largest angle, not below `min`, to 3.2 rad.
    pub max: Radians,
}

/// What a wheel and its encoder measure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gauge {
    /// Diameter of each wheel, 0.005 to 2 m.
    pub diameter: Sides<Metres>,
    /// Counts of the encoder in one turn of the wheel, gears included, 1 to 1000000.
    pub turn: f64,
}

impl Gauge {
    const fn new(diameter: f64, turn: f64) -> Self {
        Self { diameter: Sides::new(Metres(diameter), Metres(diameter)), turn }
    }
    /// Distance of a wheel for one count: π d / n.
    #[must_use]
    pub fn tick(&self) -> Sides<Metres> {
        self.diameter.map(|diameter| diameter * (std::f64::consts::PI / self.turn))
    }
    fn check(&self, table: &str) -> Result<(), Refusal> {
        within(&format!("{table}.gauge.diameter.left in m"), self.diameter.left.0, 0.005, 2.0)?;
        within(&format!("{table}.gauge.diameter.right in m"), self.diameter.right.0, 0.005, 2.0)?;
        within(&format!("{table}.gauge.turn"), self.turn, 1.0, 1e6)
    }
}

/// An Arduino with ROSArduinoBridge.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArduinoParams {
    /// Bits in a second, 1200 to 2000000. The board names its own when it is greeted, and must name this.
    pub baud: u32,
    /// Frames of its speed controller in a second, 1 to 1000: speeds are said in counts a frame.
    pub frames: f64,
    /// Whether it is told powers of its motors, which a calibration makes of speeds, instead of speeds that it keeps by
    /// itself.
    pub powers: bool,
    /// Speed of a wheel at full power as long as nothing is calibrated, 0.001 to 20 m/s, and not below
    /// robot.wheel_speed. It counts where powers are told.
    pub full_speed: MetresPerSecond,
    /// Its wheels and encoders.
    pub gauge: Gauge,
}

/// The dialects of the Open Interface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Dialect {
    /// Create 2 and Roomba 600 and later: encoder counts in a stream.
    #[default]
    Create2,
    /// Create 1 and Roomba 500: distance and angle in a stream.
    Create1,
    /// Roomba 400: distance and angle, asked for; no speeds of wheels, but a speed and a radius.
    Roomba400,
}

/// iRobot Create or Roomba.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RoombaParams {
    /// Which Open Interface: create2, create1 or roomba400.
    pub dialect: Dialect,
    /// Bits in a second, 1200 to 2000000: 115200, and 57600 for the older dialects.
    pub baud: u32,
    /// Whether it drives without its own safety: in Safe mode it stops at cliffs, lifted wheels and the charger.
    pub full: bool,
    /// What it divides angles by: 1, or 0.324056 for Create 2 up to firmware 3.4.0; 0.1 to 10. Older dialects only.
    pub angle_scale: f64,
    /// Whether it is told powers of its motors, which a calibration makes of speeds, instead of speeds that it keeps by
    /// itself. The oldest dialect has no such command.
    pub powers: bool,
    /// Speed of a wheel at full power as long as nothing is calibrated, 0.001 to 20 m/s, and not below
    /// robot.wheel_speed. It counts where powers are told.
    pub full_speed: MetresPerSecond,
    /// Its wheels and encoders.
    pub gauge: Gauge,
}

/// Parallax Eddie.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EddieParams {
    /// Bits in a second, 1200 to 2000000.
    pub baud: u32,
    /// In how long a time a wheel that runs at speed 1 does one position, 0.1 to 10 s. The documents say 1 s, the
    /// firmware that can be read has 0.5 s.
    pub speed_time: Seconds,
    /// Positions in s² that it accelerates by, 1 to 2047. High, since the gate's setpoints are ramps already.
    pub acceleration: u16,
    /// Volts of the battery when its channel reads 5 V, 1 to 100.
    pub battery_scale: f64,
    /// Whether it is told powers of its motors, which a calibration makes of speeds, instead of speeds that it keeps by
    /// itself.
    pub powers: bool,
    /// Speed of a wheel at full power as long as nothing is calibrated, 0.001 to 20 m/s, and not below
    /// robot.wheel_speed. It counts where powers are told.
    pub full_speed: MetresPerSecond,
    /// Its wheels and encoders.
    pub gauge: Gauge,
}

/// An Open Robotics board by its serial gate. It measures nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OrfaParams {
    /// Bits in a second, 1200 to 2000000.
    pub baud: u32,
    /// Speed of a wheel at full power, 0.001 to 20 m/s, and not below robot.wheel_speed.
    pub full_speed: MetresPerSecond,
    /// Share of full power below which a wheel does not turn, 0 to 0.9; powers are fitted into what is above it.
    pub dead_band: f64,
}

/// A board that takes movements as text.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DwmTextParams {
    /// Bits in a second, 1200 to 2000000.
    pub baud: u32,
    /// After so long without a movement the board stops by itself, 0.05 to 2 s.
    pub watchdog: Seconds,
    /// Whether it is told powers of its motors, which a calibration makes of speeds, instead of speeds that it keeps by
    /// itself.
    pub powers: bool,
    /// Speed of a wheel at full power as long as nothing is calibrated, 0.001 to 20 m/s, and not below
    /// robot.wheel_speed. It counts where powers are told.
    pub full_speed: MetresPerSecond,
    /// Its wheels and encoders.
    pub gauge: Gauge,
}

impl Default for RobotParams {
    fn default() -> Self {
        Self {
            beat: Seconds(0.005),
            silence: Seconds(0.25),
            greeting: Seconds(5.0),
            calibrated: true,
            servos: Vec::new(),
            robot: Drivetrain::default(),
            gate: GateParams::default(),
            mount: Mount::default(),
            arduino: ArduinoParams::default(),
            roomba: RoombaParams::default(),
            eddie: EddieParams::default(),
            orfa: OrfaParams::default(),
            dwm_text: DwmTextParams::default(),
        }
    }
}
impl Default for ServoParams {
    fn default() -> Self {
        Self { pin: 0, min: Radians(-std::f64::consts::FRAC_PI_2), max: Radians(std::f64::consts::FRAC_PI_2) }
    }
}
impl Default for ArduinoParams {
    fn default() -> Self {
        Self {
            baud: 57_600,
            frames: 30.0,
            powers: false,
            full_speed: MetresPerSecond(1.2),
            gauge: Gauge::new(0.064, 1200.0),
        }
    }
}
impl Default for RoombaParams {
    fn default() -> Self {
        Self {
            dialect: Dialect::Create2,
            baud: 115_200,
            full: false,
            angle_scale: 1.0,
            powers: false,
            full_speed: MetresPerSecond(0.5),
            gauge: Gauge::new(0.072, 508.8),
        }
    }
}
impl Default for EddieParams {
    fn default() -> Self {
        Self {
            baud: 115_200,
            speed_time: Seconds(0.5),
            acceleration: 0x400,
            battery_scale: 20.0,
            powers: false,
            full_speed: MetresPerSecond(1.2),
            gauge: Gauge::new(0.1524, 144.0),
        }
    }
}
impl Default for OrfaParams {
    fn default() -> Self {
        Self { baud: 115_200, full_speed: MetresPerSecond(1.0), dead_band: 0.0 }
    }
}
impl Default for DwmTextParams {
    fn default() -> Self {
        Self {
            baud: 115_200,
            watchdog: Seconds(0.2),
            powers: false,
            full_speed: MetresPerSecond(1.2),
            gauge: Gauge::new(0.064, 1200.0),
        }
    }
}

fn check_baud(table: &str, baud: u32) -> Result<(), Refusal> {
    within(&format!("{table}.baud"), f64::from(baud), 1200.0, 2e6)
}

impl Bounds for RobotParams {
    fn check(&self) -> Result<(), Refusal> {
        within("beat in s", self.beat.0, 0.005, 0.02)?;
        within("silence in s", self.silence.0, 0.05, 1.0)?;
        within("greeting in s", self.greeting.0, 0.5, 30.0)?;
        if self.servos.len() > MOST_SERVOS {
            let (got, limit) = (self.servos.len() as u64, MOST_SERVOS as u64);
            return Err(Refusal::TooLarge { what: "servos".into(), got, limit });
        }
        for ServoParams { pin, min, max } in &self.servos {
            within("servos.pin", f64::from(*pin), 0.0, 63.0)?;
            within("servos.min in rad", min.0, -3.2, 3.2)?;
            within("servos.max in rad (not below min)", max.0, min.0, 3.2)?;
        }
        self.robot.check()?;
        self.gate.fits(&self.robot)?;
        check_baud("arduino", self.arduino.baud)?;
        within("arduino.frames", self.arduino.frames, 1.0, 1000.0)?;
        self.arduino.gauge.check("arduino")?;
        check_baud("roomba", self.roomba.baud)?;
        within("roomba.angle_scale", self.roomba.angle_scale, 0.1, 10.0)?;
        if self.roomba.powers && self.roomba.dialect == Dialect::Roomba400 {
            let why = "the dialect roomba400 has no command for powers; leave it false";
            return Err(Refusal::malformed("roomba.powers", why));
        }
        self.roomba.gauge.check("roomba")?;
        check_baud("eddie", self.eddie.baud)?;
        within("eddie.speed_time in s", self.eddie.speed_time.0, 0.1, 10.0)?;
        within("eddie.acceleration", f64::from(self.eddie.acceleration), 1.0, 2047.0)?;
        within("eddie.battery_scale in V", self.eddie.battery_scale, 1.0, 100.0)?;
        self.eddie.gauge.check("eddie")?;
        check_baud("orfa", self.orfa.baud)?;
        for (table, full_speed) in [
            ("arduino", self.arduino.full_speed),
            ("roomba", self.roomba.full_speed),
            ("eddie", self.eddie.full_speed),
            ("orfa", self.orfa.full_speed),
            ("dwm_text", self.dwm_text.full_speed),
        ] {
            within(&format!("{table}.full_speed in m/s"), full_speed.0, 1e-3, 20.0)?;
        }
        within("orfa.dead_band", self.orfa.dead_band, 0.0, 0.9)?;
        check_baud("dwm_text", self.dwm_text.baud)?;
        within("dwm_text.watchdog in s", self.dwm_text.watchdog.0, 0.05, 2.0)?;
        self.dwm_text.gauge.check("dwm_text")
    }
}

impl Params for RobotParams {
    const FILE: &'static str = include_str!("../../../deploy/params/robot.toml");
}

impl RobotParams {
    /// The protocol of a board of this kind.
    #[must_use]
    pub fn board(&self, kind: BoardKind) -> Box<dyn Board> {
        match kind {
            BoardKind::Arduino => Box::new(Arduino::new(self.arduino, &self.servos)),
            BoardKind::Roomba => Box::new(Roomba::new(self.roomba, self.robot.track)),
            BoardKind::Eddie => Box::new(Eddie::new(self.eddie)),
            BoardKind::Orfa => Box::new(Orfa::new(self.orfa)),
            BoardKind::DwmText => Box::new(DwmText::new(self.dwm_text, &self.servos)),
        }
    }
    /// Whether this board is told powers, and not speeds that it keeps by itself.
    #[must_use]
    pub const fn powers(&self, kind: BoardKind) -> bool {
        match kind {
            BoardKind::Arduino => self.arduino.powers,
            BoardKind::Roomba => self.roomba.powers,
            BoardKind::Eddie => self.eddie.powers,
            BoardKind::Orfa => true,
            BoardKind::DwmText => self.dwm_text.powers,
        }
    }
    /// The speed of a wheel that a full signal stands for as long as nothing is calibrated: that at full power, or a
    /// fifth more than the gate lets through where the board keeps speeds, so that what it lacks can be made up for.
    #[must_use]
    pub fn full_speed(&self, kind: BoardKind) -> MetresPerSecond {
        match kind {
            BoardKind::Arduino if self.arduino.powers => self.arduino.full_speed,
            BoardKind::Roomba if self.roomba.powers => self.roomba.full_speed,
            BoardKind::Eddie if self.eddie.powers => self.eddie.full_speed,
            BoardKind::Orfa => self.orfa.full_speed,
            BoardKind::DwmText if self.dwm_text.powers => self.dwm_text.full_speed,
            _ => self.robot.wheel_speed * 1.2,
        }
    }
    /// Refuses a gate that lets through what no power of this board gives.
    ///
    /// # Errors
    /// Names both numbers.
    pub fn fits(&self, kind: BoardKind) -> Result<(), Refusal> {
        let (full, most) = (self.full_speed(kind), self.robot.wheel_speed);
        let field = format!("robot.wheel_speed in m/s, beside full_speed of {}", kind.name());
        within(&field, most.0, 0.0, full.0)
    }
    /// Bits in a second on the line of this board; eight bits, no parity, one stop bit.
    #[must_use]
    pub const fn baud(&self, kind: BoardKind) -> u32 {
        match kind {
            BoardKind::Arduino => self.arduino.baud,
            BoardKind::Roomba => self.roomba.baud,
            BoardKind::Eddie => self.eddie.baud,
            BoardKind::Orfa => self.orfa.baud,
            BoardKind::DwmText => self.dwm_text.baud,
        }
    }
    /// Distance of a wheel for one count of this board.
    #[must_use]
    pub fn tick(&self, kind: BoardKind) -> Sides<Metres> {
        match kind {
            BoardKind::Arduino | BoardKind::Orfa => self.arduino.gauge.tick(),
            BoardKind::Roomba => self.roomba.gauge.tick(),
            BoardKind::Eddie => self.eddie.gauge.tick(),
            BoardKind::DwmText => self.dwm_text.gauge.tick(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_file_holds_every_default() {
        let file: toml::Table = toml::from_str(RobotParams::FILE).expect("a table");
        assert_eq!(file, toml::Table::try_from(RobotParams::default()).expect("a table"));
        RobotParams::default().check().expect("within their ranges");
    }

    #[test]
    fn what_is_unknown_or_out_of_range_is_refused() {
        for text in ["tick = 1", "[roomba]\ndialect = \"create3\"", "[mount]\nswapped = true", "beat = nan"] {
            assert!(toml::from_str::<RobotParams>(text).is_err(), "{text:?} is refused");
        }
        for text in [
            "beat = 0.1",
            "silence = 5",
            "servos = [{ min = 1, max = 0 }]",
            "servos = [{}, {}, {}, {}, {}]",
            "[arduino]\nbaud = 9",
            "[roomba]\nangle_scale = 0",
            "[eddie]\nacceleration = 0",
            "[orfa]\ndead_band = 1.0",
            "[dwm_text]\nwatchdog = 10",
            "[eddie]\nfull_speed = 0",
            "[roomba]\npowers = true\ndialect = \"roomba400\"",
            "[arduino.gauge]\ndiameter = { left = 0, right = 0.1 }\nturn = 1",
        ] {
            let params: RobotParams = toml::from_str(text).unwrap_or_else(|why| panic!("{text:?}: {why}"));
            assert!(params.check().is_err(), "{text:?} is refused");
        }
        assert!(BoardKind::parse("roomba").is_ok());
        let unknown = BoardKind::parse("hoover").expect_err("no such board").to_string();
        assert!(unknown.contains("hoover") && unknown.contains("dwm-text"), "{unknown}");
    }
}
