//! `axle tap --since 5s`: what was measured before the tap began, from the buffers of Source.
//!
//! Source answers for encoders, inertia, fixes and ranges. What it gave is said in the order of the stamps, and then what is
//! heard now; a sample that is in both is said once.

use super::line::read;
use crate::out::note;
use axle_mesh::{Mesh, Raw, Retry, Tap};
use axle_schema::codec::encoding_of;
use axle_schema::key::Stream;
use axle_schema::window::{Window, WindowAsk};
use axle_schema::{Message, RobotId, Seconds, encode, key};
use std::collections::BTreeMap;
use std::time::Duration;

/// Source has so long to answer.
const PATIENCE: Duration = Duration::from_secs(2);

/// Samples of the past, and what of the present repeats them.
#[derive(Default)]
pub(super) struct Past {
    pub(super) samples: Vec<Raw>,
    /// The newest stamp of each key that Source gave.
    newest: BTreeMap<String, f64>,
}

impl Past {
    /// Asks the Sources of these robots for what the tap would have heard.
    pub(super) async fn ask(
        mesh: &Mesh,
        tap: &Tap,
        robots: &[RobotId],
        since: Seconds,
    ) -> anyhow::Result<Self> {
        let mut stamped = Vec::new();
        for robot in robots {
            let ask = WindowAsk { since: Some(since) };
            let answer: Result<Window, _> =
                mesh.ask(&key::WINDOW, Some(robot), &ask, PATIENCE, Retry::Idempotent).await;
            let window = answer.map_err(|refusal| anyhow::anyhow!("the Source of {robot}: {refusal}"))?;
            if window.dropped > 0 {
                note(&format!("{} measurements of {robot} never came to its Source", window.dropped));
            }
            put(&mut stamped, tap, &key::ENCODERS, robot, &window.encoders, |datum| datum.stamp)?;
            put(&mut stamped, tap, &key::INERTIAL, robot, &window.inertial, |datum| datum.stamp)?;
            put(&mut stamped, tap, &key::FIX, robot, &window.fixes, |datum| datum.stamp)?;
            put(&mut stamped, tap, &key::RANGE, robot, &window.ranges, |datum| datum.stamp)?;
        }
        stamped.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let newest = stamped.iter().map(|(stamp, raw)| (raw.key.clone(), *stamp)).collect();
        Ok(Self { samples: stamped.into_iter().map(|(_, raw)| raw).collect(), newest })
    }

    /// Whether this sample was among them.
    pub(super) fn has(&self, raw: &Raw) -> bool {
        let Some(newest) = self.newest.get(&raw.key) else { return false };
        read(raw).is_ok_and(|value| value["stamp"].as_f64().is_some_and(|stamp| stamp <= *newest))
    }
}

/// What the tap hears of one kind, as samples.
fn put<M: Message>(
    stamped: &mut Vec<(f64, Raw)>,
    tap: &Tap,
    stream: &Stream<M>,
    robot: &RobotId,
    data: &[M],
    stamp: impl Fn(&M) -> Seconds,
) -> anyhow::Result<()> {
    let key = stream.of(robot).as_str().to_owned();
    if !tap.hears(&key) {
        return Ok(());
    }
    for datum in data {
        let raw = Raw {
            key: key.clone(),
            encoding: encoding_of::<M>(),
            payload: encode(datum)?,
            attachment: Vec::new(),
            deletes: false,
            // Source does not keep when they came.
            received: 0,
        };
        stamped.push((stamp(datum).0, raw));
    }
    Ok(())
}
