//! In which order the robots can end their tasks: the proof that nobody will wait for ever.
//!
//! *Source:* the banker's algorithm (Dijkstra, EWD 108; for vehicles on guided ways, Reveliotis 2000). A robot can end
//! its task when all pieces that are left of its way are free of what the others hold. Robots are taken one after the
//! other: who can drive to its end does so and holds its last piece only. Who cannot, but comes to a piece that is on
//! the way of nobody else, goes there and gives free what is behind it. Ends that lie in the way of others are taken
//! last. The result names everybody who comes to its end.

/// A robot as the order sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Hold {
    /// The piece that it has last passed, and the last one that it may drive: it holds these and all between.
    pub(crate) passed: usize,
    pub(crate) until: usize,
    /// The last piece of its way; a robot without a task has 0, and is at its end.
    pub(crate) last: usize,
    /// When its task came. Older ones are tried first.
    pub(crate) ticket: u64,
}

impl Hold {
    /// Whether it holds this piece.
    pub(crate) const fn has(&self, piece: usize) -> bool {
        self.passed <= piece && piece <= self.until
    }
    const fn over(&self) -> bool {
        self.passed >= self.last
    }
}

/// Which pieces of which robots take the same floor.
pub(crate) trait Floor {
    /// The pieces of others, by robot and piece, that share floor with this one.
    fn shared(&self, robot: usize, piece: usize) -> &[(usize, usize)];
}

/// What became of the robots: who came to its end, in this order, and what all hold then.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    /// Who moves before all others, and to which piece.
    pub(crate) first: Option<(usize, usize)>,
    pub(crate) order: Vec<usize>,
    pub(crate) holds: Vec<Hold>,
}

impl Outcome {
    pub(crate) fn ends(&self, robot: usize) -> bool {
        self.order.contains(&robot)
    }
}

/// Plays the robots to their ends; those without a task are at theirs.
pub(crate) fn play(floor: &impl Floor, holds: &[Hold]) -> Outcome {
    let mut holds = holds.to_vec();
    let mut turn: Vec<usize> = (0..holds.len()).filter(|&robot| !holds[robot].over()).collect();
    turn.sort_by_key(|&robot| holds[robot].ticket);
    let mut order = Vec::with_capacity(turn.len());
    let mut first = None;
    loop {
        let step = turn.iter().find_map(|&robot| harmless(floor, &holds, robot)).or_else(|| {
            // Nobody can move without being in somebody's way: the oldest that can come to its end does.
            turn.iter().find(|&&robot| reach(floor, &holds, robot) == holds[robot].last).map(|&robot| {
                let last = holds[robot].last;
                (robot, last)
            })
        });
        let Some((robot, piece)) = step else { return Outcome { first, order, holds } };
        first = first.or(step);
        holds[robot] = Hold { passed: piece, until: piece, ..holds[robot] };
        if holds[robot].over() {
            order.push(robot);
            turn.retain(|&other| other != robot);
        }
    }
}

/// The farthest piece to which the way of a robot is free of what others hold.
fn reach(floor: &impl Floor, holds: &[Hold], robot: usize) -> usize {
    let Hold { until, last, .. } = holds[robot];
    (until + 1..=last).find(|&piece| blocked(floor, holds, robot, piece)).map_or(last, |piece| piece - 1)
}

/// Whether another robot holds what this piece needs.
pub(crate) fn blocked(floor: &impl Floor, holds: &[Hold], robot: usize, piece: usize) -> bool {
    floor.shared(robot, piece).iter().any(|&(other, at)| holds[other].has(at))
}

/// The farthest piece that a robot can reach where it is in nobody's way.
fn harmless(floor: &impl Floor, holds: &[Hold], robot: usize) -> Option<(usize, usize)> {
    let Hold { passed, until, .. } = holds[robot];
    let farthest = reach(floor, holds, robot);
    let private = |piece: usize| {
        floor.shared(robot, piece).iter().all(|&(other, at)| {
            let hold = &holds[other];
            hold.over() || at <= hold.until || at > hold.last
        })
    };
    // It goes on in any case, or gives something free where it may stand already.
    (until..=farthest).rev().find(|&piece| piece > passed && private(piece)).map(|piece| (robot, piece))
}
