//! The faults, one line each: what is done, and what must come of it.

use super::keys::Knock;
use crate::bench::proxy::{Weather, Weathers};
use std::time::Duration;

/// What happens to a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Blow {
    /// SIGKILL; the supervisor starts it again.
    Kill,
    /// SIGSTOP for so long, then SIGCONT.
    Freeze(Duration),
    /// SIGTERM; the supervisor starts it again.
    Restart,
}

/// What is done to a robot that drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fault {
    /// To a service, or to `router-workstation` or `router-onboard`.
    Process(&'static str, Blow),
    /// The link between the two computers has this weather for so long.
    Link(Weathers, Duration),
    /// The cable between two networks of the system is pulled for so long.
    Cable(Duration),
    /// Everything that was commanded is said again, out of its order, while the robot drives.
    Replay,
    /// So many taps are stuck, and a stream floods them.
    Taps(u32),
    /// The disk on which an AllStop is kept and a recorder writes is full.
    Disk,
    /// The wall clocks of both computers step by hours and years.
    Clocks,
    /// Somebody tries to drive the robot.
    Stranger(Knock),
}

/// What must become of the task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Task {
    /// Reached, as if nothing had been.
    Reached,
    /// Ended, with a reason.
    Ended,
    /// Either.
    Any,
}

/// One fault and what is expected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scenario {
    pub(super) name: &'static str,
    pub(super) fault: Fault,
    pub(super) task: Task,
    /// The wheels brake within so many ms, if the task was not reached.
    pub(super) brakes: Option<f64>,
}

/// At 20 Hz, whatever is cut.
const HALT: Option<f64> = Some(170.0);
/// When telemetry is lost while commands pass, the echo grows old before the gate says no.
const ECHO: Option<f64> = Some(270.0);
/// The board itself, when nobody is there to brake any more.
const FIRMWARE: Option<f64> = Some(500.0);
/// Longer than any lease, and within one.
const LONG: Duration = Duration::from_secs(2);
/// How long the weather is bad; longer than a task lasts.
const STORM: Duration = Duration::from_secs(6);

const CLEAR: Weather = Weather {
    cut: false,
    delay: Duration::ZERO,
    jitter: Duration::ZERO,
    loss: 0.0,
    double: 0.0,
    overtaken: 0.0,
};
const CUT: Weather = Weather { cut: true, ..CLEAR };

const fn process(
    name: &'static str,
    service: &'static str,
    blow: Blow,
    (task, brakes): (Task, Option<f64>),
) -> Scenario {
    Scenario { name, fault: Fault::Process(service, blow), task, brakes }
}
const fn cut(name: &'static str, ms: u64, task: Task) -> Scenario {
    let fault = Fault::Link(Weathers::both(CUT), Duration::from_millis(ms));
    Scenario { name, fault, task, brakes: HALT }
}
const fn storm(
    name: &'static str,
    out: Weather,
    back: Weather,
    (task, brakes): (Task, Option<f64>),
) -> Scenario {
    Scenario { name, fault: Fault::Link(Weathers { out, back }, STORM), task, brakes }
}
const fn same(name: &'static str, weather: Weather, of: (Task, Option<f64>)) -> Scenario {
    storm(name, weather, weather, of)
}
const fn knock(name: &'static str, who: Knock) -> Scenario {
    Scenario { name, fault: Fault::Stranger(who), task: Task::Reached, brakes: None }
}

/// What becomes of a task when each of the processes is lost. The planners have done their work; the pilot only looks on;
/// whoever closes the loop is needed.
const UNHURT: (Task, Option<f64>) = (Task::Reached, None);
const ENDS: (Task, Option<f64>) = (Task::Ended, HALT);
const BLIND: (Task, Option<f64>) = (Task::Any, ECHO);
const LOOKS_ON: (Task, Option<f64>) = (Task::Any, None);
const BOARD: (Task, Option<f64>) = (Task::Ended, FIRMWARE);

use Blow::{Freeze, Kill, Restart};

/// All of them.
pub(super) const SCENARIOS: &[Scenario] = &[
    process("kill-pathfinder", "pathfinder", Kill, UNHURT),
    process("kill-pathdriver", "pathdriver", Kill, UNHURT),
    process("kill-pilot", "pilot", Kill, LOOKS_ON),
    process("kill-d-corrector", "d-corrector", Kill, ENDS),
    process("kill-robot", "robot", Kill, BOARD),
    process("kill-source", "source", Kill, BLIND),
    process("kill-navigator", "navigator", Kill, LOOKS_ON),
    process("kill-router-workstation", "router-workstation", Kill, ENDS),
    process("kill-router-onboard", "router-onboard", Kill, ENDS),
    process("freeze-pathfinder", "pathfinder", Freeze(LONG), UNHURT),
    process("freeze-pathdriver", "pathdriver", Freeze(LONG), UNHURT),
    process("freeze-pilot", "pilot", Freeze(LONG), LOOKS_ON),
    process("freeze-d-corrector", "d-corrector", Freeze(LONG), ENDS),
    process("freeze-robot", "robot", Freeze(LONG), BOARD),
    process("freeze-source", "source", Freeze(LONG), BLIND),
    process("freeze-navigator", "navigator", Freeze(LONG), LOOKS_ON),
    process("freeze-router-workstation", "router-workstation", Freeze(LONG), ENDS),
    process("freeze-router-onboard", "router-onboard", Freeze(LONG), ENDS),
    process("restart-pathfinder", "pathfinder", Restart, UNHURT),
    process("restart-pathdriver", "pathdriver", Restart, UNHURT),
    process("restart-pilot", "pilot", Restart, LOOKS_ON),
    process("restart-d-corrector", "d-corrector", Restart, ENDS),
    process("restart-robot", "robot", Restart, BOARD),
    process("restart-source", "source", Restart, BLIND),
    process("restart-navigator", "navigator", Restart, LOOKS_ON),
    process("restart-router-workstation", "router-workstation", Restart, ENDS),
    process("restart-router-onboard", "router-onboard", Restart, ENDS),
    cut("cut-300ms", 300, Task::Any),
    cut("cut-1s", 1000, Task::Any),
    cut("cut-3s", 3000, Task::Ended),
    storm("cut-telemetry", CUT, CLEAR, (Task::Ended, ECHO)),
    storm("cut-commands", CLEAR, CUT, (Task::Ended, HALT)),
    storm("delay-300ms", CLEAR, Weather { delay: Duration::from_millis(300), ..CLEAR }, (Task::Ended, None)),
    same("jitter-40ms", Weather { jitter: Duration::from_millis(40), ..CLEAR }, UNHURT),
    same("loss-2", Weather { loss: 0.02, ..CLEAR }, (Task::Any, None)),
    same("loss-20", Weather { loss: 0.2, ..CLEAR }, (Task::Any, None)),
    same("double", Weather { double: 0.5, ..CLEAR }, UNHURT),
    same("overtaken", Weather { overtaken: 0.1, ..CLEAR }, (Task::Any, None)),
    Scenario { name: "cable", fault: Fault::Cable(LONG), task: Task::Any, brakes: HALT },
    Scenario { name: "replay", fault: Fault::Replay, task: Task::Reached, brakes: None },
    Scenario { name: "taps", fault: Fault::Taps(50), task: Task::Reached, brakes: None },
    Scenario { name: "disk", fault: Fault::Disk, task: Task::Reached, brakes: None },
    Scenario { name: "clocks", fault: Fault::Clocks, task: Task::Reached, brakes: None },
    knock("stranger-nobody", Knock::Nobody),
    knock("stranger-other-authority", Knock::Other),
    knock("stranger-expired", Knock::Expired),
    knock("stranger-other-robot", Knock::OtherRobot),
];

/// Those whose names hold one of these words; all without any.
pub(super) fn chosen(only: &[String]) -> Vec<Scenario> {
    let is_chosen = |scenario: &&Scenario| {
        only.is_empty() || only.iter().any(|word| scenario.name == word || has_part(scenario.name, word))
    };
    SCENARIOS.iter().filter(is_chosen).copied().collect()
}

/// Whether `word` is the first part of a name: `kill` of `kill-pilot`.
fn has_part(name: &str, word: &str) -> bool {
    name.strip_prefix(word).is_some_and(|rest| rest.starts_with('-'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_process_is_killed_frozen_and_restarted_and_no_name_stands_twice() {
        let names: BTreeSet<_> = SCENARIOS.iter().map(|scenario| scenario.name).collect();
        assert_eq!(names.len(), SCENARIOS.len());
        for blow in ["kill", "freeze", "restart"] {
            let all = chosen(&[blow.to_owned()]);
            let struck: BTreeSet<_> =
                all.iter().map(|scenario| format!("{blow}-{}", struck(scenario))).collect();
            assert_eq!(struck.len(), 9, "{struck:?}");
            assert!(all.iter().all(|scenario| struck.contains(scenario.name)), "{struck:?}");
        }
        assert_eq!(chosen(&[]).len(), SCENARIOS.len());
        assert_eq!(chosen(&["replay".to_owned(), "cut-3s".to_owned()]).len(), 2);
        assert!(chosen(&["kil".to_owned()]).is_empty());
    }

    fn struck(scenario: &Scenario) -> &'static str {
        match scenario.fault {
            Fault::Process(name, _) => name,
            other => panic!("{other:?}"),
        }
    }
}
