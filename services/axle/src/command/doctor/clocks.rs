//! How far the clocks of computers are apart, measured by questions.
//!
//! A process answers with its wall time. The answer was given somewhere between question and reply, so its clock is
//! ahead by the difference to the middle of the two, give or take half the round trip; the shortest round of several is
//! the best one (Cristian, 1989).

use axle_mesh::{Mesh, clock};
use axle_schema::key::Presence;
use axle_schema::presence::Status;
use std::collections::BTreeMap;
use std::time::Duration;

/// How often each computer is asked.
const ROUNDS: usize = 8;
/// So many rounds may go unanswered: one answer that a router lacks says nothing of a clock.
const MISSED: usize = 2;

/// How far a clock is ahead of the one of this computer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Offset {
    pub(super) seconds: f64,
    /// The true offset is within this of `seconds`.
    pub(super) uncertainty: f64,
}

impl Offset {
    /// What one round shows: asked and answered by the own clock, and what the other clock showed in between.
    pub(super) fn of_round(asked: f64, shown: f64, answered: f64) -> Self {
        Self {
            seconds: shown - f64::midpoint(asked, answered),
            uncertainty: ((answered - asked) / 2.0).max(0.0),
        }
    }
}

/// Measures the clock of every computer that has a process among these.
pub(super) async fn measure(
    mesh: &Mesh,
    everybody: &[(Presence, Option<Status>)],
    patience: Duration,
) -> BTreeMap<String, Offset> {
    let mut offsets: BTreeMap<String, Offset> = BTreeMap::new();
    let answering = everybody.iter().filter(|(_, status)| status.is_some());
    let asked: BTreeMap<String, &Presence> =
        answering.map(|(presence, _)| (super::pairs::host_of(presence), presence)).collect();
    for (host, presence) in asked {
        let mut missed = 0;
        for _ in 0..ROUNDS {
            let begun = clock::wall();
            let seen = mesh.processes_of(&presence.robot, &presence.service, patience).await;
            let ended = clock::wall();
            let own = seen.unwrap_or_default().into_iter().find(|(other, _)| other.boot == presence.boot);
            let Some(wall) = own.and_then(|(_, status)| status?.wall) else {
                missed += 1;
                if missed > MISSED {
                    break;
                }
                continue;
            };
            let round = Offset::of_round(begun, wall.0, ended);
            let best = offsets.entry(host.clone()).or_insert(round);
            if round.uncertainty < best.uncertainty {
                *best = round;
            }
        }
    }
    offsets
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_true_offset_is_within_the_uncertainty_however_the_delays_are_shared() {
        for (there, back) in [(0.0, 0.0), (0.001, 0.009), (0.009, 0.001), (0.005, 0.005), (0.2, 0.0)] {
            for offset in [-3600.0, -0.02, 0.0, 0.5] {
                let (asked, shown) = (100.0, 100.0 + there + offset);
                let found = Offset::of_round(asked, shown, asked + there + back);
                assert!(
                    (found.seconds - offset).abs() <= found.uncertainty + 1e-9,
                    "{there} {back} {offset}"
                );
            }
        }
    }
}
