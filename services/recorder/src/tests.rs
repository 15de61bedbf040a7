//! What is written comes back, whatever happens to the file.

mod shown;

use super::*;
use axle_schema::meta::{Cause, Meta};
use axle_schema::{Boot, Dwm, Message, encode};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// A folder of its own for one test, gone afterwards.
struct Folder(PathBuf);
impl Folder {
    fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("axle-recorder-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a folder for the test");
        Self(path)
    }
    fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}
impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).ok();
    }
}

const SECOND: u64 = 1_000_000_000;
const NOON: u64 = 1_700_000_000 * SECOND;
const KEY: &str = "r1/robot/encoders";

fn recorder(path: &Path) -> Recorder {
    let about = BTreeMap::from([("version".to_owned(), "0.1.0".to_owned())]);
    Recorder::create(path, &about, &RecorderParams::default(), NOON).expect("a new file")
}

fn sample<'a>(payload: &'a [u8], attachment: Option<&'a [u8]>, received: u64) -> Sample<'a> {
    Sample { key: KEY, encoding: "application/cbor;axle.Dwm.v1", payload, attachment, received }
}

fn meta(seq: u64) -> Vec<u8> {
    let cause = Some(Cause { source: Boot(7), seq: seq + 1 });
    encode(&Meta { seq, source: Boot(9), stamp: 1.7e9 + 0.25, cause }).expect("a meta")
}

fn samples(path: &Path) -> (Vec<Recorded>, Account) {
    let mut recording = Recording::open(path).expect("an MCAP file");
    let samples = recording
        .by_ref()
        .filter_map(|entry| match entry {
            Entry::Sample(sample) => Some(sample),
            Entry::Gap { .. } => None,
        })
        .collect();
    (samples, recording.account().clone())
}

#[test]
fn the_shipped_file_says_the_defaults() {
    let shipped: RecorderParams = toml::from_str(RecorderParams::FILE).expect("the file is TOML");
    assert_eq!(shipped, RecorderParams::default());
    shipped.check().expect("the defaults are within their ranges");
}

#[test]
fn params_outside_their_ranges_are_refused_by_name() {
    for (text, words) in [
        ("flush = 2", "flush in s is out of range: 2, allowed is 0.1 to 1"),
        ("flush = 0", "flush in s is out of range: 0"),
        ("file_gb = 0", "file_gb in GB is out of range: 0"),
    ] {
        let params: RecorderParams = toml::from_str(text).expect("well-formed");
        let refusal = params.check().expect_err(text).to_string();
        assert!(refusal.contains(words), "{text} says {refusal:?}");
    }
    assert!(toml::from_str::<RecorderParams>("flsuh = 1").is_err(), "a misspelt field is refused");
}

#[test]
fn what_is_written_comes_back() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    let dwm = encode(&Dwm::rest(Seconds(0.5))).expect("a dwm");
    let attachment = meta((1 << 40) + 5);
    let mut recorder = recorder(&path);
    recorder.write(sample(&dwm, Some(&attachment), NOON + 1)).expect("room");
    recorder.write(sample(b"", None, NOON + 2)).expect("room");
    let other =
        Sample { key: "x", encoding: "text/plain", payload: b"hi", attachment: Some(b"?"), received: NOON };
    recorder.write(other).expect("room");
    recorder.write(Sample { encoding: "", ..other }).expect("room");
    recorder.gap("a \"quoted\" key", 3, NOON + 9).expect("room");
    let totals = recorder.finish().expect("room");
    assert_eq!((totals.samples, totals.lost, totals.refused), (4, 3, 0));

    let mut recording = Recording::open(&path).expect("an MCAP file");
    let entries: Vec<Entry> = recording.by_ref().collect();
    let recorded =
        |key: &str, encoding: &str, payload: &[u8], attachment: Option<&[u8]>, received, published| {
            let (payload, attachment) = (payload.to_vec(), attachment.map(<[u8]>::to_vec));
            Entry::Sample(Recorded {
                key: key.into(),
                encoding: encoding.into(),
                payload,
                attachment,
                received,
                published,
            })
        };
    let cbor = "application/cbor;axle.Dwm.v1";
    assert_eq!(
        entries,
        [
            recorded(KEY, cbor, &dwm, Some(&attachment), NOON + 1, 1_700_000_000_250_000_000),
            recorded(KEY, cbor, b"", None, NOON + 2, NOON + 2),
            recorded("x", "text/plain", b"hi", Some(b"?"), NOON, NOON),
            recorded("x", "", b"hi", Some(b"?"), NOON, NOON),
            Entry::Gap { key: "a \"quoted\" key".into(), lost: 3, at: NOON + 9 },
        ]
    );
    assert_eq!(recording.account(), &Account { samples: 4, lost: 3, damaged: 0, finished: true, cut: None });
}

#[test]
fn a_strict_reader_finds_channels_schemas_and_an_index() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    let mut recorder = recorder(&path);
    let attachment = meta(77);
    recorder.write(sample(b"x", Some(&attachment), NOON + 1)).expect("room");
    recorder.gap(KEY, 2, NOON + 2).expect("room");
    recorder.finish().expect("room");
    let bytes = std::fs::read(&path).expect("the file");
    let summary = mcap::Summary::read(&bytes).expect("an index").expect("an index");
    assert_eq!(summary.stats.expect("counts").message_count, 3);
    let messages: Vec<_> =
        mcap::MessageStream::new(&bytes).expect("MCAP").map(|m| m.expect("a message")).collect();
    let [meta, dwm, gap] = messages.as_slice() else { panic!("three messages") };
    assert_eq!((dwm.channel.topic.as_str(), dwm.channel.message_encoding.as_str()), (KEY, "cbor"));
    assert_eq!((dwm.sequence, dwm.publish_time, dwm.log_time), (77, 1_700_000_000_250_000_000, NOON + 1));
    let schema = dwm.channel.schema.as_ref().expect("a schema");
    assert_eq!((schema.name.as_str(), schema.encoding.as_str()), ("axle.Dwm.v1", "cddl"));
    assert!(std::str::from_utf8(&schema.data).expect("text").contains("\nDwm = {"));
    assert_eq!(meta.channel.topic, format!("{KEY}{META_SUFFIX}"));
    assert_eq!(meta.channel.schema.as_ref().expect("a schema").name, format!("axle.{}.v1", Meta::NAME));
    assert_eq!((gap.channel.topic.as_str(), gap.channel.message_encoding.as_str()), (GAP_TOPIC, "json"));
}

/// A file of four flushed chunks and its index, with how many samples the first n bytes must give back.
fn flushed(path: &Path, finish: bool) -> Vec<(u64, u64)> {
    let mut marks = vec![(0, 0)];
    let mut recorder = recorder(path);
    for index in 0..20 {
        let attachment = meta(index);
        recorder.write(sample(&index.to_le_bytes(), Some(&attachment), NOON + index)).expect("room");
        if index % 5 == 4 {
            recorder.flush(NOON + index).expect("room");
            marks.push((std::fs::metadata(path).expect("the file").len(), index + 1));
        }
    }
    if finish {
        recorder.finish().expect("room");
    } else {
        // As a crash does it: neither the index nor the end is written.
        std::mem::forget(recorder);
    }
    marks
}

#[test]
fn a_file_cut_anywhere_opens_and_keeps_all_that_was_flushed() {
    let folder = Folder::new();
    let (path, short) = (folder.file("a.mcap"), folder.file("cut.mcap"));
    let marks = flushed(&path, true);
    let bytes = std::fs::read(&path).expect("the file");
    for length in 0..=bytes.len() {
        std::fs::write(&short, &bytes[..length]).expect("room");
        let (found, account) = samples(&short);
        let promised = marks.iter().rev().find(|(size, _)| *size <= length as u64).expect("a mark").1;
        assert!(
            found.len() as u64 >= promised,
            "{length} bytes give {} samples, not {promised}",
            found.len()
        );
        assert_eq!(found.len() as u64, account.samples);
        assert_eq!(account.finished, length == bytes.len(), "{length}: {account:?}");
        assert_eq!(account.cut.is_none(), length == bytes.len(), "{length}: {account:?}");
        assert_eq!(account.damaged, 0, "{length}: {account:?}");
        for (index, sample) in (0_u64..).zip(&found) {
            assert_eq!(sample.payload, index.to_le_bytes());
            assert_eq!(sample.attachment.as_deref(), Some(&meta(index)[..]));
        }
    }
}

#[test]
fn a_recorder_that_is_killed_leaves_all_that_was_flushed() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    flushed(&path, false);
    let (found, account) = samples(&path);
    assert_eq!(found.len(), 20);
    assert_eq!((account.finished, account.damaged), (false, 0));
    assert!(account.cut.is_some_and(|cut| cut.contains("without its index")));
}

#[test]
fn a_tail_of_zeros_is_a_cut() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    flushed(&path, false);
    let mut bytes = std::fs::read(&path).expect("the file");
    bytes.extend([0; 5000]);
    std::fs::write(&path, &bytes).expect("room");
    let (found, account) = samples(&path);
    assert_eq!(found.len(), 20);
    assert!(account.cut.is_some_and(|cut| cut.contains("in zeros")));
}

#[test]
fn a_flipped_bit_spares_what_is_before_it_and_never_invents_a_sample() {
    let folder = Folder::new();
    let (path, bad) = (folder.file("a.mcap"), folder.file("bad.mcap"));
    let marks = flushed(&path, true);
    let bytes = std::fs::read(&path).expect("the file");
    for at in 0..bytes.len() {
        let mut wrong = bytes.clone();
        wrong[at] ^= 1 << (at % 8);
        std::fs::write(&bad, &wrong).expect("room");
        let Ok(mut recording) = Recording::open(&bad) else {
            assert!(at < mcap::MAGIC.len(), "a file that begins as MCAP opens");
            continue;
        };
        let before = marks.iter().rev().find(|(size, _)| *size <= at as u64).expect("a mark").1;
        let found: Vec<_> = recording.by_ref().collect();
        assert!(found.len() as u64 >= before, "byte {at}: {} of {before} samples", found.len());
        let numbers: Vec<u64> = found.iter().filter_map(number).collect();
        assert_eq!(numbers.len(), found.len(), "byte {at}: a sample that was never written");
        assert!(numbers.is_sorted_by(|a, b| a < b), "byte {at}: a sample came twice: {numbers:?}");
    }
}

/// Which sample of [`flushed`] this is, whole and with its attachment.
fn number(entry: &Entry) -> Option<u64> {
    let Entry::Sample(sample) = entry else { return None };
    let number = u64::from_le_bytes(sample.payload.as_slice().try_into().ok()?);
    (sample.attachment.as_ref() == Some(&meta(number)) && sample.received == NOON + number).then_some(number)
}

#[test]
fn a_recorder_may_live_in_a_thread() {
    fn check<T: Send + 'static>() {}
    check::<Recorder>();
    check::<Recording>();
}

#[test]
fn a_chunk_is_flushed_when_its_time_has_come() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    let mut recorder = recorder(&path);
    recorder.write(sample(b"x", None, NOON)).expect("room");
    assert!(!recorder.flush_if_due(NOON + SECOND - 1).expect("room"), "too early");
    assert_eq!(samples(&path).0.len(), 0);
    assert!(recorder.flush_if_due(NOON + SECOND).expect("room"), "in time");
    assert_eq!(samples(&path).0.len(), 1);
    recorder.write(sample(b"y", None, NOON)).expect("room");
    assert!(recorder.flush_if_due(NOON - SECOND).expect("room"), "the clock was set back: better too often");
    assert_eq!(samples(&path).0.len(), 2);
}

#[test]
fn a_chunk_is_flushed_when_it_is_large() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    let mut recorder = recorder(&path);
    let payload = vec![7; 1000];
    let mut unsafe_most = 0;
    for index in 1..=1000 {
        recorder.write(sample(&payload, None, NOON)).expect("room");
        unsafe_most = unsafe_most.max(index - samples_if(index, &path));
    }
    assert!(unsafe_most * payload.len() <= CHUNK, "{unsafe_most} samples were unsafe");
}

/// Counting is slow: only every 50th time.
fn samples_if(index: usize, path: &Path) -> usize {
    if index.is_multiple_of(50) { samples(path).0.len() } else { index }
}

#[test]
fn what_is_too_large_or_too_many_is_refused_and_the_rest_is_recorded() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    let mut recorder = recorder(&path);
    let large = vec![0; MAX_PAYLOAD + 1];
    let refused = |outcome: Result<(), RecordError>, words: &str| {
        let fault = outcome.expect_err(words);
        assert!(!fault.is_final(), "{fault} is about one sample");
        assert!(fault.to_string().contains(words), "{fault} does not say {words:?}");
    };
    refused(
        recorder.write(sample(&large, None, NOON)),
        "the payload of a sample on r1/robot/encoders has 8388609 bytes",
    );
    refused(recorder.write(sample(b"", Some(&large), NOON)), "the attachment of a sample");
    let long = "k".repeat(MAX_NAME + 1);
    refused(recorder.write(Sample { key: &long, ..sample(b"", None, NOON) }), "the key of a sample");
    refused(recorder.gap(&long, 1, NOON), "the key of a sample");
    recorder.write(sample(&large[1..], None, NOON)).expect("just not too large");
    for number in 1..MAX_CHANNELS {
        let key = format!("k{number}");
        recorder.write(Sample { key: &key, ..sample(b"", None, NOON) }).expect("room");
    }
    refused(
        recorder.write(Sample { key: "one more", ..sample(b"", None, NOON) }),
        "one more is not recorded",
    );
    recorder.write(sample(b"known", None, NOON)).expect("a known key still has its channel");
    let totals = recorder.finish().expect("room");
    assert_eq!((totals.samples, totals.refused), (MAX_CHANNELS as u64 + 1, 4));
    assert_eq!(samples(&path).0.len(), MAX_CHANNELS + 1);
}

#[test]
fn a_recording_ends_at_its_limit_and_is_closed_well() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    let params = RecorderParams { file_gb: 0.001, ..RecorderParams::default() };
    let mut recorder = Recorder::create(&path, &BTreeMap::new(), &params, NOON).expect("a new file");
    let payload = vec![0; 10_000];
    let fault = (0..200).find_map(|_| recorder.write(sample(&payload, None, NOON)).err()).expect("a limit");
    assert!(
        fault.is_final() && fault.to_string() == "the recording has reached its limit of 1000000 bytes",
        "{fault}"
    );
    let totals = recorder.finish().expect("it can still be closed");
    let (found, account) = samples(&path);
    assert_eq!(found.len() as u64, totals.samples);
    assert!(account.finished && found.len() == 99, "{} samples", found.len());
    assert!(std::fs::metadata(&path).expect("the file").len() <= 1_010_000);
}

#[test]
fn a_file_that_exists_is_not_overwritten() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    std::fs::write(&path, "precious").expect("room");
    let Err(fault) = Recorder::create(&path, &BTreeMap::new(), &RecorderParams::default(), NOON) else {
        panic!("the file was overwritten");
    };
    assert!(fault.is_final() && fault.to_string().contains("a.mcap"), "{fault}");
    assert_eq!(std::fs::read_to_string(&path).expect("the file"), "precious");
}

#[test]
fn what_is_not_mcap_is_not_opened() {
    let folder = Folder::new();
    let path = folder.file("a.mcap");
    assert!(matches!(Recording::open(&path), Err(ReadError::Open { .. })), "there is no file");
    std::fs::write(&path, "some text").expect("room");
    assert!(matches!(Recording::open(&path), Err(ReadError::NotMcap { .. })));
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_that_ends_the_recording() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("a full disk");
    let Err(fault) = Recorder::to(full, &BTreeMap::new(), &RecorderParams::default(), NOON) else {
        panic!("a full disk took the header");
    };
    let chain = format!("{fault}: {:?}", std::error::Error::source(&fault));
    assert!(fault.is_final() && chain.contains("StorageFull"), "{chain}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_fills_up_is_an_error_by_the_next_flush_and_ever_after() {
    // The file is replaced below the recorder: what comes after the header meets a full disk.
    let folder = Folder::new();
    let mut recorder = recorder(&folder.file("a.mcap"));
    recorder.swap_for_a_full_disk().expect("a full disk");
    let written = recorder.write(sample(b"x", None, NOON)).and_then(|()| recorder.flush(NOON + SECOND));
    let fault = written.expect_err("the disk is full");
    assert!(fault.is_final() && matches!(fault, RecordError::Write(_)), "{fault}");
    assert!(matches!(recorder.write(sample(b"x", None, NOON)), Err(RecordError::Ended)));
    assert!(matches!(recorder.gap("x", 1, NOON), Err(RecordError::Ended)));
    assert!(matches!(recorder.flush_if_due(NOON + 9 * SECOND), Err(RecordError::Ended)));
    assert!(matches!(recorder.finish(), Err(RecordError::Ended)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_samples_come_back_in_their_order(
        samples_in in proptest::collection::vec(
            (
                "[a-z/@*\u{e9}]{0,12}",
                prop_oneof![
                    Just("application/cbor;axle.Dwm.v1".to_owned()),
                    Just("application/cbor;axle.Nonsense.v1".to_owned()),
                    Just("application/json".to_owned()),
                    ".{0,8}",
                ],
                proptest::collection::vec(any::<u8>(), 0..300),
                proptest::option::of(proptest::collection::vec(any::<u8>(), 0..40)),
                any::<u64>(),
                any::<bool>(),
            ),
            0..40,
        )
    ) {
        let folder = Folder::new();
        let path = folder.file("a.mcap");
        let mut recorder = recorder(&path);
        for (key, encoding, payload, attachment, received, flush) in &samples_in {
            let attachment = attachment.as_deref();
            recorder.write(Sample { key, encoding, payload, attachment, received: *received }).expect("room");
            if *flush {
                recorder.flush(*received).expect("room");
            }
        }
        recorder.finish().expect("room");
        let (found, account) = samples(&path);
        prop_assert!(account.finished);
        prop_assert_eq!(found.len(), samples_in.len());
        for (was, is) in samples_in.iter().zip(found) {
            let Recorded { key, encoding, payload, attachment, received, .. } = is;
            prop_assert_eq!((&*key, &*encoding, &payload, &attachment, received), (&*was.0, &*was.1, &was.2, &was.3, was.4));
        }
    }

    #[test]
    fn any_bytes_are_read_without_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400), magic in any::<bool>()) {
        let folder = Folder::new();
        let path = folder.file("a.mcap");
        let head: &[u8] = if magic { mcap::MAGIC } else { b"" };
        std::fs::write(&path, [head, &bytes].concat()).expect("room");
        if let Ok(recording) = Recording::open(&path) {
            recording.for_each(drop);
        }
    }
}
