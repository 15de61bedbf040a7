//! `axle conform`: the Generic Differential Drive contract as a black box, against any implementation on the mesh.
//!
//! The kit knows the keys of the contract and nothing else; it judges by what the drive answers, what it notifies, and
//! by the encoders in its state. A clause that the contract leaves open is never failed for being absent.

mod clause;
mod client;
mod moving;
mod report;
mod stopping;

use crate::cli::Conform;
use crate::out::note;
use crate::settings::Settings;
use crate::signal;
use anyhow::Context as _;
use client::Client;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use report::Report;
use std::time::Duration;
use tokio::time::Instant;

/// How long a drive may take to answer at first.
const COMING: Duration = Duration::from_secs(3);

/// Judges every clause, one after the other; the robot moves by up to a metre.
pub(crate) async fn conform(settings: &Settings, args: &Conform) -> anyhow::Result<()> {
    let robot = settings.one_robot()?;
    let mut stop = signal::stop()?;
    let mesh = settings.join("conform").await?;
    let mut client = Client::new(&mesh, &robot)?;
    // A drive that has just started may not have heard of its robot yet.
    let (began, mut before) = (Instant::now(), client.get().await);
    while before.is_err() && began.elapsed() < COMING {
        before = client.get().await;
    }
    let before = before.with_context(|| {
        format!("the drive of {robot} does not answer; is `axle run drive` (or your own implementation) up?")
    })?;
    note(&format!("{robot} will move by up to a metre in both directions, and turn on the spot"));
    let clauses: Vec<_> = stopping::CLAUSES.iter().chain(moving::CLAUSES).collect();
    let bar =
        ProgressBar::with_draw_target(Some(clauses.len() as u64), ProgressDrawTarget::stderr_with_hz(4));
    bar.set_style(
        ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let mut report = Report::of(&robot, &before);
    for clause in clauses {
        bar.set_message(clause.name);
        let finding = tokio::select! {
            finding = clause.judge(&mut client) => finding,
            () = stop.wait() => {
                bar.finish_and_clear();
                client.stop().await.context("stop the drive")?;
                anyhow::bail!("ended before every clause was judged; the drive is stopped, `axle enable` ends that");
            }
        };
        report.add(clause, finding);
        bar.inc(1);
    }
    bar.finish_and_clear();
    // The drive is left as it was found: at rest, and enabled or not.
    client.settle().await.context("bring the drive to rest")?;
    if !before.enabled {
        client.stop().await.context("stop the drive, as it was before")?;
    }
    mesh.leave().await;
    report.print(args)
}
