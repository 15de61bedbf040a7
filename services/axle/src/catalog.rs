//! The catalogue of services: each stands here once, and gets its command, keys, parameters and documentation from it.
//!
//! A new corrector is one file in `services/correctors` and one line in [`CATALOG`].

mod wires;

pub(crate) use wires::{Wires, composed_of, emulated_board, is_shared};

use crate::params;
use crate::replay::{self, Replay};
use crate::run::{self, Context, Running};
use axle_correctors::{ArcCorrector, DCorrector, GCorrector, LtvCorrector, PursuitCorrector, WCorrector};
use axle_pathdriver::Pathdriver;
use axle_pathfinder::Pathfinder;
use axle_schema::Message;
use axle_schema::contract::Params as _;
use axle_schema::trace::Answered;
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
    /// Replays it from a recording, if it is a value that can be.
    pub(crate) replay: Option<Replay>,
}

impl Entry {
    const fn functional<F: run::functional::Served>(
        name: &'static str,
        about: &'static str,
        wires: fn(&'static str) -> Wires,
    ) -> Self
    where
        Answered<F::Ask, F::Answer>: Message,
    {
        Self {
            name,
            about,
            scope: Scope::AllRobots,
            takes: None,
            wires,
            params: <F::Params as axle_schema::contract::Params>::FILE,
            check: params::check::<F::Params>,
            run: |context| Box::pin(run::functional::run::<F>(context)),
            replay: Some(replay::functional::<F>),
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
            replay: Some(replay::corrector::<C>),
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
        replay: None,
    },
    Entry {
        name: "pathfinder",
        about: "Turns way points into geometries.",
        scope: Scope::AllRobots,
        takes: None,
        wires: wires::pathfinder,
        params: axle_pathfinder::PathfinderParams::FILE,
        check: params::check::<axle_pathfinder::PathfinderParams>,
        run: |context| Box::pin(run::pathfinder::run(context)),
        replay: Some(replay::functional::<Pathfinder>),
    },
    Entry {
        name: "map",
        about: "Says the map that robots share.",
        scope: Scope::AllRobots,
        takes: None,
        wires: wires::map,
        params: axle_maps::MapParams::FILE,
        check: run::map::check,
        run: |context| Box::pin(run::map::run(context)),
        replay: None,
    },
    Entry::functional::<Pathdriver>(
        "pathdriver",
        "Turns geometries into movements within the robot's limits.",
        wires::pathdriver,
    ),
    Entry {
        name: "traffic",
        about: "Keeps the robots of a fleet from meeting and from waiting for ever.",
        scope: Scope::AllRobots,
        takes: None,
        wires: wires::traffic,
        params: axle_traffic::TrafficParams::FILE,
        check: params::check::<axle_traffic::TrafficParams>,
        run: |context| Box::pin(run::traffic::run(context)),
        replay: None,
    },
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
        replay: None,
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
        replay: None,
    },
    Entry {
        name: "robot",
        about: "A robot with a real board on a serial line, behind its gate.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::robot,
        params: axle_robot::RobotParams::FILE,
        check: params::check::<axle_robot::RobotParams>,
        run: |context| Box::pin(run::robot::run(context)),
        replay: None,
    },
    Entry {
        name: "calibrator",
        about: "Turns speeds into signals for the motors, and signals into speeds.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::calibrator,
        params: axle_calibrator::CalibratorParams::FILE,
        check: params::check::<axle_calibrator::CalibratorParams>,
        run: |context| Box::pin(run::calibrator::run(context)),
        replay: None,
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
        replay: None,
    },
    Entry {
        name: "motor-left",
        about: "The left motor of a composed robot, in software, with an encoder or without.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::motor,
        params: axle_emulator::MotorParams::FILE,
        check: params::check::<axle_emulator::MotorParams>,
        run: |context| Box::pin(run::motor::run(context, 0)),
        replay: None,
    },
    Entry {
        name: "motor-right",
        about: "The right motor of a composed robot, in software, with an encoder or without.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::motor,
        params: axle_emulator::RIGHT_MOTOR,
        check: params::check::<axle_emulator::MotorParams>,
        run: |context| Box::pin(run::motor::run(context, 1)),
        replay: None,
    },
    Entry {
        name: "encoder-left",
        about: "The encoder of the left wheel of a composed robot, in software, where the motor has none.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::encoder,
        params: axle_emulator::EncoderParams::FILE,
        check: params::check::<axle_emulator::EncoderParams>,
        run: |context| Box::pin(run::motor::encode(context, 0)),
        replay: None,
    },
    Entry {
        name: "encoder-right",
        about: "The encoder of the right wheel of a composed robot, in software, where the motor has none.",
        scope: Scope::OneRobot,
        takes: None,
        wires: wires::encoder,
        params: axle_emulator::RIGHT_ENCODER,
        check: params::check::<axle_emulator::EncoderParams>,
        run: |context| Box::pin(run::motor::encode(context, 1)),
        replay: None,
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
        replay: Some(replay::source),
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
        replay: Some(replay::navigator),
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
        replay: None,
    },
    Entry {
        name: "gateway",
        about: "Shows robots in a browser, and lets people drive them there.",
        scope: Scope::AllRobots,
        takes: None,
        wires: wires::gateway,
        params: axle_gateway::GatewayParams::FILE,
        check: params::check::<axle_gateway::GatewayParams>,
        run: |context| Box::pin(run::gateway::run(context)),
        replay: None,
    },
];

/// The service of that name.
pub(crate) fn find(name: &str) -> Option<&'static Entry> {
    CATALOG.iter().find(|entry| entry.name == name)
}

/// Whether a service drives or plays a board.
pub(crate) fn takes_board(name: &str) -> bool {
    name == "robot" || name == "emulator"
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
