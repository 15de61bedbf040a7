//! From taps to the board: what robots say, read at the gateway's own pace.

use super::{Gate, Hall, lock};
use crate::catalog::CATALOG;
use crate::path;
use axle_correctors::WParams;
use axle_correctors::w::arrows;
use axle_gateway::board::{Place, Word};
use axle_gateway::desk::Errand;
use axle_gateway::metrics::Process;
use axle_mesh::{Fault, Raw, Tap};
use axle_schema::codec::{Message, decode_as};
use axle_schema::command::GateState;
use axle_schema::differential_drive::{DriveDistance, DriveStage, RotateDegrees};
use axle_schema::key::{self, Presence, Stream};
use axle_schema::log::LogLine;
use axle_schema::presence::Status;
use axle_schema::task::{PilotProgress, Task};
use axle_schema::{Metres, Plan, RobotId, Seconds, TaskId};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

/// Samples of one stream that may wait for the gateway; older ones are forgotten.
const WAITING: usize = 512;
/// How often it is looked who is alive, and how long the silent ones are waited for.
const LOOK: (Duration, Duration) = (Duration::from_secs(1), Duration::from_millis(700));

/// What is done with the samples of a stream.
#[derive(Clone, Copy)]
enum Use {
    /// The newest one counts.
    Newest,
    /// Each one counts.
    Each(fn(&Hall, &RobotId, &str, &Raw)),
    /// Each one is a line of a log, of a robot's service or of one that works for all.
    Log,
}

/// Everything that the page is told about robots.
pub(super) struct Feed {
    hall: Arc<Hall>,
    taps: Vec<(Tap, Use)>,
}

impl Feed {
    /// Listens.
    pub(super) fn new(hall: &Arc<Hall>) -> Result<Self, Fault> {
        let mut feed = Self { hall: Arc::clone(hall), taps: Vec::new() };
        feed.tap(&key::POSE, Use::Newest)?;
        feed.tap(&key::TRUTH, Use::Newest)?;
        feed.tap(&key::ENCODERS, Use::Newest)?;
        feed.tap(&key::SIGNALS, Use::Newest)?;
        feed.tap(&key::DRIVE_UPDATE, Use::Newest)?;
        feed.tap(&key::GO_WAY, Use::Newest)?;
        for entry in CATALOG.iter().filter(|entry| entry.takes.is_some()) {
            feed.tap(&key::corrector_progress(entry.name), Use::Newest)?;
        }
        let logs = key::every_log(hall.only.as_ref());
        feed.taps.push((hall.mesh.tap(logs.as_str(), WAITING)?, Use::Log));
        feed.tap(&key::GATE_STATE, Use::Each(gate))?;
        feed.tap(&key::GO_PROGRESS, Use::Each(progress))?;
        feed.tap(&key::GO_PLAN, Use::Each(plan))?;
        feed.tap(&key::DRIVE_DISTANCE_STAGE, Use::Each(distance))?;
        feed.tap(&key::DRIVE_ROTATE_STAGE, Use::Each(rotate))?;
        Ok(feed)
    }

    fn tap<M: Message>(&mut self, stream: &Stream<M>, how: Use) -> Result<(), Fault> {
        let key = match &self.hall.only {
            Some(robot) => stream.of(robot),
            None => stream.of_every_robot(),
        };
        self.taps.push((self.hall.mesh.tap(key.as_str(), WAITING)?, how));
        Ok(())
    }

    /// Reads until it is dropped.
    pub(super) async fn run(self) {
        let mut beat = self.hall.mesh.beat(self.hall.params.period * 0.5);
        loop {
            beat.next().await;
            let mut dropped = 0;
            for (tap, how) in &self.taps {
                self.read(tap, *how);
                dropped += tap.dropped();
            }
            self.hall.counts.dropped.store(dropped, Relaxed);
            self.hall.news.send_replace(());
            let outs = self.hall.desk().beat(self.hall.now());
            self.hall.act(outs);
        }
    }

    fn read(&self, tap: &Tap, how: Use) {
        // Of a stream whose newest word counts, the older ones are not even decoded.
        let mut newest: BTreeMap<String, Raw> = BTreeMap::new();
        // What arrives meanwhile waits for the next beat, so that a flood holds nothing up.
        for raw in std::iter::from_fn(|| tap.take()).take(WAITING) {
            #[cfg(feature = "foxglove")]
            if self.hall.params.foxglove {
                self.hall.show.take(&raw);
            }
            match how {
                Use::Newest => drop(newest.insert(raw.key.clone(), raw)),
                Use::Log => log(&self.hall, &raw),
                Use::Each(with) => {
                    if let Some((robot, stream)) = place(&raw.key) {
                        with(&self.hall, &robot, &stream, &raw);
                    }
                }
            }
        }
        for raw in newest.into_values() {
            let Some((robot, stream)) = place(&raw.key) else { continue };
            match key::to_json(&raw.key, &raw.encoding, &raw.payload) {
                Ok(json) => show(&self.hall, &robot, &stream, json.into()),
                Err(refusal) => refuse(&self.hall, &raw, &refusal),
            }
        }
    }
}

fn place(key: &str) -> Option<(RobotId, String)> {
    let place = key::place(key)?;
    Some((RobotId::new(place.robot).ok()?, format!("{}/{}", place.service, place.name)))
}

fn refuse(hall: &Hall, raw: &Raw, refusal: &axle_schema::Refusal) {
    hall.mesh.counters().count_refused();
    tracing::debug!(key = %raw.key, "{refusal}");
}

fn word<T: Serialize>(value: &T) -> Option<Word> {
    serde_json::to_string(value).ok().map(Word::from)
}

fn put<T: Serialize>(hall: &Hall, robot: &RobotId, stream: &str, value: &T) {
    if let Some(word) = word(value) {
        show(hall, robot, stream, word);
    }
}

fn show(hall: &Hall, robot: &RobotId, stream: &str, word: Word) {
    let place = Place { robot: robot.to_string(), stream: stream.to_owned() };
    hall.board().put(hall.now(), place, word);
}

fn add<T: Serialize>(hall: &Hall, robot: &str, stream: &str, value: &T) {
    let place = Place { robot: robot.to_owned(), stream: stream.to_owned() };
    if let Some(word) = word(value) {
        hall.board().add(place, word);
    }
}

/// Reads a sample whose form the gateway must know.
fn read<M: Message>(hall: &Hall, raw: &Raw) -> Option<M> {
    if raw.payload.len() > M::LIMIT {
        hall.mesh.counters().count_refused();
        return None;
    }
    decode_as(&raw.encoding, &raw.payload).inspect_err(|refusal| refuse(hall, raw, refusal)).ok()
}

fn gate(hall: &Hall, robot: &RobotId, stream: &str, raw: &Raw) {
    if let Some(state) = read::<GateState>(hall, raw) {
        put(hall, robot, stream, &state);
        lock(&hall.gates).insert(robot.clone(), Gate { state, at: hall.now() });
    }
}

fn progress(hall: &Hall, robot: &RobotId, stream: &str, raw: &Raw) {
    if let Some(progress) = read::<PilotProgress>(hall, raw) {
        put(hall, robot, stream, &progress);
        if progress.phase.is_over() {
            add(hall, robot.as_str(), stream, &progress);
            hall.desk().over(&Errand::Task(robot.clone(), progress.task));
        }
    }
}

/// A plan, as the points that a map draws.
#[derive(Serialize)]
struct Drawn {
    task: TaskId,
    path: Vec<(f64, f64)>,
    length: Metres,
    notes: Vec<String>,
}

fn plan(hall: &Hall, robot: &RobotId, stream: &str, raw: &Raw) {
    if let Some(Task { id, plan }) = read::<Task<Plan>>(hall, raw) {
        let field = Arrows::of(id, &plan);
        let drawn =
            Drawn { task: id, path: thinned(&path::of_plan(&plan)), length: plan.length, notes: plan.notes };
        put(hall, robot, stream, &drawn);
        put(hall, robot, "pilot/field", &field);
    }
}

/// How far apart the arrows of the field are.
const SPACING: Metres = Metres(0.12);

/// The field of the W-corrector beside a plan: x, y, heading, and the share of its largest speed.
#[derive(Serialize)]
struct Arrows {
    task: TaskId,
    arrows: Vec<(f64, f64, f64, f64)>,
}

impl Arrows {
    fn of(task: TaskId, plan: &Plan) -> Self {
        // With the shipped parameters; a plan that no corrector can follow has no field.
        let arrows = arrows(&WParams::default(), plan, SPACING).unwrap_or_default();
        let most = arrows.iter().map(|arrow| arrow.speed.0).fold(1e-3, f64::max);
        let round = |value: f64| (value * 1e3).round() / 1e3;
        let drawn = arrows.iter().map(|arrow| {
            (round(arrow.x.0), round(arrow.y.0), round(arrow.heading.0), round(arrow.speed.0 / most))
        });
        Self { task, arrows: drawn.collect() }
    }
}

/// At most so many points of a path go to a page.
const MOST_POINTS: usize = 4000;

/// Every n-th point of a path, and its end.
pub(super) fn thinned(path: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let step = path.len().div_ceil(MOST_POINTS).max(1);
    let mut thin: Vec<_> = path.iter().step_by(step).copied().collect();
    if let Some(last) = path.last()
        && thin.last() != Some(last)
    {
        thin.push(*last);
    }
    thin
}

/// A line of a log, as the page shows it.
#[derive(Serialize)]
struct Logged<'a> {
    service: &'a str,
    #[serde(flatten)]
    line: &'a LogLine,
}

fn log(hall: &Hall, raw: &Raw) {
    let Some(key::Place { robot, service, .. }) = key::place(&raw.key) else { return };
    if let Some(line) = read::<LogLine>(hall, raw) {
        add(hall, robot, "log", &Logged { service, line: &line });
    }
}

fn distance(hall: &Hall, robot: &RobotId, stream: &str, raw: &Raw) {
    if let Some(stage) = read::<DriveDistance>(hall, raw) {
        add(hall, robot.as_str(), stream, &stage);
        operation(hall, robot, stage.stage, stage.operation);
    }
}

fn rotate(hall: &Hall, robot: &RobotId, stream: &str, raw: &Raw) {
    if let Some(stage) = read::<RotateDegrees>(hall, raw) {
        add(hall, robot.as_str(), stream, &stage);
        operation(hall, robot, stage.stage, stage.operation);
    }
}

fn operation(hall: &Hall, robot: &RobotId, stage: DriveStage, operation: Option<TaskId>) {
    if let (DriveStage::Completed | DriveStage::Canceled, Some(id)) = (stage, operation) {
        hall.desk().over(&Errand::Operation(robot.clone(), id));
    }
}

/// One process, as the page shows it.
#[derive(Serialize)]
struct Row<'a> {
    service: &'a str,
    robot: &'a str,
    host: &'a str,
    pid: u32,
    status: Option<Numbers<'a>>,
}

#[derive(Serialize)]
struct Numbers<'a> {
    version: &'a str,
    uptime: Seconds,
    beats: u64,
    late: u64,
    late_p99: Seconds,
    sent: u64,
    received: u64,
    refused: u64,
}

impl<'a> Numbers<'a> {
    fn of(status: &'a Status) -> Self {
        let Status { version, uptime, beats, late, late_p99, sent, received, refused, .. } = status;
        Self {
            version,
            uptime: *uptime,
            beats: *beats,
            late: *late,
            late_p99: *late_p99,
            sent: *sent,
            received: *received,
            refused: *refused,
        }
    }
}

/// Looks again and again who is alive.
pub(super) async fn look(hall: &Arc<Hall>) {
    let mut pace = tokio::time::interval(LOOK.0);
    pace.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        pace.tick().await;
        hall.entrance.refresh();
        match hall.mesh.everybody(LOOK.1).await {
            // This process is always among those that are seen, unless the router is gone.
            Ok(everybody) if !everybody.is_empty() => seen(hall, everybody),
            Ok(_) => {}
            Err(fault) => tracing::debug!("who is alive could not be asked: {fault}"),
        }
    }
}

fn seen(hall: &Arc<Hall>, mut everybody: Vec<(Presence, Option<Status>)>) {
    if let Some(only) = &hall.only {
        let is_ours = |robot: &str| robot == only.as_str() || robot == axle_schema::id::ALL;
        everybody.retain(|(presence, _)| is_ours(&presence.robot));
    }
    everybody.sort_by(|(a, _), (b, _)| (&a.robot, &a.service, a.pid).cmp(&(&b.robot, &b.service, b.pid)));
    let robots: BTreeSet<RobotId> =
        everybody.iter().filter_map(|(presence, _)| RobotId::new(&presence.robot).ok()).collect();
    let rows: Vec<_> = everybody
        .iter()
        .map(|(presence, status)| Row {
            service: &presence.service,
            robot: &presence.robot,
            host: &presence.host,
            pid: presence.pid,
            status: status.as_ref().map(Numbers::of),
        })
        .collect();
    let correctors: Vec<_> =
        CATALOG.iter().filter(|entry| entry.takes.is_some()).map(|entry| entry.name).collect();
    let all = |stream: &str| Place { robot: axle_schema::id::ALL.into(), stream: stream.into() };
    let now = hall.now();
    let mut board = hall.board();
    for (stream, word) in
        [("services", word(&rows)), ("robots", word(&robots)), ("correctors", word(&correctors))]
    {
        if let Some(word) = word {
            board.put(now, all(stream), word);
        }
    }
    // Nobody of this robot is alive any more.
    let mut gates = lock(&hall.gates);
    for robot in gates.keys().filter(|robot| !robots.contains(robot)) {
        board.forget(robot.as_str());
    }
    gates.retain(|robot, _| robots.contains(robot));
    drop((board, gates));
    let processes = everybody.into_iter().map(|(Presence { robot, service, host, .. }, status)| Process {
        robot,
        service,
        host,
        status,
    });
    *lock(&hall.processes) = processes.collect();
    *lock(&hall.looked) = Some(now);
}
