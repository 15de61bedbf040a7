//! A link in virtual time: delay, jitter, loss, and outages that end in a burst.
//!
//! It does what TCP below a publisher does that drops when it must: what is delivered is delivered in the order in which
//! it was sent; what is sent while the link is down waits and then comes all at once; what is lost was never sent.

use axle_emulator::Random;
use axle_schema::contract::Bounds;
use axle_schema::refusal::within;
use axle_schema::{Refusal, Seconds};
use std::collections::VecDeque;

/// The most messages that may be on their way; beyond it the oldest are forgotten, as the queues of the mesh do.
const MOST: usize = 1024;

/// What a link does to messages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkParams {
    /// How long every message takes at least, 0 to 10 s.
    pub delay: Seconds,
    /// How much longer it may take, evenly spread, 0 to 10 s.
    pub jitter: Seconds,
    /// The share of messages that never arrive, 0 to 1.
    pub loss: f64,
    /// How often the link goes down in a second, on average, 0 to 10.
    pub outages: f64,
    /// How long it is down then, 0 to 60 s.
    pub outage: Seconds,
}

impl Default for LinkParams {
    /// A cable: 1 to 2 ms.
    fn default() -> Self {
        let ms = Seconds(0.001);
        Self { delay: ms, jitter: ms, loss: 0.0, outages: 0.0, outage: Seconds::ZERO }
    }
}

impl Bounds for LinkParams {
    fn check(&self) -> Result<(), Refusal> {
        within("delay of a link in s", self.delay.0, 0.0, 10.0)?;
        within("jitter of a link in s", self.jitter.0, 0.0, 10.0)?;
        within("loss of a link", self.loss, 0.0, 1.0)?;
        within("outages of a link in 1/s", self.outages, 0.0, 10.0)?;
        within("outage of a link in s", self.outage.0, 0.0, 60.0)
    }
}

/// One direction between two computers.
#[derive(Clone, Debug)]
pub struct Link<T> {
    params: LinkParams,
    random: Random,
    /// What is on its way, with its time of arrival, in the order of both.
    underway: VecDeque<(Seconds, T)>,
    /// When the latest message arrives.
    latest: Seconds,
    /// When the next outage begins.
    down: Seconds,
    /// From this time on nothing is sent any more.
    cut: Seconds,
}

impl<T> Link<T> {
    /// A link whose accidents come from the stream of a seed.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(params: LinkParams, seed: u64, stream: u64) -> Result<Self, Refusal> {
        params.check()?;
        let mut random = Random::new(seed, stream);
        let down = next(&params, &mut random);
        let cut = Seconds(f64::INFINITY);
        Ok(Self { params, random, underway: VecDeque::new(), latest: Seconds::ZERO, down, cut })
    }

    /// Ends the link at this time: what is sent later never arrives.
    pub const fn cut(&mut self, at: Seconds) {
        self.cut = at;
    }

    /// Sends a message that may be lost.
    pub fn send(&mut self, now: Seconds, message: T) {
        // Drawn in any case: a message that is lost changes nothing for the next ones.
        let lost = self.random.uniform() <= self.params.loss;
        let arrives = self.arrives(now);
        if !(lost || now >= self.cut) {
            self.deliver(arrives, message);
        }
    }

    /// Sends a message that its sender repeats until it has arrived: a question, or its answer.
    pub fn send_surely(&mut self, now: Seconds, message: T) {
        let arrives = self.arrives(now);
        if now < self.cut {
            self.deliver(arrives, message);
        }
    }

    /// The next message that has arrived by `now`.
    pub fn receive(&mut self, now: Seconds) -> Option<T> {
        let arrived = self.underway.front().is_some_and(|&(arrives, _)| arrives <= now);
        if arrived { self.underway.pop_front().map(|(_, message)| message) } else { None }
    }

    fn arrives(&mut self, now: Seconds) -> Seconds {
        let alone = now + self.params.delay + self.params.jitter * (1.0 - self.random.uniform());
        let mut arrives = alone.max(self.latest);
        while arrives >= self.down {
            let up = self.down + self.params.outage;
            arrives = arrives.max(up);
            self.down = up + next(&self.params, &mut self.random);
        }
        arrives
    }

    fn deliver(&mut self, arrives: Seconds, message: T) {
        self.latest = arrives;
        if self.underway.len() == MOST {
            self.underway.pop_front();
        }
        self.underway.push_back((arrives, message));
    }
}

/// How long it is to the next outage.
fn next(params: &LinkParams, random: &mut Random) -> Seconds {
    let rests = params.outages > 0.0 && params.outage > Seconds::ZERO;
    Seconds(if rests { random.waiting() / params.outages } else { f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// When each of `count` messages, sent 10 ms apart, arrives.
    fn arrivals(params: LinkParams, seed: u64, count: u32) -> Vec<(u32, f64)> {
        let mut link = Link::new(params, seed, 0).expect("a link");
        let mut arrived = Vec::new();
        for ms in 0..count * 10 + 70_000 {
            let now = Seconds(f64::from(ms) / 1000.0);
            if ms % 10 == 0 && ms / 10 < count {
                link.send(now, ms / 10);
            }
            while let Some(number) = link.receive(now) {
                arrived.push((number, now.0));
            }
        }
        arrived
    }

    proptest! {
        #[test]
        fn what_arrives_arrives_in_order_and_never_before_its_delay(
            (delay, jitter, loss) in (0.0..0.3, 0.0..0.3, 0.0..0.5),
            (outages, outage) in (0.0..2.0, 0.0..1.0),
            seed in any::<u64>(),
        ) {
            let (delay, jitter, outage) = (Seconds(delay), Seconds(jitter), Seconds(outage));
            let arrived = arrivals(LinkParams { delay, jitter, loss, outages, outage }, seed, 200);
            for pair in arrived.windows(2) {
                prop_assert!(pair[0].0 < pair[1].0 && pair[0].1 <= pair[1].1, "{pair:?}");
            }
            for &(number, at) in &arrived {
                prop_assert!(at >= f64::from(number) * 0.01 + delay.0 - 1e-12);
            }
            if loss == 0.0 {
                prop_assert_eq!(arrived.len(), 200);
            }
        }
    }

    #[test]
    fn losses_are_as_many_as_said_and_an_outage_ends_in_a_burst() {
        let arrived = arrivals(LinkParams { loss: 0.2, ..LinkParams::default() }, 1, 5000);
        assert!((3850..4150).contains(&arrived.len()), "{} of 5000 with a loss of 20 %", arrived.len());
        let outage = LinkParams { outages: 0.5, outage: Seconds(1.0), ..LinkParams::default() };
        let arrived = arrivals(outage, 3, 1000);
        assert_eq!(arrived.len(), 1000, "nothing is lost");
        let burst = arrived.chunk_by(|a, b| a.1 >= b.1).map(<[_]>::len).max();
        assert!(burst.is_some_and(|most| most >= 90), "a second of messages comes at once: {burst:?}");
    }

    #[test]
    fn nothing_passes_a_link_that_is_cut_and_absurd_links_are_refused() {
        let mut link = Link::new(LinkParams::default(), 1, 0).expect("a link");
        link.cut(Seconds(1.0));
        link.send(Seconds(0.9), "before");
        link.send(Seconds(1.0), "after");
        link.send_surely(Seconds(1.5), "surely");
        assert_eq!((link.receive(Seconds(9.0)), link.receive(Seconds(9.0))), (Some("before"), None));
        let wrong = LinkParams { loss: f64::NAN, ..LinkParams::default() };
        assert!(Link::<()>::new(wrong, 1, 0).is_err());
    }
}
