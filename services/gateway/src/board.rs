//! The board: the newest word of every stream, and the last events.
//!
//! Robots speak faster than a browser on a bad link reads. The board keeps one word of each stream and a bounded list of
//! events, whatever the number of browsers; each browser has a [`Reader`] that knows what it was given. A reader that
//! comes seldom gets the newest, and is told how many events it missed. So a slow browser costs nobody anything: no queue
//! grows, and nobody waits.

use axle_schema::Seconds;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// The most streams that are kept; a new one beyond that is not.
pub const MAX_STREAMS: usize = 1024;
/// The most events that are kept.
pub const MAX_EVENTS: usize = 256;
/// The most bytes of one word; a longer one is kept out.
pub const MAX_WORD: usize = 512 * 1024;

/// A word as JSON text; sharing it costs nothing.
pub type Word = Arc<str>;

/// Where a word was said: the robot (or `all`) and the stream, for example `navigator/pose`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// The robot, or `all`.
    pub robot: String,
    /// Service and stream.
    pub stream: String,
}

/// The newest of everything.
#[derive(Debug, Default)]
pub struct Board {
    newest: BTreeMap<Place, Newest>,
    events: VecDeque<(Place, Word)>,
    /// Events that were ever added; the last of them are kept.
    added: u64,
    /// Grows with every word of a stream.
    version: u64,
    kept_out: u64,
}

#[derive(Debug)]
struct Newest {
    version: u64,
    at: Seconds,
    word: Word,
}

/// What one browser has been given so far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reader {
    version: u64,
    events: u64,
}

/// What is new for a reader.
#[derive(Debug, Default)]
pub struct News {
    /// The newest word of each stream that changed, with its age.
    pub newest: Vec<(String, Seconds, Word)>,
    /// Events in their order.
    pub events: Vec<(String, Word)>,
    /// Events of any robot that were forgotten before the reader came.
    pub lost: u64,
}

impl News {
    /// Whether there is nothing to tell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.newest.is_empty() && self.events.is_empty() && self.lost == 0
    }
}

impl Board {
    /// Puts a word up in the place of the one before it. Returns whether it was put up.
    pub fn put(&mut self, now: Seconds, place: Place, word: Word) -> bool {
        let is_full = self.newest.len() >= MAX_STREAMS && !self.newest.contains_key(&place);
        if is_full || word.len() > MAX_WORD {
            self.kept_out += 1;
            return false;
        }
        self.version += 1;
        self.newest.insert(place, Newest { version: self.version, at: now, word });
        true
    }
    /// Adds an event, which every reader is told once; the oldest is forgotten for it.
    pub fn add(&mut self, place: Place, word: Word) {
        if word.len() > MAX_WORD {
            self.kept_out += 1;
            return;
        }
        self.added += 1;
        if self.events.len() == MAX_EVENTS {
            self.events.pop_front();
        }
        self.events.push_back((place, word));
    }
    /// Forgets what was said about a robot that is gone.
    pub fn forget(&mut self, robot: &str) {
        self.newest.retain(|place, _| place.robot != robot);
    }
    /// The newest word of a stream, and its age.
    #[must_use]
    pub fn newest(&self, now: Seconds, place: &Place) -> Option<(Seconds, &Word)> {
        self.newest.get(place).map(|newest| (now - newest.at, &newest.word))
    }
    /// The newest word of one stream of every robot.
    pub fn of_every_robot<'a>(&'a self, stream: &'a str) -> impl Iterator<Item = (&'a str, &'a Word)> {
        let fits = self.newest.iter().filter(move |(place, _)| place.stream == stream);
        fits.map(|(place, newest)| (place.robot.as_str(), &newest.word))
    }
    /// Words that were too long, or one too many.
    #[must_use]
    pub const fn kept_out(&self) -> u64 {
        self.kept_out
    }
    /// A reader who is told the newest of everything first, and no event of the past.
    #[must_use]
    pub const fn reader(&self) -> Reader {
        Reader { version: 0, events: self.added }
    }
    /// What is new about `robot`, and about everybody; marks it as seen.
    pub fn news(&self, now: Seconds, reader: &mut Reader, robot: &str) -> News {
        let is_about = |place: &Place| place.robot == robot || place.robot == axle_schema::id::ALL;
        let changed = self.newest.iter().filter(|(_, newest)| newest.version > reader.version);
        let newest = changed
            .filter(|(place, _)| is_about(place))
            .map(|(place, newest)| (place.stream.clone(), now - newest.at, Arc::clone(&newest.word)))
            .collect();
        let forgotten = self.added - self.events.len() as u64;
        let lost = forgotten.saturating_sub(reader.events);
        // What is no longer kept cannot be passed over.
        let known = usize::try_from(reader.events.saturating_sub(forgotten)).unwrap_or(usize::MAX);
        let events = self.events.iter().skip(known).filter(|(place, _)| is_about(place));
        let events = events.map(|(place, word)| (place.stream.clone(), Arc::clone(word))).collect();
        *reader = Reader { version: self.version, events: self.added };
        News { newest, events, lost }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn word(text: &str) -> Word {
        text.into()
    }
    fn place(robot: &str, stream: &str) -> Place {
        Place { robot: robot.into(), stream: stream.into() }
    }
    fn said(news: &News) -> Vec<(&str, &str)> {
        news.newest.iter().map(|(stream, _, word)| (stream.as_str(), &**word)).collect()
    }

    #[test]
    fn a_slow_reader_gets_the_newest_and_nothing_twice() {
        let mut board = Board::default();
        let mut reader = board.reader();
        for number in 0..1000 {
            assert!(board.put(Seconds(0.01), place("r1", "navigator/pose"), word(&number.to_string())));
        }
        board.put(Seconds(0.0), place("r2", "navigator/pose"), word("-1"));
        board.put(Seconds(0.0), place("all", "services"), word("[]"));
        let news = board.news(Seconds(0.51), &mut reader, "r1");
        assert_eq!(said(&news), [("services", "[]"), ("navigator/pose", "999")]);
        assert!((news.newest[1].1.0 - 0.5).abs() < 1e-12, "its age");
        assert!(board.news(Seconds(0.6), &mut reader, "r1").is_empty());
        // Whoever turns to another robot starts anew.
        assert_eq!(said(&board.news(Seconds(1.0), &mut board.reader(), "r2")).len(), 2);
    }

    #[test]
    fn events_come_once_in_their_order_and_losses_are_counted() {
        let mut board = Board::default();
        board.add(place("r1", "log"), word("0"));
        let mut reader = board.reader();
        assert!(board.news(Seconds(0.0), &mut reader, "r1").is_empty(), "nothing of the past");
        for number in 1..=3 {
            board.add(place("r1", "log"), word(&number.to_string()));
            board.add(place("r2", "log"), word("-1"));
        }
        let news = board.news(Seconds(0.0), &mut reader, "r1");
        let texts: Vec<_> = news.events.iter().map(|(_, word)| &**word).collect();
        assert_eq!((texts, news.lost), (vec!["1", "2", "3"], 0));
        for number in 0..(MAX_EVENTS + 44) {
            board.add(place("r1", "log"), word(&number.to_string()));
        }
        let news = board.news(Seconds(0.0), &mut reader, "r1");
        assert_eq!((news.events.len(), news.lost), (MAX_EVENTS, 44));
        assert_eq!(&*news.events[0].1, "44");
        assert!(board.news(Seconds(0.0), &mut reader, "r1").is_empty());
    }

    #[test]
    fn a_flood_of_names_and_a_word_without_end_are_kept_out() {
        let mut board = Board::default();
        for number in 0..MAX_STREAMS + 10 {
            board.put(Seconds(0.0), place("r1", &number.to_string()), word("0"));
        }
        assert_eq!(board.kept_out(), 10);
        assert!(board.put(Seconds(0.0), place("r1", "3"), word("1")), "what is there is still renewed");
        let long = word(&format!("\"{}\"", "x".repeat(MAX_WORD)));
        assert!(!board.put(Seconds(0.0), place("r1", "3"), Arc::clone(&long)));
        board.add(place("r1", "log"), long);
        assert_eq!(board.kept_out(), 12);
        board.forget("r1");
        assert!(board.newest(Seconds(0.0), &place("r1", "3")).is_none());
    }
}
