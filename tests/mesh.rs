//! The mesh: real sessions at a real router, in the process of the test.

mod ask;
mod hear;
mod presence;

use axle_schema::{PlanAsk, WayTask};

/// A question for Pathfinder.
fn question() -> PlanAsk {
    PlanAsk { way: WayTask::parse("1,0").expect("a way"), ..PlanAsk::default() }
}
