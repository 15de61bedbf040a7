//! A message as a line: JSON for programs, and a short form for people.

use axle_mesh::Raw;
use axle_schema::meta::Meta;
use axle_schema::{codec, key};
use serde::Serialize;
use serde_json::value::RawValue;

/// A message for programs. Its value is copied as it was decoded: a tree of it would cost more than all the rest.
#[derive(Serialize)]
struct Line<'a> {
    key: &'a str,
    r#type: &'a str,
    /// Seconds since 1970.
    received: f64,
    /// Of the payload.
    bytes: usize,
    meta: Option<Meta>,
    value: Option<Box<RawValue>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<String>,
}

/// One message as a line.
pub(super) fn line(raw: &Raw, json: bool) -> serde_json::Result<String> {
    if json {
        let (value, problem) = match text(raw) {
            Ok(value) => (Some(RawValue::from_string(value)?), None),
            Err(problem) => (None, Some(problem)),
        };
        #[allow(clippy::cast_precision_loss, reason = "microseconds are enough for a line of text")]
        let received = raw.received as f64 / 1e9;
        return serde_json::to_string(&Line {
            key: &raw.key,
            r#type: schema(raw),
            received,
            bytes: raw.payload.len(),
            meta: raw.meta(),
            value,
            problem,
        });
    }
    Ok(match read(raw) {
        Ok(value) => format!("{} {}", raw.key, brief(&value)),
        Err(problem) => format!("{} ({} bytes, {}) {problem}", raw.key, raw.payload.len(), schema(raw)),
    })
}

/// Decodes a sample by its schema.
pub(super) fn read(raw: &Raw) -> Result<serde_json::Value, String> {
    serde_json::from_str(&text(raw)?).map_err(|fault| fault.to_string())
}

/// A sample as JSON; what Axle does not know is shown as what it says of itself.
fn text(raw: &Raw) -> Result<String, String> {
    if raw.deletes {
        return Err("deleted".into());
    }
    let read = key::to_json(&raw.key, &raw.encoding, &raw.payload);
    match read {
        Err(axle_schema::Refusal::Unknown { .. }) => {
            codec::inspect(&raw.payload).map(|value| value.to_string()).map_err(|refusal| refusal.to_string())
        }
        other => other.map_err(|refusal| refusal.to_string()),
    }
}

fn schema(raw: &Raw) -> &str {
    raw.encoding.split_once(';').map_or(&*raw.encoding, |(_, schema)| schema)
}

/// The value in one line for people: floats are cut to what an eye takes in, long lists to their length.
pub(super) fn brief(value: &serde_json::Value) -> String {
    use serde_json::Value;
    match value {
        Value::Number(number) if number.is_f64() => {
            let number = number.as_f64().unwrap_or_default();
            if number.abs() >= 1e-3 || number.abs() < f64::MIN_POSITIVE {
                let text = format!("{number:.4}");
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            } else {
                format!("{number:.2e}")
            }
        }
        Value::Array(items) if items.len() > 4 => format!("[… {} items]", items.len()),
        Value::Array(items) => format!("[{}]", items.iter().map(brief).collect::<Vec<_>>().join(", ")),
        Value::Object(fields) => {
            let fields: Vec<_> =
                fields.iter().map(|(name, value)| format!("{name}: {}", brief(value))).collect();
            format!("{{{}}}", fields.join(", "))
        }
        other => other.to_string(),
    }
}
