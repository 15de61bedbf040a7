//! Foxglove's WebSocket protocol, the part of a server that shows and takes nothing: what Foxglove, Lichtblick and other
//! viewers watch live, in the same channels that a recording has.
//!
//! Every channel keeps its newest messages on a shelf, whatever the number of viewers. A viewer has a place on each shelf
//! that it subscribes to: when it reads slowly the shelf moves on, and it is told how many messages it missed. So nothing
//! grows with slow viewers, and nobody waits for them. Names and numbers are those of
//! <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>.

use serde::Deserialize;
use serde_json::json;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// What a viewer may call the protocol; both mean this part of it.
pub const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// The most channels.
pub const MAX_CHANNELS: usize = 512;
/// The most messages that a channel keeps, and the most bytes of one.
pub const KEPT: usize = 64;
/// See [`KEPT`].
pub const MAX_MESSAGE: usize = 512 * 1024;
/// The most that a viewer may say at once, in bytes.
pub const MAX_WORD: usize = 64 * 1024;
/// The most subscriptions of a viewer.
pub const MAX_SUBSCRIPTIONS: usize = 1024;
/// A viewer is handed about so many bytes at a time, and then asked whether it has taken them.
const HANDFUL: usize = 1024 * 1024;

/// Everything that can be watched.
#[derive(Debug, Default)]
pub struct Shelf {
    channels: Vec<Channel>,
    numbers: BTreeMap<String, usize>,
}

#[derive(Debug)]
struct Channel {
    topic: String,
    schema_name: String,
    schema: String,
    /// How many messages it ever had; the last of them are kept.
    added: u64,
    messages: VecDeque<(u64, Arc<str>)>,
    watched: usize,
}

impl Shelf {
    /// Makes a channel known, unless it is already; its messages are JSON of this JSON schema. Whether anybody watches it.
    pub fn open(&mut self, topic: &str, schema_name: &str, schema: impl FnOnce() -> String) -> bool {
        if let Some(number) = self.numbers.get(topic) {
            return self.channels[*number].watched > 0;
        }
        if self.channels.len() < MAX_CHANNELS {
            self.numbers.insert(topic.to_owned(), self.channels.len());
            self.channels.push(Channel {
                topic: topic.to_owned(),
                schema_name: schema_name.to_owned(),
                schema: schema(),
                added: 0,
                messages: VecDeque::new(),
                watched: 0,
            });
        }
        false
    }
    /// Adds a message to an open channel; `at` is in nanoseconds since 1970.
    pub fn put(&mut self, topic: &str, at: u64, text: Arc<str>) {
        let Some(channel) = self.numbers.get(topic).and_then(|number| self.channels.get_mut(*number)) else {
            return;
        };
        if text.len() <= MAX_MESSAGE {
            channel.added += 1;
            if channel.messages.len() == KEPT {
                channel.messages.pop_front();
            }
            channel.messages.push_back((at, text));
        }
    }
    /// How many channels there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.channels.len()
    }
}

/// What a viewer is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Frame {
    /// JSON.
    Text(String),
    /// A message of a channel.
    Binary(Vec<u8>),
}

/// The first word of the server.
#[must_use]
pub fn greeting(version: &str, session: u64) -> Frame {
    let greeting = json!({
        "op": "serverInfo", "name": format!("Axle {version}"), "capabilities": [], "supportedEncodings": [],
        "metadata": { "axle": version }, "sessionId": format!("{session:016x}"),
    });
    Frame::Text(greeting.to_string())
}

/// What a viewer may say.
#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum Word {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    /// Everything that asks for what is not offered.
    #[serde(other)]
    Other,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: usize,
}

/// One viewer: which channels it knows, and what of them it has been sent.
#[derive(Debug, Default)]
pub struct Viewer {
    known: usize,
    /// By the number that the viewer has given it.
    subscriptions: BTreeMap<u32, Place>,
    missed: u64,
    told: u64,
    complaints: VecDeque<String>,
}

#[derive(Debug)]
struct Place {
    channel: usize,
    seen: u64,
}

impl Viewer {
    /// Takes what a viewer says. What is wrong with it it is told, and nothing comes of it.
    pub fn hear(&mut self, shelf: &mut Shelf, text: &str) {
        if text.len() > MAX_WORD {
            return self.complain(format!("a word has at most {MAX_WORD} bytes"));
        }
        match serde_json::from_str(text) {
            Ok(Word::Subscribe { subscriptions }) => {
                for Subscription { id, channel_id } in subscriptions {
                    self.subscribe(shelf, id, channel_id);
                }
            }
            Ok(Word::Unsubscribe { subscription_ids }) => {
                for id in subscription_ids {
                    match self.subscriptions.remove(&id) {
                        Some(place) => shelf.channels[place.channel].watched -= 1,
                        None => self.complain(format!("there is no subscription {id}")),
                    }
                }
            }
            Ok(Word::Other) => self.complain("nothing can be said here: this server only shows".to_owned()),
            Err(fault) => self.complain(format!("not understood: {fault}")),
        }
    }
    fn subscribe(&mut self, shelf: &mut Shelf, id: u32, number: usize) {
        let count = self.subscriptions.len();
        // A channel that it has not been told of is none.
        let Some(channel) = shelf.channels.get_mut(number).filter(|_| number < self.known) else {
            return self.complain(format!("there is no channel {number}"));
        };
        if self.subscriptions.contains_key(&id) {
            return self.complain(format!("the subscription {id} is there already"));
        }
        if count >= MAX_SUBSCRIPTIONS {
            return self.complain(format!("at most {MAX_SUBSCRIPTIONS} subscriptions"));
        }
        channel.watched += 1;
        // The newest message first, however old: a plan is said once, and is still the plan.
        let seen = channel.added.saturating_sub(1);
        self.subscriptions.insert(id, Place { channel: number, seen });
    }
    /// The viewer is gone.
    pub fn leave(&mut self, shelf: &mut Shelf) {
        for (_, place) in std::mem::take(&mut self.subscriptions) {
            shelf.channels[place.channel].watched -= 1;
        }
    }
    /// What is next to be sent: not much more than a handful.
    pub fn next(&mut self, shelf: &Shelf) -> Vec<Frame> {
        let mut frames: Vec<_> = self.complaints.drain(..).map(|text| status(2, &text)).collect();
        if self.known < shelf.channels.len() {
            frames.push(advertisement(&shelf.channels, self.known));
            self.known = shelf.channels.len();
        }
        let mut bytes = 0;
        for (id, place) in &mut self.subscriptions {
            let channel = &shelf.channels[place.channel];
            let forgotten = channel.added - channel.messages.len() as u64;
            self.missed += forgotten.saturating_sub(place.seen);
            place.seen = place.seen.max(forgotten);
            while place.seen < channel.added && bytes < HANDFUL {
                let kept =
                    usize::try_from(place.seen - forgotten).ok().and_then(|at| channel.messages.get(at));
                let Some((at, text)) = kept else { break };
                let mut frame = Vec::with_capacity(13 + text.len());
                frame.push(1);
                frame.extend_from_slice(&id.to_le_bytes());
                frame.extend_from_slice(&at.to_le_bytes());
                frame.extend_from_slice(text.as_bytes());
                bytes += frame.len();
                frames.push(Frame::Binary(frame));
                place.seen += 1;
            }
        }
        if self.missed > self.told {
            let count = self.missed - self.told;
            frames
                .push(status(1, &format!("{count} messages were left out: this viewer or its link is slow")));
            self.told = self.missed;
        }
        frames
    }
    /// How many messages it missed.
    #[must_use]
    pub const fn missed(&self) -> u64 {
        self.missed
    }

    fn complain(&mut self, text: String) {
        // Whoever says much that is wrong is not told of all of it.
        if self.complaints.len() < 16 {
            self.complaints.push_back(text.chars().take(200).collect());
        }
    }
}

/// 1 is a warning, 2 an error.
fn status(level: u8, text: &str) -> Frame {
    Frame::Text(json!({ "op": "status", "level": level, "message": text }).to_string())
}

fn advertisement(channels: &[Channel], from: usize) -> Frame {
    let channels = channels.iter().enumerate().skip(from).map(|(id, channel)| {
        json!({
            "id": id, "topic": channel.topic, "encoding": "json", "schemaName": channel.schema_name,
            "schema": channel.schema, "schemaEncoding": "jsonschema",
        })
    });
    Frame::Text(json!({ "op": "advertise", "channels": channels.collect::<Vec<_>>() }).to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    fn shelf(topics: &[&str]) -> Shelf {
        let mut shelf = Shelf::default();
        for topic in topics {
            shelf.open(topic, "foxglove.Log", || "{}".into());
        }
        shelf
    }
    fn texts(frames: &[Frame]) -> Vec<Value> {
        let texts = frames.iter().filter_map(|frame| match frame {
            Frame::Text(text) => Some(serde_json::from_str(text).expect("JSON")),
            Frame::Binary(_) => None,
        });
        texts.collect()
    }
    /// Subscription, time and text of each message.
    fn messages(frames: &[Frame]) -> Vec<(u32, u64, String)> {
        let parts = frames.iter().filter_map(|frame| match frame {
            Frame::Binary(bytes) => Some((
                u32::from_le_bytes(bytes[1..5].try_into().expect("four")),
                u64::from_le_bytes(bytes[5..13].try_into().expect("eight")),
                String::from_utf8(bytes[13..].to_vec()).expect("a text"),
            )),
            Frame::Text(_) => None,
        });
        parts.collect()
    }

    #[test]
    fn a_viewer_is_told_of_channels_and_gets_what_it_subscribes_to() {
        let mut shelf = shelf(&["/r1/pose", "/log"]);
        let mut viewer = Viewer::default();
        let said = texts(&viewer.next(&shelf));
        assert_eq!(said.len(), 1);
        assert_eq!(said[0]["op"], "advertise");
        assert_eq!(said[0]["channels"][1]["topic"], "/log");
        assert_eq!(said[0]["channels"][1]["schemaEncoding"], "jsonschema");
        assert!(viewer.next(&shelf).is_empty(), "once");
        shelf.put("/r1/pose", 7, "1".into());
        shelf.put("/r1/pose", 8, "2".into());
        assert!(!shelf.open("/r1/pose", "", String::new), "nobody watches");
        viewer.hear(&mut shelf, r#"{"op":"subscribe","subscriptions":[{"id":5,"channelId":0}]}"#);
        assert!(shelf.open("/r1/pose", "", String::new));
        assert_eq!(messages(&viewer.next(&shelf)), [(5, 8, "2".into())], "the newest, however old");
        shelf.put("/r1/pose", 9, "3".into());
        shelf.put("/log", 9, "x".into());
        assert_eq!(messages(&viewer.next(&shelf)), [(5, 9, "3".into())]);
        viewer.hear(&mut shelf, r#"{"op":"unsubscribe","subscriptionIds":[5]}"#);
        shelf.put("/r1/pose", 10, "4".into());
        assert!(viewer.next(&shelf).is_empty());
        assert!(!shelf.open("/r1/pose", "", String::new));
        // A channel that comes later is told too.
        shelf.open("/r2/pose", "foxglove.PoseInFrame", || "{}".into());
        let said = texts(&viewer.next(&shelf));
        assert_eq!(
            (&said[0]["channels"][0]["id"], said[0]["channels"].as_array().map(Vec::len)),
            (&json!(2), Some(1))
        );
        viewer.hear(&mut shelf, r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":2}]}"#);
        viewer.leave(&mut shelf);
        assert!(!shelf.open("/r2/pose", "", String::new));
    }

    #[test]
    fn a_slow_viewer_misses_what_is_old_and_is_told_how_much() {
        let mut shelf = shelf(&["/r1/pose", "/r1/plan"]);
        let mut viewer = Viewer::default();
        viewer.next(&shelf);
        let both = r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":0},{"id":2,"channelId":1}]}"#;
        viewer.hear(&mut shelf, both);
        shelf.put("/r1/plan", 1, "plan".into());
        for at in 0..1000 {
            shelf.put("/r1/pose", at, at.to_string().into());
        }
        let frames = viewer.next(&shelf);
        let got = messages(&frames);
        assert_eq!(got.len(), KEPT + 1);
        assert_eq!(got[0].2, (1000 - KEPT).to_string());
        assert_eq!(got[KEPT].2, "plan", "what is said seldom is not pushed out by what is said often");
        assert_eq!(viewer.missed(), 1000 - KEPT as u64);
        assert!(texts(&frames)[0]["message"].as_str().expect("a text").starts_with("936 messages"));
        // Large messages come a handful at a time, and none is lost for it.
        let large: Arc<str> = "x".repeat(MAX_MESSAGE).into();
        for at in 0..4 {
            shelf.put("/r1/plan", at, Arc::clone(&large));
        }
        shelf.put("/r1/plan", 9, "x".repeat(MAX_MESSAGE + 1).into());
        let handfuls: Vec<_> = (0..3).map(|_| messages(&viewer.next(&shelf)).len()).collect();
        assert_eq!(handfuls, [2, 2, 0]);
    }

    #[test]
    fn what_makes_no_sense_is_told_and_does_nothing() {
        let mut shelf = shelf(&["/log"]);
        let mut viewer = Viewer::default();
        viewer.hear(&mut shelf, r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":0}]}"#);
        assert_eq!(
            texts(&viewer.next(&shelf))[0]["message"],
            "there is no channel 0",
            "it was not told of it"
        );
        for (text, words) in [
            ("", "not understood"),
            ("[", "not understood"),
            (r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":0}]}"#, "not understood"),
            (r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":7}]}"#, "no channel 7"),
            (r#"{"op":"unsubscribe","subscriptionIds":[3]}"#, "no subscription 3"),
            (r#"{"op":"advertise","channels":[]}"#, "only shows"),
            (r#"{"op":"setParameters","parameters":[]}"#, "only shows"),
            (&format!("\"{}\"", "x".repeat(MAX_WORD)), "bytes"),
        ] {
            viewer.hear(&mut shelf, text);
            let said = texts(&viewer.next(&shelf));
            assert_eq!(
                (said.len(), &said[0]["op"], &said[0]["level"]),
                (1, &json!("status"), &json!(2)),
                "{text}"
            );
            assert!(said[0]["message"].as_str().expect("a text").contains(words), "{said:?} says {words:?}");
        }
        for id in 0..MAX_SUBSCRIPTIONS + 1 {
            viewer.hear(
                &mut shelf,
                &format!(r#"{{"op":"subscribe","subscriptions":[{{"id":{id},"channelId":0}}]}}"#),
            );
        }
        assert_eq!(viewer.subscriptions.len(), MAX_SUBSCRIPTIONS);
        for _ in 0..1000 {
            viewer.hear(&mut shelf, "nonsense");
        }
        assert!(viewer.next(&shelf).len() <= 17);
    }

    #[test]
    fn a_flood_of_topics_is_kept_out() {
        let mut shelf = Shelf::default();
        for number in 0..2 * MAX_CHANNELS {
            shelf.open(&number.to_string(), "", String::new);
            shelf.put(&number.to_string(), 0, "1".into());
        }
        assert_eq!(shelf.count(), MAX_CHANNELS);
    }
}
