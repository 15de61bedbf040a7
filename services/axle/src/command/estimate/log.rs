//! A log of measurements: JSON lines, or a recording.
//!
//! The first line may say where the robot starts and how wide it is: `{"start":{"x","y","heading"},"track":0.3}`. Every
//! other line has a stamp and one or more of `encoders`, `gyro` (and beside it `ax`), `fix`, `range` and `truth`.

use crate::lines::Lines;
use crate::out::{note, usage};
use crate::unread::Unread;
use axle_navigator::{Measurement, NavigatorParams, Range};
use axle_recorder::{Entry, Recorded, Recording};
use axle_schema::codec::decode_as;
use axle_schema::{
    EncodersData, Fix, HeadingFix, InertialData, Message, Metres, MetresPerSecondSquared, NavigatorData,
    Numbers, Pose, Radians, RadiansPerSecond, Refusal, Seconds, Track, key,
};
use serde::Deserialize;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// What an MCAP file begins with; no JSON does.
const MCAP: [u8; 5] = *b"\x89MCAP";
/// The most items that are kept: some hours at 100 Hz.
const MOST: usize = 4_000_000;

/// Where the robot really was.
#[derive(Clone, Copy, Debug)]
pub(super) struct Truth {
    pub(super) stamp: f64,
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) heading: Option<f64>,
}

/// A measurement, or what to compare with.
#[derive(Clone, Copy, Debug)]
pub(super) enum Item {
    Measured(Measurement),
    Truth(Truth),
}

/// In the order in which it came.
#[derive(Debug, Default)]
pub(super) struct Log {
    pub(super) items: Vec<Item>,
    pub(super) lines: u64,
    pub(super) bad: u64,
}

/// A line of any kind: the first one has no stamp.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    start: Option<Pose>,
    track: Option<Track>,
    stamp: Option<Seconds>,
    encoders: Option<Wheels>,
    gyro: Option<RadiansPerSecond>,
    ax: Option<MetresPerSecondSquared>,
    fix: Option<Position>,
    range: Option<Distance>,
    truth: Option<There>,
}
#[derive(Deserialize)]
struct Wheels {
    left: Metres,
    right: Metres,
}
#[derive(Deserialize)]
struct Position {
    x: Metres,
    y: Metres,
    sd: Metres,
    heading: Option<Radians>,
    heading_sd: Option<Radians>,
}
#[derive(Deserialize)]
struct Distance {
    x: Metres,
    y: Metres,
    distance: Metres,
    sd: Metres,
}
#[derive(Deserialize)]
struct There {
    x: Metres,
    y: Metres,
    heading: Option<Radians>,
}

impl Log {
    /// Reads everything; what the log says of the robot goes into `params`.
    pub(super) fn open(file: &str, params: &mut NavigatorParams) -> anyhow::Result<Self> {
        if file == "-" {
            return Self::lines(io::stdin().lock(), params);
        }
        let failed = |fault: io::Error| usage(format!("cannot read {file}: {fault}"));
        let mut magic = Vec::new();
        let input = File::open(file).map_err(failed)?;
        input.take(MCAP.len() as u64).read_to_end(&mut magic).map_err(failed)?;
        if magic == MCAP {
            return Self::recording(Path::new(file), params);
        }
        Self::lines(File::open(file).map_err(failed)?, params)
    }

    pub(super) fn lines(input: impl Read, params: &mut NavigatorParams) -> anyhow::Result<Self> {
        let (mut log, mut lines) = (Self::default(), Lines::new(input));
        while let Some(line) = lines.read_as()? {
            if let Err(why) = line.and_then(|line| log.line(line, params)) {
                log.bad += 1;
                note(&format!("line {}: {why}", lines.number()));
            }
        }
        log.lines = lines.number();
        Ok(log)
    }

    fn line(&mut self, line: Line, params: &mut NavigatorParams) -> Result<(), String> {
        let Line { start, track, stamp, encoders, gyro, ax, fix, range, truth } = line;
        let Some(stamp) = stamp else {
            if !self.items.is_empty() || encoders.is_some() || gyro.is_some() {
                return Err("missing field `stamp`".into());
            }
            params.start = start.unwrap_or(params.start);
            params.robot.track = track.unwrap_or(params.robot.track);
            return Ok(());
        };
        if start.is_some() || track.is_some() {
            return Err("start and track stand in a line of their own, without a stamp".into());
        }
        if ax.is_some() && gyro.is_none() {
            return Err("ax stands beside gyro".into());
        }
        // The gyro is before the encoders: so a span finds the angle that belongs to it.
        let inertial = gyro.map(|gyro| Measurement::Inertial(InertialData { stamp, gyro, ax, ay: None }));
        let encoders =
            encoders.map(|Wheels { left, right }| Measurement::Encoders(EncodersData { stamp, left, right }));
        let fix = fix.map(|fix| Measurement::Fix(fix.at(stamp)));
        let range = range
            .map(|Distance { x, y, distance, sd }| Measurement::Range(Range { stamp, x, y, distance, sd }));
        let measured = [inertial, encoders, fix, range];
        if measured.iter().all(Option::is_none) && truth.is_none() {
            return Err("nothing but a stamp: encoders, gyro, fix, range or truth is missing".into());
        }
        if let Some(wrong) = measured.iter().flatten().find(|measurement| !measurement.is_sound()) {
            return Err(format!("{wrong:?} is not sound: an sd must be above 0, and no number beyond 1e9"));
        }
        self.items.extend(measured.into_iter().flatten().map(Item::Measured));
        self.items.extend(truth.map(|truth| {
            let heading = truth.heading.map(|heading| heading.0);
            Item::Truth(Truth { stamp: stamp.0, x: truth.x.0, y: truth.y.0, heading })
        }));
        if self.items.len() > MOST { Err(format!("more than {MOST} measurements")) } else { Ok(()) }
    }

    fn recording(path: &Path, params: &mut NavigatorParams) -> anyhow::Result<Self> {
        let mut recording = Recording::open(path)?;
        let (mut log, mut robot, mut unread) = (Self::default(), None, Unread::default());
        for entry in recording.by_ref() {
            let Entry::Sample(sample) = entry else { continue };
            log.lines += 1;
            match log.sample(&sample, &mut robot) {
                Ok(()) if log.items.len() < MOST => {}
                Ok(()) => log.bad += 1,
                Err(refusal) => {
                    log.bad += 1;
                    unread.add(&sample.key, &refusal);
                }
            }
        }
        if let Some(why) = &recording.account().cut {
            note(&format!("the recording is cut off: {why}"));
        }
        unread.words().inspect(|words| note(words));
        // An emulated robot says where it starts; of another one the parameters do.
        if let Some(Item::Truth(Truth { x, y, heading: Some(heading), .. })) =
            log.items.iter().find(|item| matches!(item, Item::Truth(_)))
        {
            params.start = Pose::new(*x, *y, *heading);
        }
        Ok(log)
    }

    fn sample(&mut self, sample: &Recorded, robot: &mut Option<String>) -> Result<(), Refusal> {
        fn decoded<M: Message>(sample: &Recorded) -> Result<M, Refusal> {
            decode_as(&sample.encoding, &sample.payload)
        }
        let Some(place) = key::place(&sample.key) else { return Ok(()) };
        let item = match (place.service, place.name) {
            _ if robot.as_deref().is_some_and(|robot| robot != place.robot) => return Ok(()),
            ("robot", "encoders") => Item::Measured(Measurement::Encoders(decoded(sample)?)),
            ("robot", "inertial") => Item::Measured(Measurement::Inertial(decoded(sample)?)),
            ("robot", "fix") => Item::Measured(Measurement::Fix(decoded(sample)?)),
            ("robot", "range") => Item::Measured(Measurement::Range(decoded(sample)?)),
            ("emulator", "truth") => {
                let NavigatorData { stamp, pose, .. } = decoded(sample)?;
                let heading = Some(pose.heading.0);
                Item::Truth(Truth { stamp: stamp.0, x: pose.x.0, y: pose.y.0, heading })
            }
            _ => return Ok(()),
        };
        robot.get_or_insert_with(|| place.robot.to_owned());
        self.items.push(item);
        Ok(())
    }

    pub(super) fn truths(&self) -> impl Iterator<Item = &Truth> {
        self.items.iter().filter_map(|item| match item {
            Item::Truth(truth) => Some(truth),
            Item::Measured(_) => None,
        })
    }
}

impl Position {
    fn at(self, stamp: Seconds) -> Fix {
        let variance = self.sd.0 * self.sd.0;
        // A heading without a word on how good it is counts as a rough one.
        let heading = self
            .heading
            .map(|angle| HeadingFix { angle, variance: self.heading_sd.unwrap_or(Radians(0.1)).0.powi(2) });
        Fix { stamp, x: self.x, y: self.y, covariance: Numbers([variance, 0.0, 0.0, variance]), heading }
    }
}
