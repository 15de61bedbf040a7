//! `axle go "x,y x,y …"`: a task through the pilot, with a progress bar.

use crate::cli::Go;
use crate::out::{data, note};
use crate::settings::Settings;
use axle_mesh::{Inbox, Mesh, Retry};
use axle_schema::command::Done;
use axle_schema::task::{Accepted, Cancel, GoAsk, Phase, PilotProgress};
use axle_schema::{RobotId, TaskId, key};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::time::Duration;
use tokio::time::timeout;

/// The pilot has this long to take a task.
const PATIENCE: Duration = Duration::from_secs(3);
/// A pilot that says nothing for so long is gone.
const SILENCE: Duration = Duration::from_secs(3);

pub(super) async fn go(settings: &Settings, args: Go) -> anyhow::Result<()> {
    let robot = settings.one_robot()?;
    let mesh = settings.join("go").await?;
    let mut stop = crate::signal::stop()?;
    let words = mesh.inbox(&key::GO_PROGRESS.of(&robot), 64)?;
    let ask = GoAsk { way: args.way, corrector: args.corrector, confirm: args.confirm };
    let Accepted { task } = mesh.ask(&key::GO, Some(&robot), &ask, PATIENCE, Retry::Never).await?;
    let bar = Bar::new();
    let end = tokio::select! {
        end = follow(&words, task, |progress| bar.show(progress)) => end?,
        () = stop.wait() => {
            bar.clear();
            note("cancelling …");
            cancel(&mesh, &robot, task).await;
            timeout(Duration::from_secs(1), follow(&words, task, |_| {})).await.map_err(|_| {
                anyhow::anyhow!("the pilot did not confirm the cancellation within 1 s; `axle stop` stops the robot")
            })??
        }
    };
    bar.clear();
    mesh.leave().await;
    report(&end, args.json)
}

/// Follows a task to its end.
///
/// # Errors
/// When the pilot falls silent.
pub(crate) async fn follow(
    words: &Inbox<PilotProgress>,
    task: TaskId,
    mut show: impl FnMut(&PilotProgress),
) -> anyhow::Result<PilotProgress> {
    loop {
        let heard = timeout(SILENCE, words.next()).await.map_err(|_| {
            anyhow::anyhow!("the pilot said nothing for 3 s: it has ended, or the router has")
        })?;
        let progress = heard.message;
        if progress.task == task {
            show(&progress);
            if progress.phase.is_over() {
                return Ok(progress);
            }
        }
    }
}

/// Ends a task. What is not heard is no failure here: the caller waits for the end of the task.
pub(crate) async fn cancel(mesh: &Mesh, robot: &RobotId, task: TaskId) {
    let cancelled: Result<Done, _> = mesh
        .ask(&key::GO_CANCEL, Some(robot), &Cancel { id: task }, Duration::from_secs(1), Retry::Idempotent)
        .await;
    if let Err(refusal) = cancelled {
        note(&format!("the cancellation was not taken: {refusal}"));
    }
}

fn report(end: &PilotProgress, json: bool) -> anyhow::Result<()> {
    if json {
        let line = serde_json::json!({
            "reached": end.phase == Phase::Done, "points_reached": end.reached, "points": end.points,
            "distance_left_m": end.distance_left, "duration_s": end.elapsed, "task": end.task, "phase": end.phase,
        });
        data(&line.to_string())?;
    }
    let summary = format!("{} of {} way points in {:.1} s", end.reached, end.points, end.elapsed.0);
    match &end.phase {
        Phase::Done => {
            note(&format!("reached: {summary}, {:.1} cm from the last one", end.distance_left.0 * 100.0));
            Ok(())
        }
        Phase::Failed(refusal) => anyhow::bail!("not reached: {refusal}; {summary}"),
        Phase::Canceled => anyhow::bail!("cancelled: {summary}"),
        Phase::Replaced => anyhow::bail!("replaced by a newer task: {summary}"),
        Phase::Planning | Phase::Running => anyhow::bail!("not over: {summary}"),
    }
}

/// A progress bar on stderr; nothing where nobody watches.
pub(crate) struct Bar {
    bar: ProgressBar,
}

impl Bar {
    pub(crate) fn new() -> Self {
        let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr_with_hz(10));
        let style = ProgressStyle::with_template("{bar:30} {percent:>3}% {msg}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style);
        Self { bar }
    }
    pub(crate) fn show(&self, progress: &PilotProgress) {
        let phase = match progress.phase {
            Phase::Planning => "planning",
            Phase::Running => "driving",
            _ => "over",
        };
        let message = progress.waiting.clone().map_or_else(String::new, |why| format!("; it waits {why}"));
        let message = format!(
            "{phase}: {}/{} way points, {:.2} m from the last, {:.1} s{message}",
            progress.reached, progress.points, progress.distance_left.0, progress.elapsed.0
        );
        self.set(progress.fraction, message);
    }
    /// Shows a share from 0 to 1.
    pub(crate) fn set(&self, share: f64, message: String) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share from 0 to 1")]
        self.bar.set_position((share * 1000.0) as u64);
        self.bar.set_message(message);
    }
    /// Says words for people above it.
    pub(crate) fn say(&self, words: &str) {
        self.bar.suspend(|| note(words));
    }
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}
