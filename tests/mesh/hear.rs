//! Saying and hearing: queues are bounded, nobody slows anybody, and bad samples are counted and forgotten.

use super::question;
use crate::harness::{Meeting, PATIENCE, Stranger, declared, eventually, r1, within};
use axle_mesh::{Inbox, Retry, Tap};
use axle_schema::codec::encoding_of;
use axle_schema::{Dwm, EncodersData, Message as _, Metres, Plan, PlanAsk, Seconds, encode, key};
use std::io::Write;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::time::timeout;
use tracing_subscriber::fmt::MakeWriter;

fn reading(number: u32) -> EncodersData {
    EncodersData { stamp: Seconds(f64::from(number)), left: Metres(0.0), right: Metres(0.0) }
}

/// Takes the next messages until one has this stamp; how many came before it.
async fn until(inbox: &Inbox<EncodersData>, number: u32) -> usize {
    let mut before = 0;
    let coming = async {
        while inbox.next().await.message != reading(number) {
            before += 1;
        }
    };
    within(PATIENCE, &format!("reading {number} comes"), coming).await;
    before
}

#[tokio::test(flavor = "multi_thread")]
async fn an_inbox_keeps_the_newest_and_counts_what_it_forgot() {
    let meeting = Meeting::new().await;
    let (says, hears) = (meeting.join("says").await, meeting.join("hears").await);
    let key = key::ENCODERS.of(&r1());
    let inbox = hears.inbox(&key, 8).expect("an inbox");
    // A link that cannot take a burst drops some of it: each is said when the one before has come.
    let witness = hears.inbox(&key, 8).expect("an inbox");
    let publisher = says.publisher(&key).expect("a publisher");
    declared(&hears).await;
    for number in 1..=100 {
        publisher.put(&reading(number), None).expect("said");
        assert_eq!(until(&witness, number).await, 0);
    }
    eventually("92 are forgotten", || (inbox.dropped() == 92).then_some(())).await;
    let kept: Vec<_> = std::iter::from_fn(|| inbox.take()).collect();
    let numbers: Vec<_> = kept.iter().map(|heard| heard.message).collect();
    assert_eq!(numbers, (93..=100).map(reading).collect::<Vec<_>>());
    let sequence: Vec<_> = kept.iter().filter_map(|heard| Some(heard.meta?.seq)).collect();
    assert!(sequence.len() == 8 && sequence.is_sorted(), "{sequence:?}");
    assert!(kept.iter().all(|heard| heard.meta.is_some_and(|meta| meta.source == says.boot())));
    publisher.put(&reading(101), None).expect("said");
    publisher.put(&reading(102), None).expect("said");
    let newest =
        eventually("the last one comes", || inbox.latest().filter(|heard| heard.message == reading(102)));
    assert_eq!(newest.await.message, reading(102));
    assert!(inbox.latest().is_none(), "older ones are forgotten with it");
}

#[tokio::test(flavor = "multi_thread")]
async fn fifty_stuck_taps_slow_nobody() {
    let meeting = Meeting::new().await;
    let (says, hears, stuck) =
        (meeting.join("says").await, meeting.join("hears").await, meeting.join("stuck").await);
    let key = key::ENCODERS.of(&r1());
    // Nobody ever reads these; some stand in the very session of the reader.
    let taps: Vec<Tap> = (0..50)
        .map(|index| if index % 5 == 0 { &hears } else { &stuck }.tap("axle/r1/**", 4).expect("a tap"))
        .collect();
    let inbox = hears.inbox(&key, 256).expect("an inbox");
    let publisher = says.publisher(&key).expect("a publisher");
    let server = hears.server::<PlanAsk, Plan>(&key::PLAN.of_every_robot()).expect("a server");
    declared(&hears).await;
    declared(&stuck).await;
    let mut beat = says.beat(Seconds(0.02));
    for number in 1..=100 {
        beat.next().await;
        publisher.put(&reading(number), None).expect("said");
        assert_eq!(until(&inbox, number).await, 0, "each comes, and in its turn");
    }
    let (robot, ask) = (r1(), question());
    let asking = says.ask(&key::PLAN, Some(&robot), &ask, PATIENCE, Retry::Never);
    let answering = async { server.next().await.reply(Ok(Plan::default())) };
    assert_eq!(
        within(PATIENCE, "an answer", async { tokio::join!(asking, answering).0 }).await,
        Ok(Plan::default())
    );
    eventually("the taps forgot", || taps.iter().all(|tap| tap.dropped() == 96).then_some(())).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn ten_megabytes_on_a_typed_key_are_counted_and_not_kept() {
    let meeting = Meeting::new().await;
    let hears = meeting.join("hears").await;
    let stranger = Stranger::join(&meeting.endpoint).await;
    let key = key::ENCODERS.of(&r1());
    let inbox = hears.inbox(&key, 64).expect("an inbox");
    declared(&hears).await;
    stranger.say(key.as_str(), "", vec![0; 10_000_000]);
    stranger.say(key.as_str(), "", vec![0; EncodersData::LIMIT + 1]);
    stranger.say(key.as_str(), "", encode(&reading(7)).expect("a reading"));
    assert_eq!(until(&inbox, 7).await, 0);
    assert_eq!((hears.counters().refused.load(Relaxed), hears.counters().received.load(Relaxed)), (2, 1));
    assert_eq!(inbox.dropped(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn more_than_a_link_takes_hurts_only_its_sender() {
    let meeting = Meeting::new().await;
    let (says, hears) = (meeting.join("says").await, meeting.join("hears").await);
    let stranger = Stranger::join(&meeting.endpoint).await;
    let key = key::ENCODERS.of(&r1());
    let inbox = hears.inbox(&key, 64).expect("an inbox");
    declared(&hears).await;
    let publisher = says.publisher(&key).expect("a publisher");
    // Links take 16 MiB; whether this one is dropped or the link of its sender closed is up to Zenoh.
    stranger.say(key.as_str(), "", vec![0; 20_000_000]);
    let arrives = async {
        let mut number = 0;
        loop {
            number += 1;
            publisher.put(&reading(number), None).expect("said");
            if timeout(Duration::from_millis(50), inbox.next()).await.is_ok() {
                return;
            }
        }
    };
    within(PATIENCE, "others are heard as before", arrives).await;
}

/// Keeps the log of a thread.
#[derive(Clone, Default)]
struct Kept(Arc<Mutex<Vec<u8>>>);

impl Write for Kept {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().expect("no reader breaks down").extend(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
impl<'a> MakeWriter<'a> for Kept {
    type Writer = Self;
    fn make_writer(&'a self) -> Self {
        self.clone()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_samples_are_counted_and_complained_of_once_and_the_loop_goes_on() {
    let meeting = Meeting::new().await;
    let hears = meeting.join("hears").await;
    let stranger = Stranger::join(&meeting.endpoint).await;
    let key = key::ENCODERS.of(&r1());
    let inbox = hears.inbox(&key, 64).expect("an inbox");
    declared(&hears).await;
    let fine = encode(&reading(1)).expect("a reading");
    stranger.say(key.as_str(), &encoding_of::<Dwm>(), fine.clone());
    stranger.say(key.as_str(), "application/cbor;axle.EncodersData.v2", fine.clone());
    stranger.say(key.as_str(), "text/plain", b"hello".to_vec());
    stranger.say(key.as_str(), "", fine[..fine.len() - 1].to_vec());
    stranger.say(key.as_str(), "", vec![0x81; 200]);
    stranger.say(key.as_str(), "", Vec::new());
    // What a plain client may say: no encoding, no attachment, integers for floats.
    let plain = [&b"\xa3\x65stamp\x02\x64left"[..], b"\x00\x65right\x00"].concat();
    stranger.say(key.as_str(), "", plain);
    let kept = Kept::default();
    let log = tracing_subscriber::fmt().with_writer(kept.clone()).with_ansi(false).finish();
    // The log is that of this thread, on which the reading is done too: a test's own future never leaves it.
    let logging = tracing::subscriber::set_default(log);
    let heard = eventually("the plain reading comes", || inbox.take()).await;
    drop(logging);
    assert_eq!((heard.message, heard.meta), (reading(2), None));
    assert_eq!(hears.counters().refused.load(Relaxed), 6);
    let log = String::from_utf8(kept.0.lock().expect("the log").clone()).expect("text");
    let first = log.lines().next().unwrap_or_default();
    for words in ["WARN", "axle/r1/robot/encoders", "refused=1", "wrong type", "axle.Dwm.v1"] {
        assert!(first.contains(words), "{first:?} does not say {words:?}");
    }
    assert!(log.lines().count() < 6, "a flood of bad samples is no flood of logs: {log}");
}

#[tokio::test(flavor = "multi_thread")]
async fn every_key_is_a_key_of_zenoh() {
    let meeting = Meeting::new().await;
    let hears = meeting.join("hears").await;
    let stranger = Stranger::join(&meeting.endpoint).await;
    let robots = ["r1", "robots-with-a-name-of-32-letters", "all"];
    let keys = key::TABLE.iter().flat_map(|entry| {
        let service = if entry.service == key::ANY_CORRECTOR { "d-corrector" } else { entry.service };
        robots.map(|robot| format!("axle/{robot}/{service}/{}", entry.name))
    });
    let taps: Vec<(String, Tap)> = keys
        .map(|key| {
            hears.tap(&key.replacen("r1", "*", 1), 1).unwrap_or_else(|why| panic!("{key}: {why}"));
            let tap = hears.tap(&key, 4).unwrap_or_else(|why| panic!("{key}: {why}"));
            (key, tap)
        })
        .collect();
    declared(&hears).await;
    for (key, tap) in taps {
        stranger.say(&key, "", b"x".to_vec());
        let raw = within(PATIENCE, &format!("{key} is heard"), tap.next()).await;
        assert_eq!(raw.key, key, "it means itself");
        assert!(key::find(&key).is_some(), "{key} is found in the table");
    }
    for wrong in ["/axle", "axle/", "axle//x", "a#b", "a?b", ""] {
        let Err(fault) = hears.tap(wrong, 1) else { panic!("{wrong:?} is taken") };
        assert!(fault.to_string().contains(&format!("{wrong:?} is not a key expression")), "{fault}");
    }
}
