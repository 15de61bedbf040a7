//! The words of Axle: what services say to each other, and how it is written.
//!
//! Nothing here talks to a network, reads a clock or starts a thread; every algorithm of Axle is built on this crate
//! alone. SI units everywhere; x forward, y left, headings counter-clockwise from +x; left comes before right.
//!
//! # The map of conversions
//!
//! Everything turns into poses, and can therefore be drawn (paper, Figure 1):
//!
//! ```text
//!  Geometry ──normalized_dwm──> Dwm ──encoders_span──> EncodersSpan <──spread── EncodersData
//!     │ <───────geometry─────────┘ │                      │  │   └──accumulate──> EncodersData
//!     │                            │ <──────to_dwm────────┘  │
//!     └──navigator_span──┐         └─navigator_span─┐        └──navigator_span──┐
//!                        └──────────────────────────┴──> NavigatorSpan <──spread── NavigatorData
//!                                                              └─────accumulate──> NavigatorData
//!  charts: Geometry, Curve, Dwm ──poses──> NavigatorData …
//!  halves: Dwm <──> Sides<DwmHalf>, EncodersData <──> Sides<EncodersHalf>, EncodersSpan <──> Sides<EncodersSpanHalf>
//!  beyond the paper: Geometry ──> Curve (spirals and clothoids too) <──curve── Dwm, Curve ──normalized_dwm──> Dwm
//! ```
//!
//! # Where to find what
//!
//! Words: [`mod@unit`], [`sides`], [`dwm`], [`geometry`], [`curve`], [`way`], [`encoders`], [`navigator`], [`position`],
//! [`event`], [`sensor`],
//! and for the services [`board`], [`calibration`], [`plan`], [`task`], [`command`], [`window`], [`trace`], [`presence`],
//! [`mod@log`]. How they are written: [`codec`], [`refusal`],
//! [`meta`], [`key`]. What a service is: [`contract`]. Formulas: [`motion`], [`fit`], [`series`].

pub mod board;
pub mod calibration;
pub mod codec;
pub mod command;
pub mod contract;
pub mod curve;
pub mod differential_drive;
pub mod drivetrain;
pub mod dwm;
pub mod encoders;
pub mod event;
pub mod fit;
pub mod geometry;
pub mod id;
pub mod key;
pub mod log;
pub mod map;
pub mod meta;
pub mod motion;
pub mod navigator;
pub mod plan;
pub mod position;
pub mod presence;
pub mod refusal;
pub mod sensor;
pub mod series;
pub mod sides;
pub mod task;
pub mod trace;
pub mod traffic;
pub mod unit;
pub mod way;
pub mod window;

pub use calibration::{Calibration, SignalsData};
pub use codec::{Message, decode, encode};
pub use curve::Curve;
pub use drivetrain::Drivetrain;
pub use dwm::{Dwm, DwmHalf, Track};
pub use encoders::{EncodersData, EncodersHalf, EncodersSpan, EncodersSpanHalf};
pub use event::{Event, NavigatorEvent};
pub use fit::Tolerance;
pub use geometry::Geometry;
pub use id::{Boot, RobotId, StopId, TaskId, Tick};
pub use map::{MapAsk, MapData};
pub use navigator::{NavigatorData, NavigatorSpan, Pose, Twist};
pub use plan::{Drive, DriveAsk, Joints, Leg, Manner, Plan, PlanAsk, PlanProgress, PlanStrategy, Strategy};
pub use position::{GetPosition, Position, SetPosition};
pub use refusal::Refusal;
pub use sensor::{Fix, HeadingFix, InertialData, Range, Signals};
pub use sides::{Sides, Symmetric};
pub use task::Task;
pub use unit::{
    Duty, Metres, MetresPerSecond, MetresPerSecondSquared, Numbers, PerMetre, Radians, RadiansPerSecond,
    Ratio, Seconds,
};
pub use way::{WayPoint, WayTask};

/// The CDDL text of every message (RFC 8610), as shipped in `schema/axle.cddl` and the files of `schema/cddl`.
pub const CDDL: &str = concat!(
    include_str!("../axle.cddl"),
    "\n",
    include_str!("../cddl/drive.cddl"),
    "\n",
    include_str!("../cddl/log.cddl"),
    "\n",
    include_str!("../cddl/fleet.cddl"),
    "\n",
    include_str!("../cddl/manner.cddl"),
    "\n",
    include_str!("../cddl/trace.cddl"),
    "\n",
    include_str!("../cddl/board.cddl"),
    "\n",
    include_str!("../cddl/calibration.cddl"),
    "\n",
    include_str!("../cddl/navigator.cddl"),
    "\n",
    include_str!("../cddl/maps.cddl"),
);
