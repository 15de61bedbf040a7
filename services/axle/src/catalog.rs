//! The catalogue of services: each stands here once, and gets its command, keys, parameters and documentation from it.
//!
//! A new corrector is one file in `services/correctors` and one line in [`CATALOG`].

mod wires;

pub(crate) use wires::{Wires, is_shared};

use crate::params;
use crate::run::{self, Context, Running};
use axle_correctors::{ArcCorrector, DCorrector, GCorrector, LtvCorrector, PursuitCorrector, WCorrector};
use axle_pathdriver::Pathdriver;
use axle_pathfinder::Pathfinder;
use axle_schema::contract::Params as _;
use std::path::Path;

/// For whom a service works when no robot is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scope {
    /// For every robot: planners.
    AllRobots,
    /// For one robot.
    OneRobot,
}

/// The kind of plan a corrector follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Takes {
    /// Movements.
    Drive,
    /// Geometries.
    Plan,
}

/// One service.
pub(crate) struct Entry {
    /// Its name everywhere: command, keys, parameters, processes.
    pub(crate) name: &'static str,
    /// What it does, in one sentence.
    pub(crate) about: &'static str,
    /// For whom it works.
    pub(crate) scope: Scope,
    /// What it follows, if it is a corrector.
    pub(crate) takes: Option<Takes>,
    /// What it hears, says, asks and answers, by its name.
    pub(crate) wires: fn(&'static str) -> Wires,
    /// Its parameters file with all defaults and explanations.
    pub(crate) params: &'static str,
    /// Looks whether it can begin with such a file, without a mesh.
    pub(crate) check: fn(Option<&Path>) -> anyhow::Result<()>,
    /// Runs it until it is told to stop.
    pub(crate) run: fn(Context) -> Running,
}

impl Entry {
    const fn functional<F: run::functional::Served>(
        name: &'static str,
        about: &'static str,
        wires: fn(&'static str) -> Wires,
    ) -> Self {
        Self {
            name,
            about,
            scope: Scope::AllRobots,
            takes: None,
            wires,
            params: <F::Params as axle_schema::contract::Params>::FILE,
            check: params::check::<F::Params>,
            run: |context| Box::pin(run::functional::run::<F>(context)),
        }
    }
    const fn corrector<C: run::corrector::Driven>(
        name: &'static str,
        takes: Takes,
        about: &'static str,
    ) -> Self {
        Self {
            name,
            about,
            scope: Scope::OneRobot,
            takes: Some(takes),
            wires: wires::corrector,
            params: <C::Params as axle_schema::contract::Params>::FILE,
            check: params::check::<C::Params>,
            run: |context| Box::pin(run::corrector::run::<C>(context)),
        }
    }
}

/// Every service of Axle, in the order of the way of a task.
pub(crate) const CATALOG: &[Entry] = &[
    Entry {
        name: "pilot",
        about: "Takes a task, has it planned, and sees it through.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::pilot,
        params: axle_pilot::PilotParams::FILE,
        check: run::pilot::check,
        run: |context| Box::pin(run::pilot::run(context)),
    },
    Entry::functional::<Pathfinder>("pathfinder", "Turns way points into geometries.", wires::pathfinder),
    Entry::functional::<Pathdriver>(
        "pathdriver",
        "Turns geometries into movements within the robot's limits.",
        wires::pathdriver,
    ),
    Entry::corrector::<DCorrector>(
        "d-corrector",
        Takes::Drive,
        "Keeps the wheels at the distances they should have covered.",
    ),
    Entry::corrector::<GCorrector>(
        "g-corrector",
        Takes::Plan,
        "Keeps the ratio of the wheels while the leading one covers its distance.",
    ),
    Entry::corrector::<WCorrector>(
        "w-corrector",
        Takes::Plan,
        "Drives along a vector field to the ends of the legs, or along them.",
    ),
    Entry::corrector::<ArcCorrector>(
        "arc-corrector",
        Takes::Plan,
        "Drives arcs to the ends of the legs, one after the other.",
    ),
    Entry::corrector::<PursuitCorrector>(
        "pursuit-corrector",
        Takes::Plan,
        "Pursues a point of the path ahead: regulated pure pursuit.",
    ),
    Entry::corrector::<LtvCorrector>(
        "ltv-corrector",
        Takes::Drive,
        "Keeps the robot at the poses that are due: a linear time-varying regulator.",
    ),
    Entry {
        name: "drive",
        about: "Offers the Generic Differential Drive contract: powers, speeds, distances, degrees.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::drive,
        params: axle_drive::DriveParams::FILE,
        check: params::check::<axle_drive::DriveParams>,
        run: |context| Box::pin(run::drive::run(context)),
    },
    Entry {
        name: "emulator",
        about: "A robot in software, behind its gate.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::emulator,
        params: axle_emulator::EmulatorParams::FILE,
        check: params::check::<axle_emulator::EmulatorParams>,
        run: |context| Box::pin(run::emulator::run(context)),
    },
    Entry {
        name: "composed",
        about: "Owns the wheels of a robot that is composed of motor and encoder services, behind its gate.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::composed,
        params: run::composed::ComposedParams::FILE,
        check: params::check::<run::composed::ComposedParams>,
        run: |context| Box::pin(run::composed::run(context)),
    },
    Entry {
        name: "motor-left",
        about: "The left motor of a composed robot, in software, with its encoder.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::motor,
        params: axle_emulator::MotorParams::FILE,
        check: params::check::<axle_emulator::MotorParams>,
        run: |context| Box::pin(run::motor::run(context, 0)),
    },
    Entry {
        name: "motor-right",
        about: "The right motor of a composed robot, in software, with its encoder.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::motor,
        params: axle_emulator::RIGHT_MOTOR,
        check: params::check::<axle_emulator::MotorParams>,
        run: |context| Box::pin(run::motor::run(context, 1)),
    },
    Entry {
        name: "source",
        about: "Buffers measurements, and serves the newest and older ones.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::source,
        params: axle_source::SourceParams::FILE,
        check: params::check::<axle_source::SourceParams>,
        run: |context| Box::pin(run::source::run(context)),
    },
    Entry {
        name: "navigator",
        about: "Tells where the robot is, from its encoders.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::navigator,
        params: axle_navigator::NavigatorParams::FILE,
        check: params::check::<axle_navigator::NavigatorParams>,
        run: |context| Box::pin(run::navigator::run(context)),
    },
    Entry {
        name: "recorder",
        about: "Writes everything that is said about a robot to an MCAP file.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::recorder,
        params: axle_recorder::RecorderParams::FILE,
        check: params::check::<axle_recorder::RecorderParams>,
        run: |context| Box::pin(run::recorder::run(context)),
    },
];

/// The service of that name.
pub(crate) fn find(name: &str) -> Option<&'static Entry> {
    CATALOG.iter().find(|entry| entry.name == name)
}

/// The names of all services, for messages.
pub(crate) fn names() -> String {
    CATALOG.iter().map(|entry| entry.name).collect::<Vec<_>>().join(", ")
}

/// The names of all correctors, for messages.
pub(crate) fn corrector_names() -> String {
    CATALOG
        .iter()
        .filter(|entry| entry.takes.is_some())
        .map(|entry| entry.name)
        .collect::<Vec<_>>()
        .join(", ")
}
