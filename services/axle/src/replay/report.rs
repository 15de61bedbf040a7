//! What a replay found: how many outputs are the same bits, and where the others differ.

use axle_schema::codec::{Message, encode, inspect};
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// So many differences are told one by one.
const TOLD: usize = 20;

/// One field that came out otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Difference {
    /// Seconds since the beginning of the recording.
    pub(crate) time: f64,
    /// The stream: `gate/command`.
    pub(crate) stream: String,
    /// The field: `dwm.v1l`.
    pub(crate) field: String,
    /// What the recording holds.
    pub(crate) recorded: Value,
    /// What came out now.
    pub(crate) replayed: Value,
}

/// What a replay of one service found.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Report {
    /// Outputs that were compared.
    pub(crate) outputs: u64,
    /// Outputs that are the same bits.
    pub(crate) identical: u64,
    /// The first fields that differ.
    pub(crate) differences: Vec<Difference>,
    /// The largest difference of each field that is a number, by stream and field; how many outputs differ in it.
    pub(crate) fields: BTreeMap<String, (f64, u64)>,
    /// Why outputs were not judged, and how many.
    pub(crate) unjudged: BTreeMap<String, u64>,
}

impl Report {
    /// Something was not judged.
    pub(crate) fn skip(&mut self, why: impl Into<String>) {
        *self.unjudged.entry(why.into()).or_default() += 1;
    }

    /// Compares the bytes that were recorded with what is said now.
    pub(crate) fn compare<M: Message>(&mut self, time: f64, stream: &str, recorded: &[u8], now: &M) {
        match encode(now) {
            Ok(bytes) => self.compare_bytes(time, stream, recorded, &bytes),
            Err(refusal) => {
                let now = Value::String(format!("could not be said: {refusal}"));
                self.outputs += 1;
                self.tell(time, stream, "", inspect(recorded).unwrap_or_default(), now);
            }
        }
    }

    /// Something else came out: another kind of output, or none.
    pub(crate) fn compare_words(&mut self, time: f64, stream: &str, recorded: &str, now: &str) {
        self.outputs += 1;
        if recorded == now {
            self.identical += 1;
        } else {
            self.tell(time, stream, "", recorded.into(), now.into());
        }
    }

    fn compare_bytes(&mut self, time: f64, stream: &str, recorded: &[u8], now: &[u8]) {
        self.outputs += 1;
        if recorded == now {
            self.identical += 1;
            return;
        }
        let (old, new) = (inspect(recorded).unwrap_or_default(), inspect(now).unwrap_or_default());
        let mut fields = Vec::new();
        differ("", &old, &new, &mut fields);
        if fields.is_empty() {
            // The same numbers, written in another way: NaN payloads, or another writer.
            self.tell(time, stream, "(bytes)", hex(recorded), hex(now));
        }
        for (field, old, new) in fields {
            self.tell(time, stream, &field, old, new);
        }
    }

    fn tell(&mut self, time: f64, stream: &str, field: &str, recorded: Value, replayed: Value) {
        let distance = match (recorded.as_f64(), replayed.as_f64()) {
            (Some(old), Some(new)) => (old - new).abs(),
            _ => f64::INFINITY,
        };
        let entry = self.fields.entry(format!("{stream} {field}").trim_end().to_owned()).or_insert((0.0, 0));
        *entry = (entry.0.max(distance), entry.1 + 1);
        if self.differences.len() < TOLD {
            let (stream, field) = (stream.to_owned(), field.to_owned());
            self.differences.push(Difference { time, stream, field, recorded, replayed });
        }
    }

    /// Whether everything that could be judged is the same, and there was something to judge.
    pub(crate) const fn is_identical(&self) -> bool {
        self.outputs > 0 && self.identical == self.outputs
    }
}

fn hex(bytes: &[u8]) -> Value {
    use std::fmt::Write as _;
    bytes
        .iter()
        .take(64)
        .fold(String::new(), |mut text, byte| {
            // Writing to a string cannot fail.
            let _ = write!(text, "{byte:02x}");
            text
        })
        .into()
}

/// The leaves in which two values differ.
fn differ(path: &str, old: &Value, new: &Value, found: &mut Vec<(String, Value, Value)>) {
    let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match (old, new) {
        (Value::Object(old), Value::Object(new)) => {
            for (name, old) in old {
                differ(&below(name), old, new.get(name).unwrap_or(&Value::Null), found);
            }
            for (name, new) in new.iter().filter(|(name, _)| !old.contains_key(*name)) {
                found.push((below(name), Value::Null, new.clone()));
            }
        }
        (Value::Array(old), Value::Array(new)) if old.len() == new.len() => {
            for (index, (old, new)) in old.iter().zip(new).enumerate() {
                differ(&format!("{path}[{index}]"), old, new, found);
            }
        }
        // Bits are compared: 0 and -0 are two numbers.
        (Value::Number(a), Value::Number(b)) => {
            let bits = |number: &serde_json::Number| number.as_f64().map(f64::to_bits);
            if bits(a) != bits(b) {
                found.push((path.to_owned(), old.clone(), new.clone()));
            }
        }
        _ if old != new => found.push((path.to_owned(), old.clone(), new.clone())),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Dwm, MetresPerSecond, Seconds, Sides};

    fn dwm(right: f64) -> Dwm {
        let speeds = Sides::new(MetresPerSecond(0.1), MetresPerSecond(right));
        Dwm::new(speeds, speeds, Seconds(0.05)).expect("finite")
    }

    #[test]
    fn one_bit_is_found_and_named() {
        let mut report = Report::default();
        let recorded = encode(&dwm(0.3)).expect("bytes");
        report.compare(1.5, "a/b", &recorded, &dwm(0.3));
        assert!(report.is_identical());
        report.compare(2.5, "a/b", &recorded, &dwm(0.3_f64.next_up()));
        assert_eq!((report.outputs, report.identical), (2, 1));
        let first = report.differences.first().expect("a difference");
        assert_eq!((&*first.stream, first.time), ("a/b", 2.5));
        assert!(first.field.starts_with('v') && first.field.ends_with('r'), "{first:?}");
        assert!(report.fields.values().all(|(distance, count)| *distance < 1e-15 && *count == 1));
        assert!(!report.is_identical());
        report.compare(3.0, "a/b", &encode(&dwm(0.0)).expect("bytes"), &dwm(-0.0));
        assert_eq!(report.identical, 1, "0 and -0 are two numbers");
    }

    #[test]
    fn nothing_to_judge_is_not_identical() {
        let mut report = Report::default();
        report.skip("its inputs are missing");
        report.skip("its inputs are missing");
        assert!(!report.is_identical());
        assert_eq!(report.unjudged["its inputs are missing"], 2);
    }
}
