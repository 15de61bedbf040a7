//! The calibration in the process that owns the wheels: what stands between the gate and the motors.
//!
//! The gate stays the only door. What a calibration changes is the signal that a speed of the gate becomes, and the
//! distance that a count becomes. Whoever measures needs motors without a calibration: for that it asks for a lease as
//! everybody does, and then for its speeds to be taken raw, as shares of the full signal. Limits, expiry, echo and AllStop
//! stay as they are, and the calibration is back as soon as the lease has ended and the wheels stand.

use super::board::Paced;
use anyhow::Context as _;
use axle_calibrator::Map;
use axle_gate::Gate;
use axle_mesh::{Asked, Mesh, Server};
use axle_schema::calibration::{Calibrate, Calibrated, GetCalibration, Raw};
use axle_schema::command::{Done, Motion};
use axle_schema::{
    Boot, Calibration, Drivetrain, Duty, EncodersData, Metres, MetresPerSecond, Refusal, RobotId, Seconds,
    Sides, Signals, SignalsData, key,
};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A file of more bytes than this is no calibration.
const LARGEST: u64 = 64 * 1024;

/// Where the calibration of a robot is kept.
#[derive(Clone, Debug)]
pub(crate) struct Shelf {
    directory: PathBuf,
    robot: RobotId,
}

impl Shelf {
    pub(crate) fn new(directory: &Path, robot: &RobotId) -> Self {
        Self { directory: directory.to_owned(), robot: robot.clone() }
    }
    /// The file of the calibration in force, or of an older one.
    fn path(&self, version: Option<u32>) -> PathBuf {
        let name = match version {
            None => format!("{}.calibration.toml", self.robot),
            Some(version) => format!("{}.calibration.{version}.toml", self.robot),
        };
        self.directory.join(name)
    }
    /// Reads what is kept, if there is anything.
    ///
    /// # Errors
    /// When the file cannot be read or is no calibration: a robot must not drive by half of one.
    pub(crate) fn read(&self) -> anyhow::Result<Option<Calibration>> {
        read(&self.path(None))
    }
    /// Keeps a calibration; the one before stays beside it, under its number.
    ///
    /// # Errors
    /// When the directory cannot be written.
    pub(crate) fn keep(&self, calibration: &Calibration) -> anyhow::Result<()> {
        let path = self.path(None);
        let text = toml::to_string(calibration).context("write the calibration as TOML")?;
        std::fs::create_dir_all(&self.directory)
            .with_context(|| format!("make {}", self.directory.display()))?;
        if let Ok(Some(before)) = self.read() {
            let older = self.path(Some(before.version));
            std::fs::copy(&path, &older).with_context(|| format!("keep {}", older.display()))?;
        }
        // Renamed when it is whole, so that a crash leaves the old one or the new one.
        let draft = path.with_extension("draft");
        std::fs::write(&draft, text).with_context(|| format!("write {}", draft.display()))?;
        std::fs::rename(&draft, &path).with_context(|| format!("write {}", path.display()))
    }
}

/// Reads a calibration; none where there is no file.
pub(crate) fn read(path: &Path) -> anyhow::Result<Option<Calibration>> {
    let described = || format!("read the calibration {}", path.display());
    match std::fs::metadata(path) {
        Err(fault) if fault.kind() == ErrorKind::NotFound => return Ok(None),
        Err(fault) => return Err(fault).with_context(described),
        Ok(metadata) => anyhow::ensure!(
            metadata.len() <= LARGEST,
            "{} is no calibration: it has {} bytes",
            path.display(),
            metadata.len()
        ),
    }
    let text = std::fs::read_to_string(path).with_context(described)?;
    let calibration: Calibration = toml::from_str(&text).with_context(described)?;
    calibration.validate().with_context(described)?;
    Ok(Some(calibration))
}

/// What an owner of wheels is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facts {
    /// The speed of a wheel that a full signal stands for as long as nothing is calibrated.
    pub(crate) full_speed: MetresPerSecond,
    /// Whether a calibration is applied.
    pub(crate) calibrated: bool,
    /// Whether signals are speeds that a board keeps by itself.
    pub(crate) keeps_speeds: bool,
    /// Signals are said so often at most.
    pub(crate) hz: f64,
}

/// The calibration of an owner of wheels, and its lines.
pub(crate) struct Tuning {
    robot: Drivetrain,
    full_speed: MetresPerSecond,
    keeps_speeds: bool,
    boot: Boot,
    /// None where calibrations are kept but not applied.
    map: Option<Map>,
    is_applied: bool,
    shelf: Shelf,
    /// The lease whose speeds are taken raw.
    raw: Option<u32>,
    /// When, and at which speeds of the gate, the latest signals were given.
    last: (Seconds, Sides<MetresPerSecond>),
    signals: Signals,
    /// What a board has really given to its motors, where it tells.
    given: Option<Signals>,
    /// What was covered beyond what the map says, so that nothing jumps when the map changes.
    offset: Sides<Metres>,
    counted: Sides<Metres>,
    asks: Server<GetCalibration, Calibrated>,
    news: Server<Calibrate, Done>,
    raws: Server<Raw, Done>,
    motors: Paced<SignalsData>,
}

impl Tuning {
    /// Reads what is kept for this robot.
    pub(crate) fn new(
        mesh: &Mesh,
        shelf: Shelf,
        robot: Drivetrain,
        Facts { full_speed, calibrated: is_applied, keeps_speeds, hz }: Facts,
    ) -> anyhow::Result<Self> {
        let kept = if is_applied { shelf.read()? } else { None };
        if let Some(kept) = &kept {
            tracing::info!("calibration {} is applied; {}", kept.version, kept.made);
        }
        let id = &shelf.robot;
        Ok(Self {
            map: kept.map(|kept| Map::new(kept, robot.track)).transpose()?,
            is_applied,
            robot,
            full_speed,
            keeps_speeds,
            boot: mesh.boot(),
            raw: None,
            last: (Seconds::ZERO, Sides::default()),
            signals: Signals::default(),
            given: None,
            offset: Sides::default(),
            counted: Sides::default(),
            asks: mesh.server(&key::CALIBRATION.of(Some(id)))?,
            news: mesh.server(&key::CALIBRATE.of(Some(id)))?,
            raws: mesh.server(&key::RAW.of(Some(id)))?,
            motors: Paced::new(mesh.publisher(&key::MOTORS.of(id))?, hz),
            shelf,
        })
    }

    /// Answers what is asked, and ends what has ended with its lease.
    pub(crate) fn hear(&mut self, gate: &Gate) {
        if self.raw.is_some() && self.raw != gate.leased() && gate.motion() == Motion::Standing {
            self.raw = None;
        }
        while let Some(asked) = self.asks.try_next() {
            let calibration = self.map.as_ref().map(|map| map.calibration().clone()).unwrap_or_default();
            let Drivetrain { track, wheel_speed, wheel_acceleration, .. } = self.robot;
            let (full_speed, keeps_speeds) = (self.full_speed, self.keeps_speeds);
            let answer =
                Calibrated { calibration, full_speed, track, wheel_speed, wheel_acceleration, keeps_speeds };
            let question = asked.question();
            asked.reply(question.map(|_| answer));
        }
        while let Some(asked) = self.raws.try_next() {
            let raw =
                asked.question().and_then(|raw| self.holds(gate, raw.boot, raw.epoch).map(|()| raw.epoch));
            if let Ok(epoch) = raw {
                self.raw = Some(epoch);
            }
            asked.reply(raw.map(|_| Done {}));
        }
        while let Some(asked) = self.news.try_next() {
            match asked.question().and_then(|news| self.apply(gate, news)) {
                Ok(calibration) => self.keep(asked, calibration),
                Err(refusal) => asked.reply(Err(refusal)),
            }
        }
    }

    /// Whether this is the lease in force, and the wheels stand.
    fn holds(&self, gate: &Gate, boot: Boot, epoch: u32) -> Result<(), Refusal> {
        if boot != self.boot || gate.leased() != Some(epoch) {
            return Err(Refusal::Fenced {
                why: "this is not the lease in force; ask the gate for the wheels".into(),
            });
        }
        if gate.motion() == Motion::Standing || gate.state(self.last.0).wheels == Sides::default() {
            return Ok(());
        }
        Err(Refusal::Failed { why: "the wheels move; a calibration changes while they stand".into() })
    }

    fn apply(&mut self, gate: &Gate, news: Calibrate) -> Result<Calibration, Refusal> {
        self.holds(gate, news.boot, news.epoch)?;
        let map = Map::new(news.calibration.clone(), self.robot.track)?;
        if self.is_applied {
            let before = self.covered(self.counted);
            self.map = Some(map);
            let now = self.covered(self.counted);
            let jump = before.zip(now, |before, now| before - now);
            self.offset = self.offset.zip(jump, |offset, jump| offset + jump);
        }
        Ok(news.calibration)
    }

    /// Keeps it on a thread of its own, since a beat never waits for a disk; answers when it is kept.
    fn keep(&self, asked: Asked<Calibrate, Done>, calibration: Calibration) {
        let shelf = self.shelf.clone();
        let keeping = std::thread::Builder::new().name("calibration".into()).spawn(move || {
            let kept = shelf.keep(&calibration).map_err(|fault| Refusal::Failed {
                why: format!("it is applied, but will be lost at the next start: {fault:#}"),
            });
            asked.reply(kept.map(|()| Done {}));
        });
        if let Err(fault) = keeping {
            tracing::warn!("the calibration could not be kept: {fault}");
        }
    }

    /// The speeds that a nominal robot would be asked for by the signals that these speeds of the gate need now.
    pub(crate) fn setpoints(
        &mut self,
        now: Seconds,
        speeds: Sides<MetresPerSecond>,
    ) -> Sides<MetresPerSecond> {
        let (then, before) = std::mem::replace(&mut self.last, (now, speeds));
        match &self.map {
            Some(map) if self.raw.is_none() => {
                let span = (now - then).max(Seconds(1e-3));
                self.signals = map.signals(speeds, speeds.zip(before, |to, from| (to - from) / span));
                let full = self.full_speed;
                Sides::new(full * self.signals.left.get(), full * self.signals.right.get())
            }
            _ => {
                let share = |speed: MetresPerSecond| {
                    Duty::new((speed / self.full_speed).clamp(-1.0, 1.0)).unwrap_or_default()
                };
                self.signals = Signals { left: share(speeds.left), right: share(speeds.right) };
                speeds
            }
        }
    }

    fn covered(&self, counted: Sides<Metres>) -> Sides<Metres> {
        let covered = self.map.as_ref().map_or(counted, |map| map.distances(counted));
        covered.zip(self.offset, |covered, offset| covered + offset)
    }

    /// What a board has really given to its motors: whole numbers, that are rounded.
    pub(crate) const fn gave(&mut self, signals: Signals) {
        self.given = Some(signals);
    }

    /// What is given to the motors now, of a robot whose encoders say nothing.
    pub(crate) fn say_signals(&mut self, now: Seconds) {
        self.say_motors(now, None);
    }

    fn say_motors(&mut self, stamp: Seconds, counted: Option<Sides<Metres>>) {
        let Signals { left, right } = self.given.unwrap_or(self.signals);
        self.motors.put(stamp, None, || SignalsData { stamp, left, right, counted });
    }

    /// What the robot says that its wheels have covered, where its encoders have counted this; says both.
    pub(crate) fn say(&mut self, counted: EncodersData) -> EncodersData {
        self.counted = Sides::new(counted.left, counted.right);
        self.say_motors(counted.stamp, Some(self.counted));
        let Sides { left, right } = self.covered(self.counted);
        EncodersData { left, right, ..counted }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_calibrations_before_stay_beside_the_one_in_force_and_half_a_file_is_refused() {
        let directory = std::env::temp_dir().join(format!("axle-shelf-{}", std::process::id()));
        let shelf = Shelf::new(&directory, &RobotId::new("r1").expect("a robot"));
        assert_eq!(shelf.read().expect("nothing yet"), None);
        for version in 1..=3 {
            shelf.keep(&Calibration { version, ..Calibration::default() }).expect("kept");
        }
        let version = |path: PathBuf| read(&path).expect("read").map(|calibration| calibration.version);
        assert_eq!(version(shelf.path(None)), Some(3));
        assert_eq!(version(shelf.path(Some(2))), Some(2));
        assert_eq!(version(shelf.path(Some(1))), Some(1));
        assert_eq!(version(shelf.path(Some(3))), None);
        for wrong in ["version = ", "versoin = 1", "[wheels.left.forward]\nkv = 0.0"] {
            std::fs::write(shelf.path(None), wrong).expect("written");
            let said = format!("{:#}", shelf.read().expect_err(wrong));
            assert!(said.contains("r1.calibration.toml"), "{said}");
        }
        std::fs::remove_dir_all(&directory).expect("the directory");
    }
}
