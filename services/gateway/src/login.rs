//! Who may come in where the page wants a login: sessions of people, and how often somebody may try.
//!
//! Secrets are compared elsewhere, where there is a source of randomness; here a secret is a fingerprint that nobody can
//! turn back. Tries are counted for each name and for each address, in buckets that fill up again with time: whoever
//! guesses is slowed down to a try in some seconds, and a person who mistypes is not locked out. Everything is bounded:
//! when there is no room for one more, the one that was used least lately goes.

use axle_schema::{Refusal, RobotId, Seconds};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The most sessions at a time; of more, the one that was seen least lately ends.
pub const MAX_SESSIONS: usize = 256;
/// The most names and addresses whose tries are counted.
const MAX_BUCKETS: usize = 4096;
/// A session that nobody uses ends after this time.
pub const IDLE: Seconds = Seconds(2.0 * 3600.0);
/// How many tries an address has at once, and how soon it gets one back.
const OF_AN_ADDRESS: (f64, f64) = (10.0, 6.0);
/// The same for a name: more, since anybody can use up those of somebody else.
const OF_A_NAME: (f64, f64) = (20.0, 3.0);
/// The longest name.
pub const MAX_NAME: usize = 64;

/// What somebody may do from the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Looks at everything, and may stop.
    Viewer,
    /// Drives, gives tasks, and enables.
    Operator,
}

/// Somebody who is let in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Guest {
    /// The name; nobody's where no login is asked for.
    pub name: String,
    /// What they may do.
    pub role: Role,
    /// The robots that they may act on; none are all.
    pub only: Vec<RobotId>,
}

impl Guest {
    /// Whoever sits at this computer, where no login is asked for.
    #[must_use]
    pub const fn of_this_computer() -> Self {
        Self { name: String::new(), role: Role::Operator, only: Vec::new() }
    }
    /// Whether they may move a robot, or allow it to move.
    ///
    /// # Errors
    /// [`Refusal::Fenced`] says why not.
    pub fn may_move(&self, robot: &RobotId) -> Result<(), Refusal> {
        let name = &self.name;
        if self.role == Role::Viewer {
            let why = format!("{name} may look and stop; to drive, log in as an operator");
            return Err(Refusal::Fenced { why });
        }
        if !self.only.is_empty() && !self.only.contains(robot) {
            let only = self.only.iter().map(RobotId::as_str).collect::<Vec<_>>().join(", ");
            return Err(Refusal::Fenced { why: format!("{name} may move {only}, and not {robot}") });
        }
        Ok(())
    }
}

/// What a secret becomes that cannot be turned back.
pub type Fingerprint = [u8; 32];

#[derive(Debug)]
struct Session {
    guest: Guest,
    /// Of the secret by which they came in; a session ends when it is changed.
    by: Fingerprint,
    began: Seconds,
    seen: Seconds,
}

/// Who has logged in, by the fingerprint of what their browser shows.
#[derive(Debug)]
pub struct Sessions {
    lasts: Seconds,
    sessions: BTreeMap<Fingerprint, Session>,
}

impl Sessions {
    /// No sessions; each will last for so long at most.
    #[must_use]
    pub const fn new(lasts: Seconds) -> Self {
        Self { lasts, sessions: BTreeMap::new() }
    }
    /// Somebody has logged in by a secret; `id` is the fingerprint of what their browser will show.
    pub fn open(&mut self, now: Seconds, id: Fingerprint, guest: Guest, by: Fingerprint) {
        self.sweep(now);
        if self.sessions.len() >= MAX_SESSIONS
            && let Some(oldest) = least(&self.sessions, |session| session.seen)
        {
            self.sessions.remove(&oldest);
        }
        self.sessions.insert(id, Session { guest, by, began: now, seen: now });
    }
    /// Whose session it is, if it goes on.
    pub fn find(&mut self, now: Seconds, id: &Fingerprint) -> Option<Guest> {
        self.sweep(now);
        let session = self.sessions.get_mut(id)?;
        session.seen = now;
        Some(session.guest.clone())
    }
    /// Somebody logs out.
    pub fn close(&mut self, id: &Fingerprint) {
        self.sessions.remove(id);
    }
    /// Ends the sessions of those who are no longer known as they were.
    pub fn keep(&mut self, is_known: impl Fn(&Guest, &Fingerprint) -> bool) {
        self.sessions.retain(|_, session| is_known(&session.guest, &session.by));
    }
    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.sessions.len()
    }

    fn sweep(&mut self, now: Seconds) {
        let lasts = self.lasts;
        self.sessions
            .retain(|_, session| (now - session.began).0 < lasts.0 && (now - session.seen).0 < IDLE.0);
    }
}

/// The key whose time is the earliest.
fn least<K: Copy + Ord, V>(map: &BTreeMap<K, V>, time: impl Fn(&V) -> Seconds) -> Option<K> {
    map.iter().min_by(|(_, a), (_, b)| time(a).0.total_cmp(&time(b).0)).map(|(key, _)| *key)
}

/// How many tries are left, and when that was so.
#[derive(Debug)]
struct Bucket {
    left: f64,
    at: Seconds,
}

/// Who has tried to log in.
#[derive(Debug, Default)]
pub struct Tries {
    buckets: BTreeMap<String, Bucket>,
}

impl Tries {
    /// Whether this address may try this name now; it then has a try less.
    ///
    /// # Errors
    /// After how many seconds it may.
    pub fn take(&mut self, now: Seconds, address: &str, name: &str) -> Result<(), Seconds> {
        // Their names cannot be taken for each other.
        let keys = [(format!("a {address}"), OF_AN_ADDRESS), (format!("n {name}"), OF_A_NAME)];
        let wait = keys.iter().map(|(key, rule)| self.wait(now, key, *rule)).fold(0.0, f64::max);
        if wait > 0.0 {
            return Err(Seconds(wait));
        }
        for (key, rule) in keys {
            self.make_room(&key);
            let left = self.left(now, &key, rule) - 1.0;
            self.buckets.insert(key, Bucket { left, at: now });
        }
        Ok(())
    }
    /// They knew the secret: the try was none.
    pub fn give_back(&mut self, address: &str, name: &str) {
        for key in [format!("a {address}"), format!("n {name}")] {
            if let Some(bucket) = self.buckets.get_mut(&key) {
                bucket.left += 1.0;
            }
        }
    }

    fn left(&self, now: Seconds, key: &str, (most, every): (f64, f64)) -> f64 {
        self.buckets.get(key).map_or(most, |bucket| (bucket.left + (now - bucket.at).0 / every).min(most))
    }
    fn wait(&self, now: Seconds, key: &str, rule: (f64, f64)) -> f64 {
        ((1.0 - self.left(now, key, rule)) * rule.1).max(0.0)
    }
    fn make_room(&mut self, key: &str) {
        if self.buckets.len() < MAX_BUCKETS || self.buckets.contains_key(key) {
            return;
        }
        let oldest = self.buckets.iter().min_by(|(_, a), (_, b)| a.at.0.total_cmp(&b.at.0));
        if let Some(oldest) = oldest.map(|(key, _)| key.clone()) {
            self.buckets.remove(&oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guest(name: &str, role: Role, only: &[&str]) -> Guest {
        let only = only.iter().map(|robot| RobotId::new(robot).expect("a robot")).collect();
        Guest { name: name.into(), role, only }
    }
    fn id(number: usize) -> Fingerprint {
        let mut id = [0; 32];
        id[..8].copy_from_slice(&number.to_le_bytes());
        id
    }

    #[test]
    fn a_viewer_moves_nothing_and_an_operator_the_own_robots() {
        let [r1, r2] = ["r1", "r2"].map(|robot| RobotId::new(robot).expect("a robot"));
        for (guest, may) in [
            (Guest::of_this_computer(), [true, true]),
            (guest("ann", Role::Operator, &[]), [true, true]),
            (guest("bob", Role::Operator, &["r1"]), [true, false]),
            (guest("eve", Role::Viewer, &[]), [false, false]),
        ] {
            assert_eq!([&r1, &r2].map(|robot| guest.may_move(robot).is_ok()), may, "{guest:?}");
        }
        let refusal = guest("eve", Role::Viewer, &[]).may_move(&r1).expect_err("a viewer").to_string();
        assert!(refusal.contains("eve may look and stop"), "{refusal}");
    }

    #[test]
    fn a_session_ends_by_age_by_silence_by_logging_out_and_with_its_secret() {
        let ann = guest("ann", Role::Operator, &[]);
        let mut sessions = Sessions::new(Seconds(12.0 * 3600.0));
        let open = |sessions: &mut Sessions, at: f64| sessions.open(Seconds(at), id(1), ann.clone(), id(9));
        open(&mut sessions, 0.0);
        assert_eq!(sessions.find(Seconds(1.0), &id(1)), Some(ann.clone()));
        assert_eq!(sessions.find(Seconds(1.0), &id(2)), None, "nobody guesses it");
        assert_eq!(sessions.find(Seconds(2.0 + IDLE.0), &id(1)), None, "nobody used it");
        open(&mut sessions, 0.0);
        for hour in 0..12 {
            assert!(sessions.find(Seconds(f64::from(hour) * 3600.0), &id(1)).is_some(), "{hour}");
        }
        assert_eq!(sessions.find(Seconds(12.0 * 3600.0), &id(1)), None, "it is too old");
        open(&mut sessions, 0.0);
        sessions.close(&id(1));
        assert_eq!(sessions.find(Seconds(0.0), &id(1)), None);
        open(&mut sessions, 0.0);
        sessions.keep(|guest, by| guest.name == "ann" && *by == id(9));
        assert_eq!(sessions.count(), 1);
        sessions.keep(|_, by| *by == id(8));
        assert_eq!(sessions.count(), 0, "the secret was changed");
    }

    #[test]
    fn sessions_without_end_leave_the_newest() {
        let mut sessions = Sessions::new(Seconds(1e6));
        for number in 0..MAX_SESSIONS + 5 {
            #[allow(clippy::cast_precision_loss, reason = "small")]
            sessions.open(Seconds(number as f64), id(number), Guest::of_this_computer(), id(0));
        }
        assert_eq!(sessions.count(), MAX_SESSIONS);
        let now = Seconds(500.0);
        assert!(sessions.find(now, &id(4)).is_none() && sessions.find(now, &id(5)).is_some());
    }

    #[test]
    fn whoever_guesses_waits_and_whoever_knows_does_not() {
        let mut tries = Tries::default();
        let mut count = 0;
        let mut now = Seconds(0.0);
        // An hour of guessing from one address, as fast as it is let.
        while now.0 < 3600.0 {
            match tries.take(now, "10.0.0.7", "ann") {
                Ok(()) => count += 1,
                Err(wait) => {
                    assert!((0.0..=OF_AN_ADDRESS.1).contains(&wait.0), "{wait:?}");
                    now += wait;
                }
            }
        }
        assert!((600..=611).contains(&count), "{count} tries in an hour");
        // From many addresses at once the name is what slows them down.
        let many = |tries: &mut Tries, now| {
            (0..1000).filter(|number| tries.take(now, &format!("10.0.1.{number}"), "bob").is_ok()).count()
        };
        assert_eq!(many(&mut tries, Seconds(0.0)), 20);
        assert_eq!(many(&mut tries, Seconds(30.0)), 10);
        // Others come in meanwhile, and whoever knows the secret loses no try.
        for _ in 0..1000 {
            assert!(tries.take(Seconds(30.0), "10.0.2.1", "carl").is_ok());
            tries.give_back("10.0.2.1", "carl");
        }
    }

    #[test]
    fn a_flood_of_names_takes_a_bounded_room() {
        let mut tries = Tries::default();
        for number in 0..3 * MAX_BUCKETS {
            let taken = tries.take(Seconds(0.0), &format!("{number}"), &format!("{number}"));
            assert!(taken.is_ok(), "whoever is new may try");
        }
        assert!(tries.buckets.len() <= MAX_BUCKETS, "{}", tries.buckets.len());
    }
}
