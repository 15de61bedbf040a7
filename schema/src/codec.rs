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
    let Traced(message) = ciborium::de::from_reader_with_recursion_limit::<Traced<M>, _>(&mut rest, DEPTH)
        .map_err(|fault| Refusal::malformed(M::NAME, describe(&fault)))?;
    if !rest.is_empty() {
        return Err(Refusal::malformed(M::NAME, format_args!("{} bytes follow the message", rest.len())));
    }
    message.check()?;
    Ok(message)
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
        && schema != schema_of::<M>()
    {
        let got = schema.chars().take(80).collect();
        return Err(Refusal::WrongType { expected: schema_of::<M>(), got });
    }
    decode(bytes)
}

fn too_large<M: Message>(got: usize) -> Refusal {
    Refusal::TooLarge { what: format!("{} in bytes", M::NAME), got: got as u64, limit: M::LIMIT as u64 }
}

/// Says in a few words what ciborium found; its own texts are made for debugging.
fn describe(fault: &ciborium::de::Error<std::io::Error>) -> String {
    match fault {
        ciborium::de::Error::Io(_) => "the bytes end too early".to_owned(),
        ciborium::de::Error::Syntax(at) => format!("byte {at} is not valid CBOR"),
        // A hostile sender chooses this text in part: it is bounded.
        ciborium::de::Error::Semantic(_, why) => why.chars().take(300).collect(),
        ciborium::de::Error::RecursionLimitExceeded => format!("nested deeper than {DEPTH} levels"),
    }
}

/// Reads `T` and puts the path of the faulty field before the reason: `points[2].x: NaN is not a finite number`.
struct Traced<T>(T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Traced<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        serde_path_to_error::deserialize(from).map(Self).map_err(|fault| {
            let path = fault.path().to_string();
            if path == "." {
                fault.into_inner()
            } else {
                D::Error::custom(format_args!("{path}: {}", reason(&fault.into_inner())))
            }
        })
    }
}

/// The inner text of a decoder's error, without its debug wrapping.
fn reason(fault: &impl std::fmt::Display) -> String {
    let text = fault.to_string();
    match text.strip_prefix("Semantic(").and_then(|rest| rest.strip_suffix("\")")) {
        Some(inner) => inner.split_once('"').map_or(text.clone(), |(_, words)| words.replace("\\\"", "\"")),
        None => text,
    }
}
