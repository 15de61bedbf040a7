//! What of a recording could not be read: how many samples, and why the first of them.

use axle_schema::{Refusal, key};
use std::collections::BTreeMap;

/// So many schemas are remembered; a recording that names more was made up, and is read more slowly.
const MOST: usize = 256;

/// Counts what is left out, so that a person learns of it in one sentence.
#[derive(Debug, Default)]
pub(crate) struct Unread {
    count: u64,
    first: Option<String>,
    /// Whether that one says that it is of a schema that this program does not read.
    other: bool,
    /// Which schemas this program reads, of those that have been asked for: they are the same few for all samples.
    known: BTreeMap<String, bool>,
}

impl Unread {
    /// A sample that was refused.
    pub(crate) fn add(&mut self, key: &str, refusal: &Refusal) {
        self.count += 1;
        if self.first.is_none() {
            self.first = Some(format!("{key}: {refusal}"));
            // What this program reads elsewhere is under a wrong key, and of no other version.
            self.other = matches!(refusal, Refusal::WrongType { got, .. } if !key::knows(got));
        }
    }
    /// Whether this program reads what a sample says that it is; counts one that is of another version of Axle.
    pub(crate) fn is_known(&mut self, key: &str, encoding: &str) -> bool {
        let got = encoding.split_once(';').map_or("", |(_, schema)| schema);
        if got.is_empty() || self.knows(got) {
            return true;
        }
        // What is under no key of the table is somebody else's.
        let Some(entry) = key::find(key) else { return true };
        let got = got.chars().take(80).collect();
        self.add(key, &Refusal::WrongType { expected: entry.carries(), got });
        false
    }
    fn knows(&mut self, schema: &str) -> bool {
        if let Some(known) = self.known.get(schema) {
            return *known;
        }
        let known = key::knows(schema);
        if self.known.len() < MOST {
            self.known.insert(schema.to_owned(), known);
        }
        known
    }
    /// The sentence; none when everything was read.
    pub(crate) fn words(&self) -> Option<String> {
        let first = self.first.as_ref()?;
        let hint = if self.other {
            "; it was recorded by another version of Axle, and that one reads it (`axle record info` names all types)"
        } else {
            ""
        };
        Some(format!("{} samples could not be read and are left out, the first of {first}{hint}", self.count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_of_another_schema_is_counted_and_named() {
        let mut unread = Unread::default();
        let pose = "axle/r1/navigator/pose";
        for encoding in ["", "application/cbor", "application/cbor;axle.NavigatorData.v1"] {
            assert!(unread.is_known(pose, encoding), "{encoding:?}");
        }
        assert!(
            unread.is_known("somebody/elses/key", "application/cbor;theirs.v7") && unread.words().is_none()
        );
        assert!(!unread.is_known(pose, "application/cbor;axle.NavigatorData.v0"));
        assert!(!unread.is_known(pose, "application/cbor;axle.Odometry.v1"));
        let words = unread.words().expect("words");
        for part in ["2 samples", pose, "axle.NavigatorData.v1", "axle.NavigatorData.v0", "another version"] {
            assert!(words.contains(part), "{part:?} is missing in {words}");
        }
        let mut misplaced = Unread::default();
        let (expected, got) = ("axle.NavigatorData.v1".into(), "axle.Dwm.v1".into());
        misplaced.add(pose, &Refusal::WrongType { expected, got });
        assert!(!misplaced.words().expect("words").contains("another version"), "{misplaced:?}");
    }
}
