//! Words that are on their way to a browser: it echoes the stamp of each, so what it has not read yet is known.
//!
//! The buffers between a gateway and a browser on a bad link hold megabytes, and what waits in them is old before it is
//! seen. So a browser is told nothing new while it has too much to read.

use std::collections::VecDeque;

/// The most words that a browser may have before it: 0.4 s at the shipped pace.
pub const MOST: usize = 8;

/// What is on its way to one browser.
#[derive(Clone, Debug, Default)]
pub struct Flight {
    ticks: VecDeque<u64>,
}

impl Flight {
    /// Whether one more may be sent.
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.ticks.len() < MOST
    }
    /// A word with this stamp is sent.
    pub fn send(&mut self, tick: u64) {
        self.ticks.push_back(tick);
    }
    /// The browser has read the word with this stamp, and so all before it. What was never sent changes nothing.
    pub fn land(&mut self, tick: u64) {
        if self.ticks.contains(&tick) {
            while self.ticks.front().is_some_and(|sent| *sent <= tick) {
                self.ticks.pop_front();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_browser_that_does_not_read_is_told_nothing_more() {
        let mut flight = Flight::default();
        for tick in 0..MOST as u64 {
            assert!(flight.has_room());
            flight.send(tick * 50);
        }
        assert!(!flight.has_room());
        for strange in [1, 7_777_777, u64::MAX] {
            flight.land(strange);
            assert!(!flight.has_room(), "{strange} was never sent");
        }
        flight.land(100);
        assert!(flight.has_room());
        flight.land(100);
        assert_eq!(flight.ticks.len(), MOST - 3);
    }
}
