//! `axle bench record`: how many messages a second one core records, and what a kill leaves of a recording.
//!
//! Each kill hits a process of its own that records as the recorder does, at another moment of its flush period. The
//! file that it leaves must open, and may lack no more than the last second.

use crate::out::{data, table};
use anyhow::Context as _;
use axle_mesh::clock::wall_nanoseconds;
use axle_recorder::{Entry, Recorder, RecorderParams, Recording, Sample, Series};
use axle_schema::meta::Meta;
use axle_schema::{Boot, EncodersData, Metres, Seconds, encode};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Messages of the measurement.
const MESSAGES: u64 = 400_000;
/// Streams that they belong to.
const STREAMS: u64 = 40;
/// The pace of the process that is killed: as many messages at a time, so often.
const PACE: (u64, Duration) = (50, Duration::from_millis(10));
/// Processes that are killed at a time.
const AT_A_TIME: u32 = 4;
/// The last instant of a kill after the first flush, in ms: more than a period.
const LATEST: u32 = 1300;

/// What a killed recorder left.
struct Left {
    opens: bool,
    /// What is missing at its end, in s.
    lost: f64,
}

/// Measures, kills, and prints.
pub(crate) fn record(json: bool, kills: u32) -> anyhow::Result<()> {
    let directory = std::env::temp_dir().join(format!("axle-bench-record-{}", std::process::id()));
    std::fs::create_dir_all(&directory).context("make a directory")?;
    let outcome = measure(&directory).and_then(|rate| Ok((rate, kill_all(&directory, kills)?)));
    // What cannot be removed is left to the system's own cleaning.
    drop(std::fs::remove_dir_all(&directory));
    let (rate, left) = outcome?;
    let opened = left.iter().filter(|left| left.opens).count();
    let lost = left.iter().map(|left| left.lost).fold(0.0, f64::max);
    if json {
        let line = serde_json::json!({
            "messages_per_second": rate, "kills": kills, "opened": opened, "lost_max_s": lost,
        });
        return Ok(data(&line.to_string())?);
    }
    let rows = [
        ["messages a second on one core".to_owned(), format!("{rate:.0}")],
        ["recorders killed".to_owned(), kills.to_string()],
        ["files that open".to_owned(), opened.to_string()],
        ["lost at most".to_owned(), format!("{lost:.3} s")],
    ];
    Ok(table(&["what", "value"], rows.map(Vec::from))?)
}

fn sample_bytes(number: u64) -> anyhow::Result<(Vec<u8>, Vec<u8>)> {
    #[allow(clippy::cast_precision_loss, reason = "a number of a bench")]
    let stamp = number as f64 / 1000.0;
    let data = EncodersData { stamp: Seconds(stamp), left: Metres(stamp * 0.3), right: Metres(stamp / 7.0) };
    let meta = Meta { seq: number, source: Boot(7), stamp: 1.7e9 + stamp, cause: None };
    Ok((encode(&data)?, encode(&meta)?))
}

/// Messages a second, written and synced as the recorder does it.
#[allow(clippy::cast_precision_loss, reason = "a rate")]
fn measure(directory: &Path) -> anyhow::Result<f64> {
    let keys: Vec<_> = (0..STREAMS).map(|stream| format!("bench/{stream}")).collect();
    let samples = (0..1000).map(sample_bytes).collect::<anyhow::Result<Vec<_>>>()?;
    let path = directory.join("rate.mcap");
    let began = Instant::now();
    let mut recorder =
        Recorder::create(&path, &BTreeMap::new(), &RecorderParams::default(), wall_nanoseconds())?;
    for (number, key) in (0..MESSAGES).zip(keys.iter().cycle()) {
        let index = usize::try_from(number % 1000)?;
        let Some((payload, attachment)) = samples.get(index) else { continue };
        let received = wall_nanoseconds();
        let encoding = "application/cbor;axle.EncodersData.v1";
        recorder.write(Sample { key, encoding, payload, attachment: Some(attachment), received })?;
        if number.is_multiple_of(1000) {
            recorder.flush_if_due(received)?;
        }
    }
    recorder.finish()?;
    Ok(MESSAGES as f64 / began.elapsed().as_secs_f64())
}

/// Kills so many recorders, a few at a time.
fn kill_all(directory: &Path, kills: u32) -> anyhow::Result<Vec<Left>> {
    let mut left = Vec::new();
    let numbers: Vec<u32> = (0..kills).collect();
    for some in numbers.chunks(AT_A_TIME as usize) {
        let threads: Vec<_> = some
            .iter()
            .map(|number| {
                // A step that has no common divisor with the range: the moments lie everywhere in it.
                let moment = Duration::from_millis((u64::from(*number) * 137) % u64::from(LATEST));
                let path = directory.join(format!("{number}.mcap"));
                std::thread::spawn(move || kill_one(&path, moment))
            })
            .collect();
        for thread in threads {
            left.push(thread.join().map_err(|_| anyhow::anyhow!("a thread of the bench broke down"))??);
        }
    }
    Ok(left)
}

fn kill_one(path: &PathBuf, moment: Duration) -> anyhow::Result<Left> {
    let mut child = Command::new(std::env::current_exe()?)
        .arg("bench-recorder")
        .arg(path)
        .stdin(Stdio::null())
        .spawn()
        .context("start a recorder")?;
    // From the first flush on, so that the moment is one of its period, however slow the start was.
    let patience = Instant::now() + Duration::from_secs(20);
    while !std::fs::metadata(path).is_ok_and(|file| file.len() > 0) {
        anyhow::ensure!(Instant::now() < patience, "the recorder did not begin");
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(moment);
    let at = wall_nanoseconds();
    child.kill()?;
    child.wait()?;
    let began = std::fs::metadata(path)?.created().ok();
    let Ok(mut recording) = Recording::open(path) else { return Ok(Left { opens: false, lost: 0.0 }) };
    let last = recording.by_ref().filter_map(|entry| match entry {
        Entry::Sample(sample) => Some(sample.received),
        _ => None,
    });
    // A recorder that is killed within its first period may have nothing yet; then all of its life is lost.
    let born = began.and_then(|began| began.duration_since(std::time::UNIX_EPOCH).ok());
    let born = born.and_then(|born| u64::try_from(born.as_nanos()).ok()).unwrap_or(at);
    let last = last.max().unwrap_or(born);
    let lost = Duration::from_nanos(at.saturating_sub(last)).as_secs_f64();
    std::fs::remove_file(path)?;
    Ok(Left { opens: recording.account().damaged == 0, lost })
}

/// The process that is killed: records for ever, as the recorder does.
pub(crate) fn be_killed(path: &Path) -> anyhow::Result<()> {
    let mut series = Series::create(path, BTreeMap::new(), RecorderParams::default(), wall_nanoseconds())?;
    let mut number = 0;
    loop {
        for _ in 0..PACE.0 {
            let (payload, attachment) = sample_bytes(number)?;
            let received = wall_nanoseconds();
            let encoding = "application/cbor;axle.EncodersData.v1";
            let (payload, attachment) = (&payload[..], Some(&attachment[..]));
            series.write(Sample { key: "bench/0", encoding, payload, attachment, received })?;
            number += 1;
        }
        series.flush_if_due(wall_nanoseconds())?;
        std::thread::sleep(PACE.1);
    }
}
