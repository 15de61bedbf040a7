//! Whole-system proofs of Axle: one test binary, since each further one would link Zenoh again.
//!
//! `cargo test -p axle --test whole` runs them all, `cargo test -p axle --test whole drive::` those of one module.

#[cfg(test)]
mod board;
#[cfg(test)]
mod calibrate;
#[cfg(test)]
mod conform;
#[cfg(test)]
mod drive;
#[cfg(test)]
mod harness;
#[cfg(test)]
mod input;
#[cfg(test)]
mod life;
#[cfg(test)]
mod mesh;
#[cfg(test)]
mod page;
#[cfg(test)]
mod record;
#[cfg(test)]
mod secure;
#[cfg(test)]
mod tidy;
#[cfg(test)]
mod wire;
