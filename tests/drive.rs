//! A robot in software with every service as a process: it drives, and whatever dies or freezes, it stands.

mod authority;
mod composed;
mod contract;
mod correctors;
mod faults;
mod fleet;
mod holder;
mod latch;
mod navigator;
mod teleop;

use crate::harness::{Process, Robot};

/// A way to the far end of a room: long enough to do harm to whoever drives it.
const FAR: &str = "4,0";

impl Robot {
    /// Starts `axle go` to the far end, and waits until the robot is fast.
    async fn on_its_way(&self) -> Process {
        self.eyes().await.under_way(|| self.go(FAR)).await
    }
    /// A short way from wherever it is now succeeds: everything works again.
    async fn drives_again(&self) {
        let pose = self.knows_where_it_is().await;
        let way = format!("{:.3},{:.3}", pose.x.0 + 0.15, pose.y.0);
        self.reaches(&way).await;
    }
}
