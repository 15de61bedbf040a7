//! `axle calibrate --recording`: what the motors of a recorded robot do after a step, for the emulator to play.

use super::Args;
use crate::out::{data, note, usage};
use crate::settings::Settings;
use crate::unread::Unread;
use axle_calibrator::response::{self, MAX_DEGREE, Response};
use axle_recorder::{Entry, Recording};
use axle_schema::codec::decode_as;
use axle_schema::refusal::within;
use axle_schema::{SignalsData, key};
use std::path::Path;

/// The most samples that are kept: an hour at 100 Hz.
const MOST: usize = 400_000;
/// How many readings before the first movement are looked at.
const BEFORE: usize = 25;

/// Fits both wheels and prints the numbers as the parameters of the emulator.
pub(super) fn fit(path: &Path, settings: &Settings, args: &Args) -> anyhow::Result<()> {
    within("--response in s", args.response, 0.05, 2.0).map_err(usage)?;
    within("--full-speed in m/s", args.full_speed, 1e-3, 24.0).map_err(usage)?;
    let samples = read(path, settings)?;
    let moving = samples.iter().position(|data| data.left.get() != 0.0 || data.right.get() != 0.0);
    let from = moving.unwrap_or(0).saturating_sub(BEFORE);
    let samples = samples.get(from..).unwrap_or_default();
    let wheel = |signal: fn(&SignalsData) -> f64, count: fn(&SignalsData) -> Option<f64>| {
        let asked: Vec<(f64, f64)> =
            samples.iter().map(|data| (data.stamp.0, signal(data) * args.full_speed)).collect();
        let covered: Vec<(f64, f64)> =
            samples.iter().filter_map(|data| Some((data.stamp.0, count(data)?))).collect();
        response::fit(&asked, &covered, args.response, MAX_DEGREE)
    };
    let left = wheel(|data| data.left.get(), |data| Some(data.counted?.left.0));
    let right = wheel(|data| data.right.get(), |data| Some(data.counted?.right.0));
    let (Some(left), Some(right)) = (left, right) else {
        anyhow::bail!(
            "{} tells nothing of the motors: it needs axle/ROBOT/robot/motors of a robot that begins at rest and changes its \
             speeds several times",
            path.display()
        );
    };
    print(args, &left, &right)
}

fn print(args: &Args, left: &Response, right: &Response) -> anyhow::Result<()> {
    note(&format!(
        "between two readings {:.2} and {:.2} mm are left on average",
        left.left * 1000.0,
        right.left * 1000.0
    ));
    if args.json {
        let line = serde_json::json!({
            "time_s": left.time, "left": left.coefficients, "right": right.coefficients,
            "left_over_m": left.left, "right_over_m": right.left,
        });
        return Ok(data(&line.to_string())?);
    }
    data("# For the parameters of an emulator.")?;
    data("[motors.response]")?;
    data(&format!("time = {:?}", left.time))?;
    data(&format!("left = {:?}", left.coefficients))?;
    Ok(data(&format!("right = {:?}", right.coefficients))?)
}

/// What was said of the motors of one robot.
fn read(path: &Path, settings: &Settings) -> anyhow::Result<Vec<SignalsData>> {
    let mut samples: Vec<SignalsData> = Vec::new();
    let mut robot = settings.robot.as_ref().map(ToString::to_string);
    let mut unread = Unread::default();
    for entry in Recording::open(path)?.by_ref() {
        let Entry::Sample(sample) = entry else { continue };
        let Some(place) = key::place(&sample.key) else { continue };
        if (place.service, place.name) != ("robot", "motors")
            || robot.get_or_insert_with(|| place.robot.to_owned()) != place.robot
        {
            continue;
        }
        match decode_as::<SignalsData>(&sample.encoding, &sample.payload) {
            // A robot that was started anew counts anew: only its first run is looked at.
            Ok(data) if samples.len() < MOST && samples.last().is_none_or(|last| data.stamp > last.stamp) => {
                samples.push(data);
            }
            Ok(_) => {}
            Err(refusal) => unread.add(&sample.key, &refusal),
        }
    }
    unread.words().inspect(|words| note(words));
    Ok(samples)
}
