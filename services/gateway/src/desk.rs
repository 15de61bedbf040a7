//! The desk: who holds the stick of which robot, and what stops when a browser is lost.
//!
//! A state machine of sessions, stepped by hand in tests. A browser that drives sends its powers again and again; each
//! answers the latest word that it had from the gateway, so that what waited on a stuck link is too old when it comes.
//! The drive brakes when powers stop coming, whatever happens here. This desk adds what only it can know: that two people
//! hold the stick of one robot, and that a browser is gone which had begun something.
//!
//! A session has a number that nobody can guess; a page that is loaded again brings it along, and so takes up again what
//! it had begun.

use crate::GatewayParams;
use axle_schema::refusal::within;
use axle_schema::{Refusal, RobotId, Seconds, Sides, TaskId};
use std::collections::BTreeMap;

/// The most things that one session may have begun and not seen the end of.
pub const MAX_ERRANDS: usize = 16;

/// One browser, from its first word to its last; the number is known to that browser alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SessionId(pub u64);

/// Something that goes on by itself until it is ended.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Errand {
    /// A task of the pilot.
    Task(RobotId, TaskId),
    /// A distance or a turn of the drive.
    Operation(RobotId, TaskId),
}

/// What the desk wants done.
#[derive(Clone, Debug, PartialEq)]
pub enum Out {
    /// Powers of zero for the drive of this robot.
    Rest(RobotId),
    /// The end of an errand.
    End(Errand),
}

/// All sessions, and who holds which stick.
#[derive(Debug)]
pub struct Desk {
    params: GatewayParams,
    sessions: BTreeMap<SessionId, Session>,
    /// Who drives by hand, and since when nothing was renewed.
    hands: BTreeMap<RobotId, (SessionId, Seconds)>,
}

#[derive(Debug)]
struct Session {
    name: String,
    /// When it was last heard.
    heard: Seconds,
    /// How many connections it has; a page that is loaded again may come before its old one has gone.
    connections: u32,
    errands: Vec<Errand>,
}

impl Desk {
    /// A desk without sessions.
    #[must_use]
    pub const fn new(params: GatewayParams) -> Self {
        Self { params, sessions: BTreeMap::new(), hands: BTreeMap::new() }
    }
    /// A browser has connected; `former` is the session that it says it had.
    ///
    /// # Errors
    /// [`Refusal::Busy`] when there are too many.
    pub fn arrive(
        &mut self,
        now: Seconds,
        former: Option<SessionId>,
        random: u64,
        name: &str,
    ) -> Result<SessionId, Refusal> {
        if let Some((id, session)) = former.and_then(|id| Some((id, self.sessions.get_mut(&id)?))) {
            session.heard = now;
            session.connections = session.connections.saturating_add(1);
            return Ok(id);
        }
        if self.sessions.len() >= self.params.browsers {
            return Err(Refusal::Busy {
                holder: format!("{} browsers have the page open: every place", self.sessions.len()),
            });
        }
        // Below 2^53, so that a browser reads it exactly.
        let id = SessionId(random >> 11);
        let session = Session { name: name.to_owned(), heard: now, connections: 1, errands: Vec::new() };
        self.sessions.insert(id, session);
        Ok(id)
    }
    /// The session has given a sign of life.
    pub fn hear(&mut self, now: Seconds, id: SessionId) {
        if let Some(session) = self.sessions.get_mut(&id) {
            session.heard = now;
        }
    }
    /// Somebody moves the stick: whether these powers go to the drive. `echo` is the stamp of the gateway's word that the
    /// browser had last when it sent them.
    ///
    /// # Errors
    /// [`Refusal::Fenced`] for powers that are too old or from nobody; [`Refusal::Busy`] while another browser drives;
    /// [`Refusal::OutOfRange`].
    pub fn hold(
        &mut self,
        now: Seconds,
        id: SessionId,
        robot: &RobotId,
        echo: Seconds,
        powers: Sides<f64>,
    ) -> Result<(), Refusal> {
        within("left", powers.left, -20.0, 20.0)?;
        within("right", powers.right, -20.0, 20.0)?;
        if !self.sessions.contains_key(&id) {
            return Err(Refusal::Fenced { why: "this page was given up as lost; load it again".into() });
        }
        let age = (now - echo).0;
        if !(-1e-3..=self.params.max_age.0).contains(&age) {
            let limit = self.params.max_age.0;
            let why =
                format!("the stick was moved {age:.2} s ago, at most {limit} s are obeyed: the link is slow");
            return Err(Refusal::Fenced { why });
        }
        match self.hands.get(robot) {
            Some((holder, since)) if *holder != id && (now - *since).0 <= self.params.hold.0 => {
                let name = self.sessions.get(holder).map_or("another page", |session| &*session.name);
                Err(Refusal::Busy { holder: format!("{name}, who drives {robot} by hand,") })
            }
            _ => {
                self.hands.insert(robot.clone(), (id, now));
                Ok(())
            }
        }
    }
    /// Who drives this robot by hand.
    #[must_use]
    pub fn hand(&self, robot: &RobotId) -> Option<SessionId> {
        self.hands.get(robot).map(|(id, _)| *id)
    }
    /// The stick is let go: of the robots that this session drove by hand.
    pub fn release(&mut self, id: SessionId) -> Vec<Out> {
        let held: Vec<_> = self
            .hands
            .iter()
            .filter(|(_, (holder, _))| *holder == id)
            .map(|(robot, _)| robot.clone())
            .collect();
        held.into_iter()
            .map(|robot| {
                self.hands.remove(&robot);
                Out::Rest(robot)
            })
            .collect()
    }
    /// The session has begun something.
    pub fn begin(&mut self, id: SessionId, errand: Errand) -> Vec<Out> {
        match self.sessions.get_mut(&id) {
            Some(session) => {
                if session.errands.len() == MAX_ERRANDS {
                    session.errands.remove(0);
                }
                session.errands.push(errand);
                Vec::new()
            }
            // Its browser was lost while the question was on its way.
            None => vec![Out::End(errand)],
        }
    }
    /// An errand is over, whoever began it.
    pub fn over(&mut self, errand: &Errand) {
        for session in self.sessions.values_mut() {
            session.errands.retain(|own| own != errand);
        }
    }
    /// The page is hidden: nobody watches what they drive by hand.
    pub fn hide(&mut self, id: SessionId) -> Vec<Out> {
        let mut outs = self.release(id);
        if let Some(session) = self.sessions.get_mut(&id) {
            let (operations, others): (Vec<_>, Vec<_>) = std::mem::take(&mut session.errands)
                .into_iter()
                .partition(|errand| matches!(errand, Errand::Operation(..)));
            session.errands = others;
            outs.extend(operations.into_iter().map(Out::End));
        }
        outs
    }
    /// A connection of the session has ended.
    pub fn leave(&mut self, now: Seconds, id: SessionId) -> Vec<Out> {
        let Some(session) = self.sessions.get_mut(&id) else { return Vec::new() };
        session.connections = session.connections.saturating_sub(1);
        if session.connections > 0 {
            return Vec::new();
        }
        session.heard = now;
        self.release(id)
    }
    /// Looks who is lost.
    pub fn beat(&mut self, now: Seconds) -> Vec<Out> {
        let mut outs = Vec::new();
        let hold = self.params.hold;
        self.hands.retain(|robot, (_, since)| {
            let is_held = (now - *since).0 <= hold.0;
            if !is_held {
                // The drive brakes by itself; this says so at once.
                outs.push(Out::Rest(robot.clone()));
            }
            is_held
        });
        let (silence, grace) = (self.params.silence, self.params.grace);
        let mut lost = Vec::new();
        for (id, session) in &self.sessions {
            let quiet = (now - session.heard).0;
            let patience = if session.connections > 0 { silence.0 + grace.0 } else { grace.0 };
            if quiet > patience {
                lost.push(*id);
            }
        }
        for id in lost {
            outs.extend(self.release(id));
            if let Some(session) = self.sessions.remove(&id) {
                outs.extend(session.errands.into_iter().map(Out::End));
            }
        }
        outs
    }
    /// Whether a session is known; the connection of one that was given up as lost is of no use any more.
    #[must_use]
    pub fn knows(&self, id: SessionId) -> bool {
        self.sessions.contains_key(&id)
    }
    /// Lets go of everything that is held: the gateway ends.
    pub fn close(&mut self) -> Vec<Out> {
        let mut outs: Vec<_> = std::mem::take(&mut self.hands).into_keys().map(Out::Rest).collect();
        let sessions = std::mem::take(&mut self.sessions);
        outs.extend(sessions.into_values().flat_map(|session| session.errands).map(Out::End));
        outs
    }
    /// How many sessions there are.
    #[must_use]
    pub fn sessions(&self) -> usize {
        self.sessions.len()
    }
}

#[cfg(test)]
mod tests;
