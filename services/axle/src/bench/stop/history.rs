//! What was heard of one robot: which command it obeyed, and how old that was by the robot's own clock.
//!
//! The gate is not asked: its readings name the command that caused them, and the commands themselves were heard on the
//! mesh with the tick that they echo.

use axle_mesh::{Heard, Inbox, Mesh};
use axle_schema::command::{Command, GateState};
use axle_schema::meta::Cause;
use axle_schema::{EncodersData, RobotId, Tick, key};
use std::collections::VecDeque;
use std::time::Duration;
use tokio::time::{Instant, timeout_at};

/// Commands that are remembered: more than come in the longest outage of the bench.
const REMEMBERED: usize = 4096;

/// Ears for one robot.
pub(super) struct History {
    states: Inbox<GateState>,
    encoders: Inbox<EncodersData>,
    commands: Inbox<Command>,
    echoes: VecDeque<(Cause, Tick)>,
    /// The latest command that was seen to be obeyed.
    obeyed: Option<Cause>,
    /// Readings whose command has not been heard yet.
    open: VecDeque<(Cause, Tick)>,
    /// How old commands were when they were obeyed, in ms; each is up to one reading too old.
    pub(super) ages: Vec<f64>,
    /// Commands that were obeyed and never heard here, after an overflow: they cannot be judged.
    pub(super) unjudged: usize,
}

impl History {
    pub(super) fn of(mesh: &Mesh, robot: &RobotId) -> anyhow::Result<Self> {
        Ok(Self {
            states: mesh.inbox(&key::GATE_STATE.of(robot), 64)?,
            encoders: mesh.inbox(&key::ENCODERS.of(robot), 512)?,
            commands: mesh.inbox(&key::COMMAND.of(robot), 512)?,
            echoes: VecDeque::new(),
            obeyed: None,
            open: VecDeque::new(),
            ages: Vec::new(),
            unjudged: 0,
        })
    }

    /// The next state of the gate of which this holds, if one comes in time.
    pub(super) async fn state(
        &mut self,
        patience: Duration,
        is_right: impl Fn(&GateState) -> bool,
    ) -> Option<Heard<GateState>> {
        let end = Instant::now() + patience;
        loop {
            self.look();
            let heard = timeout_at(end, self.states.next()).await.ok()?;
            if is_right(&heard.message) {
                return Some(heard);
            }
        }
    }

    /// Forgets the states that were heard until now.
    pub(super) fn forget_states(&self) {
        while self.states.take().is_some() {}
    }

    /// Takes what was heard.
    pub(super) fn look(&mut self) {
        while let Some(Heard { message, meta }) = self.commands.take() {
            if let Some(meta) = meta {
                self.echoes.push_back((Cause { source: meta.source, seq: meta.seq }, message.echo));
            }
        }
        while self.echoes.len() > REMEMBERED {
            self.echoes.pop_front();
        }
        while let Some(Heard { message, meta }) = self.encoders.take() {
            let cause = meta.and_then(|meta| meta.cause);
            if let Some(cause) = cause.filter(|cause| Some(*cause) != self.obeyed) {
                self.obeyed = Some(cause);
                self.open.push_back((cause, Tick::of(message.stamp)));
            }
        }
        let echoes = &self.echoes;
        let ages = &mut self.ages;
        self.open.retain(|(cause, obeyed)| {
            let heard = echoes.iter().rev().find(|(command, _)| command == cause);
            if let Some((_, echo)) = heard {
                ages.push(f64::from(obeyed.since(*echo)));
            }
            heard.is_none()
        });
    }

    /// Gives up what waits for a command that was never heard: whoever said it is gone, and everything it said has come.
    pub(super) fn close(&mut self) {
        self.look();
        self.unjudged += self.open.len();
        self.open.clear();
    }
}
