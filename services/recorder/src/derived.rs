//! Derived channels: what of Axle's data Foxglove, Lichtblick and PlotJuggler can show by themselves.
//!
//! Nothing is lost by them and nothing is read back from them: beside each stands the sample from which it was made.
//! A stream that is faster than an eye is thinned out.

use crate::Sample;
use crate::foxglove::{self, View};
use axle_schema::codec::decode_as;
use axle_schema::command::GateState;
use axle_schema::log::{LogLevel, LogLine};
use axle_schema::task::{CorrectorProgress, Phase, PilotProgress};
use axle_schema::{Geometry, Message, NavigatorData, Plan, Pose, Task, WayTask, key};
use serde_json::Value;
use std::collections::{HashMap, HashSet};

/// The shortest time between two derived messages of one topic, in nanoseconds: 50 Hz.
const PACE: u64 = 20_000_000;
/// The most topics whose pace and words are remembered.
const MOST: usize = 1024;
/// Points of an arc are at most this far apart, in m, and at most so many.
const SPACING: (f64, f64) = (0.02, 1000.0);

/// A message for people's tools.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Where they find it, for example `/r1/pose`.
    pub topic: String,
    /// What it is.
    pub view: View,
    /// The message.
    pub json: Value,
}

/// What was shown so far.
#[derive(Debug, Default)]
pub struct Derived {
    /// When each topic was written last.
    last: HashMap<String, u64>,
    /// What each speaker of the log said last.
    words: HashMap<String, String>,
    bodies: HashSet<String>,
}

impl Derived {
    /// What a sample looks like; nothing for most of them.
    pub fn of(&mut self, sample: &Sample<'_>) -> Vec<Shown> {
        let Some(place) = key::place(sample.key) else { return Vec::new() };
        let (robot, at) = (place.robot, sample.received);
        match (place.service, place.name) {
            ("navigator", "pose") => self.pose(sample, robot, "pose", robot.to_owned()),
            ("emulator", "truth") => self.pose(sample, robot, "truth", format!("{robot}/truth")),
            ("pilot", "plan") => {
                let Some(Task { plan, .. }) = read::<Task<Plan>>(sample) else { return Vec::new() };
                let json = foxglove::poses_in_map(at, &path(&plan));
                vec![Shown { topic: format!("/{robot}/plan"), view: View::Poses, json }]
            }
            ("pilot", "way") => {
                let Some(Task { plan, .. }) = read::<Task<WayTask>>(sample) else { return Vec::new() };
                let points: Vec<_> = plan.points.iter().map(|point| (point.x.0, point.y.0)).collect();
                let json = foxglove::points(at, &points);
                vec![Shown { topic: format!("/{robot}/scene"), view: View::Scene, json }]
            }
            ("gate", "state") => {
                let Some(state) = read::<GateState>(sample) else { return Vec::new() };
                self.say(at, robot, "gate", &gate_words(&state), !state.enabled)
            }
            ("pilot", "progress") => {
                let Some(said) = read::<PilotProgress>(sample) else { return Vec::new() };
                self.phase(at, robot, "pilot", said.task, &said.phase)
            }
            (service, "log") => {
                let Some(line) = read::<LogLine>(sample) else { return Vec::new() };
                let level = match line.level {
                    LogLevel::Trace | LogLevel::Debug => 1,
                    LogLevel::Info => 2,
                    LogLevel::Warn => 3,
                    LogLevel::Error => 4,
                };
                let json = foxglove::log(at, level, &format!("{robot}/{service}"), &line.text);
                vec![Shown { topic: "/log".to_owned(), view: View::Log, json }]
            }
            (service, "progress") => {
                let Some(said) = read::<CorrectorProgress>(sample) else { return Vec::new() };
                self.phase(at, robot, service, said.task, &said.phase)
            }
            _ => Vec::new(),
        }
    }

    fn pose(&mut self, sample: &Sample<'_>, robot: &str, name: &str, frame: String) -> Vec<Shown> {
        let topic = format!("/{robot}/{name}");
        let at = sample.received;
        // Before it is decoded: a flood costs nothing.
        if !self.is_due(&topic, at) {
            return Vec::new();
        }
        let Some(NavigatorData { pose, .. }) = read(sample) else { return Vec::new() };
        let transform = foxglove::transform(at, &frame, pose);
        let mut shown = vec![
            Shown { topic, view: View::Pose, json: foxglove::pose_in_map(at, pose) },
            Shown { topic: "/tf".to_owned(), view: View::Transform, json: transform },
        ];
        if self.bodies.len() < MOST && !self.bodies.contains(&frame) {
            let json = foxglove::body(at, &frame);
            shown.push(Shown { topic: format!("/{robot}/{name}-body"), view: View::Scene, json });
            self.bodies.insert(frame);
        }
        shown
    }

    fn is_due(&mut self, topic: &str, at: u64) -> bool {
        if let Some(last) = self.last.get_mut(topic) {
            let is_due = at.abs_diff(*last) >= PACE;
            if is_due {
                *last = at;
            }
            return is_due;
        }
        let has_room = self.last.len() < MOST;
        if has_room {
            self.last.insert(topic.to_owned(), at);
        }
        has_room
    }

    fn phase(
        &mut self,
        at: u64,
        robot: &str,
        name: &str,
        task: axle_schema::TaskId,
        phase: &Phase,
    ) -> Vec<Shown> {
        let words = match phase {
            Phase::Failed(refusal) => format!("task {task} failed: {refusal}"),
            Phase::Planning => format!("task {task} is being planned"),
            Phase::Running => format!("task {task} is being driven"),
            Phase::Done => format!("task {task} is done"),
            Phase::Canceled => format!("task {task} was cancelled"),
            Phase::Replaced => format!("task {task} was replaced"),
        };
        self.say(at, robot, name, &words, matches!(phase, Phase::Failed(_)))
    }

    /// A line of the log, unless it was the last one of the same speaker.
    fn say(&mut self, at: u64, robot: &str, name: &str, words: &str, warns: bool) -> Vec<Shown> {
        let speaker = format!("{robot}/{name}");
        if self.words.get(&speaker).is_some_and(|last| last == words) || self.words.len() >= MOST {
            return Vec::new();
        }
        let json = foxglove::log(at, if warns { 3 } else { 2 }, &speaker, words);
        self.words.insert(speaker, words.to_owned());
        vec![Shown { topic: "/log".to_owned(), view: View::Log, json }]
    }
}

fn gate_words(state: &GateState) -> String {
    let motion = format!("{:?}", state.motion).to_lowercase();
    let holder = state.holder.as_deref().unwrap_or("nobody");
    let enabled = match (state.enabled, state.stop) {
        (true, _) => String::new(),
        (false, Some(stop)) => format!(", stopped by AllStop {stop}"),
        (false, None) => ", disabled".to_owned(),
    };
    let cause = state.cause.map_or_else(String::new, |cause| format!(", last braked by {cause:?}"));
    format!("the wheels are {motion} for {holder}{enabled}{cause}")
}

/// The path of the middle of the axle.
fn path(plan: &Plan) -> Vec<Pose> {
    let mut pose = plan.start;
    let mut poses = vec![pose];
    for leg in &plan.legs {
        if let Geometry::Arc { radius, angle } = leg.geometry {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 1000")]
            let steps = ((radius.0 * angle.0).abs() / SPACING.0).clamp(2.0, SPACING.1) as u32;
            let part = |step| angle * (f64::from(step) / f64::from(steps));
            poses.extend((1..steps).map(|step| Geometry::Arc { radius, angle: part(step) }.end_from(pose)));
        }
        pose = leg.geometry.end_from(pose);
        poses.push(pose);
    }
    poses.retain(|pose| pose.check().is_ok());
    poses
}

fn read<M: Message>(sample: &Sample<'_>) -> Option<M> {
    decode_as(sample.encoding, sample.payload).ok()
}
