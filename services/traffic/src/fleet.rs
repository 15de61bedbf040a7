//! The fleet: what every robot holds, what it is given, and why not more.

use crate::order::{Floor, Hold, Outcome, blocked, play};
use crate::params::TrafficParams;
use crate::piece::{self, Cell, Piece};
use axle_schema::contract::Bounds as _;
use axle_schema::plan::MAX_NOTES;
use axle_schema::traffic::{Claim, ClaimedWay, Clearance, MAX_ROBOTS, Mover, TrafficState, Wait};
use axle_schema::{Message as _, Pose, Refusal, RobotId, Seconds, TaskId};
use std::collections::BTreeMap;

/// The most squares of the floor that all ways may take.
const MAX_CELLS: usize = 2_000_000;

/// All robots, in the order in which they were first heard of.
#[derive(Clone, Debug)]
pub struct Fleet {
    params: TrafficParams,
    robots: Vec<Robot>,
    /// Who needs a square of the floor, by robot and piece.
    floor: BTreeMap<Cell, Vec<(usize, usize)>>,
    taken: usize,
    tickets: u64,
    /// Nothing is given before this.
    opens: Seconds,
}

/// One robot.
#[derive(Clone, Debug)]
struct Robot {
    name: RobotId,
    task: TaskId,
    /// The first is where the way begins.
    pieces: Vec<Piece>,
    /// For each piece, the pieces of others that need some of its floor.
    shared: Vec<Vec<(usize, usize)>>,
    hold: Hold,
    /// Whether its task may begin: from then on everybody takes care that it can end.
    admitted: bool,
    /// The last piece that it would be given now, were it alone.
    wants: usize,
    /// For whom it waits, as numbers and in words.
    blockers: Vec<usize>,
    waits: Vec<Wait>,
}

impl Floor for Fleet {
    fn shared(&self, robot: usize, piece: usize) -> &[(usize, usize)] {
        self.robots[robot].shared.get(piece).map_or(&[], Vec::as_slice)
    }
}

impl Fleet {
    /// No robots yet; `now` is the time of the start.
    ///
    /// # Errors
    /// Parameters out of their ranges.
    pub fn new(params: TrafficParams, now: Seconds) -> Result<Self, Refusal> {
        params.check()?;
        Ok(Self {
            params,
            robots: Vec::new(),
            floor: BTreeMap::new(),
            taken: 0,
            tickets: 0,
            opens: now + params.listen,
        })
    }

    /// A robot says how far it is, and hears how far it may drive.
    ///
    /// # Errors
    /// [`Refusal::Unknown`] for a task whose way was not told; what is wrong with a way; a fleet that is full.
    pub fn claim(&mut self, claim: &Claim, now: Seconds) -> Result<Clearance, Refusal> {
        claim.check()?;
        let known = self.robots.iter().position(|robot| robot.name == claim.robot);
        let robot = match (known, &claim.way) {
            (Some(robot), Some(way)) if !self.knows(robot, claim.task, way) => {
                self.enter(Some(robot), claim, way)?
            }
            (None, Some(way)) => self.enter(None, claim, way)?,
            (Some(robot), _) if self.robots[robot].task == claim.task => robot,
            (robot, _) => {
                let known = robot.map_or_else(|| "none".into(), |robot| self.robots[robot].task.to_string());
                let what = format!("task of {} (tell its way)", claim.robot);
                return Err(Refusal::Unknown { what, got: claim.task.to_string(), known });
            }
        };
        let hold = &mut self.robots[robot].hold;
        if claim.passed as usize > hold.until {
            let limit = format!("at most {}, which may be driven", hold.until);
            return Err(Refusal::out_of_range("pieces that are behind a robot", claim.passed, limit));
        }
        hold.passed = hold.passed.max(claim.passed as usize);
        self.give(robot, now);
        let Robot { hold, pieces, waits, .. } = &self.robots[robot];
        Ok(Clearance {
            task: claim.task,
            until: number(hold.until),
            pieces: number(pieces.len() - 1),
            waits: waits.clone(),
        })
    }

    /// The account of everybody.
    #[must_use]
    pub fn state(&self) -> TrafficState {
        let order = play(self, &self.holds()).order;
        let rest = (0..self.robots.len()).filter(|robot| !order.contains(robot));
        let (waiting, parked): (Vec<_>, Vec<_>) = rest.partition(|&robot| !self.robots[robot].is_over());
        let all = order.iter().copied().chain(waiting).chain(parked);
        let mover = |robot: usize| {
            let turn = order.iter().position(|&other| other == robot).map(|turn| number(turn + 1));
            let Robot { name, task, hold, pieces, waits, .. } = &self.robots[robot];
            Mover {
                robot: name.clone(),
                task: *task,
                place: pieces[hold.passed].end,
                passed: number(hold.passed),
                until: number(hold.until),
                pieces: number(pieces.len() - 1),
                turn,
                waits: waits.clone(),
            }
        };
        TrafficState { robots: all.map(mover).collect() }
    }

    /// The floor that everybody holds.
    #[cfg(test)]
    pub(crate) fn held(&self) -> Vec<(RobotId, Vec<Cell>)> {
        let cells = |robot: &Robot| {
            let held = &robot.pieces[robot.hold.passed..=robot.hold.until];
            held.iter().flat_map(|piece| piece.cells.iter().copied()).collect()
        };
        self.robots.iter().map(|robot| (robot.name.clone(), cells(robot))).collect()
    }

    /// Whether this very way was told before: a question may come twice.
    fn knows(&self, robot: usize, task: TaskId, way: &ClaimedWay) -> bool {
        let Robot { task: known, pieces, .. } = &self.robots[robot];
        *known == task && pieces.len() == piece::pieces(&way.legs).len() + 1
    }

    /// Takes a new way of a robot.
    fn enter(&mut self, known: Option<usize>, claim: &Claim, way: &ClaimedWay) -> Result<usize, Refusal> {
        if known.is_none() && self.robots.len() == MAX_ROBOTS {
            let (got, limit) = (MAX_ROBOTS as u64 + 1, MAX_ROBOTS as u64);
            return Err(Refusal::TooLarge { what: "fleet (robots)".into(), got, limit });
        }
        let pieces = piece::of(way, self.params.cell.0, self.params.margin.0)?;
        let cells: usize = pieces.iter().map(|piece| piece.cells.len()).sum();
        let before = known.map_or(0, |robot| self.robots[robot].cells());
        if self.taken - before + cells > MAX_CELLS {
            let what = "floor that all ways take (cells)".into();
            let got = (self.taken - before + cells) as u64;
            return Err(Refusal::TooLarge { what, got, limit: MAX_CELLS as u64 });
        }
        let last = pieces.len() - 1;
        // What a robot was given by a Traffic that is no more, it holds: it may be driving there.
        let until = (claim.until as usize).min(last);
        let passed = (claim.passed as usize).min(until);
        self.tickets += 1;
        let hold = Hold { passed, until, last, ticket: self.tickets };
        let robot = known.unwrap_or(self.robots.len());
        self.forget(robot);
        let fresh = Robot {
            name: claim.robot.clone(),
            task: claim.task,
            shared: vec![Vec::new(); pieces.len()],
            pieces,
            hold,
            admitted: until > 0,
            wants: until,
            blockers: Vec::new(),
            waits: Vec::new(),
        };
        match self.robots.get_mut(robot) {
            Some(old) => *old = fresh,
            None => self.robots.push(fresh),
        }
        self.spread(robot);
        Ok(robot)
    }

    /// Takes a robot's way from the floor.
    fn forget(&mut self, robot: usize) {
        let Some(old) = self.robots.get(robot) else { return };
        for cell in old.pieces.iter().flat_map(|piece| &piece.cells) {
            if let Some(users) = self.floor.get_mut(cell) {
                users.retain(|&(user, _)| user != robot);
                if users.is_empty() {
                    self.floor.remove(cell);
                }
            }
        }
        self.taken -= old.cells();
        for other in &mut self.robots {
            for shared in &mut other.shared {
                shared.retain(|&(user, _)| user != robot);
            }
            // Its number stays with the robot, but not what it was waited for.
            other.blockers.retain(|&user| user != robot);
        }
    }

    /// Puts a robot's way on the floor, and notes with whose it shares squares.
    fn spread(&mut self, robot: usize) {
        let pieces = std::mem::take(&mut self.robots[robot].pieces);
        for (index, piece) in pieces.iter().enumerate() {
            let mut shared: Vec<(usize, usize)> = Vec::new();
            for cell in &piece.cells {
                let users = self.floor.entry(*cell).or_default();
                shared.extend(users.iter().filter(|(user, _)| *user != robot));
                users.push((robot, index));
            }
            shared.sort_unstable();
            shared.dedup();
            for &(other, at) in &shared {
                self.robots[other].shared[at].push((robot, index));
            }
            self.robots[robot].shared[index] = shared;
        }
        self.robots[robot].pieces = pieces;
        self.taken += self.robots[robot].cells();
    }

    /// What everybody holds; a robot whose task may not begin yet only stands.
    fn holds(&self) -> Vec<Hold> {
        self.robots
            .iter()
            .map(|robot| if robot.admitted { robot.hold } else { Hold { last: 0, ..robot.hold } })
            .collect()
    }

    /// Gives a robot as much of its way as it may have, and notes for whom it waits.
    fn give(&mut self, robot: usize, now: Seconds) {
        let before = self.holds();
        let order = play(self, &before);
        let hold = self.robots[robot].hold;
        (self.robots[robot].blockers, self.robots[robot].waits) = (Vec::new(), Vec::new());
        if self.robots[robot].is_over() || now < self.opens {
            return;
        }
        let wants = self.horizon(robot);
        self.robots[robot].wants = wants;
        let first = hold.until + 1;
        let mut most = hold.until;
        let mut barred = None;
        while most < wants && !blocked(self, &before, robot, most + 1) {
            // Whoever moves first in the order waits for nobody's age: were it barred by an older robot that cannot
            // move before it, nobody would move any more. As far as the order takes it, it is always safe.
            let goes_first = order.first.is_some_and(|(mover, piece)| mover == robot && most < piece);
            barred = if goes_first { None } else { self.elder(robot, most + 1) };
            if barred.is_some() {
                break;
            }
            most += 1;
        }
        let with = |until: usize| {
            let mut holds = before.clone();
            holds[robot] = Hold { until, ..hold };
            holds
        };
        let given = (hold.until + usize::from(self.robots[robot].admitted)..=most)
            .rev()
            .find(|&until| keeps(&order, &play(self, &with(until)), robot));
        if let Some(until) = given {
            self.robots[robot].admitted = true;
            self.robots[robot].hold.until = until;
        }
        let until = self.robots[robot].hold.until;
        if until >= wants {
            return;
        }
        // For whom it waits: for who holds the next piece, for who goes first, or for who could not go behind it.
        let next = until + 1;
        let mut reasons: Vec<(usize, String)> = Vec::new();
        for (other, at) in holders(self, &before, robot, next) {
            reasons.push((other, format!("it holds the way at {}", self.place(other, at))));
        }
        if let (true, Some(elder)) = (reasons.is_empty() && next > most, barred) {
            reasons.push((
                elder,
                format!("its task is older, and it goes first at {}", self.place(robot, next)),
            ));
        }
        if reasons.is_empty() {
            let outcome = play(self, &with(next.max(first)));
            reasons = self.lost(robot, &order, &outcome);
        }
        reasons.sort_by_key(|(other, _)| *other);
        reasons.dedup_by_key(|(other, _)| *other);
        let waits = reasons
            .iter()
            .take(MAX_NOTES)
            .map(|(other, why)| Wait { robot: self.robots[*other].name.clone(), why: why.clone() });
        let waits = waits.collect();
        self.robots[robot].waits = waits;
        self.robots[robot].blockers = reasons.into_iter().map(|(other, _)| other).collect();
    }

    /// Who could not end its task if `robot` were given its next piece, or who would hinder `robot` itself.
    fn lost(&self, robot: usize, before: &Outcome, after: &Outcome) -> Vec<(usize, String)> {
        let name = &self.robots[robot].name;
        let mut reasons: Vec<(usize, String)> = before
            .order
            .iter()
            .filter(|&&other| other != robot && !after.ends(other))
            .map(|&other| (other, format!("{name} would stand in its way for ever: it goes first")))
            .collect();
        if !after.ends(robot) {
            let hold = after.holds[robot];
            let stuck = (hold.until + 1..=hold.last).find(|&piece| blocked(self, &after.holds, robot, piece));
            for (other, at) in stuck.into_iter().flat_map(|piece| holders(self, &after.holds, robot, piece)) {
                reasons
                    .push((other, format!("it stands in the way farther on, at {}", self.place(other, at))));
            }
        }
        reasons
    }

    /// An older robot that waits for this piece, unless it waits for `robot` itself, directly or not.
    fn elder(&self, robot: usize, piece: usize) -> Option<usize> {
        let mine = self.robots[robot].hold.ticket;
        self.shared(robot, piece).iter().find_map(|&(other, at)| {
            let elder = &self.robots[other];
            let waits = elder.admitted && !elder.blockers.is_empty() && elder.hold.ticket < mine;
            let wanted = elder.hold.until < at && at <= elder.wants;
            (waits && wanted && !self.depends(other, robot)).then_some(other)
        })
    }

    /// Whether `robot` waits for `for_whom`, or for somebody who does.
    fn depends(&self, robot: usize, for_whom: usize) -> bool {
        let mut seen = vec![false; self.robots.len()];
        let mut open = vec![robot];
        while let Some(robot) = open.pop() {
            if robot == for_whom {
                return true;
            }
            if !std::mem::replace(&mut seen[robot], true) {
                open.extend(&self.robots[robot].blockers);
            }
        }
        false
    }

    /// The last piece that a robot would be given if it were alone.
    fn horizon(&self, robot: usize) -> usize {
        let Robot { hold, pieces, .. } = &self.robots[robot];
        let mut left = self.params.ahead.0;
        let mut piece = hold.passed;
        // One piece at least, however long; and never less than was given.
        while piece < hold.last && (left > 0.0 || piece < hold.until) {
            piece += 1;
            left -= pieces[piece].length;
        }
        piece
    }

    fn place(&self, robot: usize, piece: usize) -> String {
        let Pose { x, y, .. } = self.robots[robot].pieces[piece].end;
        // Adding 0 makes a plain zero of a negative one.
        format!("({:.1}, {:.1})", x.0 + 0.0, y.0 + 0.0)
    }
}

impl Robot {
    fn cells(&self) -> usize {
        self.pieces.iter().map(|piece| piece.cells.len()).sum()
    }
    const fn is_over(&self) -> bool {
        self.hold.passed >= self.hold.last
    }
}

/// Whether everybody who could end its task before still can, and `robot` as well.
fn keeps(before: &Outcome, after: &Outcome, robot: usize) -> bool {
    let over = after.holds[robot].passed >= after.holds[robot].last;
    over && before.order.iter().all(|&other| after.ends(other))
}

/// Who holds floor that a piece needs, and the first such piece of each.
fn holders(floor: &impl Floor, holds: &[Hold], robot: usize, piece: usize) -> Vec<(usize, usize)> {
    let mut found: Vec<(usize, usize)> = Vec::new();
    for &(other, at) in floor.shared(robot, piece) {
        if holds[other].has(at) && found.iter().all(|(known, _)| *known != other) {
            found.push((other, at));
        }
    }
    found
}

fn number(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}
