//! When to stop: Ctrl-C, SIGTERM, or the end of the process that started this one.

use tokio::io::AsyncReadExt as _;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;

/// The environment variable by which a supervisor tells its children to end with it.
pub(crate) const PARENT: &str = "AXLE_PARENT";

/// Tells all parts of a process to stop.
#[derive(Clone, Debug)]
pub(crate) struct Stop {
    stopped: watch::Receiver<bool>,
}

impl Stop {
    /// Waits until it is time to stop.
    pub(crate) async fn wait(&mut self) {
        // An error means that nobody can say so any more, which is a reason to stop as well.
        drop(self.stopped.wait_for(|stopped| *stopped).await);
    }
    /// The same, but after this time at the latest.
    pub(crate) fn or_after(mut self, time: std::time::Duration) -> Self {
        let (sender, stopped) = watch::channel(false);
        tokio::spawn(async move {
            drop(tokio::time::timeout(time, self.wait()).await);
            // A sender that goes means the same.
            let _ = sender.send(true);
        });
        Self { stopped }
    }
    /// Whether it is time to stop.
    pub(crate) fn is_due(&self) -> bool {
        *self.stopped.borrow()
    }
}

/// Listens for the reasons to stop.
pub(crate) fn stop() -> std::io::Result<Stop> {
    let (sender, stopped) = watch::channel(false);
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    // A child whose supervisor was killed reads the end of its stdin: nothing is left behind, however it ended.
    let has_parent = std::env::var_os(PARENT).is_some_and(|how| how == "stdin");
    tokio::spawn(async move {
        let orphaned = async {
            if !has_parent {
                return std::future::pending().await;
            }
            let mut stdin = tokio::io::stdin();
            let mut bytes = [0; 64];
            while stdin.read(&mut bytes).await.is_ok_and(|count| count > 0) {}
        };
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
            () = orphaned => {}
        }
        let _ = sender.send(true);
        // The sender stays: a dropped one would look like a stop as well, but a second reader may come later.
        std::future::pending::<()>().await;
        drop(sender);
    });
    Ok(Stop { stopped })
}
