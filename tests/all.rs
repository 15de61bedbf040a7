//! Whole-system proofs of Axle: one test binary, since each further one would link Zenoh again.

#[cfg(test)]
mod wire;
