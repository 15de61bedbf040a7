//! What people type wrong and what strangers send: the value is named, what to do is said, and nothing breaks down.

mod bytes;
mod json;
mod line;
