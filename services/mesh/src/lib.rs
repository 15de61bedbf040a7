//! The wires of Axle: puts a service on Zenoh.
//!
//! This crate and `axle-router` are the only ones that name Zenoh; what Zenoh does in bad times is known here and
//! hidden from everybody else. A process [`Mesh::join`]s as a client of a router, becomes visible, and then publishes
//! ([`Publisher`]), hears ([`Inbox`], [`Tap`]), asks and answers ([`Mesh::ask`], [`Mesh::serve`]) and keeps a
//! [`Beat`].
//!
//! Three rules hold everywhere. Callbacks store, beats act. Every queue has a bound and forgets the oldest. Nothing
//! awaits the network inside a beat.

pub mod bare;
mod beat;
mod call;
pub mod clock;
pub mod config;
mod counters;
mod fault;
pub mod identity;
mod inbox;
mod presence;
mod probe;
mod publish;
mod session;

pub use beat::{Alarm, Beat};
pub use call::{Asked, Retry, Server};
pub use clock::Clock;
pub use config::Link;
pub use counters::Counters;
pub use fault::Fault;
pub use identity::{Identity, IdentityFault};
pub use inbox::{Heard, Inbox, Raw, Tap};
pub use presence::{Comings, Visible};
pub use probe::{Reach, probe};
pub use publish::Publisher;
pub use session::{Mesh, Patience, Settings, random_bits};
