//! Bytes on the wire: CBOR maps with text keys, decoded totally.
//!
//! Decoding is total: whatever bytes come, the answer is a message that passed its own check, or a typed [`Refusal`]
//! that names the field. In this order: size, depth, types and finite numbers, trailing bytes, ranges. Nothing here
//! panics, and nothing allocates more than the size limit suggests.

use crate::Refusal;
use serde::de::{DeserializeOwned, Deserializer, Error as _};
use serde::{Deserialize, Serialize};

/// How deep lists and maps may be nested in a message; the deepest of Axle's own uses six levels.
pub const DEPTH: usize = 16;

/// A datum that crosses a process border.
pub trait Message: Serialize + DeserializeOwned + Send + 'static {
    /// The name on the wire, for example `Dwm`; the encoding is `application/cbor;axle.Dwm.v1`.
    const NAME: &'static str;
    /// Grows when old readers can no longer understand new bytes; new optional keys do not count.
    const VERSION: u8 = 1;
    /// The most bytes an encoded message may have.
    const LIMIT: usize = 4096;

    /// Checks what types alone cannot: ranges, lengths of lists.
    ///
    /// # Errors
    /// A [`Refusal`] that names the field and its value.
    fn check(&self) -> Result<(), Refusal> {
        Ok(())
    }
}

/// The schema part of the encoding of `M`: `axle.Dwm.v1`.
#[must_use]
pub fn schema_of<M: Message>() -> String {
    format!("axle.{}.v{}", M::NAME, M::VERSION)
}

/// The whole encoding of `M`: `application/cbor;axle.Dwm.v1`.
#[must_use]
pub fn encoding_of<M: Message>() -> String {
    format!("application/cbor;{}", schema_of::<M>())
}

/// Encodes a message.
///
/// # Errors
/// Refuses a message that fails its own check, holds a number that is not finite, or is larger than its limit: what a
/// reader would refuse is not sent.
pub fn encode<M: Message>(message: &M) -> Result<Vec<u8>, Refusal> {
    message.check()?;
    let mut bytes = Vec::with_capacity(128);
    ciborium::into_writer(message, &mut bytes).map_err(|fault| Refusal::malformed(M::NAME, fault))?;
    if bytes.len() > M::LIMIT {
        return Err(too_large::<M>(bytes.len()));
    }
    Ok(bytes)
}

/// Decodes a message.
///
/// # Errors
/// A [`Refusal`] for bytes that are too many, too deep, not CBOR, of another shape, not finite, followed by more
/// bytes, or out of range.
pub fn decode<M: Message>(bytes: &[u8]) -> Result<M, Refusal> {
    if bytes.len() > M::LIMIT {
        return Err(too_large::<M>(bytes.len()));
    }
    let mut rest = bytes;
    // Keeping track of the path costs as much as reading: only bytes that are refused are read again with it.
    let message: M = match ciborium::de::from_reader_with_recursion_limit(&mut rest, DEPTH) {
        Ok(message) => message,
        Err(fault) => return Err(explain::<M>(bytes, &fault)),
    };
    if !rest.is_empty() {
        return Err(Refusal::malformed(M::NAME, format_args!("{} bytes follow the message", rest.len())));
    }
    message.check()?;
    Ok(message)
}

/// Says which field of refused bytes is at fault.
fn explain<M: Message>(bytes: &[u8], fault: &ciborium::de::Error<std::io::Error>) -> Refusal {
    let traced = ciborium::de::from_reader_with_recursion_limit::<Traced<M>, _>(bytes, DEPTH);
    Refusal::malformed(M::NAME, describe(traced.as_ref().err().unwrap_or(fault)))
}

/// Decodes a sample whose encoding is known: as [`decode`], and refuses a sample that says it is something else.
///
/// Plain clients may leave the encoding out; only one that names another Axle message is refused.
///
/// # Errors
/// As [`decode`], and [`Refusal::WrongType`].
pub fn decode_as<M: Message>(encoding: &str, bytes: &[u8]) -> Result<M, Refusal> {
    if let Some((_, schema)) = encoding.split_once(';')
        && !schema.is_empty()
        && !names::<M>(schema)
    {
        return Err(Refusal::WrongType { expected: schema_of::<M>(), got: shown(schema, 80) });
    }
    decode(bytes)
}

/// Whether a schema is the one of `M`; without writing that down, since it is asked for every message.
fn names<M: Message>(schema: &str) -> bool {
    let version =
        schema.strip_prefix("axle.").and_then(|name| name.strip_prefix(M::NAME)?.strip_prefix(".v"));
    version.is_some_and(|version| !version.starts_with(['+', '0']) && version.parse() == Ok(M::VERSION))
}

/// Shows bytes of a message that Axle does not know, by what they say of themselves: CBOR as JSON.
///
/// For debugging tools only; services decode what they know.
///
/// # Errors
/// Refuses more than 1 MiB, deep nesting, and what is not CBOR.
pub fn inspect(bytes: &[u8]) -> Result<serde_json::Value, Refusal> {
    const LIMIT: usize = 1024 * 1024;
    if bytes.len() > LIMIT {
        let (got, limit) = (bytes.len() as u64, LIMIT as u64);
        return Err(Refusal::TooLarge { what: "unknown message in bytes".into(), got, limit });
    }
    ciborium::de::from_reader_with_recursion_limit(bytes, DEPTH)
        .map_err(|fault| Refusal::malformed("unknown message", describe(&fault)))
}

fn too_large<M: Message>(got: usize) -> Refusal {
    Refusal::TooLarge { what: format!("{} in bytes", M::NAME), got: got as u64, limit: M::LIMIT as u64 }
}

/// Says in a few words what ciborium found; its own texts are made for debugging.
fn describe(fault: &ciborium::de::Error<std::io::Error>) -> String {
    match fault {
        ciborium::de::Error::Io(_) => ENDS_EARLY.to_owned(),
        ciborium::de::Error::Syntax(at) => format!("byte {at} is not valid CBOR"),
        ciborium::de::Error::Semantic(_, why) => shown(why, 300),
        ciborium::de::Error::RecursionLimitExceeded => format!("nested deeper than {DEPTH} levels"),
    }
}

const ENDS_EARLY: &str = "the bytes end too early";

/// The beginning of a text that a hostile sender chose in part: bounded, and without what a terminal would obey.
fn shown(text: &str, most: usize) -> String {
    text.chars().take(most).map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

/// Reads a `T`, forgets it, and puts the path of the faulty field before the reason: `points[2].x: NaN is not a finite number`.
struct Traced<T>(std::marker::PhantomData<T>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Traced<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        serde_path_to_error::deserialize(from).map(|_: T| Self(std::marker::PhantomData)).map_err(|fault| {
            let path = fault.path().to_string();
            if path == "." {
                fault.into_inner()
            } else {
                // A key that cannot be read has no name.
                let path =
                    path.strip_suffix('?').map_or_else(|| path.clone(), |above| format!("{above}<key>"));
                D::Error::custom(format_args!("{path}: {}", reason(&fault.into_inner())))
            }
        })
    }
}

/// The inner text of a decoder's error, without its debug wrapping.
fn reason(fault: &impl std::fmt::Display) -> String {
    let text = fault.to_string();
    // Inside a field the decoder's error is known by its text alone; these are ciborium's four kinds.
    if text.starts_with("Io(") {
        ENDS_EARLY.to_owned()
    } else if text == "RecursionLimitExceeded" {
        format!("nested deeper than {DEPTH} levels")
    } else if let Some(at) = text.strip_prefix("Syntax(").and_then(|rest| rest.strip_suffix(')')) {
        format!("byte {at} is not valid CBOR")
    } else if let Some(inner) = text.strip_prefix("Semantic(").and_then(|rest| rest.strip_suffix("\")")) {
        let words = inner.split_once('"').map_or(inner, |(_, words)| words);
        words.replace("\\\"", "\"").replace("type: Option value", "type: null")
    } else {
        text
    }
}
