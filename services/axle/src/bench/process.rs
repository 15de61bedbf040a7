//! What processes cost: memory and processor time, as the operating system counts them.

use std::time::Duration;

/// Clock ticks of `/proc/<pid>/stat` in a second: 100 on every Linux that people run.
const TICKS: f64 = 100.0;

/// What some processes use.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Usage {
    /// Resident memory, in bytes.
    pub(crate) rss: u64,
    /// Processor time since their start.
    pub(crate) cpu: Duration,
}

impl Usage {
    /// Of all these processes together; one that has ended counts nothing.
    pub(crate) fn of(pids: impl Iterator<Item = u32>) -> Self {
        pids.filter_map(one)
            .fold(Self::default(), |sum, one| Self { rss: sum.rss + one.rss, cpu: sum.cpu + one.cpu })
    }
}

fn one(pid: u32) -> Option<Usage> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let rss = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let rss: u64 = rss.trim().trim_end_matches("kB").trim().parse().ok()?;
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name of the program may hold blanks; it ends with the last parenthesis.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks: f64 = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    Some(Usage { rss: rss * 1024, cpu: Duration::from_secs_f64(ticks / TICKS) })
}
