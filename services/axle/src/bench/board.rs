//! `axle bench board`: how long the bridge takes from the setpoint of a beat to the first byte on the line.
//!
//! The line is a pseudo-terminal, at whose other end a thread does nothing but look for bytes. What is measured is
//! everything that the bridge adds: the protocol, the queue to the task that writes, and the write.

use crate::out::{data, table};
use crate::run::emulated_board::terminal;
use crate::run::serial::{Arrival, Port};
use anyhow::Context as _;
use axle_mesh::Clock;
use axle_robot::{BoardKind, Bridge, RobotParams, firmware};
use axle_schema::{MetresPerSecond, Seconds, Sides};
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Commands of which the time is taken.
const ROUNDS: usize = 500;
/// A board that takes longer to be greeted will not be.
const GREETING: Duration = Duration::from_secs(10);
/// A byte that takes longer was lost.
const LOST: Duration = Duration::from_secs(1);

/// Measures every board and prints.
pub(crate) async fn board(json: bool) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for kind in BoardKind::ALL {
        let mut times = tokio::task::spawn_blocking(move || measure(kind)).await??;
        times.sort_unstable();
        rows.push((kind.name(), times[times.len() / 2], times[times.len() * 99 / 100]));
    }
    let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
    if json {
        let object: serde_json::Map<_, _> = rows
            .iter()
            .map(|(name, median, late)| {
                let times =
                    serde_json::json!({ "median_ms": milliseconds(*median), "p99_ms": milliseconds(*late) });
                ((*name).to_owned(), times)
            })
            .collect();
        return Ok(data(&serde_json::Value::Object(object).to_string())?);
    }
    let shown = |time: Duration| format!("{:.3} ms", milliseconds(time));
    let rows = rows.into_iter().map(|(name, median, late)| vec![name.to_owned(), shown(median), shown(late)]);
    Ok(table(&["board", "setpoint to first byte, median", "99 of 100 within"], rows)?)
}

/// A board at the other end of a line, and when it got its bytes.
struct Other {
    arrivals: Receiver<Instant>,
    is_over: Arc<AtomicBool>,
}

impl Drop for Other {
    fn drop(&mut self) {
        self.is_over.store(true, Relaxed);
    }
}

/// The firmware of the board, on a thread that looks for bytes all the time.
fn other(kind: BoardKind, clock: Clock) -> anyhow::Result<(Other, String)> {
    let (mut master, path) = terminal()?;
    let (told, arrivals) = channel();
    let is_over = Arc::new(AtomicBool::new(false));
    let ends = Arc::clone(&is_over);
    let mut board = firmware::firmware(kind, &RobotParams::default(), firmware::Quirks::default());
    let body = firmware::Body { voltage: 12.0, ..firmware::Body::default() };
    std::thread::Builder::new().name("board".into()).spawn(move || {
        let mut bytes = [0; 256];
        while !ends.load(Relaxed) {
            let mut out = Vec::new();
            if let Ok(count) = master.read(&mut bytes) {
                if told.send(Instant::now()).is_err() {
                    return;
                }
                board.hear(clock.now(), bytes.get(..count).unwrap_or_default(), &mut out);
            }
            board.beat(clock.now(), &body, &mut out);
            if !out.is_empty() {
                drop(master.write(&out));
            }
            std::thread::yield_now();
        }
    })?;
    Ok((Other { arrivals, is_over }, path))
}

/// The times of one board.
fn measure(kind: BoardKind) -> anyhow::Result<Vec<Duration>> {
    let clock = Clock::start();
    let params = RobotParams::default();
    let (other, path) = other(kind, clock)?;
    let runtime = tokio::runtime::Handle::current();
    let _inside = runtime.enter();
    let mut port = Port::open(Path::new(&path), params.baud(kind), clock);
    let mut bridge = Bridge::new(&params, kind, &path)?;
    let mut out = Vec::new();
    let begun = Instant::now();
    let mut times = Vec::with_capacity(ROUNDS);
    let mut fast = false;
    while times.len() < ROUNDS {
        std::thread::sleep(Duration::from_millis(5));
        let now = clock.now();
        while let Some(arrival) = port.take() {
            match arrival {
                Arrival::Opened => bridge.opened(now, &mut out),
                Arrival::Bytes(at, bytes) => bridge.hear(at, &bytes),
                Arrival::Closed(Some(why)) => bridge.closed(why),
                Arrival::Closed(None) => {}
            }
        }
        let is_up = bridge.health(now).is_ok();
        anyhow::ensure!(is_up || begun.elapsed() < GREETING, "{} is not greeted", kind.name());
        while other.arrivals.try_recv().is_ok() {}
        fast = is_up && !fast;
        let speed = MetresPerSecond(if fast { 0.2 } else { 0.0 });
        let said = Instant::now();
        bridge.beat(now, Sides::new(speed, speed), &mut out);
        if out.is_empty() {
            continue;
        }
        port.say(std::mem::take(&mut out))?;
        if is_up {
            let came = other.arrivals.recv_timeout(LOST).context("no byte came over the line")?;
            times.push(came.saturating_duration_since(said));
        }
    }
    // The stop is read before the line goes.
    bridge.beat(clock.now() + Seconds(0.1), Sides::default(), &mut out);
    port.say(out)?;
    Ok(times)
}
